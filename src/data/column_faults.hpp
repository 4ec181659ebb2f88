/// @file
/// Columns whose numbers are finite and yet no measurement: positions that jump, torques that stay at one value, stamps that come late.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace heft::data {

/// Least jump of a position [rad, m], as in core's estimators, and least travel in a stretch of constant torque.
inline constexpr double kLeastJump = 0.02, kTravelOfHeld = 0.05;

/// The positions of one joint, row by row: those that go on far from where the last step led.
class PositionJumps {
 public:
  struct Jump {
    double way;   ///< from where the step before led to [rad, m]
    double step;  ///< from the row before [rad, m]
    double time, period;
    double stood;  ///< time at rest before [s]
  };

  /// @param from,to     position of the row before and of this one [rad, m]
  /// @param time        of this row; @param period  since the row before [s]
  void add(double from, double to, double time, double period) {
    const double step = to - from, way = std::abs(step - rate_ * period);
    if (has_step_) {
      sum_ += way;
      ++count_;
      // A row after a jump does not jump, though it lies off the way that leads on.
      if (way > kLeastJump && std::abs(step) > 0.4 * way) keep({way, step, time, period, stood_});
    }
    way_ += std::abs(step);
    time_ += period;
    rate_ = step / period;
    stood_ = step == 0.0 ? stood_ + period : 0.0;
    has_step_ = true;
  }
  /// The next row has none before it.
  void interrupt() {
    rate_ = stood_ = 0.0;
    has_step_ = false;
  }

  /// Mean speed without the largest jumps [rad/s, m/s].
  double mean_speed() const {
    double way = way_;
    for (const Jump& jump : kept_) way -= std::abs(jump.step);
    return time_ > 0.0 ? way / time_ : 0.0;
  }
  /// In order of time: what is far more than positions go off on average, which all rows of a fast motion with few samples do.
  /// @param least_step  of the encoder
  std::vector<Jump> jumps(double least_step) const {
    constexpr double kTimesMean = 30.0, kSteps = 8.0;
    double others = sum_;
    for (const Jump& jump : kept_) others -= jump.way;
    const long count = count_ - static_cast<long>(kept_.size());
    std::vector<Jump> all;
    for (const Jump& jump : kept_) {
      if (count > kFewest && jump.way > kTimesMean * others / static_cast<double>(count) && jump.way > kSteps * least_step)
        all.push_back(jump);
    }
    std::sort(all.begin(), all.end(), [](const Jump& a, const Jump& b) { return a.time < b.time; });
    return all;
  }

 private:
  static constexpr std::size_t kMost = 200;  ///< the largest ones are kept
  static constexpr long kFewest = 100;       ///< rows that a mean is taken of

  void keep(const Jump& jump) {
    const auto nearer = [](const Jump& a, const Jump& b) { return a.way < b.way; };
    if (kept_.size() < kMost) {
      kept_.push_back(jump);
    } else if (jump.way > least_kept_) {
      *std::min_element(kept_.begin(), kept_.end(), nearer) = jump;
    } else {
      return;
    }
    if (kept_.size() == kMost) least_kept_ = std::min_element(kept_.begin(), kept_.end(), nearer)->way;
  }

  std::vector<Jump> kept_;
  double rate_{0.0}, stood_{0.0}, sum_{0.0};
  double way_{0.0}, time_{0.0}, least_kept_{0.0};
  long count_{0};
  bool has_step_{false};
};

/// The torque of one joint, row by row: stretches in which it stays at one value although the joint moves, and not at one
/// acceleration.
class HeldTorque {
 public:
  struct Stretch {
    double torque, begin, end;
    double travel;  ///< of the joint [rad, m]
    long rows;
  };

  /// @param last,torque  of the row before and of this one [N·m, N]
  /// @param from,to      positions likewise
  void add(double last, double torque, double from, double to, double time, double period) {
    ++rows_;
    if (torque != last) {
      interrupt();
      return;
    }
    if (run_.rows == 0) {
      run_ = {torque, time - period, time, 0.0, 1};
      low_ = high_ = first_ = from;
      moments_.setZero();
    }
    run_.end = time;
    ++run_.rows;
    low_ = std::min(low_, to);
    high_ = std::max(high_, to);
    const double t = time - run_.begin;
    const Eigen::Vector4d row(1.0, t, t * t, to - first_);
    moments_.noalias() += row * row.transpose();
  }
  /// The next row has none before it.
  void interrupt() {
    ++values_;
    if (is_held()) keep(run());
    run_.rows = 0;
  }

  /// Those that last far longer than this torque usually stays as it is: a coarse one does so for a while.
  std::vector<Stretch> stretches() const {
    constexpr double kTimesUsual = 20.0;
    std::vector<Stretch> all = kept_;
    if (is_held()) all.push_back(run());
    long others = rows_;
    for (const Stretch& stretch : all) others -= stretch.rows;
    const double usual = static_cast<double>(others) / static_cast<double>(values_ + 1);
    std::erase_if(all, [&](const Stretch& s) { return static_cast<double>(s.rows) < kTimesUsual * usual; });
    return all;
  }
  long rows() const { return rows_; }

 private:
  static constexpr std::size_t kMost = 200;

  void keep(const Stretch& stretch) {
    if (kept_.size() < kMost) kept_.push_back(stretch);
  }
  Stretch run() const {
    Stretch stretch = run_;
    stretch.travel = high_ - low_;
    return stretch;
  }
  /// At one acceleration a torque without noise is constant: so are targets, and logs of simulators.
  bool is_held() const {
    constexpr long kFewest = 10;
    constexpr double kShortest = 0.25, kCurved = 0.005;  // [s]; off a parabola, rms in parts of the travel
    const double travel = high_ - low_;
    if (run_.rows < kFewest || run_.end - run_.begin < kShortest || travel < kTravelOfHeld) return false;
    // What is left of the squares of q beside 1, t and t².
    const Eigen::Vector3d product = moments_.topRightCorner<3, 1>();
    const double off = moments_(3, 3) - product.dot(moments_.topLeftCorner<3, 3>().ldlt().solve(product));
    return off > moments_(0, 0) * std::pow(kCurved * travel, 2);
  }

  std::vector<Stretch> kept_;
  Stretch run_{0.0, 0.0, 0.0, 0.0, 0};
  double low_{0.0}, high_{0.0}, first_{0.0};
  Eigen::Matrix4d moments_;  ///< of 1, t, t², q over the rows of the run but the first
  long rows_{0}, values_{0};
};

/// The torque of one joint, row by row: single rows that are far beyond all that lasts longer.
class TorqueSpikes {
 public:
  struct Spike {
    double torque, time;
  };

  /// @param last,torque  of the row before and of this one [N·m, N]
  void add(double last, double torque, double time) {
    const double size = std::abs(torque);
    lasting_ = std::max(lasting_, std::min(std::abs(last), size));
    if (size > kTimesLasting * lasting_ && kept_.size() < kMost) kept_.push_back({torque, time});
  }
  /// In order of time, at most 1000.
  std::vector<Spike> spikes() const {
    std::vector<Spike> all = kept_;
    std::erase_if(all, [&](const Spike& spike) { return !(std::abs(spike.torque) > kTimesLasting * lasting_); });
    return all;
  }

 private:
  static constexpr double kTimesLasting = 3.0;
  static constexpr std::size_t kMost = 1000;

  std::vector<Spike> kept_;
  double lasting_{0.0};  ///< largest torque of two rows in succession
};

/// Time stamps that come late by more than half a step and are caught up with, as those of a program that was interrupted.
class LateStamps {
 public:
  /// @param step  to the next row [s]
  /// @param time  at which it begins [s]
  void add(double step, double time) {
    // A row that is lost makes a long step, but no short one after it.
    if (before_ > 0.0 && last_ >= 1.5 * before_ && step <= 0.5 * before_ && count_++ == 0) first_ = time;
    before_ = std::exchange(last_, step);
  }
  /// The next step has none before it.
  void interrupt() { last_ = before_ = 0.0; }

  long count() const { return count_; }
  /// The first of them [s].
  double first() const { return first_; }

 private:
  double last_{0.0}, before_{0.0};  ///< steps; 0: there is none
  long count_{0};
  double first_{0.0};
};

}  // namespace heft::data
