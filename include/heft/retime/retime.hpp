/// @file
/// How fast can the arm go along this path? Time-optimal motion on a given path under limits of torque, velocity and
/// acceleration.
///
/// @code
/// const retime::Path path = retime::through(robot, data::read_log("points.csv", {}));
/// const retime::Retiming found = retime::retime(robot, path);
/// std::puts(report::full(found).c_str());
/// data::write_log("fast.csv", found.log);
/// @endcode
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/log.hpp"
#include "heft/data/log_set.hpp"
#include "heft/host/numbers.hpp"
#include "heft/host/verdict.hpp"
#include "heft/model/point_load.hpp"
#include "heft/model/robot.hpp"

namespace heft::retime {

/// A path in joint space without time: a cubic spline through points, its parameter s the distance along the chords between
/// them [rad, m mixed]; q, dq/ds and d²q/ds² are continuous, d²q/ds² is 0 at both ends.
struct Path {
  std::string source;         ///< file that it came from; may be empty
  Eigen::VectorXd s;          ///< of the points, increasing from 0, k
  Eigen::MatrixXd points;     ///< k × n [rad, m]
  Eigen::MatrixXd curvature;  ///< d²q/ds² at the points, k × n
  /// The log's time, without standstill of more than half a second at its ends [s]; NaN: not from a log.
  double duration{kNaN};
  /// Largest distance between the path and the log's rows, or between the path and straight lines from waypoint to waypoint
  /// [rad, m].
  double deviation{0.0};
  bool from_log{false};
  std::vector<std::string> notes;  ///< what a user should know

  double length() const { return s[s.size() - 1]; }
  /// @param at          from 0 to length()
  /// @param q,dq,ddq    out, n: position, first and second derivative by s
  void evaluate(double at, Eigen::VectorXd& q, Eigen::VectorXd& dq, Eigen::VectorXd& ddq) const;
};

/// The path through waypoints.
/// @param waypoints  a row a point; its time is not used
/// @param rounding   0: a spline through the points; above: straight lines between the points, their corners cut from so far
///                   before a point to so far behind it, at most to the middle of a line [rad, m]
/// @throws DataError for fewer than two points, two equal points in a row, another number of joints, a rounding below 0, or a
///         path that leaves a joint's range
Path through(const model::Robot& robot, const data::Log& waypoints, double rounding = 0.0);

/// The path that a logged motion took: points at least 0.02 rad (m) apart, so that noise of the encoders does not count;
/// standstill is left out.
/// @throws DataError as data::read, when the log stands still, or a path that leaves a joint's range
Path along(const model::Robot& robot, const data::LogSource& log);

/// What the arm may do.
struct Options {
  /// Limits of the joints: size 0: those of the robot (its URDF), 1: the same for every joint, or n. All > 0, infinite: none.
  std::vector<double> velocity{};      ///< [rad/s, m/s]
  std::vector<double> acceleration{};  ///< [rad/s², m/s²]; a URDF states none
  std::vector<double> torque{};        ///< of the motors, on the joint's side [N·m, N]
  /// Part of every limit that stays unused at least [%], 0 to below 100: what the controller needs beyond the plan, and what the
  /// model may be wrong by. Where the rehearsal needs more, more is left.
  double margin_percent{5.0};
  double speed{1.0};        ///< share of the velocity limits that is used, in (0, 1]
  double rate{100.0};       ///< rows a second of the log [Hz]
  model::PointLoad load{};  ///< carried along the whole path
  bool rehearse{true};      ///< run on the simulated arm and check the result
  /// The model was fitted to sensors behind the gears: it lacks friction and rotors, which the motors have to move.
  bool behind_gears{false};
};

/// Which limit.
enum class Limit { kTorque, kVelocity, kAcceleration };
/// "torque", "velocity" or "acceleration", as in JSON results.
const char* to_string(Limit limit);

/// A stretch of the motion in which one limit decides how fast it is.
struct Stretch {
  double begin{0.0}, end{0.0};  ///< [s]
  int joint{0};                 ///< 0-based
  Limit limit{Limit::kTorque};
};

/// How much of the time a limit decides.
struct Share {
  int joint{0};  ///< 0-based
  Limit limit{Limit::kTorque};
  double share{0.0};
};

/// The motion over the path, at k + 1 places.
struct Profile {
  Eigen::VectorXd s;             ///< places on the path
  Eigen::VectorXd time;          ///< when the arm passes them [s]
  Eigen::VectorXd speed;         ///< ds/dt there [1/s]
  Eigen::VectorXd fastest;       ///< largest ds/dt from which all limits can be kept up to the end
  Eigen::VectorXd acceleration;  ///< d²s/dt² between place i and i + 1, k

  double duration() const { return time[time.size() - 1]; }
  /// @param t  clamped to the motion [s]
  /// @param at,rate,acceleration  out: s, ds/dt, d²s/dt²
  void evaluate(double t, double& at, double& rate, double& acceleration) const;
};

/// The motion on the simulated arm under computed torque with the same model: 1000 samples a second, exact sensors, each sample
/// given the acceleration that leads to the next.
struct Rehearsal {
  Eigen::VectorXd torque, velocity;  ///< largest, n [N·m, N; rad/s, m/s]
  double tracking_error{0.0};        ///< largest distance from the reference [rad, m]
  std::string failure;               ///< the limit that was exceeded, in words; empty: none
  std::string unable;                ///< why the model could not be simulated; empty: it was
  data::Log log;                     ///< of the simulated arm

  bool passed() const { return failure.empty() && unable.empty(); }
};

/// A path with the fastest motion along it.
struct Retiming {
  model::Robot robot;  ///< with the load
  Path path;
  /// Limits without margin, speed share included, n; infinite: none.
  Eigen::VectorXd velocity, acceleration, torque;
  /// Shares of the limits that stay unused, n: the margin asked for, and what the rehearsal needed beyond it.
  Eigen::VectorXd velocity_margin, torque_margin;
  Profile profile;
  /// Largest share of each limit that is used, n, on a grid four times as fine as that of the profile; 0 without a limit.
  Eigen::VectorXd velocity_use, acceleration_use, torque_use;
  std::vector<Stretch> active;
  std::vector<Share> shares;  ///< of the time, the largest first
  double lowered{
      0.0};  ///< largest share by which a limit was lowered in an interval, so that it holds between places, too
  double longer{0.0};  ///< share by which the motion is longer for that
  int sweeps{0};       ///< of the last plan
  data::Log log;       ///< time, q, qd, qdd, tau as predicted; at rest in the last row
  std::optional<Rehearsal> rehearsal;
  host::Judgement judgement;
  std::vector<std::string> notes;

  double duration() const { return profile.duration(); }
  /// Share of the log's duration that is saved; NaN: the path is not from a log.
  double saved() const { return 1.0 - duration() / path.duration; }
  /// false: the simulated arm exceeded a limit.
  bool usable() const { return judgement.usable(); }
};

/// Finds the fastest motion along a path, from rest to rest, on which no limit less its margin is exceeded.
///
/// With x = ṡ² and u = s̈, velocity, acceleration and torque of rigid bodies are linear in (u, x) at each place of the path.
/// Sets of speeds from which the rest can be driven are found backward from the end, then the largest acceleration that stays
/// in them forward from the start (reachability analysis, H. Pham and Q.-C. Pham, IEEE Trans. Robotics 34 (2018) 645-659);
/// limits are kept at both ends of each interval. What is not linear in (u, x), friction over speed and under load, enters by
/// its tangent at the last motion, and the sweep is repeated until the motion stays. The result is checked with the whole
/// torque of the model between the places, too; where a limit is exceeded there, it is lowered for that interval by as
/// much. Elastic joints count as rigid, friction as settled and cold. Where the simulated arm exceeds a limit, since a controller that
/// samples needs more than the plan, that joint's limit is lowered and the motion planned again.
///
/// Cost: about 10⁵ evaluations of the inverse dynamics, some tenths of a second; the rehearsal simulates the motion.
/// @throws ModelError for limits or options out of range, or a joint that nothing limits; NotIdentifiableError when no motion
///         keeps the limits: names the joint and the place
Retiming retime(const model::Robot& robot, const Path& path, const Options& options = {});

}  // namespace heft::retime
