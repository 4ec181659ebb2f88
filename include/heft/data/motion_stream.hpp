/// @file
/// A log read piece by piece, with its motion derived: memory does not grow with the log.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/differentiate.hpp"
#include "heft/data/log.hpp"
#include "heft/data/log_checks.hpp"

namespace heft::data {

/// A piece of a log on an even grid, with margins before and after so that zero-phase filters have settled
/// inside it.
struct MotionChunk {
  double sample_rate{0.0};     ///< of the grid [Hz]
  Eigen::Index first{0};       ///< number, counted from the start of the log, of row `begin`
  Eigen::Index begin{0};       ///< first row that belongs to this piece; rows before it are margin
  Eigen::Index count{0};       ///< rows that belong to it; the rest is margin
  Eigen::VectorXd time;        ///< grid, margins included [s]
  Eigen::MatrixXd q, qd, qdd;  ///< derived motion, rows × n
  Eigen::MatrixXd tau;  ///< as logged, brought to the grid, not filtered; 0 columns when the log has none
  /// false: in a gap of time or within three periods of the cut-off of one, or in the standstill that was cut
  /// off; such rows mean nothing to a fit.
  Eigen::Array<bool, Eigen::Dynamic, 1> usable;
  /// The log's own rows of this piece (no margins) and the torque as logged: what an error is measured on.
  Eigen::VectorXd row_time;
  Eigen::MatrixXd row_tau;
  /// Derived motion at row_time where that is not the grid's time of the rows that belong to the piece; otherwise empty.
  Eigen::MatrixXd off_grid_q, off_grid_qd, off_grid_qdd;
  /// Displacements since the row before, on the grid and of the log's own rows, rows × 2 n: the integral of the logged
  /// velocity, then the same held within four standard deviations of the logged position; see displacement_column().
  /// On a grid other than the log's own, turning points between its rows move to the nearest of them.
  /// Friction's memory sees in them how a joint settles, which a low-pass rounds off and the encoder's steps and noise
  /// hide [rad, m]. No columns unless asked for, or without logged velocities.
  Eigen::MatrixXd displacement, row_displacement;
  /// Temperatures of the joints, on the grid and of the log's own rows, rows × n [°C]. No columns unless asked for, or
  /// where the log lacks those of a joint.
  Eigen::MatrixXd temperature, row_temperature;
  /// Other columns of the log that were asked for, on the grid: rows × columns each.
  std::vector<Eigen::MatrixXd> extra;

  /// Derived motion at row_time, rows × n.
  Eigen::Ref<const Eigen::MatrixXd> row_q() const { return at_rows(q, off_grid_q); }
  Eigen::Ref<const Eigen::MatrixXd> row_qd() const { return at_rows(qd, off_grid_qd); }
  Eigen::Ref<const Eigen::MatrixXd> row_qdd() const { return at_rows(qdd, off_grid_qdd); }

 private:
  Eigen::Ref<const Eigen::MatrixXd> at_rows(const Eigen::MatrixXd& on_grid, const Eigen::MatrixXd& off_grid) const {
    if (off_grid.cols() > 0) return off_grid;
    return on_grid.middleRows(begin, count);
  }
};

/// How a stream derives motion and what it leaves out.
struct StreamOptions {
  MotionOptions motion{};  ///< cut-off etc.; `from_position` is decided by `prefer_logged`
  /// Take qd and qdd as logged where the log has both and they agree with q (LogCheck::unusable_rate); otherwise they
  /// come from q. A velocity alone is not taken: drives report it late against the position, or noisier than its
  /// derivative.
  bool prefer_logged{true};
  bool cut_standstill{true};  ///< mark standstill at the ends as not usable
  bool displacement{false};   ///< fill in MotionChunk::displacement where the log has velocities
  bool temperature{false};    ///< fill in MotionChunk::temperature where the log has it
  /// No joint faster: standstill [rad/s, m/s]. 0: 1 % of the joint's top speed in the log. Joints that travel
  /// less than 0.01 rad (m), or a hundredth of the largest travel, do not count: their top speed is noise.
  double standstill_speed{0.0};
  /// Groups of extra columns wanted ("qref", "qlink"), which may be channels of Log: columns name1,
  /// name2, ... up to the first that is missing; a group that the log lacks gives a matrix without columns.
  std::vector<std::string> extra{};
  Eigen::Index chunk_samples{16384};  ///< rows a piece at least
  /// Rows handed out before and after a piece [s]; 0: 14 periods of the cut-off, in which a zero-phase filter
  /// of that cut-off forgets to 1e-14 that the piece was cut. Pieces are at least twice as long as a margin.
  double margin{0.0};
};

/// What is known of the whole log after the first pass.
struct StreamSummary {
  std::string path;
  int num_joints{0};
  long samples{0};
  double begin{0.0}, end{0.0};  ///< time of first and last row [s]
  double sample_rate{0.0};      ///< of the grid [Hz]
  bool resampled{false};
  bool velocity_logged{false}, acceleration_logged{false};  ///< and used
  bool temperature_logged{false};                           ///< of every joint, and asked for
  double cutoff{0.0};  ///< asked for or chosen [Hz], 0: none; logged motion is not filtered
  bool cutoff_chosen{false};
  double bandwidth{0.0};                    ///< [Hz]
  double moving_from{0.0}, moving_to{0.0};  ///< standstill outside of it [s]
  std::vector<TimeGap> gaps;                ///< at most the first 100
  Eigen::VectorXd travel;                   ///< largest minus smallest position of each joint [rad, m]
  Eigen::VectorXd top_speed;                ///< largest |q̇| of the derived motion [rad/s, m/s]
  Eigen::VectorXd max_torque;               ///< largest |τ| as logged [N·m, N]
  std::vector<std::string> notes;           ///< lines worth telling
};

class KeptLog;
struct LogSource;

/// A log as a sequence of pieces. The first pass checks every row and collects the summary.
class MotionStream {
 public:
  /// From a file, which is read once, a pipe too: its rows are kept in a temporary file, in memory where they are few. When
  /// the disk has no place for them, and when the file has changed since, later passes read it again. Times are those of
  /// the samples where the positions show them, otherwise the stamps.
  /// @throws DataError as read_log does.
  MotionStream(const std::string& path, const LogRequirements& needs, const StreamOptions& options = {});
  /// From memory; the same pieces, with times as they are.
  explicit MotionStream(Log log, const StreamOptions& options = {});
  ~MotionStream();
  MotionStream(MotionStream&&) noexcept;
  MotionStream& operator=(MotionStream&&) noexcept;

  const StreamSummary& summary() const;
  /// Unit slips and worthless columns, from what the first pass saw (see LogCheck). The stream itself refuses
  /// none of them: a caller that knows the robot's limits does, with refuse_errors.
  std::vector<LogFinding> check(const JointLimits& limits = {}) const;
  /// Calls `piece` for every piece in time order, one call at a time, not always from the same thread: pieces are derived by
  /// several at once. Pieces wholly inside a gap of time are left out.
  /// @param progress  called with 0..1; may be empty
  /// @throws DataError when the file is no longer the one that the first pass read
  void for_each(const std::function<void(const MotionChunk&)>& piece,
                const std::function<void(double)>& progress = {}) const;
  /// The same in two steps: `work` on several pieces at once, on several threads; `use` with what it made of them, in time
  /// order, one call at a time.
  template <typename Result>
  void for_each(const std::function<Result(const MotionChunk&)>& work, const std::function<void(Result&)>& use,
                const std::function<void(double)>& progress = {}) const {
    for_each_piece([&](MotionChunk& chunk) { return std::make_shared<Result>(work(chunk)); },
                   [&](void* result) { use(*static_cast<Result*>(result)); }, progress);
  }

 private:
  friend MotionStream stream(const LogSource& source, const StreamOptions& options);
  MotionStream(std::shared_ptr<const KeptLog> log, const StreamOptions& options);
  void for_each_piece(const std::function<std::shared_ptr<void>(MotionChunk&)>& work,
                      const std::function<void(void*)>& use, const std::function<void(double)>& progress) const;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace heft::data
