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

/// What each joint's residual is, how it changes, and how much of both free motion may show.
///
/// The torque from outside passes a first-order low-pass, r ← r + (1 − e^{−Kh}) clip(d − r): a single sample counts no more
/// than a multiple of the threshold, so that a glitch of the velocity or of the current passes unnoticed, while a push,
/// which differs from r by its rate over K, is not held up. Of r two things are compared with thresholds:
///
/// - r itself, against which friction and the model's error stand in full, since they last: it finds what grows slowly;
/// - its change c = r − m, with m following r at the rate A: friction and the model's error vary with the poses, within
///   seconds, a push within tenths of a second. It finds a push in the noise that the low-pass leaves.
///
/// Both depend on what the joint does: at rest its motor may give any torque within friction's limit, while it turns
/// friction changes sign or level, in motion it is known best. What the load of a resting joint changes by, its friction may
/// take up: with the change of the load b = e - n, e the torque that the model explains behind the same low-pass and n following
/// it at the rate A, the part of c between 0 and b is no change,
///
///   c ← c - clip(c, min(b, 0), max(b, 0)).
///
/// Motion harsher than that which the thresholds were learnt from widens them: in proportion to the rate of the arm's load and
/// to the joint's speed.
template <typename Scalar, int N>
class ContactDeviation {
 public:
  using Vector = JointVector<Scalar, N>;
  using Thresholds = ContactThresholds<Scalar, N>;

  struct Record {
    Vector residual = Vector::Zero();          ///< r, torque from outside along positive q [N·m, N]
    Vector level_threshold = Vector::Zero();   ///< for |r|
    Vector change = Vector::Zero();            ///< c [N·m, N]
    Vector taken_up = Vector::Zero();  ///< what c is smaller by since friction at rest takes up load [N·m, N]
    Vector change_threshold = Vector::Zero();  ///< for |c|
    std::array<MotionPhase, static_cast<std::size_t>(N)> phase{};
  };

  /// Filters have forgotten the start to 1 % after that time [1 / adaptation].
  static constexpr Scalar kSettling{5};

  /// Takes new thresholds, which are valid, and forgets the past.
  void configure(const Thresholds& thresholds) noexcept {
    thresholds_ = thresholds;
    reset();
  }
  /// Forgets the past.
  void reset() noexcept { *this = ContactDeviation(thresholds_); }
  /// Forgets the filters, not what the joints do: after a gap.
  void restart() noexcept {
    samples_ = 0;
    rate_ = Scalar(0);
  }

  /// Takes one sample.
  /// @param outside    mean torque from outside since the sample before, as it is, n [N·m, N]
  /// @param explained  torque that the model explains, likewise
  /// @param qd         velocities, n [rad/s, m/s]
  /// @param period     > 0 [s]
  /// @param hold       something touches the arm: the mean of a joint whose change is above that many thresholds, or whose
  ///                   residual is above its own, stays where it was before; 0: nothing does, and all follow
  void update(const Vector& outside, const Vector& explained, const Vector& qd, Scalar period, Scalar hold,
              Record& record) noexcept {
    set_period(period);
    const Scalar widening = rate_ > thresholds_.load_rate ? rate_ / thresholds_.load_rate : Scalar(1);
    const bool starts = samples_ == 0, held = hold > Scalar(0);
    const Scalar share = starts ? Scalar(1) : pass_;
    // The controllers of an arm that stands have unwound: its torques creep only, and a slow push shows.
    const Scalar follow = still_ < kStillTime ? follow_ : kStanding * follow_;
    Scalar rate(0);
    bool moves = false;
    for (int j = 0; j < N; ++j) {
      const std::size_t i = static_cast<std::size_t>(j);
      const JointThreshold<Scalar>& limits = thresholds_.joints[i];
      Joint& joint = joints_[i];
      Scalar step = outside[j] - joint.residual;
      if (!starts) step = limited(step, joint.largest_step);
      joint.residual += share * step;
      const Scalar change = share * (explained[j] - joint.explained);
      joint.explained += change;
      rate += size(change);
      if (starts) {
        joint.mean = joint.residual;
        joint.mean_explained = joint.explained;
      }
      const Scalar speed = size(qd[j]);
      const Scalar wide = speed > limits.top_speed ? widening * (speed / limits.top_speed) : widening;
      const MotionPhase phase = phase_of(qd[j], speed, period, limits, joint);
      moves = moves || phase != MotionPhase::kRest;
      Scalar level = wide, limit = wide;
      if (phase == MotionPhase::kMoving) {
        level *= limits.moving;
        limit *= limits.moving_change;
        // What friction was while the joint turned says nothing of its motion.
        const bool anew = joint.phase != phase;
        if (anew && (!held || size(joint.residual) < kSmall * level)) joint.mean = joint.residual;
      } else if (phase == MotionPhase::kTurning) {
        level *= limits.turning;
        limit *= limits.turning_change;
      } else {
        level *= limits.rest;
        limit *= limits.rest_change;
      }
      joint.phase = phase;
      const Scalar apart = joint.residual - joint.mean, loaded = joint.explained - joint.mean_explained;
      const Scalar taken_up = phase == MotionPhase::kRest ? common(apart, loaded) : Scalar(0);
      const Scalar beyond = apart - taken_up;
      if (!held || (size(beyond) < hold * limit && size(joint.residual) < level)) joint.mean += follow * apart;
      joint.mean_explained += follow * loaded;
      joint.largest_step = thresholds_.largest_step * limit;
      record.phase[i] = phase;
      record.residual[j] = joint.residual;
      record.level_threshold[j] = level;
      record.change[j] = beyond;
      record.taken_up[j] = taken_up;
      record.change_threshold[j] = limit;
    }
    if (!starts) rate_ += rate_pass_ * (rate * frequency_ - rate_);
    still_ = moves ? Scalar(0) : still_ < kStillTime ? still_ + period : still_;
    samples_ = 1;
  }

  /// Takes a joint's residual for what free motion shows from now on.
  void accept(int joint) noexcept {
    Joint& now = joints_[static_cast<std::size_t>(joint)];
    now.mean = now.residual;
  }

  const Thresholds& thresholds() const noexcept { return thresholds_; }
  /// Sum over the joints of the mean |rate| of the torque that the model explains [N·m/s, N/s].
  Scalar load_rate() const noexcept { return rate_; }

 private:
  static constexpr std::uint8_t kBackward = 0, kStill = 1, kForward = 2;
  /// Of the mean rate of the load [1/s]: a tenth of a second, over which inertia and timing show.
  static constexpr Scalar kRateBandwidth{10};
  /// A joint slower than that many rest speeds turns: friction of a creeping joint is not that of a moving one.
  static constexpr Scalar kSlow{8};

  /// Part of the threshold of the residual below which no push is left in it.
  static constexpr Scalar kSmall{static_cast<Scalar>(0.33)};
  /// The arm stands when no joint has moved for that long [s], and part of the rate A at which the mean follows then.
  static constexpr Scalar kStillTime{static_cast<Scalar>(0.6)}, kStanding{static_cast<Scalar>(0.05)};

  struct Joint {
    Scalar residual{0}, explained{0};
    Scalar mean{0};            ///< m [N·m, N]
    Scalar mean_explained{0};  ///< n [N·m, N]
    Scalar largest_step{0};  ///< of the residual's input [N·m, N]
    Scalar age{0};  ///< time since the joint started, stopped or turned round, up to the turning time [s]
    std::uint8_t way{kStill};
    MotionPhase phase{MotionPhase::kRest};
  };

  ContactDeviation(const Thresholds& thresholds) noexcept : thresholds_(thresholds) {}

  static Scalar size(Scalar value) noexcept { return value < Scalar(0) ? -value : value; }
  static Scalar limited(Scalar value, Scalar limit) noexcept {
    return value > limit ? limit : value < -limit ? -limit : value;
  }
  /// The part of a value between 0 and another.
  static Scalar common(Scalar value, Scalar other) noexcept {
    if (other < Scalar(0)) return value < other ? other : value < Scalar(0) ? value : Scalar(0);
    return value > other ? other : value > Scalar(0) ? value : Scalar(0);
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

  MotionPhase phase_of(Scalar velocity, Scalar speed, Scalar period, const JointThreshold<Scalar>& limits,
                       Joint& joint) const noexcept {
    const std::uint8_t way = way_of(velocity, limits.rest_speed, joint.way);
    if (way != joint.way) {
      joint.age = Scalar(0);
    } else if (joint.age < thresholds_.turning_time) {
      joint.age += period;
    }
    joint.way = way;
    const bool aged = joint.age >= thresholds_.turning_time;
    if (way == kStill) return aged ? MotionPhase::kRest : MotionPhase::kTurning;
    const bool settled = aged && speed >= kSlow * limits.rest_speed;
    return settled ? MotionPhase::kMoving : MotionPhase::kTurning;
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
