#include "load_geometry.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <random>

#include <fmt/format.h>

#include "heft/core/inertia.hpp"
#include "heft/host/decompositions.hpp"

namespace heft::payload {

Eigen::Matrix<double, 10, 10> to_flange(const model::Robot& robot) {
  std::array<double, 9> turn{};
  std::array<double, 3> origin{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      turn[3 * i + j] = robot.tip_rotation[3 * j + i];
      origin[i] -= robot.tip_rotation[3 * j + i] * robot.tip_position[j];
    }
  }
  Eigen::Matrix<double, 10, 10> T;
  for (std::size_t c = 0; c < 10; ++c) {
    InertialParameters<double> unit{};
    unit[c] = 1.0;
    const InertialParameters<double> column =
        to_inertial_parameters(moved(to_pseudo_inertia(unit), turn, origin));
    for (std::size_t r = 0; r < 10; ++r)
      T(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c)) = column[r];
  }
  return T;
}

bool mass_is_visible(const model::Dynamics& dynamics, int first) {
  const int n = dynamics.num_joints();
  const int rows = n - first;
  const int states = 40;
  std::mt19937 generator(2);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  Eigen::MatrixXd W(states * rows, 9);
  Eigen::VectorXd y(states * rows);
  Eigen::VectorXd q(n), qd(n), qdd(n);
  for (int k = 0; k < states; ++k) {
    for (int i = 0; i < n; ++i) {
      q[i] = 3.0 * uniform(generator);
      qd[i] = 2.0 * uniform(generator);
      qdd[i] = 5.0 * uniform(generator);
    }
    const Eigen::MatrixXd Y = dynamics.regressor(q, qd, qdd).middleCols(10 * (n - 1), 10);
    y.segment(k * rows, rows) = Y.col(0).tail(rows);
    W.middleRows(k * rows, rows) = Y.rightCols(9).bottomRows(rows);
  }
  const Eigen::VectorXd rest = y - W * least_squares(W, y);
  return rest.norm() > 1e-8 * std::sqrt(static_cast<double>(y.size()));
}

std::string joint_range(int first, int last) {
  return first == last ? fmt::format("joint {}", last) : fmt::format("joints {} to {}", first, last);
}

std::string hidden_mass(int first, int last) {
  return fmt::format(
      "the torque of {} does not depend on the mass of the load, whatever the motion, only on its first "
      "moment and inertia; use more rows (--rows with a smaller K)",
      joint_range(first, last));
}

double friction_prior(const model::Robot& robot, int first, const Eigen::VectorXd& residual_std,
                      bool behind_gears) {
  if (behind_gears) return 1e-6;
  double largest = 1.0;
  for (auto i = static_cast<std::size_t>(first); i < robot.joints.size(); ++i) {
    const JointActuation<double>& drive = robot.joints[i].actuation;
    largest = std::max({largest, std::abs(drive.coulomb_friction), std::abs(drive.viscous_friction),
                        3.0 * residual_std[static_cast<Eigen::Index>(i)]});
  }
  return largest;
}

statistics::Interval centre_of_mass(const Eigen::VectorXd& parameters, const Eigen::MatrixXd& covariance,
                                    Eigen::Index row, const statistics::Interval& mass, double factor) {
  const double m = mass.value;
  if (!(std::abs(m) > mass.half_width())) return {};
  const double c = parameters[row] / m;
  Eigen::VectorXd slope = Eigen::VectorXd::Zero(10);
  slope[row] = 1.0 / m;
  slope[0] = -c / m;
  return statistics::Interval::around(c, std::sqrt(slope.dot(covariance * slope)), factor);
}

}  // namespace heft::payload
