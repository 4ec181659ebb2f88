#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "cutoff.hpp"
#include "displacement.hpp"
#include "heft/host/error.hpp"
#include "motion_stream_impl.hpp"
#include "refuse_unsound.hpp"
#include "resample.hpp"
#include "streaming_median.hpp"

namespace heft::data {

using Eigen::Index;

namespace {

/// Gaps kept in the summary.
constexpr std::size_t kMostGaps = 100;
/// Joints that travel less rest [rad, m]; also those with less than a hundredth of the largest travel.
constexpr double kRestingTravel = 1e-2;

/// Extremes and mean of the columns of a log.
class Ranges {
 public:
  Ranges(Index joints, Index torques)
      : low_(Eigen::RowVectorXd::Constant(joints, std::numeric_limits<double>::infinity())),
        high_(-low_),
        sum_(Eigen::RowVectorXd::Zero(joints)),
        torque_(Eigen::RowVectorXd::Zero(torques)) {}

  /// The next rows; `tau` may be without columns.
  void add(const Eigen::Ref<const Eigen::MatrixXd>& q, const Eigen::Ref<const Eigen::MatrixXd>& tau) {
    if (origin_.size() == 0) origin_ = q.row(0);
    low_ = low_.cwiseMin(q.colwise().minCoeff());
    high_ = high_.cwiseMax(q.colwise().maxCoeff());
    sum_ += (q.rowwise() - origin_).colwise().sum();
    if (tau.cols() > 0) torque_ = torque_.cwiseMax(tau.cwiseAbs().colwise().maxCoeff());
  }
  Eigen::VectorXd travel() const { return (high_ - low_).transpose(); }
  Eigen::VectorXd max_torque() const { return torque_.transpose(); }
  Eigen::RowVectorXd mean(long samples) const { return origin_ + sum_ / static_cast<double>(samples); }

 private:
  Eigen::RowVectorXd low_, high_, sum_, torque_;
  Eigen::RowVectorXd origin_;  ///< first row: a large constant must not leave rounding noise in the sum
};

}  // namespace

/// Time stamps of a log, in order: their median and longest period, and whether an even grid fits them.
class SampleClock {
 public:
  void add(double t) {
    if (samples_ == 0) {
      begin_ = t;
    } else {
      const double elapsed = t - begin_;
      const auto number = static_cast<double>(samples_);
      least_period_ = std::max(least_period_, elapsed / (number + 0.01));
      most_period_ = std::min(most_period_, elapsed / (number - 0.01));
      longest_period_ = std::max(longest_period_, t - last_time_);
      median.add(t - last_time_);
    }
    last_time_ = t;
    ++samples_;
  }
  long samples() const { return samples_; }
  double begin() const { return begin_; }
  double end() const { return last_time_; }
  double longest_period() const { return longest_period_; }
  /// Whether an even grid of this period fits.
  bool is_even(double period) const { return least_period_ <= period && period <= most_period_; }

  StreamingMedian median;  ///< of the periods

 private:
  long samples_{0};
  double begin_{0.0}, last_time_{0.0};
  double longest_period_{0.0};
  // The grid is the log's own when |t_k - t_0 - k p| <= p/100 for every k and p = (t_end - t_0)/(m-1), that
  // is when (t_k - t_0)/(k + 0.01) <= p <= (t_k - t_0)/(k - 0.01): bounds that need no second look at the
  // rows.
  double least_period_{0.0};
  double most_period_{std::numeric_limits<double>::infinity()};
};

/// The source of the first pass, with every column that is checked.
MotionStream::Impl::OpenSource MotionStream::Impl::open_first() {
  OpenSource pass;
  if (memory) {
    refuse_unsound(*memory);
    prepare_memory(true);
    summary.path = memory->path;
    pass.source = std::make_unique<MemorySource>(memory->time, memory_columns);
  } else {
    pass.file = std::make_unique<LogFile>(summary.path, needs);
    prepare_file(*pass.file, true);
    pass.source = std::make_unique<FileSource>(*pass.file, file_columns);
  }
  return pass;
}

void MotionStream::Impl::first_pass() {
  OpenSource pass = open_first();
  const Index n = layout.q;
  summary.num_joints = static_cast<int>(n);
  summary.velocity_logged = summary.acceleration_logged = logged;
  std::vector<MovingSpan> spans(static_cast<std::size_t>(n));
  log_check.emplace(summary.path, static_cast<int>(n));

  // Every row once: format, time stamps, ranges.
  SampleClock clock;
  Ranges ranges(n, layout.tau);
  PositionNoise noise(n);
  RowBuffer rows(layout.total());
  while (const Index count = pass.source->read(kBlockRows, rows)) {
    for (Index k = rows.begin; k < rows.end; ++k) clock.add(rows.time[k]);
    const auto group = [&](Index from, Index columns) {
      return rows.values.block(rows.begin, from, count, columns);
    };
    const auto q = group(0, n), tau = group(n, layout.tau), qd = group(n + layout.tau, layout.qd);
    ranges.add(q, tau);
    log_check->add(rows.time.segment(rows.begin, count), q, qd, group(n + layout.tau + layout.qd, layout.qdd),
                   tau);
    if (wants_displacement(layout.qd)) noise.add(q, qd);
    if (logged) {
      for (Index joint = 0; joint < n; ++joint) {
        MovingSpan& span = spans[static_cast<std::size_t>(joint)];
        for (Index k = 0; k < count; ++k) span.add(rows.time[rows.begin + k], std::abs(qd(k, joint)));
      }
    }
    rows.clear();
  }
  distrust_logged_rates(spans);
  if (pass.file) {
    pass.file->check_length();
    prepare_file(*pass.file, false);
    std::vector<std::size_t> used;
    for (const FileColumn& column : file_columns) used.push_back(column.column);
    if (std::string note = pass.file->note(used); !note.empty()) summary.notes.push_back(std::move(note));
  }
  if (memory) prepare_memory(false);
  position_noise = noise.value();
  summary.samples = clock.samples();
  summary.begin = clock.begin();
  summary.end = clock.end();
  if (summary.samples < kLeastSamples) refuse_short_log(summary.path, summary.samples);
  summary.travel = ranges.travel();
  summary.max_torque = ranges.max_torque();

  fit_grid(clock);
  find_cutoff(ranges.mean(summary.samples));
  if (!logged) find_speeds(spans);
  find_standstill(spans);
}

/// A recorded rate that contradicts the positions would be worse than a derived one.
void MotionStream::Impl::distrust_logged_rates(std::vector<MovingSpan>& spans) {
  const std::string reason = logged ? log_check->unusable_rate() : std::string();
  if (reason.empty()) return;
  options.prefer_logged = logged = false;
  summary.velocity_logged = summary.acceleration_logged = false;
  spans.assign(spans.size(), MovingSpan());
  summary.notes.push_back(fmt::format("{}: {}; velocity and acceleration are derived from position instead",
                                      summary.path, reason));
}

/// The even grid: the log's own rows where its clock is even.
void MotionStream::Impl::fit_grid(SampleClock& clock) {
  StreamingMedian& median = clock.median;
  while (!median.finish_pass()) {
    OpenSource again = open(Wanted::kTime);
    RowBuffer times(0);
    bool first = true;
    double last_time = 0.0;
    while (again.source->read(kBlockRows, times) > 0) {
      for (Index k = times.begin; k < times.end; ++k) {
        if (!first) median.add(times.time[k] - last_time);
        first = false;
        last_time = times.time[k];
      }
      times.clear();
    }
  }
  const double length = summary.end - summary.begin;
  const double even_period = length / static_cast<double>(summary.samples - 1);
  summary.resampled = !clock.is_even(even_period);
  grid_count =
      summary.resampled ? grid_rows(length, 1.0 / median.value()) : static_cast<Index>(summary.samples);
  summary.sample_rate = static_cast<double>(grid_count - 1) / length;
  longest = kGapFactor * median.value();
  if (clock.longest_period() > longest) find_gaps_of_log();
}

void MotionStream::Impl::find_gaps_of_log() {
  OpenSource pass = open(Wanted::kTime);
  RowBuffer rows(0);
  double last_time = summary.begin;
  while (pass.source->read(kBlockRows, rows) > 0) {
    for (Index k = rows.begin; k < rows.end; ++k) {
      if (rows.time[k] - last_time > longest) {
        if (summary.gaps.size() == kMostGaps) return;
        summary.gaps.push_back({last_time, rows.time[k]});
      }
      last_time = rows.time[k];
    }
    rows.clear();
  }
}

/// @param mean  of each position over the log
void MotionStream::Impl::find_cutoff(const Eigen::RowVectorXd& mean) {
  if (options.motion.cutoff == 0.0) {
    summary.cutoff_chosen = true;
    BandwidthEstimate bandwidth(grid_count, mean, summary.sample_rate);
    walk(Wanted::kPosition, kBlockRows * 4, 0,
         [&](const Window& window) { bandwidth.add(on_grid(window, 0, layout.q)); });
    summary.bandwidth = bandwidth.value();
  }
  summary.cutoff = choose_cutoff(summary.path, options.motion, summary.bandwidth, summary.sample_rate);
}

/// Speeds of a motion that has to be derived.
void MotionStream::Impl::find_speeds(std::vector<MovingSpan>& spans) const {
  const Index margin = settling_rows(summary.sample_rate, summary.cutoff, options.motion);
  walk(Wanted::kPosition, std::max(kBlockRows * 4, 2 * margin), margin, [&](const Window& window) {
    const DerivedMotion derived = motion(window);
    const auto clear = outside_gaps(window);
    for (Index joint = 0; joint < layout.q; ++joint) {
      const auto speed = derived.qd.col(joint).cwiseAbs();
      MovingSpan& span = spans[static_cast<std::size_t>(joint)];
      for (Index k = window.first - window.lo; k < window.first - window.lo + window.count; ++k) {
        if (clear[k]) span.add(window.grid[k], speed[k]);
      }
    }
  });
}

/// Top speeds, and from when to when a joint moves.
void MotionStream::Impl::find_standstill(const std::vector<MovingSpan>& spans) {
  const Index n = layout.q;
  summary.top_speed.resize(n);
  summary.moving_from = summary.end;
  summary.moving_to = summary.begin;
  const double least_travel = std::max(kRestingTravel, 0.01 * summary.travel.maxCoeff());
  for (Index joint = 0; joint < n; ++joint) {
    const MovingSpan& span = spans[static_cast<std::size_t>(joint)];
    summary.top_speed[joint] = span.top_speed();
    // Of a joint that rests, what is above 1 % of its top speed is noise.
    if (summary.travel[joint] < least_travel) continue;
    const double threshold =
        options.standstill_speed > 0.0 ? options.standstill_speed : 0.01 * span.top_speed();
    const double from = span.first_above(threshold);
    if (std::isnan(from)) continue;
    summary.moving_from = std::min(summary.moving_from, from);
    summary.moving_to = std::max(summary.moving_to, span.last_above(threshold));
  }
  if (summary.moving_from > summary.moving_to) {
    summary.moving_from = summary.begin;
    summary.moving_to = summary.end;
    summary.notes.push_back(
        fmt::format("{}: no joint moves more than {} rad or m; the whole log is treated as standstill",
                    summary.path, kRestingTravel));
  }
}

}  // namespace heft::data
