// The check of a stream: which rows it looks at, and when.
#include <algorithm>
#include <cstddef>
#include <future>
#include <limits>
#include <utility>

#include "heft/data/log_checks.hpp"
#include "heft/data/log_set.hpp"
#include "heft/plausibility/plausibility.hpp"

namespace heft::plausibility {
namespace {

using Eigen::Index;

/// Time in motion before the first check, doubled from check to check, and before the last one [s].
constexpr double kFirst = 4.0, kLast = 64.0;
/// Time in motion from which on the size of one joint's torque says something; at 6 s one of 49 sound measured logs was suspected [s].
constexpr double kSizeCounts = 8.0;
/// A check is over by then, however slow the machine: it takes a tenth of a second [s].
constexpr double kPatience = 1.0;
/// A joint moves that is faster than this between two looks so far apart: encoder steps and noise are slower [rad/s, m/s; s].
constexpr double kMoves = 0.05, kBetweenLooks = 0.05;
/// Rows are kept for so long after the last motion: where a joint stops, its torque settles [s].
constexpr double kAfterMotion = 1.0;
/// Rows kept a second, at most: all is looked at behind a low-pass of 5 Hz [Hz].
constexpr double kMostRate = 500.0;
/// The clock was set: time goes on behind a gap [s].
constexpr double kBreak = 1.0;
/// Fewer are no motion to judge by.
constexpr std::size_t kLeastRows = 50;

data::Log log_of(const std::vector<data::LiveRow>& rows, const std::string& name) {
  data::Log log;
  log.path = name;
  const auto samples = static_cast<Index>(rows.size());
  const data::LiveRow& first = rows.front();
  log.time.resize(samples);
  log.q.resize(samples, first.q.size());
  log.qd.resize(samples, first.qd.size());
  log.tau.resize(samples, first.tau.size());
  for (Index k = 0; k < samples; ++k) {
    const data::LiveRow& row = rows[static_cast<std::size_t>(k)];
    log.time[k] = row.time;
    log.q.row(k) = row.q;
    log.qd.row(k) = row.qd;
    log.tau.row(k) = row.tau;
  }
  return log;
}

/// Needs more than a few seconds, see kSizeCounts.
bool is_of_size(const Finding& finding) {
  return finding.kind == Contradiction::kNoSignal ||
         (finding.kind == Contradiction::kScale && finding.joint >= 0);
}

}  // namespace

struct LiveCheck::Impl {
  Impl(const model::Robot& arm, std::string stream, const Options& how)
      : robot(arm), name(std::move(stream)), options(how), clock(name) {}

  void keep(const data::LiveRow& row) {
    time += clock.anew() ? kBreak : clock.step();
    if (clock.anew()) {
      looked = time;
      position = row.q;
    } else if (time - looked >= kBetweenLooks) {
      const double since = time - std::exchange(looked, time);
      const bool moves = (row.q - position).cwiseAbs().maxCoeff() > kMoves * since;
      position = row.q;
      if (moves) {
        moved += std::min(since, kBreak);
        motion = time;
      }
    }
    const bool dense = !rows.empty() && time - rows.back().time < 0.999 / kMostRate;
    if (dense || time - motion > kAfterMotion) return;
    rows.push_back(row);
    rows.back().time = time;
  }

  TorqueCheck check(double seconds) const {
    const data::Log log = log_of(rows, name);
    data::refuse_errors(data::check_log(log, data::limits_of(robot.joint_specs())));
    TorqueCheck found = check_torque(robot, log, options);
    for (Finding& finding : found.findings)
      finding.clear = finding.clear && (seconds >= kSizeCounts || !is_of_size(finding));
    return found;
  }

  void start() {
    // A copy of the rows, because more of them come while it runs.
    running = std::async(std::launch::async, [part = std::make_unique<Impl>(*this, rows), seconds = moved] {
      return part->check(seconds);
    });
    due = time + kPatience;
    next *= 2.0;
  }

  /// Of the check that runs.
  std::optional<TorqueCheck> finish() {
    TorqueCheck found = running.get();
    if (!found.refused() && next <= kLast) return std::nullopt;
    return close(std::move(found));
  }

  TorqueCheck close(TorqueCheck found) {
    over = true;
    rows.clear();
    return found;
  }

  /// What a check needs of another.
  Impl(const Impl& other, std::vector<data::LiveRow> part)
      : robot(other.robot), name(other.name), options(other.options), rows(std::move(part)) {}

  model::Robot robot;
  std::string name;
  Options options;
  data::LiveClock clock;
  std::vector<data::LiveRow> rows;                          ///< by this clock
  Eigen::VectorXd position;                                 ///< when it was looked at
  double time{0.0}, looked{0.0};                            ///< since the first row [s]
  double motion{-std::numeric_limits<double>::infinity()};  ///< last seen [s]
  double moved{0.0};                                        ///< time in motion [s]
  double next{kFirst};                                      ///< time in motion of the next check [s]
  double due{0.0};                                          ///< when the one that runs is asked [s]
  std::future<TorqueCheck> running;
  bool over{false};
};

LiveCheck::LiveCheck(const model::Robot& robot, std::string name, const Options& options)
    : impl_(std::make_unique<Impl>(robot, std::move(name), options)) {}
LiveCheck::~LiveCheck() = default;

std::optional<TorqueCheck> LiveCheck::push(const data::LiveRow& row) {
  Impl& my = *impl_;
  if (my.over) return std::nullopt;
  static_cast<void>(my.clock.push(row));
  my.keep(row);
  if (my.running.valid()) return my.time >= my.due ? my.finish() : std::nullopt;
  if (my.moved >= my.next && my.rows.size() >= kLeastRows) my.start();
  return std::nullopt;
}

std::optional<TorqueCheck> LiveCheck::end() {
  Impl& my = *impl_;
  if (my.over) return std::nullopt;
  if (my.running.valid()) {
    if (std::optional<TorqueCheck> found = my.finish()) return found;
  }
  if (my.rows.size() < kLeastRows) return std::nullopt;
  return my.close(my.check(my.moved));
}

}  // namespace heft::plausibility
