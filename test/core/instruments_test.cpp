#include "heft/core/estimate/instruments.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "heft/core/friction/friction.hpp"
#include "support/terminal_link_run.hpp"

namespace heft {
namespace {

TEST(JointAccelerationModel, FollowsTheJointItModels) {
  // J q̈ + D q̇ = K u with K/J = 40, c = 6: integrate finely, compare at the samples.
  JointAccelerationModel<double, 1> joint;
  JointAccelerationModel<double, 1>::Config config;
  config.gain.setConstant(40.0);
  config.decay.setConstant(6.0);
  config.period = 0.001;
  ASSERT_EQ(joint.configure(config), Status::kOk);
  using V = JointVector<double, 1>;
  const auto u = [](double t) { return std::sin(3 * t) + 0.5 * std::sin(11 * t + 1) - 0.5 * std::sin(1.0); };
  double velocity = 0;
  double worst = 0;
  for (int n = 0; n < 4000; ++n) {
    const double t = 0.001 * n;
    const double exact = 40 * u(t) - 6 * velocity;
    const double modelled = joint.update(V(u(t)))[0];
    if (n > 2000) {
      worst = std::max(worst, std::abs(modelled - exact));
    }
    for (int k = 0; k < 20; ++k) {
      const double s = t + 0.00005 * k;
      velocity += 0.00005 * (40 * u(s + 0.000025) - 6 * (velocity + 0.000025 * (40 * u(s) - 6 * velocity)));
    }
  }
  EXPECT_LT(worst, 0.02);
}

TEST(JointAccelerationModel, RefusesSettingsOutOfRangeAndKeepsItsState) {
  JointAccelerationModel<double, 2> joint, untouched;
  JointAccelerationModel<double, 2>::Config config;
  ASSERT_EQ(joint.configure(config), Status::kOk);
  ASSERT_EQ(untouched.configure(config), Status::kOk);
  using V = JointVector<double, 2>;
  for (const double u : {0.0, 1.0}) ASSERT_EQ(joint.update(V(u, -u)), untouched.update(V(u, -u)));
  config.gain[1] = 0;
  EXPECT_EQ(joint.configure(config), Status::kOutOfRange);
  config.gain[1] = 1;
  config.decay[0] = -1;
  EXPECT_EQ(joint.configure(config), Status::kOutOfRange);
  config.decay[0] = 0;
  config.period = 0;
  EXPECT_EQ(joint.configure(config), Status::kOutOfRange);
  for (const double u : {3.0, 2.0, 5.0}) EXPECT_EQ(joint.update(V(u, -u)), untouched.update(V(u, -u)));
  EXPECT_NE(untouched.update(V(0.0, 0.0)), V(0.0, 0.0)) << "the model gave no acceleration";
}

TEST(DelayedMean, AveragesSamplesOfTheStatedAge) {
  DelayedMean<double, 1, 8> mean;
  ASSERT_EQ(mean.configure(3, 2), Status::kOk);
  using V = JointVector<double, 1>;
  for (int n = 0; n < 20; ++n) {
    const bool ready = mean.ready();
    EXPECT_EQ(ready, n >= 4);
    const double value = mean.update(V(static_cast<double>(n)))[0];
    if (ready) {
      EXPECT_DOUBLE_EQ(value, ((n - 3) + (n - 4)) / 2.0);
    } else {
      EXPECT_EQ(value, 0.0);
    }
  }
  EXPECT_EQ(mean.configure(0, 2), Status::kOutOfRange) << "this sample's own measurement is no instrument";
  EXPECT_EQ(mean.configure(7, 2), Status::kOutOfRange);
  EXPECT_TRUE(mean.ready()) << "refused settings change nothing";
  EXPECT_DOUBLE_EQ(mean.update(V(20.0))[0], (17 + 16) / 2.0);
}

TEST(PredictedAcceleration, ReturnsTheAccelerationThatMadeTheTorque) {
  const ReducedParameters<double, model::KawasakiArm> parameters{
      reduced_links(model::KawasakiArmWithPayload::kModel)};
  const test::Vector6 rotor = test::Vector6::Constant(0.003);
  for (const auto& s : test::terminal_link_run(50, 0.0, 1)) {
    test::Vector6 tau = s.tau + rotor.cwiseProduct(s.qdd);
    for (int i = 0; i < 6; ++i) {
      tau[i] -= friction_torque(model::KawasakiArmWithPayload::kModel.actuation[static_cast<std::size_t>(i)],
                                s.qd[i], 0.0);
    }
    test::Vector6 qdd = test::Vector6::Zero();
    ASSERT_EQ(predicted_acceleration<test::Arm6>(parameters, joint_trigonometry<test::Arm6>(s.q), s.q, s.qd,
                                                 rotor, tau, qdd),
              Status::kOk);
    EXPECT_LT((qdd - s.qdd).norm(), 1e-9 * s.qdd.norm());
  }
}

}  // namespace
}  // namespace heft
