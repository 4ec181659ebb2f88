/// @file
/// What the parts of the study share: the load, the instruments, the zones that table 5 prints.
#pragma once

#include <array>
#include <initializer_list>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "ur5_stiffness_study.hpp"

namespace heft::studies {

inline constexpr double kDegree = std::numbers::pi / 180.0;

/// Angles in rad from degrees.
Eigen::VectorXd degrees(std::initializer_list<double> list);

/// θ2 from, to, θ3 from, to [°].
using ZoneAngles = std::array<double, 4>;
/// The two zones of table 5.
const std::vector<std::pair<std::string, ZoneAngles>>& printed_zones();
/// Whole turns do not count.
bool inside(const ZoneAngles& zone, double theta2, double theta3);
/// Whether joints 2 and 3 of a pose [rad] are in a zone of table 5.
bool in_a_zone(const Eigen::VectorXd& q);
/// Common area over joint area.
double overlap(const ZoneAngles& a, const ZoneAngles& b);

/// Each pose of consecutive rows once.
std::vector<Eigen::VectorXd> poses_of(const std::vector<data::Deflection>& rows);

/// Joints 1 to 3 and joints 4 to 6 of a UR5 have gears of one size each.
std::vector<std::vector<int>> gear_sizes();

/// Readings of a whole deflection or of a wire along (1, 1, 0)/√2, in axes of the tool, at poses under the load (135).
enum class Instrument { kWire, kWireAtCantilever, kWhole };
/// Poses with readings of value 0.
/// @param sigma, sigma_rotation  standard deviations of displacements [m] and rotations [rad]
/// @param length                 as in stiffness::loaded_poses [m]
std::vector<stiffness::LoadedPose> loaded_with(const model::Kinematics& kinematics,
                                               const std::vector<Eigen::VectorXd>& poses,
                                               Instrument instrument, double sigma, double sigma_rotation,
                                               double length);
/// Values of all readings from compliances: δd = J diag(x) Jᵀ w (106).
void set_values(std::vector<stiffness::LoadedPose>& poses, const Eigen::VectorXd& compliance);

}  // namespace heft::studies
