/// @file
/// Limits of a motion.
#pragma once

#include <array>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/collision/collision.hpp"
#include "heft/model/link_shape.hpp"
#include "heft/model/robot.hpp"

namespace heft::excite {

/// Default of MotionLimits::tool_speed [m/s]: the setting with which Universal Robots' controllers are delivered as the limit of
/// the tool's speed. It is a limit for an arm whose surroundings have been assessed, not one that makes contact with
/// people safe: ISO 10218-1 allows 0.25 m/s ("reduced speed") where somebody is near the arm without other measures.
inline constexpr double kToolSpeed = 1.5;

/// Limits of a motion. Vectors of n.
struct MotionLimits {
  Eigen::VectorXd lower, upper;  ///< positions [rad, m], finite, lower < upper
  Eigen::VectorXd velocity;      ///< [rad/s, m/s], > 0 and finite
  Eigen::VectorXd acceleration;  ///< [rad/s², m/s²], > 0, may be infinite
  Eigen::VectorXd torque;        ///< [N·m, N], > 0, may be infinite
  /// Share of every limit that stays unused; of half the range for positions. In [0, 1).
  double margin{0.05};
  /// Speed of the tool, the tip and the origin of every link [m/s]; may be infinite.
  double tool_speed{std::numeric_limits<double>::infinity()};
  /// The links as capsules, kept apart from one another, the floor, the box and the obstacles. Without capsules only
  /// link origins and tool keep clear of floor and box. The pairs that are watched are chosen by whoever checks.
  collision::ArmCapsules arm;
  /// The collision shapes that the capsules are around; a finished motion is checked against them once more.
  std::vector<model::LinkShape> shapes;
  /// Height above the base frame's origin, against gravity, that the arm stays above [m].
  std::optional<double> floor;
  /// Corners of a box in the base frame that the arm stays inside [m]; infinite entries allowed.
  std::optional<std::array<Eigen::Vector3d, 2>> box;
  std::vector<collision::BoxObstacle> obstacles;  ///< that the arm stays outside
  double clearance{0.0};  ///< distance kept between links, and from floor, box and obstacles [m], ≥ 0
  Eigen::Vector3d tool{Eigen::Vector3d::Zero()};  ///< a point of the tool, in the tip frame [m]
  /// Radius of a capsule from the tip to that point, where that is not the tip itself [m].
  double tool_radius{0.05};
};

/// How near a motion comes to the limits, without the margin: 1 is the limit itself. Vectors of n.
struct LimitUse {
  Eigen::VectorXd lowest, highest;                 ///< positions reached [rad, m]
  Eigen::VectorXd position;                        ///< distance from the middle of the range over half of it
  Eigen::VectorXd velocity, acceleration, torque;  ///< largest values [rad/s, rad/s², N·m; m, N]
  double lowest_height{0.0};  ///< of the moving bodies above the base origin [m]; NaN: no floor
  double box_distance{0.0};   ///< smallest distance of the moving bodies from the box's walls [m]; NaN: none
  double link_distance{0.0};  ///< smallest distance between two links that are watched [m]; NaN: none
  double obstacle_distance{0.0};  ///< smallest distance of a link from an obstacle [m]; NaN: none
  double tool_speed{0.0};         ///< largest speed of the tool or a link origin [m/s]
  std::string closest_links;      ///< the two that come nearest to each other
  bool inside{false};             ///< all limits kept with their margin
  std::string worst;              ///< the limit nearest or passed, in words
};

/// Positions and speeds in space that follow from a pose and its velocities.
struct InSpace {
  double link_distance{0.0};      ///< smallest distance between two links that are watched [m]; NaN: none
  double link_spare{0.0};         ///< smallest distance beyond the clearance of its pair [m]; NaN: none
  double obstacle_distance{0.0};  ///< smallest distance of a link from an obstacle [m]; NaN: none
  double height{0.0};             ///< lowest above the base origin [m]; NaN: no floor
  double box_distance{0.0};       ///< smallest distance from the box's walls [m]; NaN: none
  double speed{0.0};              ///< of the fastest of tool, tip and link origins [m/s]
  std::string closest_links;
};

/// Values that limits_of takes where the description of a robot gives none.
struct LimitDefaults {
  bool full_turns{false};  ///< keep ranges beyond ±π of a revolute joint; hoses and cables rarely allow them
  double tool_speed{kToolSpeed};
  std::vector<model::LinkShape> shapes;  ///< urdf::load_shapes; none: capsules are fitted from the kinematics
  /// For simulated arms only: no capsules, and 5 % of the arm's length as clearance of link origins from the floor.
  bool without_bodies{false};
};

/// The URDF's limits. A revolute joint that may turn by more than one turn, or whose limits are not stated, gets ±π
/// (a turn about the middle of its range where that leaves out 0); a prismatic one without limits and a joint without
/// velocity limit stay unbounded, which ExcitationDesign refuses. The floor is the base frame's x-y plane when
/// the base is upright within 45°, else (ceiling, wall, no gravity) there is none. Clearance: 2 % of the arm's
/// length.
MotionLimits limits_of(const model::Robot& robot, const LimitDefaults& defaults = {});

/// Further settings of a limits file (JSON).
struct LimitsFile {
  MotionLimits limits;
  Eigen::VectorXd start;         ///< n, or size 0
  Eigen::VectorXd torque_noise;  ///< n, or size 0
};
/// `limits` with those of a file in their place. Keys: lower, upper, velocity, acceleration, torque, margin, tool_speed,
/// floor, clearance, box, obstacles, tool, tool_radius, start, torque_noise.
/// @throws ModelError naming the file and the key: what was found, what was expected
LimitsFile read_limits(const model::Robot& robot, const std::string& path, MotionLimits limits);

/// @throws ModelError when limits contradict themselves, one another or the robot: which, what was found, what to do
void check_limits(const model::Robot& robot, const MotionLimits& limits);

}  // namespace heft::excite
