/// @file
/// Unscented Kalman filter on motion, drifting friction and load of an arm.
#pragma once

#include <cmath>

#include "heft/core/estimate/detail/drift_filter.hpp"

namespace heft {

namespace detail {

/// The step at 2 s sigma points x ± √s √D_k U_k (s states). Each pair gives a difference and a mean: the differences take the
/// place of A U, and the scatter of the means, which linearising does not see, is extra columns. All weights are
/// positive, so that the factors of the result come from one orthogonalisation, without a matrix that might
/// have lost its definiteness.
template <typename Scalar, int N, int Load>
class SigmaPointStep {
 public:
  using Arm = DriftingArm<Scalar, N, Load>;
  using Layout = DriftLayout<N, Load>;
  using Mechanics = typename Arm::Mechanics;
  static constexpr int kExtra = Layout::kStates;
  using Columns = StepColumns<Scalar, N, Load, kExtra>;

  Status propagate(Arm& arm, const typename Arm::State& x, const UdFactors<Scalar, Layout::kStates>& P,
                   const typename Arm::Vector& tau, const Scalar& dt, Mechanics& change,
                   Columns& out) noexcept {
    using std::sqrt;
    // At the centre: what a torque does, and the friction that is open.
    if (const Status status = arm.step(x, tau, dt, change); status != Status::kOk) {
      return status;
    }
    arm.gain(dt, out.of_torque);
    out.uncertain = arm.uncertain_friction();

    constexpr int kStates = Layout::kStates;
    const Scalar spread = sqrt(static_cast<Scalar>(kStates));
    mean_.setZero();
    for (int c = 0; c < kStates; ++c) {
      const std::size_t k = static_cast<std::size_t>(c);
      const Scalar deviation = sqrt(P.pivot(k));
      Mechanics up, down;
      if (const Status status = step_from(arm, x, P, k, spread * deviation, tau, dt, up);
          status != Status::kOk) {
        return status;
      }
      if (const Status status = step_from(arm, x, P, k, -spread * deviation, tau, dt, down);
          status != Status::kOk) {
        return status;
      }
      const Scalar scale = Scalar(1) / (Scalar(2) * spread * deviation);
      for (int i = 0; i < 2 * N; ++i) {
        const Scalar before = i < c ? P.upper(static_cast<std::size_t>(i), k) : Scalar(i == c ? 1 : 0);
        out.of_factors(i, c) = before + (up[i] - down[i]) * scale;
        out.extra(i, c) = Scalar(0.5) * ((up[i] - change[i]) + (down[i] - change[i]));
        mean_[i] += out.extra(i, c);
      }
    }
    mean_ *= Scalar(1) / static_cast<Scalar>(kStates);
    for (int c = 0; c < kStates; ++c) {
      for (int i = 0; i < 2 * N; ++i) {
        out.extra(i, c) = (out.extra(i, c) - mean_[i]) / spread;
      }
    }
    change += mean_;
    return Status::kOk;
  }

 private:
  Status step_from(Arm& arm, const typename Arm::State& x, const UdFactors<Scalar, Layout::kStates>& P,
                   std::size_t k, const Scalar& way, const typename Arm::Vector& tau, const Scalar& dt,
                   Mechanics& change) noexcept {
    point_ = x;
    for (std::size_t i = 0; i < k; ++i) {
      point_[i] += way * P.upper(i, k);
    }
    point_[k] += way;
    return arm.step(point_, tau, dt, change);
  }

  typename Arm::State point_{};
  Mechanics mean_ = Mechanics::Zero();
};

}  // namespace detail

/// The estimate of ExtendedKalmanFilter with sigma points (S. J. Julier, J. K. Uhlmann, A new extension of the Kalman filter to
/// nonlinear systems, 1997, with κ = 0) in the place of derivatives: the same interface, settings and faults. It sees how the
/// friction curve bends over the uncertainty of the velocity, near standstill above all, and costs six times as much.
///
/// Cost, 6 joints, no load: 131 000 multiplications, and 760 a measured value; every twentieth sample 7000 more.
template <typename Scalar, int N, int Load = 0>
using UnscentedKalmanFilter = detail::DriftFilter<Scalar, N, Load, detail::SigmaPointStep<Scalar, N, Load>>;

}  // namespace heft
