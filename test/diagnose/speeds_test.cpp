/// What depends on speed, in logs that are short or slow.
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

}  // namespace
}  // namespace heft::diagnose
