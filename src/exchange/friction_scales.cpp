#include "heft/exchange/friction_scales.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "heft/host/error.hpp"
#include "left_out.hpp"
#include "load.hpp"

namespace heft::exchange {
namespace {

using model::Robot;
using model::RobotJoint;

double scale_of(const std::string& joint, const char* what, double own, double of_controller) {
  refuse_negative(joint, what, own);
  if (!(of_controller > 0.0) || !std::isfinite(of_controller)) {
    throw ModelError(fmt::format("joint \"{}\": found {} {:.4g} in the controller's model; expected what the "
                                 "controller compensates for, above zero; fit a model to its target torque or current",
                                 joint, what, of_controller));
  }
  return own / of_controller;
}

/// Whether it is friction; of the rest of the robot the controller has a model of its own.
bool is_friction(const LeftOut& left) {
  constexpr std::string_view kNone[] = {"spring", "rotor_inertia", "torque_scale", "ripple"};
  if (left.what == "friction_offset") return true;
  return joint_effect_kind(left.what) >= 0 && std::find(std::begin(kNone), std::end(kNone), left.what) == std::end(kNone);
}

std::string limited_list(const std::vector<double>& scales) {
  std::vector<double> limited = scales;
  for (double& scale : limited) scale = std::clamp(scale, 0.0, 1.0);
  return fmt::format("[{:.3f}]", fmt::join(limited, ", "));
}

}  // namespace

FrictionScales friction_scales(const Robot& robot, const Robot& controller) {
  if (robot.num_joints() != controller.num_joints()) {
    throw ModelError(fmt::format("the controller's model has {} joints; expected the {} of the robot \"{}\"",
                                 controller.num_joints(), robot.num_joints(), robot.name));
  }
  FrictionScales scales;
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    const RobotJoint &own = robot.joints[j], &other = controller.joints[j];
    if (own.name != other.name) {
      throw ModelError(fmt::format("joint {} of the controller's model is \"{}\"; expected \"{}\", as in that of the robot",
                                   j + 1, other.name, own.name));
    }
    scales.viscous.push_back(
        scale_of(own.name, "viscous friction", own.actuation.viscous_friction, other.actuation.viscous_friction));
    scales.coulomb.push_back(
        scale_of(own.name, "Coulomb friction", own.actuation.coulomb_friction, other.actuation.coulomb_friction));
  }
  const auto all = [&](double scale) {
    const auto is = [scale](double value) { return value == scale; };
    return std::all_of(scales.viscous.begin(), scales.viscous.end(), is) &&
           std::all_of(scales.coulomb.begin(), scales.coulomb.end(), is);
  };
  if (all(0.0)) {
    throw ModelError(fmt::format("robot \"{}\": found no friction in any joint; expected that of the arm as measured; give a "
                                 "model that was fitted to its logs",
                                 robot.name));
  }
  if (all(1.0)) {
    throw ModelError(fmt::format("robot \"{}\" and the controller's model have the same friction to the last digit; expected "
                                 "two models, one fitted to the measured torque and one to the controller's own",
                                 robot.name));
  }
  return scales;
}

RobotText ur_friction_scales(const Robot& robot, const Robot& controller) {
  if (robot.num_joints() != 6) {
    throw ModelError(fmt::format("robot \"{}\": found {} joints; expected the 6 of an arm by Universal Robots", robot.name,
                                 robot.num_joints()));
  }
  const FrictionScales scales = friction_scales(robot, controller);
  std::string text = fmt::format(
      "# Friction of {} in parts of what the controller compensates for: 0 none of it, 1 all of it.\n"
      "# PolyScope 5.25.1, PolyScope X 10.12.1 and later; the same two lists are those of ur_msgs/FrictionModelParameters.\n",
      robot.name);
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    for (const auto& [what, scale] : {std::pair{"viscous", scales.viscous[j]}, {"Coulomb", scales.coulomb[j]}}) {
      if (scale > 1.0)
        text += fmt::format("# {}: {} friction is {:.2f} of the controller's; the scale ends at 1, {:.0f} % stay.\n",
                            robot.joints[j].name, what, scale, 100.0 * (1.0 - 1.0 / scale));
    }
  }
  text += fmt::format(
      "global viscous_scale = {}\nglobal coulomb_scale = {}\n"
      "# direct_torque(torque, viscous_scale=viscous_scale, coulomb_scale=coulomb_scale)\n",
      limited_list(scales.viscous), limited_list(scales.coulomb));
  RobotText written{std::move(text), left_out(robot, {.rotor_inertia = true, .spring = true, .gravity = true})};
  std::erase_if(written.left_out, [](const LeftOut& left) { return !is_friction(left); });
  return written;
}

RobotFormat friction_scales_format() { return {"ur-friction", "friction for Universal Robots' direct_torque"}; }

}  // namespace heft::exchange
