#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "heft/data/log_checks.hpp"
#include "log_check_impl.hpp"

namespace heft::data {
namespace {

/// Faster than this many times its velocity limit no joint goes from row to row.
constexpr double kBeyondLimit = 1.5;
/// A jump this large that is faster than any motion makes whatever is derived from it wrong [rad, m].
constexpr double kLargeJump = 0.1;
/// A joint that is faster than this part of what no joint can be has its positions in another unit.
constexpr double kMeanOfTop = 0.1;

/// Stretches of one torque: those at an extreme of the column, and others.
struct Held {
  std::vector<HeldTorque::Stretch> cut, repeated;
};

Held sorted(const HeldTorque& torque, double most, double least) {
  Held held;
  for (const HeldTorque::Stretch& stretch : torque.stretches())
    (stretch.torque == most || stretch.torque == least ? held.cut : held.repeated).push_back(stretch);
  // One stretch at the extreme may be a value repeated; a limit is met again.
  if (held.cut.size() < 2) {
    held.repeated.insert(held.repeated.end(), held.cut.begin(), held.cut.end());
    held.cut.clear();
  }
  return held;
}

const HeldTorque::Stretch& longest(const std::vector<HeldTorque::Stretch>& stretches) {
  return *std::max_element(stretches.begin(), stretches.end(), [](const auto& a, const auto& b) {
    return a.end - a.begin < b.end - b.begin;
  });
}

double percent_of(const std::vector<HeldTorque::Stretch>& stretches, long rows) {
  long all = 0;
  for (const HeldTorque::Stretch& stretch : stretches) all += stretch.rows;
  return 100.0 * static_cast<double>(all) / static_cast<double>(rows);
}

/// "; likewise q2 and q5" of joints after the first.
std::string likewise(std::string_view prefix, const std::vector<int>& joints) {
  const std::vector<int> others(joints.begin() + 1, joints.end());
  return others.empty() ? "" : fmt::format("; likewise {}", columns_of(prefix, others));
}

}  // namespace

/// Positions that jump. @return whether that is an error, which looks like another unit
bool LogCheck::Impl::find_jumps(const JointLimits& limits, std::vector<LogFinding>& found) const {
  std::vector<int> joints;
  std::string first;
  bool is_error = false;
  for (int joint = 0; joint < n; ++joint) {
    const auto j = static_cast<std::size_t>(joint);
    const double limit = velocity_limit(limits, joint), top = top_speed(limits, joint);
    const double possible = std::min(kBeyondLimit * limit, top);
    // In another unit, rows that are lost look like jumps.
    if (positions[j].mean_speed() > kMeanOfTop * top) return false;
    std::vector<PositionJumps::Jump> all = positions[j].jumps(least_step[joint]);
    std::erase_if(all, [&](const PositionJumps::Jump& jump) { return std::abs(jump.step) < possible * jump.period; });
    if (all.empty()) continue;
    joints.push_back(joint);
    is_error = is_error || velocity[j].top_rate > top || std::any_of(all.begin(), all.end(), [&](const PositionJumps::Jump& jump) {
                 return std::abs(jump.step) > std::max(kLargeJump, top * jump.period);
               });
    if (joints.size() > 1) continue;
    const PositionJumps::Jump& jump = all.front();
    const char* unit = is_revolute(limits, joint) ? "rad" : "m";
    first = fmt::format("{}: column 'q{}': q{} jumps by {:.3g} {} from one row to the next at {:.6g} s{}, {:.3g} {}/s{}{}", path,
                        joint + 1, joint + 1, jump.step, unit, jump.time,
                        jump.stood > 3.0 * jump.period ? fmt::format(" after {:.3g} s at one value", jump.stood) : "",
                        std::abs(jump.step) / jump.period, unit,
                        std::isfinite(limit) ? fmt::format(" where {:.3g} is the limit", limit) : "",
                        all.size() > 1 ? fmt::format(" ({} such jumps until {:.6g} s)", all.size(), all.back().time) : "");
  }
  if (joints.empty()) return false;
  found.push_back({is_error ? Severity::kError : Severity::kNote,
                   fmt::format("{}{}: rows lost or repeated, or a fault of the encoder; expected positions that a joint can "
                               "reach in that time; remove the wrong rows (a gap in time is understood)",
                               first, likewise("q", joints))});
  return is_error;
}

/// Torques that stay at one value while their joint moves.
void LogCheck::Impl::find_held_torque(const JointLimits& limits, std::vector<LogFinding>& found) const {
  std::vector<int> joints;
  std::string first;
  for (int joint = 0; joint < n; ++joint) {
    const HeldTorque& torque = torques[static_cast<std::size_t>(joint)];
    const Held held = sorted(torque, most_torque[joint], least_torque[joint]);
    if (!held.cut.empty()) {
      const HeldTorque::Stretch& stretch = longest(held.cut);
      found.push_back(
          {Severity::kNote,
           fmt::format("{}: column 'tau{}': tau{} is cut at {:.4g}: {} stretches of up to {:.3g} s ({:.3g} % of the log) have "
                       "exactly its {} value while q{} moves; expected the whole torque; a limit of the drive is true torque, one of "
                       "the sensor or of the logger is not: remove these rows then (a gap in time is understood)",
                       path, joint + 1, joint + 1, stretch.torque, held.cut.size(), stretch.end - stretch.begin,
                       percent_of(held.cut, torque.rows()), stretch.torque == most_torque[joint] ? "largest" : "least",
                       joint + 1)});
    }
    if (held.repeated.empty()) continue;
    joints.push_back(joint);
    if (joints.size() > 1) continue;
    const HeldTorque::Stretch& stretch = longest(held.repeated);
    first = fmt::format("{}: column 'tau{}': tau{} stays at exactly {:.4g} from {:.6g} to {:.6g} s, while q{} moves by {:.3g} {} "
                        "({:.3g} % of the log in {} such stretch{})",
                        path, joint + 1, joint + 1, stretch.torque, stretch.begin, stretch.end, joint + 1, stretch.travel,
                        is_revolute(limits, joint) ? "rad" : "m",
                        percent_of(held.repeated, torque.rows()), held.repeated.size(), held.repeated.size() > 1 ? "es" : "");
  }
  if (joints.empty()) return;
  found.push_back({Severity::kNote,
                   fmt::format("{}{}; expected a new value with every row, unless it was commanded so; where the last value was "
                               "repeated, remove the rows (a gap in time is understood)",
                               first, likewise("tau", joints))});
}

/// Torques of single rows that cannot be right.
void LogCheck::Impl::find_torque_spikes(std::vector<LogFinding>& found) const {
  std::vector<int> joints;
  std::string first;
  for (int joint = 0; joint < n; ++joint) {
    const std::vector<TorqueSpikes::Spike> all = torque_spikes[static_cast<std::size_t>(joint)].spikes();
    if (all.empty()) continue;
    joints.push_back(joint);
    if (joints.size() > 1) continue;
    first = fmt::format("{}: column 'tau{}': tau{} is {:.4g} in one row at {:.6g} s{}, more than three times the largest of any "
                        "two rows in succession",
                        path, joint + 1, joint + 1, all.front().torque, all.front().time,
                        all.size() > 1 ? fmt::format(" ({} such rows until {:.6g} s)", all.size(), all.back().time) : "");
  }
  if (joints.empty()) return;
  found.push_back({Severity::kNote,
                   fmt::format("{}{}: a fault of the transmission; expected torque as measured; remove these rows", first,
                               likewise("tau", joints))});
}

/// Stamps of whoever wrote the log, who was interrupted.
void LogCheck::Impl::find_late_stamps(std::vector<LogFinding>& found) const {
  constexpr long kFewest = 3;
  constexpr double kShare = 1e-3;
  const long late = late_stamps.count();
  if (late < kFewest || static_cast<double>(late) < kShare * static_cast<double>(rows)) return;
  found.push_back({Severity::kNote,
                   fmt::format("{}: column 'time': {} stamps come late by more than half a step and are followed by a short one (the first at "
                               "{:.6g} s), as those of a program that was interrupted; expected the time of the sample: if it is not, velocities and "
                               "accelerations derived from positions are wrong there unless these show when samples were taken, which a "
                               "further note then says; log the controller's own time or the number of the sample",
                               path, late, late_stamps.first())});
}

}  // namespace heft::data
