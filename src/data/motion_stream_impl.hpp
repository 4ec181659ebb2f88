/// @file
/// What the passes of a MotionStream share: its first pass and those that hand out pieces.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "derive_motion.hpp"
#include "heft/data/motion_stream.hpp"
#include "log_file.hpp"
#include "moving_span.hpp"
#include "row_source.hpp"

namespace heft::data {

class SampleClock;

struct MotionStream::Impl {
  /// Columns of a pass, by group, in this order in a RowBuffer.
  struct Layout {
    Eigen::Index q{0}, tau{0}, qd{0}, qdd{0};  ///< columns each
    std::vector<Eigen::Index> extra{};         ///< columns of each group
    Eigen::Index total() const {
      Eigen::Index sum = q + tau + qd + qdd;
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
  StreamSummary summary;
  Layout layout;  ///< of a pass over everything
  std::vector<FileColumn> file_columns;
  std::vector<const double*> memory_columns;
  std::optional<LogCheck> log_check;
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
  /// Checks every row, fits the even grid, finds ranges, bandwidth, top speeds and standstill.
  void first_pass();
  OpenSource open_first();
  void distrust_logged_rates(std::vector<MovingSpan>& spans);
  void fit_grid(SampleClock& clock);
  void find_cutoff(const Eigen::RowVectorXd& mean);
  void find_speeds(std::vector<MovingSpan>& spans) const;
  void find_standstill(const std::vector<MovingSpan>& spans);
  void find_gaps_of_log();
  Eigen::Index margin_rows() const;
  Window window_of(Eigen::Index first, Eigen::Index chunk, Eigen::Index margin) const;
  void walk(Wanted wanted, Eigen::Index chunk, Eigen::Index margin,
            const std::function<void(const Window&)>& use,
            const std::function<void(double)>& progress = {}) const;
  void refuse_other_length(Eigen::Index rows) const;
  Eigen::MatrixXd on_grid(const Window& window, Eigen::Index column, Eigen::Index columns) const;
  DerivedMotion motion(const Window& window) const;
  Eigen::Array<bool, Eigen::Dynamic, 1> outside_gaps(const Window& window) const;
  MotionChunk chunk(const Window& window) const;
  bool wants_displacement(Eigen::Index velocities) const {
    return options.displacement && velocities == layout.q;
  }
  void add_displacement(const Window& window, Eigen::Index lo, Eigen::Index size, MotionChunk& chunk) const;
};

}  // namespace heft::data
