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
  if (options.temperature && log.temperature.cols() == n) layout.temperature = add(log.temperature);
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
  if (options.temperature && file.has_channel(&Log::temperature)) layout.temperature = add("temp");
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
  const std::vector<FileColumn> columns(file_columns.begin(), file_columns.begin() + count);
  open.source = kept->source(columns);
  if (open.source) return open;
  open.file = std::make_unique<LogFile>(summary.path, needs);
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
  open.source = kept->placed(std::make_unique<FileSource>(*open.file, columns));
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

MotionStream::Impl::Walk::Walk(const Impl& stream, Wanted wanted, Index chunk, Index margin)
    : stream_(stream),
      pass_(stream.open(wanted)),
      rows_(pass_.layout.total()),
      chunk_(chunk),
      margin_(margin),
      reach_(stream.summary.resampled ? kSplineReach : 0) {}

double MotionStream::Impl::Walk::window_bytes() const {
  return static_cast<double>(chunk_ + 2 * margin_) * static_cast<double>(pass_.layout.total() + 1) * sizeof(double);
}

bool MotionStream::Impl::Walk::read() {
  at_end_ = pass_.source->read(kBlockRows, rows_) == 0;
  return !at_end_;
}

/// First row in the buffer at or after a time.
Index MotionStream::Impl::Walk::row_at(double time) const {
  const double* begin = rows_.time.data() + rows_.begin;
  return static_cast<Index>(std::lower_bound(begin, begin + rows_.size(), time) - begin);
}

/// Rows of the log: up to `reach_` behind a window from .. to, and from `reach_` before it.
/// @param last  number of the row behind the window, where the grid is the log's own
void MotionStream::Impl::Walk::read_around(double from, double to, Index last) {
  const auto enough = [&] {
    if (!stream_.summary.resampled) return rows_.first + rows_.size() >= last;
    return rows_.size() > reach_ && rows_.time[rows_.end - 1 - reach_] > to;
  };
  while (!at_end_ && !enough() && read()) {
    // A long gap must not make the buffer grow.
    if (stream_.summary.resampled && rows_.size() > 0) {
      const Index before = row_at(from) - reach_ - 1;
      if (before > 0) rows_.drop_front(before);
    }
  }
}

/// Goes on to where a gap ends that holds the whole window. @return whether there is one
bool MotionStream::Impl::Walk::skip_gap(double from, double to) {
  if (!stream_.summary.resampled) return false;
  const Index next = row_at(from);
  if (next == 0 || next >= rows_.size() || rows_.time[rows_.begin + next] <= to) return false;
  const double gap_end = rows_.time[rows_.begin + next];
  const auto ahead = static_cast<Index>((gap_end - from) * stream_.summary.sample_rate) - 2 * margin_ - 2;
  if (gap_end - rows_.time[rows_.begin + next - 1] <= stream_.longest || ahead <= chunk_) return false;
  first_ += ahead;
  return true;
}

bool MotionStream::Impl::Walk::next(Window& window) {
  const StreamSummary& summary = stream_.summary;
  while (first_ < stream_.grid_count) {
    window = stream_.window_of(first_, chunk_, margin_);
    const double from = window.grid[0];
    const double to = window.grid[window.grid.size() - 1];
    read_around(from, to, window.hi);
    const Index begin =
        summary.resampled ? std::max<Index>(0, row_at(from) - reach_ - 1) : window.lo - rows_.first;
    rows_.drop_front(begin);
    const Index end =
        summary.resampled ? std::min(rows_.size(), row_at(to) + reach_ + 1) : window.hi - window.lo;
    if (begin < 0 || end > rows_.size() || end < 1) {
      throw DataError(fmt::format(
          "{}: the log changed while it was being read (it had {} rows); wait until it is complete and try "
          "again",
          summary.path, summary.samples));
    }
    if (skip_gap(from, to)) continue;

    window.raw_first = rows_.first;
    window.time = rows_.time.segment(rows_.begin, end);
    window.values = rows_.values.middleRows(rows_.begin, end);
    const bool is_last = first_ + window.count == stream_.grid_count;
    if (summary.resampled) {
      window.own_begin = first_ == 0 ? 0 : row_at(stream_.grid_time(first_));
      window.own_end = is_last ? end : row_at(stream_.grid_time(first_ + window.count));
    } else {
      window.own_begin = first_ - window.lo;
      window.own_end = window.own_begin + window.count;
    }
    first_ += window.count;
    return true;
  }
  // The rest of the rows, if any, shows whether the log is still the one that was read first.
  while (!at_end_ && read()) rows_.clear();
  stream_.refuse_other_length(rows_.first + rows_.size());
  return false;
}

/// @throws DataError when a later pass finds another number of rows than the first
void MotionStream::Impl::refuse_other_length(Index rows) const {
  if (rows == summary.samples) return;
  throw DataError(fmt::format(
      "{}: the log has {} rows and had {} when it was first read; wait until it is complete and try again",
      summary.path, rows, summary.samples));
}

Eigen::MatrixXd MotionStream::Impl::on_grid(const Window& window, Index column, Index columns, Index first,
                                            Index count) const {
  if (!summary.resampled) return window.values.block(first, column, count, columns);
  return resample(window.time, window.values.middleCols(column, columns), window.grid, longest,
                  column == 0 ? Bridge::kMotion : Bridge::kLine)
      .middleRows(first, count);
}

DerivedMotion MotionStream::Impl::motion(const Window& window) const {
  if (!logged) {
    return of_positions(window, [&](const Eigen::Ref<const Eigen::MatrixXd>& q) {
      return derive_on_grid(window.grid, q, summary.sample_rate, summary.cutoff, options.motion);
    });
  }
  const Index n = layout.q, rows = window.grid.size();
  return {on_grid(window, 0, n, 0, rows), on_grid(window, n + layout.tau, n, 0, rows),
          on_grid(window, n + layout.tau + n, n, 0, rows)};
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
  chunk.tau = on_grid(window, n, layout.tau, lo, size);
  Index column = n + layout.tau + layout.qd + layout.qdd;
  const bool has_temperature = layout.temperature == n;
  if (has_temperature) chunk.temperature = on_grid(window, column, n, lo, size);
  const Index at_temperature = column;
  column += layout.temperature;
  for (const Index columns : layout.extra) {
    chunk.extra.push_back(on_grid(window, column, columns, lo, size));
    column += columns;
  }

  // The log's own rows.
  const Index own = window.own_end - window.own_begin;
  chunk.row_time = window.time.segment(window.own_begin, own);
  const auto own_rows = [&](Index from, Index columns) {
    return window.values.block(window.own_begin, from, own, columns);
  };
  chunk.row_tau = own_rows(n, layout.tau);
  if (has_temperature) chunk.row_temperature = own_rows(at_temperature, n);
  if (logged && summary.resampled) {
    chunk.off_grid_q = own_rows(0, n);
    chunk.off_grid_qd = own_rows(n + layout.tau, n);
    chunk.off_grid_qdd = own_rows(n + layout.tau + n, n);
  } else if (summary.resampled) {
    const double no_gap = std::numeric_limits<double>::infinity();
    chunk.off_grid_q = resample(chunk.time, chunk.q, chunk.row_time, no_gap);
    chunk.off_grid_qd = resample(chunk.time, chunk.qd, chunk.row_time, no_gap);
    chunk.off_grid_qdd = resample(chunk.time, chunk.qdd, chunk.row_time, no_gap);
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

MotionStream::MotionStream(const std::string& path, const LogRequirements& needs, const StreamOptions& options)
    : MotionStream(std::make_shared<const KeptLog>(path, needs, false), options) {
  // Who opens a set of logs is told then.
  if (std::string note = impl_->kept->note_on_times(); !note.empty()) impl_->summary.notes.push_back(std::move(note));
}

MotionStream::MotionStream(std::shared_ptr<const KeptLog> log, const StreamOptions& options)
    : impl_(std::make_unique<Impl>()) {
  impl_->needs = log->needs();
  impl_->options = options;
  impl_->kept = std::move(log);
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
  return impl_->facts().check.findings(limits);
}

void MotionStream::for_each_piece(const std::function<std::shared_ptr<void>(MotionChunk&)>& work,
                                  const std::function<void(void*)>& use,
                                  const std::function<void(double)>& progress) const {
  struct Done {
    std::shared_ptr<void> result;
    Index behind{0};  ///< row of the grid behind the piece
  };
  const Index handed_out = impl_->margin_rows();
  const Index settling =
      impl_->logged ? 0
                    : settling_rows(impl_->summary.sample_rate, impl_->summary.cutoff, impl_->options.motion);
  const Index chunk = std::max(impl_->options.chunk_samples, 2 * handed_out);
  impl_->walk<Done>(
      Impl::Wanted::kEverything, chunk, handed_out + settling,
      [&](Impl::Window& window) {
        MotionChunk piece = impl_->chunk(window);
        window.values.resize(0, 0);  // room for the work
        return Done{work(piece), window.first + window.count};
      },
      [&](Done& done) {
        use(done.result.get());
        if (progress) progress(static_cast<double>(done.behind) / static_cast<double>(impl_->grid_count));
      });
}

void MotionStream::for_each(const std::function<void(const MotionChunk&)>& piece,
                            const std::function<void(double)>& progress) const {
  for_each_piece([](MotionChunk& chunk) { return std::make_shared<MotionChunk>(std::move(chunk)); },
                 [&](void* chunk) { piece(*static_cast<const MotionChunk*>(chunk)); }, progress);
}

}  // namespace heft::data
