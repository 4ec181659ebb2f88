/// A motor that turns with two joints which are not those of a usual wrist.
#include <gtest/gtest.h>

#include "heft/core/effects/arm_effects.hpp"
#include "heft/diagnose/diagnose.hpp"
#include "support/two_link_log.hpp"

namespace heft::diagnose {
namespace {

constexpr GearCoupling<double> kPair{.driving = 0, .driven = 1, .ratio = 0.5};

model::Robot uncoupled_arm() { return test::two_link_with_friction(); }

data::Log log_of(const model::Robot& robot, unsigned seed) {
  test::TwoLinkLog made = test::two_link_motion("coupling", seed);
  made.add_torque(robot);
  made.add_noise(seed + 100);
  return made.log;
}

model::Robot coupled_arm() {
  model::Robot robot = uncoupled_arm();
  robot.couplings = {kPair};
  robot.couplings[0].coulomb_friction = 1.5;
  robot.couplings[0].viscous_friction = 0.8;
  return robot;
}

void expect_found(const Diagnosis& d) {
  ASSERT_EQ(d.findings.size(), 1U);
  const Finding& found = d.findings[0];
  EXPECT_TRUE(found.effect.is<WristCoupling>()) << found.effect.id();
  EXPECT_EQ(found.joint, kPair.driving);
  EXPECT_EQ(found.driven_joint, kPair.driven);
  EXPECT_NEAR(found.parameters[0].second, 1.5, 0.05);
  EXPECT_NEAR(found.parameters[1].second, 0.8, 0.05);
  ASSERT_EQ(d.after.couplings.size(), 1U);
  EXPECT_EQ(d.after.couplings[0].driving, kPair.driving);
  EXPECT_EQ(d.after.couplings[0].driven, kPair.driven);
  EXPECT_EQ(d.after.couplings[0].ratio, kPair.ratio);
}

TEST(Coupling, OfAPairAskedForIsFound) {
  DiagnoseOptions options;
  options.couplings = {kPair};
  expect_found(diagnose(uncoupled_arm(), {log_of(coupled_arm(), 1)}, {log_of(coupled_arm(), 2)}, options));
}

TEST(Coupling, OfTheRobotsOwnPairIsFoundAnew) {
  model::Robot robot = uncoupled_arm();
  robot.couplings = {kPair};  // a model file names the pair
  expect_found(diagnose(robot, {log_of(coupled_arm(), 1)}, {log_of(coupled_arm(), 2)}));
}

TEST(Coupling, IsNotSoughtInAnArmWithoutAWrist) {
  const Diagnosis d = diagnose(uncoupled_arm(), {log_of(coupled_arm(), 1)}, {log_of(coupled_arm(), 2)});
  for (const Finding& f : d.findings) EXPECT_FALSE(f.effect.is<WristCoupling>());
}

}  // namespace
}  // namespace heft::diagnose
