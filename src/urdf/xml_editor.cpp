#include "xml_editor.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

namespace heft::urdf {

void XmlEditor::replace(std::size_t begin, std::size_t end, std::string content) {
  if (std::string_view(text_).substr(begin, end - begin) != content)
    edits_.push_back({begin, end, std::move(content)});
}

void XmlEditor::set_attribute(const XmlElement& element, std::string_view name, const std::string& value) {
  std::size_t behind = element.begin + 1 + element.tag.size();
  for (std::size_t k = 0; k < element.attributes.size(); ++k) {
    const auto& [begin, end] = element.attribute_places[k];
    if (element.attributes[k].first == name) {
      replace(begin, end, value);
      return;
    }
    behind = end + 1;
  }
  replace(behind, behind, fmt::format(" {}=\"{}\"", name, value));
}

void XmlEditor::insert(const XmlElement& parent, const XmlElement* after, const std::vector<Line>& lines) {
  const XmlElement* sibling = after == nullptr && !parent.children.empty() ? &parent.children.front() : after;
  const bool on_one_line = sibling != nullptr && !indent(sibling->begin);
  const std::string outer = indent(parent.begin).value_or("");
  const std::string inner = sibling != nullptr ? indent(sibling->begin).value_or("") : outer + indent_step();
  std::string block;
  for (const Line& line : lines) {
    if (!on_one_line) {
      block += newline_ + inner;
      for (int k = 0; k < line.depth; ++k) block += indent_step();
    }
    block += line.text;
  }
  if (parent.open_end == parent.end) {  // <link name="a"/>
    const std::string closed = fmt::format(">{}{}{}</{}>", block, newline_, outer, parent.tag);
    replace(parent.end - 2, parent.end, closed);
    return;
  }
  std::size_t at = after != nullptr ? after->end : parent.open_end;
  if (!on_one_line) at = behind_comments(at);
  // <link name="a"></link>: the closing tag gets a line of its own.
  const bool closes_here = sibling == nullptr && text_.compare(at, 2, "</") == 0;
  if (closes_here) block += newline_ + outer;
  replace(at, at, block);
}

std::string XmlEditor::result() {
  std::stable_sort(edits_.begin(), edits_.end(),
                   [](const Edit& a, const Edit& b) { return a.begin < b.begin; });
  std::string out;
  std::size_t at = 0;
  for (const Edit& edit : edits_) {
    out.append(text_, at, edit.begin - at);
    out += edit.content;
    at = edit.end;
  }
  return out.append(text_, at, std::string::npos);
}

std::optional<std::string> XmlEditor::indent(std::size_t place) const {
  const std::size_t before = place == 0 ? std::string::npos : text_.rfind('\n', place - 1);
  const std::size_t line = before == std::string::npos ? 0 : before + 1;
  std::string space = text_.substr(line, place - line);
  if (space.find_first_not_of(" \t") != std::string::npos) return std::nullopt;
  return space;
}

const std::string& XmlEditor::indent_step() {
  if (step_.empty()) {
    step_ = "  ";
    const XmlElement root = outline_xml(text_);
    const std::string outer = indent(root.begin).value_or("");
    for (const XmlElement& child : root.children) {
      const std::optional<std::string> inner = indent(child.begin);
      if (!inner || inner->size() <= outer.size() || !inner->starts_with(outer)) continue;
      step_ = inner->substr(outer.size());
      break;
    }
  }
  return step_;
}

std::size_t XmlEditor::behind_comments(std::size_t at) const {
  const std::size_t start = at;
  for (std::size_t end = at;;) {
    const std::size_t next = std::min(text_.find_first_not_of(" \t", end), text_.size());
    if (next == text_.size() || text_[next] == '\n' || text_[next] == '\r') return at;
    if (text_.compare(next, 4, "<!--") != 0) return start;
    end = text_.find("-->", next + 4) + 3;
    at = end;
  }
}

}  // namespace heft::urdf
