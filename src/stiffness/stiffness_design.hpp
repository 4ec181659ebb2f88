/// @file
/// The regression behind fit_stiffness: compliances and whatever else moved the instrument, linear in both; its solution;
/// what it predicts for poses left out.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/stiffness/deflection_fit.hpp"

namespace heft::stiffness {

/// Joints of each compliance: as asked for, or each joint its own.
std::vector<std::vector<int>> groups_of(const StiffnessOptions& options, int n);

/// Whether a reading is of a rotation.
bool is_rotation(const LoadedPose& pose, Eigen::Index reading);

/// Whether two have the same pose and the same load, to rounding.
bool same_load(const LoadedPose& a, const LoadedPose& b);

/// y = B x, m readings.
struct Design {
  Eigen::MatrixXd B;
  Eigen::VectorXd y;
  Eigen::VectorXd weight;  ///< of a row: 1 / standard deviation, or `scale` where none is stated
  Eigen::VectorXd scale;   ///< makes a residual a length: 1 for displacements
  std::vector<int> name_of_row;
  std::vector<std::string> names;
  bool stated_noise{false};
};

/// @param compliance  of the n joints, for K_C; empty leaves K_C out
Design stiffness_design(const model::Kinematics& kinematics, const std::vector<LoadedPose>& poses,
                        const StiffnessOptions& options, const Eigen::VectorXd& compliance, double length);

struct Solution {
  Eigen::VectorXd x;             ///< least squares, the smallest where columns depend on each other
  Eigen::MatrixXd inverse;       ///< (Bᵀ W² B)⁻¹, on what is determined
  std::vector<bool> determined;  ///< of each column
  int rank{0};
  double condition{0.0};
};
Solution solve(const Design& design);

/// M with M y = scale (y − B x without the poses of the row's own name), m × m: errors on poses left out, without
/// fitting again. Rows of poses that cannot be left out are 0.
/// @param solution  of the design
/// @param possible  of each name, whether the others determine its readings; may be null
Eigen::MatrixXd left_out_operator(const Design& design, const Solution& solution,
                                  std::vector<bool>* possible);

}  // namespace heft::stiffness
