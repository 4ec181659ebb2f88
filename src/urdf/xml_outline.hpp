// The elements of an XML text with their line numbers. urdfdom gives the values but no lines, and messages
// need them.
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace heft::urdf {

/// A place where the text stops being XML.
class XmlOutlineError : public std::runtime_error {
 public:
  XmlOutlineError(std::size_t error_line, const std::string& what)
      : std::runtime_error(what), line(error_line) {}
  std::size_t line;
};

struct XmlElement {
  std::string tag;
  std::size_t line{0};
  std::size_t begin{0}, end{0};  ///< the element in the text, from its '<' to behind its last '>'
  std::size_t open_end{0};       ///< behind the '>' of the opening tag; equal to `end` in `<a/>`
  std::vector<std::pair<std::string, std::string>> attributes;  ///< names, values with entities resolved
  /// Where the values are in the text, between the quotes: begin and end, in the order of `attributes`.
  std::vector<std::pair<std::size_t, std::size_t>> attribute_places;
  std::vector<XmlElement> children;

  /// Value of an attribute; null when it is absent.
  const std::string* attribute(std::string_view name) const;
  /// First child with this tag; null when there is none.
  const XmlElement* child(std::string_view child_tag) const;
};

/// The root element of the text with everything in it. Text between tags, comments and declarations are
/// skipped.
/// @throws XmlOutlineError
XmlElement outline_xml(std::string_view text);

}  // namespace heft::urdf
