#include "xml_outline.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <system_error>
#include <utility>

#include <fmt/format.h>

namespace heft::urdf {
namespace {

/// Deeper nesting than any robot has; keeps a hostile file from exhausting the stack.
constexpr int kMaxDepth = 100;

/// The character of a reference by number, &#65; or &#x41;, that begins a text, and its length; 0 where there is none, or no
/// printable character of ASCII.
std::pair<char, std::size_t> numbered(std::string_view value) {
  if (!value.starts_with("&#")) return {};
  const bool hexadecimal = value.starts_with("&#x");
  const std::size_t begin = hexadecimal ? 3 : 2, end = std::min(value.find(';'), value.size());
  int code = 0;
  const auto [stop, error] =
      std::from_chars(value.data() + begin, value.data() + end, code, hexadecimal ? 16 : 10);
  if (end == value.size() || error != std::errc() || stop != value.data() + end || code < 32 || code > 126) return {};
  return {static_cast<char>(code), end + 1};
}

/// The value with XML's five named entities and printable ASCII characters by number resolved; others stay as they are.
std::string resolved(std::string_view value) {
  static constexpr std::array<std::pair<std::string_view, char>, 5> kEntities{
      {{"&amp;", '&'}, {"&lt;", '<'}, {"&gt;", '>'}, {"&quot;", '"'}, {"&apos;", '\''}}};
  std::string text;
  while (!value.empty()) {
    std::pair<char, std::size_t> next = numbered(value);
    for (const auto& [name, character] : kEntities) {
      if (value.starts_with(name)) next = {character, name.size()};
    }
    if (next.second == 0) next = {value.front(), 1};
    text += next.first;
    value.remove_prefix(next.second);
  }
  return text;
}

class Scanner {
 public:
  explicit Scanner(std::string_view text) : text_(text) {}

  XmlElement root() {
    skip_to_tag();
    if (at_end()) throw XmlOutlineError(1, "found no XML element");
    XmlElement element = read_element(0);
    skip_to_tag();
    if (!at_end()) throw XmlOutlineError(line_, fmt::format("found more after the end of <{}>", element.tag));
    return element;
  }

 private:
  bool at_end() const { return at_ >= text_.size(); }
  bool looking_at(std::string_view what) const { return text_.substr(at_, what.size()) == what; }

  void advance(std::size_t count) {
    const std::size_t stop = std::min(at_ + count, text_.size());
    line_ += static_cast<std::size_t>(std::count(text_.begin() + static_cast<std::ptrdiff_t>(at_),
                                                 text_.begin() + static_cast<std::ptrdiff_t>(stop), '\n'));
    at_ = stop;
  }

  void skip_past(std::string_view what, std::string_view kind) {
    const std::size_t begin_line = line_;
    const std::size_t found = text_.find(what, at_);
    if (found == std::string_view::npos)
      throw XmlOutlineError(begin_line, fmt::format("found a {} that does not end", kind));
    advance(found + what.size() - at_);
  }

  /// `<!DOCTYPE robot [ <!ENTITY a "b>c"> ]>`: the '>' outside of brackets and quotes ends it.
  void skip_document_type() {
    const std::size_t begin_line = line_;
    int depth = 0;
    for (std::size_t at = at_ + 1; at < text_.size(); ++at) {
      const char c = text_[at];
      if (c == '"' || c == '\'') {
        at = std::min(text_.find(c, at + 1), text_.size());
      } else if (text_.substr(at, 4) == "<!--") {
        at = std::min(text_.find("-->", at), text_.size() - 1);
      } else if (c == '[' || c == ']') {
        depth += c == '[' ? 1 : -1;
      } else if (c == '>' && depth == 0) {
        advance(at + 1 - at_);
        return;
      }
    }
    throw XmlOutlineError(begin_line, "found a declaration that does not end");
  }

  void skip_space() {
    std::size_t count = 0;
    while (at_ + count < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_ + count])))
      ++count;
    advance(count);
  }

  /// Moves to the next tag that opens or closes an element.
  void skip_to_tag() {
    for (;;) {
      const std::size_t found = text_.find('<', at_);
      advance((found == std::string_view::npos ? text_.size() : found) - at_);
      if (at_end()) return;
      if (looking_at("<!--")) {
        skip_past("-->", "comment");
      } else if (looking_at("<![CDATA[")) {
        skip_past("]]>", "CDATA section");
      } else if (looking_at("<?")) {
        skip_past("?>", "declaration");
      } else if (looking_at("<!")) {
        skip_document_type();
      } else {
        return;
      }
    }
  }

  std::string read_name() {
    std::size_t stop = at_;
    while (stop < text_.size() && !std::isspace(static_cast<unsigned char>(text_[stop])) &&
           std::string_view("<>/=\"'").find(text_[stop]) == std::string_view::npos) {
      ++stop;
    }
    std::string name(text_.substr(at_, stop - at_));
    advance(stop - at_);
    return name;
  }

  void read_attribute(XmlElement& element) {
    const std::size_t line = line_;
    std::string name = read_name();
    skip_space();
    if (name.empty() || !looking_at("="))
      throw XmlOutlineError(line, fmt::format("found a broken attribute in <{}>", element.tag));
    advance(1);
    skip_space();
    const char quote = at_end() ? '\0' : text_[at_];
    if (quote != '"' && quote != '\'') {
      throw XmlOutlineError(line,
                            fmt::format("found no quotes around the value of {} in <{}>", name, element.tag));
    }
    advance(1);
    const std::size_t stop = text_.find(quote, at_);
    if (stop == std::string_view::npos) {
      throw XmlOutlineError(line, fmt::format("found no closing quote for {} in <{}>", name, element.tag));
    }
    element.attributes.emplace_back(std::move(name), resolved(text_.substr(at_, stop - at_)));
    element.attribute_places.emplace_back(at_, stop);
    advance(stop + 1 - at_);
  }

  XmlElement read_element(int depth) {
    if (depth > kMaxDepth) throw XmlOutlineError(line_, "found elements nested too deeply");
    XmlElement element;
    element.line = line_;
    element.begin = at_;
    if (looking_at("</")) throw XmlOutlineError(line_, "found a closing tag that closes nothing");
    advance(1);
    element.tag = read_name();
    if (element.tag.empty()) throw XmlOutlineError(element.line, "found '<' without an element name");
    for (;;) {
      skip_space();
      if (at_end())
        throw XmlOutlineError(element.line, fmt::format("found <{}> that does not end", element.tag));
      if (looking_at("/>")) {
        advance(2);
        element.open_end = element.end = at_;
        return element;
      }
      if (looking_at(">")) {
        advance(1);
        element.open_end = at_;
        break;
      }
      read_attribute(element);
    }
    for (;;) {
      skip_to_tag();
      if (at_end())
        throw XmlOutlineError(element.line, fmt::format("found <{}> that is never closed", element.tag));
      if (!looking_at("</")) {
        element.children.push_back(read_element(depth + 1));
        continue;
      }
      const std::size_t line = line_;
      advance(2);
      const std::string closed = read_name();
      skip_space();
      if (closed != element.tag || !looking_at(">")) {
        throw XmlOutlineError(line, fmt::format("found </{}> where </{}> is due (opened in line {})", closed,
                                                element.tag, element.line));
      }
      advance(1);
      element.end = at_;
      return element;
    }
  }

  std::string_view text_;
  std::size_t at_{0};
  std::size_t line_{1};
};

}  // namespace

const std::string* XmlElement::attribute(std::string_view name) const {
  for (const auto& [key, value] : attributes) {
    if (key == name) return &value;
  }
  return nullptr;
}

const XmlElement* XmlElement::child(std::string_view child_tag) const {
  for (const XmlElement& element : children) {
    if (element.tag == child_tag) return &element;
  }
  return nullptr;
}

XmlElement outline_xml(std::string_view text) { return Scanner(text).root(); }

}  // namespace heft::urdf
