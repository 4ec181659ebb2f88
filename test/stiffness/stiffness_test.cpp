// The facade: springs from both sources as one answer, its model file, and what it refuses.
#include "heft/stiffness/stiffness.hpp"

#include <cmath>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/error.hpp"
#include "support/arms.hpp"
#include "support/ur5_dh_table.hpp"

namespace heft::stiffness {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;
using ::testing::HasSubstr;

const VectorXd& springs() {
  static const VectorXd k = (VectorXd(6) << 12e3, 9e3, 8e3, 4e3, 3.5e3, 5e3).finished();
  return k;
}

/// What a tracker reads at a pose of an arm with these springs, under a force at the hook.
data::Deflection read_at(const model::Robot& robot, const VectorXd& q, const Vector6d& wrench,
                         const std::string& name) {
  data::Deflection row;
  row.pose = name;
  row.where = "test";
  row.q = q;
  row.force = wrench.head<3>();
  row.moment = wrench.tail<3>();
  const ToolDeflection exact = exact_deflection(model::Kinematics(robot), q, springs(), wrench);
  for (int axis = 0; axis < 3; ++axis) {
    row.readings.push_back({false, Vector3d::Unit(axis), exact.tool[axis], 0.0});
    row.readings.push_back({true, Vector3d::Unit(axis), exact.tool[3 + axis], 0.0});
  }
  return row;
}

TEST(StiffnessFacade, PlannedPosesGiveTheSpringsBackAsAModel) {
  const model::Robot robot = test::ur5_of_dh_table();
  PlanOptions wanted;
  wanted.poses = 8;
  wanted.force = Vector3d(30.0, 20.0, -40.0);
  wanted.point = Vector3d(0.3, 0.0, 0.0);
  int asked = 0;
  // The elbow is to stay on one side.
  wanted.refuse = [&](const VectorXd& q) { return ++asked, q[2] > 0.0 ? "" : "the elbow is up"; };
  const MeasurementPlan plan = plan_measurements(robot, wanted);
  EXPECT_EQ(asked, 3000);
  EXPECT_LT(plan.safe, 2000);
  ASSERT_EQ(plan.chosen.size(), 8U);
  std::vector<data::Deflection> rows;
  for (std::size_t k = 0; k < plan.chosen.size(); ++k) {
    EXPECT_GT(plan.chosen[k].q[2], 0.0);
    rows.push_back(read_at(robot, plan.chosen[k].q, plan.wrenches[k], std::to_string(k + 1)));
  }
  DeflectionOptions options;
  options.sources = {"read.csv"};
  const Stiffness found = from_deflections(robot, rows, options);
  EXPECT_TRUE(found.usable());
  EXPECT_LT((found.joints - springs()).cwiseQuotient(springs()).cwiseAbs().maxCoeff(), 0.02);
  const model::ModelFile file = found.model_file();
  EXPECT_EQ(file.elasticities.size(), 6U);
  EXPECT_EQ(file.provenance.method, "stiffness");
  EXPECT_EQ(file.provenance.logs, options.sources);
}

TEST(StiffnessFacade, RefusesSingularPosesUnlessTheyAreKept) {
  const model::Robot robot = test::ur5_of_dh_table();
  const Vector6d wrench = (Vector6d() << 10.0, 10.0, -40.0, 1.0, 2.0, 3.0).finished();
  std::vector<data::Deflection> rows{read_at(robot, VectorXd::Zero(6), wrench, "stretched")};
  std::mt19937 random(2);
  std::uniform_real_distribution<double> angle(0.4, 1.4);
  for (int k = 0; k < 6; ++k) {
    const VectorXd q = VectorXd::NullaryExpr(6, [&](Eigen::Index) { return angle(random); });
    rows.push_back(read_at(robot, q, wrench, std::to_string(k)));
  }
  try {
    (void)from_deflections(robot, rows);
    FAIL() << "a singular pose was taken";
  } catch (const NotIdentifiableError& error) {
    EXPECT_THAT(error.what(), HasSubstr("pose stretched is singular"));
  }
  DeflectionOptions keep;
  keep.keep_singular = true;
  std::vector<std::string> notes;
  EXPECT_TRUE(from_deflections(robot, rows, keep, &notes).found_any());
  EXPECT_THAT(notes, ::testing::Contains(HasSubstr("pose stretched is singular and kept")));
}

constexpr double kSpring = 2e4, kRotor = 3.0;  // [N·m/rad], [kg·m²] on the link's side

/// Two joints in sines; a spring in joint 2, seen by encoders on both sides. The torque is the gear's.
data::Log gear_log(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> phase(0.0, 2.0 * std::numbers::pi);
  std::normal_distribution<double> noise(0.0, 2e-6);
  const double a = phase(random), b = phase(random), c = phase(random);
  const int rows = 3001;
  data::Log log;
  log.path = "run.csv";
  log.time = VectorXd::LinSpaced(rows, 0.0, 30.0);
  log.q.resize(rows, 2);
  log.tau.resize(rows, 2);
  VectorXd link(rows);
  for (int k = 0; k < rows; ++k) {
    const double t = log.time[k];
    log.q(k, 0) = 0.4 * std::sin(0.9 * t + a);
    log.q(k, 1) = 0.5 * std::sin(1.3 * t + b) + 0.2 * std::sin(2.9 * t + c);
    const double gear =
        8.0 * std::cos(log.q(k, 1)) + 5.0 * std::sin(0.7 * t + c) + 3.0 * std::sin(1.9 * t + a);
    log.tau(k, 0) = 12.0 * std::cos(log.q(k, 0));
    log.tau(k, 1) = gear;
    link[k] = log.q(k, 1) - gear / kSpring + noise(random);
  }
  log.extra = {{"qlink2", link}};
  return log;
}

model::Robot arm_with_rotor() {
  model::Robot robot = test::planar_two_link();
  robot.joints[1].actuation.rotor_inertia = kRotor;
  return robot;
}

TEST(StiffnessFacade, EncodersGiveTheSpringOfTheJointTheySee) {
  const model::Robot robot = arm_with_rotor();
  const data::LogSet logs = data::log_set(robot.joint_specs(), {gear_log(1)}, {}, data::TorqueAt::kJoint);
  const Stiffness found = from_encoders(robot, logs);
  EXPECT_TRUE(std::isinf(found.joints[0]));
  EXPECT_NEAR(found.joints[1] / kSpring, 1.0, 0.02);
  const model::ModelFile file = found.model_file();
  ASSERT_EQ(file.elasticities.size(), 1U);
  EXPECT_EQ(file.elasticities[0].joint, 1);
  EXPECT_DOUBLE_EQ(file.elasticities[0].stiffness, found.joints[1]);
}

TEST(StiffnessFacade, OnlyTorqueOfTheMotorHoldsTheRotorsShare) {
  const model::Robot robot = arm_with_rotor();
  data::Log motor = gear_log(1);
  // q̈ of joint 2 by central differences.
  const double period = motor.time[1] - motor.time[0];
  VectorXd acceleration = VectorXd::Zero(motor.time.size());
  for (Eigen::Index k = 1; k + 1 < acceleration.size(); ++k)
    acceleration[k] = (motor.q(k + 1, 1) - 2.0 * motor.q(k, 1) + motor.q(k - 1, 1)) / (period * period);
  motor.tau.col(1) += kRotor * acceleration;
  const auto spring = [&](data::TorqueAt at) {
    return from_encoders(robot, data::log_set(robot.joint_specs(), {motor}, {}, at)).joints[1] / kSpring;
  };
  EXPECT_NEAR(spring(data::TorqueAt::kMotor), 1.0, 0.02);
  EXPECT_GT(std::abs(spring(data::TorqueAt::kJoint) - 1.0), 0.05);
}

TEST(StiffnessFacade, WantsOneRotorInertiaAJoint) {
  const model::Robot robot = arm_with_rotor();
  EncoderOptions options;
  options.rotor_inertia = {1.0};
  const data::LogSet logs = data::log_set(robot.joint_specs(), {gear_log(1)}, {});
  EXPECT_THROW((void)from_encoders(robot, logs, options), InputError);
}

}  // namespace
}  // namespace heft::stiffness
