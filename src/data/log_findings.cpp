#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "heft/data/log_checks.hpp"
#include "heft/host/numbers.hpp"
#include "log_check_impl.hpp"

namespace heft::data {
namespace {

constexpr double kDegree = 180.0 / std::numbers::pi;
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

bool is_near(double ratio, double factor) {
  return ratio * factor > 0.0 && std::abs(std::log(ratio / factor)) < kRatioTolerance;
}

std::string range_text(double lower, double upper) {
  if (lower == -upper) return fmt::format("+-{:.4g}", upper);
  return fmt::format("{:.4g} to {:.4g}", lower, upper);
}

}  // namespace

std::string columns_of(std::string_view prefix, const std::vector<int>& joints) {
  std::string text;
  for (std::size_t k = 0; k < joints.size(); ++k) {
    text +=
        fmt::format("{}{}{}", k == 0 ? "" : (k + 1 == joints.size() ? " and " : ", "), prefix, joints[k] + 1);
  }
  return text;
}

std::vector<LogFinding> LogCheck::findings(const JointLimits& limits) const {
  const Impl& s = *impl_;
  std::vector<LogFinding> found;
  if (s.rows < 2) return found;
  // A position that jumps is as fast as one in degrees.
  if (!s.find_jumps(limits, found)) s.find_degrees(limits, found);
  s.find_turns(limits, found);
  s.find_time_unit(found);
  s.find_clock_rate(limits, found);
  if (s.has_velocity) s.find_rate_slips(limits, "qd", "q", s.velocity, found);
  if (s.has_velocity && s.has_acceleration) s.find_rate_slips(limits, "qdd", "qd", s.acceleration, found);
  if (s.has_torque) {
    s.find_torque_unit(limits, found);
    s.find_held_torque(limits, found);
    s.find_torque_spikes(found);
  }
  s.find_late_stamps(found);
  s.find_coarse_sampling(found);
  s.find_resting_joints(limits, found);
  std::stable_partition(found.begin(), found.end(),
                        [](const LogFinding& finding) { return finding.severity == Severity::kError; });
  return found;
}

double LogCheck::Impl::velocity_limit(const JointLimits& limits, int joint) const {
  return limits.velocity.size() == n && limits.velocity[joint] > 0.0 ? limits.velocity[joint] : kInfinity;
}

double LogCheck::Impl::top_speed(const JointLimits& limits, int joint) const {
  const double limit = velocity_limit(limits, joint);
  return std::isfinite(limit) ? kTooFast * limit : kTopSpeed;
}

LogCheck::Impl::DegreeSigns LogCheck::Impl::degree_signs(const JointLimits& limits) const {
  const bool has_limits = limits.lower.size() == n && limits.upper.size() == n;
  DegreeSigns signs;
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
      if (too_high || too_low) signs.outside.push_back(joint);
      const bool far = (too_high && high[joint] > kBeyond * std::max(upper, -lower)) ||
                       (too_low && -low[joint] > kBeyond * std::max(upper, -lower));
      if (revolute && far) signs.beyond.push_back(joint);
      if (revolute && (high[joint] / kDegree > upper + slack || low[joint] / kDegree < lower - slack)) {
        signs.fits_in_degrees = false;
      }
    }
    if (!revolute) continue;
    if (rate.top_rate > top_speed(limits, joint) && rate.stretches > 20) signs.fast.push_back(joint);
    if (has_velocity && travel(joint) > kTellingTravel && rate.correlation() > kBelieved &&
        is_near(rate.ratio(), 1.0 / kDegree)) {
      signs.by_velocity.push_back(joint);
    }
  }
  return signs;
}

/// Positions in degrees, or beyond the limits otherwise.
void LogCheck::Impl::find_degrees(const JointLimits& limits, std::vector<LogFinding>& found) const {
  const bool has_limits = limits.lower.size() == n && limits.upper.size() == n;
  const bool has_speeds = limits.velocity.size() == n;
  const DegreeSigns signs = degree_signs(limits);
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
  if (!signs.beyond.empty() && signs.fits_in_degrees) {
    const auto worst = std::max_element(signs.beyond.begin(), signs.beyond.end(), [&](int a, int b) {
      return std::abs(largest(a)) < std::abs(largest(b));
    });
    const double value = largest(*worst);
    found.push_back(
        {Severity::kError,
         fmt::format("{}: column 'q{}': q{} reaches {:.4g}, the limits are {} rad; {:.4g} is {:.3g} rad in "
                     "degrees{}; {}",
                     path, *worst + 1, *worst + 1, value,
                     range_text(limits.lower[*worst], limits.upper[*worst]), value, value / kDegree,
                     signs.beyond.size() > 1
                         ? fmt::format(" (likewise {})", columns_of("q",
                                                                    [&] {
                                                                      std::vector<int> others = signs.beyond;
                                                                      std::erase(others, *worst);
                                                                      return others;
                                                                    }()))
                         : "",
                     remedy(agrees))});
    return;
  }
  if (!signs.by_velocity.empty()) {
    const int joint = signs.by_velocity.front();
    found.push_back(
        {Severity::kError,
         fmt::format("{}: column 'q{}': {} {} {:.3g} times as fast as qd says, about 180/pi: positions in "
                     "degrees, velocities in rad/s; {}",
                     path, joint + 1, columns_of("q", signs.by_velocity),
                     signs.by_velocity.size() == 1 ? "changes" : "change",
                     1.0 / velocity[static_cast<std::size_t>(joint)].ratio(), remedy(false))});
    return;
  }
  if (!signs.fast.empty() && (!has_limits || signs.fits_in_degrees)) {
    const int joint = signs.fast.front();
    const double speed = velocity[static_cast<std::size_t>(joint)].top_rate;
    const bool limited = has_speeds && std::isfinite(limits.velocity[joint]);
    found.push_back(
        {Severity::kError,
         fmt::format(
             "{}: column 'q{}': {} {} with up to {:.4g} a second, {}; {:.4g} degrees are {:.3g} rad; {}",
             path, joint + 1, columns_of("q", signs.fast), signs.fast.size() == 1 ? "moves" : "move", speed,
             limited ? fmt::format("the velocity limit is {:.4g} rad/s", limits.velocity[joint])
                     : std::string("faster than any arm in rad"),
             speed, speed / kDegree, remedy(agrees))});
    return;
  }
  if (!signs.outside.empty()) {
    const int joint = signs.outside.front();
    found.push_back(
        {Severity::kNote,
         fmt::format(
             "{}: column 'q{}': {} {} outside the limits (q{} from {:.4g} to {:.4g}, limits {}); expected "
             "the positions of this robot; check zero offsets, order of columns and the URDF",
             path, joint + 1, columns_of("q", signs.outside), signs.outside.size() == 1 ? "is" : "are",
             joint + 1, low[joint], high[joint], range_text(limits.lower[joint], limits.upper[joint]))});
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
    const double limit = velocity_limit(limits, joint);
    if (c.ratio() * c.top_rate > (std::isfinite(limit) ? kBeyond * limit : kTopSpeed)) return 1.0;
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
  const Eigen::ArrayXd max_torque = most_torque.max(-least_torque);
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

}  // namespace heft::data
