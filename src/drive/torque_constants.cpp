#include "heft/drive/torque_constants.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/host/words.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/statistics/median.hpp"
#include "host/json.hpp"
#include "log_slopes.hpp"

namespace heft::drive {
namespace {

/// Scatter from log to log beyond which they do not show one constant [1].
constexpr double kScatter = 0.05;
/// A log whose constant is off by more than this from the median of at least three, and by more than kSurely times what
/// both intervals allow, contradicts the others [1]: ten times the scatter between logs of a drive that is well known.
constexpr double kContradicts = 0.05;
/// Three standard deviations instead of two: every log is asked about every joint.
constexpr double kSurely = 1.5;
/// Half-width in all joints below which no drive was measured [1]: a tenth of what the best logs give.
constexpr double kMade = 5e-4;
/// No geared joint gives so little torque an ampere [N·m/A]: motors of arms give 0.05 to 0.2 before a gear of 50 and more.
constexpr double kTiny = 0.05;

/// Slopes of all joints in one log.
struct LogSlopes {
  std::string log;
  std::vector<Slope> slopes;
};

double half_width(const Slope& slope) { return slope.factor * slope.std; }

bool shows(const Slope& slope) { return slope.known() && half_width(slope) < kWidestLog * slope.value; }

/// How far a log is from the median of those that are left, as a share of it, in the joint where that is most; 0 when it
/// contradicts them nowhere.
double contradiction(const std::vector<LogSlopes>& logs, const std::vector<bool>& off, std::size_t log) {
  double worst = 0.0;
  for (std::size_t j = 0; j < logs[log].slopes.size(); ++j) {
    const Slope& slope = logs[log].slopes[j];
    if (!shows(slope)) continue;
    std::vector<double> values, widths;
    for (std::size_t k = 0; k < logs.size(); ++k) {
      if (off[k] || !shows(logs[k].slopes[j])) continue;
      values.push_back(logs[k].slopes[j].value);
      widths.push_back(half_width(logs[k].slopes[j]));
    }
    if (values.size() < 3) continue;
    const double middle = statistics::median(values);
    const double allowed = kSurely * std::hypot(half_width(slope), statistics::median(widths));
    const double error = std::abs(slope.value - middle);
    if (error > kContradicts * middle && error > allowed) worst = std::max(worst, error / middle);
  }
  return worst;
}

/// Logs that contradict the others in a joint: the worst first, one at a time, as long as most logs agree.
std::vector<bool> contradicting(const std::vector<LogSlopes>& logs) {
  std::vector<bool> off(logs.size(), false);
  for (std::size_t count = 0; 2 * (count + 1) < logs.size(); ++count) {
    std::size_t worst = 0;
    double largest = 0.0;
    for (std::size_t k = 0; k < logs.size(); ++k) {
      const double error = off[k] ? 0.0 : contradiction(logs, off, k);
      if (error > largest) worst = k, largest = error;
    }
    if (largest == 0.0) break;
    off[worst] = true;
  }
  return off;
}

std::string file_name(const std::string& path) { return std::filesystem::path(path).filename().string(); }

/// What makes a joint known that is not.
std::string motion_for(From from) {
  return from == From::kStandstill
             ? "record poses at rest in which gravity loads the joint"
             : "record a motion in which gravity or acceleration loads the joint, both ways and faster than 0.03 rad/s";
}

/// The constant 1/b of a joint from the slopes b of the logs that show it.
JointConstant constant_of(const std::vector<LogSlopes>& logs, const std::vector<bool>& off, std::size_t joint,
                          From from) {
  JointConstant result;
  result.from = from;
  std::vector<Slope> used;
  double best = kInfinity;
  for (std::size_t k = 0; k < logs.size(); ++k) {
    const Slope& slope = logs[k].slopes[joint];
    if (slope.opposite) {
      result.missing = fmt::format(
          "in {} the current falls as the target torque rises: the sign of one of them is wrong; turn it "
          "round in the log",
          file_name(logs[k].log));
      return result;
    }
    if (!slope.known()) continue;
    best = std::min(best, half_width(slope) / slope.value);
    if (!shows(slope)) continue;
    result.logs.push_back(
        {logs[k].log,
         statistics::reciprocal(statistics::Interval::around(slope.value, slope.std, slope.factor)),
         !off[k]});
    if (!off[k]) used.push_back(slope);
  }
  const auto unknown = [&](const std::string& why) {
    result.missing = why + "; " + motion_for(from);
    return result;
  };
  if (used.empty()) {
    return unknown(
        std::isfinite(best)
            ? fmt::format("the target torque hardly moves the current (interval ±{:.0f} %)", 100.0 * best)
            : "the target torque does not move the current");
  }
  const Combined mean = combine(used);
  const auto slope = statistics::Interval::around(
      mean.value, mean.std, used.size() == 1 ? used.front().factor : statistics::kNormal95);
  if (mean.between > kScatter * mean.value)
    return unknown(
        fmt::format("the logs differ by {:.0f} % from one to another", 100.0 * mean.between / mean.value));
  if (slope.half_width() > kWidest * mean.value) {
    return unknown(fmt::format("the interval is ±{:.0f} %, which is too wide to use",
                               100.0 * slope.half_width() / mean.value));
  }
  result.constant = statistics::reciprocal(slope);
  std::vector<double> friction;
  for (const Slope& one : used)
    if (std::isfinite(one.load_friction)) friction.push_back(one.load_friction);
  if (!friction.empty()) {
    double sum = 0.0;
    for (const double share : friction) sum += share;
    result.load_friction = sum / static_cast<double>(friction.size());
  }
  return result;
}

void judge(TorqueConstants& constants) {
  std::vector<int> unknown;
  std::size_t known = 0;
  for (std::size_t j = 0; j < constants.joints.size(); ++j) {
    if (constants.joints[j].known()) {
      ++known;
    } else {
      unknown.push_back(static_cast<int>(j));
    }
  }
  if (known == 0) {
    constants.judgement.add(host::Verdict::kBad, "the logs show the torque constant of no joint");
  } else if (!unknown.empty()) {
    constants.judgement.add(host::Verdict::kDoubtful, fmt::format("the torque constant of {} is not known",
                                                                  host::joints_in_words(unknown)));
  }
}

/// Constants of both kinds of current that differ: logs of two arms, or a load that the controller does not know of.
void compare_kinds(const std::vector<JointConstant>& by_target, const std::vector<LogSlopes>& by_current,
                   const std::vector<bool>& off, TorqueConstants& constants) {
  std::vector<int> joints;
  double largest = 0.0;
  for (std::size_t j = 0; j < by_target.size() && !by_current.empty(); ++j) {
    const JointConstant other = constant_of(by_current, off, j, From::kMotion);
    if (!by_target[j].known() || !other.known()) continue;
    const statistics::Interval &a = by_target[j].constant, &b = other.constant;
    const double error = std::abs(a.value - b.value);
    if (error < kContradicts * a.value || error < kSurely * std::hypot(a.half_width(), b.half_width()))
      continue;
    joints.push_back(static_cast<int>(j));
    largest = std::max(largest, error / a.value);
  }
  if (joints.empty()) return;
  constants.judgement.add(
      host::Verdict::kDoubtful,
      fmt::format(
          "the logs with target current and those without differ by up to {:.0f} % in {}; expected logs of one arm, "
          "whose controller knows its load",
          100.0 * largest, host::joints_in_words(joints)));
}

/// What no drive shows: a current without friction or noise, or thousandths of the usual constant.
void doubt_signals(const std::vector<LogSlopes>& by_current, TorqueConstants& constants) {
  for (const LogSlopes& log : by_current) {
    const bool made = std::all_of(log.slopes.begin(), log.slopes.end(), [](const Slope& slope) {
      return slope.known() && half_width(slope) < kMade * slope.value;
    });
    if (!made) continue;
    constants.judgement.add(
        host::Verdict::kDoubtful,
        fmt::format(
            "in {} the target torque is the measured current times a constant; expected the torque of the "
            "controller's model, without friction",
            file_name(log.log)));
  }
  const bool tiny =
      std::all_of(constants.joints.begin(), constants.joints.end(),
                  [](const JointConstant& joint) { return !joint.known() || joint.constant.value < kTiny; });
  if (tiny && constants.usable())
    constants.notes.push_back(
        "All constants are a thousandth of what geared joints have: if the current is in mA, the constants are in N·m/mA.");
}

std::vector<std::string> names_of(const std::vector<LogSlopes>& logs, const std::vector<bool>& off) {
  std::vector<std::string> names;
  for (std::size_t k = 0; k < logs.size(); ++k)
    if (off[k]) names.push_back(logs[k].log);
  return names;
}

}  // namespace

const char* to_string(From from) {
  switch (from) {
    case From::kStandstill: return "standstill";
    case From::kMotion: return "motion";
    case From::kLoad: return "load";
  }
  return "";
}

bool TorqueConstants::usable() const {
  return judgement.usable() &&
         std::any_of(joints.begin(), joints.end(), [](const JointConstant& joint) { return joint.known(); });
}

std::vector<double> TorqueConstants::values() const {
  std::vector<double> result;
  for (const JointConstant& joint : joints) result.push_back(joint.constant.value);
  return result;
}

std::vector<double> completed(std::vector<double> values, const std::vector<double>& otherwise) {
  std::vector<int> missing;
  for (std::size_t j = 0; j < values.size(); ++j) {
    if (std::isfinite(values[j])) continue;
    if (otherwise.size() == 1) values[j] = otherwise[0];
    if (otherwise.size() == values.size()) values[j] = otherwise[j];
    if (!std::isfinite(values[j])) missing.push_back(static_cast<int>(j));
  }
  if (!missing.empty()) {
    throw DataError(fmt::format(
        "the torque constant of {} is not known; expected one for every joint; give those that are missing",
        host::joints_in_words(missing)));
  }
  return values;
}

data::LogSet open_logs(const std::vector<std::string>& paths, const data::ReadAs& as) {
  if (paths.empty())
    throw InputError("no log was given; expected one or more with target torque and current");
  std::error_code ignored;
  data::LogFiles files;
  files.train = paths;
  files.split = 0.0;
  files.torque = false;
  files.as = as;
  data::LogRequirements needs;
  needs.as = as;
  if (std::filesystem::is_regular_file(paths.front(), ignored)) {
    const data::MotionStream first(paths.front(), needs);
    return data::open_logs(std::vector<JointSpec>(static_cast<std::size_t>(first.summary().num_joints)),
                           files);
  }
  // What can be read only once is kept in memory.
  std::vector<data::Log> logs;
  for (const std::string& path : paths) logs.push_back(data::read_log(path, needs));
  const std::vector<JointSpec> joints(static_cast<std::size_t>(logs.front().num_joints()));
  return data::log_set(joints, std::move(logs), {});
}

TorqueConstants from_targets(const data::LogSet& logs) {
  TorqueConstants constants;
  std::vector<LogSlopes> at_rest, by_target, by_current;
  for (const data::LogSource& log : logs.given()) {
    constants.logs.push_back(log.path);
    const DriveLog signals(log);
    const bool by_targets = signals.has(Signal::kTargetCurrent);
    if (!signals.has_target() || !(by_targets || signals.has(Signal::kCurrent))) {
      constants.notes.push_back(fmt::format(
          "{}: columns tauref1.. and one of iref1.., i1.. are not there for all joints; the log is not used",
          log.path));
      continue;
    }
    const Slopes slopes = signals.slopes(by_targets ? Signal::kTargetCurrent : Signal::kCurrent, by_targets);
    if (by_targets) at_rest.push_back({log.path, slopes.at_rest});
    (by_targets ? by_target : by_current).push_back({log.path, slopes.in_motion});
  }
  if (by_target.empty() && by_current.empty()) {
    throw DataError(
        "no log has the controller's target torque (tauref1..) with its target current (iref1..) or the measured current "
        "(i1..); expected these columns for all joints; record them, or give a known load");
  }
  const std::vector<bool> rest_off = contradicting(at_rest), target_off = contradicting(by_target),
                          current_off = contradicting(by_current);
  const std::size_t n = (by_target.empty() ? by_current : by_target).front().slopes.size();
  for (std::size_t j = 0; j < n; ++j) {
    JointConstant best;
    if (!at_rest.empty()) best = constant_of(at_rest, rest_off, j, From::kStandstill);
    if (!best.known() && !by_target.empty()) best = constant_of(by_target, target_off, j, From::kMotion);
    if (!best.known() && !by_current.empty()) best = constant_of(by_current, current_off, j, From::kMotion);
    constants.joints.push_back(std::move(best));
  }
  if (!by_target.empty()) compare_kinds(constants.joints, by_current, current_off, constants);
  for (const std::string& log : names_of(by_current, current_off)) {
    constants.judgement.add(
        host::Verdict::kDoubtful,
        fmt::format(
            "{} contradicts the other logs and is not used; a load that the controller does not know of would do that",
            file_name(log)));
  }
  if (!by_current.empty()) {
    constants.notes.push_back(
        "Constants from the measured current are as right as the controller's model: a load that it does not know of makes "
        "them too small.");
  }
  judge(constants);
  doubt_signals(by_current, constants);
  return constants;
}

std::vector<statistics::Interval> torque_scales(const std::vector<data::LogSource>& logs) {
  std::vector<LogSlopes> slopes;
  for (const data::LogSource& log : logs) {
    const DriveLog signals(log);
    if (signals.has_target() && signals.has(Signal::kTorque))
      slopes.push_back({log.path, signals.slopes(Signal::kTorque, false).in_motion});
  }
  std::vector<statistics::Interval> scales;
  if (slopes.empty()) return scales;
  const std::vector<bool> off = contradicting(slopes);
  for (std::size_t j = 0; j < slopes.front().slopes.size(); ++j) {
    const JointConstant inverse = constant_of(slopes, off, j, From::kMotion);
    scales.push_back(inverse.known() ? statistics::reciprocal(inverse.constant) : statistics::Interval{});
  }
  return scales;
}

std::vector<double> read_torque_constants(const std::string& path) {
  const host::Json json = host::parse_json(host::read_file(path, "torque constants"), path);
  const host::JsonValue joints = host::JsonValue(json, path, "").at("joints", "a list, one entry a joint");
  std::vector<double> values;
  for (std::size_t j = 0; j < joints.array_size("a list, one entry a joint"); ++j) {
    values.push_back(joints.at(j).at("value", "a torque constant [N·m/A] or null").number(true));
  }
  return values;
}

}  // namespace heft::drive
