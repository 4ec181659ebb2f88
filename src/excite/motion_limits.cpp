#include "heft/excite/motion_limits.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/host/numbers.hpp"
#include "heft/host/settings_reader.hpp"
#include "robot_words.hpp"

namespace heft::excite {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

using std::numbers::pi;
// Lengths beyond this are slips of a unit or of the keyboard.
constexpr double kLongest = 1e4;  // [m]

/// Floor, box, obstacles, tool and clearance.
void check_space(const model::Robot& robot, const MotionLimits& limits) {
  const auto refuse = [&](const std::string& text) {
    throw ModelError(fmt::format("robot \"{}\": {}", robot.name, text));
  };
  const auto length = [&](double value, const char* what) {
    if (!(std::abs(value) <= kLongest)) {
      refuse(fmt::format("{}: found {:.6g} m, expected a length of at most {:g} m", what, value, kLongest));
    }
  };
  if (!(limits.clearance >= 0.0)) {
    refuse(fmt::format("clearance: found {}, expected at least 0", limits.clearance));
  }
  length(limits.clearance, "clearance");
  length(limits.tool.norm(), "tool");
  if (!(limits.tool_radius >= 0.0))
    refuse(fmt::format("tool_radius: found {}, expected at least 0", limits.tool_radius));
  length(limits.tool_radius, "tool_radius");
  if (limits.floor) length(*limits.floor, "floor");
  if (!(limits.tool_speed > 0.0)) {
    refuse(fmt::format("tool speed: found {} m/s, expected more than 0", limits.tool_speed));
  }
  for (const collision::BoxObstacle& box : limits.obstacles) {
    for (Index a = 0; a < 3; ++a) {
      length(box.lower[a], "obstacles");
      length(box.upper[a], "obstacles");
      if (!(box.lower[a] < box.upper[a])) {
        refuse(fmt::format("obstacle \"{}\": found {:.6g} to {:.6g} along {}, expected lower < upper",
                           box.name, box.lower[a], box.upper[a], "xyz"[a]));
      }
    }
  }
  if (limits.box) {
    for (Index a = 0; a < 3; ++a) {
      if (!((*limits.box)[0][a] + limits.clearance < (*limits.box)[1][a] - limits.clearance)) {
        refuse(fmt::format("box: found {} to {} along {} with clearance {}, expected room between",
                           (*limits.box)[0][a], (*limits.box)[1][a], "xyz"[a], limits.clearance));
      }
    }
  }
}

/// ±π about 0, or about the middle of the range where that leaves out 0.
void take_one_turn(double& lower, double& upper) {
  if (lower <= -pi && upper >= pi) {
    lower = -pi;
    upper = pi;
    return;
  }
  const double middle = 0.5 * (lower + upper);
  lower = middle - pi;
  upper = middle + pi;
}

}  // namespace

MotionLimits limits_of(const model::Robot& robot, const LimitDefaults& defaults) {
  const Index n = robot.num_joints();
  MotionLimits limits;
  limits.lower.resize(n);
  limits.upper.resize(n);
  limits.velocity.resize(n);
  limits.torque.resize(n);
  limits.acceleration = VectorXd::Constant(n, kInfinity);
  for (Index j = 0; j < n; ++j) {
    const model::RobotJoint& joint = joint_of(robot, j);
    double lower = joint.lower, upper = joint.upper;
    if (joint.joint.type == JointType::kRevolute) {
      if (!std::isfinite(lower) || !std::isfinite(upper)) {
        lower = std::isfinite(lower) ? lower : std::isfinite(upper) ? upper - 2 * pi : -pi;
        upper = std::isfinite(upper) ? upper : lower + 2 * pi;
      }
      if (!defaults.full_turns && upper - lower > 2 * pi) take_one_turn(lower, upper);
    }
    limits.lower[j] = lower;
    limits.upper[j] = upper;
    limits.velocity[j] = joint.velocity_limit;
    limits.torque[j] = joint.effort_limit;
  }
  // Up in the base frame; the base is upright when its z leans less than 45° from it.
  const Vector3d up = -vector_of(robot.gravity).normalized();
  if (up.z() > std::sqrt(0.5)) limits.floor = 0.0;
  limits.clearance = (defaults.without_bodies ? 0.05 : 0.02) * collision::arm_length(robot);
  limits.tool_speed = defaults.tool_speed;
  if (!defaults.without_bodies) {
    limits.shapes = defaults.shapes;
    limits.arm = collision::arm_capsules(robot, defaults.shapes);
  }
  return limits;
}

LimitsFile read_limits(const model::Robot& robot, const std::string& path, MotionLimits limits) {
  const int n = robot.num_joints();
  const host::SettingsReader reader = host::SettingsReader::parse(host::read_file(path, "limits"), path);
  LimitsFile file{std::move(limits), {}, {}};
  const auto take = [&](const char* key, host::Range range, VectorXd& value) {
    const VectorXd found = reader.numbers_or_none(key, n, range);
    if (found.size() > 0) value = found;
  };
  MotionLimits& read = file.limits;
  take("lower", host::Range::kAny, read.lower);
  take("upper", host::Range::kAny, read.upper);
  take("velocity", host::Range::kPositive, read.velocity);
  take("acceleration", host::Range::kPositive, read.acceleration);
  take("torque", host::Range::kPositive, read.torque);
  for (Index j = 0; j < n; ++j) {
    if (read.lower[j] >= read.upper[j]) {
      throw ModelError(
          fmt::format("{}: {}: found lower {} and upper {} [rad, m], expected lower < upper; what the file "
                      "leaves out comes from the URDF",
                      path, joint_name(robot, j), read.lower[j], read.upper[j]));
    }
  }
  read.margin = reader.number_or("margin", read.margin, host::Range::kNotNegative);
  read.clearance = reader.number_or("clearance", read.clearance, host::Range::kNotNegative);
  read.tool_speed = reader.number_or("tool_speed", read.tool_speed, host::Range::kPositive);
  if (reader.has("floor")) {
    if (reader.is_text("floor")) {
      reader.word("floor", {"none"});
      read.floor.reset();
    } else {
      read.floor = reader.number("floor");
    }
  }
  if (reader.has("box")) {
    const MatrixXd box = reader.table("box", 2, 3);
    read.box = std::array<Vector3d, 2>{box.row(0), box.row(1)};
  }
  if (reader.has("obstacles")) {
    for (const host::SettingsReader& obstacle : reader.objects("obstacles")) {
      collision::BoxObstacle box;
      box.name = obstacle.has("name") ? obstacle.text("name")
                                      : fmt::format("obstacle {}", read.obstacles.size() + 1);
      box.lower = obstacle.numbers("lower", 3);
      box.upper = obstacle.numbers("upper", 3);
      obstacle.finish();
      read.obstacles.push_back(std::move(box));
    }
  }
  if (reader.has("tool")) read.tool = reader.numbers("tool", 3);
  read.tool_radius = reader.number_or("tool_radius", read.tool_radius, host::Range::kNotNegative);
  take("start", host::Range::kAny, file.start);
  take("torque_noise", host::Range::kPositive, file.torque_noise);
  reader.finish();
  try {
    check_space(robot, read);
  } catch (const ModelError& error) {
    throw ModelError(fmt::format("{}: {}", path, error.what()));
  }
  return file;
}

void check_limits(const model::Robot& robot, const MotionLimits& limits) {
  const Index n = robot.num_joints();
  const auto refuse = [&](const std::string& text) {
    throw ModelError(fmt::format("robot \"{}\": {}", robot.name, text));
  };
  const auto sized = [&](const VectorXd& v, const char* what) {
    if (v.size() != n)
      refuse(fmt::format("{}: found {} numbers, expected {}, one a joint", what, v.size(), n));
  };
  sized(limits.lower, "lower position limits");
  sized(limits.upper, "upper position limits");
  sized(limits.velocity, "velocity limits");
  sized(limits.acceleration, "acceleration limits");
  sized(limits.torque, "torque limits");
  if (!(limits.margin >= 0.0 && limits.margin < 1.0)) {
    refuse(fmt::format("margin: found {}, expected 0 to below 1", limits.margin));
  }
  for (Index j = 0; j < n; ++j) {
    const std::string name = joint_name(robot, j);
    if (!std::isfinite(limits.lower[j]) || !std::isfinite(limits.upper[j])) {
      refuse(fmt::format("{}: position limits: found {} to {}, expected finite ones; state them", name,
                         limits.lower[j], limits.upper[j]));
    }
    if (!(limits.lower[j] < limits.upper[j])) {
      refuse(fmt::format("{}: position limits: found lower {} and upper {}, expected lower < upper", name,
                         limits.lower[j], limits.upper[j]));
    }
    if (!(limits.velocity[j] > 0.0) || !std::isfinite(limits.velocity[j])) {
      refuse(
          fmt::format("{}: velocity limit: found {}, expected a finite one above 0; a joint that must not "
                      "move cannot be excited",
                      name, limits.velocity[j]));
    }
    if (!(limits.acceleration[j] > 0.0)) {
      refuse(fmt::format("{}: acceleration limit: found {}, expected more than 0", name,
                         limits.acceleration[j]));
    }
    if (!(limits.torque[j] > 0.0)) {
      refuse(fmt::format("{}: torque limit: found {}, expected more than 0", name, limits.torque[j]));
    }
    const double coulomb = joint_of(robot, j).actuation.coulomb_friction;
    if (!(limits.torque[j] * (1.0 - limits.margin) > coulomb)) {
      refuse(
          fmt::format("{}: torque limit: found {} with margin {}, expected more than the {} that Coulomb "
                      "friction alone takes",
                      name, limits.torque[j], limits.margin, coulomb));
    }
  }
  check_space(robot, limits);
}

}  // namespace heft::excite
