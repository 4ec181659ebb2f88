/// @file
/// Motions made of pieces that are at rest where they meet, and their rehearsal on a simulated arm.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/log.hpp"
#include "heft/excite/fourier_motion.hpp"
#include "heft/excite/motion_limits.hpp"
#include "heft/model/robot.hpp"
#include "heft/sim/reference.hpp"
#include "heft/sim/simulator.hpp"

namespace heft::excite {

/// One piece of a motion, at rest at both ends.
struct Piece {
  std::string name;
  double duration{0.0};  ///< [s]
  /// @param t         from 0 to the duration [s]
  /// @param q,qd,qdd  out, n
  std::function<void(double t, Eigen::VectorXd& q, Eigen::VectorXd& qd, Eigen::VectorXd& qdd)> at;
};

/// Pieces one after the other, each beginning where the one before ends.
class PiecewiseMotion {
 public:
  void add(Piece piece);
  const std::vector<Piece>& pieces() const { return pieces_; }
  double duration() const { return duration_; }  ///< [s]
  /// @param t  clamped to the motion [s]
  void evaluate(double t, Eigen::VectorXd& q, Eigen::VectorXd& qd, Eigen::VectorXd& qdd) const;

 private:
  std::vector<Piece> pieces_;
  std::vector<double> begins_;
  double duration_{0.0};
};

/// A Fourier series as a piece.
Piece fourier_piece(const std::string& name, const ExcitationTrajectory& motion);
/// A straight line in joint space from rest to rest, a fifth-order polynomial in time.
Piece line_piece(const std::string& name, const Eigen::VectorXd& from, const Eigen::VectorXd& to,
                 double duration);

/// The motion as a log: time, q, qd, qdd, and as tau the torque that the robot's model predicts.
/// @param rate  rows a second
data::Log log_of(const model::Robot& robot, const PiecewiseMotion& motion, double rate);

/// A safe way between two poses: the straight line in joint space where that keeps all limits, else through
/// waypoints (a rapidly exploring random tree from both ends, shortened), each line from rest to rest and as fast as
/// the limits allow. Deterministic.
/// @param name  of the pieces
/// @throws NotIdentifiableError naming the limit when an end cannot be held or no way is found.
std::vector<Piece> safe_way(const model::Robot& robot, const MotionLimits& limits, const std::string& name,
                            const Eigen::VectorXd& from, const Eigen::VectorXd& to);

/// The motion of a log on the simulated arm, under computed torque with the arm's own model and friction; encoders of
/// 2e-5 rad (m), exact velocities, 100 rows a second.
/// @param motion  with q, qd and qdd
sim::SimulationResult replay(const model::Robot& robot, const data::Log& motion);
/// A motion as a simulator's reference.
std::shared_ptr<const sim::Reference> reference_of(const PiecewiseMotion& motion, int num_joints);

/// Outcome of a motion on the simulated arm.
struct Rehearsal {
  LimitUse use;                ///< of the simulated joints; torque is the simulated motors'
  double tracking_error{0.0};  ///< largest distance from the reference [rad, m]
  double shape_distance{0.0};  ///< smallest between the collision shapes themselves, by FCL [m]; NaN: none
  std::string nearest_shapes;
  bool passed{false};
  std::string failure;  ///< the limit that was passed, in words; empty when none was
  data::Log log;        ///< of the simulated arm
};

/// Runs the motion on the simulated arm and checks the outcome: positions, velocities and torques within the limits
/// (the margin is for the controller to use), at least half the clearance between links, from floor, box and obstacles,
/// the speed of the tool, and that no collision shapes touch.
Rehearsal rehearse(const model::Robot& robot, const MotionLimits& limits, const PiecewiseMotion& motion);

}  // namespace heft::excite
