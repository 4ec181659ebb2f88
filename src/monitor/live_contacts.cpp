#include <optional>
#include <utility>

#include "causal_sample.hpp"
#include "heft/host/numbers.hpp"
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
      : robot(
            model::as_measured(given, limits.torque_at == "joint", file.fit ? &*file.fit : nullptr, &notes)),
        thresholds(limits) {
    check_joints(thresholds, robot);
    notes.insert(notes.end(), limits.judgement.reasons.begin(), limits.judgement.reasons.end());
  }

  /// Goes through the rows that waited for the sample period.
  void start(std::vector<LiveContact>& events) {
    core.emplace(robot, thresholds, data::live_period(first), first.front().time);
    for (const data::LiveRow& row : first) take(row, events);
    first.clear();
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
  std::vector<data::LiveRow> first;  ///< rows that wait for the sample period
  std::optional<Core> core;
  std::optional<OpenContact> open;
  double threshold{0.0};
  double last{-kInfinity};  ///< time of the last row [s]
  LiveSummary summary;
};

LiveContacts::LiveContacts(const model::ModelFile& file, const model::Robot& robot,
                           const Thresholds& thresholds)
    : impl_(std::make_unique<Impl>(file, robot, thresholds)) {}
LiveContacts::~LiveContacts() = default;

std::vector<LiveContact> LiveContacts::push(const data::LiveRow& row) {
  std::vector<LiveContact> events;
  if (!(row.time > impl_->last)) {
    if (impl_->open) impl_->close(impl_->open->contact(), events);
    impl_->core.reset();
    impl_->first.clear();
  }
  impl_->last = row.time;
  if (impl_->core) {
    impl_->take(row, events);
  } else {
    impl_->first.push_back(row);
    if (impl_->first.size() == kFirstRows) impl_->start(events);
  }
  return events;
}

LiveSummary LiveContacts::end(long refused) {
  std::vector<LiveContact> events;
  if (impl_->first.size() > 1) impl_->start(events);
  if (impl_->open) impl_->close(impl_->open->contact(), events);
  LiveSummary summary = impl_->summary;
  summary.refused += refused;
  return summary;
}

const std::vector<std::string>& LiveContacts::notes() const { return impl_->notes; }

}  // namespace heft::monitor
