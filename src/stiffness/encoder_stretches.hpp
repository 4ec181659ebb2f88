/// @file
/// Stretches of a log that the two encoders of a joint saw without gaps, filtered.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heft/data/log.hpp"
#include "heft/stiffness/joint_encoders.hpp"

namespace heft::stiffness {

/// A stretch without gaps on an even grid, one joint.
struct Stretch {
  int log{0};
  double rate{0.0};
  Eigen::VectorXd time;
  std::vector<char> measured;            ///< grid points that represent a sample
  Eigen::VectorXd q, qlink, tau, model;  ///< as read
  Eigen::VectorXd q_smooth, qlink_smooth, qd, direction;
  Eigen::VectorXd torque, instrument;  ///< behind the filter, without rotor inertia
  double torque_noise{0.0};  ///< power of the noise of tau that passes the filter [(N·m)²], at most
};

/// Shortest stretch between gaps that is used [s].
inline constexpr double kShortestStretch = 2.0;

/// Column qlink<joint + 1>, or null.
const Eigen::VectorXd* link_column(const data::Log& log, int joint);

/// Stretches of finite samples of a joint, resampled evenly.
/// @param index  number of the log
/// @param model  torque of a model in the shape of log.tau, or null
std::vector<Stretch> stretches_of(const data::Log& log, int index, int joint, const Eigen::MatrixXd* model);

/// Zero-phase low-pass; the signal itself where the sample rate does not reach beyond the cut-off [Hz].
Eigen::VectorXd smooth(const Eigen::VectorXd& signal, double rate, double cutoff);

/// Bandwidth of the motion of all joints, in the longest stretch without a missing position [Hz].
double bandwidth_of(const data::Log& log);

/// Fills what goes through the filter.
/// @param rotor_inertia  on the link side of the gear [kg·m², kg]
void filter(Stretch& s, double cutoff, double rotor_inertia, const JointEncoderOptions& options);

}  // namespace heft::stiffness
