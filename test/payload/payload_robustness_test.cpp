/// Core's payload estimator when the input is not as it should be.
#include <array>
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "heft/core/dynamics/regressor.hpp"
#include "heft/core/estimate/payload_estimator.hpp"
#include "heft/model/named_arms.hpp"

namespace heft {
namespace {

using Estimator = PayloadEstimator<double, 6, 6>;
using Vector = JointVector<double, 6>;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A sample of a moving UR5: regressor, velocities, torque residual of a load of 1.2 kg.
class Samples {
 public:
  void next() {
    for (int i = 0; i < 6; ++i) {
      q[i] = 3 * uniform_(generator_);
      qd[i] = 2 * uniform_(generator_);
      qdd[i] = 5 * uniform_(generator_);
    }
    link_regressor(arm_, joint_trigonometry<DynamicArm<double, 6>>(q), q, qd, qdd, Y);
    InertialParameters<double> load{1.2, 0.05, -0.08, 0.1, 0.02, 0, 0.02, 0, 0, 0.01};
    residual = Y.rightCols<10>() * Eigen::Map<const Eigen::Matrix<double, 10, 1>>(load.data());
    for (int i = 0; i < 6; ++i) residual[i] += 0.05 * normal_(generator_);
  }
  Vector q, qd, qdd, residual;
  LinkRegressor<double, 6> Y;

 private:
  DynamicArm<double, 6> arm_{model::Ur5Arm::kModel};
  std::mt19937 generator_{7};
  std::uniform_real_distribution<double> uniform_{-1.0, 1.0};
  std::normal_distribution<double> normal_;
};

Estimator::Config settings() {
  Estimator::Config config;
  config.noise_std.setConstant(0.05);
  config.gate = 8;
  config.standstill_speed = 0.03;
  return config;
}

/// Everything the estimator says of its state.
std::array<double, 2 * Estimator::kParameters> state_of(const Estimator& estimator) {
  std::array<double, 2 * Estimator::kParameters> state{};
  for (std::size_t i = 0; i < Estimator::kParameters; ++i) {
    state[i] = estimator.estimator().solution()[i];
    state[Estimator::kParameters + i] = estimator.standard_deviation(static_cast<int>(i));
  }
  return state;
}

Estimator converged(Samples& samples) {
  Estimator estimator;
  EXPECT_EQ(estimator.configure(settings()), Status::kOk);
  for (int k = 0; k < 500; ++k) {
    samples.next();
    Estimator::Record record;
    EXPECT_EQ(estimator.update(samples.Y, samples.qd, samples.residual, record), Status::kOk);
  }
  EXPECT_NEAR(estimator.payload()[0], 1.2, 0.02);
  return estimator;
}

TEST(PayloadRobustness, WhatIsNotFiniteChangesNothingAndSaysSo) {
  Samples samples;
  Estimator estimator = converged(samples);
  const auto before = state_of(estimator);
  for (const double bad : {kNaN, kInfinity, -kInfinity}) {
    for (int place = 0; place < 4; ++place) {
      samples.next();
      Vector sign = samples.qd.cwiseSign();
      if (place == 0) samples.residual[2] = bad;
      if (place == 1) samples.qd[0] = bad;
      if (place == 2) samples.Y(3, 57) = bad;
      if (place == 3) sign[5] = bad;
      Estimator::Record record;
      EXPECT_EQ(estimator.update(samples.Y, samples.qd, sign, samples.residual, record),
                Status::kNonFiniteInput);
      EXPECT_EQ(record.rows_used, 0);
      EXPECT_EQ(state_of(estimator), before) << "bad number " << bad << " in place " << place;
    }
  }
}

TEST(PayloadRobustness, BeforeSettingsNothingIsTaken) {
  Samples samples;
  samples.next();
  Estimator estimator;
  Estimator::Record record;
  EXPECT_EQ(estimator.update(samples.Y, samples.qd, samples.residual, record), Status::kNotConfigured);
}

TEST(PayloadRobustness, AnOutlierIsRejectedAndCounted) {
  Samples samples;
  Estimator estimator = converged(samples);
  const auto before = state_of(estimator);
  samples.next();
  samples.qd << 1, -1, 0.5, -0.5, 1, -1;
  samples.residual.array() += 100;
  Estimator::Record record;
  ASSERT_EQ(estimator.update(samples.Y, samples.qd, samples.residual, record), Status::kOk);
  EXPECT_EQ(record.rows_rejected, 6);
  EXPECT_EQ(record.rows_used, 0);
  EXPECT_FALSE(record.used[0]);
  EXPECT_NEAR(record.innovation[0], 100, 2);
  EXPECT_EQ(state_of(estimator), before);
}

TEST(PayloadRobustness, OnlyRowsOfJointsAtRestAreLeftOut) {
  Samples samples;
  Estimator estimator = converged(samples);
  samples.next();
  samples.qd << 1, 0.01, -0.02, -1, 0.0, 1;
  samples.residual[1] = samples.residual[2] = samples.residual[4] = 50;  // stiction holds it
  Estimator::Record record;
  ASSERT_EQ(estimator.update(samples.Y, samples.qd, samples.residual, record), Status::kOk);
  EXPECT_EQ(record.rows_at_rest, 3);
  EXPECT_FALSE(record.standstill);
  EXPECT_EQ(record.innovation_variance[1], 0.0);
  EXPECT_GT(record.innovation_variance[0], 0.0);
}

TEST(PayloadRobustness, AMillionSamplesAtRestDoNotWindUp) {
  Samples samples;
  Estimator estimator;
  Estimator::Config config = settings();
  config.forgetting_factor = 0.999;
  ASSERT_EQ(estimator.configure(config), Status::kOk);
  Estimator::Record record;
  for (int k = 0; k < 500; ++k) {
    samples.next();
    ASSERT_EQ(estimator.update(samples.Y, samples.qd, samples.residual, record), Status::kOk);
  }
  const auto before = state_of(estimator);
  samples.qd.setConstant(1e-4);
  samples.residual.setConstant(3);
  for (int k = 0; k < 1000000; ++k) {
    if (estimator.update(samples.Y, samples.qd, samples.residual, record) != Status::kOk) FAIL() << k;
  }
  EXPECT_TRUE(record.standstill);
  EXPECT_EQ(state_of(estimator), before);
}

TEST(PayloadRobustness, AMillionEqualSamplesWithForgettingDoNotWindUp) {
  // Creeping along without excitation, which the standstill rule does not catch.
  Samples samples;
  Estimator estimator;
  Estimator::Config config = settings();
  config.forgetting_factor = 0.999;
  ASSERT_EQ(estimator.configure(config), Status::kOk);
  Estimator::Record record;
  for (int k = 0; k < 500; ++k) {
    samples.next();
    ASSERT_EQ(estimator.update(samples.Y, samples.qd, samples.residual, record), Status::kOk);
  }
  for (int k = 0; k < 1000000; ++k) {
    if (estimator.update(samples.Y, samples.qd, samples.residual, record) != Status::kOk) FAIL() << k;
  }
  EXPECT_NEAR(estimator.payload()[0], 1.2, 0.1);
  // And it still learns: a heavier load afterwards is found.
  for (int k = 0; k < 5000; ++k) {
    samples.next();
    samples.residual *= 1.5;
    ASSERT_EQ(estimator.update(samples.Y, samples.qd, samples.residual, record), Status::kOk);
    if (k == 0) estimator.restart();
  }
  EXPECT_NEAR(estimator.payload()[0], 1.8, 0.05);
}

TEST(PayloadRobustness, RestartTakesUpTheUncertaintyAndKeepsTheEstimate) {
  Samples samples;
  Estimator estimator = converged(samples);
  const auto before = estimator.payload();
  ASSERT_TRUE(estimator.identifiable(0));
  estimator.restart();
  EXPECT_EQ(estimator.payload(), before);
  EXPECT_FALSE(estimator.identifiable(0));
  EXPECT_DOUBLE_EQ(estimator.standard_deviation(0), settings().mass_prior);
}

TEST(PayloadRobustness, CorrelatedSamplesWidenTheDeviationsAndKeepTheGate) {
  Samples samples;
  Estimator white, coloured;
  Estimator::Config config = settings();
  ASSERT_EQ(white.configure(config), Status::kOk);
  config.correlated_samples = 25;
  ASSERT_EQ(coloured.configure(config), Status::kOk);
  Estimator::Record record;
  for (int k = 0; k < 2000; ++k) {
    samples.next();
    ASSERT_EQ(white.update(samples.Y, samples.qd, samples.residual, record), Status::kOk);
    ASSERT_EQ(coloured.update(samples.Y, samples.qd, samples.residual, record), Status::kOk);
  }
  EXPECT_NEAR(coloured.standard_deviation(0) / white.standard_deviation(0), 5, 0.05);
  EXPECT_NEAR(coloured.payload()[0], white.payload()[0], 1e-3);
  samples.next();
  samples.residual[0] += 1.0;  // 20 standard deviations of a single sample, 4 of 25 together
  ASSERT_EQ(coloured.update(samples.Y, samples.qd, samples.residual, record), Status::kOk);
  EXPECT_EQ(record.rows_rejected, 1);
  config.correlated_samples = 0.5;
  EXPECT_EQ(coloured.configure(config), Status::kOutOfRange);
}

TEST(PayloadRobustness, FrictionOfEveryJointMayChange) {
  Samples samples;
  PayloadEstimator<double, 6, 6> all;
  PayloadEstimator<double, 6> last;
  ASSERT_EQ(all.configure(settings()), Status::kOk);
  PayloadEstimator<double, 6>::Config config;
  config.noise_std.setConstant(0.05);
  config.gate = 0;
  ASSERT_EQ(last.configure(config), Status::kOk);
  for (int k = 0; k < 500; ++k) {
    samples.next();
    samples.residual[1] += 2 * velocity_sign(samples.qd[1], 0.01) + 0.5 * samples.qd[1];
    PayloadEstimator<double, 6, 6>::Record all_record;
    ASSERT_EQ(all.update(samples.Y, samples.qd, samples.residual, all_record), Status::kOk);
    PayloadEstimator<double, 6>::Record last_record;
    ASSERT_EQ(last.update(samples.Y, samples.qd, samples.residual, last_record), Status::kOk);
  }
  EXPECT_NEAR(all.coulomb_change(1), 2, 0.05);
  EXPECT_NEAR(all.viscous_change(1), 0.5, 0.05);
  EXPECT_NEAR(all.coulomb_change(5), 0, 0.05);
  EXPECT_NEAR(all.payload()[0], 1.2, 0.02);
  EXPECT_EQ(last.coulomb_change(1), 0.0) << "no parameter of its own";
}

}  // namespace
}  // namespace heft
