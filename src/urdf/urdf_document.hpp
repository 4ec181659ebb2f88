// The text of a URDF: what is where, and whether it hangs together.
#pragma once

#include <initializer_list>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "xml_outline.hpp"

namespace heft::urdf {

/// Names in quotation marks, joined by commas and "and".
std::string quoted(const std::vector<std::string>& names);

/// The file as messages refer to it: its name, and the lines of its links and joints.
class Document {
 public:
  /// @param name  of the file, for messages
  /// @throws UrdfError when the text is not XML, its root not <robot>, or a name is missing or used twice
  Document(const std::string& text, const std::string& name);

  // Its maps point into its own elements.
  Document(const Document&) = delete;
  Document& operator=(const Document&) = delete;

  const std::map<std::string, const XmlElement*>& links() const { return links_; }
  const std::map<std::string, const XmlElement*>& joints() const { return joints_; }
  const XmlElement& root() const { return root_; }

  const XmlElement* link(const std::string& name) const { return find(links_, name); }
  const XmlElement* joint(const std::string& name) const { return find(joints_, name); }
  /// The same of a link or joint that urdfdom has read here.
  /// @throws UrdfError when urdfdom reads its name in another way
  const XmlElement& known_link(const std::string& name) const { return known(links_, "link", name); }
  const XmlElement& known_joint(const std::string& name) const { return known(joints_, "joint", name); }

  template <typename... Args>
  [[noreturn]] void fail(fmt::format_string<Args...> format, Args&&... args) const {
    throw UrdfError(fmt::format("{}: {}", name_, fmt::format(format, std::forward<Args>(args)...)));
  }

  template <typename... Args>
  [[noreturn]] void fail_at(const XmlElement& element, fmt::format_string<Args...> format,
                            Args&&... args) const {
    throw UrdfError(at(element, fmt::format(format, std::forward<Args>(args)...)));
  }

  /// `file:line: text`
  std::string at(const XmlElement& element, const std::string& text) const;

  /// The child of an element where it has one, otherwise the element itself: the best line for a message.
  static const XmlElement& nearest(const XmlElement& element, std::initializer_list<std::string_view> path);

 private:
  static const XmlElement* find(const std::map<std::string, const XmlElement*>& elements,
                                const std::string& name);
  const XmlElement& known(const std::map<std::string, const XmlElement*>& elements, const char* tag,
                          const std::string& name) const;

  void check_root() const;

  void add(const XmlElement& element, std::map<std::string, const XmlElement*>& elements) const;

  std::string name_;
  XmlElement root_;
  std::map<std::string, const XmlElement*> links_;
  std::map<std::string, const XmlElement*> joints_;
};

/// Joints that name links, one parent for each link, no loop, one root. urdfdom lets some of these pass
/// (a link with two parents) and names others without a line.
/// @throws UrdfError naming the line
void check_structure(const Document& document);

/// Revolute and prismatic joints have limits. Asked of the text, since urdfdom fills in zeros and names no
/// line.
/// @throws UrdfError naming the line
void check_limits(const Document& document);

}  // namespace heft::urdf
