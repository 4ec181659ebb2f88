/// @file
/// Where the level of friction is not known: at rest, around reversals, and on the way on which it creeps to its level.
#pragma once

#include <cmath>

#include "heft/core/arm_geometry.hpp"

namespace heft::detail {

template <typename Scalar, int N>
class FrictionDoubt {
 public:
  using Vector = JointVector<Scalar, N>;

  /// One sample more.
  /// @param qd      velocities [rad/s, m/s]
  /// @param way     since the sample before [rad, m]
  /// @param slow    below it friction has no sign [rad/s, m/s]
  /// @param forget  what the filter that torques pass keeps of the past over this sample, 0 to 1: it remembers what was not known
  /// @return all joints are slow
  bool look(const Vector& qd, const Vector& way, const Scalar& slow, const Scalar& forget) noexcept {
    using std::abs;
    bool all_slow = true;
    for (int i = 0; i < N; ++i) {
      const bool stands = abs(qd[i]) < slow;
      const bool creeps = stands || slid_[i] < static_cast<Scalar>(kCreep);
      slid_[i] = stands ? Scalar(0) : creeps ? slid_[i] + abs(way[i]) : slid_[i];
      doubt_[i] = creeps ? Scalar(1) : doubt_[i] * forget;
      all_slow = all_slow && stands;
    }
    return all_slow;
  }

  /// Variance of the friction of a joint with this level: anything between minus and plus it, in doubt.
  Scalar variance(int joint, const Scalar& level) const noexcept {
    const Scalar friction = doubt_[joint] * level;
    return friction * friction * static_cast<Scalar>(1.0 / 3.0);
  }

 private:
  /// Way after a rest or a reversal on which friction creeps to its level [rad, m]: some thousandths with harmonic drives.
  static constexpr double kCreep = 0.007;

  Vector doubt_ = Vector::Ones();  ///< 0 to 1
  Vector slid_ = Vector::Zero();   ///< since the last rest or reversal [rad, m]
};

}  // namespace heft::detail
