/// @file
/// Logs as one table of motion and torque, cut into blocks that stay together in cross-validation.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/core/effects/effect_point.hpp"
#include "heft/data/motion_stream.hpp"

namespace heft::diagnose {

/// A stretch of one log that is either fitted or judged on, never both.
struct Block {
  Eigen::Index begin{0};
  Eigen::Index count{0};
  int run{0};   ///< which log
  int fold{0};  ///< which share of the blocks it is left out with
};

/// Samples of one or several logs on their even grids, one after the other.
struct MotionTable {
  int num_joints{0};
  double sample_rate{0.0};        ///< of the rows of the first log [Hz]
  double logged_rate{0.0};        ///< of that log [Hz]: its rows may be means of several samples
  std::vector<std::string> runs;  ///< names of the logs
  std::vector<double> run_seconds;
  std::vector<Eigen::Index> run_begin;  ///< first row of each log, and one past the last
  /// The same, and the first row behind each gap that the gap does not reach: how springs swing there nothing before it says.
  std::vector<Eigen::Index> section_begin;
  Eigen::VectorXd time;                 ///< since the begin of its log [s]
  Eigen::MatrixXd q, qd, qdd, tau;      ///< m × n
  Eigen::MatrixXd direction;            ///< m × n: smooth sign of the velocity
  /// m × 2 n, as measured, since the row before, see displacement_column(); no columns unless every log has velocities.
  Eigen::MatrixXd displacement;
  Eigen::MatrixXd temperature;  ///< m × n, of the joints [°C]; no columns unless every log has it
  /// m × n, 1 or 0: the row counts. Near a reversal no log resolves when the sign turns; in gaps and at the ends
  /// the derived motion means nothing.
  Eigen::MatrixXd keep;
  /// m × n, 1 or 0: the joint rests before or after the motion, and between two parts of it. What holds it there only friction
  /// that remembers can say: such rows count together with it, and do not with friction that knows no more than the velocity.
  Eigen::MatrixXd standing, resting;
  /// m, 1 or 0: an error in the row counts, see validate::ScoredTime; and what was made up in a gap of time reaches the row.
  Eigen::VectorXd scored, in_gap;
  std::vector<Block> blocks;
  Eigen::VectorXd sign_width;  ///< n: of the smooth sign [rad/s, m/s]
  /// n: time within which the low-pass of its motion leaves open when a joint turns back, and with it the sign of its
  /// velocity: 1/(2 pi cut-off), of the log where it is longest [s]; 0: no low-pass.
  Eigen::VectorXd turn_seconds;
  Eigen::VectorXd encoder_step;  ///< n: see encoder_steps(); no rows: not known

  Eigen::Index rows() const { return time.size(); }
  /// m, 1 or 0: the joint moves, and turns back within `times` turn_seconds.
  Eigen::VectorXd turns(int joint, double times) const;
  /// Takes the motion of one joint from another table of the same logs, whose low-pass has another cut-off.
  void take_motion(const MotionTable& other, int joint);
};

/// An interval that holds nothing yet.
inline SeenInterval<double> nowhere() {
  return {std::numeric_limits<double>::max(), std::numeric_limits<double>::lowest()};
}
/// Widens an interval by the values of rows that count.
/// @param keep  above 0: the row counts
void widen(SeenInterval<double>& seen, const Eigen::Ref<const Eigen::VectorXd>& values,
           const Eigen::Ref<const Eigen::VectorXd>& keep);

struct TableOptions {
  double cutoff{0.0};         ///< of the low-pass on q [Hz]; 0: chosen by the stream
  double block_seconds{1.0};  ///< length of a block
  int folds{8};
  double reversal_seconds{0.006};  ///< rows nearer than this to a change of direction do not count
  long most_rows{40000};  ///< beyond it neighbouring samples are averaged
};

/// Part of the rows in which an arm moves, 0 to 1, that come as near to a row of another table as the same motion made
/// again does. Positions and velocities count in parts of their scatter; a motion that is another one is at none of its rows
/// near in all joints at once.
double part_repeated(const MotionTable& motion, const MotionTable& of);

/// Columns of a signal on a table's rows as they were `delay` seconds earlier, by straight lines between rows; the
/// first rows of each log, which have nothing earlier, take its first one.
/// @param signal  m × columns
Eigen::MatrixXd earlier(const MotionTable& table, const Eigen::MatrixXd& signal, double delay);
/// The same of positions, velocities or accelerations, by cubics: straight lines blur them between rows, by more or less as a
/// delay falls on rows or between them.
Eigen::MatrixXd earlier_motion(const MotionTable& table, const Eigen::MatrixXd& signal, double delay);
/// earlier() of some rows of one signal.
/// @param signal  m
/// @param from    first row of the result
void put_earlier(const MotionTable& table, const Eigen::Ref<const Eigen::VectorXd>& signal, double delay,
                 Eigen::Index from, Eigen::Ref<Eigen::VectorXd> result);

/// Smallest step between the positions of each joint [rad, m], n: of an encoder that is coarse, its resolution; of one
/// that is not, next to nothing.
Eigen::VectorXd encoder_steps(const data::Log& log);

/// Reads logs into a table.
MotionTable make_table(const std::vector<const data::MotionStream*>& logs, const std::vector<bool>& prismatic,
                       const TableOptions& options);

}  // namespace heft::diagnose
