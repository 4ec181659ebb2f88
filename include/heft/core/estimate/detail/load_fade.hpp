/// @file
/// From one load to the next, for a model that must not jump.
#pragma once

#include <cstddef>

#include "heft/core/arm_model.hpp"

namespace heft::detail {

/// The load that a model is to have, and the one that it has on the way there.
template <typename Scalar>
class LoadFade {
 public:
  using Load = InertialParameters<Scalar>;

  void start(const Scalar& transition_time) noexcept {
    *this = LoadFade{};
    time_ = transition_time;
  }

  /// A share of the way to an estimate; the transition, if one is due, begins.
  void approach(const Load& estimate) noexcept {
    constexpr Scalar kShare{static_cast<Scalar>(0.2)};
    for (std::size_t i = 0; i < goal_.size(); ++i) {
      goal_[i] = (Scalar(1) - kShare) * goal_[i] + kShare * estimate[i];
    }
    // On its way to nothing a load becomes nothing, before its digits are lost below the smallest normal number.
    if (goal_[kMass] < static_cast<Scalar>(1e-9)) {
      goal_ = {};
    }
    going_ = true;
  }

  /// Another load from now on: the present one stays until approach() or go_to().
  void hold() noexcept {
    advance(Scalar(0));
    from_ = now_;
    progress_ = Scalar(0);
    going_ = false;
  }
  void go_to(const Load& load) noexcept {
    going_ = load != goal_;
    goal_ = load;
  }

  void advance(const Scalar& elapsed) noexcept {
    if (!going_) {
      return;
    }
    if (progress_ < Scalar(1)) {
      progress_ = time_ > elapsed ? progress_ + elapsed / time_ : Scalar(1);
    }
    if (!(progress_ < Scalar(1))) {
      now_ = goal_;
      return;
    }
    // A sum of two bodies; as a difference, rounding would leave what is no body where one of them is nearly gone.
    const Scalar left = Scalar(1) - progress_;
    for (std::size_t i = 0; i < now_.size(); ++i) {
      now_[i] = left * from_[i] + progress_ * goal_[i];
    }
  }

  const Load& goal() const noexcept { return goal_; }
  const Load& now() const noexcept { return now_; }

 private:
  Load goal_{}, now_{}, from_{};
  Scalar time_{0}, progress_{1};
  bool going_{false};
};

}  // namespace heft::detail
