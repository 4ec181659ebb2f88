/// @file
/// What the passes of a MotionStream share: its first pass and those that hand out pieces.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "derive_motion.hpp"
#include "heft/data/motion_stream.hpp"
#include "heft/host/parallel.hpp"
#include "kept_log.hpp"
#include "log_facts.hpp"
#include "log_file.hpp"
#include "moving_span.hpp"
#include "row_source.hpp"

namespace heft::data {

struct MotionStream::Impl {
  /// Columns of a pass, by group, in this order in a RowBuffer.
  struct Layout {
    Eigen::Index q{0}, tau{0}, qd{0}, qdd{0}, temperature{0};  ///< columns each
    std::vector<Eigen::Index> extra{};         ///< columns of each group
    Eigen::Index total() const {
      Eigen::Index sum = q + tau + qd + qdd + temperature;
      for (const Eigen::Index columns : extra) sum += columns;
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
    Eigen::Index first{0}, count{0};        ///< of the piece
    Eigen::Index lo{0}, hi{0};              ///< with margins
    Eigen::VectorXd grid;                   ///< lo..hi
    Eigen::Index raw_first{0};              ///< number of the first row below, from the start of the log
    Eigen::Index own_begin{0}, own_end{0};  ///< rows below that belong to the piece
    Eigen::VectorXd time;                   ///< of the log's rows
    Eigen::MatrixXd values;
  };

  enum class Wanted { kTime, kPosition, kEverything };

  LogRequirements needs;
  StreamOptions options;
  std::optional<Log> memory;
  std::unique_ptr<LogFacts> own_facts;  ///< of a log in memory
  std::shared_ptr<const KeptLog> kept;  ///< of a file
  StreamSummary summary;
  Layout layout;  ///< of a pass over everything
  std::vector<FileColumn> file_columns;
  std::vector<const double*> memory_columns;
  Eigen::Index grid_count{0};
  double longest{0.0};  ///< bridged by a spline [s]
  bool logged{false};   ///< motion as logged
  Eigen::RowVectorXd
      position_noise;  ///< standard deviation of the position at rest, where displacements are wanted

  Eigen::VectorXd grid(Eigen::Index first, Eigen::Index count) const {
    return Eigen::VectorXd::LinSpaced(grid_count, summary.begin, summary.end).segment(first, count);
  }
  double grid_time(Eigen::Index row) const { return grid(row, 1)[0]; }

  void prepare_memory(bool every_rate);
  void prepare_file(const LogFile& file, bool every_rate);
  OpenSource open(Wanted wanted) const;
  const LogFacts& facts() const { return memory ? *own_facts : kept->facts(); }
  LogFacts facts_of_memory();
  /// Fits the even grid, finds bandwidth, top speeds and standstill of rows that were checked.
  void first_pass();
  void distrust_logged_rates(std::vector<MovingSpan>& spans);
  void fit_grid();
  LogGrid grid_of_log() const;
  std::vector<TimeGap> gaps_of_log(double longest_step) const;
  void find_cutoff(const Eigen::RowVectorXd& mean);
  double bandwidth_of_log(const Eigen::RowVectorXd& mean) const;
  void find_speeds(std::vector<MovingSpan>& spans) const;
  void derive_speeds(std::vector<MovingSpan>& spans) const;
  void find_standstill(const std::vector<MovingSpan>& spans);
  Eigen::Index margin_rows() const;
  Window window_of(Eigen::Index first, Eigen::Index chunk, Eigen::Index margin) const;
  /// Windows of a pass one by one, in time order, those wholly inside a gap left out.
  class Walk {
   public:
    Walk(const Impl& stream, Wanted wanted, Eigen::Index chunk, Eigen::Index margin);
    /// @return false at the end
    /// @throws DataError when the log is no longer the one that the first pass read
    bool next(Window& window);
    /// Bytes of a window, about.
    double window_bytes() const;

   private:
    bool read();
    Eigen::Index row_at(double time) const;
    void read_around(double from, double to, Eigen::Index last);
    bool skip_gap(double from, double to);

    const Impl& stream_;
    OpenSource pass_;
    RowBuffer rows_;
    Eigen::Index chunk_, margin_, reach_;
    Eigen::Index first_{0};
    bool at_end_{false};
  };
  /// Calls `use` with what `work` made of each window: `work` on several threads, `use` in time order.
  template <typename Result, typename Work, typename Use>
  void walk(Wanted wanted, Eigen::Index chunk, Eigen::Index margin, const Work& work, const Use& use) const {
    // A piece of a log is some megabytes, with what is made of it several times as much: memory must not grow with the
    // number of processors.
    constexpr double kMostBytes = 1e8;
    constexpr double kCopies = 6.0;
    Walk windows(*this, wanted, chunk, margin);
    const auto most = static_cast<std::size_t>(std::max(2.0, kMostBytes / (kCopies * windows.window_bytes())));
    host::for_each_in_order<Window, Result>(
        most, [&](Window& window) { return windows.next(window); }, work, use);
  }
  void refuse_other_length(Eigen::Index rows) const;
  /// Rows first .. first + count of the window's grid, of so many columns.
  Eigen::MatrixXd on_grid(const Window& window, Eigen::Index column, Eigen::Index columns, Eigen::Index first,
                          Eigen::Index count) const;
  /// `f` of the positions on the window's grid, which are no copy where it is the log's own.
  template <typename F>
  auto of_positions(const Window& window, const F& f) const {
    if (!summary.resampled) return f(window.values.leftCols(layout.q));
    return f(on_grid(window, 0, layout.q, 0, window.grid.size()));
  }
  DerivedMotion motion(const Window& window) const;
  Eigen::Array<bool, Eigen::Dynamic, 1> outside_gaps(const Window& window) const;
  MotionChunk chunk(const Window& window) const;
  bool wants_displacement(Eigen::Index velocities) const {
    return options.displacement && velocities == layout.q;
  }
  void add_displacement(const Window& window, Eigen::Index lo, Eigen::Index size, MotionChunk& chunk) const;
};

}  // namespace heft::data
