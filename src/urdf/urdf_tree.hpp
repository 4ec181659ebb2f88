// Links and joints in the text of a URDF that has been read once.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "xml_outline.hpp"

namespace heft::urdf {

/// Links and joints of the text, and what is fixed to what.
struct UrdfTree {
  explicit UrdfTree(const std::string& text) : root(outline_xml(text)) {
    for (const XmlElement& element : root.children) {
      if (element.tag == "link") links.emplace(*element.attribute("name"), &element);
      if (element.tag != "joint") continue;
      joints.emplace(*element.attribute("name"), &element);
      if (*element.attribute("type") == "fixed") {
        fixed.emplace(*element.child("parent")->attribute("link"),
                      *element.child("child")->attribute("link"));
      }
    }
  }
  // Its maps point into its own elements.
  UrdfTree(const UrdfTree&) = delete;
  UrdfTree& operator=(const UrdfTree&) = delete;

  /// The links fixed to a link, over any number of fixed joints, in the file's order of each.
  std::vector<std::string> fixed_to(const std::string& link) const {
    std::vector<std::string> found;
    const auto [first, last] = fixed.equal_range(link);
    for (auto child = first; child != last; ++child) {
      found.push_back(child->second);
      const std::vector<std::string> further = fixed_to(child->second);
      found.insert(found.end(), further.begin(), further.end());
    }
    return found;
  }

  XmlElement root;
  std::map<std::string, const XmlElement*> links, joints;
  std::multimap<std::string, std::string> fixed;  ///< child by parent
};

}  // namespace heft::urdf
