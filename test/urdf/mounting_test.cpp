/// Mountings of a base, against turns that can be seen without a calculation.
#include "heft/urdf/mounting.hpp"

#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

namespace heft {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;

constexpr double kQuarter = std::numbers::pi / 2.0;

TEST(Mounting, TurnsAboutTheAxesOfTheWorldOneAfterTheOther) {
  const double roll = 0.3, pitch = -0.7, yaw = 1.9;
  const auto found = urdf::mount_rotation(roll, pitch, yaw);
  const Eigen::Matrix3d expected =
      (Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
       Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(found.data());
  EXPECT_LT((R - expected).cwiseAbs().maxCoeff(), 1e-15);
}

TEST(Mounting, GravityIsSeenFromTheBase) {
  const auto near = [](double value) { return DoubleNear(value, 1e-12); };
  EXPECT_THAT(urdf::gravity_in_base(urdf::mount_rotation(0, 0, 1.0)),
              ElementsAre(near(0), near(0), near(-9.81)));
  // Under the ceiling it points out of the base.
  EXPECT_THAT(urdf::gravity_in_base(urdf::mount_rotation(2.0 * kQuarter, 0, 0)),
              ElementsAre(near(0), near(0), near(9.81)));
  // On a wall, turned about x: the base's y points up.
  EXPECT_THAT(urdf::gravity_in_base(urdf::mount_rotation(kQuarter, 0, 0)),
              ElementsAre(near(0), near(-9.81), near(0)));
}

TEST(Mounting, OfARobotHoldsAgainstThatOfAModelFile) {
  model::Robot robot;
  robot.gravity = {0.0, 0.0, 9.81};
  model::ModelFile file;
  urdf::mount_like(robot, file);
  EXPECT_FALSE(file.kinematics);
  file.kinematics.emplace();
  urdf::mount_like(robot, file);
  EXPECT_EQ(file.kinematics->gravity, robot.gravity);
}

}  // namespace
}  // namespace heft
