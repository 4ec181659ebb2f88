#include "heft/page/page.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "data_file.hpp"
#include "heft/host/file.hpp"
#include "page_script.hpp"
#include "palette.hpp"

namespace heft::page {
namespace {

constexpr const char* kStyle = R"css(
*{box-sizing:border-box}
body{margin:0;background:var(--page);color:var(--ink);font:16px/1.55 system-ui,-apple-system,"Segoe UI",Roboto,"Noto Sans",sans-serif;-webkit-text-size-adjust:100%}
main{max-width:1000px;margin:0 auto;padding:2.2rem 1.2rem 3rem}
h1{font-size:1.9rem;line-height:1.2;margin:0 0 .2rem;letter-spacing:-.01em}
h2{font-size:1.25rem;margin:2.4rem 0 .6rem;padding-top:.9rem;border-top:1px solid var(--grid)}
p{margin:.6rem 0;max-width:46rem}
.subtitle{color:var(--mark);margin:0 0 1rem}
.verdict{font-size:1.15rem;line-height:1.45;margin:1.1rem 0;padding:.8rem 1.1rem;border-left:5px solid var(--tone);background:var(--card);border-radius:0 6px 6px 0;max-width:none}
.good{--tone:var(--c-green)}.neutral{--tone:var(--c-blue)}.doubtful{--tone:var(--c-orange)}.bad{--tone:var(--bad)}
.verdict ul{margin:.5rem 0 0;padding-left:1.2rem;font-size:1rem}
.verdict li{margin:.25rem 0;overflow-wrap:anywhere}
.verdict strong{display:block;margin-top:.6rem;font-size:1rem}
.facts{display:grid;grid-template-columns:repeat(auto-fit,minmax(11rem,1fr));gap:.8rem;margin:1.2rem 0}
.fact{background:var(--card);border-radius:8px;padding:.7rem 1rem .8rem}
.fact b{display:block;font-size:1.55rem;line-height:1.25;font-weight:650;font-variant-numeric:tabular-nums}
.fact span{display:block;color:var(--mark);font-size:.86rem;line-height:1.35}
.note{font-size:.92rem;color:var(--mark);border-left:3px solid var(--grid);padding-left:.9rem}
pre{background:var(--card);border-radius:6px;padding:.8rem 1rem;overflow-x:auto;font:13px/1.5 ui-monospace,"DejaVu Sans Mono",Menlo,monospace}
.scroll{overflow-x:auto;margin:.9rem 0}
table{border-collapse:collapse;font-size:.94rem;font-variant-numeric:tabular-nums}
.caption{color:var(--mark);font-size:.9rem;margin:.9rem 0 0}.caption+.scroll{margin-top:.4rem}
th,td{padding:.32rem .9rem .32rem 0;text-align:left;vertical-align:top;border-bottom:1px solid var(--grid)}
th{font-weight:600;border-bottom:2px solid var(--mark)}
td.n,th.n{text-align:right}
td.n{white-space:nowrap}
tbody tr:hover{background:var(--card)}
figure{margin:1.1rem 0}
figcaption{font-weight:600;margin-bottom:.15rem}
figure>svg{display:block;width:100%;height:auto;overflow:visible}
svg text{font-family:system-ui,-apple-system,"Segoe UI",Roboto,"Noto Sans",sans-serif}
.legend{display:flex;flex-wrap:wrap;gap:.2rem 1.2rem;font-size:.9rem;color:var(--mark);margin-bottom:.2rem}
.key{display:inline-flex;align-items:center;gap:.45rem}
.key i{display:inline-block;width:1.4rem;border-top:3px solid var(--k)}
.key i.dash{border-top-style:dashed}
.key i.dot{width:.55rem;height:.55rem;border:0;border-radius:50%;background:var(--k)}
.key i.band{height:.7rem;border:0;background:var(--k);opacity:.35}
.key i.bar{width:.8rem;height:.7rem;border:0;background:var(--k)}
.grid{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,26rem),1fr));gap:.4rem 1.6rem}
.grid figure{margin:.5rem 0}
.grid figcaption{font-size:.92rem}
.noplot{color:var(--mark);border:1px dashed var(--mark);border-radius:6px;padding:.9rem 1rem;max-width:none}
footer p{margin:.15rem 0;max-width:none;overflow-wrap:anywhere}
footer{margin-top:3rem;padding-top:.8rem;border-top:1px solid var(--grid);color:var(--mark);font-size:.85rem}
.live{position:relative}
.live>svg{touch-action:pan-y;user-select:none}.live>svg:focus:not(:focus-visible){outline:none}
.readout{position:absolute;transform:translateY(-100%);z-index:1;pointer-events:none;padding:.3rem .6rem;background:var(--page);border:1px solid var(--mark);border-radius:4px;font-size:.85rem;line-height:1.4;white-space:nowrap;font-variant-numeric:tabular-nums}
.cross{pointer-events:none}
.zoomed>g:not(.axes):not(.cross){display:none}
.window{overflow:hidden}.window *{vector-effect:non-scaling-stroke}
.sort{font:inherit;color:inherit;background:none;border:0;padding:0;margin:0;text-align:inherit;cursor:pointer}
[aria-sort=ascending]>.sort::after{content:" ▲"}[aria-sort=descending]>.sort::after{content:" ▼"}
.download{font-size:.9rem}.download a{color:var(--c-blue)}
@media print{.controls,.cross{display:none}body{font-size:11pt}main{max-width:none;padding:0}figure,.fact,.verdict,tr{break-inside:avoid}h2{break-after:avoid}.scroll{overflow:visible}.grid{grid-template-columns:1fr 1fr}}
)css";

/// The reader's program itself refuses whatever is outside the page.
constexpr const char* kPolicy =
    "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'; img-src data:\">\n";

/// CSS variables: light for paper and by default, dark where the reader's screen asks for it.
std::string variables() {
  // Red is for verdicts alone: no curve is bad.
  std::string light = "--page:#ffffff;--card:#f3f5f7;--bad:#c62828";
  std::string dark = "--page:#0f1419;--card:#1a2027;--bad:#ff6b60";
  for (const Colour& colour : kPalette) {
    light += fmt::format(";{}:{}", colour.variable, colour.light);
    dark += fmt::format(";{}:{}", colour.variable, colour.dark);
  }
  return fmt::format(
      ":root{{color-scheme:light dark;{}}}\n@media screen and (prefers-color-scheme:dark){{:root{{{}}}}}\n",
      light, dark);
}

std::string legend_row(const PlotSpec& spec) {
  const std::string legend = legend_html(spec);
  return legend.empty() ? legend : fmt::format("<div class=\"legend\">{}</div>", legend);
}

const char* class_of(Tone tone) {
  switch (tone) {
    case Tone::kGood: return "good";
    case Tone::kNeutral: return "neutral";
    case Tone::kDoubtful: return "doubtful";
    case Tone::kBad: break;
  }
  return "bad";
}

std::string caption(const std::string& title) {
  return title.empty() ? title : fmt::format("<figcaption>{}</figcaption>", escape_html(title));
}

}  // namespace

std::string escape_html(const std::string& text) {
  std::string escaped;
  escaped.reserve(text.size());
  for (const char c : text) {
    switch (c) {
      case '&': escaped += "&amp;"; break;
      case '<': escaped += "&lt;"; break;
      case '>': escaped += "&gt;"; break;
      case '"': escaped += "&quot;"; break;
      case '\'': escaped += "&#39;"; break;
      default: escaped += c;
    }
  }
  return escaped;
}

Page::Page(std::string title, std::string subtitle)
    : title_(std::move(title)), subtitle_(std::move(subtitle)) {}

Tone tone_of(host::Verdict verdict) {
  switch (verdict) {
    case host::Verdict::kGood: return Tone::kGood;
    case host::Verdict::kDoubtful: return Tone::kDoubtful;
    case host::Verdict::kBad: break;
  }
  return Tone::kBad;
}

Page& Page::verdict(const std::string& sentence, Tone tone) {
  parts_.push_back({fmt::format("<p class=\"verdict {}\">{}</p>\n", class_of(tone), escape_html(sentence))});
  return *this;
}

Page& Page::verdict(const std::string& sentence, const host::Judgement& judgement) {
  const Tone tone = tone_of(judgement.verdict);
  if (judgement.reasons.empty()) return verdict(sentence, tone);
  // Some readers do not see colours, and some printers do not print them.
  std::string html = fmt::format("<div class=\"verdict {}\">{}<strong>{}</strong><ul>\n", class_of(tone),
                                 escape_html(sentence),
                                 judgement.usable() ? "Doubtful, because:" : "Do not use this result:");
  for (const std::string& reason : judgement.reasons)
    html += fmt::format("<li>{}</li>\n", escape_html(reason));
  parts_.push_back({html + "</ul></div>\n"});
  return *this;
}

Page& Page::footer(const std::string& line) {
  footer_.push_back(line);
  return *this;
}

Page& Page::facts(const std::vector<Fact>& facts) {
  std::string html = "<div class=\"facts\">\n";
  for (const Fact& fact : facts) {
    html += fmt::format("<div class=\"fact\"><span>{}</span><b>{}</b>", escape_html(fact.label),
                        escape_html(fact.value));
    if (!fact.note.empty()) html += fmt::format("<span>{}</span>", escape_html(fact.note));
    html += "</div>\n";
  }
  html += "</div>\n";
  parts_.push_back({std::move(html)});
  return *this;
}

Page& Page::heading(const std::string& text) {
  parts_.push_back({fmt::format("<h2>{}</h2>\n", escape_html(text))});
  return *this;
}

Page& Page::paragraph(const std::string& text) {
  parts_.push_back({fmt::format("<p>{}</p>\n", escape_html(text))});
  return *this;
}

Page& Page::note(const std::string& text) {
  parts_.push_back({fmt::format("<p class=\"note\">{}</p>\n", escape_html(text))});
  return *this;
}

Page& Page::preformatted(const std::string& text) {
  parts_.push_back({fmt::format("<pre>{}</pre>\n", escape_html(text))});
  return *this;
}

Page& Page::table(const Table& table, const std::string& caption_text) {
  std::string html;
  if (!caption_text.empty()) html += fmt::format("<p class=\"caption\">{}</p>", escape_html(caption_text));
  html += "<div class=\"scroll\"><table>";
  const auto cells = [&](const std::vector<std::string>& row, const char* tag) {
    std::string row_html = "<tr>";
    for (std::size_t c = 0; c < row.size(); ++c) {
      row_html += fmt::format("<{0}{1}>{2}</{0}>", tag, table.is_numeric(c) ? " class=\"n\"" : "",
                              escape_html(row[c]));
    }
    return row_html + "</tr>\n";
  };
  html += "<thead>" + cells(table.headers(), "th") + "</thead>\n<tbody>\n";
  for (const auto& row : table.rows()) html += cells(row, "td");
  html += "</tbody></table></div>\n";
  parts_.push_back({std::move(html)});
  return *this;
}

void Page::add_figure(PlotSpec spec, bool with_legend) {
  parts_.push_back({"<figure>" + caption(spec.title) + (with_legend ? legend_row(spec) : "") + "\n"});
  parts_.push_back({{}, [spec = std::move(spec)] { return render_plot(spec); }});
  parts_.push_back({"</figure>\n"});
}

Page& Page::plot(const PlotSpec& spec) {
  add_figure(spec, true);
  return *this;
}

Page& Page::plot(const MapSpec& spec) {
  parts_.push_back({"<figure>" + caption(spec.title) + "\n"});
  parts_.push_back({{}, [spec] { return render_plot(spec); }});
  parts_.push_back({"</figure>\n"});
  return *this;
}

Page& Page::plots(const std::string& title, std::vector<PlotSpec> specs) {
  if (specs.empty()) return *this;
  parts_.push_back({"<figure>" + caption(title) + legend_row(specs.front()) + "\n<div class=\"grid\">\n"});
  for (PlotSpec& spec : specs) {
    spec.width = std::min(spec.width, 460);
    spec.height = std::min(spec.height, 210);
    add_figure(std::move(spec), false);
  }
  parts_.push_back({"</div></figure>\n"});
  return *this;
}

Page& Page::file(const DataFile& file) {
  if (std::string html = data_file_html(file); !html.empty()) parts_.push_back({std::move(html)});
  return *this;
}

std::string Page::html() const {
  std::string page = "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n";
  page += kPolicy;
  page += "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n";
  page += fmt::format("<title>{}</title>\n<style>\n{}{}</style>\n</head>\n<body>\n<main>\n",
                      escape_html(title_), variables(), kStyle);
  page += fmt::format("<h1>{}</h1>\n", escape_html(title_));
  if (!subtitle_.empty()) page += fmt::format("<p class=\"subtitle\">{}</p>\n", escape_html(subtitle_));
  for (const Part& part : parts_) page += part.drawing ? part.drawing() : part.html;
  page += "<footer>\n";
  for (const std::string& line : footer_) page += fmt::format("<p>{}</p>\n", escape_html(line));
  page += "<p>Made by heft " HEFT_VERSION
          ". Units are SI unless a label says otherwise.</p>\n</footer>\n</main>\n";
  return page + script_html(page) + "</body>\n</html>\n";
}

void Page::write(const std::string& path) const { host::write_file_atomically(path, html()); }

}  // namespace heft::page
