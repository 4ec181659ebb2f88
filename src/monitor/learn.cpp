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
/// A recording exceeds the level that follows from the others by up to 1.15 (twenty-two recordings of four arms); a single
/// log does not show how friction and motion differ from one recording to the next (a KUKA LWR4+, slow and fast: by 1.5).
constexpr double kNextRecording = 1.2, kOnlyRecording = 1.6;
/// Fewer blocks have no tail; the level without: above any that measured arms asked for.
constexpr std::size_t kFewBlocks = 10;
constexpr double kUnknownLevel = 5.0;
/// A sample counts that many thresholds at least: less would hold up a push, not a glitch.
constexpr double kLeastStep = 0.6;
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

/// Multiple of the scales that is exceeded at half the rate allowed, and the alarms to be expected from it added: rest and
/// motion share them.
double level_of(std::vector<double> maxima, bool single, const Options& options, Thresholds& result) {
  if (maxima.size() < kFewBlocks) return kUnknownLevel;
  constexpr double kHourly = 3600.0 / kBlock;
  const double share = static_cast<double>(maxima.size()) * kBlock / (3600.0 * result.hours);
  Tail tail = tail_of(std::move(maxima));
  if (single) tail.shape = 0.0;  // its own scales hold its largest deviations down
  const double rate = 0.5 * options.false_alarms_per_hour / (kHourly * share);
  const double level = (single ? kOnlyRecording : kNextRecording) * std::max(tail.level(rate), 1.0);
  const double log_rate = tail.log_rate(level), half = statistics::kNormal95 * tail.log_rate_std(level);
  result.expected.value += kHourly * share * std::exp(log_rate);
  result.expected.lower += kHourly * share * std::exp(log_rate - half);
  result.expected.upper += kHourly * share * std::exp(log_rate + half);
  return level;
}

/// Mean delay of a push by a hand over the joints, in motion [s].
double hand_delay(const Thresholds& thresholds, double level) {
  double delay = 0.0;
  for (const JointThreshold<double>& joint : thresholds.joints) {
    const double seconds = push_delay(thresholds.bandwidth, thresholds.adaptation, level * joint.moving,
                                      joint.offset_limit, kHandRate);
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
  const bool single = motion.logs.size() == 1;
  result.expected = {0.0, kNaN, 0.0, 0.0};
  const double rest = level_of(maxima.rest, single, options, result);
  const double level = level_of(maxima.motion, single, options, result);
  result.bandwidth = scales.bandwidth;
  result.load_rate = scales.load_rate;
  result.largest_step = std::max(scales.largest_step / (margin * level), kLeastStep);
  result.joints = scales.joints;
  for (JointThreshold<double>& joint : result.joints) {
    joint.moving *= margin * level;
    joint.turning *= margin * level;
    joint.rest *= margin * rest;
    joint.offset_limit *= margin;
  }
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

double push_delay(double bandwidth, double adaptation, double threshold, double offset_limit, double rate) {
  constexpr double kStep = 1e-4, kEnd = 10.0;
  double residual = 0.0, offset = 0.0;
  for (double time = kStep; time < kEnd; time += kStep) {
    residual += bandwidth * kStep * (rate * time - residual);
    if (residual - offset > threshold) return time;
    offset = std::min(offset + adaptation * kStep * (residual - offset), offset_limit);
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
