/// Headers that `heft export` wrote while this test was built, against the robots they come from.
#include <cstddef>

#include <gtest/gtest.h>

#include "exported/franka.hpp"
#include "exported/scara.hpp"
#include "heft/urdf/urdf_import.hpp"

namespace heft {
namespace {

/// Every number of a description against the URDF's; `snap` is what may have been rounded to 0 or ±1.
template <typename Description>
void expect_same(const model::Robot& robot) {
  constexpr auto kModel = Description::kModel;  // a constant expression, or this does not compile
  ASSERT_EQ(robot.num_joints(), kModel.kNumJoints);
  constexpr double kSnap = 1e-12;
  for (std::size_t j = 0; j < kModel.joints.size(); ++j) {
    const auto& joint = robot.joints[j].joint;
    EXPECT_EQ(kModel.joints[j].type, joint.type);
    EXPECT_EQ(kModel.joints[j].position, joint.position);
    EXPECT_EQ(kModel.links[j], robot.joints[j].link);
    for (std::size_t k = 0; k < 9; ++k) EXPECT_NEAR(kModel.joints[j].rotation[k], joint.rotation[k], kSnap);
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(kModel.joints[j].axis[k], joint.axis[k], kSnap);
    EXPECT_EQ(kModel.actuation[j].rotor_inertia, robot.joints[j].actuation.rotor_inertia);
    EXPECT_EQ(kModel.actuation[j].coulomb_friction, robot.joints[j].actuation.coulomb_friction);
    EXPECT_EQ(kModel.actuation[j].viscous_friction, robot.joints[j].actuation.viscous_friction);
    EXPECT_EQ(kModel.actuation[j].friction_offset, robot.joints[j].actuation.friction_offset);
  }
  EXPECT_EQ(kModel.gravity, robot.gravity);
  EXPECT_EQ(Description::kTipPosition, robot.tip_position);
}

TEST(ExportedArm, IsTheRobotOfTheUrdf) {
  expect_same<exported::Franka>(urdf::load_urdf(urdf::resolve_robot("panda")));
  expect_same<exported::Scara>(urdf::load_urdf(urdf::resolve_robot("scara")));
}

}  // namespace
}  // namespace heft
