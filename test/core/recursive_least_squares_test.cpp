#include "heft/core/estimate/recursive_least_squares.hpp"

#include <limits>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "heft/core/dynamics/regressor.hpp"
#include "heft/core/estimate/payload_estimator.hpp"
#include "heft/model/named_arms.hpp"
#include "support/random_arm.hpp"

namespace heft {
namespace {

constexpr int kP = 6;
template <typename Scalar>
using Estimator = RecursiveLeastSquares<Scalar, kP>;

template <typename Scalar>
Estimator<Scalar> make(Scalar forgetting, Scalar gate = Scalar(0)) {
  Estimator<Scalar> estimator;
  typename Estimator<Scalar>::Row prior{}, variance;
  variance.fill(Scalar(100));
  typename Estimator<Scalar>::Config config;
  config.forgetting_factor = forgetting;
  config.noise_variance = Scalar(0.25);
  config.gate = gate;
  EXPECT_EQ(estimator.configure(config, prior, variance), Status::kOk);
  return estimator;
}

TEST(RecursiveLeastSquares, EqualsTheRegularisedBatchEstimateAndItsCovariance) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  auto estimator = make<double>(1.0);
  Eigen::MatrixXd information = Eigen::MatrixXd::Identity(kP, kP) / 100;
  Eigen::VectorXd right = Eigen::VectorXd::Zero(kP);
  for (int n = 0; n < 500; ++n) {
    Estimator<double>::Row w;
    for (double& v : w) {
      v = normal(random);
    }
    const Eigen::Map<const Eigen::Matrix<double, kP, 1>> row(w.data());
    const double y = row.sum() + 0.5 * normal(random);
    information += row * row.transpose() / 0.25;
    right += row * y / 0.25;
    Estimator<double>::Record record;
    ASSERT_EQ(estimator.update(w, y, 0.0, record), Status::kOk);
    EXPECT_TRUE(record.used);
  }
  const Eigen::MatrixXd covariance = information.inverse();
  const Eigen::VectorXd x = covariance * right;
  for (int i = 0; i < kP; ++i) {
    EXPECT_NEAR(estimator.solution()[static_cast<std::size_t>(i)], x[i], 1e-10);
    EXPECT_NEAR(estimator.variance(i), covariance(i, i), 1e-10 * covariance(i, i));
  }
}

TEST(RecursiveLeastSquares, RefusesNumbersThatAreNotFiniteAndKeepsItsState) {
  auto estimator = make<double>(0.99);
  Estimator<double>::Row w{1, 2, 3, 4, 5, 6};
  Estimator<double>::Record record;
  ASSERT_EQ(estimator.update(w, 1.0, 0.0, record), Status::kOk);
  const auto before = estimator.solution();
  const double variance = estimator.variance(2);
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  EXPECT_EQ(estimator.update(w, nan, 0.0, record), Status::kNonFiniteInput);
  EXPECT_EQ(estimator.update(w, -inf, 0.0, record), Status::kNonFiniteInput);
  w[3] = nan;
  EXPECT_EQ(estimator.update(w, 1.0, 0.0, record), Status::kNonFiniteInput);
  w[3] = inf;
  EXPECT_EQ(estimator.update(w, 1.0, 0.0, record), Status::kNonFiniteInput);
  EXPECT_EQ(estimator.solution(), before);
  EXPECT_EQ(estimator.variance(2), variance);
}

TEST(RecursiveLeastSquares, RefusesSettingsOutOfRangeAndWorkBeforeSettings) {
  Estimator<double> estimator;
  Estimator<double>::Row w{}, variance;
  variance.fill(1.0);
  Estimator<double>::Record record;
  EXPECT_EQ(estimator.update(w, 0.0, 0.0, record), Status::kNotConfigured);
  Estimator<double>::Config config;
  config.forgetting_factor = 1.1;
  EXPECT_EQ(estimator.configure(config, w, variance), Status::kOutOfRange);
  EXPECT_EQ(estimator.update(w, 0.0, 0.0, record), Status::kNotConfigured) << "refused settings are none";
}

TEST(RecursiveLeastSquares, KeepsItsStateWhenSettingsAreRefused) {
  auto estimator = make<double>(0.99, 5.0), untouched = make<double>(0.99, 5.0);
  std::mt19937_64 random(8);
  std::normal_distribution<double> normal;
  Estimator<double>::Record record, other_record;
  // What a refused configure() changed would show in the estimate now, or in what later samples make of it.
  for (int n = 0; n < 60; ++n) {
    if (n == 30) {
      const auto status_with = [&](auto change) {
        Estimator<double>::Config config;
        Estimator<double>::Row prior{}, variance;
        prior.fill(7.0);
        variance.fill(3.0);
        change(config, prior, variance);
        return estimator.configure(config, prior, variance);
      };
      EXPECT_EQ(status_with([](auto& c, auto&, auto&) { c.forgetting_factor = 1.1; }), Status::kOutOfRange);
      EXPECT_EQ(status_with([](auto& c, auto&, auto&) { c.forgetting_factor = 0.0; }), Status::kOutOfRange);
      EXPECT_EQ(status_with([](auto&, auto&, auto& variance) { variance[5] = 0.0; }), Status::kOutOfRange);
      EXPECT_EQ(status_with([](auto&, auto& prior, auto&) { prior[5] = std::nan(""); }),
                Status::kNonFiniteInput);
    }
    Estimator<double>::Row w;
    for (double& v : w) v = normal(random);
    const double y = normal(random);
    ASSERT_EQ(estimator.update(w, y, 0.0, record), Status::kOk);
    ASSERT_EQ(untouched.update(w, y, 0.0, other_record), Status::kOk);
    ASSERT_EQ(record.used, other_record.used) << "sample " << n;
  }
  EXPECT_EQ(estimator.solution(), untouched.solution());
  for (int i = 0; i < kP; ++i) EXPECT_EQ(estimator.variance(i), untouched.variance(i)) << "parameter " << i;
}

TEST(RecursiveLeastSquares, DoesNotWindUpWithoutExcitation) {
  auto estimator = make<double>(0.98);
  std::mt19937_64 random(2);
  std::normal_distribution<double> normal;
  Estimator<double>::Record record;
  Estimator<double>::Row w{};
  for (int n = 0; n < 2000; ++n) {
    double y = 0;
    for (double& v : w) {
      v = normal(random);
      y += v;
    }
    ASSERT_EQ(estimator.update(w, y + 0.5 * normal(random), 0.0, record), Status::kOk);
  }
  const auto before = estimator.solution();
  // A million samples of nothing, then of one and the same direction.
  for (int n = 0; n < 1000000; ++n) {
    ASSERT_EQ(estimator.update(Estimator<double>::Row{}, 0.5 * normal(random), 0.0, record), Status::kOk);
  }
  for (std::size_t i = 0; i < kP; ++i) {
    EXPECT_EQ(estimator.solution()[i], before[i]);
  }
  for (int n = 0; n < 200000; ++n) {
    ASSERT_EQ(estimator.update({1, 0, 0, 0, 0, 0}, 1.0 + 0.5 * normal(random), 0.0, record), Status::kOk);
  }
  for (int i = 0; i < kP; ++i) {
    EXPECT_LT(estimator.variance(i), 100.0) << "parameter " << i;
    EXPECT_NEAR(estimator.solution()[static_cast<std::size_t>(i)], 1.0, 0.5) << "parameter " << i;
  }
}

TEST(RecursiveLeastSquares, FollowsAChangeWhenItForgets) {
  auto estimator = make<double>(0.98);
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  Estimator<double>::Record record;
  for (int n = 0; n < 6000; ++n) {
    Estimator<double>::Row w;
    double y = 0;
    for (double& v : w) {
      v = normal(random);
      y += v * (n < 3000 ? 1.0 : 3.0);
    }
    ASSERT_EQ(estimator.update(w, y + 0.1 * normal(random), 0.0, record), Status::kOk);
  }
  for (const double x : estimator.solution()) {
    EXPECT_NEAR(x, 3.0, 0.3);
  }
}

TEST(RecursiveLeastSquares, GateKeepsOutliersOut) {
  auto gated = make<double>(1.0, 5.0), open = make<double>(1.0);
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal;
  Estimator<double>::Record record;
  int refused = 0;
  for (int n = 0; n < 3000; ++n) {
    Estimator<double>::Row w;
    double y = 0;
    for (double& v : w) {
      v = normal(random);
      y += v;
    }
    y += n > 500 && n % 20 == 0 ? 100.0 : 0.5 * normal(random);
    ASSERT_EQ(gated.update(w, y, 0.0, record), Status::kOk);
    refused += record.used ? 0 : 1;
    ASSERT_EQ(open.update(w, y, 0.0, record), Status::kOk);
  }
  EXPECT_NEAR(refused, 124, 3);
  double worst_gated = 0, worst_open = 0;
  for (std::size_t i = 0; i < kP; ++i) {
    worst_gated = std::max(worst_gated, std::abs(gated.solution()[i] - 1));
    worst_open = std::max(worst_open, std::abs(open.solution()[i] - 1));
  }
  EXPECT_LT(worst_gated, 0.05);
  EXPECT_GT(worst_open, worst_gated);
}

TEST(RecursiveLeastSquares, KeepsItsVariancesPositiveInFloat) {
  // Nearly dependent columns, narrow noise, many rows: where the plain covariance recursion loses definiteness.
  RecursiveLeastSquares<float, kP> estimator;
  RecursiveLeastSquares<float, kP>::Row prior{}, variance;
  variance.fill(1e6F);
  RecursiveLeastSquares<float, kP>::Config config;
  config.noise_variance = 1e-4F;
  ASSERT_EQ(estimator.configure(config, prior, variance), Status::kOk);
  std::mt19937_64 random(5);
  std::normal_distribution<float> normal;
  RecursiveLeastSquares<float, kP>::Record record;
  for (int n = 0; n < 100000; ++n) {
    const float a = normal(random);
    RecursiveLeastSquares<float, kP>::Row w;
    float y = 0;
    for (float& v : w) {
      v = a + 1e-3F * normal(random);
      y += v;
    }
    ASSERT_EQ(estimator.update(w, y, 0.0F, record), Status::kOk);
  }
  for (int i = 0; i < kP; ++i) {
    EXPECT_GT(estimator.variance(i), 0.0F);
    EXPECT_LT(estimator.variance(i), 1e6F);
  }
}

/// Payload on the UR5: regressor rows on random states, exact torques.
class Payload : public ::testing::TestWithParam<int> {};

TEST_P(Payload, IsFoundFromRowsKToN) {
  const int first = GetParam();
  test::Random random(6);
  const DynamicArm<double, 6> bare(model::Ur5Arm::kModel);
  auto loaded_model = model::Ur5Arm::kModel;
  const auto body = test::random_body(random);
  for (std::size_t i = 0; i < 10; ++i) {
    loaded_model.links[5][i] += body[i];
  }
  const DynamicArm<double, 6> loaded(loaded_model);
  PayloadEstimator<double, 6> estimator;
  PayloadEstimator<double, 6>::Config config;
  config.first_row = first;
  config.noise_std.setConstant(1e-6);
  config.gate = 0;
  ASSERT_EQ(estimator.configure(config), Status::kOk);
  for (int n = 0; n < 200; ++n) {
    const auto q = test::random_vector<6>(random, 3), qd = test::random_vector<6>(random, 2),
               qdd = test::random_vector<6>(random, 5);
    LinkRegressor<double, 6> Y;
    link_regressor(bare, joint_trigonometry<DynamicArm<double, 6>>(q), q, qd, qdd, Y);
    const JointVector<double, 6> residual =
        inverse_dynamics(loaded, q, qd, qdd) - inverse_dynamics(bare, q, qd, qdd);
    PayloadEstimator<double, 6>::Record record;
    ASSERT_EQ(estimator.update(Y, qd, residual, record), Status::kOk);
    EXPECT_EQ(record.rows_used, 6 - first);
  }
  const bool sees_mass = first <= 3;  // core/estimate/README.md, section 6: rows 5, 6 do not
  EXPECT_EQ(estimator.identifiable(0), sees_mass);
  if (sees_mass) {
    for (std::size_t i = 0; i < 10; ++i) {
      EXPECT_NEAR(estimator.payload()[i], body[i], 1e-5) << "parameter " << i;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(K1To5, Payload, ::testing::Values(0, 1, 2, 3, 4));

/// P + (prior − P_ii) e eᵀ: the estimate that as much process noise on one parameter gives.
TEST(RecursiveLeastSquares, AParameterThatHasChangedIsAsUncertainAsThePriorAndNoOtherIs) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  auto estimator = make<double>(1.0);
  const auto learn = [&] {
    Estimator<double>::Row w;
    for (double& v : w) v = normal(random);
    Estimator<double>::Record record;
    ASSERT_EQ(estimator.update(w, normal(random), 0.0, record), Status::kOk);
  };
  for (int n = 0; n < 30; ++n) learn();
  for (const int changed : {0, 2, kP - 1}) {
    const auto before = estimator;
    estimator.widen(changed);
    EXPECT_EQ(estimator.solution(), before.solution());
    for (int i = 0; i < kP; ++i) {
      for (int j = 0; j < kP; ++j) {
        const bool own = i == changed && j == changed;
        EXPECT_NEAR(estimator.covariance(i, j), own ? 100.0 : before.covariance(i, j), 1e-9) << i << j;
      }
    }
    estimator.replace(changed, 7.0);
    EXPECT_EQ(estimator.solution()[static_cast<std::size_t>(changed)], 7.0);
    EXPECT_NEAR(estimator.covariance(changed, changed), 100.0, 1e-9);
    learn();
  }
}

TEST(PayloadEstimator, LeavesOutStandstillAndRefusesNan) {
  PayloadEstimator<double, 6> estimator;
  PayloadEstimator<double, 6>::Config config;
  config.standstill_speed = 0.01;
  ASSERT_EQ(estimator.configure(config), Status::kOk);
  LinkRegressor<double, 6> Y = LinkRegressor<double, 6>::Ones();
  JointVector<double, 6> qd = JointVector<double, 6>::Zero(), residual = JointVector<double, 6>::Ones();
  PayloadEstimator<double, 6>::Record record;
  ASSERT_EQ(estimator.update(Y, qd, residual, record), Status::kOk);
  EXPECT_TRUE(record.standstill);
  EXPECT_EQ(estimator.payload()[0], 0.0);
  qd.setOnes();
  residual[2] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(estimator.update(Y, qd, residual, record), Status::kNonFiniteInput);
  EXPECT_EQ(estimator.payload()[0], 0.0);
}

TEST(PayloadEstimator, KeepsItsStateWhenSettingsAreRefused) {
  PayloadEstimator<double, 6> estimator, untouched;
  ASSERT_EQ(estimator.configure({}), Status::kOk);
  ASSERT_EQ(untouched.configure({}), Status::kOk);
  test::Random random(9);
  PayloadEstimator<double, 6>::Record record;
  const JointVector<double, 6> qd = JointVector<double, 6>::Ones();
  for (int n = 0; n < 40; ++n) {
    if (n == 20) {
      const auto status_with = [&](auto change) {
        PayloadEstimator<double, 6>::Config config;
        config.first_row = 2;
        config.sign_width = 1.0;
        change(config);
        return estimator.configure(config);
      };
      EXPECT_EQ(status_with([](auto& c) { c.first_row = 6; }), Status::kOutOfRange);
      EXPECT_EQ(status_with([](auto& c) { c.mass_prior = 0.0; }), Status::kOutOfRange);
      EXPECT_EQ(status_with([](auto& c) { c.noise_std[5] = -1.0; }), Status::kOutOfRange);
      EXPECT_EQ(status_with([](auto& c) { c.forgetting_factor = 1.1; }), Status::kOutOfRange);
    }
    LinkRegressor<double, 6> Y;
    for (Eigen::Index i = 0; i < Y.size(); ++i) Y(i) = test::random_vector<1>(random, 1.0)[0];
    const JointVector<double, 6> residual = test::random_vector<6>(random, 1.0);
    ASSERT_EQ(estimator.update(Y, qd, residual, record), Status::kOk);
    ASSERT_EQ(untouched.update(Y, qd, residual, record), Status::kOk);
  }
  EXPECT_NE(untouched.payload()[0], 0.0) << "nothing was estimated";
  EXPECT_EQ(estimator.payload(), untouched.payload());
}

}  // namespace
}  // namespace heft
