/// @file
/// Limits along any motion, given as positions, velocities and accelerations at instants.
#pragma once

#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/collision/collision.hpp"
#include "heft/excite/motion_limits.hpp"
#include "heft/model/dynamics.hpp"

namespace heft::excite {

/// A point that moves with a link has to stay on one side of a plane: normal · P ≥ bound, base frame.
struct Wall {
  int link;
  Eigen::Vector3d point;  ///< in the link frame
  Eigen::Vector3d normal;
  double bound;  ///< [m], the radius of the body around the point included
  std::string name;
  bool is_floor;
  double radius;  ///< [m]

  double slack(const collision::LinkFrames& frames) const {
    return normal.dot(frames.at(link, point)) - bound;
  }
};

/// A point whose speed is limited.
struct SpeedPoint {
  int link;
  Eigen::Vector3d point;  ///< in the link frame
  std::string name;
};

/// Where a motion is nearest to leaving the limits. Slack is a share of the limit, for distances of the clearance.
struct Closest {
  double slack{0.0};
  std::string what;
  Eigen::Index row{0};  ///< instant
};

/// Positions, velocities and accelerations at instants, m × n each.
struct Samples {
  Eigen::MatrixXd q, qd, qdd;
};

/// The limits of a robot less their margin, ready to be looked at.
class LimitCheck {
 public:
  /// Chooses the pairs of capsules that are watched.
  /// @param share  of every clearance that is asked for
  /// @throws ModelError as check_limits, or when a floor is stated without gravity
  LimitCheck(const model::Robot& robot, const MotionLimits& limits, double share = 1.0);

  /// Smallest slack over instants; stops at the first below `enough`.
  Closest closest(const Samples& motion, double enough) const;
  /// Slack of standing still at q.
  Closest closest_at_rest(const Eigen::VectorXd& q) const;
  /// Position limits, walls, links against one another and obstacles alone: what a pose can break.
  double pose_slack(const Eigen::VectorXd& q, std::string* what = nullptr) const;
  /// The same with the frames at q.
  double pose_slack(const collision::LinkFrames& frames, const Eigen::VectorXd& q, std::string* what) const;

  InSpace in_space(const Eigen::VectorXd& q, const Eigen::VectorXd& qd) const;
  /// @param tau  m × n, or empty: torque is then what the model predicts
  LimitUse use_of(const Samples& motion, const Eigen::MatrixXd& tau = {}) const;

  /// Torque without Coulomb friction [N·m, N], n.
  Eigen::VectorXd torque_without_coulomb(const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                                         const Eigen::VectorXd& qdd) const;

  int n() const { return static_cast<int>(middle.size()); }

  model::Robot robot;
  MotionLimits limits;
  // Less the margin.
  Eigen::VectorXd middle, half, velocity, acceleration, torque;
  Eigen::VectorXd coulomb;
  double tool_speed{0.0};
  std::vector<Wall> walls;         ///< that the motion can do something about
  std::vector<SpeedPoint> points;  ///< likewise; empty without a limit of speed
  bool has_space{false};           ///< anything but the joints themselves is limited

 private:
  void add_walls(int link, const Eigen::Vector3d& point, double radius, const std::string& name);
  void place_walls();
  void place_points();
  void keep_what_varies();

  model::Dynamics dynamics_;
  model::Dynamics smooth_;  ///< of the robot without Coulomb friction
  Eigen::Vector3d up_{Eigen::Vector3d::Zero()};
};

/// A random position in the range, or over a share of it.
Eigen::VectorXd random_position(std::mt19937_64& random, const Eigen::VectorXd& middle,
                                const Eigen::VectorXd& half, double share);

}  // namespace heft::excite
