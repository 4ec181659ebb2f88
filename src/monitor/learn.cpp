#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "causal_run.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "heft/model/at_sensor.hpp"
#include "heft/monitor/monitor.hpp"
#include "heft/statistics/interval.hpp"
#include "heft/statistics/median.hpp"
#include "push_delay.hpp"
#include "threshold_fit.hpp"

namespace heft::monitor {
namespace {

using Eigen::Index;

/// Bandwidths of the observer that are tried [1/s]: 4 Hz, as slow as a hand, up to 32 Hz.
constexpr double kBandwidths[] = {25.0, 50.0, 100.0, 200.0};
/// Length of a block [s]: five time constants of the offsets, so that maxima of blocks hardly know of one another.
constexpr double kBlock = 1.0;
/// Fewer seconds show no tail.
constexpr double kShortest = 10.0;
/// Offsets may be larger by that part than any that the logs show.
constexpr double kOffsetMargin = 1.2;
/// On logs that the model was not fitted to, the deviation was up to 1.7 times as large as on those that it was fitted to
/// (a KUKA LWR4+ on another motion).
constexpr double kSeenMargin = 2.0;
/// A recording of another day exceeds the level of the others by up to that (nineteen recordings of three arms with gears,
/// each judged by the others of its arm; beyond it went motions unlike all others): friction and motions differ more from
/// one recording to the next than within one.
constexpr double kNextRecording = 1.35;
/// Part of its top speed below which a joint is at rest, and the least such speed [rad/s]; a tenth of it in m/s.
constexpr double kRestShare = 0.01, kLeastRest = 0.01;
/// A push that is not found within that time counts as that [s], where bandwidths are compared.
constexpr double kSlowestPush = 2.0;
/// Expected false alarms whose interval reaches that multiple of what was asked for are extrapolated too far.
constexpr double kWideRate = 10.0;

/// Motion without contact, ready for core.
struct FreeMotion {
  std::vector<Signals> logs;
  Eigen::VectorXd rest_speed;
  double seconds{0.0};
  double rate{0.0};  ///< lowest sample rate [Hz]
};

/// Deviations of all joints at one bandwidth, part by part.
struct Deviations {
  std::vector<std::vector<Part>> joints;  ///< [joint][part]
  Eigen::VectorXd largest_offset;
};

struct JointFit {
  Shape shape = Shape::Zero();
  Tail tail;
  double level{0.0};
};

Deviations deviations_of(const model::Robot& robot, const FreeMotion& motion, double bandwidth) {
  const int n = robot.num_joints();
  Deviations found;
  found.joints.resize(static_cast<std::size_t>(n));
  found.largest_offset.setZero(n);
  const Thresholds open = open_thresholds(bandwidth, motion.rest_speed);
  for (const Signals& signals : motion.logs) {
    const Run run = run_core(robot, signals, open, true);
    const Index samples = run.deviation.rows();
    std::vector<Index> rows;
    for (Index k = 0; k < samples; ++k) {
      if (run.judged[static_cast<std::size_t>(k)] != 0) rows.push_back(k);
    }
    if (rows.empty()) continue;
    for (int j = 0; j < n; ++j) {
      Part piece;
      piece.size = run.deviation(rows, j).cwiseAbs();
      piece.circumstance.resize(static_cast<Index>(rows.size()), kCircumstances);
      for (int c = 0; c < kCircumstances; ++c)
        piece.circumstance.col(c) = run.circumstance[static_cast<std::size_t>(c)](rows, j);
      for (const Index k : rows)
        piece.block.push_back(std::lround(std::floor((signals.time[k] - signals.time[0]) / kBlock)));
      found.largest_offset[j] = std::max(found.largest_offset[j], run.offset(rows, j).cwiseAbs().maxCoeff());
      found.joints[static_cast<std::size_t>(j)].push_back(std::move(piece));
    }
  }
  return found;
}

JointFit fit_joint(const std::vector<Part>& parts, double rate) {
  JointFit fit;
  fit.shape = fit_shape(parts);
  fit.tail = tail_of(block_maxima(parts, fit.shape));
  fit.level = kNextRecording * fit.tail.level(rate);
  return fit;
}

double median_threshold(const std::vector<Part>& parts, const JointFit& fit) {
  std::vector<double> all;
  for (const Part& part : parts) {
    const Eigen::VectorXd values = fit.level * part.circumstance * fit.shape;
    all.insert(all.end(), values.begin(), values.end());
  }
  return statistics::median(std::move(all));
}

FreeMotion free_motion_of(const model::Robot& robot, const data::LogSet& logs, Thresholds& result) {
  FreeMotion motion;
  const int n = robot.num_joints();
  Eigen::VectorXd top = Eigen::VectorXd::Zero(n);
  motion.rate = kInfinity;
  for (const data::LogSource& source : logs.train()) {
    const data::Log log = data::read(source, &result.notes);
    motion.logs.push_back(signals_of(robot, log));
    const Signals& signals = motion.logs.back();
    top = top.cwiseMax(signals.qd.cwiseAbs().colwise().maxCoeff().transpose());
    const double seconds = signals.time[signals.time.size() - 1] - signals.time[0];
    motion.seconds += seconds;
    motion.rate = std::min(motion.rate, static_cast<double>(signals.time.size() - 1) / seconds);
    result.logs.push_back(source.path);
  }
  motion.rest_speed.resize(n);
  for (int j = 0; j < n; ++j) {
    const bool prismatic = robot.joints[static_cast<std::size_t>(j)].joint.type == JointType::kPrismatic;
    motion.rest_speed[j] = std::max((prismatic ? 0.1 : 1.0) * kLeastRest, kRestShare * top[j]);
  }
  if (motion.seconds < kShortest) {
    throw NotIdentifiableError(fmt::format(
        "thresholds of contacts: found {:.3g} s of free motion; expected {:.3g} s at least; record the robot's "
        "usual work for some minutes, untouched",
        motion.seconds, kShortest));
  }
  return motion;
}

struct Choice {
  double bandwidth{0.0};
  Deviations deviations;
  std::vector<JointFit> fits;
};

/// The bandwidth at which pushes are found soonest.
Choice choose_bandwidth(const model::Robot& robot, const FreeMotion& motion, double rate,
                        const Thresholds& result, const Options& options) {
  Choice best;
  double soonest = kInfinity;
  int tried = 0;
  for (const double bandwidth : kBandwidths) {
    if (options.progress)
      options.progress("learning thresholds", tried++ / static_cast<double>(std::size(kBandwidths)));
    if (bandwidth > std::max(motion.rate, kBandwidths[0])) continue;
    Choice now{bandwidth, deviations_of(robot, motion, bandwidth), {}};
    double delay = 0.0;
    for (std::size_t j = 0; j < now.deviations.joints.size(); ++j) {
      const std::vector<Part>& parts = now.deviations.joints[j];
      now.fits.push_back(fit_joint(parts, rate));
      const double seconds =
          push_delay(bandwidth, result.adaptation, median_threshold(parts, now.fits.back()),
                     now.deviations.largest_offset[static_cast<Index>(j)]);
      delay += std::isfinite(seconds) ? std::min(seconds, kSlowestPush) : kSlowestPush;
    }
    if (!(delay < soonest)) continue;
    soonest = delay;
    best = std::move(now);
  }
  return best;
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

double push_delay(double bandwidth, double adaptation, double threshold, double offset_limit) {
  constexpr double kStep = 1e-4, kEnd = 10.0;
  double residual = 0.0, offset = 0.0;
  for (double time = kStep; time < kEnd; time += kStep) {
    residual += bandwidth * kStep * (kPushRate * time - residual);
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
  const int n = measured.num_joints();
  const double rate = options.false_alarms_per_hour / n / 3600.0 * kBlock;  // of one joint in one block
  const Choice choice = choose_bandwidth(measured, motion, rate, result, options);
  result.bandwidth = choice.bandwidth;
  const std::vector<std::string> seen = seen_of(file, logs);
  const double margin = seen.empty() ? 1.0 : kSeenMargin;
  const double hourly = 3600.0 / kBlock;
  for (int j = 0; j < n; ++j) {
    const JointFit& joint = choice.fits[static_cast<std::size_t>(j)];
    const Shape form = margin * joint.level * joint.shape;
    result.joints.push_back({form[0], form[1], form[2], form[3], form[4], form[5],
                             margin * kOffsetMargin * choice.deviations.largest_offset[j],
                             motion.rest_speed[j]});
    const double log_rate = joint.tail.log_rate(joint.level), std = joint.tail.log_rate_std(joint.level);
    result.expected.value += hourly * std::exp(log_rate);
    result.expected.lower += hourly * std::exp(log_rate - statistics::kNormal95 * std);
    result.expected.upper += hourly * std::exp(log_rate + statistics::kNormal95 * std);
  }
  judge(seen, options, result);
  return result;
}

}  // namespace heft::monitor
