#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "balance.hpp"
#include "causal_run.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "heft/model/at_sensor.hpp"
#include "heft/monitor/monitor.hpp"
#include "heft/statistics/interval.hpp"
#include "push_delay.hpp"
#include "threshold_fit.hpp"

namespace heft::monitor {
namespace {

/// Bandwidths of the low-pass that are tried [1/s]: 4 Hz, as slow as a hand, up to 32 Hz.
constexpr double kBandwidths[] = {25.0, 35.0, 50.0, 100.0, 200.0};
/// Push by which they are compared [N·m/s]: hands that pushed a UR5 raised the torque of a joint by 100 to 400.
constexpr double kHandRate = 200.0;
/// Multiple of the scales by which they are compared: what the tail of measured arms asks for, 1.5 to 4.
constexpr double kUsualLevel = 2.0;
/// A push that is not found within that time counts as that [s].
constexpr double kSlowestPush = 2.0;
/// Fewer seconds show no tail.
constexpr double kShortest = 10.0;
/// On logs that the model was not fitted to, the deviation was up to 1.7 times as large as on those that it was fitted to
/// (a KUKA LWR4+ on another motion).
constexpr double kSeenMargin = 2.0;
/// By how much a recording may exceed the multiple that follows from the others.
struct Margin {
  double
      next;  ///< than several recordings (one of twenty-two of four arms: the residual by 1.26, its change by 1.19)
  double
      only;  ///< than a single one, which does not show how recordings differ (the residual of a KR 300: by 3.3)
};
constexpr Margin kLevelMargin{1.4, 4.0}, kChangeMargin{1.25, 1.6};
/// Fewer blocks have no tail; the level without: above any that measured arms asked for.
constexpr std::size_t kFewBlocks = 10;
constexpr double kUnknownLevel = 5.0;
/// Part of the threshold of a change by which a single sample moves the residual at most. A glitch of the torque is in two
/// samples, one of the velocity in two of opposite signs: neither reaches the threshold.
constexpr double kGlitchShare = 0.45;
/// Least speed of a joint that moves [rad/s]; a tenth of it in m/s.
constexpr double kLeastSpeed = 0.01;
/// Expected false alarms whose interval reaches that multiple of what was asked for are extrapolated too far.
constexpr double kWideRate = 10.0;

/// Motion without contact.
struct FreeMotion {
  std::vector<Balance> logs;
  Eigen::VectorXd least_speed;
  double seconds{0.0};
  double rate{0.0};  ///< lowest sample rate [Hz]

  std::vector<const Balance*> all() const {
    std::vector<const Balance*> pointers;
    for (const Balance& log : logs) pointers.push_back(&log);
    return pointers;
  }
};

FreeMotion free_motion_of(const model::Robot& robot, const data::LogSet& logs, Thresholds& result) {
  FreeMotion motion;
  const int n = robot.num_joints();
  motion.rate = kInfinity;
  for (const data::LogSource& source : logs.train()) {
    const data::Log log = data::read(source, &result.notes);
    const Signals signals = signals_of(robot, log);
    motion.logs.push_back(balance_of(robot, signals));
    const double seconds = signals.time[signals.time.size() - 1] - signals.time[0];
    motion.seconds += seconds;
    motion.rate = std::min(motion.rate, static_cast<double>(signals.time.size() - 1) / seconds);
    result.logs.push_back(source.path);
  }
  motion.least_speed.resize(n);
  for (int j = 0; j < n; ++j) {
    const bool prismatic = robot.joints[static_cast<std::size_t>(j)].joint.type == JointType::kPrismatic;
    motion.least_speed[j] = (prismatic ? 0.1 : 1.0) * kLeastSpeed;
  }
  if (motion.seconds < kShortest) {
    throw NotIdentifiableError(fmt::format(
        "thresholds of contacts: found {:.3g} s of free motion; expected {:.3g} s at least; record the robot's "
        "usual work for some minutes, untouched",
        motion.seconds, kShortest));
  }
  return motion;
}

/// As ContactThresholds::largest_step.
double largest_step(double bandwidth, double rate) {
  return std::clamp(kGlitchShare / -std::expm1(-bandwidth / rate), 1e-3, 1000.0);
}

/// Multiples of scales that are exceeded at the rate allowed, and the alarms to be expected from them.
class Levels {
 public:
  Levels(bool single, const Options& options, double hours)
      : single_(single), allowed_(options.false_alarms_per_hour), hours_(hours) {}

  /// @param part  of the alarms that are allowed
  double level_of(const std::vector<double>& maxima, double part, const Margin& margin) {
    if (maxima.size() < kFewBlocks) return kUnknownLevel;
    constexpr double kHourly = 3600.0 / kBlock;
    const double share = static_cast<double>(maxima.size()) * kBlock / (3600.0 * hours_);
    Tail tail = tail_of(maxima);
    if (single_) tail.shape = 0.0;  // its own scales hold its largest deviations down
    const double rate = part * allowed_ / (kHourly * share);
    const double level = (single_ ? margin.only : margin.next) * std::max(tail.level(rate), 1.0);
    const double alarms = kHourly * share * std::exp(tail.log_rate(level));
    alarms_ += alarms;
    variance_ += std::pow(alarms * tail.log_rate_std(level), 2);
    return level;
  }

  /// Alarms an hour. The tails are taken as independent, the logarithm of each is known by its standard deviation.
  statistics::Interval expected() const {
    if (!(alarms_ > 0)) return {0.0, kNaN, 0.0, 0.0};
    const double half = statistics::kNormal95 * std::sqrt(variance_) / alarms_;
    return {alarms_, kNaN, alarms_ * std::exp(-half), alarms_ * std::exp(half)};
  }

 private:
  bool single_;
  double allowed_, hours_;
  double alarms_{0.0}, variance_{0.0};
};

/// Mean delay of a push by a hand over the joints, in motion [s].
double hand_delay(const Thresholds& thresholds, double level) {
  double delay = 0.0;
  for (const JointThreshold<double>& joint : thresholds.joints) {
    const double seconds =
        push_delay(thresholds, level * joint.moving, level * joint.moving_change, kHandRate);
    delay += std::isfinite(seconds) ? std::min(seconds, kSlowestPush) : kSlowestPush;
  }
  return delay / static_cast<double>(thresholds.joints.size());
}

/// Thresholds at one bandwidth, from scales there. Changes what `result` expects.
void set_thresholds(const FreeMotion& motion, const Thresholds& scales, double margin, const Options& options,
                    Thresholds& result) {
  const BlockMaxima maxima = block_maxima(motion.all(), motion.least_speed, scales.bandwidth);
  if (maxima.motion.size() < kFewBlocks) {
    throw NotIdentifiableError(fmt::format(
        "thresholds of contacts: found {:.3g} s of motion in {:.3g} s; expected {:.3g} s at least; record the robot's usual "
        "work for some minutes, untouched",
        static_cast<double>(maxima.motion.size()) * kBlock, motion.seconds,
        static_cast<double>(kFewBlocks) * kBlock));
  }
  // Residual and change, rest and motion share the alarms; of the change each joint has its part, since one that is noisy
  // or sticks must not raise the thresholds of the others.
  constexpr double kPart = 0.25;
  Levels levels(motion.logs.size() == 1, options, result.hours);
  const double rest = levels.level_of(maxima.rest, kPart, kLevelMargin);
  const double moving = levels.level_of(maxima.motion, kPart, kLevelMargin);
  result.bandwidth = scales.bandwidth;
  result.load_rate = scales.load_rate;
  result.largest_step = largest_step(scales.bandwidth, motion.rate);
  result.joints = scales.joints;
  const double joint_part = kPart / static_cast<double>(result.joints.size());
  for (std::size_t j = 0; j < result.joints.size(); ++j) {
    JointThreshold<double>& joint = result.joints[j];
    const double change = levels.level_of(maxima.motion_change[j], joint_part, kChangeMargin);
    joint.moving *= margin * moving;
    joint.turning *= margin * moving;
    joint.rest *= margin * rest;
    joint.moving_change *= margin * change;
    joint.turning_change *= margin * change;
    joint.rest_change *= margin * levels.level_of(maxima.rest_change[j], joint_part, kChangeMargin);
  }
  result.expected = levels.expected();
}

/// Thresholds at the bandwidth by which pushes are found soonest: of the two that promise most by their scales, that which
/// keeps the promise.
void choose(const FreeMotion& motion, double margin, const Options& options, Thresholds& result) {
  std::vector<Thresholds> candidates;
  for (const double bandwidth : kBandwidths) {
    if (options.progress)
      options.progress("learning thresholds", static_cast<double>(candidates.size()) /
                                                  static_cast<double>(std::size(kBandwidths) + 2));
    if (bandwidth > std::max(motion.rate, kBandwidths[0])) continue;
    candidates.push_back(scales_of(motion.all(), motion.least_speed, bandwidth));
  }
  std::stable_sort(candidates.begin(), candidates.end(), [](const Thresholds& a, const Thresholds& b) {
    return hand_delay(a, kUsualLevel) < hand_delay(b, kUsualLevel);
  });
  double soonest = kInfinity;
  for (std::size_t k = 0; k < std::min<std::size_t>(candidates.size(), 2); ++k) {
    Thresholds now = result;
    set_thresholds(motion, candidates[k], margin, options, now);
    const double delay = hand_delay(now, 1.0);
    if (!(delay < soonest)) continue;
    soonest = delay;
    result = std::move(now);
  }
}

/// A number of alarms for a sentence.
std::string alarms(double count) {
  return count < 10 ? fmt::format("{:.2g}", count) : fmt::format("{:.0f}", count);
}

/// The logs that the model was fitted to, among those to learn from.
std::vector<std::string> seen_of(const model::ModelFile& file, const data::LogSet& logs) {
  std::vector<std::string> seen;
  for (const std::string& path : file.provenance.logs) {
    for (const data::LogSource& source : logs.train()) {
      if (source.path == path) seen.push_back(path);
    }
  }
  return seen;
}

void judge(const std::vector<std::string>& seen, const Options& options, Thresholds& result) {
  using host::Verdict;
  result.judgement.add(options.torque);
  if (!seen.empty()) {
    result.judgement.add(
        Verdict::kDoubtful,
        fmt::format("the thresholds were learnt from {}, which the model was fitted to: its residual is "
                    "larger on other motions, so they were doubled",
                    seen.front()));
  }
  if (result.expected.upper > kWideRate * result.asked_rate) {
    result.judgement.add(
        Verdict::kDoubtful,
        fmt::format("{:.2g} min of free motion let expect up to {} false alarms an hour; {} were "
                    "allowed: learn from more of it",
                    60.0 * result.hours, alarms(result.expected.upper), alarms(result.asked_rate)));
  }
}

}  // namespace

double push_delay(const Thresholds& thresholds, double level, double change, double rate) {
  constexpr double kStep = 1e-4, kEnd = 10.0;
  double residual = 0.0, mean = 0.0;
  for (double time = kStep; time < kEnd; time += kStep) {
    residual += thresholds.bandwidth * kStep * (rate * time - residual);
    if (residual > level || residual - mean > change) return time;
    mean += thresholds.adaptation * kStep * (residual - mean);
  }
  return kNaN;
}

Thresholds learn(const model::ModelFile& file, const model::Robot& robot, const data::LogSet& logs,
                 const Options& options) {
  if (!(options.false_alarms_per_hour > 0)) {
    throw InputError(fmt::format("false alarms an hour: found {}; expected a number above 0",
                                 options.false_alarms_per_hour));
  }
  Thresholds result;
  const model::FitRecord* fit = file.fit ? &*file.fit : nullptr;
  const model::Robot measured =
      model::as_measured(robot, logs.torque_at() == data::TorqueAt::kJoint, fit, &result.notes);
  result.torque_at = data::to_string(logs.torque_at());
  result.asked_rate = options.false_alarms_per_hour;
  const FreeMotion motion = free_motion_of(measured, logs, result);
  result.hours = motion.seconds / 3600.0;
  const std::vector<std::string> seen = seen_of(file, logs);
  choose(motion, seen.empty() ? 1.0 : kSeenMargin, options, result);
  judge(seen, options, result);
  return result;
}

}  // namespace heft::monitor
