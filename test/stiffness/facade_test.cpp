/// Springs that are known, where the tool is looked at, and what deflections are not fitted with.
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/error.hpp"
#include "heft/stiffness/stiffness.hpp"
#include "support/arms.hpp"

namespace heft::stiffness {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

model::Robot arm() {
  model::Robot robot = test::planar_two_link();
  robot.joints[0].lower = -1.0;
  robot.joints[0].upper = 3.0;
  return robot;
}

template <typename Call>
std::string input_error(Call call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

TEST(GivenSprings, OfARobotAreItsElasticJoints) {
  model::Robot robot = arm();
  robot.elasticities = {{1, 4000.0, 2.0, 0.1}};
  const Stiffness springs = given(robot);
  ASSERT_EQ(springs.joints.size(), 2);
  EXPECT_TRUE(std::isinf(springs.joints[0]));
  EXPECT_EQ(springs.joints[1], 4000.0);
  EXPECT_TRUE(springs.found_any());
  const model::ModelFile file = springs.model_file();
  ASSERT_EQ(file.elasticities.size(), 1U);
  EXPECT_EQ(file.elasticities[0].stiffness, 4000.0);
  EXPECT_FALSE(given(arm()).found_any());
}

TEST(GivenSprings, AreOneAJoint) {
  EXPECT_THAT(input_error([] { given(arm(), Eigen::Vector3d(1e3, 1e3, 1e3)); }),
              AllOf(HasSubstr("found 3 values"), HasSubstr("has 2 joints; expected one a joint")));
}

TEST(ToolPoses, OfGivenSpringsAreThePathsFirstOrTheMiddleOfTheRanges) {
  const Stiffness springs = given(arm(), Vector2d(1e3, 1e3));
  const auto middle = poses_to_look_at(springs);
  ASSERT_EQ(middle.size(), 1U);
  EXPECT_EQ(middle[0].q, VectorXd(Vector2d(1.0, 0.0))) << "of -1 to 3; the second joint has no limits";
  const MatrixXd path{{0.1, 0.2}, {0.3, 0.4}};
  const auto first = poses_to_look_at(springs, path);
  ASSERT_EQ(first.size(), 1U);
  EXPECT_EQ(first[0].q, VectorXd(Vector2d(0.1, 0.2)));
  Stiffness measured = springs;
  measured.encoders.emplace();
  EXPECT_THAT(poses_to_look_at(measured, path), IsEmpty());
}

TEST(CompensatedPath, HasNoVelocityOfTheOtherPositions) {
  data::Log path;
  path.time = Vector2d(0.0, 0.1);
  path.q = path.qd = path.qdd = MatrixXd{{0.1, 0.2}, {0.3, 0.4}};
  PathSag sag;
  sag.compensated = MatrixXd{{0.11, 0.21}, {0.31, 0.41}};
  const data::Log log = compensated(path, sag);
  EXPECT_EQ(log.q, sag.compensated);
  EXPECT_EQ(log.time, path.time);
  EXPECT_EQ(log.qd.cols(), 0);
  EXPECT_EQ(log.qdd.cols(), 0);
}

TEST(Groups, AreOfJointsThatTheRobotHasEachOnce) {
  const auto refusal = [](std::vector<std::vector<int>> groups) {
    return input_error([&] { from_deflections(arm(), {}, {.groups = groups}); });
  };
  EXPECT_THAT(refusal({{0}, {2}}), HasSubstr("has no joint 3; expected joints 1 to 2"));
  EXPECT_THAT(refusal({{-1, 0}}), HasSubstr("has no joint 0; expected joints 1 to 2"));
  EXPECT_THAT(refusal({{0, 1}, {1}}), HasSubstr("joint 2 is in two groups"));
}

}  // namespace
}  // namespace heft::stiffness
