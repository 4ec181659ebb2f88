#include "urdf_document.hpp"

#include <algorithm>
#include <array>
#include <set>

namespace heft::urdf {

std::string quoted(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t k = 0; k < names.size(); ++k) {
    text += fmt::format("{}\"{}\"", k == 0 ? "" : (k + 1 == names.size() ? " and " : ", "), names[k]);
  }
  return text;
}

Document::Document(const std::string& text, const std::string& name) : name_(name) {
  if (text.find_first_not_of(" \t\r\n") == std::string::npos)
    fail("the file is empty; expected a URDF (<robot ...>)");
  try {
    root_ = outline_xml(text);
  } catch (const XmlOutlineError& error) {
    throw UrdfError(fmt::format("{}:{}: not XML: {}; expected a URDF (<robot ...>); repair the file", name_,
                                error.line, error.what()));
  }
  check_root();
  for (const XmlElement& element : root_.children) {
    if (element.tag == "link") add(element, links_);
    if (element.tag == "joint") add(element, joints_);
  }
  if (links_.empty())
    fail_at(root_, "the robot has no <link>; expected links and joints; check that this is the right file");
}

std::string Document::at(const XmlElement& element, const std::string& text) const {
  return fmt::format("{}:{}: {}", name_, element.line, text);
}

const XmlElement& Document::nearest(const XmlElement& element, std::initializer_list<std::string_view> path) {
  const XmlElement* found = &element;
  for (const std::string_view tag : path) {
    const XmlElement* next = found->child(tag);
    if (next == nullptr) break;
    found = next;
  }
  return *found;
}

const XmlElement* Document::find(const std::map<std::string, const XmlElement*>& elements,
                                 const std::string& name) {
  const auto found = elements.find(name);
  return found == elements.end() ? nullptr : found->second;
}

const XmlElement& Document::known(const std::map<std::string, const XmlElement*>& elements, const char* tag,
                                  const std::string& name) const {
  const XmlElement* element = find(elements, name);
  if (element == nullptr) {
    std::string printable = name;
    std::replace_if(printable.begin(), printable.end(), [](unsigned char c) { return c < 32 || c == 127; }, '?');
    fail("{} \"{}\": its name can be read in two ways; expected letters and digits, without zero bytes or references to "
         "characters by number; rename it",
         tag, printable);
  }
  return *element;
}

void Document::check_root() const {
  const auto is_xacro = [](const XmlElement& element) { return element.tag.starts_with("xacro:"); };
  if (root_.tag != "robot") {
    fail_at(root_, "the root element is <{}>; expected <robot>; {}", root_.tag,
            root_.tag == "sdf" ? "this is an SDF file, convert it to URDF" : "check that this is a URDF");
  }
  const auto found = std::find_if(root_.children.begin(), root_.children.end(), is_xacro);
  if (found != root_.children.end()) {
    fail_at(*found, "<{}>: this is a xacro file; expected plain URDF; expand it first (xacro IN > OUT)",
            found->tag);
  }
}

void Document::add(const XmlElement& element, std::map<std::string, const XmlElement*>& elements) const {
  const std::string* name = element.attribute("name");
  if (name == nullptr || name->empty()) {
    fail_at(element, "<{}> without a name; expected name=\"...\"; give it one", element.tag);
  }
  const auto [before, is_new] = elements.emplace(*name, &element);
  if (!is_new) {
    fail_at(element, "{} \"{}\" already exists (line {}); expected every name once; rename one",
            element.tag, *name, before->second->line);
  }
}

namespace {

/// Who hangs from whom.
struct Connections {
  std::map<std::string, const XmlElement*> parent_joint;  ///< by child link
  std::multimap<std::string, std::string> children;       ///< by parent link
};

/// Names of the parent and the child link of a joint, which exist and differ.
std::array<std::string, 2> ends_of(const XmlElement& joint, const std::string& name,
                                   const Document& document) {
  std::array<std::string, 2> ends;
  const std::array<const char*, 2> tags{"parent", "child"};
  for (std::size_t k = 0; k < 2; ++k) {
    const XmlElement* end = joint.child(tags[k]);
    const std::string* link = end == nullptr ? nullptr : end->attribute("link");
    if (link == nullptr) {
      document.fail_at(joint, "joint \"{}\": found no <{} link=\"...\">; expected one; add it", name,
                       tags[k]);
    }
    if (document.link(*link) == nullptr) {
      document.fail_at(*end,
                       "joint \"{}\": its {} link \"{}\" does not exist; expected the name of a <link>; "
                       "correct the name or add the link",
                       name, tags[k], *link);
    }
    ends[k] = *link;
  }
  if (ends[0] == ends[1]) {
    document.fail_at(joint,
                     "joint \"{}\": link \"{}\" is its own parent: a loop; expected an open tree of links",
                     name, ends[0]);
  }
  return ends;
}

/// Checks every joint on its own, and that no link has two parents.
Connections connections_of(const Document& document) {
  static const std::set<std::string> kTypes{"revolute", "continuous", "prismatic",
                                            "fixed",    "floating",   "planar"};
  Connections found;
  for (const XmlElement& joint : document.root().children) {
    if (joint.tag != "joint") continue;
    const std::string& name = *joint.attribute("name");
    const std::string* type = joint.attribute("type");
    if (type == nullptr || !kTypes.contains(*type)) {
      document.fail_at(
          joint, "joint \"{}\": found {}; expected type revolute, continuous, prismatic or fixed; correct it",
          name, type == nullptr ? "no type" : fmt::format("type \"{}\"", *type));
    }
    const auto [parent, child] = ends_of(joint, name, document);
    const auto [before, is_new] = found.parent_joint.emplace(child, &joint);
    if (!is_new) {
      document.fail_at(
          joint,
          "link \"{}\" is the child of two joints, \"{}\" (line {}) and \"{}\": a loop; expected an open "
          "tree of links; cut the loop at one joint",
          child, *before->second->attribute("name"), before->second->line, name);
    }
    found.children.emplace(parent, child);
  }
  return found;
}

/// One root, from which every link is reached.
void check_reach(const Document& document, const Connections& connections) {
  std::vector<std::string> roots;
  std::set<std::string> reached;
  for (const auto& [name, element] : document.links()) {
    if (!connections.parent_joint.contains(name)) roots.push_back(name);
  }
  if (roots.size() > 1) {
    document.fail("links {} have no parent: the robot is in pieces; expected one root; join them by joints",
                  quoted(roots));
  }
  std::vector<std::string> waiting = roots;
  while (!waiting.empty()) {
    const std::string name = waiting.back();
    waiting.pop_back();
    reached.insert(name);
    const auto [first, last] = connections.children.equal_range(name);
    for (auto child = first; child != last; ++child) waiting.push_back(child->second);
  }
  // Every link has at most one parent here, so what is not reached from the root goes round in a circle.
  for (const auto& [child, joint] : connections.parent_joint) {
    if (reached.contains(child)) continue;
    std::vector<std::string> circle;
    std::set<std::string> seen;
    for (std::string link = child; seen.insert(link).second;) {
      circle.push_back(link);
      link = *connections.parent_joint.at(link)->child("parent")->attribute("link");
    }
    document.fail_at(
        *joint,
        "joint \"{}\": links {} go round in a loop; expected an open tree of links; cut the loop at one "
        "joint",
        *joint->attribute("name"), quoted(circle));
  }
}

}  // namespace

void check_structure(const Document& document) { check_reach(document, connections_of(document)); }

void check_limits(const Document& document) {
  for (const auto& [name, joint] : document.joints()) {
    const std::string& type = *joint->attribute("type");
    if (type != "revolute" && type != "prismatic") continue;
    const XmlElement* limit = joint->child("limit");
    if (limit == nullptr) {
      document.fail_at(*joint,
                       "joint \"{}\": found no <limit>; expected lower, upper, velocity and effort on a {} "
                       "joint; add it{}",
                       name, type, type == "revolute" ? " or make the joint continuous" : "");
    }
    for (const char* attribute : {"lower", "upper", "velocity", "effort"}) {
      // A limit of zero may be left out by the format's rule, but not both ends of the range.
      const bool is_range = attribute == std::string_view("lower") || attribute == std::string_view("upper");
      const bool other_end = limit->attribute("lower") != nullptr || limit->attribute("upper") != nullptr;
      if (limit->attribute(attribute) == nullptr && !(is_range && other_end)) {
        document.fail_at(
            *limit,
            "joint \"{}\": <limit> has no {}; expected lower, upper, velocity and effort on a {} joint; "
            "add it",
            name, attribute, type);
      }
    }
  }
}

}  // namespace heft::urdf
