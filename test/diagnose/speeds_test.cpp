/// What depends on speed, in logs that are short or slow.
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/core/effects/effects.hpp"
#include "heft/diagnose/diagnose.hpp"
#include "support/two_link_log.hpp"

namespace heft::diagnose {
namespace {

/// 24 s of motion, so many times as fast.
data::Log log_of(unsigned seed, double speed, const model::Robot& robot = test::two_link_with_friction()) {
  test::TwoLinkLog made = test::two_link_motion("speed", seed);
  made.log.time /= speed;
  made.qd *= speed;
  made.qdd *= speed * speed;
  made.add_torque(robot);
  made.add_noise(seed);
  return made.log;
}

std::vector<std::string> notes_of(double speed) {
  return diagnose(test::two_link_with_friction(), {log_of(1, 1.0)}, {log_of(2, speed)}).notes;
}

TEST(Speeds, OfTheValidationLogsThatTheTrainingLogsDoNotReachAreNoted) {
  const auto has_note = testing::Contains(testing::AllOf(testing::HasSubstr("joints 1 and 2 move "),
                                                         testing::HasSubstr("times as fast in the validation logs")));
  EXPECT_THAT(notes_of(3.0), has_note);
  EXPECT_THAT(notes_of(1.0), testing::Not(has_note));
}

// A curve has three values to follow chance with, and wants half a minute of motion; but not where it takes most of the error.
TEST(Speeds, ShowInAShortLogACurveThatIsMostOfTheError) {
  model::Robot robot = test::two_link_with_friction();
  JointEffect<double> curve;
  curve.kind = joint_effect_kind<FrictionCurve>();
  curve.joint = 0;
  curve.parameters = {3.0, -3.6, 1.2, 0.7};
  robot.effects = {curve};
  const Diagnosis d = diagnose(test::two_link_with_friction(), {log_of(1, 1.0, robot)}, {log_of(2, 1.0, robot)});
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_TRUE(d.findings.front().effect.is<FrictionCurve>()) << d.findings.front().effect.id();
  EXPECT_EQ(d.findings.front().joint, 0);
}

// Slow motion shows next to nothing of a delay, yet no chance explains that; what it is worth the quick validation log says.
TEST(Speeds, ShowADelayThatSlowTrainingLogsHardlyShow) {
  model::Robot robot = test::two_link_with_friction();
  robot.torque_delay = 0.006;
  const auto noisy = [&](unsigned seed, double speed) {
    data::Log log = log_of(seed, speed, robot);
    std::mt19937 random(seed + 10);
    std::normal_distribution<double> noise(0.0, 1.0);
    for (Eigen::Index k = 0; k < log.tau.rows(); ++k) log.tau.row(k) += Eigen::RowVector2d(0.5 * noise(random), 0.3 * noise(random));
    return log;
  };
  const Diagnosis d = diagnose(test::two_link_with_friction(), {noisy(1, 0.6)}, {noisy(2, 2.0)});
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_TRUE(d.findings.front().effect.is<Delay>()) << d.findings.front().effect.id();
  EXPECT_NEAR(d.findings.front().parameters.front().second, robot.torque_delay, 0.001);
}

// Where motion is slow each shift explains the same, by its coefficient: the search begins far below the true one.
TEST(Speeds, ThatAreLowLeaveADelayAsItIs) {
  model::Robot robot = test::two_link_with_friction();
  robot.torque_delay = 0.006;
  const Diagnosis d = diagnose(test::two_link_with_friction(), {log_of(1, 0.7, robot)}, {log_of(2, 0.7, robot)});
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_TRUE(d.findings.front().effect.is<Delay>()) << d.findings.front().effect.id();
  EXPECT_NEAR(d.findings.front().parameters.front().second, robot.torque_delay, 0.0003);
}

}  // namespace
}  // namespace heft::diagnose
