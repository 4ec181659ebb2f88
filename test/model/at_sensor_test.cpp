// What of a robot a sensor behind the gears sees, and whose offset is whose.
#include "heft/model/at_sensor.hpp"

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "heft/model/dynamics.hpp"
#include "heft/model/motion_torque.hpp"
#include "support/arms.hpp"

namespace heft::model {
namespace {

/// Everything a drive can hold.
Robot driven() {
  Robot robot = test::planar_two_link();
  for (RobotJoint& joint : robot.joints) joint.actuation = {0.2, 4.0, 1.5, 0.7};
  robot.couplings = {{0, 1, 1.0, 0.05, 4.0, 1.0}};
  robot.effects = {{joint_effect_kind<Stribeck>(), 0, {3.0, 0.2}}};
  robot.torque_delay = 0.01;
  return robot;
}

FitRecord fitted_at(const std::string& side) {
  FitRecord record;
  record.torque_at = side;
  return record;
}

/// Torque of a robot along a motion in which everything moves.
Eigen::MatrixXd torque_of(const Robot& robot) {
  const Eigen::VectorXd time = Eigen::VectorXd::LinSpaced(50, 0.0, 0.49);
  Eigen::MatrixXd q(50, 2), qd(50, 2), qdd(50, 2);
  for (Eigen::Index j = 0; j < 2; ++j) {
    const Eigen::ArrayXd phase = 5.0 * time.array() + static_cast<double>(j);
    q.col(j) = phase.sin(), qd.col(j) = 5.0 * phase.cos(), qdd.col(j) = -25.0 * phase.sin();
  }
  return MotionTorque(robot).torque(time, q, qd, qdd);
}

/// The same of the links alone, by the rigid bodies' inverse dynamics.
Eigen::MatrixXd links_of(const Robot& robot) {
  Robot bare = robot;
  for (RobotJoint& joint : bare.joints) joint.actuation = {};
  bare.couplings.clear(), bare.effects.clear();
  bare.torque_delay = 0.0;
  return torque_of(bare);
}

TEST(AtSensor, SeesTheLinksOfARobotKnownFromItsMotorsAndNotItsOffsets) {
  const Robot robot = driven();
  const FitRecord motors = fitted_at("motor");
  EXPECT_GT((torque_of(robot) - links_of(robot)).cwiseAbs().maxCoeff(), 1.0) << "this motion is no test";
  for (const FitRecord* fit : {static_cast<const FitRecord*>(nullptr), &motors}) {
    EXPECT_LT((torque_of(as_measured(robot, true, fit)) - links_of(robot)).cwiseAbs().maxCoeff(), 1e-12);
  }
}

TEST(AtSensor, KeepsTheSpringOfAnElasticJointAndLosesTheMotorsInertia) {
  Robot robot = driven();
  robot.elasticities = {{1, 400.0, 0.5, 0.1}};
  const Robot seen = at_sensor(robot);
  ASSERT_EQ(seen.elasticities.size(), 1U);
  EXPECT_EQ(seen.elasticities[0].stiffness, 400.0);
  EXPECT_EQ(seen.elasticities[0].damping, 0.5);
  EXPECT_EQ(seen.elasticities[0].motor_inertia, 0.0);
}

TEST(AtSensor, AModelFittedThereIsWhatItSees) {
  const Robot robot = driven();
  const FitRecord sensors = fitted_at("joint");
  EXPECT_EQ(torque_of(as_measured(robot, true, &sensors)), torque_of(robot));
}

TEST(AtMotors, EveryModelIsTakenAsItIsButOneFittedBehindTheGearsIsPointedOut) {
  const Robot robot = driven();
  std::vector<std::string> notes;
  const FitRecord motors = fitted_at("motor"), sensors = fitted_at("joint");
  EXPECT_EQ(torque_of(as_measured(robot, false, nullptr, &notes)), torque_of(robot));
  EXPECT_EQ(torque_of(as_measured(robot, false, &motors, &notes)), torque_of(robot));
  EXPECT_TRUE(notes.empty());
  EXPECT_EQ(torque_of(as_measured(robot, false, &sensors, &notes)), torque_of(robot));
  EXPECT_EQ(notes.size(), 1U);
}

}  // namespace
}  // namespace heft::model
