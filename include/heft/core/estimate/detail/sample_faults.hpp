/// @file
/// What may be wrong with a sample whose numbers are finite: dropouts before it, jumps, frozen encoders, clipped torques.
#pragma once

#include <cmath>
#include <cstdint>

#include "heft/core/arm_geometry.hpp"

namespace heft::detail {

/// Looks at one sample after the other. Knows no model.
template <typename Scalar, int N>
class SampleFaults {
 public:
  using Vector = JointVector<Scalar, N>;

  struct Found {
    std::uint32_t frozen{0};   ///< bit i: position i stands although its velocity does not
    std::uint32_t clipped{0};  ///< bit i: torque i is or was at its limit, as far as a filter remembers
    bool disturbed{false};     ///< what a filter holds of the motion is wrong from here on
  };

  /// @param period  nominal time between samples [s]
  void start(const Scalar& period) noexcept {
    *this = SampleFaults{};
    period_ = period;
  }

  /// @param before,velocity_before  the sample before
  /// @param limit  of torques
  /// @param cut    bit i: torque i is known to be cut, whatever was measured
  /// @param omega  of the filter behind [1/s]
  Found look(const Vector& before, const Vector& velocity_before, const Vector& q, const Vector& qd,
             const Vector& tau, const Vector& limit, const Scalar& elapsed, const Scalar& omega,
             std::uint32_t cut = 0) noexcept {
    using std::abs;
    Found found;
    // A line between two samples is no motion once they are further apart than usual and than the filter averages.
    found.disturbed = elapsed > Scalar(kGap) * period_ && elapsed * omega > Scalar(1);
    const Scalar remembered = Scalar(kMemory) / omega;
    for (int i = 0; i < N; ++i) {
      const std::uint32_t bit = std::uint32_t{1} << i;
      const Scalar way = abs(q[i] - before[i]);
      const Scalar speed = abs(qd[i]) > abs(velocity_before[i]) ? abs(qd[i]) : abs(velocity_before[i]);
      if (q[i] == before[i]) {
        // With its sign: the noise of a velocity at rest leads nowhere.
        const Scalar stood = stood_[i] + qd[i] * elapsed;
        stood_[i] = stood > Scalar(1) ? Scalar(1) : stood < Scalar(-1) ? Scalar(-1) : stood;
      } else {
        found.disturbed = found.disturbed || abs(stood_[i]) > static_cast<Scalar>(kLongestWay) ||
                          way > Scalar(2) * speed * elapsed + static_cast<Scalar>(kLongestWay);
        stood_[i] = Scalar(0);
      }
      found.frozen |= abs(stood_[i]) > static_cast<Scalar>(kLongestWay) ? bit : 0U;
      clipped_[i] = abs(tau[i]) >= limit[i] || (cut & bit) != 0 ? remembered
                    : clipped_[i] > elapsed                     ? clipped_[i] - elapsed
                                                                : Scalar(0);
      found.clipped |= clipped_[i] > Scalar(0) ? bit : 0U;
    }
    return found;
  }

 private:
  static constexpr int kGap = 5;      ///< usual periods that no jitter reaches
  static constexpr int kMemory = 10;  ///< time constants of the filter after which a value is forgotten
  /// A position may miss this much of what the velocity says [rad, m]: coarse encoders, and a velocity that is late.
  static constexpr double kLongestWay = 0.02;

  Vector stood_ = Vector::Zero();    ///< way that the velocity has covered while the position stood [rad, m]
  Vector clipped_ = Vector::Zero();  ///< time until a limit is forgotten [s]
  Scalar period_{0};
};

}  // namespace heft::detail
