/// @file
/// Which combinations of parameters the torque depends on at all.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/regression/regression_columns.hpp"

namespace heft::regression {

/// The base parameters β = G x of a regression: the smallest set that gives the same torque, in any motion.
///
/// β_i is the i-th kept parameter plus a combination of the dropped ones; the torque is the kept columns of
/// the regressor times β.
struct BaseParameters {
  std::vector<int> kept;       ///< b columns of the regression, ascending
  Eigen::MatrixXd regrouping;  ///< G, b × p; its kept columns are the identity
  /// b closed forms: "Izz1 + Iyy2 + Iyy3 + 0.375 m3".
  std::vector<std::string> expressions;
  /// What no motion of this arm shows, in words: "the mass of link 1 moves no torque", "Iyy2 is felt only
  /// together with Izz1".
  std::vector<std::string> null_space;
  double gap{0.0};  ///< smallest kept pivot over largest dropped one: how clear-cut the rank is

  int count() const { return static_cast<int>(kept.size()); }  ///< b
  /// Name of the i-th base parameter: that of the kept one, with an asterisk when others are grouped with it.
  std::string name(const RegressionColumns& columns, int i) const;
};

struct BaseOptions {
  int samples{0};          ///< random states; 0: six times the columns a joint
  std::uint64_t seed{1};   ///< of the random motion
  double tolerance{1e-9};  ///< of a column's part that the columns before it do not explain, against its norm
};

/// Base parameters found numerically: random states (positions over a full turn or 1 m, velocities and
/// accelerations of 1), their regressors stacked, columns scaled to norm 1, then QR with the columns taken in
/// the order in which the field keeps them: links from the base out, within a link inertias and first moments
/// before Iyy, mcz and mass, so that groups form on the link nearer to the base as Khalil and Gautier do [1].
/// A column that the ones before it explain is dropped and its share of each found by back substitution.
///
/// [1] M. Gautier, Numerical calculation of the base inertial parameters of robots, J. Robotic Systems 8 (1991).
///
/// Cost: O(samples n p²), 30 ms for six joints.
BaseParameters find_base_parameters(const RegressionColumns& columns, const BaseOptions& options = {});

}  // namespace heft::regression
