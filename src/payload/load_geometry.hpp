/// @file
/// The load's ten parameters seen from the flange, and from the torques.
#pragma once

#include <string>

#include <Eigen/Core>

#include "heft/model/dynamics.hpp"
#include "heft/model/robot.hpp"
#include "heft/statistics/interval.hpp"

namespace heft::payload {

/// Ten parameters about the last link frame into ten about the flange frame.
Eigen::Matrix<double, 10, 10> to_flange(const model::Robot& robot);

/// Whether some motion shows the mass in the rows of joints first..n: its column over random states does
/// not lie in the span of the other nine.
/// @param first  from 0
bool mass_is_visible(const model::Dynamics& dynamics, int first);
/// What to say where it is not; joints from 1.
std::string hidden_mass(int first, int last);
/// "joints 2 to 6".
std::string joint_range(int first, int last);

/// Standard deviation of the change of friction that joints first..n may have against the model [N·m, N·m·s/rad]: as much as
/// there is, or what the scatter of the torque suggests; next to nothing behind the gears, where there is no friction.
/// @param first  from 0
double friction_prior(const model::Robot& robot, int first, const Eigen::VectorXd& residual_std,
                      bool behind_gears);

/// Coordinate of the centre of mass c = h/m, with δc = (δh − c δm)/m; no number while the mass is not clear of zero.
/// @param parameters,covariance  of the load about the flange
/// @param row                    of the first moment h: 1 to 3
statistics::Interval centre_of_mass(const Eigen::VectorXd& parameters, const Eigen::MatrixXd& covariance,
                                    Eigen::Index row, const statistics::Interval& mass,
                                    double factor = statistics::kNormal95);

}  // namespace heft::payload
