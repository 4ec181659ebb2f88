#include "heft/data/motion_stream.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "heft/core/effects/displacement.hpp"
#include "heft/host/error.hpp"
#include "log_file.hpp"
#include "motion_steps.hpp"

namespace heft::data {
namespace {

using Eigen::Index;

/// Rows of a log read at once.
constexpr Index kBlockRows = 2048;
/// Knots after which a cubic spline has forgotten where it was cut: a knot takes at least half away
/// (0.27 of it on an even grid).
constexpr Index kSplineReach = 64;
/// Gaps kept in the summary.
constexpr std::size_t kMostGaps = 100;
/// Joints that travel less rest [rad, m]; also those with less than a hundredth of the largest travel.
constexpr double kRestingTravel = 1e-2;
/// Slower rows show the noise of a position [rad/s, m/s].
constexpr double kRestingSpeed = 5e-3;
/// How far the position as logged may lie from where the joint is, in standard deviations.
constexpr double kPositionReach = 4.0;

/// Rows of a log in a row, old ones dropped in front and new ones added behind.
struct RowBuffer {
  Eigen::VectorXd time;
  Eigen::MatrixXd values;
  Index begin{0}, end{0};  ///< rows in use
  Index first{0};          ///< number of row `begin`, counted from the start of the log

  explicit RowBuffer(Index columns) : time(4 * kBlockRows), values(4 * kBlockRows, columns) {}

  Index size() const { return end - begin; }

  void make_room(Index rows) {
    if (end + rows <= time.size()) return;
    const Index used = size();
    if (used + rows > time.size() - time.size() / 4) {
      const Index capacity = 2 * (used + rows);
      Eigen::VectorXd new_time(capacity);
      Eigen::MatrixXd new_values(capacity, values.cols());
      new_time.head(used) = time.segment(begin, used);
      new_values.topRows(used) = values.middleRows(begin, used);
      time = std::move(new_time);
      values = std::move(new_values);
    } else {
      // Towards the front, so that an overlap is copied in the right order.
      std::copy(time.data() + begin, time.data() + end, time.data());
      for (Index c = 0; c < values.cols(); ++c) {
        double* column = values.col(c).data();
        std::copy(column + begin, column + end, column);
      }
    }
    begin = 0;
    end = used;
  }

  void drop_front(Index rows) {
    begin += rows;
    first += rows;
  }
  void clear() { drop_front(size()); }
};

/// Where a pass over a log gets its rows from: time and a choice of columns.
class RowSource {
 public:
  virtual ~RowSource() = default;
  /// Adds up to `most` rows. @return how many; 0 at the end
  virtual Index read(Index most, RowBuffer& rows) = 0;
};

class MemorySource : public RowSource {
 public:
  MemorySource(const Eigen::VectorXd& time, std::vector<const double*> columns)
      : time_(time), columns_(std::move(columns)) {}

  Index read(Index most, RowBuffer& rows) override {
    const Index count = std::min(most, time_.size() - at_);
    rows.make_room(count);
    rows.time.segment(rows.end, count) = time_.segment(at_, count);
    for (std::size_t c = 0; c < columns_.size(); ++c) {
      rows.values.col(static_cast<Index>(c)).segment(rows.end, count) =
          Eigen::Map<const Eigen::VectorXd>(columns_[c] + at_, count);
    }
    rows.end += count;
    at_ += count;
    return count;
  }

 private:
  const Eigen::VectorXd& time_;
  std::vector<const double*> columns_;
  Index at_{0};
};

/// A column of a file and what its numbers are to be multiplied by.
struct FileColumn {
  std::size_t column{0};
  double factor{1.0};
};

class FileSource : public RowSource {
 public:
  FileSource(LogFile& file, std::vector<FileColumn> columns)
      : file_(file), columns_(std::move(columns)), row_(file.num_columns(), 0.0) {}

  Index read(Index most, RowBuffer& rows) override {
    rows.make_room(most);
    const std::size_t time_column = file_.find_column("time");
    for (Index count = 0; count < most; ++count) {
      if (!file_.next(row_.data())) return count;
      rows.time[rows.end] = row_[time_column];
      for (std::size_t c = 0; c < columns_.size(); ++c) {
        rows.values(rows.end, static_cast<Index>(c)) = columns_[c].factor * row_[columns_[c].column];
      }
      ++rows.end;
    }
    return most;
  }

 private:
  LogFile& file_;
  std::vector<FileColumn> columns_;
  std::vector<double> row_;
};

/// First and last time at which a speed is above a threshold that is known only after the last sample: 1 % of
/// the largest speed, say. Kept are the samples that could still be the answer: towards the front those
/// faster than all before, towards the end those faster than all after.
class MovingSpan {
 public:
  void add(double time, double speed) {
    if (front_.empty() || speed > front_.back().speed) front_.push_back({time, speed});
    while (!back_.empty() && back_.back().speed <= speed) back_.pop_back();
    back_.push_back({time, speed});
    // When there are too many, two neighbours become one that moves for longer than either.
    if (front_.size() > kMost) {
      halve(front_, [](const Sample& a, const Sample& b) { return Sample{a.time, b.speed}; });
    }
    if (back_.size() > kMost) {
      halve(back_, [](const Sample& a, const Sample& b) { return Sample{b.time, a.speed}; });
    }
  }
  double top_speed() const { return front_.empty() ? 0.0 : front_.back().speed; }
  /// NaN: never above.
  double first_above(double threshold) const {
    for (const Sample& sample : front_) {
      if (sample.speed > threshold) return sample.time;
    }
    return std::numeric_limits<double>::quiet_NaN();
  }
  double last_above(double threshold) const {
    for (auto sample = back_.rbegin(); sample != back_.rend(); ++sample) {
      if (sample->speed > threshold) return sample->time;
    }
    return std::numeric_limits<double>::quiet_NaN();
  }

 private:
  struct Sample {
    double time, speed;
  };
  static constexpr std::size_t kMost = 4096;

  template <typename Merge>
  static void halve(std::vector<Sample>& samples, const Merge& merge) {
    std::size_t kept = 0;
    for (std::size_t k = 0; k + 1 < samples.size(); k += 2)
      samples[kept++] = merge(samples[k], samples[k + 1]);
    if (samples.size() % 2 == 1) samples[kept++] = samples.back();
    samples.resize(kept);
  }

  std::vector<Sample> front_, back_;
};

}  // namespace

void refuse_unsound(const Log& log) {
  const std::string& path = log.path;
  const Index rows = log.time.size();
  const auto check = [&](const Eigen::MatrixXd& matrix, std::string_view name, bool required) {
    if (matrix.cols() == 0 && !required) return;
    if (matrix.cols() != log.q.cols() || matrix.cols() == 0 || matrix.rows() != rows) {
      throw DataError(
          fmt::format("{}: {} is {} x {}; expected {} rows as time has and a column for each joint", path,
                      name, matrix.rows(), matrix.cols(), rows));
    }
    for (Index c = 0; c < matrix.cols(); ++c) {
      for (Index k = 0; k < rows; ++k) {
        if (!std::isfinite(matrix(k, c))) {
          throw DataError(fmt::format("{}: row {}, column '{}{}': found {}; expected a finite number", path,
                                      k + 1, name, c + 1, matrix(k, c)));
        }
      }
    }
  };
  check(log.q, "q", true);
  check(log.tau, "tau", false);
  check(log.qd, "qd", false);
  check(log.qdd, "qdd", false);
  for (Index k = 0; k < rows; ++k) {
    if (!std::isfinite(log.time[k]) || (k > 0 && !(log.time[k] > log.time[k - 1]))) {
      throw DataError(fmt::format(
          "{}: row {}, column 'time': found {}{}; expected finite time that increases with every row", path,
          k + 1, log.time[k], k > 0 ? fmt::format(" after {}", log.time[k - 1]) : ""));
    }
  }
}

struct MotionStream::Impl {
  /// Columns of a pass, by group, in this order in a RowBuffer.
  struct Layout {
    Index q{0}, tau{0}, qd{0}, qdd{0};  ///< columns each
    std::vector<Index> extra{};         ///< columns of each group
    Index total() const {
      Index sum = q + tau + qd + qdd;
      for (const Index columns : extra) sum += columns;
      return sum;
    }
  };
  /// A source and what keeps it alive.
  struct OpenSource {
    std::unique_ptr<LogFile> file;
    std::unique_ptr<RowSource> source;
    Layout layout;
    double part_read() const { return file ? file->part_read() : 0.0; }
  };
  /// A piece of the even grid and the rows of the log around it.
  struct Window {
    Index first{0}, count{0};        ///< of the piece
    Index lo{0}, hi{0};              ///< with margins
    Eigen::VectorXd grid;            ///< lo..hi
    Index raw_first{0};              ///< number of the first row below, from the start of the log
    Index own_begin{0}, own_end{0};  ///< rows below that belong to the piece
    Eigen::VectorXd time;            ///< of the log's rows
    Eigen::MatrixXd values;
  };

  enum class Wanted { kTime, kPosition, kEverything };

  LogRequirements needs;
  StreamOptions options;
  std::optional<Log> memory;
  StreamSummary summary;
  Layout layout;  ///< of a pass over everything
  std::vector<FileColumn> file_columns;
  std::vector<const double*> memory_columns;
  std::optional<LogCheck> log_check;
  Index grid_count{0};
  double longest{0.0};  ///< bridged by a spline [s]
  bool logged{false};   ///< motion as logged
  Eigen::RowVectorXd
      position_noise;  ///< standard deviation of the position at rest, where displacements are wanted

  Eigen::VectorXd grid(Index first, Index count) const {
    return Eigen::VectorXd::LinSpaced(grid_count, summary.begin, summary.end).segment(first, count);
  }
  double grid_time(Index row) const { return grid(row, 1)[0]; }

  void prepare_memory(bool every_rate);
  void prepare_file(const LogFile& file, bool every_rate);
  OpenSource open(Wanted wanted) const;
  void first_pass();
  void find_gaps_of_log();
  void find_motion();
  Index margin_rows() const;
  void walk(Wanted wanted, Index chunk, Index margin, const std::function<void(const Window&)>& use,
            const std::function<void(double)>& progress = {}) const;
  Eigen::MatrixXd on_grid(const Window& window, Index column, Index columns) const;
  DerivedMotion motion(const Window& window) const;
  Eigen::Array<bool, Eigen::Dynamic, 1> outside_gaps(const Window& window) const;
  MotionChunk chunk(const Window& window) const;
  bool wants_displacement(Index velocities) const { return options.displacement && velocities == layout.q; }
  void add_displacement(const Window& window, Index lo, Index size, MotionChunk& chunk) const;
};

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

/// Checks every row, fits the even grid, finds ranges, bandwidth, top speeds and standstill.
void MotionStream::Impl::first_pass() {
  // 1. Every row once: format, time stamps, ranges.
  OpenSource pass;
  std::vector<MovingSpan> spans;
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
  const Index n = layout.q;
  summary.num_joints = static_cast<int>(n);
  summary.velocity_logged = summary.acceleration_logged = logged;
  spans.resize(static_cast<std::size_t>(n));
  log_check.emplace(summary.path, static_cast<int>(n));

  StreamingMedian median;
  double last_time = 0.0;
  double longest_period = 0.0;
  // The grid is the log's own when |t_k - t_0 - k p| <= p/100 for every k and p = (t_end - t_0)/(m-1), that
  // is when (t_k - t_0)/(k + 0.01) <= p <= (t_k - t_0)/(k - 0.01): bounds that need no second look at the
  // rows.
  double least_period = 0.0;
  double most_period = std::numeric_limits<double>::infinity();
  Eigen::RowVectorXd low = Eigen::RowVectorXd::Constant(n, std::numeric_limits<double>::infinity());
  Eigen::RowVectorXd high = -low;
  Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(n);
  Eigen::RowVectorXd origin;
  Eigen::RowVectorXd torque = Eigen::RowVectorXd::Zero(layout.tau);
  RowBuffer rows(layout.total());
  long samples = 0;
  Eigen::RowVectorXd resting_squares = Eigen::RowVectorXd::Zero(n), resting_rows = resting_squares;
  while (const Index count = pass.source->read(kBlockRows, rows)) {
    for (Index k = rows.begin; k < rows.end; ++k) {
      const double t = rows.time[k];
      if (samples == 0) {
        summary.begin = t;
        origin = rows.values.row(k).head(n);
      } else {
        const double elapsed = t - summary.begin;
        const auto number = static_cast<double>(samples);
        least_period = std::max(least_period, elapsed / (number + 0.01));
        most_period = std::min(most_period, elapsed / (number - 0.01));
        longest_period = std::max(longest_period, t - last_time);
        median.add(t - last_time);
      }
      last_time = t;
      ++samples;
    }
    const auto q = rows.values.middleRows(rows.begin, count).leftCols(n);
    low = low.cwiseMin(q.colwise().minCoeff());
    high = high.cwiseMax(q.colwise().maxCoeff());
    sum += (q.rowwise() - origin).colwise().sum();
    if (layout.tau > 0) {
      torque = torque.cwiseMax(
          rows.values.block(rows.begin, n, count, layout.tau).cwiseAbs().colwise().maxCoeff());
    }
    const auto group = [&](Index from, Index columns) {
      return rows.values.block(rows.begin, from, count, columns);
    };
    log_check->add(rows.time.segment(rows.begin, count), q, group(n + layout.tau, layout.qd),
                   group(n + layout.tau + layout.qd, layout.qdd), group(n, layout.tau));
    if (wants_displacement(layout.qd)) {
      for (Index joint = 0; joint < n; ++joint) {
        const auto velocity = rows.values.col(n + layout.tau + joint);
        for (Index k = rows.begin + 1; k < rows.end; ++k) {
          if (!(std::max(std::abs(velocity[k]), std::abs(velocity[k - 1])) < kRestingSpeed)) continue;
          const double step = rows.values(k, joint) - rows.values(k - 1, joint);
          resting_squares[joint] += step * step;
          resting_rows[joint] += 1.0;
        }
      }
    }
    if (logged) {
      for (Index joint = 0; joint < n; ++joint) {
        const auto column = rows.values.col(n + layout.tau + joint);
        for (Index k = rows.begin; k < rows.end; ++k) {
          spans[static_cast<std::size_t>(joint)].add(rows.time[k], std::abs(column[k]));
        }
      }
    }
    rows.clear();
  }
  // A recorded rate that contradicts the positions would be worse than a derived one.
  if (const std::string reason = logged ? log_check->unusable_rate() : std::string(); !reason.empty()) {
    options.prefer_logged = logged = false;
    summary.velocity_logged = summary.acceleration_logged = false;
    spans.assign(static_cast<std::size_t>(n), MovingSpan());
    summary.notes.push_back(fmt::format("{}: {}; velocity and acceleration are derived from position instead",
                                        summary.path, reason));
  }
  if (pass.file) {
    pass.file->check_length();
    prepare_file(*pass.file, false);
    std::vector<std::size_t> used;
    for (const FileColumn& column : file_columns) used.push_back(column.column);
    if (std::string note = pass.file->note(used); !note.empty()) summary.notes.push_back(std::move(note));
  }
  if (memory) prepare_memory(false);
  // A difference of two positions has twice the variance.
  position_noise = (0.5 * resting_squares.array() / resting_rows.array().max(1.0)).sqrt().matrix();
  summary.samples = samples;
  summary.end = last_time;
  if (samples < kLeastSamples) refuse_short_log(summary.path, samples);
  summary.travel = (high - low).transpose();
  summary.max_torque = torque.transpose();

  // 2. The even grid.
  while (!median.finish_pass()) {
    OpenSource again = open(Wanted::kTime);
    RowBuffer times(0);
    bool first = true;
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
  const double even_period = length / static_cast<double>(samples - 1);
  summary.resampled = !(least_period <= even_period && even_period <= most_period);
  grid_count = summary.resampled ? grid_rows(length, 1.0 / median.value()) : static_cast<Index>(samples);
  summary.sample_rate = static_cast<double>(grid_count - 1) / length;
  longest = kGapFactor * median.value();
  if (longest_period > longest) find_gaps_of_log();

  // 3. The cut-off.
  if (options.motion.cutoff == 0.0) {
    summary.cutoff_chosen = true;
    BandwidthEstimate bandwidth(grid_count, origin + sum / static_cast<double>(samples), summary.sample_rate);
    walk(Wanted::kPosition, kBlockRows * 4, 0,
         [&](const Window& window) { bandwidth.add(on_grid(window, 0, n)); });
    summary.bandwidth = bandwidth.value();
  }
  summary.cutoff = choose_cutoff(summary.path, options.motion, summary.bandwidth, summary.sample_rate);

  // 4. Speeds and standstill.
  if (!logged) {
    const Index margin = settling_rows(summary.sample_rate, summary.cutoff, options.motion);
    walk(Wanted::kPosition, std::max(kBlockRows * 4, 2 * margin), margin, [&](const Window& window) {
      const DerivedMotion derived = motion(window);
      const auto clear = outside_gaps(window);
      for (Index joint = 0; joint < n; ++joint) {
        const auto speed = derived.qd.col(joint).cwiseAbs();
        MovingSpan& span = spans[static_cast<std::size_t>(joint)];
        for (Index k = window.first - window.lo; k < window.first - window.lo + window.count; ++k) {
          if (clear[k]) span.add(window.grid[k], speed[k]);
        }
      }
    });
  }
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

/// Rows handed out before and after a piece.
Index MotionStream::Impl::margin_rows() const {
  double seconds = options.margin;
  if (seconds <= 0.0) seconds = summary.cutoff > 0.0 ? 14.0 / summary.cutoff : 0.0;
  return std::max(kSplineReach, static_cast<Index>(std::ceil(seconds * summary.sample_rate)));
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
    Window window;
    window.first = first;
    window.count = std::min(chunk, grid_count - first);
    window.lo = std::max<Index>(0, first - margin);
    window.hi = std::min(grid_count, first + window.count + margin);
    window.grid = grid(window.lo, window.hi - window.lo);
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
  if (rows.first + rows.size() != summary.samples) {
    throw DataError(fmt::format(
        "{}: the log has {} rows and had {} when it was first read; wait until it is complete and try again",
        summary.path, rows.first + rows.size(), summary.samples));
  }
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
  const Index n = layout.q, count = window.time.size(), own = window.own_end - window.own_begin;
  Eigen::MatrixXd travelled(count, kMeasuredDisplacements * n);
  for (Index joint = 0; joint < n; ++joint) {
    const auto q = window.values.col(joint), qd = window.values.col(n + layout.tau + joint);
    const double reach = kPositionReach * position_noise[joint];
    auto free = travelled.col(joint), held = travelled.col(n + joint);
    free[0] = held[0] = q[0];
    for (Index k = 1; k < count; ++k) {
      double step = 0.5 * (qd[k] + qd[k - 1]) * (window.time[k] - window.time[k - 1]);
      if (!std::isfinite(step)) step = q[k] - q[k - 1];  // a velocity dropped out
      free[k] = free[k - 1] + step;
      held[k] = std::clamp(held[k - 1] + step, q[k] - reach, q[k] + reach);
    }
  }
  const auto steps = [](const Eigen::MatrixXd& x, Index first, Index rows) {
    Eigen::MatrixXd d = Eigen::MatrixXd::Zero(rows, x.cols());
    const Index from = first > 0 ? 0 : 1;  // nothing precedes the first row
    d.bottomRows(rows - from) =
        x.middleRows(first + from, rows - from) - x.middleRows(first + from - 1, rows - from);
    return d;
  };
  chunk.row_displacement = steps(travelled, window.own_begin, own);
  if (!summary.resampled) {
    chunk.displacement = steps(travelled, lo, size);
    return;
  }
  // Memory goes by turning points: one that lies between rows of the grid moves to the nearest of them.
  Eigen::MatrixXd even(window.grid.size(), travelled.cols());
  const double half = 0.5 / summary.sample_rate;
  Index at = 0;
  for (Index k = 0; k < window.grid.size(); ++k) {
    const double t = window.grid[k];
    while (at + 2 < count && window.time[at + 1] < t) ++at;
    const Index next = std::min(at + 1, count - 1);
    const double span = window.time[next] - window.time[at];
    const double share = span > 0.0 ? std::clamp((t - window.time[at]) / span, 0.0, 1.0) : 0.0;
    const Eigen::RowVectorXd between = (1.0 - share) * travelled.row(at) + share * travelled.row(next);
    even.row(k) = between;
    Index first = at;
    while (first > 0 && window.time[first - 1] > t - half) --first;
    for (Index i = first; i < count && window.time[i] <= t + half; ++i) {
      if (window.time[i] <= t - half || i == 0 || i + 1 == count) continue;
      for (Index c = 0; c < travelled.cols(); ++c) {
        const double x = travelled(i, c);
        const bool turns = (x - travelled(i - 1, c)) * (travelled(i + 1, c) - x) < 0.0;
        if (turns && std::abs(x - between[c]) > std::abs(even(k, c) - between[c])) even(k, c) = x;
      }
    }
  }
  chunk.displacement = steps(even, lo, size);
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
