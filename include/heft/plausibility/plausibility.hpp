/// @file
/// Does the torque of a log belong to the robot? Signs, joint order, unit, joint zeros, direction of gravity, gravity left out.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "heft/data/live_log.hpp"
#include "heft/data/log.hpp"
#include "heft/data/motion_stream.hpp"
#include "heft/host/verdict.hpp"
#include "heft/model/robot.hpp"

namespace heft::plausibility {

/// Kinds of contradiction between a torque and the robot.
enum class Contradiction {
  kNoSignal,      ///< the torque of a joint never changes
  kSign,          ///< the torque of a joint has the opposite sign
  kInterchanged,  ///< torques, positions or all columns of two joints are interchanged
  kZero,          ///< a joint counts its position from another zero
  kGravity,       ///< gravity points elsewhere than the robot's mounting says
  kWeightless,    ///< gravity is already compensated in the torque
  kScale,         ///< the torque is too small or too large: another unit, or another side of the gear
  kRobot,         ///< the torque is that of another robot
  kModelTorque    ///< a motor torque without friction: computed by a model, not measured
};

/// One contradiction.
struct Finding {
  Contradiction kind{Contradiction::kSign};
  /// The evidence leaves no reasonable doubt; otherwise it is worth a warning.
  bool clear{false};
  int joint{-1};         ///< counted from 0; -1: the whole arm
  int other{-1};         ///< kInterchanged: the other joint
  double value{0.0};     ///< kSign, kScale: measured over expected torque; kZero: to be added to q [rad]
  double evidence{0.0};  ///< fall of minus twice the log-likelihood when the contradiction is undone
  std::string message;   ///< without the log's path: the likely cause, and what to do
};

/// A joint's measured torque against the torque expected from the robot's masses.
struct JointExpectation {
  double slope{0.0};  ///< measured over expected gravity and inertia torque, friction and offset fitted too
  double slope_std{0.0};     ///< standard deviation of `slope`, with the uncertainty of the robot's masses
  double torque_rms{0.0};    ///< measured [N·m, N]
  double expected_rms{0.0};  ///< gravity and inertia torque [N·m, N]
  bool moving{false};
};

struct TorqueCheck {
  std::string log;
  std::vector<JointExpectation> joints;  ///< n
  std::vector<Finding> findings;         ///< strongest first; empty: nothing speaks against the log

  bool refused() const;
  /// Clear findings are bad, the others doubtful. Reasons name the log.
  host::Judgement judgement() const;
};

struct Options {
  bool at_motor{true};  ///< the torque was measured on the motor's side of the gears, so friction is in it
  /// Robots that the log may belong to instead; asked for only when the torque does not fit. May be empty.
  std::function<std::vector<model::Robot>()> other_robots{};
};

/// Compares the torque of a log with the robot it is said to belong to.
///
/// Every joint is compared by itself with the torque expected from the robot's masses, give or take a quarter of each
/// mass, some centimetres of each centre of mass and a payload of an eighth of the arm, plus friction that takes
/// energy out and an offset. A contradiction is named when undoing it raises the likelihood far beyond what other
/// explanations do; the likelihood is that of residuals correlated in time and of a model that is itself wrong
/// (src/plausibility/README.md). So it works with catalogue masses and placeholders, and stays silent where a log cannot decide:
/// on joints at rest, whose friction holds any torque, and on torque as small as sensor offsets.
///
/// Costs one pass over the log and about a quarter of a second.
///
/// @param robot  with nominal or identified parameters; without any mass nothing is checked
/// @throws DataError as MotionStream does; ModelError for more than model::kMaxJoints joints
TorqueCheck check_torque(const model::Robot& robot, const data::MotionStream& log,
                         const Options& options = {});
TorqueCheck check_torque(const model::Robot& robot, const data::Log& log, const Options& options = {});

/// The same check, and that for unit slips (data::LogCheck), while rows arrive: after 4 s of motion, 8, 16, 32 and 64 s, or at the end,
/// on all rows since the first. It runs beside the caller, who is not held up: what a check finds comes with the first row 1 s later.
///
/// An arm at rest shows nothing: its rows count for no time and are not kept. What rests on the size of a single joint's torque is no
/// clear finding before 8 s: an arm that has hardly moved yet holds its weight by friction.
///
/// @code
/// plausibility::LiveCheck check(robot, "-");
/// for (data::LiveRow row; rows.next(row);)
///   if (const auto found = check.push(row)) plausibility::refuse_contradictions(*found);
/// @endcode
class LiveCheck {
 public:
  /// @param name  of the stream, for messages
  LiveCheck(const model::Robot& robot, std::string name, const Options& options = {});
  ~LiveCheck();

  /// Takes a row, with torque.
  /// @return once: with the first clear finding, or when all checks are done
  /// @throws DataError for a unit slip; as data::LiveClock::push
  std::optional<TorqueCheck> push(const data::LiveRow& row);
  /// The stream ends. @return what push() would have, if it has not yet
  /// @throws DataError for a unit slip
  std::optional<TorqueCheck> end();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// @throws DataError that lists the clear findings, if there are any
void refuse_contradictions(const TorqueCheck& check);

}  // namespace heft::plausibility
