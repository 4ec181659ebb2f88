// Poses at which to look at the tool, and a path that compensates for its sag.
#include <algorithm>
#include <cmath>

#include "heft/stiffness/stiffness.hpp"

namespace heft::stiffness {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// As many as a table takes.
constexpr std::size_t kMostPoses = 12;

std::vector<NamedPose> poses_measured_at(const DeflectionAnswer& answer) {
  std::vector<NamedPose> named;
  for (const PoseInfluence& influence : answer.fit.poses) {
    if (named.size() == kMostPoses) break;
    const auto pose = std::find_if(answer.poses.begin(), answer.poses.end(),
                                   [&](const LoadedPose& p) { return p.name == influence.name; });
    named.push_back({influence.name, pose->q});
  }
  return named;
}

/// Zero for a joint without limits.
VectorXd middle_of_ranges(const model::Robot& robot) {
  VectorXd q = VectorXd::Zero(robot.num_joints());
  for (int j = 0; j < robot.num_joints(); ++j) {
    const model::RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
    if (std::isfinite(joint.lower + joint.upper)) q[j] = 0.5 * (joint.lower + joint.upper);
  }
  return q;
}

}  // namespace

std::vector<NamedPose> poses_to_look_at(const Stiffness& stiffness, const MatrixXd& path) {
  if (stiffness.deflections) return poses_measured_at(*stiffness.deflections);
  if (stiffness.encoders) return {};
  if (path.rows() > 0) return {{"first of the path", path.row(0).transpose()}};
  return {{"middle of the ranges", middle_of_ranges(stiffness.robot)}};
}

data::Log compensated(data::Log path, const PathSag& sag) {
  path.q = sag.compensated;
  path.qd.resize(path.q.rows(), 0);
  path.qdd.resize(path.q.rows(), 0);
  return path;
}

}  // namespace heft::stiffness
