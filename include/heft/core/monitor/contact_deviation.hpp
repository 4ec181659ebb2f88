/// @file
/// What of the torque from outside friction and model errors do not explain, and how much of it free motion may show.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/monitor/contact_thresholds.hpp"

namespace heft {

/// Deviation of each joint from free motion, and its threshold.
///
/// The torque from outside passes a first-order low-pass, r ← r + (1 − e^{−Kh}) clip(d − r): a single sample counts no more
/// than a multiple of the threshold, so that a glitch of the velocity or of the current passes unnoticed, while a push,
/// which differs from r by its rate over K, is not held up. What is left of free motion is mostly friction, and depends on
/// what the joint does:
///
/// - at rest its motor may give any torque within friction's limit, and its controller walks through that range while other
///   joints move: the deviation is what exceeds the offsets of free motion. Once the whole arm stands, nothing makes it
///   walk, and the torque that it stands with is followed at a tenth of the rate A within that limit;
/// - in motion friction differs from the model's by an offset, one for each direction. It is followed at the rate A within
///   the limit; while a direction is new, the limit times e^{−A t}, t the time spent in it, is added to the threshold;
/// - while the joint turns, friction changes sign or level, and the threshold is a larger one.
///
/// Motion harsher than that which the thresholds were learnt from widens them: in proportion to the rate of the arm's load
/// and to the joint's speed.
template <typename Scalar, int N>
class ContactDeviation {
 public:
  using Vector = JointVector<Scalar, N>;
  using Thresholds = ContactThresholds<Scalar, N>;

  struct Record {
    Vector residual = Vector::Zero();   ///< r, torque from outside along positive q [N·m, N]
    Vector deviation = Vector::Zero();  ///< r less the offset of friction
    Vector threshold = Vector::Zero();  ///< for |deviation|
    Vector offset = Vector::Zero();     ///< [N·m, N]
    Vector allowance = Vector::Zero();  ///< part of the threshold for an offset that is not known yet
    std::array<MotionPhase, static_cast<std::size_t>(N)> phase{};
  };

  /// Takes new thresholds, which are valid, and forgets the past.
  void configure(const Thresholds& thresholds) noexcept {
    thresholds_ = thresholds;
    reset();
  }
  /// Forgets the past, offsets included.
  void reset() noexcept { *this = ContactDeviation(thresholds_); }
  /// Forgets the filters, not the offsets: after a gap.
  void restart() noexcept {
    samples_ = 0;
    rate_ = Scalar(0);
  }

  /// Takes one sample.
  /// @param outside    mean torque from outside since the sample before, as it is, n [N·m, N]
  /// @param explained  torque that the model explains, likewise
  /// @param qd         velocities, n [rad/s, m/s]
  /// @param period     > 0 [s]
  /// @param hold       true: offsets do not follow, since something touches the arm; afterwards they are not known
  void update(const Vector& outside, const Vector& explained, const Vector& qd, Scalar period, bool hold,
              Record& record) noexcept {
    set_period(period);
    const Scalar widening = rate_ > thresholds_.load_rate ? rate_ / thresholds_.load_rate : Scalar(1);
    const Scalar share = samples_ > 0 ? pass_ : Scalar(1);
    Scalar rate(0);
    bool moves = false;
    for (int j = 0; j < N; ++j) {
      const std::size_t i = static_cast<std::size_t>(j);
      const JointThreshold<Scalar>& limits = thresholds_.joints[i];
      Joint& joint = joints_[i];
      Scalar step = outside[j] - joint.residual;
      if (samples_ > 0) step = limited(step, joint.largest_step);
      joint.residual += share * step;
      const Scalar change = share * (explained[j] - joint.explained);
      joint.explained += change;
      if (samples_ > 0) rate += size(change) * frequency_;
      record.phase[i] = phase_of(qd[j], period, limits, joint);
      moves = moves || joint.way != kStill;
      record.residual[j] = joint.residual;
      record.threshold[j] = widening * threshold_of(record.phase[i], size(qd[j]), limits);
      Direction& now = joint.directions[joint.way];
      if (joint.way == kStill && still_ < kStillTime) {
        now = {limited(joint.residual, limits.offset_limit), Scalar(0), false};
      }
      if (joint.way != kStill && hold != now.held) {
        // What a push has left in the offset before it was found is not friction.
        if (now.held) now.ignorance = Scalar(1);
        now.held = hold;
      }
      record.offset[j] = now.offset;
      record.deviation[j] = joint.residual - now.offset;
      record.allowance[j] = limits.offset_limit * now.ignorance;
      record.threshold[j] += record.allowance[j];
      if (!hold) {
        const Scalar follow = joint.way == kStill ? kStanding * follow_ : follow_;
        now.offset = limited(now.offset + follow * record.deviation[j], limits.offset_limit);
        now.ignorance -= follow_ * now.ignorance;
      }
      joint.largest_step = thresholds_.largest_step * record.threshold[j];
    }
    rate_ += rate_pass_ * (rate - rate_);
    still_ = moves ? Scalar(0) : still_ < kStillTime ? still_ + period : still_;
    if (samples_ < 1) ++samples_;
  }

  /// Takes a joint's residual for friction from now on, as far as free motion allows.
  void accept(int joint) noexcept {
    Joint& now = joints_[static_cast<std::size_t>(joint)];
    const Scalar limit = thresholds_.joints[static_cast<std::size_t>(joint)].offset_limit;
    now.directions[now.way].offset = limited(now.residual, limit);
  }

  const Thresholds& thresholds() const noexcept { return thresholds_; }
  /// Sum over the joints of the mean |rate| of the torque that the model explains [N·m/s, N/s].
  Scalar load_rate() const noexcept { return rate_; }

 private:
  static constexpr std::uint8_t kBackward = 0, kStill = 1, kForward = 2;
  /// Of the mean rate of the load [1/s]: a tenth of a second, over which inertia and timing show.
  static constexpr Scalar kRateBandwidth{10};
  /// A joint slower than that many rest speeds turns: friction of a creeping joint is not that of a moving one.
  static constexpr Scalar kSlow{4};

  /// The arm stands when no joint has moved for that long [s]: until then controllers unwind.
  static constexpr Scalar kStillTime{static_cast<Scalar>(0.6)};
  /// Part of the rate A at which the torque of a standing arm is followed: it creeps only.
  static constexpr Scalar kStanding{static_cast<Scalar>(0.1)};

  /// Of a joint in one direction of motion, or at rest.
  struct Direction {
    Scalar offset{0};
    Scalar ignorance{1};
    bool held{false};
  };
  struct Joint {
    Scalar residual{0}, explained{0};
    Scalar largest_step{0};  ///< of the residual's input [N·m, N]
    Scalar age{0};  ///< time since the joint started, stopped or turned round, up to the turning time [s]
    std::array<Direction, 3> directions{};
    std::uint8_t way{kStill};
  };

  ContactDeviation(const Thresholds& thresholds) noexcept : thresholds_(thresholds) {}

  static Scalar size(Scalar value) noexcept { return value < Scalar(0) ? -value : value; }
  static Scalar limited(Scalar value, Scalar limit) noexcept {
    return value > limit ? limit : value < -limit ? -limit : value;
  }

  void set_period(Scalar period) noexcept {
    using std::exp;
    if (period == period_) return;
    period_ = period;
    frequency_ = Scalar(1) / period;
    pass_ = Scalar(1) - exp(-thresholds_.bandwidth * period);
    follow_ = Scalar(1) - exp(-thresholds_.adaptation * period);
    rate_pass_ = Scalar(1) - exp(-kRateBandwidth * period);
  }

  /// Direction of a joint with hysteresis: it moves above its rest speed and stops below a third of it.
  static std::uint8_t way_of(Scalar speed, Scalar rest, std::uint8_t before) noexcept {
    if (speed > rest) return kForward;
    if (speed < -rest) return kBackward;
    return size(speed) < static_cast<Scalar>(0.3) * rest ? kStill : before;
  }

  MotionPhase phase_of(Scalar speed, Scalar period, const JointThreshold<Scalar>& limits,
                       Joint& joint) const noexcept {
    const std::uint8_t way = way_of(speed, limits.rest_speed, joint.way);
    if (way != joint.way) {
      joint.age = Scalar(0);
    } else if (joint.age < thresholds_.turning_time) {
      joint.age += period;
    }
    joint.way = way;
    if (way == kStill) return MotionPhase::kRest;
    const bool settled = joint.age >= thresholds_.turning_time && size(speed) >= kSlow * limits.rest_speed;
    return settled ? MotionPhase::kMoving : MotionPhase::kTurning;
  }

  static Scalar threshold_of(MotionPhase phase, Scalar speed, const JointThreshold<Scalar>& limits) noexcept {
    const Scalar threshold = phase == MotionPhase::kMoving    ? limits.moving
                             : phase == MotionPhase::kTurning ? limits.turning
                                                              : limits.rest;
    return speed > limits.top_speed ? threshold * (speed / limits.top_speed) : threshold;
  }

 public:
  ContactDeviation() noexcept = default;

 private:
  Thresholds thresholds_{};
  std::array<Joint, static_cast<std::size_t>(N)> joints_{};
  Scalar rate_{0};
  Scalar still_{0};  ///< time for which no joint has moved, up to kStillTime [s]
  Scalar period_{0}, frequency_{0}, pass_{0}, follow_{0}, rate_pass_{0};
  int samples_{0};  ///< in a row, up to 1
};

}  // namespace heft
