/// Torque, gravity torque and regressor along logs, against the pendulum's closed form.
#include "heft/validate/inverse_dynamics.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/error.hpp"

namespace heft {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using validate::DynamicsQuantity;

constexpr double kBob = 2.0, kLength = 0.5, kG = 9.81;  // [kg], [m], [m/s²]
constexpr double kRotor = 0.3, kCoulomb = 1.5, kViscous = 0.7, kOffset = 0.2;

/// A point mass on a weightless rod that is horizontal at q = 0 and turns about a horizontal axis.
model::Robot pendulum() {
  model::Robot robot;
  robot.name = "pendulum";
  robot.gravity = {0.0, -kG, 0.0};
  model::RobotJoint joint;
  joint.link[kMass] = kBob;
  joint.link[kMcx] = kBob * kLength;
  joint.link[kIyy] = joint.link[kIzz] = kBob * kLength * kLength;
  joint.actuation = {kRotor, kCoulomb, kViscous, kOffset};
  robot.joints.push_back(joint);
  return robot;
}

double rigid_torque(double q, double qdd) {
  return kBob * kLength * kLength * qdd + kBob * kG * kLength * std::cos(q);
}

double drive_torque(double qd, double qdd) {
  return kRotor * qdd + kCoulomb * (qd > 0 ? 1.0 : -1.0) + kViscous * qd + kOffset;
}

/// Ten seconds of a swing that never rests, without torque.
data::Log swing(const std::string& path) {
  constexpr Eigen::Index kRows = 1000;
  constexpr double kRate = 100.0, kOmega = 2.0;
  data::Log log;
  log.path = path;
  log.time = Eigen::VectorXd::LinSpaced(kRows, 0.0, (kRows - 1) / kRate);
  log.q.resize(kRows, 1);
  log.qd = log.qdd = log.q;
  for (Eigen::Index k = 0; k < kRows; ++k) {
    const double angle = kOmega * log.time[k] + 0.1;
    log.q(k, 0) = std::sin(angle);
    log.qd(k, 0) = kOmega * std::cos(angle);
    log.qdd(k, 0) = -kOmega * kOmega * std::sin(angle);
  }
  return log;
}

data::LogSet to_follow(std::vector<data::Log> logs, data::TorqueAt at = data::TorqueAt::kMotor) {
  return data::log_set(pendulum().joint_specs(), {}, std::move(logs), at);
}

TEST(InverseDynamics, GivesTheTorqueOfAPendulumWithItsDrive) {
  const auto found = validate::inverse_dynamics_along(pendulum(), to_follow({swing("swing.csv")}));
  EXPECT_EQ(found.robot, "pendulum");
  EXPECT_THAT(found.columns, ElementsAre("tau1"));
  ASSERT_EQ(found.logs.size(), 1U);
  const validate::LogDynamics& along = found.logs.front();
  EXPECT_FALSE(along.score) << "the log holds no torque";
  ASSERT_EQ(along.values.rows(), 1000);
  double largest = 0.0;
  for (int k = 0; k < 1000; ++k) {
    const double q = along.log.q(k, 0), qd = along.log.qd(k, 0), qdd = along.log.qdd(k, 0);
    const double torque = rigid_torque(q, qdd) + drive_torque(qd, qdd);
    largest = std::max(largest, std::abs(torque));
    ASSERT_NEAR(along.values(k, 0), torque, 1e-10) << k;
  }
  EXPECT_NEAR(along.largest()[0], largest, 1e-10);
}

TEST(InverseDynamics, GravityIsThatOfThePoseAlone) {
  validate::DynamicsOptions gravity;
  gravity.what = DynamicsQuantity::kGravity;
  const auto found = validate::inverse_dynamics_along(pendulum(), to_follow({swing("swing.csv")}), gravity);
  EXPECT_THAT(found.columns, ElementsAre("g1"));
  const validate::LogDynamics& along = found.logs.front();
  ASSERT_EQ(along.values.rows(), 1000);
  for (int k = 0; k < 1000; ++k)
    ASSERT_NEAR(along.values(k, 0), kBob * kG * kLength * std::cos(along.log.q(k, 0)), 1e-10) << k;
}

TEST(InverseDynamics, RegressorTimesTheParametersIsTheTorque) {
  validate::DynamicsOptions regressor;
  regressor.what = DynamicsQuantity::kRegressor;
  const auto found = validate::inverse_dynamics_along(pendulum(), to_follow({swing("swing.csv")}), regressor);
  EXPECT_THAT(found.columns, ElementsAre("Y1_m1", "Y1_mcx1", "Y1_mcy1", "Y1_mcz1", "Y1_Ixx1", "Y1_Ixy1",
                                         "Y1_Iyy1", "Y1_Ixz1", "Y1_Iyz1", "Y1_Izz1", "Y1_rotor1",
                                         "Y1_coulomb1", "Y1_viscous1", "Y1_offset1"));
  const validate::LogDynamics& along = found.logs.front();
  ASSERT_EQ(along.values.cols(), 14);
  Eigen::VectorXd parameters = Eigen::VectorXd::Zero(14);
  parameters[0] = kBob;
  parameters[1] = kBob * kLength;
  parameters[9] = kBob * kLength * kLength;
  parameters.tail(4) << kRotor, kCoulomb, kViscous, kOffset;
  for (int k = 0; k < 1000; ++k) {
    const double q = along.log.q(k, 0), qd = along.log.qd(k, 0), qdd = along.log.qdd(k, 0);
    ASSERT_NEAR(along.values.row(k).dot(parameters), rigid_torque(q, qdd) + drive_torque(qd, qdd), 1e-10);
  }
}

TEST(InverseDynamics, RegressorBehindTheGearHasNoColumnsOfTheDrive) {
  validate::DynamicsOptions regressor;
  regressor.what = DynamicsQuantity::kRegressor;
  const auto found = validate::inverse_dynamics_along(
      pendulum(), to_follow({swing("swing.csv")}, data::TorqueAt::kJoint), regressor);
  EXPECT_EQ(found.columns.size(), 10U);
  EXPECT_EQ(found.columns.back(), "Y1_Izz1");
  EXPECT_EQ(found.logs.front().values.cols(), 10);
}

TEST(InverseDynamics, ComparesWithTorqueThatTheLogHolds) {
  data::Log log = swing("measured.csv");
  log.tau.resize(log.num_samples(), 1);
  constexpr double kError = 0.25;  // [N·m]
  for (int k = 0; k < log.num_samples(); ++k) {
    log.tau(k, 0) = rigid_torque(log.q(k, 0), log.qdd(k, 0)) + drive_torque(log.qd(k, 0), log.qdd(k, 0)) +
                    (k % 2 == 0 ? kError : -kError);
  }
  std::vector<double> done;
  validate::DynamicsOptions options;
  options.progress = [&](const std::string& path, double share) {
    EXPECT_THAT(path, ::testing::AnyOf("measured.csv", "swing.csv"));
    done.push_back(share);
  };
  const auto found =
      validate::inverse_dynamics_along(pendulum(), to_follow({std::move(log), swing("swing.csv")}), options);
  ASSERT_EQ(found.logs.size(), 2U);
  ASSERT_TRUE(found.logs[0].score);
  EXPECT_NEAR(found.logs[0].score->rmse[0], kError, 1e-9);
  EXPECT_FALSE(found.logs[1].score);
  EXPECT_THAT(done, ElementsAre(0.0, 0.5));
}

TEST(InverseDynamics, RefusesATorqueThatIsNotFinite) {
  model::Robot robot = pendulum();
  robot.joints.front().link[kMcx] = std::numeric_limits<double>::infinity();
  try {
    validate::inverse_dynamics_along(robot, to_follow({swing("swing.csv")}));
    FAIL() << "took an infinite torque";
  } catch (const DataError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("swing.csv: row 1 (time 0 s)"), HasSubstr("not finite")));
  }
}

}  // namespace
}  // namespace heft
