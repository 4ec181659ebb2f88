/// @file
/// An arm in lanes behind an interface that every instruction set has in a file of its own.
///
/// A function that is emitted in a file compiled for AVX-512 must never be the one that the linker keeps for the rest of
/// the program: on an older processor that is an illegal instruction. So these files share nothing with the others that
/// the linker could merge: what they compute with are packs of their own width, hence types of their own; their classes
/// have no name outside; and they are optimised in every build, so that small functions of other types (std::array,
/// Eigen's) are inlined. `LaneSymbols` in test/model looks at the objects.
#pragma once

#include <cstddef>

namespace heft::model {

/// m states: q of joint j at q[j * q_step], m numbers in a row; qd and qdd likewise.
struct LaneStates {
  const double* q;
  const double* qd;
  const double* qdd;
  std::ptrdiff_t q_step, qd_step, qdd_step;
  std::ptrdiff_t count;  ///< m, at least width()
};

class LaneArm {
 public:
  LaneArm() = default;
  LaneArm(const LaneArm&) = delete;
  LaneArm& operator=(const LaneArm&) = delete;
  virtual ~LaneArm();

  virtual std::ptrdiff_t width() const noexcept = 0;
  /// @param tau  of joint j from tau[j * step] on
  virtual void inverse_dynamics(const LaneStates& states, double* tau, std::ptrdiff_t step) const noexcept = 0;
  /// @param places  n × 10n row by row: where the m numbers of an entry go, those that nobody wants to one place (a store
  ///                costs less than asking); zeros of links inboard of a joint are not written
  virtual void regressor(const LaneStates& states, double* const* places) const noexcept = 0;
  /// @param mass  of column c (i + n j) from mass[c * step] on; qd and qdd are not looked at
  virtual void mass_matrix(const LaneStates& states, double* mass, std::ptrdiff_t step) const noexcept = 0;
  /// @param states  with torques in the place of qdd
  /// @param drives  n × n column by column: added to the mass matrix
  /// @return m, or less: from this state on one of width() states has no positive definite mass matrix
  virtual std::ptrdiff_t forward_dynamics(const LaneStates& states, const double* drives, double* qdd,
                                          std::ptrdiff_t step) const noexcept = 0;
};

/// Makes an arm in lanes.
/// @param joints  1 to kMaxJoints
/// @param arm     a DynamicArm<double, joints>
/// @return null for another number of joints
using MakeLaneArm = LaneArm*(int joints, const void* arm);
MakeLaneArm make_baseline_arm, make_avx2_arm, make_avx512_arm;

}  // namespace heft::model
