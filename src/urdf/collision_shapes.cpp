#include "heft/urdf/collision_shapes.hpp"

#include <cctype>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <optional>
#include <sstream>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "heft/host/error.hpp"
#include "rigid_body.hpp"
#include "stl.hpp"
#include "urdf_text.hpp"
#include "xml_outline.hpp"

namespace heft::urdf {
namespace {

using model::LinkShape;

/// Collects the shapes of one file.
class ShapeReader {
 public:
  ShapeReader(const std::string& text, std::string name, const model::Robot& robot,
              std::vector<std::string>* warnings)
      : root_(outline(text, name)), name_(std::move(name)), robot_(robot), warnings_(warnings) {
    for (const XmlElement& element : root_.children) {
      const std::string* own = element.attribute("name");
      if (own == nullptr) continue;
      if (element.tag == "link") links_[*own] = &element;
      if (element.tag != "joint") continue;
      const std::string *parent = end_of(element, "parent"), *child = end_of(element, "child");
      if (parent == nullptr || child == nullptr) continue;
      joints_.emplace(*parent, &element);
      child_of_[&element] = *child;
    }
    for (int j = 0; j < robot.num_joints(); ++j) {
      moved_[robot.joints[static_cast<std::size_t>(j)].link_name] = j;
    }
  }

  std::vector<LinkShape> read() {
    collect(robot_.base_link, -1, Placement{}, 0);
    for (int j = 0; j < robot_.num_joints(); ++j) {
      collect(robot_.joints[static_cast<std::size_t>(j)].link_name, j, Placement{}, 0);
    }
    return std::move(shapes_);
  }

 private:
  static XmlElement outline(const std::string& text, const std::string& name) {
    try {
      return outline_xml(text);
    } catch (const XmlOutlineError& error) {
      throw UrdfError(fmt::format("{}:{}: not XML: {}; expected a URDF (<robot ...>); repair the file", name,
                                  error.line, error.what()));
    }
  }

  static const std::string* end_of(const XmlElement& joint, const char* tag) {
    const XmlElement* end = joint.child(tag);
    return end == nullptr ? nullptr : end->attribute("link");
  }

  [[noreturn]] void refuse(const XmlElement& element, const std::string& text) const {
    throw UrdfError(fmt::format("{}:{}: {}", name_, element.line, text));
  }

  /// `count` finite numbers of an attribute.
  std::vector<double> numbers(const XmlElement& element, const char* attribute, std::size_t count) const {
    const std::string* text = element.attribute(attribute);
    std::vector<double> values;
    if (text != nullptr) {
      std::istringstream in(*text);
      for (std::string word; in >> word;) {
        char* end = nullptr;
        values.push_back(std::strtod(word.c_str(), &end));
        if (*end != '\0' || !std::isfinite(values.back())) {
          values.clear();
          break;
        }
      }
    }
    if (values.size() != count) {
      refuse(element, fmt::format("<{}>: found {}; expected {} numbers in {}; correct it", element.tag,
                                  text == nullptr ? "no " + std::string(attribute) : '"' + *text + '"', count,
                                  attribute));
    }
    return values;
  }

  double size(const XmlElement& element, const char* attribute) const {
    const double value = numbers(element, attribute, 1)[0];
    if (!(value > 0.0)) {
      refuse(element, fmt::format("<{}>: found {} {}; expected more than 0 m; correct it", element.tag,
                                  attribute, value));
    }
    return value;
  }

  Placement placement_of_origin(const XmlElement& owner) const {
    Placement placement;
    const XmlElement* origin = owner.child("origin");
    if (origin == nullptr) return placement;
    if (origin->attribute("xyz") != nullptr) {
      const std::vector<double> xyz = numbers(*origin, "xyz", 3);
      placement.p = {xyz[0], xyz[1], xyz[2]};
    }
    if (origin->attribute("rpy") != nullptr) {
      const std::vector<double> rpy = numbers(*origin, "rpy", 3);
      placement.R = snapped((Eigen::AngleAxisd(rpy[2], Eigen::Vector3d::UnitZ()) *
                             Eigen::AngleAxisd(rpy[1], Eigen::Vector3d::UnitY()) *
                             Eigen::AngleAxisd(rpy[0], Eigen::Vector3d::UnitX()))
                                .toRotationMatrix());
    }
    return placement;
  }

  /// Shapes of a link and of what is fixed to it.
  void collect(const std::string& link, int joint, const Placement& placement, int depth) {
    const auto found = links_.find(link);
    if (found == links_.end() || depth > 1000) return;
    for (const XmlElement& child : found->second->children) {
      if (child.tag == "collision") add(child, link, joint, placement);
    }
    const auto [first, last] = joints_.equal_range(link);
    for (auto at = first; at != last; ++at) {
      const std::string& child = child_of_.at(at->second);
      if (!moved_.contains(child))
        collect(child, joint, placement * placement_of_origin(*at->second), depth + 1);
    }
  }

  void add(const XmlElement& collision, const std::string& link, int joint, const Placement& placement) {
    const XmlElement* geometry = collision.child("geometry");
    if (geometry == nullptr || geometry->children.empty()) {
      refuse(collision,
             fmt::format("link \"{}\": <collision> without a shape; expected <geometry> with a box, "
                         "cylinder, sphere or mesh; add it",
                         link));
    }
    const XmlElement& shape = geometry->children.front();
    const Placement own = placement * placement_of_origin(collision);
    if (shape.tag == "box") {
      const std::vector<double> edges = numbers(shape, "size", 3);
      if (!(edges[0] > 0.0 && edges[1] > 0.0 && edges[2] > 0.0)) {
        refuse(shape, "<box>: found an edge that is not above 0 m; expected three lengths; correct it");
      }
      put(link, joint, own, LinkShape::Kind::kBox, {edges[0], edges[1], edges[2]});
    } else if (shape.tag == "sphere") {
      put(link, joint, own, LinkShape::Kind::kSphere, {size(shape, "radius"), 0.0, 0.0});
    } else if (shape.tag == "cylinder" || shape.tag == "capsule") {
      const double radius = size(shape, "radius"), length = size(shape, "length");
      put(link, joint, own, LinkShape::Kind::kCylinder, {radius, length, 0.0});
      if (shape.tag == "capsule") {
        for (const double end : {-0.5, 0.5}) {
          const Placement cap = own * Placement{Eigen::Matrix3d::Identity(), {0.0, 0.0, end * length}};
          put(link, joint, cap, LinkShape::Kind::kSphere, {radius, 0.0, 0.0});
        }
      }
    } else if (shape.tag == "mesh") {
      add_mesh(shape, link, joint, own);
    } else {
      warn(shape,
           fmt::format("link \"{}\": shape <{}> is not known; its capsule is fitted from the kinematics",
                       link, shape.tag));
    }
  }

  LinkShape& put(const std::string& link, int joint, const Placement& at, LinkShape::Kind kind,
                 std::array<double, 3> size) {
    LinkShape shape;
    shape.link = joint;
    shape.link_name = link;
    shape.kind = kind;
    shape.size = size;
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column)
        shape.rotation[static_cast<std::size_t>(3 * row + column)] = at.R(row, column);
    }
    shape.position = {at.p.x(), at.p.y(), at.p.z()};
    shapes_.push_back(std::move(shape));
    return shapes_.back();
  }

  void add_mesh(const XmlElement& mesh, const std::string& link, int joint, const Placement& own) {
    const std::string* file = mesh.attribute("filename");
    const std::optional<std::string> path = file == nullptr ? std::nullopt : find_mesh(*file);
    std::string why = "no such file";
    if (path) {
      try {
        std::vector<std::array<double, 3>> corners = read_stl(*path);
        if (mesh.attribute("scale") != nullptr) {
          const std::vector<double> scale = numbers(mesh, "scale", 3);
          for (auto& corner : corners) {
            for (std::size_t k = 0; k < 3; ++k) corner[k] *= scale[k];
          }
        }
        put(link, joint, own, LinkShape::Kind::kMesh, {0, 0, 0}).corners = std::move(corners);
        return;
      } catch (const InputError& error) {
        why = error.what();
      }
    }
    warn(mesh, fmt::format(
                   "link \"{}\": mesh \"{}\" cannot be read ({}); its capsule is fitted from the kinematics",
                   link, file == nullptr ? "" : *file, why));
  }

  std::optional<std::string> find_mesh(std::string file) const {
    namespace fs = std::filesystem;
    std::error_code code;
    const fs::path folder = fs::path(name_).parent_path();
    constexpr std::string_view kFile = "file://", kPackage = "package://";
    if (file.starts_with(kFile)) file.erase(0, kFile.size());
    if (!file.starts_with(kPackage)) {
      const fs::path next_to_it = fs::path(file).is_absolute() ? fs::path(file) : folder / file;
      if (fs::is_regular_file(next_to_it, code)) return next_to_it.string();
      return std::nullopt;
    }
    file.erase(0, kPackage.size());
    // The package is a folder above the URDF, or next to one above it.
    const std::string inside = file.substr(std::min(file.size(), file.find('/') + 1));
    for (fs::path above = fs::absolute(folder, code);; above = above.parent_path()) {
      for (const fs::path& candidate : {above / file, above / inside}) {
        if (fs::is_regular_file(candidate, code)) return candidate.string();
      }
      if (above == above.parent_path()) return std::nullopt;
    }
  }

  void warn(const XmlElement& element, const std::string& text) {
    if (warnings_ != nullptr) warnings_->push_back(fmt::format("{}:{}: {}", name_, element.line, text));
  }

  XmlElement root_;
  std::string name_;
  const model::Robot& robot_;
  std::vector<std::string>* warnings_;
  std::map<std::string, const XmlElement*> links_;
  std::multimap<std::string, const XmlElement*> joints_;  ///< by parent link
  std::map<const XmlElement*, std::string> child_of_;
  std::map<std::string, int> moved_;
  std::vector<LinkShape> shapes_;
};

}  // namespace

std::vector<model::LinkShape> load_shapes_string(const std::string& text, const std::string& name,
                                                 const model::Robot& robot,
                                                 std::vector<std::string>* warnings) {
  return ShapeReader(text, name, robot, warnings).read();
}

std::vector<model::LinkShape> load_shapes(const std::string& path, const model::Robot& robot,
                                          std::vector<std::string>* warnings) {
  return load_shapes_string(read_urdf(path), path, robot, warnings);
}

}  // namespace heft::urdf
