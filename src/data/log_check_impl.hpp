/// @file
/// What the checks of a log collect row by row, and what they find in it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "column_faults.hpp"
#include "heft/data/log_checks.hpp"
#include "heft/host/numbers.hpp"

namespace heft::data {

/// "q1, q2 and q5" of joints counted from 0.
std::string columns_of(std::string_view prefix, const std::vector<int>& joints);

/// Longest run of equal rows that is taken for repetition rather than for standstill.
inline constexpr int kLongestRepetition = 20;

/// Regression of the change that a rate column claims on the change that happened.
struct RateComparison {
  double claimed_happened{0.0}, happened_happened{0.0}, claimed_claimed{0.0};
  double top_rate{0.0};  ///< largest happened change per time
  int stretches{0};

  void add(double claimed, double happened, double duration) {
    claimed_happened += claimed * happened;
    happened_happened += happened * happened;
    claimed_claimed += claimed * claimed;
    top_rate = std::max(top_rate, std::abs(happened) / duration);
    ++stretches;
  }
  double correlation() const {
    const double scale = std::sqrt(happened_happened * claimed_claimed);
    return scale > 0.0 ? claimed_happened / scale : 0.0;
  }
  /// By total least squares for a line through zero, so that noise on either side does not make it smaller.
  double ratio() const {
    if (claimed_happened == 0.0) return 0.0;
    // Geometric mean of the two regressions; its sign is the correlation's.
    return std::copysign(std::sqrt(claimed_claimed / happened_happened), claimed_happened);
  }
};

struct LogCheck::Impl {
  std::string path;
  int n{0};
  long rows{0};
  double begin{0.0}, last_time{0.0};
  bool has_velocity{false}, has_acceleration{false}, has_torque{false};

  Eigen::ArrayXd low, high, least_torque, most_torque;
  std::vector<RateComparison> velocity, acceleration;

  // The row before, and the stretch since `stretch_time`.
  Eigen::ArrayXd last_q, last_qd, last_qdd, last_tau;
  Eigen::ArrayXd stretch_q, stretch_qd, claimed_q, claimed_qd;
  double stretch_time{0.0};
  int stretch_rows{0};
  double stepped{0.0};  ///< time of all steps that are no gap
  long regular_steps{0};
  std::vector<char> skip_stretch;  ///< a jump is in it

  // Position steps and repetition.
  Eigen::ArrayXd least_step;
  Eigen::Array<long, Eigen::Dynamic, 1> steps, rests;
  long repeated{0};
  int run{0};

  // Jumps by a whole turn, whatever the unit.
  Eigen::ArrayXd step_sum;
  struct Jump {
    double size{0.0}, time{0.0};
    long count{0};
  };
  std::vector<Jump> jumps;

  std::vector<PositionJumps> positions;
  std::vector<HeldTorque> torques;
  std::vector<TorqueSpikes> torque_spikes;
  LateStamps late_stamps;

  Impl(std::string where, int joints) : path(std::move(where)), n(joints) {
    low = Eigen::ArrayXd::Constant(n, kInfinity);
    high = -low;
    least_torque = low;
    most_torque = high;
    velocity.resize(static_cast<std::size_t>(n));
    acceleration.resize(static_cast<std::size_t>(n));
    last_q = last_qd = last_qdd = last_tau = Eigen::ArrayXd::Zero(n);
    stretch_q = stretch_qd = claimed_q = claimed_qd = Eigen::ArrayXd::Zero(n);
    skip_stretch.resize(static_cast<std::size_t>(n), 0);
    least_step = Eigen::ArrayXd::Constant(n, kInfinity);
    step_sum = Eigen::ArrayXd::Zero(n);
    jumps.resize(static_cast<std::size_t>(n));
    positions.resize(static_cast<std::size_t>(n));
    torques.resize(static_cast<std::size_t>(n));
    torque_spikes.resize(static_cast<std::size_t>(n));
    steps = rests = Eigen::Array<long, Eigen::Dynamic, 1>::Zero(n);
  }

  double travel(int joint) const { return high[joint] - low[joint]; }
  double sample_rate() const {
    return last_time > begin ? static_cast<double>(rows - 1) / (last_time - begin) : 0.0;
  }
  bool is_revolute(const JointLimits& limits, int joint) const {
    return limits.prismatic.empty() || !limits.prismatic[static_cast<std::size_t>(joint)];
  }

  /// The joint's velocity limit; infinity: none is known [rad/s, m/s].
  double velocity_limit(const JointLimits& limits, int joint) const;
  /// Faster than any motion of the joint [rad/s, m/s].
  double top_speed(const JointLimits& limits, int joint) const;

  /// Rows of a log that come together, and what all joints have in common in them.
  struct Part {
    std::vector<double> times;       ///< of the row before, then of the rows
    std::vector<char> ends, gaps;    ///< row by row: a stretch ends in it, a gap does
    std::vector<char> repeats;       ///< it is the one before
    double first_stretch_time{0.0};  ///< where the first stretch began
    bool from_start{false};
    std::size_t rows() const { return ends.size(); }
    /// First row that has one before it.
    std::size_t second() const { return from_start ? 1 : 0; }
  };
  void find_stretches(Part& part);
  void add_joint(int joint, const Part& part, const std::vector<double>& position,
                 const std::vector<double>& speed, const std::vector<double>& rate);
  bool add_step(std::size_t joint, double from, double to, double time);
  void add_torque(int joint, const Part& part, const std::vector<double>& position,
                  const std::vector<double>& torque);
  void count_repetition(const Part& part);

  /// Joints by what speaks for positions in degrees.
  struct DegreeSigns {
    std::vector<int> beyond, fast, by_velocity, outside;
    bool fits_in_degrees{true};  ///< every joint would be inside its limits
  };
  DegreeSigns degree_signs(const JointLimits& limits) const;
  void find_degrees(const JointLimits& limits, std::vector<LogFinding>& found) const;
  void find_turns(const JointLimits& limits, std::vector<LogFinding>& found) const;
  void find_time_unit(std::vector<LogFinding>& found) const;
  double clock_ratio(const JointLimits& limits) const;
  void find_clock_rate(const JointLimits& limits, std::vector<LogFinding>& found) const;
  void find_rate_slips(const JointLimits& limits, std::string_view rate, std::string_view of,
                       const std::vector<RateComparison>& comparison, std::vector<LogFinding>& found) const;
  bool find_jumps(const JointLimits& limits, std::vector<LogFinding>& found) const;
  void find_held_torque(const JointLimits& limits, std::vector<LogFinding>& found) const;
  void find_torque_spikes(std::vector<LogFinding>& found) const;
  void find_late_stamps(std::vector<LogFinding>& found) const;
  void find_torque_unit(const JointLimits& limits, std::vector<LogFinding>& found) const;
  void find_coarse_sampling(std::vector<LogFinding>& found) const;
  void find_resting_joints(const JointLimits& limits, std::vector<LogFinding>& found) const;
};

}  // namespace heft::data
