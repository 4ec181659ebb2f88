/// @file
/// The motion and torque of a log, low-passed and thinned out as far as a comparison with masses allows.
#pragma once

#include <Eigen/Core>

#include "heft/data/motion_stream.hpp"

namespace heft::plausibility {

struct Samples {
  Eigen::MatrixXd q, qd, qdd, tau;  ///< rows × n
  double duration{0.0};             ///< time that the rows represent [s]
};

/// Position and torque behind the same zero-phase low-pass of 5 Hz, velocity and acceleration as differences of the
/// former, a few hundred rows spread over the log. Standstill at the ends and gaps of time are left out. Memory does
/// not grow with the log.
Samples samples_of(const data::MotionStream& log);

}  // namespace heft::plausibility
