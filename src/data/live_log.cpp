#include "heft/data/live_log.hpp"

#include <cstddef>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "heft/core/run_clock.hpp"
#include "heft/host/error.hpp"
#include "heft/statistics/median.hpp"
#include "log_file.hpp"

namespace heft::data {

const std::vector<LiveRow>& LiveClock::push(const LiveRow& row) {
  anew_ = !started_ || !(row.time > last_ && row.time - last_ <= kLongestStep);
  step_ = anew_ ? 0.0 : row.time - last_;
  if (anew_) {
    first_.clear();
    period_ = 0.0;
  }
  started_ = true;
  last_ = row.time;
  if (period_ > 0.0) {
    out_.assign(1, row);
    return out_;
  }
  out_.clear();
  first_.push_back(row);
  return first_.size() < kFirstRows ? out_ : hand_out_first();
}

const std::vector<LiveRow>& LiveClock::end() {
  out_.clear();
  return first_.size() > 1 ? hand_out_first() : out_;
}

const std::vector<LiveRow>& LiveClock::hand_out_first() {
  constexpr double kLongest = 1.0;  // [s]
  std::vector<double> periods;
  for (std::size_t k = 1; k < first_.size(); ++k) periods.push_back(first_[k].time - first_[k - 1].time);
  const double period = statistics::median(std::move(periods));
  if (!(period <= kLongest)) {
    throw DataError(fmt::format(
        "{}column 'time': found a row every {:.4g} s, expected one every {:g} s at least; time in milliseconds is to "
        "be divided by 1000",
        name_.empty() ? "" : name_ + ": ", period, kLongest));
  }
  period_ = period;
  out_ = std::exchange(first_, {});
  return out_;
}

struct LiveLog::Impl {
  Impl(const std::string& where, const LogRequirements& needs, std::function<void(const std::string&)> notes)
      : path(where), tell(std::move(notes)), file(where, needs, Reading::kArriving), row(file.num_columns()) {
    time = file.find_column("time");
    q = columns_of("q");
    if (file.has_channel(&Log::qd)) qd = columns_of("qd");
    if (needs.torque) tau = columns_of(file.torque_from_current() ? "i" : "tau");
    std::vector<std::size_t> wanted = q;
    wanted.insert(wanted.end(), qd.begin(), qd.end());
    wanted.insert(wanted.end(), tau.begin(), tau.end());
    file.want_only(wanted);
    if (const std::string unused = file.unused_torque_constants(); !unused.empty()) tell(unused);
  }

  std::vector<std::size_t> columns_of(std::string_view prefix) const {
    std::vector<std::size_t> columns;
    for (int joint = 1; joint <= file.num_joints(); ++joint)
      columns.push_back(file.find_column(fmt::format("{}{}", prefix, joint)));
    return columns;
  }

  void fill(const std::vector<std::size_t>& columns, Eigen::VectorXd& to) const {
    to.resize(static_cast<Eigen::Index>(columns.size()));
    for (std::size_t k = 0; k < columns.size(); ++k) to[static_cast<Eigen::Index>(k)] = row[columns[k]];
  }

  /// With the first row: units may stand in a line of their own above it.
  void tell_how_read() {
    if (told) return;
    told = true;
    if (const std::string how = file.how_read(); !how.empty()) tell(how);
  }

  void refuse(const DataError& error) {
    ++refused;
    if (refused <= kMostNotes) tell(fmt::format("{}; the row is left out", error.what()));
    if (refused == kMostNotes) tell(fmt::format("{}: further rows that are left out are only counted", path));
  }

  std::string path;
  std::function<void(const std::string&)> tell;
  LogFile file;
  std::vector<double> row;
  std::size_t time{0};
  std::vector<std::size_t> q, qd, tau;
  long refused{0};
  bool told{false};
};

LiveLog::LiveLog(const std::string& path, const LogRequirements& needs,
                 std::function<void(const std::string&)> tell)
    : impl_(std::make_unique<Impl>(path, needs, std::move(tell))) {}
LiveLog::~LiveLog() = default;

bool LiveLog::next(LiveRow& row) {
  Impl& my = *impl_;
  for (;;) {
    const std::size_t line = my.file.line();
    try {
      if (!my.file.next(my.row.data())) break;
      my.tell_how_read();
    } catch (const DataError& error) {
      if (my.file.line() == line) throw;  // of the stream, not of a row
      my.refuse(error);
      continue;
    }
    row.time = my.row[my.time];
    my.fill(my.q, row.q);
    my.fill(my.qd, row.qd);
    my.fill(my.tau, row.tau);
    if (my.file.torque_from_current()) {
      for (int joint = 0; joint < my.file.num_joints(); ++joint)
        row.tau[joint] *= my.file.torque_constant(joint);
    }
    return true;
  }
  if (my.refused > kMostNotes) my.tell(fmt::format("{}: {} rows were left out", my.path, my.refused));
  return false;
}

long LiveLog::refused() const { return impl_->refused; }

}  // namespace heft::data
