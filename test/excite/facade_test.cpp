/// What the facade makes of the torque sensor's place, limits from a file, logs already taken and poses.
#include <cstddef>
#include <optional>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/excite/excite.hpp"
#include "heft/host/parallel.hpp"
#include "support/arms.hpp"

namespace heft::excite {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

/// Two joints that share a motor, with friction.
model::Robot arm() {
  model::Robot robot = test::planar_two_link();
  for (model::RobotJoint& joint : robot.joints) {
    joint.lower = -2.0;
    joint.upper = 2.0;
    joint.velocity_limit = 2.0;
    joint.effort_limit = 80.0;
    joint.actuation = {0.0, 1.0, 0.5, 0.0};
  }
  robot.couplings = {{.driving = 0, .driven = 1, .coulomb_friction = 0.5, .viscous_friction = 0.2}};
  return robot;
}

MotionLimits limits() { return limits_of(arm(), {.shapes = {}, .without_bodies = true}); }

/// The cheapest search there is: what is asked of it is not its motion.
Options quick() {
  Options options;
  options.search.duration = 5.0;
  options.search.harmonics = 3;
  options.search.starts = options.search.finalists = 1;
  options.search.iterations = 2;
  options.rehearse = false;
  return options;
}

TEST(TorqueAt, TheMotorGivesColumnsForFrictionAndTheRobotsCouplings) {
  const ExcitingMotion motion = design(arm(), limits(), quick());
  const ModelStructure& structure = motion.design->options().structure;
  EXPECT_TRUE(structure.coulomb);
  EXPECT_TRUE(structure.viscous);
  EXPECT_THAT(structure.couplings, SizeIs(1));
}

TEST(TorqueAt, AJointSensorGivesRigidBodiesOnly) {
  Options options = quick();
  options.torque_at = data::TorqueAt::kJoint;
  options.search.structure.couplings = arm().couplings;
  const ExcitingMotion motion = design(arm(), limits(), options);
  const ModelStructure& structure = motion.design->options().structure;
  EXPECT_FALSE(structure.coulomb);
  EXPECT_FALSE(structure.viscous);
  EXPECT_THAT(structure.couplings, IsEmpty());
}

TEST(LimitsOfAFile, GiveStartAndNoiseWhereNoneIsAskedFor) {
  const LimitsFile file{limits(), Vector2d(0.3, -0.2), Vector2d(0.4, 0.5)};
  const ExcitingMotion motion = design(arm(), file, quick());
  EXPECT_EQ(motion.design->options().start, file.start);
  EXPECT_EQ(motion.design->torque_noise(), file.torque_noise);
  EXPECT_EQ(motion.noise, ExcitingMotion::Noise::kStated);
  Options asked = quick();
  asked.search.start = Vector2d(0.1, 0.1);
  EXPECT_EQ(design(arm(), file, asked).design->options().start, asked.search.start);

  FrictionOptions strokes;
  strokes.speeds = 1;
  strokes.rehearse = false;
  EXPECT_EQ(friction_strokes(arm(), file, strokes).pose, file.start);
  strokes.pose = Vector2d(0.1, 0.1);
  EXPECT_EQ(friction_strokes(arm(), file, strokes).pose, strokes.pose);
}

TEST(GivenMotions, AreThinnedToAHundredRowsASecond) {
  constexpr Index kRows = 1001;
  data::Log log;
  log.path = "fast";
  log.time = VectorXd::LinSpaced(kRows, 0.0, 1.0);  // 1 kHz
  log.q = log.qd = log.qdd = MatrixXd(kRows, 2);
  for (int j = 0; j < 2; ++j) {
    const Eigen::ArrayXd phase = 6.0 * log.time.array() + j;
    log.q.col(j) = 0.3 * phase.sin();
    log.qd.col(j) = 1.8 * phase.cos();
    log.qdd.col(j) = -10.8 * phase.sin();
  }
  log.tau = log.q;
  const auto given = given_motions(data::log_set(arm().joint_specs(), {}, {log}));
  ASSERT_THAT(given, SizeIs(1));
  EXPECT_EQ(given[0].name, "fast");
  ASSERT_EQ(given[0].q.rows(), 101);
  EXPECT_NEAR(given[0].seconds, 0.01, 1e-9);
  EXPECT_EQ(given[0].q.row(7), log.q.row(70));
  EXPECT_EQ(given[0].qdd.row(100), log.qdd.row(1000));
}

TEST(PoseCheck, NamesTheLimitThatAPoseMisses) {
  MotionLimits at_rest = limits();
  at_rest.velocity.setConstant(0.1);
  at_rest.torque.setConstant(1e-3);  // the arm's weight needs more: it is not looked at
  const PoseCheck check(arm(), at_rest);
  EXPECT_EQ(check.objection(Vector2d(1.0, 0.5)), "");
  EXPECT_THAT(check.objection(Vector2d(1.0, 1.99)), HasSubstr("position of joint 2")) << "within the margin";
}

TEST(Within, TakesTheRangesOfTheLimits) {
  MotionLimits narrow = limits();
  narrow.lower[1] = -0.5;
  narrow.upper[1] = 0.25;
  const model::Robot robot = within(arm(), narrow);
  EXPECT_EQ(robot.joints[1].lower, -0.5);
  EXPECT_EQ(robot.joints[1].upper, 0.25);
  EXPECT_EQ(robot.joints[0].lower, -2.0);
}

TEST(UrScript, IsObjectedToBeforeAMotionIsDesigned) {
  EXPECT_THAT(urscript_objection(arm(), 100.0), HasSubstr("has 2 joints; URScript drives six"));
  const model::Robot six = test::six_joint_arm();
  EXPECT_EQ(urscript_objection(six, 500.0), "");
  EXPECT_THAT(urscript_objection(six, 501.0), HasSubstr("more than the 500 Hz"));
}

TEST(Threads, OfAnyNumberGiveTheSameMotionToTheLastBit) {
  Options options = quick();
  options.search.starts = 4;
  options.search.finalists = 3;
  options.search.iterations = 4;
  options.compare = 3;
  options.rehearse = true;
  std::optional<ExcitingMotion> alone;
  for (const std::size_t threads : {1U, 2U, 3U, 8U}) {
    host::set_threads(threads);
    ExcitingMotion motion = design(arm(), limits(), options);
    if (!alone) {
      alone = std::move(motion);
      continue;
    }
    EXPECT_EQ(motion.log.q, alone->log.q) << threads;
    EXPECT_EQ(motion.log.tau, alone->log.tau) << threads;
    EXPECT_EQ(motion.random->condition, alone->random->condition) << threads;
  }
  host::set_threads(0);
}

}  // namespace
}  // namespace heft::excite
