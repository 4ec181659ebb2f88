// heft's importer and dynamics against KDL on every robot in urdf/.

#include <filesystem>
#include <iostream>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/model/dynamics.hpp"
#include "heft/model/kinematics.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/kdl.hpp"
#include "urdf/comparison.hpp"

namespace heft::urdf {
namespace {

using test::KdlArm;

constexpr int kStates = 1000;
/// Relative to the largest entry: two recursions of some hundred operations each in double precision.
constexpr double kTolerance = 1e-12;

struct State {
  Eigen::VectorXd q, qd, qdd;
};

State random_state(int joints, std::mt19937_64& random) {
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto vector = [&](double scale) -> Eigen::VectorXd {
    return Eigen::VectorXd::NullaryExpr(joints, [&] { return scale * uniform(random); });
  };
  return {vector(3.2), vector(4.0), vector(20.0)};
}

class Robots : public testing::TestWithParam<std::string> {};

void compare(const model::Robot& robot, const KDL::Chain& chain) {
  const model::Dynamics dynamics(robot);
  KdlArm kdl(chain, robot.gravity);
  ASSERT_EQ(kdl.num_joints(), robot.num_joints());
  std::mt19937_64 random(19880101);
  double worst = 0.0;
  for (int k = 0; k < kStates; ++k) {
    const State s = random_state(robot.num_joints(), random);
    const double torque =
        relative_error(dynamics.inverse_dynamics(s.q, s.qd, s.qdd), kdl.inverse_dynamics(s.q, s.qd, s.qdd));
    const double mass = relative_error(dynamics.mass_matrix(s.q), kdl.mass_matrix(s.q));
    const Eigen::VectorXd gravity = kdl.gravity_torque(s.q);
    // In some poses gravity loads no joint: measure against what it can load at worst.
    const double scale = std::max(gravity.cwiseAbs().maxCoeff(), 1e-3);
    const double weight = (dynamics.gravity_torque(s.q) - gravity).cwiseAbs().maxCoeff() / scale;
    worst = std::max({worst, torque, mass, weight});
    ASSERT_LE(torque, kTolerance) << "q = " << s.q.transpose() << "\nqd = " << s.qd.transpose()
                                  << "\nqdd = " << s.qdd.transpose();
    ASSERT_LE(mass, kTolerance) << "q = " << s.q.transpose();
    ASSERT_LE(weight, kTolerance) << "q = " << s.q.transpose();
  }
  std::cout << robot.name << ": largest relative difference " << worst << '\n';
}

TEST_P(Robots, DynamicsEqualKdlOnTheUrdfItself) {
  compare(load_urdf(GetParam()), test::kdl_chain_from_urdf(GetParam()));
}

TEST_P(Robots, DynamicsEqualKdlOnTheImportedRobot) {
  const model::Robot robot = load_urdf(GetParam());
  compare(robot, test::kdl_chain_from_robot(robot));
}

TEST_P(Robots, DynamicsEqualKdlOnATiltedBase) {
  UrdfOptions options;
  // Turned by 0.6 about x, then 0.3 about z: an arm on a sloping wall.
  const double cx = std::cos(0.6), sx = std::sin(0.6), cz = std::cos(0.3), sz = std::sin(0.3);
  options.mount_rotation = {cz, -sz * cx, sz * sx, sz, cz * cx, -cz * sx, 0.0, sx, cx};
  const model::Robot robot = load_urdf(GetParam(), options);
  compare(robot, test::kdl_chain_from_urdf(GetParam()));
  EXPECT_NEAR(Eigen::Vector3d(robot.gravity.data()).norm(), 9.81, 1e-12);
}

TEST_P(Robots, TipPlacementEqualsKdlOnTheUrdfItself) {
  const model::Robot robot = load_urdf(GetParam());
  KdlArm imported(test::kdl_chain_from_robot(robot));
  KdlArm direct(test::kdl_chain_from_urdf(GetParam()));
  std::mt19937_64 random(4);
  for (int k = 0; k < kStates; ++k) {
    const State s = random_state(robot.num_joints(), random);
    ASSERT_LE((imported.forward_kinematics(s.q) - direct.forward_kinematics(s.q)).cwiseAbs().maxCoeff(),
              kTolerance)
        << "q = " << s.q.transpose();
  }
}

TEST_P(Robots, KinematicsEqualKdlInBaseAndToolAxes) {
  const model::Robot robot = load_urdf(GetParam());
  const model::Kinematics kinematics(robot);
  KdlArm kdl(test::kdl_chain_from_urdf(GetParam()));
  std::mt19937_64 random(5);
  double worst = 0.0;
  for (int k = 0; k < kStates; ++k) {
    const State s = random_state(robot.num_joints(), random);
    const Eigen::Matrix4d placement = kdl.forward_kinematics(s.q);
    const Eigen::MatrixXd J = kdl.jacobian(s.q);
    const Eigen::Matrix3d R = placement.topLeftCorner<3, 3>();
    Eigen::MatrixXd in_tool(6, J.cols());
    in_tool.topRows(3) = R.transpose() * J.topRows(3);
    in_tool.bottomRows(3) = R.transpose() * J.bottomRows(3);
    const model::ToolPlacement tip = kinematics.tip(s.q);
    const double error = std::max({(tip.rotation - R).cwiseAbs().maxCoeff(),
                                   (tip.position - placement.topRightCorner<3, 1>()).cwiseAbs().maxCoeff(),
                                   (kinematics.jacobian(s.q) - J).cwiseAbs().maxCoeff(),
                                   (kinematics.jacobian_in_tool(s.q) - in_tool).cwiseAbs().maxCoeff()});
    worst = std::max(worst, error);
    ASSERT_LE(error, kTolerance) << "q = " << s.q.transpose();
  }
  std::cout << robot.name << ": largest difference " << worst << '\n';
}

TEST_P(Robots, ToolBeyondTheTipMovesTheReferencePointAlone) {
  const model::Robot robot = load_urdf(GetParam());
  const Eigen::Vector3d point(0.11, -0.23, 0.37);
  KDL::Chain chain = test::kdl_chain_from_urdf(GetParam());
  chain.addSegment(KDL::Segment(KDL::Joint(KDL::Joint::None), KDL::Frame(KDL::Vector(0.11, -0.23, 0.37))));
  KdlArm kdl(chain);
  const model::Kinematics kinematics(robot, model::tool_beyond_tip(robot, point));
  std::mt19937_64 random(6);
  for (int k = 0; k < 20; ++k) {
    const State s = random_state(robot.num_joints(), random);
    ASSERT_LE((kinematics.jacobian(s.q) - kdl.jacobian(s.q)).cwiseAbs().maxCoeff(), kTolerance);
    const Eigen::VectorXd wrench = Eigen::VectorXd::LinSpaced(6, -3.0, 7.0);
    ASSERT_LE(
        (kinematics.joint_torque(s.q, wrench) - kdl.jacobian(s.q).transpose() * wrench).cwiseAbs().maxCoeff(),
        1e-11);
  }
}

TEST_P(Robots, HaveNothingToWarnAbout) {
  std::vector<std::string> warnings;
  UrdfOptions options;
  options.refuse_impossible_inertia = true;
  const model::Robot robot = load_urdf(GetParam(), options, &warnings);
  EXPECT_THAT(warnings, testing::IsEmpty());
  for (const model::RobotJoint& joint : robot.joints) {
    SCOPED_TRACE(joint.name);
    EXPECT_LT(joint.lower, joint.upper);
    EXPECT_TRUE(std::isfinite(joint.velocity_limit));
    EXPECT_TRUE(std::isfinite(joint.effort_limit));
    // Every axis and every quarter turn must be exact, for the compile-time dynamics to drop the zeros.
    for (const double entry : joint.joint.rotation)
      EXPECT_TRUE(entry == 0.0 || std::abs(entry) == 1.0) << entry;
    for (const double entry : joint.joint.axis) EXPECT_TRUE(entry == 0.0 || std::abs(entry) == 1.0) << entry;
  }
}

std::string name_of(const testing::TestParamInfo<std::string>& info) {
  return std::filesystem::path(info.param).stem().string();
}

INSTANTIATE_TEST_SUITE_P(Urdf, Robots, testing::ValuesIn(robot_files()), name_of);

}  // namespace
}  // namespace heft::urdf
