// Recursive least squares, payload estimator and filters under numbers that no sensor should give, in both precisions.
#include <cmath>
#include <initializer_list>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "heft/core/dynamics/regressor.hpp"
#include "heft/core/estimate/instruments.hpp"
#include "heft/core/estimate/payload_estimator.hpp"
#include "heft/core/filter/state_variable_filter.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/model/named_arms.hpp"
#include "support/random_arm.hpp"

namespace heft {
namespace {

constexpr int kP = 6;

template <typename Scalar>
class HugeNumbers : public ::testing::Test {
 public:
  using Recursion = RecursiveLeastSquares<Scalar, kP>;
  using Row = typename Recursion::Row;
  static constexpr Scalar kNan = std::numeric_limits<Scalar>::quiet_NaN();
  static constexpr Scalar kInf = std::numeric_limits<Scalar>::infinity();
  static constexpr Scalar kMax = std::numeric_limits<Scalar>::max();

  static Row row_of(Scalar value) {
    Row row;
    row.fill(value);
    return row;
  }
  Row random_row() {
    Row row;
    for (Scalar& v : row) v = static_cast<Scalar>(normal(random));
    return row;
  }
  /// Rows of parameters 1, with noise of 0.5.
  void feed(Recursion& estimator, int rows, Scalar parameter = Scalar(1)) {
    typename Recursion::Record record;
    for (int n = 0; n < rows; ++n) {
      const Row w = random_row();
      Scalar y = static_cast<Scalar>(0.5 * normal(random));
      for (const Scalar& v : w) y += parameter * v;
      ASSERT_EQ(estimator.update(w, y, Scalar(0), record), Status::kOk);
    }
  }
  static Recursion configured(Scalar forgetting, Scalar gate) {
    typename Recursion::Config config;
    config.forgetting_factor = forgetting;
    config.noise_variance = static_cast<Scalar>(0.25);
    config.gate = gate;
    Recursion estimator;
    EXPECT_EQ(estimator.configure(config, Row{}, row_of(100)), Status::kOk);
    return estimator;
  }
  static void expect_finite(const Recursion& estimator, const char* what) {
    for (int i = 0; i < kP; ++i) {
      EXPECT_TRUE(std::isfinite(estimator.solution()[static_cast<std::size_t>(i)])) << what;
      EXPECT_TRUE(std::isfinite(estimator.variance(i)) && estimator.variance(i) > 0) << what;
    }
  }

  std::mt19937_64 random{1};
  std::normal_distribution<double> normal;
};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(HugeNumbers, Scalars);

TYPED_TEST(HugeNumbers, RecursionRefusesThemAndIsWhatItWas) {
  using Rls = typename TestFixture::Recursion;
  for (const TypeParam gate : {TypeParam(0), TypeParam(5)}) {
    Rls estimator = this->configured(TypeParam(0.98), gate);
    this->feed(estimator, 300);
    const auto x = estimator.solution();
    const TypeParam variance = estimator.variance(2);
    typename Rls::Record record;
    const TypeParam huge = std::is_same_v<TypeParam, float> ? TypeParam(1e30) : static_cast<TypeParam>(1e160);
    for (const TypeParam bad : {huge, -huge, this->kMax, this->kInf, this->kNan}) {
      auto w = this->random_row();
      w[3] = bad;
      EXPECT_EQ(estimator.update(w, TypeParam(1), TypeParam(0), record), Status::kNonFiniteInput) << bad;
      EXPECT_EQ(estimator.update(this->random_row(), bad, TypeParam(0), record), Status::kNonFiniteInput)
          << bad;
      EXPECT_NE(estimator.update(this->random_row(), TypeParam(1), bad, record), Status::kOk)
          << "noise " << bad;
      EXPECT_FALSE(record.used);
    }
    EXPECT_NE(estimator.update(this->random_row(), TypeParam(1), TypeParam(-1), record), Status::kOk);
    EXPECT_EQ(estimator.solution(), x);
    EXPECT_EQ(estimator.variance(2), variance);
    this->feed(estimator, 300);
    for (const TypeParam v : estimator.solution()) EXPECT_NEAR(v, 1, 0.5);
  }
}

TYPED_TEST(HugeNumbers, OutliersOfEverySizeThatIsAcceptedLeaveTheRecursionFinite) {
  using Rls = typename TestFixture::Recursion;
  for (double size = 1e2; size < 1.1 * kLargestInput<TypeParam>; size *= 100) {
    for (const TypeParam gate : {TypeParam(0), TypeParam(5)}) {
      Rls estimator = this->configured(TypeParam(0.98), gate);
      this->feed(estimator, 300);
      typename Rls::Record record;
      auto w = this->random_row();
      w[2] = static_cast<TypeParam>(0.99 * size);
      ASSERT_EQ(estimator.update(w, TypeParam(1), TypeParam(0), record), Status::kOk);
      if (gate > 0) {
        EXPECT_FALSE(record.used) << size;
      }
      ASSERT_EQ(
          estimator.update(this->random_row(), static_cast<TypeParam>(0.99 * size), TypeParam(0), record),
          Status::kOk);
      if (gate > 0) {
        EXPECT_FALSE(record.used) << size;
      }
      this->expect_finite(estimator, "after the outlier");
      // Forgotten after ln(size²) / (1 − λ) rows; the variance floor bounds it.
      this->feed(estimator, 300 + static_cast<int>(50 * 2 * std::log(size)));
      this->expect_finite(estimator, "later");
      for (const TypeParam v : estimator.solution()) EXPECT_NEAR(v, 1, 0.6) << size << " gate " << gate;
    }
  }
}

TYPED_TEST(HugeNumbers, RecursionRefusesSettingsThatWouldEndInNan) {
  using Rls = typename TestFixture::Recursion;
  const auto status_with = [&](auto change) {
    typename Rls::Config config;
    auto prior = this->row_of(0), variance = this->row_of(100);
    change(config, prior, variance);
    Rls estimator;
    return estimator.configure(config, prior, variance);
  };
  for (const TypeParam bad : {this->kNan, this->kInf, this->kMax}) {
    EXPECT_NE(status_with([&](auto&, auto& prior, auto&) { prior[1] = bad; }), Status::kOk) << bad;
    EXPECT_NE(status_with([&](auto&, auto&, auto& variance) { variance[1] = bad; }), Status::kOk) << bad;
    EXPECT_NE(status_with([&](auto& c, auto&, auto&) { c.noise_variance = bad; }), Status::kOk) << bad;
    EXPECT_NE(status_with([&](auto& c, auto&, auto&) { c.gate = bad; }), Status::kOk) << bad;
    EXPECT_NE(status_with([&](auto& c, auto&, auto&) { c.gate_noise_share = bad; }), Status::kOk) << bad;
    EXPECT_NE(status_with([&](auto& c, auto&, auto&) { c.forgetting_factor = bad; }), Status::kOk) << bad;
  }
  EXPECT_NE(status_with([&](auto& c, auto&, auto&) { c.forgetting_factor = TypeParam(1e-30); }), Status::kOk);
  EXPECT_NE(status_with([&](auto& c, auto&, auto&) { c.noise_variance = TypeParam(0); }), Status::kOk);
}

TYPED_TEST(HugeNumbers, PayloadEstimatorRefusesThemAndIsWhatItWas) {
  PayloadEstimator<TypeParam, 6> estimator;
  using Vector = JointVector<TypeParam, 6>;
  typename PayloadEstimator<TypeParam, 6>::Record record;
  LinkRegressor<TypeParam, 6> Y = LinkRegressor<TypeParam, 6>::Random();
  Vector qd = Vector::Ones(), residual = Vector::Ones();
  EXPECT_EQ(estimator.update(Y, qd, residual, record), Status::kNotConfigured);
  ASSERT_EQ(estimator.configure({}), Status::kOk);
  for (int n = 0; n < 50; ++n) {
    Y.setRandom();
    ASSERT_EQ(estimator.update(Y, qd, residual, record), Status::kOk);
  }
  const auto before = estimator.payload();
  for (const TypeParam bad : {this->kMax, -this->kMax, this->kInf, this->kNan}) {
    auto wild = Y;
    wild(3, 55) = bad;  // the last link's columns are those that are used
    EXPECT_EQ(estimator.update(wild, qd, residual, record), Status::kNonFiniteInput) << bad;
    Vector of_joint = residual;
    of_joint[5] = bad;  // behind five good rows
    EXPECT_EQ(estimator.update(Y, qd, of_joint, record), Status::kNonFiniteInput) << bad;
    of_joint = qd;
    of_joint[1] = bad;
    EXPECT_EQ(estimator.update(Y, of_joint, residual, record), Status::kNonFiniteInput) << bad;
  }
  EXPECT_EQ(estimator.payload(), before);
}

TYPED_TEST(HugeNumbers, StateVariableFilterRefusesThemAndIsWhatItWas) {
  using V = JointVector<TypeParam, 2>;
  StateVariableFilter<TypeParam, 2> filter;
  EXPECT_EQ(filter.configure(this->kMax), Status::kOutOfRange);
  ASSERT_EQ(filter.configure(TypeParam(20)), Status::kOk);
  const auto sample = [](int n) { return V(static_cast<TypeParam>(std::sin(0.01 * n)), TypeParam(1)); };
  for (int n = 0; n < 300; ++n) ASSERT_EQ(filter.update(sample(n), TypeParam(0.001)), Status::kOk);
  const V value = filter.value(), rate = filter.derivative();
  for (const TypeParam bad : {this->kMax, -this->kMax, this->kInf, this->kNan}) {
    EXPECT_EQ(filter.update(V(TypeParam(0), bad), TypeParam(0.001)), Status::kNonFiniteInput) << bad;
  }
  // No time for the input to change in: differences over such a period have no digit left.
  for (const double period : {1e-310, 1e-40, 1e-12}) {
    EXPECT_EQ(filter.update(V(TypeParam(0), TypeParam(0)), static_cast<TypeParam>(period)),
              Status::kOutOfRange);
  }
  EXPECT_EQ(filter.update(V(TypeParam(0), TypeParam(0)), this->kNan), Status::kOutOfRange);
  EXPECT_EQ(filter.value(), value);
  EXPECT_EQ(filter.derivative(), rate);
  for (int n = 300; n < 1200; ++n) ASSERT_EQ(filter.update(sample(n), TypeParam(0.001)), Status::kOk);
  EXPECT_NEAR(filter.value()[1], 1, 1e-5);
}

TYPED_TEST(HugeNumbers, LargestInputsOfTheFilterDieAway) {
  using V = JointVector<TypeParam, 1>;
  StateVariableFilter<TypeParam, 1> filter;
  ASSERT_EQ(filter.configure(TypeParam(1000)), Status::kOk);
  const TypeParam largest = static_cast<TypeParam>(0.99 * kLargestInput<TypeParam>);
  ASSERT_EQ(filter.update(V(TypeParam(0)), TypeParam(1e-3)), Status::kOk);
  ASSERT_EQ(filter.update(V(largest), TypeParam(1e-3)), Status::kOk);
  // e^-6 a millisecond: 1e70 is gone after 27, its second derivative (6e3² as large) with it.
  for (int n = 0; n < 100; ++n) ASSERT_EQ(filter.update(V(TypeParam(1)), TypeParam(1e-3)), Status::kOk) << n;
  EXPECT_NEAR(filter.value()[0], 1, 1e-4);
  EXPECT_NEAR(filter.second_derivative()[0], 0, 1);
}

TYPED_TEST(HugeNumbers, AccelerationModelLeavesThemOut) {
  using V = JointVector<TypeParam, 1>;
  JointAccelerationModel<TypeParam, 1> model, untouched;
  ASSERT_EQ(model.configure({}), Status::kOk);
  ASSERT_EQ(untouched.configure({}), Status::kOk);
  for (int n = 0; n < 20; ++n) {
    for (const TypeParam bad : {this->kMax, this->kInf, this->kNan}) static_cast<void>(model.update(V(bad)));
    const V u(static_cast<TypeParam>(std::sin(0.3 * n)));
    EXPECT_EQ(model.update(u), untouched.update(u));
  }
}

TYPED_TEST(HugeNumbers, InflateRaisesVariancesUpToTheirInitialValuesAndNothingElse) {
  using Rls = typename TestFixture::Recursion;
  Rls estimator;
  EXPECT_EQ(estimator.inflate(TypeParam(2)), Status::kNotConfigured);
  estimator = this->configured(TypeParam(1), TypeParam(0));
  this->feed(estimator, 100);
  const TypeParam before = estimator.variance(1), other = estimator.covariance(0, 3);
  for (const TypeParam bad : {TypeParam(0), TypeParam(-1), TypeParam(0.5), this->kNan, this->kInf}) {
    EXPECT_EQ(estimator.inflate(bad), Status::kOutOfRange) << bad;
  }
  EXPECT_EQ(estimator.variance(1), before);
  ASSERT_EQ(estimator.inflate(TypeParam(4)), Status::kOk);
  EXPECT_NEAR(estimator.variance(1), 4 * before, 1e-5 * before);
  EXPECT_NEAR(estimator.covariance(0, 3), 4 * other, 1e-5 * before);
  ASSERT_EQ(estimator.inflate(TypeParam(1e7)), Status::kOk);
  TypeParam largest = 0;
  for (int i = 0; i < kP; ++i) largest = std::max(largest, estimator.variance(i));
  EXPECT_NEAR(largest, 100, 1e-3) << "the initial variance";
  this->feed(estimator, 100, TypeParam(3));
  for (const TypeParam v : estimator.solution()) EXPECT_NEAR(v, 3, 0.3);
}

/// A payload on the UR5 that is put down, as a controller sees it.
template <typename Scalar>
class PayloadPutDown {
 public:
  using Estimator = PayloadEstimator<Scalar, 6>;
  using Vector = JointVector<Scalar, 6>;

  PayloadPutDown() {
    auto model = model::Ur5Arm::kModel;
    const InertialParameters<double> body{1.8, 0.0, 0.09, 0.18, 0.03, 0.0, 0.03, 0.0, -0.009, 0.01};
    for (std::size_t i = 0; i < 10; ++i) model.links[5][i] += body[i];
    loaded_ = DynamicArm<double, 6>(model);
  }

  /// Slow random-phase motion, sample by sample. @return mass after each sample
  std::vector<double> run(Estimator& estimator, int samples, int put_down_at, double noise) {
    std::vector<double> mass;
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal(0.0, noise);
    typename Estimator::Record record;
    for (int n = 0; n < samples; ++n) {
      JointVector<double, 6> q, qd, qdd;
      for (int i = 0; i < 6; ++i) {
        q[i] = qd[i] = qdd[i] = 0;
        for (int k = 1; k <= 3; ++k) {
          const double w = 0.7 * k + 0.11 * i, phase = 1.3 * k * i + w * 0.01 * n;
          q[i] += 0.5 / k * std::sin(phase);
          qd[i] += 0.5 / k * w * std::cos(phase);
          qdd[i] -= 0.5 / k * w * w * std::sin(phase);
        }
      }
      JointVector<double, 6> residual = JointVector<double, 6>::Zero();
      if (n < put_down_at)
        residual = inverse_dynamics(loaded_, q, qd, qdd) - inverse_dynamics(bare_, q, qd, qdd);
      for (int i = 0; i < 6; ++i) residual[i] += normal(random);
      LinkRegressor<double, 6> Y;
      link_regressor(bare_, joint_trigonometry<DynamicArm<double, 6>>(q), q, qd, qdd, Y);
      const LinkRegressor<Scalar, 6> narrow = Y.cast<Scalar>();
      EXPECT_EQ(estimator.update(narrow, qd.cast<Scalar>(), residual.cast<Scalar>(), record), Status::kOk);
      mass.push_back(static_cast<double>(estimator.payload()[0]));
    }
    return mass;
  }

 private:
  DynamicArm<double, 6> bare_{model::Ur5Arm::kModel}, loaded_{model::Ur5Arm::kModel};
};

TYPED_TEST(HugeNumbers, PayloadEstimatorForgetsASampleNotARow) {
  PayloadPutDown<TypeParam> arm;
  typename PayloadPutDown<TypeParam>::Estimator::Config config;
  config.gate = 0;
  config.noise_std.setConstant(TypeParam(0.3));
  config.forgetting_factor = TypeParam(0.999);  // a memory of 1000 samples: 90 % in 2300
  typename PayloadPutDown<TypeParam>::Estimator estimator;
  ASSERT_EQ(estimator.configure(config), Status::kOk);
  const auto mass = arm.run(estimator, 14000, 8000, 0.3);
  EXPECT_NEAR(mass[7999], 1.8, 0.05);
  EXPECT_GT(mass[8800], 0.3) << "six rows a sample must not forget six times";
  EXPECT_LT(std::abs(mass[11500]), 0.18) << "3.5 memories: e^-3.5 is 3 %";
}

TYPED_TEST(HugeNumbers, PayloadEstimatorFollowsAChangeWithItsDefaults) {
  PayloadPutDown<TypeParam> arm;
  typename PayloadPutDown<TypeParam>::Estimator::Config config;
  config.noise_std.setConstant(TypeParam(0.3));
  typename PayloadPutDown<TypeParam>::Estimator estimator;
  ASSERT_EQ(estimator.configure(config), Status::kOk);
  const auto mass = arm.run(estimator, 34000, 20000, 0.3);
  EXPECT_NEAR(mass[19999], 1.8, 0.03);
  EXPECT_LT(std::abs(mass[33999]), 0.18) << "14 000 samples are 2.8 memories of the default";
}

TYPED_TEST(HugeNumbers, LargestMagnitudeAnswersForAllNumbers) {
  const auto largest_of = [](std::initializer_list<TypeParam> values) {
    LargestMagnitude<TypeParam> found;
    for (const TypeParam& value : values) found.look(value);
    return found.largest();
  };
  constexpr TypeParam nan = TestFixture::kNan, infinity = TestFixture::kInf;
  EXPECT_EQ(largest_of({}), TypeParam(0));
  EXPECT_EQ(largest_of({TypeParam(-0.0), TypeParam(0)}), TypeParam(0));
  EXPECT_EQ(largest_of({TypeParam(1.5), TypeParam(-2.5), TypeParam(2)}), TypeParam(2.5));
  EXPECT_EQ(largest_of({TypeParam(1), -infinity, TypeParam(3)}), infinity);
  EXPECT_TRUE(std::isnan(largest_of({TypeParam(1), -nan, infinity, TypeParam(3)})));
  EXPECT_TRUE(is_usable(largest_of({static_cast<TypeParam>(-kLargestInput<TypeParam>)})));
  EXPECT_FALSE(is_usable(largest_of({TypeParam(1), nan, TypeParam(3)})));
}

TYPED_TEST(HugeNumbers, GateLetsInAChangeThatLastsAndKeepsOutliersOut) {
  using Rls = typename TestFixture::Recursion;
  Rls estimator = this->configured(TypeParam(0.99), TypeParam(5));
  this->feed(estimator, 2000);
  typename Rls::Record record;
  int let_in = 0;
  for (int n = 0; n < 2000; ++n) {
    const bool outlier = n % 10 == 0;
    const auto w = this->random_row();
    TypeParam y = static_cast<TypeParam>(outlier ? 1e4 : 0.5 * this->normal(this->random));
    for (const TypeParam& v : w) y += v;
    ASSERT_EQ(estimator.update(w, y, TypeParam(0), record), Status::kOk);
    let_in += outlier && record.used ? 1 : 0;
  }
  EXPECT_EQ(let_in, 0) << "a tenth of the rows are no change";
  this->feed(estimator, 1500, TypeParam(30));
  for (const TypeParam v : estimator.solution()) EXPECT_NEAR(v, 30, 0.5);
}

}  // namespace
}  // namespace heft
