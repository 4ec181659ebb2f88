#include "drawing.hpp"

#include <algorithm>
#include <cstdint>
#include <cstdio>

#include <fmt/format.h>

#include "compact_svg.hpp"
#include "gnuplot.hpp"
#include "heft/host/file.hpp"
#include "heft/page/page.hpp"
#include "palette.hpp"

namespace heft::page {
namespace {

/// Above this an SVG drawing is slower to show than a picture.
constexpr std::size_t kMaxSvgBytes = 300 * 1024;

std::string solid(std::size_t entry) { return kPalette[entry].light; }

std::string base64(const std::string& bytes) {
  static constexpr char kAlphabet[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t k = 0; k < bytes.size(); k += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - k);
    std::uint32_t word = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      word = (word << 8U) | (i < count ? static_cast<unsigned char>(bytes[k + i]) : 0U);
    }
    for (std::size_t i = 0; i < 4; ++i) {
      text += i <= count ? kAlphabet[(word >> (18U - 6U * i)) & 63U] : '=';
    }
  }
  return text;
}

/// The axes at the same place as in the drawing that the picture stands for: data and points are those of the drawing.
std::string margins(const Frame& frame, int width, int height) {
  return fmt::format(
      "set lmargin at screen {:.6f}\nset rmargin at screen {:.6f}\nset tmargin at screen {:.6f}\n"
      "set bmargin at screen {:.6f}\n",
      frame.left / width, frame.right / width, 1.0 - frame.top / height, 1.0 - frame.bottom / height);
}

std::string draw_png(int width, int height, const Script& script, const std::optional<Frame>& frame) {
  std::string commands = script(solid);
  // Margins stand in the script, before the command that draws, which is its last line.
  if (frame) {
    const std::size_t last = commands.rfind('\n', commands.size() - 2) + 1;
    commands.insert(last, margins(*frame, width, height));
  }
  const GnuplotResult result = run_gnuplot(fmt::format("set terminal pngcairo size {},{} noenhanced rounded "
                                                       "fontscale 1.6 linewidth 1.6 background '#ffffff'\n",
                                                       2 * width, 2 * height) +
                                           commands);
  return result.ok ? result.output : std::string{};
}

std::string not_drawn(const std::string& title, const std::string& reason) {
  return fmt::format("<p class=\"noplot\">{} is not drawn: {}.</p>\n",
                     title.empty() ? "The plot" : "“" + escape_html(title) + "”", escape_html(reason));
}

/// gnuplot lays out the margins itself; after drawing it knows where the axes are, on its standard error.
constexpr const char* kSayFrame =
    "print 'frame ', GPVAL_TERM_XMIN, GPVAL_TERM_XMAX, GPVAL_TERM_YMIN, GPVAL_TERM_YMAX\n";

/// What kSayFrame printed; gnuplot counts y from below.
std::optional<Frame> frame_in(const std::string& remarks, int height) {
  const std::size_t at = remarks.rfind("frame ");
  double left = 0, right = 0, low = 0, high = 0;
  if (at == std::string::npos ||
      std::sscanf(remarks.c_str() + at, "frame %lf %lf %lf %lf", &left, &right, &low, &high) != 4 ||
      !(left < right && low < high && high <= height)) {
    return std::nullopt;
  }
  return Frame{left, right, height - high, height - low};
}

}  // namespace

std::string quote(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) {
    if (c == '\'') {
      quoted += "’";
    } else {
      quoted += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
    }
  }
  return quoted + "'";
}

Drawing draw_svg(int width, int height, const Script& script) {
  const GnuplotResult result =
      run_gnuplot(fmt::format("set terminal svg size {},{} dynamic noenhanced rounded font 'sans-serif,12'\n",
                              width, height) +
                  script(placeholder) + kSayFrame);
  if (!result.ok) return {{}, result.error};
  return {compact_svg(result.output), {}, frame_in(result.remarks, height)};
}

bool is_dense(const Drawing& drawing) { return drawing.body.size() > kMaxSvgBytes; }

std::string fragment(const Drawing& drawing, const std::string& title, const std::string& label, int width,
                     int height, const Script& script, const std::string& data, const std::string& points) {
  if (!drawing.error.empty()) return not_drawn(title, drawing.error);
  std::string body = drawing.body;
  if (is_dense(drawing)) {
    const std::string png = draw_png(width, height, script, drawing.frame);
    if (png.empty()) return not_drawn(title, "gnuplot could not draw it as a picture");
    body = fmt::format(
        "<g class=\"picture\"><image width=\"{}\" height=\"{}\" href=\"data:image/png;base64,{}\"/></g>\n{}",
        width, height, base64(png), points);
  }
  return fmt::format(
      "<svg viewBox=\"0 0 {} {}\" font-size=\"12\" role=\"img\" aria-label=\"{}\"{}>\n{}</svg>\n", width,
      height, escape_html(label), data.empty() ? data : " data-plot='" + data + "'", body);
}

void write_standalone(const Drawing& drawing, const std::string& title, const std::string& legend, int width,
                      int height, const std::string& path) {
  constexpr int kHead = 44;
  host::write_file_atomically(
      path, fmt::format(
                "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" "
                "viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" font-family=\"sans-serif\" "
                "font-size=\"12\" fill=\"#24292f\">\n<rect width=\"{0}\" height=\"{1}\" fill=\"#ffffff\"/>\n"
                "<text x=\"12\" y=\"20\" font-size=\"14\" font-weight=\"bold\">{2}</text>\n{3}"
                "<g transform=\"translate(0,{4})\">\n{5}</g>\n</svg>\n",
                width, height + kHead, escape_html(title), legend, kHead, drawing.body));
}

}  // namespace heft::page
