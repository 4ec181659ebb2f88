/// @file
/// The even clock behind time stamps that scatter.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace heft::data {

/// Rows of a log as a clock with an even beat counts and dates them.
struct EvenClock {
  std::vector<double> number;  ///< of each row; lost rows count
  Eigen::VectorXd time;        ///< when the clock beat at each row [s]
};

/// The clock of rows in succession: a line through the stamps of a second (a hundred rows at least) to both sides. Lost rows count:
/// as many as all later stamps say are lost, and before the row that the positions show. O(rows × joints).
/// @param q        positions of these rows, rows × n
/// @param period   of the beat [s]
/// @param longest  a longer step is a gap, behind which the clock starts anew [s]
EvenClock even_clock(const Eigen::VectorXd& time, const Eigen::MatrixXd& q, double period, double longest);

/// Rows before and after a row that decide when its clock beats: those of a longer log may be left out.
Eigen::Index even_clock_margin(double period);

}  // namespace heft::data
