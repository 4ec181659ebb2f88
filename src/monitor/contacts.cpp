#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "causal_run.hpp"
#include "heft/core/monitor/contact_monitor.hpp"
#include "heft/host/error.hpp"
#include "heft/model/at_sensor.hpp"
#include "heft/monitor/monitor.hpp"
#include "heft/statistics/interval.hpp"
#include "heft/statistics/median.hpp"
#include "push_delay.hpp"

namespace heft::monitor {
namespace {

using Eigen::Index;

/// A model whose deviation exceeds its thresholds for longer than that part of a log does not hold there.
constexpr double kMostContact = 0.5;

Contact contact_of(const Run& run, const Signals& signals, Index from, Index to) {
  OpenContact open(signals.time[from], run.deviation.row(from), run.threshold.row(from));
  for (Index k = from + 1; k <= to; ++k)
    open.add(signals.time[k], run.deviation.row(k), run.threshold.row(k));
  return open.contact();
}

std::vector<Contact> contacts_of(const Run& run, const Signals& signals) {
  std::vector<Contact> contacts;
  Index from = -1;
  for (const Event& event : run.events) {
    const auto kind = static_cast<ContactEvent>(event.kind);
    if (kind == ContactEvent::kContact) {
      from = event.row;
      continue;
    }
    contacts.push_back(contact_of(run, signals, from, event.row));
    contacts.back().load_change = kind == ContactEvent::kLoadChange;
    contacts.back().load = event.load;
    from = -1;
  }
  if (from >= 0) contacts.push_back(contact_of(run, signals, from, signals.time.size() - 1));
  return contacts;
}

Eigen::VectorXd median_of(const Eigen::MatrixXd& threshold, const Run& run) {
  Eigen::VectorXd medians(threshold.cols());
  for (Index j = 0; j < medians.size(); ++j) {
    std::vector<double> values;
    for (Index k = 0; k < threshold.rows(); ++k) {
      if (run.judged[static_cast<std::size_t>(k)] != 0) values.push_back(threshold(k, j));
    }
    medians[j] = statistics::median(std::move(values));
  }
  return medians;
}

/// Seconds of the samples whose flag is set.
double seconds_of(const std::vector<char>& flags, const Eigen::VectorXd& time) {
  double seconds = 0.0;
  for (Index k = 1; k < time.size(); ++k) {
    if (flags[static_cast<std::size_t>(k)] != 0) seconds += time[k] - time[k - 1];
  }
  return seconds;
}

void judge(const Run& run, const Signals& signals, const Options& options, Contacts& result) {
  using host::Verdict;
  result.judgement.add(result.thresholds.judgement);
  // Thresholds learnt in the same run hold the doubts about its logs already.
  const std::vector<std::string>& known = result.judgement.reasons;
  const auto is_known = [&](const std::string& reason) {
    return std::find(known.begin(), known.end(), reason) != known.end();
  };
  if (!std::all_of(options.torque.reasons.begin(), options.torque.reasons.end(), is_known)) {
    result.judgement.add(options.torque);
  }
  if (!(result.judged_seconds > 0)) {
    result.judgement.add(Verdict::kBad, "the log is too short: the filters did not settle");
    return;
  }
  const double touched = seconds_of(run.contact, signals.time) / result.judged_seconds;
  if (touched > kMostContact) {
    result.judgement.add(
        Verdict::kBad,
        fmt::format("the thresholds are exceeded during {:.0f} % of the log: the model does not hold for "
                    "it, or the arm carries another load from the start",
                    100.0 * touched));
  }
  if (options.known_free && result.false_alarms.lower > result.thresholds.asked_rate) {
    result.judgement.add(
        Verdict::kBad,
        fmt::format("{} false alarms in {:.3g} s where nothing touched the arm: learn the thresholds from "
                    "logs of this motion as well",
                    result.contacts.size(), result.judged_seconds));
  }
}

Contacts monitor_log(const model::ModelFile& file, const model::Robot& robot, const data::LogSource& source,
                     const Thresholds& thresholds, const Options& options) {
  Contacts result;
  const model::FitRecord* fit = file.fit ? &*file.fit : nullptr;
  const model::Robot measured =
      model::as_measured(robot, thresholds.at() == data::TorqueAt::kJoint, fit, &result.notes);
  const data::Log log = data::read(source, &result.notes);
  const Signals signals = signals_of(measured, log);
  const Run run = run_core(measured, signals, thresholds);
  result.robot = robot.name;
  result.model = file.path;
  result.log = source.path;
  result.log_seconds = signals.time[signals.time.size() - 1] - signals.time[0];
  result.log_rate = static_cast<double>(signals.time.size() - 1) / result.log_seconds;
  result.thresholds = thresholds;
  result.judged_seconds = seconds_of(run.judged, signals.time);
  result.contacts = contacts_of(run, signals);
  result.threshold = median_of(run.level_threshold, run);
  result.change_threshold = median_of(run.change_threshold, run);
  result.delay.resize(result.threshold.size());
  for (Index j = 0; j < result.delay.size(); ++j) {
    result.delay[j] = push_delay(thresholds, result.threshold[j], result.change_threshold[j]);
  }
  result.known_free = options.known_free;
  result.false_alarms = thresholds.expected;
  if (options.known_free && result.judged_seconds > 0) {
    const double hours = result.judged_seconds / 3600.0;
    const auto count = static_cast<long>(result.contacts.size());
    const statistics::Interval interval = statistics::count_interval(count);
    result.false_alarms = {interval.value / hours, interval.std / hours, interval.lower / hours,
                           interval.upper / hours};
  }
  if (signals.velocity_derived)
    result.notes.push_back(fmt::format(
        "{}: no velocities; derived from the positions by a causal low-pass, 16 ms late", source.path));
  if (run.refused > 0)
    result.notes.push_back(fmt::format("{}: {} samples were refused", source.path, run.refused));
  if (options.traces)
    result.trace = {signals.time, run.residual, run.level_threshold, run.change, run.change_threshold};
  judge(run, signals, options, result);
  return result;
}

}  // namespace

std::vector<Contacts> monitor(const model::ModelFile& file, const model::Robot& robot,
                              const data::LogSet& logs, const Thresholds& thresholds,
                              const Options& options) {
  check_joints(thresholds, robot);
  if (logs.torque_at() != thresholds.at()) {
    throw ModelError(fmt::format(
        "thresholds of contacts: found thresholds of torque at the {}; expected the {}, where the logs have theirs; learn them from "
        "such logs, or say where the torque was measured (--torque-at)",
        data::to_string(thresholds.at()), data::to_string(logs.torque_at())));
  }
  std::vector<std::string> notes;
  data::refuse_seen(logs, file.provenance.logs, &notes);
  data::refuse_seen(logs, thresholds.logs, &notes, "the thresholds were learnt from");
  std::vector<Contacts> all;
  for (const data::LogSource& log : logs.judge()) {
    if (options.progress)
      options.progress("monitoring",
                       static_cast<double>(all.size()) / static_cast<double>(logs.judge().size()));
    all.push_back(monitor_log(file, robot, log, thresholds, options));
  }
  if (!all.empty()) all.front().notes.insert(all.front().notes.begin(), notes.begin(), notes.end());
  return all;
}

}  // namespace heft::monitor
