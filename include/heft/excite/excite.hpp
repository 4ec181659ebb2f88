/// @file
/// Motions that reveal the parameters of an arm, checked before anyone runs them: the facade of this room.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/log.hpp"
#include "heft/data/log_set.hpp"
#include "heft/excite/excitation_design.hpp"
#include "heft/excite/motion.hpp"
#include "heft/excite/motion_limits.hpp"
#include "heft/host/verdict.hpp"
#include "heft/model/point_load.hpp"
#include "heft/model/robot.hpp"

namespace heft::excite {

/// A load on the flange.
using Payload = model::PointLoad;

/// Purpose of a motion, and the pose of the arm before it. Limits are separate: limits_of, read_limits.
struct Options {
  /// Its structure gets the robot's gear couplings where it names none.
  ExcitationOptions search;
  /// Where torque will be measured. A sensor behind the gears sees neither friction nor couplings: no columns for them.
  data::TorqueAt torque_at{data::TorqueAt::kMotor};
  Payload payload;                      ///< carried along; counts in every torque
  std::optional<Eigen::VectorXd> from;  ///< the arm is here before and after, n [rad, m]
  double rate{100.0};                   ///< rows a second of the log [Hz]
  bool rehearse{true};                  ///< run on the simulated arm and check the result
  /// Torque noise where `search` states none: this part of each torque limit, where there are limits [%].
  double noise_percent{1.0};
  int compare{0};  ///< random motions inside the same limits to compare with
  /// Motion of logs already taken: q, q̇, q̈ (m × n) and the time that a row represents [s].
  struct Given {
    std::string name;
    Eigen::MatrixXd q, qd, qdd;
    double seconds{0.0};
  };
  std::vector<Given> given;
  std::function<void(double)> progress{};  ///< called with 0..1, from the calling thread
};

/// The motion of each log of a set. A log of 200 Hz and faster is thinned to 100 to 200 rows a second: neighbouring rows of it
/// move alike.
/// @param notes  gets what is worth telling; may be null
std::vector<Options::Given> given_motions(const data::LogSet& logs,
                                          std::vector<std::string>* notes = nullptr);

/// A stretch of a motion.
struct Phase {
  std::string name;
  double begin{0.0}, end{0.0};  ///< [s]
};

/// A motion over time in space, for plots: one row a log row.
struct SpaceRecord {
  /// [m]; NaN where there is nothing to be near to. `link_spare` is beyond the clearance of a pair.
  Eigen::VectorXd link_distance, link_spare, obstacle_distance, height;
  Eigen::VectorXd tool_speed;  ///< [m/s]
};
SpaceRecord in_space(const model::Robot& robot, const MotionLimits& limits, const data::Log& log);

/// A finished motion.
struct Motion {
  model::Robot robot;   ///< with the payload
  MotionLimits limits;  ///< with the pairs of links that are watched
  PiecewiseMotion path;
  std::vector<Phase> phases;
  data::Log log;  ///< time, q, qd, qdd, tau as predicted
  LimitUse use;   ///< of the whole motion
  std::optional<Rehearsal> rehearsal;
  host::Judgement judgement;

  bool usable() const { return judgement.usable(); }
};

/// What random motions inside the same limits would reveal: medians.
struct RandomMotions {
  int count{0};
  double condition{0.0}, mean_std{0.0}, volume_std{0.0};
};

/// An exciting motion with its design.
struct ExcitingMotion : Motion {
  /// Where the torque noise of the design came from.
  enum class Noise { kStated, kShareOfLimits, kOne };
  std::shared_ptr<const ExcitationDesign> design;
  Excitation excitation;
  Noise noise{Noise::kOne};
  double noise_percent{0.0};       ///< of each torque limit, for Noise::kShareOfLimits
  std::vector<std::string> given;  ///< names of the logs that the motion complements
  std::optional<RandomMotions> random;
};

/// Designs an exciting motion, leads to it and back from where the arm is, and rehearses all of it.
/// @throws ModelError as ExcitationDesign; NotIdentifiableError when no safe motion is found, the rehearsal passes a limit
///         (both name it), or the motion leaves parameters undetermined.
ExcitingMotion design(const model::Robot& robot, const MotionLimits& limits, const Options& options = {});
/// The same within the limits of a file, whose start and torque noise hold where `options.search` states none.
ExcitingMotion design(const model::Robot& robot, const LimitsFile& limits, const Options& options = {});

/// Strokes at constant speed both ways, joint by joint, for friction over speed.
struct FrictionOptions {
  int speeds{6};               ///< of each joint, evenly spaced on a logarithmic scale
  double slowest{0.02};        ///< share of the fastest
  double longest_stroke{3.0};  ///< at constant speed [s]
  std::vector<int> joints;     ///< 0-based; empty: all
  Eigen::VectorXd pose;        ///< around which the joints move, the others at rest, n; size 0: chosen
  Payload payload;
  std::optional<Eigen::VectorXd> from;  ///< as Options::from
  double rate{100.0};                   ///< [Hz]
  bool rehearse{true};
  std::uint64_t seed{1};  ///< of the poses tried
};

/// One stretch at constant speed.
struct Stroke {
  int joint{0};                 ///< 0-based
  double speed{0.0};            ///< signed [rad/s, m/s]
  double begin{0.0}, end{0.0};  ///< of the constant speed [s]
  double from{0.0}, to{0.0};    ///< position of the joint there [rad, m]
};

struct FrictionMotion : Motion {
  Eigen::VectorXd pose;
  std::vector<Stroke> strokes;
};

/// @throws as design
FrictionMotion friction_strokes(const model::Robot& robot, const MotionLimits& limits,
                                const FrictionOptions& options = {});
/// The same within the limits of a file, whose start is the pose where `options` states none.
FrictionMotion friction_strokes(const model::Robot& robot, const LimitsFile& limits,
                                const FrictionOptions& options = {});

/// A program for a Universal Robots controller that runs the motion: one servoj a row. It does not move to the first
/// row by itself, since it does not know a safe way there: it stops with a message unless the arm is there.
/// @throws ModelError for a robot without six joints, rows that are not evenly spaced, or less than 2 ms apart
std::string to_urscript(const data::Log& log, const std::string& name = "heft_motion");
/// Why to_urscript() will refuse a motion, to be known before one is designed: "" when it will not.
/// @param rate  rows a second of the motion [Hz]
std::string urscript_objection(const model::Robot& robot, double rate);
/// A ROS 2 trajectory_msgs/msg/JointTrajectory in YAML, as `ros2 topic pub` and `ros2 action send_goal` take it.
std::string to_ros_trajectory(const data::Log& log, const model::Robot& robot);

/// The robot with the limits' ranges of the joints in place of its own.
model::Robot within(model::Robot robot, const MotionLimits& limits);

/// Poses that the arm may take: inside the limits less their margin, clear of itself, floor, box and obstacles.
class PoseCheck {
 public:
  /// @param limits  those of speed and torque do not matter: poses are held, not run through
  PoseCheck(const model::Robot& robot, MotionLimits limits);
  ~PoseCheck();
  PoseCheck(PoseCheck&&) noexcept;
  PoseCheck& operator=(PoseCheck&&) noexcept;
  /// The limit that a pose misses by most, in words; "" where it may be taken.
  std::string objection(const Eigen::VectorXd& q) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace heft::excite
