/// @file
/// Whether the joints agree about a load: what each feels of it, against what all together say it is.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "heft/payload/payload.hpp"

namespace heft::payload {

/// Sums by which the torque of each joint, less what the arm explains, is fitted by s times the torque of the load
/// found plus a change of the joint's own friction: r = s (w x) + c sign(q̇) + v q̇. A joint whose torque has another
/// scale than the others has another s.
class TorqueScales {
 public:
  explicit TorqueScales(int joints);

  /// Adds a row of one joint.
  /// @param load      of the regressor, for the ten parameters of the load
  /// @param friction  Coulomb, viscous
  void add(int block, int joint, const Eigen::VectorXd& load, const Eigen::VectorXd& friction,
           double residual);
  /// The same row's dependence on the arm's own parameters. Summed over the whole log: after a change of load the
  /// model's share of the interval is too wide rather than too narrow.
  void add_dependence(int joint, const Eigen::VectorXd& load, const Eigen::VectorXd& friction,
                      const Eigen::VectorXd& arm);

  /// @param members, merge  blocks as in BlockJackknife::solve
  /// @param edge_factor     of the covariance, see ResidualStatistics
  /// @param x               the load found, 10
  /// @param model           covariance of the arm's parameters; absent: its error is left out
  /// @return one a joint
  std::vector<Estimated> solve(const std::vector<int>& members, int merge, double edge_factor,
                               const Eigen::VectorXd& x, const std::optional<Eigen::MatrixXd>& model) const;

  /// Change of the load found for a change of each joint's torque scale by 1, p × n: ∂x/∂ln s_i = −A⁻¹ Σ wᵀ (w x)/σ² over
  /// the rows of joint i.
  /// @param information_inverse  A⁻¹ of all parameters: ten of the load, Coulomb and viscous of each joint
  /// @param noise_variance       σ² of each joint's rows
  Eigen::MatrixXd gain_sensitivity(const std::vector<int>& members, const Eigen::VectorXd& x,
                                   const Eigen::MatrixXd& information_inverse,
                                   const Eigen::VectorXd& noise_variance) const;

 private:
  static constexpr int kColumns = 12;  ///< ten of the load, two of friction
  using Moments = Eigen::Matrix<double, kColumns + 1, kColumns + 1>;

  std::vector<std::vector<Moments>> blocks_;  ///< [block][joint]
  std::vector<Eigen::MatrixXd> dependence_;   ///< [joint]: kColumns × size of the arm's parameters
  int joints_;
};

}  // namespace heft::payload
