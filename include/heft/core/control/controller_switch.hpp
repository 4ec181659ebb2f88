/// @file
/// Several controllers, one of them in charge, exchanged at run time without a jump of the torque.
#pragma once

#include <cstddef>
#include <tuple>
#include <type_traits>

#include <Eigen/Core>

#include "heft/core/control/arm_controller.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// Bumpless transfer: the torque of the cycle of a switch is the one applied before it, within the new controller's limits. The
/// difference to what the new controller wants fades along a cubic within `fade_time`, so that it changes by at
/// most 1.5 · difference · dt / fade_time a cycle.
///
/// Controllers that are not in charge watch: their estimators go on. What a controller believes of the load stays its own;
/// where it is to be handed over, call set_load() of the next one before select().
///
/// It is an ArmController itself. Cost: the controller in charge, and the estimators of the others.
///
/// @tparam Controllers  of as many joints, with the same Scalar
template <ArmController First, ArmController... Others>
class ControllerSwitch {
 public:
  using Scalar = typename First::Scalar;
  static constexpr int kNumJoints = First::kNumJoints;
  using Vector = typename First::Vector;
  using Reference = typename First::Reference;
  using Measurement = typename First::Measurement;
  using Step = typename First::Step;
  static constexpr std::size_t kCount = 1 + sizeof...(Others);
  static_assert((std::is_same_v<Step, typename Others::Step> && ...), "one Scalar, one number of joints");

  /// @param fade_time  > 0 [s]
  /// @return kOutOfRange: the old one is kept
  Status set_fade_time(Scalar fade_time) noexcept {
    if (!(fade_time > Scalar(0)) || !is_usable(fade_time)) {
      return Status::kOutOfRange;
    }
    fade_time_ = fade_time;
    return Status::kOk;
  }

  /// A controller, to be configured before it is in charge.
  template <std::size_t I>
  auto& get() noexcept {
    return std::get<I>(controllers_);
  }
  template <std::size_t I>
  const auto& get() const noexcept {
    return std::get<I>(controllers_);
  }

  /// Puts a controller in charge, from the next step on; the one that is already stays undisturbed.
  /// @return kOutOfRange: no such controller, nothing changed
  Status select(std::size_t which) noexcept {
    if (which >= kCount) {
      return Status::kOutOfRange;
    }
    if (which != active_) {
      active_ = which;
      if (started_) {
        hand_over(fade_time_);
      }
    }
    return Status::kOk;
  }
  std::size_t active() const noexcept { return active_; }

  Step step(const Reference& reference, const Measurement& measured) noexcept {
    Step out;
    visit([&](auto& controller, bool in_charge) {
      if (in_charge) {
        out = controller.step(reference, measured);
      } else {
        controller.watch(measured);
      }
    });
    applied_ = out.torque;
    started_ = true;
    return out;
  }

  void watch(const Measurement& measured) noexcept {
    visit([&](auto& controller, bool) { controller.watch(measured); });
  }

  void take_over(const Vector& torque, Scalar fade_time) noexcept {
    applied_ = torque;
    started_ = true;
    hand_over(fade_time);
  }

 private:
  template <typename F>
  void visit(F&& f) noexcept {
    std::apply(
        [&](auto&... controllers) {
          std::size_t at = 0;
          (f(controllers, at++ == active_), ...);
        },
        controllers_);
  }

  void hand_over(Scalar fade_time) noexcept {
    visit([&](auto& controller, bool in_charge) {
      if (in_charge) {
        controller.take_over(applied_, fade_time);
      }
    });
  }

  std::tuple<First, Others...> controllers_;
  Vector applied_ = Vector::Zero();
  Scalar fade_time_{static_cast<Scalar>(0.2)};
  std::size_t active_{0};
  bool started_{false};
};

}  // namespace heft
