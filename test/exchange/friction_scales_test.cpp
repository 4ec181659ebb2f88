// Friction in parts of a controller's own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/exchange/friction_scales.hpp"
#include "heft/host/error.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/temporary_folder.hpp"

namespace heft::exchange {
namespace {

using ::testing::DoubleNear;
using ::testing::Each;
using ::testing::HasSubstr;

model::Robot ur5e(double coulomb, double viscous) {
  model::Robot robot = urdf::load_urdf(urdf::resolve_robot("ur5e"));
  for (model::RobotJoint& joint : robot.joints)
    joint.actuation = {.rotor_inertia = 0.2, .coulomb_friction = coulomb, .viscous_friction = viscous};
  return robot;
}

TEST(FrictionScales, AreTheArmsFrictionOverTheControllers) {
  const FrictionScales scales = friction_scales(ur5e(3.0, 2.0), ur5e(4.0, 8.0));
  EXPECT_THAT(scales.coulomb, Each(DoubleNear(0.75, 1e-15)));
  EXPECT_THAT(scales.viscous, Each(DoubleNear(0.25, 1e-15)));
}

TEST(FrictionScales, EndWhereTheControllersEndAndSaySo) {
  model::Robot robot = ur5e(3.0, 2.0);
  robot.joints[1].actuation.coulomb_friction = 5.0;
  const std::string text = ur_friction_scales(robot, ur5e(4.0, 8.0)).text;
  EXPECT_THAT(text, HasSubstr("viscous_scale = [0.250, 0.250, 0.250, 0.250, 0.250, 0.250]\n"));
  EXPECT_THAT(text, HasSubstr("coulomb_scale = [0.750, 1.000, 0.750, 0.750, 0.750, 0.750]\n"));
  EXPECT_THAT(text, HasSubstr("shoulder_lift_joint: Coulomb friction is 1.25 of the controller's; the scale ends at 1, 20 % stay"));
}

TEST(FrictionScales, ListFrictionThatTheyCannotExpressAndNothingElse) {
  model::Robot robot = ur5e(3.0, 2.0);
  robot.effects.push_back({joint_effect_kind<LoadFriction>(), 2, {0.1}, {}});
  robot.effects.push_back({joint_effect_kind<Spring>(), 1, {20.0, 0.0}, {}});
  const std::vector<LeftOut> left = ur_friction_scales(robot, ur5e(4.0, 8.0)).left_out;
  ASSERT_EQ(left.size(), 1U);
  EXPECT_EQ(left[0].what, "load_friction");
  EXPECT_EQ(left[0].joint, 2);
}

TEST(FrictionScales, RefuseAControllerWithoutFrictionAndOtherArms) {
  model::Robot other = ur5e(4.0, 8.0);
  other.joints[3].actuation.viscous_friction = 0.0;
  EXPECT_THAT(test::message_of<ModelError>([&] { friction_scales(ur5e(3.0, 2.0), other); }),
              HasSubstr("wrist_1_joint\": found viscous friction 0 in the controller's model"));
  model::Robot negative = ur5e(3.0, 2.0);
  negative.joints[0].actuation.coulomb_friction = -1.0;
  EXPECT_THAT(test::message_of<ModelError>([&] { friction_scales(negative, ur5e(4.0, 8.0)); }),
              HasSubstr("not below zero"));
  const model::Robot panda = urdf::load_urdf(urdf::resolve_robot("panda"));
  EXPECT_THAT(test::message_of<ModelError>([&] { friction_scales(ur5e(3.0, 2.0), panda); }),
              HasSubstr("7 joints; expected the 6"));
  EXPECT_THAT(test::message_of<ModelError>([&] { ur_friction_scales(panda, panda); }), HasSubstr("expected the 6 of an arm"));
  EXPECT_THAT(test::message_of<ModelError>([&] { friction_scales(ur5e(0.0, 0.0), ur5e(4.0, 8.0)); }),
              HasSubstr("found no friction in any joint"));
  EXPECT_THAT(test::message_of<ModelError>([&] { friction_scales(ur5e(4.0, 8.0), ur5e(4.0, 8.0)); }),
              HasSubstr("the same friction to the last digit"));
  model::Robot renamed = ur5e(4.0, 8.0);
  renamed.joints[0].name = "axis1";
  EXPECT_THAT(test::message_of<ModelError>([&] { friction_scales(ur5e(3.0, 2.0), renamed); }), HasSubstr("\"axis1\""));
}

}  // namespace
}  // namespace heft::exchange
