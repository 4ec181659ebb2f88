// A base that is not level.
#include <cmath>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>

#include "../arm_search.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/model/batch_dynamics.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// Two horizontal directions in the base frame, square to gravity; x and y for gravity along -z.
std::pair<Vector3d, Vector3d> horizontal_directions(const model::Robot& robot) {
  const Vector3d down = Vector3d(robot.gravity.data()).normalized();
  Vector3d first = Vector3d::UnitX() - down.x() * down;
  if (first.norm() < 0.1) first = Vector3d::UnitY() - down.y() * down;
  first.normalize();
  return {first, first.cross(down)};
}

/// Torque of gravity in some poses, m × n.
MatrixXd gravity_torque(model::Robot robot, const Vector3d& gravity, const MatrixXd& q) {
  robot.gravity = {gravity.x(), gravity.y(), gravity.z()};
  return model::BatchDynamics(robot).gravity_torque(q);
}

/// @param change  of the links' parameters, 10 n
void add_to_links(const VectorXd& change, model::Robot& robot) {
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    for (std::size_t k = 0; k < 10; ++k) robot.joints[j].link[k] += change[static_cast<Index>(10 * j + k)];
  }
}

/// The torque that a change of the links' parameters adds.
MatrixXd gravity_torque_of(const VectorXd& change, model::Robot robot, const Vector3d& gravity, const MatrixXd& q) {
  for (model::RobotJoint& joint : robot.joints) joint.link = {};
  add_to_links(change, robot);
  return gravity_torque(std::move(robot), gravity, q);
}

/// Directions among the links' parameters that level ground hides and a tilt shows, 10 n × h: a first moment about an upright
/// axis turns no joint until the axis leans.
/// @param horizontal  part of gravity
MatrixXd shown_by_tilt(const Workbench& bench, const Vector3d& horizontal) {
  const MatrixXd hidden = bench.base->hidden_masses();
  constexpr Index kPoses = 200;
  const MatrixXd& q = bench.motion->link_q;
  MatrixXd poses(kPoses, q.cols());
  for (Index k = 0; k < kPoses; ++k) poses.row(k) = q.row(k * (q.rows() - 1) / (kPoses - 1));
  MatrixXd torque(kPoses * q.cols(), hidden.cols());
  for (Index c = 0; c < hidden.cols(); ++c)
    torque.col(c) = gravity_torque_of(hidden.col(c), *bench.robot, horizontal, poses).reshaped();
  const Svd svd = svd_of(triangle_of(torque));
  // Of what a unit of mass or first moment pulls when it lies across: less is zero but for rounding. Not of the largest, which
  // is such a zero itself where a tilt shows nothing, as on a gantry, whose slides have shown it all.
  const double least = 1e-6 * horizontal.norm() * std::sqrt(static_cast<double>(kPoses));
  Index shown = 0;
  while (shown < svd.values.size() && svd.values[shown] > least) ++shown;
  return hidden * svd.V.leftCols(shown);
}

std::vector<Candidate> propose_tilt(const Workbench& bench, const std::vector<bool>&) {
  Candidate c(BaseTilt{});
  put_tilt_columns(bench, c);
  c.trial = judge(bench, c, bench.least_gain);
  return {std::move(c)};
}

/// @param c  horizontal part of gravity, of which the vertical part keeps the length; then the masses that only a tilt shows
void apply_tilt(const Candidate& tilt, const VectorXd& c, model::Robot& robot) {
  const Vector3d g(robot.gravity.data());
  const auto [first, second] = horizontal_directions(robot);
  Vector3d tilted = g + c[0] * first + c[1] * second;
  tilted *= g.norm() / tilted.norm();
  robot.gravity = {tilted.x(), tilted.y(), tilted.z()};
  if (tilt.hidden.cols() > 0) add_to_links(tilt.hidden * c.segment(2, tilt.hidden.cols()), robot);
}

void describe_tilt(const Candidate&, const VectorXd& c, const model::Robot& robot, Finding& finding) {
  const double g = Vector3d(robot.gravity.data()).norm();
  finding.parameters = {{"tilt_deg", std::atan2(std::hypot(c[0], c[1]), g) * 180.0 / std::numbers::pi},
                        {"azimuth_deg", std::atan2(c[1], c[0]) * 180.0 / std::numbers::pi}};
}

}  // namespace

/// Two columns, of the horizontal part of gravity with the masses of the fit; from the second fit on, around that tilt, those of
/// the masses that only it shows.
void put_tilt_columns(const Workbench& bench, Candidate& tilt) {
  const auto [first, second] = horizontal_directions(*bench.robot);
  const Vector3d horizontal = tilt.tilt[0] * first + tilt.tilt[1] * second;
  tilt.hidden.resize(10 * bench.table->num_joints, 0);
  if (horizontal.norm() > 0.0) tilt.hidden = shown_by_tilt(bench, horizontal);
  const MatrixXd& q = bench.motion->link_q;
  std::vector<MatrixXd> torques;
  for (const Vector3d& direction : {first, second}) torques.push_back(gravity_torque(*bench.robot, direction, q));
  for (Index h = 0; h < tilt.hidden.cols(); ++h)
    torques.push_back(gravity_torque_of(tilt.hidden.col(h), *bench.robot, horizontal, q));
  tilt.columns.joints = all_joints(bench.table->num_joints);
  tilt.columns.values.assign(tilt.columns.joints.size(), MatrixXd(q.rows(), static_cast<Index>(torques.size())));
  for (std::size_t j = 0; j < tilt.columns.values.size(); ++j) {
    for (std::size_t c = 0; c < torques.size(); ++c)
      tilt.columns.values[j].col(static_cast<Index>(c)) = torques[c].col(static_cast<Index>(j));
  }
}

ArmSearch search_of(BaseTilt) { return {propose_tilt, apply_tilt, describe_tilt}; }

}  // namespace heft::diagnose
