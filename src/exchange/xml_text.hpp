/// @file
/// XML of the model files of other programs, an element a line.
#pragma once

#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/Core>

namespace heft::exchange {

/// Shortest text that reads back as the same double; -0 is 0.
inline std::string number(double value) { return fmt::format("{}", value == 0.0 ? 0.0 : value); }

/// Numbers with blanks between them.
template <typename Vector>
std::string numbers(const Vector& values) {
  std::string text;
  for (Eigen::Index k = 0; k < values.size(); ++k) text += (k > 0 ? " " : "") + number(values[k]);
  return text;
}

/// Text in an attribute.
inline std::string escaped(std::string_view text) {
  std::string safe;
  for (const char c : text) {
    switch (c) {
      case '&': safe += "&amp;"; break;
      case '<': safe += "&lt;"; break;
      case '>': safe += "&gt;"; break;
      case '"': safe += "&quot;"; break;
      default: safe += c;
    }
  }
  return safe;
}

/// Text in a comment, where two hyphens must not follow one another.
inline std::string in_comment(std::string_view text) {
  std::string safe;
  for (const char c : text) {
    if (c == '-' && !safe.empty() && safe.back() == '-') safe += ' ';
    safe += c;
  }
  return safe;
}

/// Elements written from front to back, each inside those that are open.
class XmlText {
 public:
  using Attributes = std::initializer_list<std::pair<std::string_view, std::string>>;

  void comment(std::string_view text) { line(fmt::format("<!-- {} -->", in_comment(text))); }
  /// Attributes with an empty text are left out.
  void open(std::string_view name, Attributes attributes = {}) {
    line(fmt::format("<{}{}>", name, list(attributes)));
    ++depth_;
  }
  void close(std::string_view name) {
    --depth_;
    line(fmt::format("</{}>", name));
  }
  void element(std::string_view name, Attributes attributes) {
    line(fmt::format("<{}{}/>", name, list(attributes)));
  }
  void element(std::string_view name, const std::string& text) {
    line(fmt::format("<{0}>{1}</{0}>", name, escaped(text)));
  }
  void element(std::string_view name, Attributes attributes, const std::string& text) {
    line(fmt::format("<{0}{1}>{2}</{0}>", name, list(attributes), escaped(text)));
  }
  const std::string& text() const { return text_; }

 private:
  void line(const std::string& what) { text_ += std::string(2 * depth_, ' ') + what + "\n"; }
  static std::string list(Attributes attributes) {
    std::string text;
    for (const auto& [name, value] : attributes) {
      if (!value.empty()) text += fmt::format(" {}=\"{}\"", name, escaped(value));
    }
    return text;
  }

  std::string text_;
  std::size_t depth_{0};
};

}  // namespace heft::exchange
