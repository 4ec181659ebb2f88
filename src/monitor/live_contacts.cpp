#include <optional>
#include <utility>

#include <fmt/format.h>

#include "causal_sample.hpp"
#include "heft/model/at_sensor.hpp"
#include "heft/monitor/monitor.hpp"

namespace heft::monitor {

struct LiveContacts::Impl {
  /// What remembers the rows before.
  struct Core {
    Core(const model::Robot& robot, const Thresholds& thresholds, double period, double begin)
        : filter(robot), friction(robot, begin), monitor(robot, thresholds, period) {}
    SampleFilter filter;
    SampleFriction friction;
    SampleMonitor monitor;
    std::optional<double> last, last_taken;  ///< times of samples [s]
  };

  Impl(const model::ModelFile& file, const model::Robot& given, const Thresholds& limits)
      : robot(model::as_measured(given, limits.at() == data::TorqueAt::kJoint,
                                 file.fit ? &*file.fit : nullptr, &notes)),
        thresholds(limits) {
    check_joints(thresholds, robot);
    notes.insert(notes.end(), limits.judgement.reasons.begin(), limits.judgement.reasons.end());
  }

  void go_through(const std::vector<data::LiveRow>& rows, std::vector<LiveContact>& events) {
    if (rows.empty()) return;
    if (!core) core.emplace(robot, thresholds, clock.period(), rows.front().time);
    for (const data::LiveRow& row : rows) take(row, events);
  }

  void take(const data::LiveRow& row, std::vector<LiveContact>& events) {
    Eigen::VectorXd q = row.q, qd = row.qd, tau = row.tau;
    const double step = core->last ? row.time - *core->last : 0.0;
    if (qd.size() != q.size()) core->filter.update(q, qd, tau, step);
    const Eigen::VectorXd time = Eigen::VectorXd::Constant(1, row.time);
    const Eigen::VectorXd friction = core->friction.rows(time, q.transpose(), qd.transpose()).row(0);
    const double period = core->last_taken ? row.time - *core->last_taken : 0.0;
    SampleRecord record;
    const Status status = core->monitor.update(q, qd, tau, friction, period, record);
    core->last = row.time;
    summary.seconds += step;
    if (status != Status::kOk) {
      ++summary.refused;
      return;
    }
    core->last_taken = row.time;
    ++summary.samples;
    if (record.judged) summary.judged_seconds += step;
    follow(row.time, record, events);
  }

  void follow(double time, const SampleRecord& record, std::vector<LiveContact>& events) {
    if (record.event == ContactEvent::kContact) {
      open.emplace(time, record.deviation, record.threshold);
      const Contact begun = open->contact();
      threshold = record.threshold[begun.joint];
      events.push_back({false, begun, threshold});
      return;
    }
    if (!open) return;
    open->add(time, record.deviation, record.threshold);
    if (record.event == ContactEvent::kNone) return;
    Contact ended = open->contact();
    ended.load_change = record.event == ContactEvent::kLoadChange;
    ended.load = record.load;
    close(std::move(ended), events);
  }

  void close(Contact ended, std::vector<LiveContact>& events) {
    open.reset();
    summary.contacts.push_back(ended);
    events.push_back({true, std::move(ended), threshold});
  }

  std::vector<std::string> notes;
  model::Robot robot;
  Thresholds thresholds;
  data::LiveClock clock;
  std::optional<Core> core;
  std::optional<OpenContact> open;
  double threshold{0.0};
  LiveSummary summary;
};

LiveContacts::LiveContacts(const model::ModelFile& file, const model::Robot& robot,
                           const Thresholds& thresholds)
    : impl_(std::make_unique<Impl>(file, robot, thresholds)) {}
LiveContacts::~LiveContacts() = default;

std::vector<LiveContact> LiveContacts::push(const data::LiveRow& row) {
  std::vector<LiveContact> events;
  const std::vector<data::LiveRow>& rows = impl_->clock.push(row);
  if (impl_->clock.anew()) {
    if (impl_->open) impl_->close(impl_->open->contact(), events);
    impl_->core.reset();
  }
  impl_->go_through(rows, events);
  return events;
}

LiveSummary LiveContacts::end(long refused) {
  std::vector<LiveContact> events;
  impl_->go_through(impl_->clock.end(), events);
  if (impl_->open) impl_->close(impl_->open->contact(), events);
  LiveSummary summary = impl_->summary;
  summary.refused += refused;
  if (!(summary.judged_seconds > 0.0)) {
    summary.unanswered = fmt::format(
        "nothing could be judged: {} samples taken, {} refused; filters take some tenths of a second of rows to settle; give more "
        "rows, as the log of a recording has them",
        summary.samples, summary.refused);
  }
  return summary;
}

const std::vector<std::string>& LiveContacts::notes() const { return impl_->notes; }

}  // namespace heft::monitor
