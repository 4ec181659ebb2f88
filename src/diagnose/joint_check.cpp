#include "joint_check.hpp"

#include <algorithm>
#include <cmath>

#include "residual_structure.hpp"

namespace heft::diagnose {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// @return the column's global number
int append(const MatrixXd& values, int joint, Problem& problem) {
  Columns columns;
  columns.joints = {joint};
  columns.values = {values};
  return problem.append(columns);
}

/// Whether one column, with a coefficient above 0, is all that stands between a joint's rows and those of the others.
bool lacks_only(const Eigen::Ref<const VectorXd>& column, const Problem& problem, int joint) {
  Problem with(problem);
  const int added = append(column, joint, with);
  with.reweight();
  return with.theta()[added] > 0.0 && with.noise()[joint] < kTimesAloneWithColumn * with.noise_alone()[joint];
}

/// Whether all that a joint lacks is a spring about it or the inertia of its motor.
bool lacks_spring_or_motor(const Problem& problem, const MotionTable& table, int joint) {
  return lacks_only(table.q.col(joint), problem, joint) || lacks_only(table.qdd.col(joint), problem, joint);
}

}  // namespace

std::vector<NotExplained> not_explained(const Problem& fitted, const MotionTable& table) {
  Problem problem(fitted);
  for (int j = 0; j < table.num_joints; ++j) append(MatrixXd::Ones(table.rows(), 1), j, problem);
  problem.reweight();
  const VectorXd together = problem.noise(), alone = problem.noise_alone();
  const VectorXd noise = white_noise(table, fitted.keep(), problem.residual());

  std::vector<NotExplained> found;
  for (int j = 0; j < table.num_joints; ++j) {
    const auto counted = fitted.keep().col(j).array() > 0.0;
    const double rows = static_cast<double>(counted.count());
    if (!(rows > 30.0)) continue;
    const Eigen::ArrayXd torque = counted.select(table.tau.col(j).array(), 0.0);
    const double largest = torque.abs().maxCoeff();
    const double variance = torque.square().sum() / rows - std::pow(torque.sum() / rows, 2);
    const double square = together[j] * together[j], white = std::min(noise[j] * noise[j], square);
    if (!(variance > white) || together[j] < kSmallError * largest) continue;
    const double explained = 1.0 - (square - white) / (variance - white);
    const double contradicted = (square - alone[j] * alone[j]) / variance;
    const bool contradicts = contradicted >= kContradicts && together[j] >= kTimesAlone * alone[j];
    if (explained >= kExplainsNothing && (!contradicts || lacks_spring_or_motor(problem, table, j))) continue;
    found.push_back(
        {j, together[j], alone[j], std::sqrt(square / variance), together[j] / largest, contradicts});
  }
  std::stable_sort(found.begin(), found.end(), [](const NotExplained& a, const NotExplained& b) {
    return a.share_of_largest > b.share_of_largest;
  });
  return found;
}

}  // namespace heft::diagnose
