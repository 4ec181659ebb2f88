/// Exciting motions of the robots in urdf/: no link touches another, speed and limits are kept by the simulated arm. Read
/// from the URDF with urdfdom and placed by KDL, with distances of its own: nothing of the planner's is used.
#include <algorithm>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/model/dynamics.hpp"
#include "safety_check.hpp"

namespace heft::excite {
namespace {

class EveryRobot : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryRobot, MovesSafelyInSimulation) { design_and_look(GetParam(), 1); }

INSTANTIATE_TEST_SUITE_P(Robots, EveryRobot,
                         ::testing::Values("kawasaki6r", "panda", "scara", "ur10e", "ur5", "ur5e"),
                         [](const auto& robot) { return std::string(robot.param); });

// The same arm without regard for itself: the check above must find what the motion of earlier versions did.
TEST(PlainArm, FindsTheCollisionsOfAMotionThatMindsNone) {
  const model::Robot robot = urdf::load_urdf(path_of("ur10e"));
  MotionLimits limits = limits_of(robot, {.full_turns = true,
                                          .tool_speed = std::numeric_limits<double>::infinity(),
                                          .shapes = {},
                                          .without_bodies = true});
  const ExcitationDesign design(robot, limits, quick(1).search);
  const ExcitationTrajectory motion = design.optimize().trajectory;
  const PlainArm arm(path_of("ur10e"));
  VectorXd q, qd, qdd;
  double least = 1.0, fastest = 0.0;
  for (double t = 0.0; t < motion.duration; t += 0.05) {
    motion.evaluate(t, q, qd, qdd);
    least = std::min(least, arm.smallest_distance(q));
    fastest = std::max(fastest, arm.largest_speed(q, qd));
  }
  EXPECT_LT(least, 0.0) << "the wrist goes through the upper arm";
  EXPECT_GT(fastest, kToolSpeed);
}

TEST(FrictionStrokes, AreSafeBothWaysAtEverySpeedAndLeadBack) {
  const model::Robot robot = urdf::load_urdf(path_of("ur5e"));
  const MotionLimits limits = safe_limits(robot, path_of("ur5e"));
  FrictionOptions options;
  options.speeds = 3;
  options.longest_stroke = 1.0;
  options.from = VectorXd(Eigen::Vector<double, 6>(0.0, -1.57, 1.57, 0.0, 0.5, 0.0));
  const FrictionMotion motion = friction_strokes(robot, limits, options);
  ASSERT_EQ(motion.strokes.size(), 6U * 3U * 2U);
  VectorXd q, qd, qdd;
  for (const Stroke& stroke : motion.strokes) {
    for (const double part : {0.01, 0.5, 0.99}) {
      motion.path.evaluate(stroke.begin + part * (stroke.end - stroke.begin), q, qd, qdd);
      for (int j = 0; j < 6; ++j) EXPECT_NEAR(qd[j], j == stroke.joint ? stroke.speed : 0.0, 1e-9);
      EXPECT_NEAR(qdd.norm(), 0.0, 1e-9);
      EXPECT_NEAR(q[stroke.joint], stroke.from + part * (stroke.to - stroke.from), 1e-9);
    }
  }
  for (std::size_t k = 0; k < motion.strokes.size(); k += 2)
    EXPECT_EQ(motion.strokes[k].speed, -motion.strokes[k + 1].speed);
  for (const double t : {0.0, motion.path.duration()}) {
    motion.path.evaluate(t, q, qd, qdd);
    EXPECT_LT((q - *options.from).norm(), 1e-9);
    EXPECT_LT(qd.norm() + qdd.norm(), 1e-9);
  }
  expect_safe("ur5e", robot, limits, motion.rehearsal->log, "strokes ");
}

TEST(SafeWay, GoesRoundAnObstacleThatTheStraightWayHits) {
  const model::Robot robot = urdf::load_urdf(path_of("ur10e"));
  MotionLimits limits = safe_limits(robot, path_of("ur10e"));
  const VectorXd from = Eigen::Vector<double, 6>(-1.0, -0.6, 0.8, 0.3, 0.5, 0.0);
  VectorXd to = from;
  to[0] = 1.0;
  EXPECT_EQ(safe_way(robot, limits, "way", from, to).size(), 1U) << "nothing in between";
  // A post where the outstretched arm passes.
  limits.obstacles = {{"post", Vector3d(-1.0, -0.1, 0.0), Vector3d(-0.8, 0.1, 1.0)}};
  const std::vector<Piece> way = safe_way(robot, limits, "way", from, to);
  EXPECT_GT(way.size(), 1U);
  collision::ArmCapsules arm = limits.arm;
  VectorXd q, qd, qdd, last = from;
  for (const Piece& piece : way) {
    piece.at(0.0, q, qd, qdd);
    EXPECT_LT((q - last).norm(), 1e-9) << "pieces follow one another";
    for (double t = 0.0; t <= piece.duration; t += 0.01) {
      piece.at(t, q, qd, qdd);
      const collision::LinkFrames frames(robot, q);
      for (const collision::Capsule& capsule : arm.capsules) {
        if (capsule.link <= 0) continue;
        EXPECT_GT(collision::distance(frames, capsule, limits.obstacles[0]).distance, 0.0);
      }
    }
    piece.at(piece.duration, last, qd, qdd);
  }
  EXPECT_LT((last - to).norm(), 1e-9);
}

std::string refusal(const model::Robot& robot, const MotionLimits& limits, const Options& options) {
  try {
    design(robot, limits, options);
  } catch (const NotIdentifiableError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(Design, RefusesWhereThereIsNoSafeMotionAndNamesTheLimit) {
  using ::testing::HasSubstr;
  const model::Robot robot = urdf::load_urdf(path_of("ur5e"));
  MotionLimits limits = safe_limits(robot, path_of("ur5e"));
  limits.obstacles = {{"wall", Vector3d(-2, -2, -1), Vector3d(2, 2, 3)}};
  EXPECT_THAT(refusal(robot, limits, quick(1)),
              ::testing::AllOf(HasSubstr("no safe motion"), HasSubstr("from wall")));
  limits = safe_limits(robot, path_of("ur5e"));
  Options options = quick(1);
  options.from = VectorXd(Eigen::Vector<double, 6>(0.0, -1.5, 2.9, 0.0, 0.0, 0.0));
  EXPECT_THAT(
      refusal(robot, limits, options),
      ::testing::AllOf(HasSubstr("pose to come from"), HasSubstr("distance of"), HasSubstr("in rad")));
  options = quick(1);
  options.payload = {500.0, Vector3d(0.2, 0.2, 0.2)};  // of an arm for 5 kg
  EXPECT_THAT(refusal(robot, limits, options), HasSubstr("torque of joint"));
}

TEST(Design, PayloadCountsInTheTorques) {
  const model::Robot robot = urdf::load_urdf(path_of("ur5e"));
  const model::Robot loaded = model::with_load(robot, {3.0, Vector3d(0.0, 0.0, 0.1)});
  // Stretched out level: the weight at its distance from the shoulder, on top of the bare arm's torque.
  const VectorXd level = VectorXd::Zero(6);
  const double more =
      model::Dynamics(loaded).gravity_torque(level)[1] - model::Dynamics(robot).gravity_torque(level)[1];
  // Level distance of shoulder and load: upper arm, forearm; wrist 2 hangs down, wrist 3 points sideways.
  EXPECT_NEAR(std::abs(more), 3.0 * 9.81 * (0.425 + 0.3922), 1e-6);
}

TEST(Programs, AreWhatControllersRead) {
  using ::testing::HasSubstr;
  const model::Robot robot = urdf::load_urdf(path_of("ur5e"));
  PiecewiseMotion motion;
  motion.add(line_piece("line", VectorXd::Zero(6), VectorXd::Constant(6, 0.5), 1.0));
  const data::Log log = log_of(robot, motion, 50.0);
  const std::string script = to_urscript(log);
  EXPECT_THAT(script, ::testing::AllOf(
                          HasSubstr("def heft_motion():"), HasSubstr("t=0.02"), HasSubstr("halt"),
                          HasSubstr("servoj([0.500000, 0.500000, 0.500000, 0.500000, 0.500000, 0.500000]")));
  EXPECT_EQ(std::count(script.begin(), script.end(), '\n'), 51 + 12 + 3);
  const std::string ros = to_ros_trajectory(log, robot);
  EXPECT_THAT(ros, ::testing::AllOf(HasSubstr("joint_names: [\"shoulder_pan_joint\""),
                                    HasSubstr("time_from_start: {sec: 1, nanosec: 0}"),
                                    HasSubstr("time_from_start: {sec: 0, nanosec: 20000000}")));
  EXPECT_THROW(to_urscript(log_of(robot, motion, 1000.0)), ModelError) << "faster than the controller";
  const model::Robot panda = urdf::load_urdf(path_of("panda"));
  PiecewiseMotion seven;
  seven.add(line_piece("line", VectorXd::Zero(7), VectorXd::Constant(7, 0.5), 1.0));
  EXPECT_THROW(to_urscript(log_of(panda, seven, 50.0)), ModelError);
}

}  // namespace
}  // namespace heft::excite
