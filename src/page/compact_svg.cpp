#include "compact_svg.hpp"

#include <cctype>
#include <cstdio>
#include <utility>

#include <fmt/format.h>

#include "palette.hpp"

namespace heft::page {
namespace {

/// rgb(1, 0, index) becomes var(--name,#light); black is ink.
std::string with_variables(const std::string& svg) {
  std::string out;
  out.reserve(svg.size());
  std::size_t from = 0;
  for (std::size_t at = svg.find("rgb("); at != std::string::npos; at = svg.find("rgb(", from)) {
    const std::size_t close = svg.find(')', at);
    if (close == std::string::npos) break;
    int r = -1, g = -1, b = -1;
    const bool parsed = std::sscanf(svg.c_str() + at, "rgb(%d,%d,%d)", &r, &g, &b) == 3;
    out.append(svg, from, at - from);
    if (parsed && r == 1 && g == 0 && b >= 0 && static_cast<std::size_t>(b) < kPalette.size()) {
      const Colour& colour = kPalette[static_cast<std::size_t>(b)];
      out += fmt::format("var({},{})", colour.variable, colour.light);
    } else {
      out.append(svg, at, close + 1 - at);
    }
    from = close + 1;
  }
  out.append(svg, from);
  return out;
}

/// Value of an attribute `name='...'` or `name="..."` in a tag.
std::string attribute(const std::string& tag, const std::string& name) {
  const std::size_t at = tag.find(' ' + name + '=');
  if (at == std::string::npos) return {};
  const char mark = tag[at + name.size() + 2];
  const std::size_t begin = at + name.size() + 3;
  const std::size_t end = tag.find(mark, begin);
  return end == std::string::npos ? std::string{} : tag.substr(begin, end - begin);
}

/// One decimal of a pixel is enough for path data.
std::string with_short_numbers(const std::string& line) {
  std::string out;
  out.reserve(line.size());
  for (std::size_t k = 0; k < line.size(); ++k) {
    out += line[k];
    const bool point = line[k] == '.' && k + 2 < line.size() &&
                       std::isdigit(static_cast<unsigned char>(line[k + 1])) &&
                       std::isdigit(static_cast<unsigned char>(line[k + 2]));
    if (point) {
      out += line[k + 1];
      k += 2;
    }
  }
  return out;
}

int count(const std::string& text, const std::string& what) {
  int number = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++number;
  return number;
}

/// The points of one colour and size that follow one another, as one path.
class PointPath {
 public:
  explicit PointPath(std::string& out) : out_(out) {}
  /// @param line  gnuplot's element of one point
  void add(const std::string& line) {
    const std::string colour = attribute(line, "color");
    double x = 0, y = 0, scale = 0;
    if (std::sscanf(attribute(line, "transform").c_str(), "translate(%lf,%lf) scale(%lf)", &x, &y, &scale) !=
        3)
      return;
    const double size = scale / 1.35 * 3.6;  // 1.35 is the scale of points of size 0.3
    if (colour != colour_ || size != size_) flush();
    colour_ = colour;
    size_ = size;
    path_ += fmt::format("M{:.1f},{:.1f}h0", x, y);
  }
  void flush() {
    if (path_.empty()) return;
    out_ += fmt::format(
        "<path fill='none' stroke='{}' stroke-width='{:.1f}' stroke-linecap='round' stroke-opacity='0.75' "
        "d='{}'/>\n",
        colour_, size_, path_);
    path_.clear();
  }

 private:
  std::string& out_;
  std::string colour_, path_;
  double size_{0.0};
};

/// gnuplot's groups of one line style, of which many are empty and many go on with the style of the one before.
class StyleGroups {
 public:
  explicit StyleGroups(std::string& out) : out_(out) {}
  static bool opens(const std::string& line) { return line.rfind("<g fill=\"none\" color=", 0) == 0; }
  void open(const std::string& line) {
    if (line == closed_) {
      out_.resize(before_close_);
      start(closed_);
    } else {
      waiting_ = line;
    }
  }
  /// @return whether the line ends a group that nothing was drawn in
  bool ends_empty(const std::string& line) {
    if (line != "</g>" || waiting_.empty()) return false;
    waiting_.clear();
    return true;
  }
  /// Before a line of the drawing is written.
  void before_line() {
    if (!waiting_.empty()) {
      out_ += waiting_ + '\n';
      start(waiting_);
    }
    closed_.clear();
  }
  /// After it.
  void after_line(const std::string& line) {
    if (depth_ > 0) depth_ += count(line, "<g") - count(line, "</g>");
    if (depth_ > 0 || open_.empty()) return;
    closed_ = std::exchange(open_, {});
    before_close_ = out_.rfind("</g>");
  }

 private:
  void start(std::string& group) {
    open_ = std::exchange(group, {});
    depth_ = 1;
  }
  std::string& out_;
  std::string waiting_;          ///< has no content yet
  std::string open_;             ///< the one that is open
  int depth_{0};                 ///< of groups, from that one on
  std::string closed_;           ///< the one that ended just now,
  std::size_t before_close_{0};  ///< and where
};

}  // namespace

std::string placeholder(std::size_t entry) { return fmt::format("#0100{:02x}", entry); }

void replace_all(std::string& text, const std::string& what, const std::string& with) {
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + with.size())) {
    text.replace(at, what.size(), with);
  }
}

std::string compact_svg(const std::string& svg) {
  std::string out;
  PointPath points(out);
  StyleGroups groups(out);
  bool in_definitions = false;
  bool in_body = false;
  std::size_t from = 0;
  while (from < svg.size()) {
    std::size_t end = svg.find('\n', from);
    if (end == std::string::npos) end = svg.size();
    std::string line = svg.substr(from, end - from);
    from = end + 1;
    const std::size_t first = line.find_first_not_of(" \t");
    if (first == std::string::npos) continue;
    line.erase(0, first);
    if (!in_body) {  // the heading and <svg ...> itself are written by the caller
      in_body = line.rfind("<g id=\"gnuplot_canvas\">", 0) == 0;
      if (in_body) out += "<g>\n";
      continue;
    }
    if (line.rfind("<defs>", 0) == 0) in_definitions = true;
    if (in_definitions) {
      if (line.rfind("</defs>", 0) == 0) in_definitions = false;
      continue;
    }
    if (line == "</svg>") break;
    if (line.rfind("<use ", 0) == 0) {
      groups.before_line();
      points.add(line);
      continue;
    }
    points.flush();
    if (StyleGroups::opens(line)) {
      groups.open(line);
      continue;
    }
    if (groups.ends_empty(line)) continue;
    groups.before_line();
    // Ids of several drawings on one page would collide, and a title would show under the pointer.
    int series = 0;
    if (std::sscanf(line.c_str(), "<g id=\"gnuplot_plot_%d\"", &series) == 1)
      line = fmt::format("<g class=\"series\" data-i=\"{}\">", series - 1);
    const bool drawn = line.rfind("<path", 0) == 0 || line.rfind("<polygon", 0) == 0 || line[0] == 'L' ||
                       std::isdigit(static_cast<unsigned char>(line[0]));  // or goes on from the line before
    out += (drawn ? with_short_numbers(line) : line) + '\n';
    groups.after_line(line);
  }
  // As the fragment itself says.
  replace_all(out, " font-family=\"sans-serif\" font-size=\"12.00\" ", "");
  replace_all(out, "\"black\"", "\"var(--ink,#24292f)\"");
  replace_all(out, "'black'", "'var(--ink,#24292f)'");
  return with_variables(out);
}

}  // namespace heft::page
