/// @file
/// Torque of rival explanations along a motion.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heft/excite/separate.hpp"
#include "heft/model/dynamics.hpp"
#include "limit_check.hpp"

namespace heft::excite {

/// A sampled motion with the torque of the rigid bodies.
struct RivalMotion {
  Samples at;            ///< m × n each
  Eigen::VectorXd time;  ///< m [s]
  Eigen::MatrixXd load;  ///< m × n [N·m, N]
};
RivalMotion rival_motion(const model::Dynamics& dynamics, Samples samples, double rate);

/// Torque of a rival with the parameters it has, m × n each: one matrix, or several for a function that is not known.
std::vector<Eigen::MatrixXd> own_torque(const model::Robot& robot, const Rival& rival,
                                        const RivalMotion& motion);

/// Columns of a rival's family: for each value of its shape the columns that its free coefficients multiply, m × n each.
std::vector<std::vector<Eigen::MatrixXd>> family(const model::Robot& robot, const Rival& rival,
                                                 const RivalMotion& motion);

/// Whether a motion can be designed for that kind.
bool is_separable(const std::string& kind);

}  // namespace heft::excite
