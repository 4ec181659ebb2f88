// From rows of a file to poses under load: in the base frame, repeats merged.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "heft/stiffness/deflection_fit.hpp"
#include "heft/stiffness/dexterity.hpp"

#include "stiffness_design.hpp"

namespace heft::stiffness {

using Eigen::Index;
using Eigen::Vector3d;

namespace {

void check_limits(const model::Robot& robot, const data::Deflection& row) {
  // Encoders are read with some error; a pose at a stop may read a little beyond it.
  constexpr double kSlack = 1e-3;
  for (int j = 0; j < robot.num_joints(); ++j) {
    const model::RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
    const double q = row.q[j];
    if (q < joint.lower - kSlack || q > joint.upper + kSlack) {
      const bool degrees = joint.joint.type == JointType::kRevolute && std::abs(q) > 7.0;
      throw DataError(
          fmt::format("{}: column 'q{}': pose '{}' has joint {} at {:g}, outside its limits [{:g}, {:g}]; "
                      "expected a pose the robot "
                      "can take{}; correct the pose or the limits in the URDF",
                      row.where, j + 1, row.pose, j + 1, q, joint.lower, joint.upper,
                      degrees ? " in rad (this looks like degrees)" : ""));
    }
  }
}

/// A row of the file in the base frame, not yet merged with its repeats.
LoadedPose on_robot(const model::Kinematics& kinematics, const data::Deflection& row) {
  check_limits(kinematics.robot(), row);
  LoadedPose pose;
  pose.name = row.pose;
  pose.q = row.q;
  pose.tool = kinematics.tip_and_jacobian(row.q, pose.J);
  const Eigen::Matrix3d axes =
      row.tool_axes ? pose.tool.rotation : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
  pose.wrench << axes * row.force, axes * row.moment;
  pose.follows = row.tool_axes ? WrenchFrame::kTool : WrenchFrame::kBase;
  pose.point = pose.tool.rotation * row.point;
  const auto m = static_cast<Index>(row.readings.size());
  pose.rows.resize(m, 6);
  pose.values.resize(m);
  pose.sigmas.resize(m);
  pose.scatter.setConstant(m, kNaN);
  for (Index r = 0; r < m; ++r) {
    const data::DeflectionReading& reading = row.readings[static_cast<std::size_t>(r)];
    const Vector3d u = axes * reading.direction;
    // A point p off the tip moves by δp + δω × p: along u that is u·δp + (p × u)·δω.
    if (reading.rotation) {
      pose.rows.row(r) << Eigen::RowVector3d::Zero(), u.transpose();
    } else {
      pose.rows.row(r) << u.transpose(), pose.point.cross(u).transpose();
    }
    pose.values[r] = reading.value;
    pose.sigmas[r] = reading.sigma;
  }
  return pose;
}

/// Relative to the load; poses [rad], rows [1]: rounding of a file.
constexpr double kSame = 1e-9;

bool same_measurement(const LoadedPose& a, const LoadedPose& b) {
  return a.name == b.name && a.rows.rows() == b.rows.rows() && same_load(a, b) &&
         (a.rows - b.rows).norm() < kSame;
}

/// Mean, scatter and the deviation of the mean of repeats.
LoadedPose merged(const std::vector<LoadedPose>& repeats) {
  LoadedPose pose = repeats.front();
  const auto count = static_cast<double>(repeats.size());
  if (repeats.size() < 2) return pose;
  pose.repeats = static_cast<int>(repeats.size());
  pose.values.setZero();
  for (const LoadedPose& repeat : repeats) pose.values += repeat.values / count;
  pose.scatter.setZero(pose.values.size());
  for (const LoadedPose& repeat : repeats) {
    pose.scatter.array() += (repeat.values - pose.values).array().square() / (count - 1.0);
  }
  pose.scatter = pose.scatter.cwiseSqrt();
  pose.sigmas /= std::sqrt(count);
  return pose;
}

}  // namespace

bool same_load(const LoadedPose& a, const LoadedPose& b) {
  return (a.q - b.q).norm() < kSame && (a.wrench - b.wrench).norm() < kSame * a.wrench.norm();
}

std::vector<LoadedPose> loaded_poses(const model::Kinematics& kinematics,
                                     const std::vector<data::Deflection>& rows, double length) {
  std::vector<std::vector<LoadedPose>> repeats;
  for (const data::Deflection& row : rows) {
    LoadedPose pose = on_robot(kinematics, row);
    const auto found = std::find_if(repeats.begin(), repeats.end(),
                                    [&](const auto& known) { return same_measurement(known.front(), pose); });
    if (found == repeats.end()) {
      repeats.push_back({std::move(pose)});
    } else {
      found->push_back(std::move(pose));
    }
  }
  std::vector<LoadedPose> poses;
  for (const auto& same : repeats) poses.push_back(merged(same));
  if (length <= 0.0) length = shared_length(poses);
  for (LoadedPose& pose : poses) pose.dexterity = dexterity(pose.J, length);
  return poses;
}

double shared_length(const std::vector<LoadedPose>& poses) {
  double square = 0.0;
  for (const LoadedPose& pose : poses) {
    square += std::pow(rms_axis_distance(pose.J), 2) / static_cast<double>(poses.size());
  }
  return square > 0.0 ? std::sqrt(square) : 1.0;
}

}  // namespace heft::stiffness
