#include "heft/data/motion_stream.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "displacement.hpp"
#include "heft/host/error.hpp"
#include "motion_stream_impl.hpp"
#include "resample.hpp"

namespace heft::data {
namespace {

using Eigen::Index;

/// Knots after which a cubic spline has forgotten where it was cut: a knot takes at least half away
/// (0.27 of it on an even grid).
constexpr Index kSplineReach = 64;

}  // namespace

/// Pointers to the columns of a log in memory.
/// @param every_rate  qd and qdd also where they are not taken for the motion: the first pass checks them
void MotionStream::Impl::prepare_memory(bool every_rate) {
  const Log& log = *memory;
  memory_columns.clear();
  layout = Layout{};
  const Index n = log.q.cols();
  logged = options.prefer_logged && log.qd.cols() == n && log.qdd.cols() == n;
  const auto add = [&](const Eigen::MatrixXd& matrix) {
    for (Index c = 0; c < matrix.cols(); ++c) memory_columns.push_back(matrix.col(c).data());
    return matrix.cols();
  };
  layout.q = add(log.q);
  layout.tau = add(log.tau);
  if (logged || every_rate || options.displacement) layout.qd = add(log.qd);
  if (logged || every_rate) layout.qdd = add(log.qdd);
  for (const std::string& group : options.extra) {
    Index count = 0;
    for (const Channel& channel : kChannels) {
      if (channel.prefix == group) count = add(log.*channel.matrix);
    }
    if (count == 0) {
      for (; count < n; ++count) {
        const std::string name = fmt::format("{}{}", group, count + 1);
        const auto column = std::find_if(log.extra.begin(), log.extra.end(),
                                         [&](const auto& candidate) { return candidate.first == name; });
        if (column == log.extra.end()) break;
        memory_columns.push_back(column->second.data());
      }
    }
    layout.extra.push_back(count);
  }
}

/// Numbers of the columns of a log file. Extra columns only after the first pass, when it is known which of
/// them hold numbers.
void MotionStream::Impl::prepare_file(const LogFile& file, bool every_rate) {
  const int n = file.num_joints();
  logged = options.prefer_logged && file.has_channel(&Log::qd) && file.has_channel(&Log::qdd);
  file_columns.clear();
  layout = Layout{};
  const auto add = [&](std::string_view prefix, bool with_torque_constant = false) {
    for (int joint = 1; joint <= n; ++joint) {
      const std::size_t column = file.find_column(fmt::format("{}{}", prefix, joint));
      if (column == file.num_columns() || file.is_dropped(column)) return Index{joint - 1};
      file_columns.push_back({column, with_torque_constant ? file.torque_constant(joint - 1) : 1.0});
    }
    return Index{n};
  };
  layout.q = add("q");
  if (file.torque_from_current()) {
    layout.tau = add("i", true);
  } else if (file.has_channel(&Log::tau)) {
    layout.tau = add("tau");
  }
  if (logged || ((every_rate || options.displacement) && file.has_channel(&Log::qd))) layout.qd = add("qd");
  if (logged || (every_rate && file.has_channel(&Log::qdd))) layout.qdd = add("qdd");
  for (const std::string& group : options.extra) layout.extra.push_back(add(group));
}

MotionStream::Impl::OpenSource MotionStream::Impl::open(Wanted wanted) const {
  OpenSource open;
  if (wanted == Wanted::kPosition) open.layout.q = layout.q;
  if (wanted == Wanted::kEverything) open.layout = layout;
  const auto count = static_cast<std::ptrdiff_t>(open.layout.total());
  if (memory) {
    open.source = std::make_unique<MemorySource>(
        memory->time, std::vector(memory_columns.begin(), memory_columns.begin() + count));
    return open;
  }
  open.file = std::make_unique<LogFile>(summary.path, needs);
  const std::vector<FileColumn> columns(file_columns.begin(), file_columns.begin() + count);
  std::vector<std::size_t> numbers;
  for (const FileColumn& column : columns) {
    if (column.column >= open.file->num_columns()) {
      throw DataError(
          fmt::format("{}:1: the header changed while the log was being read; wait until it is complete and "
                      "try again",
                      summary.path));
    }
    numbers.push_back(column.column);
  }
  open.file->want_only(numbers);
  open.source = std::make_unique<FileSource>(*open.file, columns);
  return open;
}

/// Rows handed out before and after a piece.
Index MotionStream::Impl::margin_rows() const {
  double seconds = options.margin;
  if (seconds <= 0.0) seconds = summary.cutoff > 0.0 ? 14.0 / summary.cutoff : 0.0;
  return std::max(kSplineReach, static_cast<Index>(std::ceil(seconds * summary.sample_rate)));
}

/// A piece of the grid with its margins, rows of the log still missing.
MotionStream::Impl::Window MotionStream::Impl::window_of(Index first, Index chunk, Index margin) const {
  Window window;
  window.first = first;
  window.count = std::min(chunk, grid_count - first);
  window.lo = std::max<Index>(0, first - margin);
  window.hi = std::min(grid_count, first + window.count + margin);
  window.grid = grid(window.lo, window.hi - window.lo);
  return window;
}

/// Calls `use` for every piece of the grid, pieces wholly inside a gap left out.
void MotionStream::Impl::walk(Wanted wanted, Index chunk, Index margin,
                              const std::function<void(const Window&)>& use,
                              const std::function<void(double)>& progress) const {
  OpenSource pass = open(wanted);
  RowBuffer rows(pass.layout.total());
  bool at_end = false;
  const auto read = [&] {
    at_end = pass.source->read(kBlockRows, rows) == 0;
    return !at_end;
  };
  const Index reach = summary.resampled ? kSplineReach : 0;
  // First row in the buffer at or after a time.
  const auto row_at = [&](double time) {
    const double* begin = rows.time.data() + rows.begin;
    return static_cast<Index>(std::lower_bound(begin, begin + rows.size(), time) - begin);
  };

  for (Index first = 0; first < grid_count;) {
    Window window = window_of(first, chunk, margin);
    const double from = window.grid[0];
    const double to = window.grid[window.grid.size() - 1];

    // Rows of the log: up to `reach` behind the window, and from `reach` before it.
    const auto enough = [&] {
      if (!summary.resampled) return rows.first + rows.size() >= window.hi;
      return rows.size() > reach && rows.time[rows.end - 1 - reach] > to;
    };
    while (!at_end && !enough() && read()) {
      // A long gap must not make the buffer grow.
      if (summary.resampled && rows.size() > 0) {
        const Index before = row_at(from) - reach - 1;
        if (before > 0) rows.drop_front(before);
      }
    }
    const Index begin =
        summary.resampled ? std::max<Index>(0, row_at(from) - reach - 1) : window.lo - rows.first;
    rows.drop_front(begin);
    const Index end =
        summary.resampled ? std::min(rows.size(), row_at(to) + reach + 1) : window.hi - window.lo;
    if (begin < 0 || end > rows.size() || end < 1) {
      throw DataError(fmt::format(
          "{}: the log changed while it was being read (it had {} rows); wait until it is complete and try "
          "again",
          summary.path, summary.samples));
    }

    // A gap that holds the whole window: on to where it ends.
    if (summary.resampled) {
      const Index next = row_at(from);
      if (next > 0 && next < rows.size() && rows.time[rows.begin + next] > to) {
        const double gap_end = rows.time[rows.begin + next];
        const auto ahead = static_cast<Index>((gap_end - from) * summary.sample_rate) - 2 * margin - 2;
        if (gap_end - rows.time[rows.begin + next - 1] > longest && ahead > chunk) {
          first += ahead;
          continue;
        }
      }
    }

    window.raw_first = rows.first;
    window.time = rows.time.segment(rows.begin, end);
    window.values = rows.values.middleRows(rows.begin, end);
    const bool is_last = first + window.count == grid_count;
    if (summary.resampled) {
      window.own_begin = first == 0 ? 0 : row_at(grid_time(first));
      window.own_end = is_last ? end : row_at(grid_time(first + window.count));
    } else {
      window.own_begin = first - window.lo;
      window.own_end = window.own_begin + window.count;
    }
    use(window);
    first += window.count;
    if (progress) progress(static_cast<double>(first) / static_cast<double>(grid_count));
  }
  // The rest of the rows, if any, shows whether the log is still the one that was read first.
  while (!at_end && read()) rows.clear();
  refuse_other_length(rows.first + rows.size());
}

/// @throws DataError when a later pass finds another number of rows than the first
void MotionStream::Impl::refuse_other_length(Index rows) const {
  if (rows == summary.samples) return;
  throw DataError(fmt::format(
      "{}: the log has {} rows and had {} when it was first read; wait until it is complete and try again",
      summary.path, rows, summary.samples));
}

Eigen::MatrixXd MotionStream::Impl::on_grid(const Window& window, Index column, Index columns) const {
  if (!summary.resampled) return window.values.middleCols(column, columns);
  return resample(window.time, window.values.middleCols(column, columns), window.grid, longest);
}

DerivedMotion MotionStream::Impl::motion(const Window& window) const {
  const Index n = layout.q;
  const Eigen::MatrixXd q = on_grid(window, 0, n);
  if (logged) {
    return {q, on_grid(window, n + layout.tau, n), on_grid(window, n + layout.tau + n, n)};
  }
  return derive_on_grid(window.grid, q, summary.sample_rate, summary.cutoff, options.motion);
}

/// Rows of the window's grid that no gap reaches: a filter carries what was invented there as far as three
/// periods of its cut-off (8e-4 of it is left).
Eigen::Array<bool, Eigen::Dynamic, 1> MotionStream::Impl::outside_gaps(const Window& window) const {
  Eigen::Array<bool, Eigen::Dynamic, 1> clear =
      Eigen::Array<bool, Eigen::Dynamic, 1>::Constant(window.grid.size(), true);
  const double period = 1.0 / summary.sample_rate;
  const double reach = summary.cutoff > 0.0 ? 3.0 / summary.cutoff : options.motion.stencil * period;
  for (Index k = 1; k < window.time.size(); ++k) {
    if (window.time[k] - window.time[k - 1] <= longest) continue;
    for (Index row = 0; row < window.grid.size(); ++row) {
      const double t = window.grid[row];
      if (t > window.time[k - 1] - reach && t < window.time[k] + reach) clear[row] = false;
    }
  }
  return clear;
}

MotionChunk MotionStream::Impl::chunk(const Window& window) const {
  const Index n = layout.q;
  DerivedMotion derived = motion(window);

  // Of the window, what is right to the last digit is handed out.
  const Index margin = margin_rows();
  const Index lo = std::max<Index>(0, window.first - margin) - window.lo;
  const Index hi = std::min(grid_count, window.first + window.count + margin) - window.lo;
  const Index size = hi - lo;
  MotionChunk chunk;
  chunk.sample_rate = summary.sample_rate;
  chunk.first = window.first;
  chunk.begin = window.first - window.lo - lo;
  chunk.count = window.count;
  chunk.time = window.grid.segment(lo, size);
  chunk.q = derived.q.middleRows(lo, size);
  chunk.qd = derived.qd.middleRows(lo, size);
  chunk.qdd = derived.qdd.middleRows(lo, size);
  chunk.usable = outside_gaps(window).segment(lo, size);
  if (options.cut_standstill) {
    chunk.usable =
        chunk.usable && chunk.time.array() >= summary.moving_from && chunk.time.array() <= summary.moving_to;
  }
  chunk.tau = on_grid(window, n, layout.tau).middleRows(lo, size);
  Index column = n + layout.tau + layout.qd + layout.qdd;
  for (const Index columns : layout.extra) {
    chunk.extra.push_back(on_grid(window, column, columns).middleRows(lo, size));
    column += columns;
  }

  // The log's own rows.
  const Index own = window.own_end - window.own_begin;
  chunk.row_time = window.time.segment(window.own_begin, own);
  const auto own_rows = [&](Index from, Index columns) {
    return window.values.block(window.own_begin, from, own, columns);
  };
  chunk.row_tau = own_rows(n, layout.tau);
  if (logged) {
    chunk.row_q = own_rows(0, n);
    chunk.row_qd = own_rows(n + layout.tau, n);
    chunk.row_qdd = own_rows(n + layout.tau + n, n);
  } else if (summary.resampled) {
    const double no_gap = std::numeric_limits<double>::infinity();
    chunk.row_q = resample(chunk.time, chunk.q, chunk.row_time, no_gap);
    chunk.row_qd = resample(chunk.time, chunk.qd, chunk.row_time, no_gap);
    chunk.row_qdd = resample(chunk.time, chunk.qdd, chunk.row_time, no_gap);
  } else {
    chunk.row_q = chunk.q.middleRows(chunk.begin, own);
    chunk.row_qd = chunk.qd.middleRows(chunk.begin, own);
    chunk.row_qdd = chunk.qdd.middleRows(chunk.begin, own);
  }
  if (wants_displacement(layout.qd)) add_displacement(window, lo, size, chunk);
  return chunk;
}

/// @param lo, size  rows of the window's grid that the chunk hands out
void MotionStream::Impl::add_displacement(const Window& window, Index lo, Index size,
                                          MotionChunk& chunk) const {
  const Index n = layout.q;
  const Eigen::MatrixXd path = travelled(window.time, window.values.leftCols(n),
                                         window.values.middleCols(n + layout.tau, n), position_noise);
  chunk.row_displacement = steps(path, window.own_begin, window.own_end - window.own_begin);
  chunk.displacement = steps(
      summary.resampled ? on_even_rows(window.grid, summary.sample_rate, window.time, path) : path, lo, size);
}

MotionStream::MotionStream(const std::string& path, const LogRequirements& needs,
                           const StreamOptions& options)
    : impl_(std::make_unique<Impl>()) {
  impl_->needs = needs;
  impl_->options = options;
  impl_->summary.path = path;
  std::error_code ignored;
  // What cannot be read twice (a pipe) is kept.
  if (std::filesystem::exists(path, ignored) && std::filesystem::is_other(path, ignored)) {
    impl_->memory = read_log(path, needs, &impl_->summary.notes);
  }
  impl_->first_pass();
}

MotionStream::MotionStream(Log log, const StreamOptions& options) : impl_(std::make_unique<Impl>()) {
  impl_->options = options;
  impl_->memory = std::move(log);
  impl_->first_pass();
}

MotionStream::~MotionStream() = default;
MotionStream::MotionStream(MotionStream&&) noexcept = default;
MotionStream& MotionStream::operator=(MotionStream&&) noexcept = default;

const StreamSummary& MotionStream::summary() const { return impl_->summary; }

std::vector<LogFinding> MotionStream::check(const JointLimits& limits) const {
  return impl_->log_check->findings(limits);
}

void MotionStream::for_each(const std::function<void(const MotionChunk&)>& piece,
                            const std::function<void(double)>& progress) const {
  const Index handed_out = impl_->margin_rows();
  const Index settling =
      impl_->logged ? 0
                    : settling_rows(impl_->summary.sample_rate, impl_->summary.cutoff, impl_->options.motion);
  const Index chunk = std::max(impl_->options.chunk_samples, 2 * handed_out);
  impl_->walk(
      Impl::Wanted::kEverything, chunk, handed_out + settling,
      [&](const Impl::Window& window) { piece(impl_->chunk(window)); }, progress);
}

}  // namespace heft::data
