/// @file
/// Core's run-time dynamics at many states at once, as many side by side as the processor computes.
#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "heft/model/regressor_rows.hpp"
#include "heft/model/robot.hpp"

namespace heft::model {

/// How many states are computed side by side, by the instructions that it takes. The results are the same to the last
/// bit: which one runs is a matter of time alone.
enum class Lanes {
  kBaseline,  ///< 2: what every processor of this kind has
  kAvx2,      ///< 4
  kAvx512     ///< 8
};
/// "baseline", "AVX2", "AVX-512".
const char* to_string(Lanes lanes);
/// Whether this build has them and this processor can run them.
bool is_available(Lanes lanes);
/// The most that is available.
Lanes widest_lanes();

/// Dynamics of a robot's rigid bodies at m states, for whom the calls of Dynamics are too slow one by one.
///
/// States are m × n matrices, a row a state, as logs have them. Every value is that of Dynamics at this state to the last
/// bit (but for the sign of a zero) where the compiler leaves products and sums apart, as on x86-64; elsewhere within
/// rounding. Nothing is kept between calls, which may come from several threads at once. Cost: bench/dynamics_bench.
class BatchDynamics {
 public:
  /// m × n: q [rad, m], qd, qdd; a block of rows of a matrix is taken as it is.
  using States = Eigen::Ref<const Eigen::MatrixXd>;
  using Result = Eigen::Ref<Eigen::MatrixXd>;

  /// @param lanes  available ones
  /// @throws ModelError when the robot has no joint or more than kMaxJoints, or the lanes are not available
  explicit BatchDynamics(const Robot& robot, Lanes lanes = widest_lanes());
  ~BatchDynamics();
  BatchDynamics(BatchDynamics&&) noexcept;
  BatchDynamics& operator=(BatchDynamics&&) noexcept;

  int num_joints() const;
  Lanes lanes() const;

  /// Rigid-body inverse dynamics with gravity, without actuation terms.
  /// @param tau  m × n [N·m, N]
  /// @throws ModelError, as all of these, for matrices whose sizes do not fit the robot or each other
  void inverse_dynamics(const States& q, const States& qd, const States& qdd, Result tau) const;
  Eigen::MatrixXd inverse_dynamics(const States& q, const States& qd, const States& qdd) const;
  /// Gravity torque, m × n.
  Eigen::MatrixXd gravity_torque(const States& q) const;

  /// Rows of the regressor, joint by joint and only the columns asked for: of one joint most are known to be zero.
  /// @param columns  n lists of columns of Dynamics::regressor (0 to 14n − 1), for each joint those of its matrix, each
  ///                 once in a list. Coulomb columns with the sharp sign, 0 at standstill.
  /// @param rows     made m × columns[j].size(); its storage is used again
  void regressor_rows(const States& q, const States& qd, const States& qdd,
                      const std::vector<std::vector<int>>& columns, RegressorRows& rows) const;
  /// The same columns for every joint: all 14n when none are named; the columns that a set of base parameters keeps make
  /// the base regressor.
  std::vector<Eigen::MatrixXd> regressor_rows(const States& q, const States& qd, const States& qdd,
                                              const std::vector<int>& columns = {}) const;

  /// Joint-space mass matrices of the rigid bodies (no rotor inertia), a row a state.
  /// @param mass  m × n²: M(i, j) in column i + n j
  void mass_matrix(const States& q, Result mass) const;

  /// Accelerations that torques give: (M + rotor inertia) q̈ = τ − bias, without friction.
  /// @param qdd  m × n
  /// @throws ModelError naming the first row whose mass matrix is not positive definite
  void forward_dynamics(const States& q, const States& qd, const States& tau, Result qdd) const;
  /// The same with all that drives add to the mass matrix, in place of rotor inertia alone.
  /// @param drives  n × n, symmetric (rotors, gear couplings) [kg·m², kg]
  void forward_dynamics(const States& q, const States& qd, const States& tau, const Eigen::MatrixXd& drives, Result qdd) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace heft::model
