/// @file
/// Joint effects fed forward by a controller.
#pragma once

#include <array>
#include <cstddef>
#include <limits>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/converted.hpp"
#include "heft/core/effects/effects.hpp"
#include "heft/core/friction/friction.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// Up to M joint effects of an arm with N joints, with the memory that some of them carry along the motion. What a
/// controller adds to its feed-forward of rigid bodies and declared friction:
///
/// @code
/// EffectFeedForward<float, 6, 4> effects;
/// if (effects.configure(app::Ur5e::kEffects) != Status::kOk) ...   // a header of `heft export`
/// ...                                                             // every cycle, along the reference
/// status = effects.add_torque(t, q_ref, qd_ref, qdd_ref, rigid, actuation, sign_width, tau);
/// @endcode
///
/// Call it once a cycle and in order: memory goes on by the way from call to call.
template <typename Scalar, int N, int M>
class EffectFeedForward {
 public:
  static_assert(N >= 1 && M >= 1, "at least one joint and room for one effect");
  using Vector = JointVector<Scalar, N>;

  /// One effect more.
  /// @return kOutOfRange when there is no room, no such joint or effect, a parameter outside its range (a length or time
  ///         that is not positive), or an interval that ends before it begins; kNonFiniteInput; state kept
  Status add(const JointEffect<Scalar>& effect) noexcept {
    if (count_ >= M || effect.joint < 0 || effect.joint >= N || effect.kind < 0 ||
        effect.kind >= kNumJointEffects) {
      return Status::kOutOfRange;
    }
    for (const Scalar value : effect.parameters) {
      if (!is_finite(value)) {
        return Status::kNonFiniteInput;
      }
    }
    if (parameter_out_of_range(effect) >= 0 || !is_in_order(effect.seen)) {
      return Status::kOutOfRange;
    }
    effects_[static_cast<std::size_t>(count_)] = effect;
    memory_.values[static_cast<std::size_t>(count_)] = Scalar(0);
    ++count_;
    return Status::kOk;
  }

  /// These effects and no others, in any precision.
  /// @return as add(); what came before the refused effect is taken
  template <typename From, std::size_t kCount>
  Status configure(const std::array<JointEffect<From>, kCount>& effects) noexcept {
    static_assert(kCount <= static_cast<std::size_t>(M), "more effects than there is room for");
    count_ = 0;
    reset();
    for (const JointEffect<From>& from : effects) {
      JointEffect<Scalar> effect;
      effect.kind = from.kind;
      effect.joint = from.joint;
      for (std::size_t i = 0; i < from.parameters.size(); ++i) {
        effect.parameters[i] = static_cast<Scalar>(from.parameters[i]);
      }
      effect.seen = converted<Scalar>(from.seen);
      if (const Status status = add(effect); status != Status::kOk) {
        return status;
      }
    }
    return Status::kOk;
  }

  int count() const noexcept { return count_; }

  /// Temperatures of the joints from now on, n [°C]; not a number: not known, and friction is that at the effect's T0.
  void set_temperature(const Vector& temperature) noexcept { temperature_ = temperature; }

  /// Forgets the motion: memory restarts at 0.
  void reset() noexcept {
    memory_.values.fill(Scalar(0));
    memory_.started = false;
  }

  /// What the motion has left, for a caller that may have to go back.
  struct Memory {
    std::array<Scalar, static_cast<std::size_t>(M)> values{};
    Vector last_q = Vector::Zero();
    bool started{false};
  };
  const Memory& memory() const noexcept { return memory_; }
  void go_back(const Memory& memory) noexcept { memory_ = memory; }

  /// Adds the torque of all effects at this instant.
  /// @param time        since the run, with cold joints, began [s]
  /// @param q,qd,qdd    motion, n; that of the reference does not chatter
  /// @param load        torque of the rigid bodies, n [N·m, N]
  /// @param actuation   declared friction, which some effects scale or replace
  /// @param sign_width  as in velocity_sign; the width that declared friction is fed forward with
  /// @param tau         n [N·m, N]; unchanged unless kOk
  /// @return kNonFiniteInput when a torque is not finite; then memory is unchanged too
  Status add_torque(Scalar time, const Vector& q, const Vector& qd, const Vector& qdd, const Vector& load,
                    const std::array<JointActuation<Scalar>, static_cast<std::size_t>(N)>& actuation,
                    Scalar sign_width, Vector& tau) noexcept {
    Vector sum = Vector::Zero();
    std::array<Scalar, static_cast<std::size_t>(M)> memory = memory_.values;
    for (std::size_t k = 0; k < static_cast<std::size_t>(count_); ++k) {
      const JointEffect<Scalar>& effect = effects_[k];
      const int j = effect.joint;
      if (memory_.started) {
        memory[k] = joint_effect_memory(effect, memory[k], q[j] - memory_.last_q[j]);
      }
      const EffectPoint<Scalar> point{time,    q[j],     qd[j], qdd[j], velocity_sign(qd[j], sign_width),
                                      load[j], memory[k], temperature_[j]};
      sum[j] += joint_effect_torque(effect, point, actuation[static_cast<std::size_t>(j)]);
    }
    for (int j = 0; j < N; ++j) {
      if (!is_finite(sum[j]) || !is_finite(q[j])) {
        return Status::kNonFiniteInput;
      }
    }
    memory_ = {memory, q, true};
    for (int j = 0; j < N; ++j) {
      tau[j] += sum[j];
    }
    return Status::kOk;
  }

 private:
  std::array<JointEffect<Scalar>, static_cast<std::size_t>(M)> effects_{};
  Memory memory_;
  Vector temperature_ = Vector::Constant(std::numeric_limits<Scalar>::quiet_NaN());
  int count_{0};
};

}  // namespace heft
