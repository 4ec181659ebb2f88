// A base that is not level.
#include <cmath>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>

#include "../arm_search.hpp"
#include "heft/model/dynamics.hpp"

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

std::vector<Candidate> propose_tilt(const Workbench& bench, const std::vector<bool>&) {
  Candidate c(BaseTilt{});
  c.columns = tilt_columns(bench);
  c.trial = judge(bench, c);
  return {std::move(c)};
}

/// @param c  horizontal part of gravity; the vertical part keeps the length
void apply_tilt(const Candidate&, const VectorXd& c, model::Robot& robot) {
  const Vector3d g(robot.gravity.data());
  const auto [first, second] = horizontal_directions(robot);
  Vector3d tilted = g + c[0] * first + c[1] * second;
  tilted *= g.norm() / tilted.norm();
  robot.gravity = {tilted.x(), tilted.y(), tilted.z()};
}

void describe_tilt(const Candidate&, const VectorXd& c, const model::Robot& robot, Finding& finding) {
  const double g = Vector3d(robot.gravity.data()).norm();
  finding.parameters = {{"tilt_deg", std::atan2(std::hypot(c[0], c[1]), g) * 180.0 / std::numbers::pi},
                        {"azimuth_deg", std::atan2(c[1], c[0]) * 180.0 / std::numbers::pi}};
}

}  // namespace

Columns tilt_columns(const Workbench& bench) {
  const int n = bench.table->num_joints;
  const auto [first, second] = horizontal_directions(*bench.robot);
  Columns columns;
  columns.joints = all_joints(n);
  columns.values.assign(static_cast<std::size_t>(n), MatrixXd(bench.table->rows(), 2));
  int column = 0;
  for (const Vector3d& direction : {first, second}) {
    model::Robot robot = *bench.robot;
    robot.gravity = {direction.x(), direction.y(), direction.z()};
    const model::Dynamics dynamics(robot);
    for (Index i = 0; i < bench.table->rows(); ++i) {
      const VectorXd tau = dynamics.gravity_torque(bench.motion->link_q.row(i).transpose());
      for (int j = 0; j < n; ++j) columns.values[static_cast<std::size_t>(j)](i, column) = tau[j];
    }
    ++column;
  }
  return columns;
}

ArmSearch search_of(BaseTilt) { return {propose_tilt, apply_tilt, describe_tilt}; }

}  // namespace heft::diagnose
