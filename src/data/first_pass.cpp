#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "cutoff.hpp"
#include "heft/host/error.hpp"
#include "motion_stream_impl.hpp"
#include "refuse_unsound.hpp"
#include "resample.hpp"

namespace heft::data {

using Eigen::Index;

namespace {

/// Gaps kept in the summary.
constexpr std::size_t kMostGaps = 100;
/// Joints that travel less rest [rad, m]; also those with less than a hundredth of the largest travel.
constexpr double kRestingTravel = 1e-2;

}  // namespace

/// The facts of a log in memory; of a file they are known.
LogFacts MotionStream::Impl::facts_of_memory() {
  refuse_unsound(*memory);
  prepare_memory(true);
  summary.path = memory->path;
  MemorySource source(memory->time, memory_columns);
  LogFacts facts(summary.path, layout.q, layout.tau, logged);
  RowBuffer rows(layout.total());
  while (const Index count = source.read(kBlockRows, rows)) {
    const auto group = [&](Index from, Index columns) {
      return rows.values.block(rows.begin, from, count, columns);
    };
    const Index n = layout.q;
    facts.add(rows.time.segment(rows.begin, count), group(0, n), group(n, layout.tau),
              group(n + layout.tau, layout.qd), group(n + layout.tau + layout.qd, layout.qdd));
    rows.clear();
  }
  return facts;
}

void MotionStream::Impl::first_pass() {
  if (memory) {
    own_facts = std::make_unique<LogFacts>(facts_of_memory());
  } else {
    summary.path = kept->path();
    prepare_file(kept->file(), true);
  }
  const LogFacts& known = facts();
  const Index n = layout.q;
  summary.num_joints = static_cast<int>(n);
  summary.velocity_logged = summary.acceleration_logged = logged;
  std::vector<MovingSpan> spans(static_cast<std::size_t>(n));
  if (logged) spans = known.spans;
  distrust_logged_rates(spans);
  if (memory) {
    prepare_memory(false);
  } else {
    prepare_file(kept->file(), false);
    std::vector<std::size_t> used;
    for (const FileColumn& column : file_columns) used.push_back(column.column);
    if (std::string note = kept->file().note(used); !note.empty()) summary.notes.push_back(std::move(note));
  }
  summary.temperature_logged = layout.temperature == layout.q && layout.q > 0;
  position_noise = known.noise.value();
  summary.samples = known.clock.samples();
  summary.begin = known.clock.begin();
  summary.end = known.clock.end();
  if (summary.samples < kLeastSamples) refuse_short_log(summary.path, summary.samples);
  summary.travel = known.ranges.travel();
  summary.max_torque = known.ranges.max_torque();

  fit_grid();
  find_cutoff(known.ranges.mean(summary.samples));
  if (!logged) find_speeds(spans);
  find_standstill(spans);
}

/// A recorded rate that contradicts the positions would be worse than a derived one.
void MotionStream::Impl::distrust_logged_rates(std::vector<MovingSpan>& spans) {
  const std::string reason = logged ? facts().check.unusable_rate() : std::string();
  if (reason.empty()) return;
  options.prefer_logged = logged = false;
  summary.velocity_logged = summary.acceleration_logged = false;
  spans.assign(spans.size(), MovingSpan());
  summary.notes.push_back(fmt::format("{}: {}; velocity and acceleration are derived from position instead",
                                      summary.path, reason));
}

/// The even grid: the log's own rows where its clock is even.
void MotionStream::Impl::fit_grid() {
  LogGrid grid;
  bool known = false;
  if (kept) {
    kept->with_motion([&](KeptLog::Motion& motion) {
      known = motion.grid.has_value();
      if (known) grid = *motion.grid;
    });
  }
  if (!known) {
    grid = grid_of_log();
    if (kept) kept->with_motion([&](KeptLog::Motion& motion) { motion.grid = grid; });
  }
  summary.resampled = grid.resampled;
  summary.sample_rate = grid.sample_rate;
  summary.gaps = grid.gaps;
  grid_count = grid.rows;
  longest = grid.longest;
}

LogGrid MotionStream::Impl::grid_of_log() const {
  const SampleClock& clock = facts().clock;
  const auto each_time = [this](const auto& use) {
    const OpenSource pass = open(Wanted::kTime);
    for_each_time(*pass.source, use);
  };
  const double median = median_of_steps(clock.median, each_time);
  const double length = summary.end - summary.begin;
  LogGrid grid;
  grid.resampled = !clock.is_even();
  grid.rows = grid.resampled ? grid_rows(length, 1.0 / median) : static_cast<Index>(summary.samples);
  grid.sample_rate = static_cast<double>(grid.rows - 1) / length;
  grid.longest = kGapFactor * median;
  if (clock.longest_period() > grid.longest) grid.gaps = gaps_of_log(grid.longest);
  return grid;
}

std::vector<TimeGap> MotionStream::Impl::gaps_of_log(double longest_step) const {
  std::vector<TimeGap> gaps;
  const OpenSource pass = open(Wanted::kTime);
  double last = summary.begin;
  for_each_time(*pass.source, [&](double time) {
    if (time - last > longest_step && gaps.size() < kMostGaps) gaps.push_back({last, time});
    last = time;
  });
  return gaps;
}

/// @param mean  of each position over the log
void MotionStream::Impl::find_cutoff(const Eigen::RowVectorXd& mean) {
  if (options.motion.cutoff == 0.0) {
    summary.cutoff_chosen = true;
    std::optional<double> known;
    if (kept) kept->with_motion([&](const KeptLog::Motion& motion) { known = motion.bandwidth; });
    summary.bandwidth = known ? *known : bandwidth_of_log(mean);
    if (kept) kept->with_motion([&](KeptLog::Motion& motion) { motion.bandwidth = summary.bandwidth; });
  }
  summary.cutoff = choose_cutoff(summary.path, options.motion, summary.bandwidth, summary.sample_rate);
}

double MotionStream::Impl::bandwidth_of_log(const Eigen::RowVectorXd& mean) const {
  BandwidthEstimate bandwidth(grid_count, mean, summary.sample_rate);
  Walk windows(*this, Wanted::kPosition, kBlockRows * 4, 0);
  for (Window window; windows.next(window);)
    of_positions(window, [&](const Eigen::Ref<const Eigen::MatrixXd>& q) { bandwidth.add(q); });
  return bandwidth.value();
}

namespace {

bool same_derivative(const MotionOptions& a, const MotionOptions& b) {
  return a.stencil == b.stencil && a.method == b.method && a.polynomial_order == b.polynomial_order;
}

}  // namespace

/// Speeds of a motion that has to be derived.
void MotionStream::Impl::find_speeds(std::vector<MovingSpan>& spans) const {
  bool known = false;
  if (kept) {
    kept->with_motion([&](const KeptLog::Motion& motion) {
      for (const KeptLog::Motion::Speeds& speeds : motion.speeds) {
        if (speeds.cutoff != summary.cutoff || !same_derivative(speeds.options, options.motion)) continue;
        spans = speeds.spans;
        known = true;
      }
    });
  }
  if (known) return;
  derive_speeds(spans);
  if (!kept) return;
  kept->with_motion([&](KeptLog::Motion& motion) {
    motion.speeds.push_back({options.motion, summary.cutoff, spans});
  });
}

void MotionStream::Impl::derive_speeds(std::vector<MovingSpan>& spans) const {
  const Index margin = settling_rows(summary.sample_rate, summary.cutoff, options.motion);
  using Spans = std::vector<MovingSpan>;
  walk<Spans>(
      Wanted::kPosition, std::max(options.chunk_samples, 2 * margin), margin,
      [&](const Window& window) {
        const Eigen::MatrixXd qd = of_positions(window, [&](const Eigen::Ref<const Eigen::MatrixXd>& q) {
          return velocity_on_grid(window.grid, q, summary.sample_rate, summary.cutoff, options.motion);
        });
        const Eigen::Array<bool, Eigen::Dynamic, 1> clear = outside_gaps(window);
        Spans piece(spans.size());
        for (Index joint = 0; joint < layout.q; ++joint) {
          MovingSpan& span = piece[static_cast<std::size_t>(joint)];
          for (Index k = window.first - window.lo; k < window.first - window.lo + window.count; ++k) {
            if (clear[k]) span.add(window.grid[k], std::abs(qd(k, joint)));
          }
        }
        return piece;
      },
      [&](const Spans& piece) {
        for (std::size_t joint = 0; joint < spans.size(); ++joint) spans[joint].add(piece[joint]);
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
