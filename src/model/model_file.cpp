#include "heft/model/model_file.hpp"

#include <array>
#include <cmath>

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "name_at.hpp"

namespace heft::model {
namespace {

/// Link frames further apart than what files round to.
bool frames_differ(const Joint<double>& a, const Joint<double>& b) {
  constexpr double kRounding = 1e-4;
  const auto far = [](const auto& u, const auto& v) {
    for (std::size_t i = 0; i < u.size(); ++i) {
      if (std::abs(u[i] - v[i]) > kRounding) return true;
    }
    return false;
  };
  return a.type != b.type || far(a.rotation, b.rotation) || far(a.position, b.position) ||
         far(a.axis, b.axis);
}

}  // namespace

ModelFile make_model(const Robot& robot) {
  ModelFile model;
  model.robot = robot.name;
  for (const RobotJoint& joint : robot.joints) {
    model.link_names.push_back(joint.link_name);
    model.joint_names.push_back(joint.name);
    model.links.push_back(joint.link);
    model.actuation.push_back(joint.actuation);
  }
  model.couplings = robot.couplings;
  model.cables = robot.cables;
  model.effects = robot.effects;
  model.elasticities = robot.elasticities;
  model.torque_delay = robot.torque_delay;
  KinematicsRecord& kinematics = model.kinematics.emplace();
  kinematics.base_link = robot.base_link;
  kinematics.tip_link = robot.tip_link;
  for (const RobotJoint& joint : robot.joints) {
    kinematics.joints.push_back(
        {joint.joint, joint.lower, joint.upper, joint.velocity_limit, joint.effort_limit});
  }
  kinematics.gravity = robot.gravity;
  kinematics.tip_rotation = robot.tip_rotation;
  kinematics.tip_position = robot.tip_position;
  return model;
}

Robot make_robot(const ModelFile& model) {
  if (!model.kinematics) {
    throw ModelError(
        fmt::format("{}: /kinematics: missing; expected the joint frames of robot \"{}\"; give its URDF "
                    "with --urdf as well, or fit the model again",
                    model.path.empty() ? "model" : model.path, model.robot));
  }
  const KinematicsRecord& kinematics = *model.kinematics;
  Robot robot;
  robot.name = model.robot;
  robot.base_link = kinematics.base_link;
  robot.tip_link = kinematics.tip_link;
  robot.gravity = kinematics.gravity;
  robot.tip_rotation = kinematics.tip_rotation;
  robot.tip_position = kinematics.tip_position;
  for (std::size_t k = 0; k < kinematics.joints.size(); ++k) {
    const KinematicsRecord::JointPlace& place = kinematics.joints[k];
    robot.joints.push_back({name_at(model.joint_names, k),
                            name_at(model.link_names, k),
                            place.joint,
                            {},
                            {},
                            place.lower,
                            place.upper,
                            place.velocity_limit,
                            place.effort_limit});
  }
  apply(model, robot);
  return robot;
}

namespace {

/// @throws ModelError when the model is of other joints than the robot
void refuse_other_joints(const ModelFile& model, const Robot& robot, const std::string& where) {
  if (model.num_joints() != robot.num_joints()) {
    throw ModelError(
        fmt::format("{}: the model has {} joints; expected {}, as robot \"{}\" has; "
                    "use the model with the URDF that it was made with",
                    where, model.num_joints(), robot.num_joints(), robot.name));
  }
  for (std::size_t k = 0; k < robot.joints.size(); ++k) {
    const std::string name = name_at(model.joint_names, k);
    if (!name.empty() && name != robot.joints[k].name) {
      throw ModelError(
          fmt::format("{}: /joints/{}/name: found \"{}\"; expected \"{}\", as in robot \"{}\"; "
                      "use the model with the URDF that it was made with",
                      where, k, name, robot.joints[k].name, robot.name));
    }
  }
}

/// The model's gravity, where both chains begin at the same link.
void take_gravity(const KinematicsRecord& kinematics, const std::string& where, Robot& robot,
                  std::vector<std::string>* notes) {
  const std::array<double, 3>& gravity = kinematics.gravity;
  const std::array<double, 3> own = robot.gravity;
  const bool same_base =
      kinematics.base_link.empty() || robot.base_link.empty() || kinematics.base_link == robot.base_link;
  if (same_base) robot.gravity = gravity;
  const double apart = std::hypot(gravity[0] - own[0], gravity[1] - own[1], gravity[2] - own[2]);
  constexpr double kRounding = 1e-6;  // [m/s²]
  if (notes == nullptr || apart < kRounding) return;
  notes->push_back(fmt::format(
      "{}: the model was made with gravity ({:.6g}, {:.6g}, {:.6g}) m/s², robot \"{}\" "
      "has ({:.6g}, {:.6g}, {:.6g}); {}",
      where, gravity[0], gravity[1], gravity[2], robot.name, own[0], own[1], own[2],
      same_base ? "the model's is used" : "the robot's is used, since its chain begins at another link"));
}

}  // namespace

void apply(const ModelFile& model, Robot& robot, std::vector<std::string>* notes) {
  const std::string where = model.path.empty() ? "model" : model.path;
  refuse_other_joints(model, robot, where);
  if (notes != nullptr && !model.robot.empty() && model.robot != robot.name) {
    notes->push_back(fmt::format("{}: the model was made for robot \"{}\" and is used with \"{}\"", where,
                                 model.robot, robot.name));
  }
  if (notes != nullptr && model.kinematics) {
    for (std::size_t k = 0; k < robot.joints.size(); ++k) {
      if (!frames_differ(model.kinematics->joints[k].joint, robot.joints[k].joint)) continue;
      notes->push_back(
          fmt::format("{}: joint {} of robot \"{}\" is elsewhere than when the model was made; the model's "
                      "parameters are about its own link frames",
                      where, k + 1, robot.name));
      break;
    }
  }
  for (std::size_t k = 0; k < robot.joints.size(); ++k) {
    robot.joints[k].link = model.links[k];
    robot.joints[k].actuation = model.actuation[k];
  }
  robot.couplings = model.couplings;
  robot.cables = model.cables;
  robot.effects = model.effects;
  robot.elasticities = model.elasticities;
  robot.torque_delay = model.torque_delay;
  if (model.kinematics) take_gravity(*model.kinematics, where, robot, notes);
}

ModelFile read_model(const std::string& path) { return parse_model(host::read_file(path, "model"), path); }

void write_model(const std::string& path, const ModelFile& model) {
  host::write_file_atomically(path, to_json(model));
}

}  // namespace heft::model
