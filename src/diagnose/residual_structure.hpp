/// @file
/// What a residual holds other than noise.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "motion_table.hpp"

namespace heft::diagnose {

/// Noise of each joint's residual that has no memory, n: from third differences of neighbouring rows that count.
/// What a model misses moves with the arm and is as good as constant from sample to sample.
/// @param keep  m × n, 1 or 0: the row counts
Eigen::VectorXd white_noise(const MotionTable& table, const Eigen::MatrixXd& keep,
                            const Eigen::MatrixXd& residual);

/// The same with the strongest line of the spectrum, if it is quicker than motion and no joint's acceleration has it: of a hum an effect
/// explains nothing. What shakes the arm as well, an effect of the motion may seem to explain.
Eigen::VectorXd noise_with_hum(const MotionTable& table, const Eigen::MatrixXd& keep, const Eigen::MatrixXd& residual);

/// Something that a residual goes with.
struct Structure {
  std::string what;       ///< in words
  double share{0.0};      ///< of the residual's squared error that it explains, on blocks not fitted
  double frequency{0.0};  ///< of a line in the spectrum [Hz]; 0: none
};

/// The strongest structure of one joint's residual, strongest first: a line in the spectrum, dependence on
/// position, velocity, time, on other joints' motion, memory.
/// @param keep  m, 1 or 0: the row counts
std::vector<Structure> structures(const MotionTable& table, const Eigen::VectorXd& keep,
                                  const Eigen::VectorXd& residual, int joint);

}  // namespace heft::diagnose
