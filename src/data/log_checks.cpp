#include "heft/data/log_checks.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"

namespace heft::data {
namespace {

using Eigen::Index;

constexpr double kDegree = 180.0 / std::numbers::pi;
constexpr double kTurn = 2.0 * std::numbers::pi;

/// A stretch over which a rate is compared with the change of what it is the rate of.
constexpr int kStretchRows = 4;
constexpr double kStretchTime = 0.05;
/// A step in time this many times the mean step so far, and longer than a stretch, is a gap: nobody knows the rate in it.
constexpr double kGapInSteps = 10.0;
/// From here on a ratio is believed, and up to here two signals have nothing to do with each other.
constexpr double kBelieved = 0.9;
constexpr double kUnrelated = 0.5;
/// ln of what a ratio may be off its factor by: 10 %.
constexpr double kRatioTolerance = 0.1;
/// Less travel says nothing about a velocity column [rad, m].
constexpr double kTellingTravel = 0.02;
/// A joint that travels less is at rest [rad, m].
constexpr double kStillTravel = 1e-3;
/// ln of what the joints' ratios may differ by when a clock explains all of them: 5 %.
constexpr double kClockTolerance = 0.05;
/// Beyond a limit by this factor no calibration offset explains it.
constexpr double kBeyond = 1.5;
/// No arm's joint is faster than this many times its velocity limit, nor than kTopSpeed [rad/s] without one.
constexpr double kTooFast = 5.0;
constexpr double kTopSpeed = 30.0;
/// Longest run of equal rows that is taken for repetition rather than for standstill.
constexpr int kLongestRepetition = 20;
/// Position steps worth telling [rad, m].
constexpr double kCoarseStep = 2e-4;
/// Without a velocity, time is in milliseconds when a motion of more than kClearTravel has fewer samples a
/// second than a log of 10 kHz would then have, and is slower than arms are moved for a measurement [Hz,
/// rad/s].
constexpr double kMillisecondRate = 10.0;
constexpr double kMillisecondSpeed = 0.02;
constexpr double kClearTravel = 0.1;
/// Fewer samples a second are worth telling in any case [Hz].
constexpr double kFewSamples = 2.0;

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

bool is_near(double ratio, double factor) {
  return ratio * factor > 0.0 && std::abs(std::log(ratio / factor)) < kRatioTolerance;
}

/// "q1, q2 and q5" of joints counted from 0.
std::string columns_of(std::string_view prefix, const std::vector<int>& joints) {
  std::string text;
  for (std::size_t k = 0; k < joints.size(); ++k) {
    text +=
        fmt::format("{}{}{}", k == 0 ? "" : (k + 1 == joints.size() ? " and " : ", "), prefix, joints[k] + 1);
  }
  return text;
}

std::string range_text(double lower, double upper) {
  if (lower == -upper) return fmt::format("+-{:.4g}", upper);
  return fmt::format("{:.4g} to {:.4g}", lower, upper);
}

}  // namespace

struct LogCheck::Impl {
  std::string path;
  int n{0};
  long rows{0};
  double begin{0.0}, last_time{0.0};
  bool has_velocity{false}, has_acceleration{false}, has_torque{false};

  Eigen::ArrayXd low, high, max_torque;
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

  Impl(std::string where, int joints) : path(std::move(where)), n(joints) {
    low = Eigen::ArrayXd::Constant(n, kInfinity);
    high = -low;
    max_torque = Eigen::ArrayXd::Zero(n);
    velocity.resize(static_cast<std::size_t>(n));
    acceleration.resize(static_cast<std::size_t>(n));
    last_q = last_qd = last_qdd = last_tau = Eigen::ArrayXd::Zero(n);
    stretch_q = stretch_qd = claimed_q = claimed_qd = Eigen::ArrayXd::Zero(n);
    skip_stretch.resize(static_cast<std::size_t>(n), 0);
    least_step = Eigen::ArrayXd::Constant(n, kInfinity);
    step_sum = Eigen::ArrayXd::Zero(n);
    jumps.resize(static_cast<std::size_t>(n));
    steps = rests = Eigen::Array<long, Eigen::Dynamic, 1>::Zero(n);
  }

  double travel(int joint) const { return high[joint] - low[joint]; }
  double sample_rate() const {
    return last_time > begin ? static_cast<double>(rows - 1) / (last_time - begin) : 0.0;
  }
  bool is_revolute(const JointLimits& limits, int joint) const {
    return limits.prismatic.empty() || !limits.prismatic[static_cast<std::size_t>(joint)];
  }

  void find_degrees(const JointLimits& limits, std::vector<LogFinding>& found) const;
  void find_turns(const JointLimits& limits, std::vector<LogFinding>& found) const;
  void find_time_unit(std::vector<LogFinding>& found) const;
  double clock_ratio(const JointLimits& limits) const;
  void find_clock_rate(const JointLimits& limits, std::vector<LogFinding>& found) const;
  void find_rate_slips(const JointLimits& limits, std::string_view rate, std::string_view of,
                       const std::vector<RateComparison>& comparison, std::vector<LogFinding>& found) const;
  void find_torque_unit(const JointLimits& limits, std::vector<LogFinding>& found) const;
  void find_coarse_sampling(std::vector<LogFinding>& found) const;
  void find_resting_joints(const JointLimits& limits, std::vector<LogFinding>& found) const;
};

LogCheck::LogCheck(std::string path, int num_joints)
    : impl_(std::make_unique<Impl>(std::move(path), num_joints)) {}
LogCheck::~LogCheck() = default;
LogCheck::LogCheck(LogCheck&&) noexcept = default;
LogCheck& LogCheck::operator=(LogCheck&&) noexcept = default;

void LogCheck::add(const Eigen::Ref<const Eigen::VectorXd>& time, const Eigen::Ref<const Eigen::MatrixXd>& q,
                   const Eigen::Ref<const Eigen::MatrixXd>& qd, const Eigen::Ref<const Eigen::MatrixXd>& qdd,
                   const Eigen::Ref<const Eigen::MatrixXd>& tau) {
  Impl& s = *impl_;
  s.has_velocity = qd.cols() == s.n;
  s.has_acceleration = qdd.cols() == s.n;
  s.has_torque = tau.cols() == s.n;
  const Index count = time.size();
  if (count == 0) return;
  s.low = s.low.min(q.colwise().minCoeff().transpose().array());
  s.high = s.high.max(q.colwise().maxCoeff().transpose().array());
  if (s.has_torque) s.max_torque = s.max_torque.max(tau.cwiseAbs().colwise().maxCoeff().transpose().array());

  // Joint by joint over the rows of this part, which is fast for matrices in columns; where stretches end,
  // and whether a row is the one before, is the same for all joints and found first.
  std::vector<double> times(static_cast<std::size_t>(count) + 1);
  times[0] = s.rows == 0 ? time[0] : s.last_time;
  std::copy(time.data(), time.data() + count, times.begin() + 1);
  const auto n_rows = static_cast<std::size_t>(count);
  std::vector<char> repeats(n_rows, 1);
  std::vector<char> ends(n_rows, 0), gaps(n_rows, 0);
  const bool from_start = s.rows == 0;
  if (from_start) {
    s.begin = time[0];
    s.stretch_time = time[0];
    s.stretch_rows = 0;
  }
  const double first_stretch_time = s.stretch_time;
  for (std::size_t k = from_start ? 1 : 0; k < n_rows; ++k) {
    const double step = times[k + 1] - times[k];
    const bool gap = s.regular_steps >= 10 && step > kStretchTime &&
                     step > kGapInSteps * s.stepped / static_cast<double>(s.regular_steps);
    if (gap) {
      gaps[k] = ends[k] = 1;
      s.stretch_time = times[k + 1];
      s.stretch_rows = 0;
      continue;
    }
    s.stepped += step;
    ++s.regular_steps;
    ++s.stretch_rows;
    if (s.stretch_rows < kStretchRows || times[k + 1] - s.stretch_time < kStretchTime) continue;
    ends[k] = 1;
    s.stretch_time = times[k + 1];
    s.stretch_rows = 0;
  }

  // A column with the row before the part in front.
  std::vector<double> position(n_rows + 1), speed(n_rows + 1), rate(n_rows + 1);
  const auto load = [&](std::vector<double>& to, const Eigen::Ref<const Eigen::MatrixXd>& from, int joint,
                        Eigen::ArrayXd& last) {
    if (from_start) last[joint] = from(0, joint);
    to[0] = last[joint];
    std::copy(from.col(joint).data(), from.col(joint).data() + count, to.begin() + 1);
    last[joint] = to[n_rows];
    for (std::size_t k = 0; k < n_rows; ++k)
      repeats[k] = static_cast<char>(repeats[k] & (to[k + 1] == to[k]));
  };
  for (int joint = 0; joint < s.n; ++joint) {
    const auto j = static_cast<std::size_t>(joint);
    load(position, q, joint, s.last_q);
    if (s.has_torque) load(rate, tau, joint, s.last_tau);  // only for its repetition
    if (s.has_velocity) load(speed, qd, joint, s.last_qd);
    if (s.has_acceleration) {
      std::copy(qdd.col(joint).data(), qdd.col(joint).data() + count, rate.begin() + 1);
      rate[0] = from_start ? rate[1] : s.last_qdd[joint];
      s.last_qdd[joint] = rate[n_rows];
    }
    if (from_start) {
      s.stretch_q[joint] = position[0];
      if (s.has_velocity) s.stretch_qd[joint] = speed[0];
    }
    double begin_time = first_stretch_time;
    double claimed_q = s.claimed_q[joint];
    double claimed_qd = s.claimed_qd[joint];
    bool skip = s.skip_stretch[j] != 0;
    for (std::size_t k = from_start ? 1 : 0; k < n_rows; ++k) {
      const double period = times[k + 1] - times[k];
      const double step = std::abs(position[k + 1] - position[k]);
      if (step > 0.0) {
        s.least_step[joint] = std::min(s.least_step[joint], step);
        ++s.steps[joint];
        if (step > 5.9 && (std::abs(step / kTurn - 1.0) < 0.05 || std::abs(step / 360.0 - 1.0) < 0.05)) {
          Impl::Jump& jump = s.jumps[j];
          if (jump.count++ == 0) {
            jump.size = position[k + 1] - position[k];
            jump.time = times[k + 1];
          }
          skip = true;
        } else {
          s.step_sum[joint] += step;
        }
      } else {
        ++s.rests[joint];
      }
      if (s.has_velocity) claimed_q += 0.5 * period * (speed[k] + speed[k + 1]);
      if (s.has_acceleration) claimed_qd += 0.5 * period * (rate[k] + rate[k + 1]);
      if (ends[k] == 0) continue;
      if (!skip && gaps[k] == 0) {
        const double duration = times[k + 1] - begin_time;
        s.velocity[j].add(claimed_q, position[k + 1] - s.stretch_q[joint], duration);
        if (s.has_velocity && s.has_acceleration) {
          s.acceleration[j].add(claimed_qd, speed[k + 1] - s.stretch_qd[joint], duration);
        }
      }
      begin_time = times[k + 1];
      s.stretch_q[joint] = position[k + 1];
      if (s.has_velocity) s.stretch_qd[joint] = speed[k + 1];
      claimed_q = claimed_qd = 0.0;
      skip = false;
    }
    s.claimed_q[joint] = claimed_q;
    s.claimed_qd[joint] = claimed_qd;
    s.skip_stretch[j] = skip ? 1 : 0;
  }
  for (std::size_t k = from_start ? 1 : 0; k < n_rows; ++k) {
    if (repeats[k] != 0) {
      ++s.run;
    } else {
      if (s.run <= kLongestRepetition) s.repeated += s.run;
      s.run = 0;
    }
  }
  s.last_time = time[count - 1];
  s.rows += count;
}

std::vector<LogFinding> LogCheck::findings(const JointLimits& limits) const {
  const Impl& s = *impl_;
  std::vector<LogFinding> found;
  if (s.rows < 2) return found;
  s.find_degrees(limits, found);
  s.find_turns(limits, found);
  s.find_time_unit(found);
  s.find_clock_rate(limits, found);
  if (s.has_velocity) s.find_rate_slips(limits, "qd", "q", s.velocity, found);
  if (s.has_velocity && s.has_acceleration) s.find_rate_slips(limits, "qdd", "qd", s.acceleration, found);
  if (s.has_torque) s.find_torque_unit(limits, found);
  s.find_coarse_sampling(found);
  s.find_resting_joints(limits, found);
  std::stable_partition(found.begin(), found.end(),
                        [](const LogFinding& finding) { return finding.severity == Severity::kError; });
  return found;
}

/// Positions in degrees, or beyond the limits otherwise.
void LogCheck::Impl::find_degrees(const JointLimits& limits, std::vector<LogFinding>& found) const {
  const bool has_limits = limits.lower.size() == n && limits.upper.size() == n;
  const bool has_speeds = limits.velocity.size() == n;
  std::vector<int> beyond, fast, by_velocity, outside;
  bool fits_in_degrees = true;  // every joint would be inside its limits
  for (int joint = 0; joint < n; ++joint) {
    const bool revolute = is_revolute(limits, joint);
    const RateComparison& rate = velocity[static_cast<std::size_t>(joint)];
    if (has_limits) {
      const double lower = limits.lower[joint];
      const double upper = limits.upper[joint];
      // What an offset of the zero may take: a tenth of the largest limit.
      const double slack = 0.1 * std::max(std::isfinite(lower) ? std::abs(lower) : 0.0,
                                          std::isfinite(upper) ? std::abs(upper) : 0.0);
      const bool too_high = high[joint] > upper + slack;
      const bool too_low = low[joint] < lower - slack;
      if (too_high || too_low) outside.push_back(joint);
      const bool far = (too_high && high[joint] > kBeyond * std::max(upper, -lower)) ||
                       (too_low && -low[joint] > kBeyond * std::max(upper, -lower));
      if (revolute && far) beyond.push_back(joint);
      if (revolute && (high[joint] / kDegree > upper + slack || low[joint] / kDegree < lower - slack)) {
        fits_in_degrees = false;
      }
    }
    if (!revolute) continue;
    const bool limited = has_speeds && std::isfinite(limits.velocity[joint]) && limits.velocity[joint] > 0.0;
    const double fastest = limited ? kTooFast * limits.velocity[joint] : kTopSpeed;
    if (rate.top_rate > fastest && rate.stretches > 20) fast.push_back(joint);
    if (has_velocity && travel(joint) > kTellingTravel && rate.correlation() > kBelieved &&
        is_near(rate.ratio(), 1.0 / kDegree)) {
      by_velocity.push_back(joint);
    }
  }
  const auto largest = [&](int joint) {
    return std::abs(high[joint]) >= std::abs(low[joint]) ? high[joint] : low[joint];
  };
  const auto remedy = [&](bool velocity_agrees) {
    return fmt::format("expected rad; multiply q1 to q{}{} by pi/180", n,
                       velocity_agrees ? fmt::format(" and qd1 to qd{}", n) : "");
  };
  // A velocity column that goes with q is in degrees too.
  bool agrees = false;
  for (int joint = 0; has_velocity && joint < n; ++joint) {
    const RateComparison& rate = velocity[static_cast<std::size_t>(joint)];
    agrees = agrees || (rate.correlation() > kBelieved && is_near(rate.ratio(), 1.0));
  }
  if (!beyond.empty() && fits_in_degrees) {
    const auto worst = std::max_element(beyond.begin(), beyond.end(), [&](int a, int b) {
      return std::abs(largest(a)) < std::abs(largest(b));
    });
    const double value = largest(*worst);
    found.push_back(
        {Severity::kError,
         fmt::format("{}: column 'q{}': q{} reaches {:.4g}, the limits are {} rad; {:.4g} is {:.3g} rad in "
                     "degrees{}; {}",
                     path, *worst + 1, *worst + 1, value,
                     range_text(limits.lower[*worst], limits.upper[*worst]), value, value / kDegree,
                     beyond.size() > 1
                         ? fmt::format(" (likewise {})", columns_of("q",
                                                                    [&] {
                                                                      std::vector<int> others = beyond;
                                                                      std::erase(others, *worst);
                                                                      return others;
                                                                    }()))
                         : "",
                     remedy(agrees))});
    return;
  }
  if (!by_velocity.empty()) {
    const int joint = by_velocity.front();
    found.push_back(
        {Severity::kError,
         fmt::format("{}: column 'q{}': {} {} {:.3g} times as fast as qd says, about 180/pi: positions in "
                     "degrees, velocities in rad/s; {}",
                     path, joint + 1, columns_of("q", by_velocity),
                     by_velocity.size() == 1 ? "changes" : "change",
                     1.0 / velocity[static_cast<std::size_t>(joint)].ratio(), remedy(false))});
    return;
  }
  if (!fast.empty() && (!has_limits || fits_in_degrees)) {
    const int joint = fast.front();
    const double speed = velocity[static_cast<std::size_t>(joint)].top_rate;
    const bool limited = has_speeds && std::isfinite(limits.velocity[joint]);
    found.push_back(
        {Severity::kError,
         fmt::format(
             "{}: column 'q{}': {} {} with up to {:.4g} a second, {}; {:.4g} degrees are {:.3g} rad; {}",
             path, joint + 1, columns_of("q", fast), fast.size() == 1 ? "moves" : "move", speed,
             limited ? fmt::format("the velocity limit is {:.4g} rad/s", limits.velocity[joint])
                     : std::string("faster than any arm in rad"),
             speed, speed / kDegree, remedy(agrees))});
    return;
  }
  if (!outside.empty()) {
    const int joint = outside.front();
    found.push_back(
        {Severity::kNote,
         fmt::format(
             "{}: column 'q{}': {} {} outside the limits (q{} from {:.4g} to {:.4g}, limits {}); expected "
             "the positions of this robot; check zero offsets, order of columns and the URDF",
             path, joint + 1, columns_of("q", outside), outside.size() == 1 ? "is" : "are", joint + 1,
             low[joint], high[joint], range_text(limits.lower[joint], limits.upper[joint]))});
  }
}

/// Positions that start again at each turn.
void LogCheck::Impl::find_turns(const JointLimits& limits, std::vector<LogFinding>& found) const {
  for (int joint = 0; joint < n; ++joint) {
    const Jump& jump = jumps[static_cast<std::size_t>(joint)];
    const double mean_step = step_sum[joint] / static_cast<double>(rows);
    if (jump.count == 0 || !is_revolute(limits, joint) || std::abs(jump.size) < 50.0 * mean_step) continue;
    found.push_back(
        {Severity::kError,
         fmt::format("{}: column 'q{}': q{} jumps by {:.4g} at time {:.6g} ({} such jumps): one turn; "
                     "expected positions that count turns; add or take off a turn from there on",
                     path, joint + 1, joint + 1, jump.size, jump.time, jump.count)});
    return;
  }
}

/// Time in milliseconds or smaller.
void LogCheck::Impl::find_time_unit(std::vector<LogFinding>& found) const {
  struct Unit {
    double factor;
    std::string_view name;
  };
  constexpr std::array<Unit, 3> kUnits{{{1e3, "milliseconds"}, {1e6, "microseconds"}, {1e9, "nanoseconds"}}};
  const double rate = sample_rate();
  const auto remedy = [](double factor) {
    return fmt::format("expected seconds; divide time by {:g}", factor);
  };

  // With a velocity: how much faster it is than the change of q over the time stamps.
  for (const Unit& unit : kUnits) {
    std::vector<int> joints;
    for (int joint = 0; has_velocity && joint < n; ++joint) {
      const RateComparison& comparison = velocity[static_cast<std::size_t>(joint)];
      if (travel(joint) < kTellingTravel || comparison.correlation() < kBelieved) continue;
      // Degrees may come on top, on either side.
      const double ratio = comparison.ratio();
      if (is_near(ratio, unit.factor) || is_near(ratio, unit.factor * kDegree) ||
          is_near(ratio, unit.factor / kDegree)) {
        joints.push_back(joint);
      }
    }
    if (joints.empty()) continue;
    const double ratio = velocity[static_cast<std::size_t>(joints.front())].ratio();
    std::string degrees;
    if (is_near(ratio, unit.factor * kDegree)) degrees = " (and qd in degrees a second)";
    if (is_near(ratio, unit.factor / kDegree)) degrees = " (and q in degrees)";
    found.push_back(
        {Severity::kError,
         fmt::format(
             "{}: column 'time': {} {} {:.4g} times what q changes by in that time, and there are {:.3g} "
             "samples a second: time in {}{}; {}",
             path, columns_of("qd", joints), joints.size() == 1 ? "is" : "are", ratio, rate, unit.name,
             degrees, remedy(unit.factor))});
    return;
  }

  double most_travel = 0.0;
  double top_speed = 0.0;
  for (int joint = 0; joint < n; ++joint) {
    most_travel = std::max(most_travel, travel(joint));
    top_speed = std::max(top_speed, velocity[static_cast<std::size_t>(joint)].top_rate);
  }
  // The unit that makes at least 20 samples a second of it.
  const Unit& unit = rate > 0.02 ? kUnits[0] : rate > 2e-5 ? kUnits[1] : kUnits[2];
  if (!has_velocity && rate < kMillisecondRate && most_travel > kClearTravel &&
      top_speed < kMillisecondSpeed) {
    found.push_back(
        {Severity::kError,
         fmt::format("{}: column 'time': {:.3g} samples a second of a motion of {:.3g} rad that is "
                     "never faster than {:.2g} rad/s: time in {}; {}",
                     path, rate, most_travel, top_speed, unit.name, remedy(unit.factor))});
  } else if (rate < kFewSamples) {
    found.push_back({Severity::kNote,
                     fmt::format("{}: column 'time': {:.3g} samples a second; expected 50 or more to derive "
                                 "velocities; if time is in {}, divide it by {:g}",
                                 path, rate, unit.name, unit.factor)});
  }
}

/// What qd of all joints that move is of what q changes by, if it is the same multiple in all of them and a speed that
/// the joints can have (else qd is the motors'): the clock runs at another rate. Else 1.
double LogCheck::Impl::clock_ratio(const JointLimits& limits) const {
  double sum = 0.0;
  std::vector<double> ratios;
  for (int joint = 0; has_velocity && joint < n; ++joint) {
    const RateComparison& c = velocity[static_cast<std::size_t>(joint)];
    if (c.stretches < 10 || travel(joint) < kTellingTravel) continue;
    if (c.correlation() < kBelieved) return 1.0;
    const bool limited =
        limits.velocity.size() == n && limits.velocity[joint] > 0.0 && std::isfinite(limits.velocity[joint]);
    if (c.ratio() * c.top_rate > (limited ? kBeyond * limits.velocity[joint] : kTopSpeed)) return 1.0;
    ratios.push_back(std::log(c.ratio()));
    sum += ratios.back();
  }
  if (ratios.size() < 2) return 1.0;
  const double mean = sum / static_cast<double>(ratios.size());
  for (const double ratio : ratios) {
    if (std::abs(ratio - mean) > kClockTolerance) return 1.0;
  }
  return std::exp(mean);
}

void LogCheck::Impl::find_clock_rate(const JointLimits& limits, std::vector<LogFinding>& found) const {
  const double ratio = clock_ratio(limits);
  if (std::abs(std::log(ratio)) < 0.2) return;
  // Slips of the unit have been named.
  for (const double unit : {1.0, 1e3, 1e6, 1e9}) {
    if (is_near(ratio, unit) || is_near(ratio, unit * kDegree) || is_near(ratio, unit / kDegree)) return;
  }
  found.push_back(
      {Severity::kError,
       fmt::format(
           "{}: column 'time': in every joint that moves qd is {:.4g} times what q changes by in that time, "
           "at "
           "{:.4g} samples a second; expected the same; if qd is right, the log has {:.4g} samples a second: "
           "divide time by {:.4g}",
           path, ratio, sample_rate(), ratio * sample_rate(), ratio)});
}

/// A velocity (or acceleration) column that is not the rate of the column it belongs to.
void LogCheck::Impl::find_rate_slips(const JointLimits& limits, std::string_view rate, std::string_view of,
                                     const std::vector<RateComparison>& comparison,
                                     std::vector<LogFinding>& found) const {
  std::vector<int> degrees, flipped, other, unrelated;
  for (int joint = 0; joint < n; ++joint) {
    const RateComparison& c = comparison[static_cast<std::size_t>(joint)];
    if (c.stretches < 10 || travel(joint) < kTellingTravel) continue;
    const double ratio = c.ratio();
    const double correlation = c.correlation();
    const bool revolute = is_revolute(limits, joint);
    if (std::abs(correlation) < kUnrelated) {
      // Of a joint that hardly moves, the velocity may be noise.
      if (travel(joint) > 5.0 * kTellingTravel) unrelated.push_back(joint);
    } else if (std::abs(correlation) > kBelieved) {
      bool explained = is_near(ratio, 1.0) || (of == "q" && is_near(ratio, clock_ratio(limits)));
      // Other findings name slips of time, and of position against velocity.
      for (const double factor : {1e3, 1e6, 1e9}) {
        explained = explained || is_near(ratio, factor) || is_near(ratio, factor * kDegree) ||
                    is_near(ratio, factor / kDegree);
      }
      explained = explained || (of == "q" && revolute && is_near(ratio, 1.0 / kDegree));
      if (explained) continue;
      if (revolute && is_near(ratio, kDegree)) {
        degrees.push_back(joint);
      } else if (is_near(ratio, -1.0)) {
        flipped.push_back(joint);
      } else if (std::abs(std::log(std::abs(ratio))) > 0.2) {
        other.push_back(joint);
      }
    }
  }
  const auto example = [&](const std::vector<int>& joints) {
    return comparison[static_cast<std::size_t>(joints.front())];
  };
  const auto is = [](const std::vector<int>& joints) { return joints.size() == 1 ? "is" : "are"; };
  const std::string_view unit = of == "q" ? "rad/s" : "rad/s^2";
  const std::string_view per = of == "q" ? "a second" : "a second squared";
  if (!degrees.empty()) {
    found.push_back({Severity::kError,
                     fmt::format("{}: column '{}{}': {} {} {:.4g} times the derivative of {}, about 180/pi: "
                                 "degrees {}; expected {}; multiply {} by pi/180",
                                 path, rate, degrees.front() + 1, columns_of(rate, degrees), is(degrees),
                                 example(degrees).ratio(), of, per, unit, columns_of(rate, degrees))});
  }
  if (!flipped.empty()) {
    found.push_back(
        {Severity::kError,
         fmt::format("{}: column '{}{}': {} {} minus the derivative of {}; expected the same sign; "
                     "change the sign of {}, or of {} if the joint turns the other way",
                     path, rate, flipped.front() + 1, columns_of(rate, flipped), is(flipped), of,
                     columns_of(rate, flipped), columns_of(of, flipped))});
  }
  if (!other.empty()) {
    found.push_back(
        {Severity::kNote,
         fmt::format("{}: column '{}{}': {} {} {:.4g} times the derivative of {}; expected 1; motor "
                     "side, another unit or another joint? correct or leave out the column",
                     path, rate, other.front() + 1, columns_of(rate, other), is(other),
                     example(other).ratio(), of)});
  }
  if (!unrelated.empty()) {
    found.push_back(
        {Severity::kNote,
         fmt::format("{}: column '{}{}': {} {} nothing to do with the derivative of {} (correlation "
                     "{:.2f}); expected the same motion; check the order of the columns or leave {} out",
                     path, rate, unrelated.front() + 1, columns_of(rate, unrelated),
                     unrelated.size() == 1 ? "has" : "have", of, example(unrelated).correlation(), rate)});
  }
}

/// Torques in another unit; limits are too rough for more than a note.
void LogCheck::Impl::find_torque_unit(const JointLimits& limits, std::vector<LogFinding>& found) const {
  if (limits.effort.size() != n) return;
  double most = 0.0;  // largest torque in parts of the limit
  double least = kInfinity;
  int most_joint = 0;
  for (int joint = 0; joint < n; ++joint) {
    const double limit = limits.effort[joint];
    if (!std::isfinite(limit) || !(limit > 0.0) || max_torque[joint] == 0.0) return;
    const double part = max_torque[joint] / limit;
    if (part > most) {
      most = part;
      most_joint = joint;
    }
    least = std::min(least, part);
  }
  const auto note = [&](std::string_view suspicion) {
    found.push_back(
        {Severity::kNote,
         fmt::format("{}: column 'tau{}': reaches {:.4g} with a limit of {:.4g} Nm; expected Nm at "
                     "the joint; {}",
                     path, most_joint + 1, max_torque[most_joint], limits.effort[most_joint], suspicion)});
  };
  if (most > 30.0 && most < 3000.0) {
    note("if it is mNm, divide tau by 1000");
  } else if (most < 2e-3) {
    note("if it is kNm, multiply tau by 1000");
  } else if (most > kBeyond && max_torque.maxCoeff() <= 150.0 && least < 0.3 &&
             limits.effort.maxCoeff() > 3.0 * limits.effort.minCoeff()) {
    // Small joints beyond their limits and large ones far below: everything between 0 and 100.
    note("if it is per cent of the rated torque, multiply tau by the rated torques");
  }
}

/// Rows and positions that are coarser than they look.
void LogCheck::Impl::find_coarse_sampling(std::vector<LogFinding>& found) const {
  const long repeats = repeated + (run <= kLongestRepetition ? run : 0);
  if (rows > 20 && static_cast<double>(repeats) > 0.1 * static_cast<double>(rows)) {
    found.push_back(
        {Severity::kNote,
         fmt::format("{}: {:.0f} % of the rows repeat the row before with a new time stamp; expected "
                     "new samples; thin the log out to the rate at which the robot reports",
                     path, 100.0 * static_cast<double>(repeats) / static_cast<double>(rows))});
  }
  std::vector<int> coarse;
  for (int joint = 0; joint < n; ++joint) {
    if (steps[joint] >= 50 && rests[joint] >= std::max<long>(3, rows / 100) &&
        least_step[joint] >= kCoarseStep) {
      coarse.push_back(joint);
    }
  }
  if (!coarse.empty()) {
    const double step = least_step[coarse.front()];
    found.push_back(
        {Severity::kNote,
         fmt::format("{}: column 'q{}': {} {} in steps of {:.3g} rad ({:.2g} degrees), which makes noise "
                     "in velocity and acceleration; log more digits, or lower the cut-off",
                     path, coarse.front() + 1, columns_of("q", coarse), coarse.size() == 1 ? "comes" : "come",
                     step, step * kDegree)});
  }
}

void LogCheck::Impl::find_resting_joints(const JointLimits& limits, std::vector<LogFinding>& found) const {
  std::vector<int> resting;
  double most = 0.0;
  for (int joint = 0; joint < n; ++joint) {
    if (travel(joint) >= kStillTravel) continue;
    resting.push_back(joint);
    most = std::max(most, travel(joint));
  }
  if (resting.empty()) return;
  const bool one = resting.size() == 1;
  std::string joints;
  for (std::size_t k = 0; k < resting.size(); ++k) {
    joints += fmt::format("{}{}", k == 0 ? "" : (k + 1 == resting.size() ? " and " : ", "), resting[k] + 1);
  }
  found.push_back(
      {Severity::kNote,
       fmt::format("{}: joint{} {} never {} ({} {} within {:.2g} {}); {} friction and {} share of the "
                   "inertia cannot be determined from this log; log a motion of {}",
                   path, one ? "" : "s", joints, one ? "moves" : "move", columns_of("q", resting),
                   one ? "stays" : "stay", most, is_revolute(limits, resting.front()) ? "rad" : "m",
                   one ? "its" : "their", one ? "its" : "their", one ? "it" : "them")});
}

std::string LogCheck::unusable_rate() const {
  const Impl& s = *impl_;
  if (!s.has_velocity || !s.has_acceleration) return {};
  const auto reason = [&](std::string_view rate, std::string_view of,
                          const std::vector<RateComparison>& comparison) -> std::string {
    for (int joint = 0; joint < s.n; ++joint) {
      const RateComparison& c = comparison[static_cast<std::size_t>(joint)];
      if (c.stretches < 10 || s.travel(joint) < 5.0 * kTellingTravel) continue;
      if (c.correlation() < kUnrelated) {
        return fmt::format("{}{} has nothing to do with the derivative of {} (correlation {:.2f})", rate,
                           joint + 1, of, c.correlation());
      }
      if (c.correlation() > kBelieved && std::abs(std::log(c.ratio())) > 0.2) {
        return fmt::format("{}{} is {:.3g} times the derivative of {}", rate, joint + 1, c.ratio(), of);
      }
    }
    return {};
  };
  const std::string velocity = reason("qd", "q", s.velocity);
  return velocity.empty() ? reason("qdd", "qd", s.acceleration) : velocity;
}

std::vector<LogFinding> check_log(const Log& log, const JointLimits& limits) {
  LogCheck check(log.path, log.num_joints());
  check.add(log.time, log.q, log.qd, log.qdd, log.tau);
  return check.findings(limits);
}

void refuse_errors(const std::vector<LogFinding>& findings) {
  for (const LogFinding& finding : findings) {
    if (finding.severity == Severity::kError) throw DataError(finding.message);
  }
}

}  // namespace heft::data
