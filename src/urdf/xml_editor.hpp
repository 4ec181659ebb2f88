// Changes to an XML text that leave everything else as it is: order, comments, white space.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "xml_outline.hpp"

namespace heft::urdf {

/// Collects changes, by the places that the outline of the same text gives, and applies them together.
class XmlEditor {
 public:
  /// @param text  must outlive the editor
  explicit XmlEditor(const std::string& text)
      : text_(text), newline_(text.find("\r\n") == std::string::npos ? "\n" : "\r\n") {}

  /// Replaces text [begin, end) by `content`.
  void replace(std::size_t begin, std::size_t end, std::string content);

  /// Sets the value of an attribute, or adds the attribute behind the others.
  void set_attribute(const XmlElement& element, std::string_view name, const std::string& value);

  /// One line of a new element.
  struct Line {
    int depth{0};  ///< below the parent's children
    std::string text;
  };
  /// Adds an element, given line by line, to a parent: behind the child `after`, or in
  /// front of all children.
  void insert(const XmlElement& parent, const XmlElement* after, const std::vector<Line>& lines);

  /// The text with all changes.
  std::string result();

 private:
  struct Edit {
    std::size_t begin{0}, end{0};
    std::string content;
  };

  /// White space in front of what begins its line here; nothing when something else precedes it.
  std::optional<std::string> indent(std::size_t place) const;

  /// One level of indentation: that of the first element inside the root.
  const std::string& indent_step();

  /// Behind the comments that end the line here: they refer to what precedes them.
  std::size_t behind_comments(std::size_t at) const;

  const std::string& text_;
  std::string newline_;
  std::string step_;
  std::vector<Edit> edits_;
};

}  // namespace heft::urdf
