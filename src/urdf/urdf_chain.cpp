#include "urdf_chain.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

#include <Eigen/Dense>

#include "rigid_body.hpp"

namespace heft::urdf {
namespace {

bool moves(const ::urdf::Joint& joint) { return joint.type != ::urdf::Joint::FIXED; }

using LinkPtr = ::urdf::LinkConstSharedPtr;

/// Picks the chain out of the tree and turns it into a robot.
class ChainBuilder {
 public:
  ChainBuilder(const Document& document, const ::urdf::ModelInterface& model, const UrdfOptions& options,
               std::vector<std::string>* warnings)
      : document_(document), model_(model), options_(options), warnings_(warnings) {}

  model::Robot build() {
    model::Robot robot;
    robot.name = model_.getName();
    const LinkPtr base = find_base();
    const LinkPtr tip = find_tip(base);
    robot.base_link = base->name;
    robot.tip_link = tip->name;
    robot.gravity = gravity_in_base();

    Placement pending;  // of the next joint's parent link in the last moving link
    for (const ::urdf::JointSharedPtr& joint : joints_between(base, tip)) {
      on_chain_.insert(joint->name);
      pending = pending * checked_placement(*joint);
      if (!moves(*joint)) continue;
      robot.joints.push_back(make_joint(*joint, pending));
      pending = Placement{};
    }
    const Eigen::Matrix3d tip_rotation = snapped(pending.R);
    const Eigen::Vector3d tip_position = snapped(pending.p);
    store(tip_rotation, robot.tip_rotation);
    store(tip_position, robot.tip_position);
    if (robot.joints.empty()) {
      document_.fail(
          "no joint moves between \"{}\" and \"{}\"; expected at least one revolute, continuous or prismatic "
          "joint; name other links",
          base->name, tip->name);
    }
    for (std::size_t k = 0; k < robot.joints.size(); ++k)
      fill_link(robot.joints[k], k + 1 == robot.joints.size());
    return robot;
  }

 private:
  void warn(const std::string& text) {
    if (warnings_ != nullptr) warnings_->push_back(text);
  }

  static void store(const Eigen::Matrix3d& rotation, std::array<double, 9>& out) {
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column)
        out[static_cast<std::size_t>(3 * row + column)] = rotation(row, column);
    }
  }

  static void store(const Eigen::Vector3d& vector, std::array<double, 3>& out) {
    out = {vector.x(), vector.y(), vector.z()};
  }

  LinkPtr named_link(const std::string& name, const char* role) const {
    const LinkPtr link = model_.getLink(name);
    if (!link) {
      std::vector<std::string> names;
      for (const auto& [known, unused] : model_.links_) names.push_back(known);
      document_.fail("there is no link \"{}\" for the {}; the links are {}; name one of them", name, role,
                     quoted(names));
    }
    return link;
  }

  LinkPtr find_base() const {
    if (!options_.base_link.empty()) return named_link(options_.base_link, "base");
    return model_.getRoot();
  }

  /// Links that move on their own and have no moving joint outboard.
  static void last_moving_links(const LinkPtr& link, bool moving, std::vector<LinkPtr>& found) {
    const std::size_t before = found.size();
    std::function<void(const LinkPtr&)> outward = [&](const LinkPtr& at) {
      for (const auto& joint : at->child_joints) {
        const LinkPtr child = child_of(at, joint->name);
        if (moves(*joint)) {
          last_moving_links(child, true, found);
        } else {
          outward(child);
        }
      }
    };
    outward(link);
    if (moving && found.size() == before) found.push_back(link);
  }

  static LinkPtr child_of(const LinkPtr& link, const std::string& joint_name) {
    for (const auto& child : link->child_links) {
      if (child->parent_joint->name == joint_name) return child;
    }
    return nullptr;
  }

  /// Where a chain ends: the one frame fixed outermost to its last moving link, or that link when there are
  /// several.
  LinkPtr end_frame(const LinkPtr& last, bool& several) const {
    std::vector<LinkPtr> leaves;
    std::function<void(const LinkPtr&)> outward = [&](const LinkPtr& at) {
      if (at->child_links.empty()) leaves.push_back(at);
      for (const auto& child : at->child_links) outward(child);
    };
    outward(last);
    several = leaves.size() > 1;
    return several ? last : leaves.front();
  }

  std::vector<LinkPtr> path_from_root(LinkPtr link) const {
    std::vector<LinkPtr> path;
    for (; link; link = link->getParent()) path.push_back(link);
    std::reverse(path.begin(), path.end());
    return path;
  }

  LinkPtr find_tip(const LinkPtr& base) {
    if (!options_.tip_link.empty()) return named_link(options_.tip_link, "tip");
    std::vector<LinkPtr> ends;
    last_moving_links(base, false, ends);
    if (ends.empty()) {
      document_.fail(
          "no joint moves outboard of \"{}\"; expected at least one revolute, continuous or prismatic joint; "
          "check that this is the right file",
          base->name);
    }
    bool several = false;
    if (ends.size() > 1) refuse_branches(base, ends);
    LinkPtr tip = end_frame(ends.front(), several);
    if (several) {
      warn(document_.at(document_.known_link(tip->name),
                        fmt::format("link \"{}\": several frames are fixed to the last moving link; "
                                    "it is taken as the tip itself; name the tip link to choose another",
                                    tip->name)));
    }
    return tip;
  }

  [[noreturn]] void refuse_branches(const LinkPtr& base, const std::vector<LinkPtr>& ends) const {
    std::vector<std::string> candidates;
    std::vector<LinkPtr> common = path_from_root(ends.front());
    for (const LinkPtr& end : ends) {
      bool several = false;
      candidates.push_back(end_frame(end, several)->name);
      const std::vector<LinkPtr> path = path_from_root(end);
      std::size_t shared = 0;
      while (shared < common.size() && shared < path.size() && common[shared] == path[shared]) ++shared;
      common.resize(shared);
    }
    // The link where they part is a tip too, if something moves on the way to it.
    std::string parting;
    for (LinkPtr link = common.back(); link && link != base; link = link->getParent()) {
      if (moves(*link->parent_joint))
        parting = fmt::format(", or \"{}\" where they part", common.back()->name);
    }
    document_.fail(
        "more than one chain begins at \"{}\"; candidate tips are {}{}; expected one chain; name the tip "
        "link",
        base->name, quoted(candidates), parting);
  }

  std::vector<::urdf::JointSharedPtr> joints_between(const LinkPtr& base, const LinkPtr& tip) const {
    std::vector<::urdf::JointSharedPtr> joints;
    for (LinkPtr link = tip; link != base; link = link->getParent()) {
      if (!link || !link->parent_joint) {
        document_.fail(
            "the tip link \"{}\" is not outboard of the base link \"{}\"; expected a chain from base to tip; "
            "name other links",
            tip->name, base->name);
      }
      joints.push_back(link->parent_joint);
    }
    std::reverse(joints.begin(), joints.end());
    return joints;
  }

  Placement checked_placement(const ::urdf::Joint& joint) const {
    const Placement placement = placement_of(joint.parent_to_joint_origin_transform);
    if (!placement.p.allFinite() || !placement.R.allFinite()) {
      const XmlElement& element = document_.known_joint(joint.name);
      document_.fail_at(Document::nearest(element, {"origin"}),
                        "joint \"{}\": its origin is not finite; expected numbers", joint.name);
    }
    return placement;
  }

  std::array<double, 3> gravity_in_base() const {
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> mount(
        options_.mount_rotation.data());
    const Eigen::Map<const Eigen::Vector3d> gravity(options_.gravity.data());
    if (!gravity.allFinite()) document_.fail("gravity is not finite; expected three numbers [m/s²]");
    if (!mount.allFinite() ||
        (mount.transpose() * mount - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() > 1e-6 ||
        mount.determinant() < 0.0) {
      document_.fail(
          "the mounting is not a rotation matrix; expected orthonormal rows and determinant 1; check its "
          "entries");
    }
    Eigen::Vector3d turned = snapped(Eigen::Matrix3d(mount)).transpose() * gravity;
    // Rounding must not make a level base look tilted.
    const double rounding = 1e-15 * gravity.norm();
    turned = turned.unaryExpr([rounding](double value) { return std::abs(value) <= rounding ? 0.0 : value; });
    return {turned.x(), turned.y(), turned.z()};
  }

  model::RobotJoint make_joint(const ::urdf::Joint& joint, const Placement& placement) const {
    const XmlElement& element = document_.known_joint(joint.name);
    model::RobotJoint result;
    result.name = joint.name;
    result.link_name = joint.child_link_name;
    const bool prismatic = joint.type == ::urdf::Joint::PRISMATIC;
    if (!prismatic && joint.type != ::urdf::Joint::REVOLUTE && joint.type != ::urdf::Joint::CONTINUOUS) {
      document_.fail_at(
          element,
          "joint \"{}\": type \"{}\" is on the chain; expected revolute, continuous, prismatic or fixed; "
          "name a base link behind it or change its type",
          joint.name, *element.attribute("type"));
    }
    if (joint.mimic) {
      document_.fail_at(Document::nearest(element, {"mimic"}),
                        "joint \"{}\" mimics \"{}\"; expected joints that move on their "
                        "own; name a tip link before it, or fix the joint",
                        joint.name, joint.mimic->joint_name);
    }
    result.joint.type = prismatic ? JointType::kPrismatic : JointType::kRevolute;
    store(snapped(placement.R), result.joint.rotation);
    store(snapped(placement.p), result.joint.position);

    const Eigen::Vector3d axis(joint.axis.x, joint.axis.y, joint.axis.z);
    if (!axis.allFinite() || axis.norm() < 1e-9) {
      document_.fail_at(Document::nearest(element, {"axis"}),
                        "joint \"{}\": its axis is ({:.6g} {:.6g} {:.6g}); expected a "
                        "direction other than zero; correct <axis xyz>",
                        joint.name, axis.x(), axis.y(), axis.z());
    }
    const Eigen::Vector3d unit =
        axis.normalized().unaryExpr([](double value) { return snapped(value, 1e-12); });
    store(unit, result.joint.axis);

    read_limits(joint, element, result);
    if (joint.dynamics) {
      const double friction = joint.dynamics->friction;
      const double damping = joint.dynamics->damping;
      const bool in_range = (friction >= 0.0 && damping >= 0.0) || options_.accept_impossible_values;
      if (!std::isfinite(friction) || !std::isfinite(damping) || !in_range) {
        document_.fail_at(Document::nearest(element, {"dynamics"}),
                          "joint \"{}\": friction {:.6g} and damping {:.6g}; expected "
                          "finite numbers not below zero; correct <dynamics>",
                          joint.name, friction, damping);
      }
      result.actuation.coulomb_friction = friction;
      result.actuation.viscous_friction = damping;
    }
    return result;
  }

  void read_limits(const ::urdf::Joint& joint, const XmlElement& element, model::RobotJoint& result) const {
    if (!joint.limits) return;  // a continuous joint; check_limits has seen to the others
    const XmlElement& line = Document::nearest(element, {"limit"});
    const ::urdf::JointLimits& limits = *joint.limits;
    if (joint.type != ::urdf::Joint::CONTINUOUS) {
      if (!(limits.lower < limits.upper)) {
        document_.fail_at(line,
                          "joint \"{}\": position limits from {:.6g} to {:.6g}; expected lower below upper; "
                          "correct <limit>",
                          joint.name, limits.lower, limits.upper);
      }
      result.lower = limits.lower;
      result.upper = limits.upper;
    }
    if (!(limits.velocity >= 0.0) || !(limits.effort >= 0.0)) {
      document_.fail_at(
          line,
          "joint \"{}\": velocity limit {:.6g} and effort limit {:.6g}; expected numbers not below zero; "
          "correct <limit>",
          joint.name, limits.velocity, limits.effort);
    }
    if (limits.velocity > 0.0) result.velocity_limit = limits.velocity;
    if (limits.effort > 0.0) result.effort_limit = limits.effort;
  }

  /// Inertia of the link that a joint moves, with everything fixed to it.
  void fill_link(model::RobotJoint& joint, bool is_last) {
    Body body;
    attach(model_.getLink(joint.link_name), Placement{}, body);
    const XmlElement& element = document_.known_link(joint.link_name);
    const bool has_inertia = !body.inertia.isZero(0.0);  // without mass: only where that is accepted
    if (body.mass == 0.0 && !has_inertia) {
      if (is_last) {
        document_.fail_at(
            element,
            "link \"{}\" is the last that moves and has no mass, nor has anything fixed to it; expected "
            "<inertial> with a positive mass; add it or name another tip link",
            joint.link_name);
      }
      warn(document_.at(
          element,
          fmt::format("link \"{}\" moves but has no mass, nor has anything fixed to it; it is taken as "
                      "massless",
                      joint.link_name)));
    }
    joint.link = body.parameters();
  }

  /// @param fixed  the link is fixed to the one that moves
  void attach(const LinkPtr& link, const Placement& placement, Body& body, bool fixed = false) {
    // A frame without mass, such as a tool centre point, is often given an inertia that some programs ask for.
    const bool frame = fixed && link->inertial && link->inertial->mass == 0.0;
    if (link->inertial && !frame) add_inertial(*link, placement, body);
    for (const auto& joint : link->child_joints) {
      const LinkPtr child = child_of(link, joint->name);
      if (!moves(*joint)) {
        attach(child, placement * checked_placement(*joint), body, true);
      } else if (!on_chain_.contains(joint->name)) {
        warn(document_.at(
            document_.known_joint(joint->name),
            fmt::format(
                "joint \"{}\" moves but is not on the chain: link \"{}\" and what it carries ({:.6g} kg) "
                "are left out",
                joint->name, child->name, mass_outboard(child))));
      }
    }
  }

  static double mass_outboard(const LinkPtr& link) {
    double mass = link->inertial ? link->inertial->mass : 0.0;
    for (const auto& child : link->child_links) mass += mass_outboard(child);
    return mass;
  }

  void add_inertial(const ::urdf::Link& link, const Placement& placement, Body& body) {
    const ::urdf::Inertial& inertial = *link.inertial;
    const XmlElement& element = document_.known_link(link.name);
    const Placement own = placement * placement_of(inertial.origin);
    const Eigen::Matrix3d inertia = inertia_of(inertial);
    if (!std::isfinite(inertial.mass) || !(inertial.mass > 0.0 || options_.accept_impossible_values)) {
      document_.fail_at(Document::nearest(element, {"inertial", "mass"}),
                        "link \"{}\": mass {:.6g} kg; expected a positive "
                        "number on a moving link; correct it, or remove <inertial> from a link without mass",
                        link.name, inertial.mass);
    }
    if (!own.p.allFinite() || !own.R.allFinite() || !inertia.allFinite()) {
      document_.fail_at(Document::nearest(element, {"inertial"}),
                        "link \"{}\": its inertial values are not all finite; expected "
                        "numbers; correct them",
                        link.name);
    }
    if (const std::string reason = impossibility(inertia); !reason.empty()) {
      const std::string message =
          document_.at(Document::nearest(element, {"inertial", "inertia"}),
                       fmt::format("link \"{}\": {}; check units and about-point", link.name, reason));
      if (options_.refuse_impossible_inertia) throw UrdfError(message);
      warn(message);
    }
    const Eigen::Matrix3d turned = own.R * inertia * own.R.transpose();
    body.add(inertial.mass, snapped(own.p), 0.5 * (turned + turned.transpose()));
  }

  const Document& document_;
  const ::urdf::ModelInterface& model_;
  const UrdfOptions& options_;
  std::vector<std::string>* warnings_;
  std::set<std::string> on_chain_;
};

}  // namespace

model::Robot build_chain(const Document& document, const ::urdf::ModelInterface& model,
                         const UrdfOptions& options, std::vector<std::string>* warnings) {
  return ChainBuilder(document, model, options, warnings).build();
}

}  // namespace heft::urdf
