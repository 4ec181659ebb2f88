#include "export_checks.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "heft/host/error.hpp"
#include "link_body.hpp"
#include "rigid_body.hpp"

namespace heft::urdf {
namespace {

/// Why a link's parameters are physically impossible; empty when they are possible.
std::string fault_of(const InertialParameters<double>& p) {
  if (!(p[kMass] > 0.0)) return fmt::format("mass {:.6g} kg: expected above zero", p[kMass]);
  return impossibility(to_body(p).about_com);
}

/// Refuses values that cannot be written, and, unless allowed, impossible ones.
class Checker {
 public:
  Checker(const UrdfTree& tree, const std::string& name, bool allow_impossible,
          std::vector<std::string>& notes)
      : tree_(tree), name_(name), allow_impossible_(allow_impossible), notes_(notes) {}

  void check(const model::Robot& robot, const model::Robot& file) {
    for (std::size_t k = 0; k < robot.joints.size(); ++k) {
      const model::RobotJoint& joint = robot.joints[k];
      check_link(joint, is_zero(file.joints[k].link));
      check_friction(joint, "Coulomb friction", joint.actuation.coulomb_friction);
      check_friction(joint, "viscous friction", joint.actuation.viscous_friction);
    }
    if (impossible_.empty()) return;
    if (!allow_impossible_) {
      const std::string more =
          impossible_.size() == 1 ? "" : fmt::format(" (and {} more)", impossible_.size() - 1);
      throw UrdfError(
          fmt::format("{}{}; not written; fit a physically consistent model (method physical), or allow "
                      "impossible values",
                      impossible_.front(), more));
    }
    for (const std::string& fault : impossible_) notes_.push_back(fault + "; written as it is");
  }

 private:
  void check_link(const model::RobotJoint& joint, bool massless_in_file) {
    const XmlElement& element = *tree_.links.at(joint.link_name);
    const InertialParameters<double>& p = joint.link;
    if (!std::all_of(p.begin(), p.end(), [](double value) { return std::isfinite(value); })) {
      throw UrdfError(at(element,
                         "link \"{}\": its parameters [{:.6g}] are not all finite; expected numbers; check "
                         "the fit",
                         joint.link_name, fmt::join(p, ", ")));
    }
    if (is_zero(p) && massless_in_file) return;
    const double largest_moment = std::max({std::abs(p[kMcx]), std::abs(p[kMcy]), std::abs(p[kMcz])});
    if (p[kMass] == 0.0 && largest_moment > 0.0) {
      throw UrdfError(
          at(element,
             "link \"{}\": no mass but a first moment of {:.6g} kg·m, which URDF cannot express; expected "
             "a mass above zero; fit a physically consistent model (method physical)",
             joint.link_name, largest_moment));
    }
    if (const std::string fault = fault_of(p); !fault.empty())
      impossible_.push_back(at(element, "link \"{}\": {}", joint.link_name, fault));
  }

  void check_friction(const model::RobotJoint& joint, const char* what, double value) {
    const XmlElement& element = *tree_.joints.at(joint.name);
    if (!std::isfinite(value)) {
      throw UrdfError(at(element, "joint \"{}\": {} {:.6g}; expected a finite number; check the fit",
                         joint.name, what, value));
    }
    if (value < 0.0) {
      impossible_.push_back(
          at(element, "joint \"{}\": {} {:.6g}: expected not below zero", joint.name, what, value));
    }
  }

  template <typename... Args>
  std::string at(const XmlElement& element, fmt::format_string<Args...> format, Args&&... args) const {
    return fmt::format("{}:{}: {}", name_, element.line, fmt::format(format, std::forward<Args>(args)...));
  }

  const UrdfTree& tree_;
  const std::string& name_;
  bool allow_impossible_;
  std::vector<std::string>& notes_;
  std::vector<std::string> impossible_;
};

}  // namespace

void check_same_chain(const model::Robot& file, const model::Robot& robot, const std::string& name) {
  constexpr const char* kRemedy = "write into the URDF that the robot was read from";
  if (file.num_joints() != robot.num_joints()) {
    throw UrdfError(fmt::format("{}: {} joints move between \"{}\" and \"{}\"; expected the robot's {}; {}",
                                name, file.num_joints(), file.base_link, file.tip_link, robot.num_joints(),
                                kRemedy));
  }
  for (std::size_t k = 0; k < robot.joints.size(); ++k) {
    const model::RobotJoint& there = file.joints[k];
    const model::RobotJoint& here = robot.joints[k];
    if (there.name != here.name || there.link_name != here.link_name) {
      throw UrdfError(
          fmt::format("{}: joint {} is \"{}\" with link \"{}\"; expected \"{}\" with link \"{}\" as in "
                      "the robot; {}",
                      name, k + 1, there.name, there.link_name, here.name, here.link_name, kRemedy));
    }
    const auto far = [](const auto& a, const auto& b) {
      for (std::size_t i = 0; i < a.size(); ++i) {
        if (!(std::abs(a[i] - b[i]) <= 1e-9)) return true;
      }
      return false;
    };
    if (there.joint.type != here.joint.type || far(there.joint.rotation, here.joint.rotation) ||
        far(there.joint.position, here.joint.position) || far(there.joint.axis, here.joint.axis)) {
      throw UrdfError(
          fmt::format("{}: joint \"{}\" has another type, place or axis than in the robot; expected the "
                      "same; {}",
                      name, here.name, kRemedy));
    }
  }
}

void check_values(const model::Robot& robot, const model::Robot& file, const UrdfTree& tree,
                  const std::string& name, bool allow_impossible, std::vector<std::string>& notes) {
  Checker(tree, name, allow_impossible, notes).check(robot, file);
}

}  // namespace heft::urdf
