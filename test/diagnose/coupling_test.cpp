/// A motor that turns with two joints which are not those of a usual wrist.
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "heft/core/effects/arm_effects.hpp"
#include "heft/diagnose/diagnose.hpp"
#include "heft/model/motion_torque.hpp"
#include "support/arms.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr GearCoupling<double> kPair{.driving = 0, .driven = 1, .ratio = 0.5};

model::Robot uncoupled_arm() {
  model::Robot robot = test::planar_two_link();
  robot.joints[0].actuation = {0.0, 2.0, 1.0, 0.0};
  robot.joints[1].actuation = {0.0, 1.0, 0.5, 0.0};
  return robot;
}

data::Log log_of(const model::Robot& robot, unsigned seed) {
  constexpr double kRate = 200.0, kSeconds = 24.0;
  const auto rows = static_cast<Index>(kSeconds * kRate);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> phase(0.0, 6.28), part(0.7, 1.3);
  std::normal_distribution<double> noise(0.0, 0.05);
  data::Log log;
  log.path = "coupling-" + std::to_string(seed);
  log.time = Eigen::VectorXd::LinSpaced(rows, 0.0, static_cast<double>(rows - 1) / kRate);
  log.q.resize(rows, 2);
  MatrixXd qd(rows, 2), qdd(rows, 2);
  for (int j = 0; j < 2; ++j) {
    const double a = 0.5 * part(random), b = 0.2 * part(random), p = phase(random), r = phase(random);
    const double v = 2.0 * 3.14159 * 0.17 * part(random), w = 2.0 * 3.14159 * 0.53 * part(random);
    for (Index k = 0; k < rows; ++k) {
      const double t = log.time[k];
      log.q(k, j) = a * std::sin(v * t + p) + b * std::sin(w * t + r);
      qd(k, j) = a * v * std::cos(v * t + p) + b * w * std::cos(w * t + r);
      qdd(k, j) = -a * v * v * std::sin(v * t + p) - b * w * w * std::sin(w * t + r);
    }
  }
  log.tau = model::MotionTorque(robot).torque(log.time, log.q, qd, qdd, 1e-3, {});
  for (double& tau : log.tau.reshaped()) tau += noise(random);
  return log;
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
