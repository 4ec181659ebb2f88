/// Directional forgetting against its closed form, against exponential forgetting, which winds up, and against leakage.
#include "heft/core/estimate/directional_least_squares.hpp"

#include <cmath>
#include <limits>
#include <random>
#include <sstream>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "heft/core/estimate/recursive_least_squares.hpp"

namespace heft {
namespace {

constexpr int kP = 4;
using Vector = Eigen::Matrix<double, kP, 1>;
using Matrix = Eigen::Matrix<double, kP, kP>;

template <typename Scalar, int Rows = 1>
DirectionalLeastSquares<Scalar, kP, Rows> make(double forgetting, double noise, double prior_variance,
                                               double gate = 0) {
  DirectionalLeastSquares<Scalar, kP, Rows> estimator;
  typename DirectionalLeastSquares<Scalar, kP, Rows>::Config config;
  config.forgetting_factor = static_cast<Scalar>(forgetting);
  config.noise_variance.fill(static_cast<Scalar>(noise));
  config.gate = static_cast<Scalar>(gate);
  typename DirectionalLeastSquares<Scalar, kP, Rows>::Row prior{}, variance;
  variance.fill(static_cast<Scalar>(prior_variance));
  EXPECT_EQ(estimator.configure(config, prior, variance), Status::kOk);
  return estimator;
}

template <typename Scalar>
std::array<Scalar, kP> row_of(const Vector& v) {
  std::array<Scalar, kP> row;
  for (int i = 0; i < kP; ++i) row[static_cast<std::size_t>(i)] = static_cast<Scalar>(v[i]);
  return row;
}

Vector random_vector(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  return Vector::NullaryExpr([&] { return normal(random); });
}

/// The information form written down: R − (1 − λ) R Wᵀ (W R Wᵀ)⁻¹ W R + Wᵀ W / σ², with the right side R x.
TEST(DirectionalLeastSquares, EqualsTheClosedFormOfTheInformationMatrix) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  constexpr double kNoise = 0.25, kForget = 0.9;
  auto estimator = make<double, 2>(kForget, kNoise, 1e8);
  Matrix R = Matrix::Identity() / 1e8;
  Vector x = Vector::Zero();
  int compared = 0;
  for (int n = 0; n < 300; ++n) {
    const Vector a = random_vector(random), b = random_vector(random);
    const Eigen::Vector2d y(a.sum() + normal(random), b.sum() + normal(random));
    Eigen::Matrix<double, 2, kP> W;
    W << a.transpose(), b.transpose();
    const Eigen::Matrix2d seen = W * R * W.transpose();
    R -= (1 - kForget) * R * W.transpose() * seen.inverse() * W * R;
    R += W.transpose() * W / kNoise;
    x += R.inverse() * W.transpose() * (y - W * x) / kNoise;
    decltype(estimator)::Record record;
    ASSERT_EQ(estimator.update({row_of<double>(a), row_of<double>(b)}, {y[0], y[1]}, record), Status::kOk);
    EXPECT_EQ(record.used, 3U);
    EXPECT_EQ(record.forgot, 3U);
    if (n < 5) {  // while a variance is at the prior's, less is forgotten
      Matrix P;
      for (int i = 0; i < kP; ++i) {
        for (int j = 0; j < kP; ++j) P(i, j) = estimator.covariance(i, j);
      }
      R = P.inverse();
      x = Vector::Map(estimator.solution().data());
      continue;
    }
    const Matrix P = R.inverse();
    ++compared;
    for (int i = 0; i < kP; ++i) {
      ASSERT_NEAR(estimator.solution()[static_cast<std::size_t>(i)], x[i], 1e-6) << n;
      for (int j = 0; j < kP; ++j) {
        ASSERT_NEAR(estimator.covariance(i, j), P(i, j), 1e-6 * std::sqrt(P(i, i) * P(j, j))) << n;
      }
    }
  }
  EXPECT_EQ(compared, 295);
}

TEST(DirectionalLeastSquares, WithoutForgettingIsTheBatchEstimate) {
  std::mt19937_64 random(2);
  std::normal_distribution<double> normal;
  auto estimator = make<double>(1.0, 0.25, 100);
  Matrix R = Matrix::Identity() / 100;
  Vector right = Vector::Zero();
  for (int n = 0; n < 200; ++n) {
    const Vector w = random_vector(random);
    const double y = w.sum() + 0.5 * normal(random);
    R += w * w.transpose() / 0.25, right += w * y / 0.25;
    decltype(estimator)::Record record;
    ASSERT_EQ(estimator.update({row_of<double>(w)}, {y}, record), Status::kOk);
  }
  const Vector x = R.inverse() * right;
  for (int i = 0; i < kP; ++i) EXPECT_NEAR(estimator.solution()[static_cast<std::size_t>(i)], x[i], 1e-10);
}

TEST(DirectionalLeastSquares, ForgetsOnceADirectionThatSeveralRowsShare) {
  // Three equal rows of a sample are one row of a third of the variance.
  auto three = make<double, 3>(0.9, 3.0, 100);
  auto one = make<double, 1>(0.9, 1.0, 100);
  std::mt19937_64 random(3);
  for (int n = 0; n < 50; ++n) {
    const auto w = row_of<double>(random_vector(random));
    decltype(three)::Record record;
    decltype(one)::Record single;
    ASSERT_EQ(three.update({w, w, w}, {1.0, 1.0, 1.0}, record), Status::kOk);
    ASSERT_EQ(one.update({w}, {1.0}, single), Status::kOk);
    EXPECT_EQ(record.forgot, 1U);
  }
  for (int i = 0; i < kP; ++i) EXPECT_NEAR(three.variance(i), one.variance(i), 1e-9 * one.variance(i));
}

/// Exponential forgetting as textbooks print it.
struct Exponential {
  double forgetting;
  Matrix P = Matrix::Identity();
  Vector x = Vector::Zero();
  void update(const Vector& w, double y, double noise) {
    P /= forgetting;
    const Vector gain = P * w / (w.dot(P * w) + noise);
    x += gain * (y - w.dot(x));
    P -= gain * (P * w).transpose();
    P = 0.5 * (P + P.transpose()).eval();
  }
};

/// What README.md, section 12, states: 2000 rows in all directions, then rows of one direction, and in the end a change that shows
/// in all of them again.
struct Comparison {
  double largest_variance{0};  ///< of a parameter without excitation
  double drift{0};             ///< largest change without excitation of what the rows do not show
  double error{0};             ///< rms of the estimates in the last 500 of the first rows
  int lag{0};                  ///< rows after the change until the mean error is below 1/e of it
};

template <typename Update, typename Solution, typename Variance>
Comparison compare(Update update, Solution solution, Variance variance, int without_excitation) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal;
  Comparison found;
  for (int n = 0; n < 2000; ++n) {
    const Vector w = random_vector(random);
    update(w, w.sum() + 0.5 * normal(random));
    if (n >= 1500) found.error += (solution() - Vector::Ones()).squaredNorm() / (500 * kP);
  }
  found.error = std::sqrt(found.error);
  const Vector before = solution();
  for (int n = 0; n < without_excitation; ++n) {
    const Vector w = Vector::Unit(0);
    update(w, w.sum() + 0.5 * normal(random));
    for (int i = 0; i < kP; ++i) found.largest_variance = std::max(found.largest_variance, variance(i));
    found.drift = std::max(found.drift, Vector(solution() - before).tail(kP - 1).norm());
  }
  for (int n = 0; n < 3000; ++n) {
    const Vector w = random_vector(random);
    update(w, 3 * w.sum() + 0.5 * normal(random));
    found.lag = found.lag == 0 && std::abs(solution().mean() - 3) < 2 / std::exp(1.0) ? n + 1 : found.lag;
  }
  return found;
}

Comparison compare_directional(double forgetting, int rows) {
  auto estimator = make<double>(forgetting, 0.25, 1.0);
  return compare(
      [&](const Vector& w, double y) {
        decltype(estimator)::Record record;
        ASSERT_EQ(estimator.update({row_of<double>(w)}, {y}, record), Status::kOk);
      },
      [&] { return Vector(Vector::Map(estimator.solution().data())); },
      [&](int i) { return estimator.variance(i); }, rows);
}

Comparison compare_leakage(double forgetting, int rows) {
  RecursiveLeastSquares<double, kP> estimator;
  RecursiveLeastSquares<double, kP>::Config config;
  config.forgetting_factor = forgetting, config.noise_variance = 0.25;
  EXPECT_EQ(estimator.configure(config, {}, {1.0, 1.0, 1.0, 1.0}), Status::kOk);
  return compare(
      [&](const Vector& w, double y) {
        RecursiveLeastSquares<double, kP>::Record record;
        ASSERT_EQ(estimator.update(row_of<double>(w), y, 0.0, record), Status::kOk);
      },
      [&] { return Vector(Vector::Map(estimator.solution().data())); },
      [&](int i) { return estimator.variance(i); }, rows);
}

/// One row of four parameters shows a quarter of the directions: to forget as fast as λ = 0.98 of everything it takes 1 − 4 · 0.02.
TEST(DirectionalLeastSquares,
     KeepsWhatIsNotShownWhereExponentialForgettingWindsUpAndLeakageReturnsToThePrior) {
  const auto exponential = [](int rows) {
    Exponential plain{0.98};
    return compare([&](const Vector& w, double y) { plain.update(w, y, 0.25); }, [&] { return plain.x; },
                   [&](int i) { return plain.P(i, i); }, rows);
  };
  // Without rows of one direction in between: error and lag. With them: variance and drift.
  const Comparison quick[] = {exponential(0), compare_leakage(0.98, 0), compare_directional(0.92, 0)};
  const Comparison rested[] = {exponential(1500), compare_leakage(0.98, 20'000),
                               compare_directional(0.92, 20'000)};
  const char* names[] = {"exponential", "leakage", "directional"};
  for (int i = 0; i < 3; ++i) {
    std::ostringstream row;
    row << "error " << quick[i].error << " lag " << quick[i].lag << " variance " << rested[i].largest_variance
        << " wandered " << rested[i].drift;
    RecordProperty(names[i], row.str());
  }
  // 1500 rows multiply a variance by 1.02^1500 = 1e13.
  EXPECT_GT(rested[0].largest_variance, 1e9);
  EXPECT_LE(rested[1].largest_variance, 1.0 + 1e-9);
  EXPECT_GT(rested[1].largest_variance, 0.5) << "returns to the prior's 1";
  // With excitation a variance is some p (1 − λ) σ² / m = 0.02.
  EXPECT_LT(rested[2].largest_variance, 0.05);
  EXPECT_LT(rested[2].drift, rested[1].drift);
  // All three forget alike what is shown.
  EXPECT_NEAR(quick[1].error, quick[0].error, 0.2 * quick[0].error);
  EXPECT_NEAR(quick[2].error, quick[0].error, 0.2 * quick[0].error);
  EXPECT_NEAR(quick[2].lag, quick[0].lag, 25);
}

template <typename Scalar>
class DirectionalBound : public ::testing::Test {};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(DirectionalBound, Scalars);

/// Rows of rounding and noise, of one direction, of all, of nothing, huge ones: no variance leaves [0, prior].
TYPED_TEST(DirectionalBound, VariancesStayWithinThePriorWhateverTheRows) {
  auto estimator = make<TypeParam, 2>(0.95, 0.01, 4.0);
  std::mt19937_64 random(5);
  typename decltype(estimator)::Record record;
  long looked_at = 0;
  for (int n = 0; n < 60'000; ++n) {
    Vector a = random_vector(random), b = random_vector(random);
    switch (n / 5000 % 6) {
      case 0: a *= 1e-3, b *= 1e-3; break;
      case 1: a = Vector::Unit(1), b = a * (1 + 1e-7); break;
      case 2: b = a + 1e-6 * b; break;
      case 3: a.setZero(), b.setZero(); break;
      case 4: a *= 1e4, b *= 1e-4; break;
      default: break;
    }
    const double y = n % 1000 == 7 ? 1e7 : a.sum();
    ASSERT_EQ(estimator.update({row_of<TypeParam>(a), row_of<TypeParam>(b)},
                               {static_cast<TypeParam>(y), static_cast<TypeParam>(b.sum())}, record),
              Status::kOk);
    for (int i = 0; i < kP; ++i) {
      ASSERT_GT(estimator.variance(i), TypeParam(0)) << n;
      ASSERT_LE(estimator.variance(i), TypeParam(4.0001)) << n;
      ASSERT_TRUE(std::isfinite(estimator.solution()[static_cast<std::size_t>(i)])) << n;
      ++looked_at;
    }
  }
  EXPECT_EQ(looked_at, 60'000 * kP);
}

/// Two rows a sample that bring hardly more than the prior has, and fast forgetting: without its limit a variance comes to nine times
/// the prior's.
TYPED_TEST(DirectionalBound, VariancesStayWithinThePriorWhereRowsBringLittle) {
  auto estimator = make<TypeParam, 2>(0.5, 1.0, 1.0);
  std::mt19937_64 random(7);
  typename decltype(estimator)::Record record;
  int forgot = 0;
  for (int n = 0; n < 20'000; ++n) {
    const Vector stretch(1, 1, 1, 0.1);
    const Vector a = 1.005 * random_vector(random).cwiseProduct(stretch).normalized(),
                 b = 1.005 * random_vector(random).cwiseProduct(stretch).normalized();
    ASSERT_EQ(estimator.update({row_of<TypeParam>(a), row_of<TypeParam>(b)}, {}, record), Status::kOk);
    forgot += record.forgot == 3U ? 1 : 0;
    for (int i = 0; i < kP; ++i) ASSERT_LE(estimator.variance(i), TypeParam(1.0001)) << n;
  }
  EXPECT_GT(forgot, 10'000);
}

TYPED_TEST(DirectionalBound, ARowTooWeakToImproveThePriorMakesNothingBeForgotten) {
  auto estimator = make<TypeParam>(0.9, 1.0, 1.0);
  typename decltype(estimator)::Record record;
  for (int n = 0; n < 100; ++n) {
    const Vector w = Vector::Unit(n % kP);
    ASSERT_EQ(estimator.update({row_of<TypeParam>(w)}, {TypeParam(1)}, record), Status::kOk);
  }
  const TypeParam before = estimator.variance(2);
  for (int n = 0; n < 100'000; ++n) {
    ASSERT_EQ(estimator.update({row_of<TypeParam>(0.01 * Vector::Unit(n % kP))}, {TypeParam(0.01)}, record),
              Status::kOk);
    ASSERT_EQ(record.forgot, 0U);
  }
  EXPECT_LE(estimator.variance(2), before);
}

TYPED_TEST(DirectionalBound, AnOutlierIsLeftOutAndMakesNothingBeForgotten) {
  auto gated = make<TypeParam, 2>(0.95, 0.01, 4.0, 5), without = make<TypeParam, 2>(0.95, 0.01, 4.0, 5);
  std::mt19937_64 random(6);
  typename decltype(gated)::Record record;
  const auto take = [&](auto& estimator, const Vector& a, const Vector& b, double error) {
    ASSERT_EQ(
        estimator.update({row_of<TypeParam>(a), row_of<TypeParam>(b)},
                         {static_cast<TypeParam>(a.sum()), static_cast<TypeParam>(b.sum() + error)}, record),
        Status::kOk);
  };
  for (int n = 0; n < 100; ++n) {
    const Vector a = random_vector(random), b = random_vector(random);
    take(gated, a, b, 0), take(without, a, b, 0);
  }
  take(gated, Vector::Zero(), random_vector(random), 100.0);
  EXPECT_EQ(record.used, 1U);
  EXPECT_EQ(record.forgot, 0U);
  for (int i = 0; i < kP; ++i) {
    EXPECT_EQ(gated.variance(i), without.variance(i));
    EXPECT_EQ(gated.solution()[static_cast<std::size_t>(i)], without.solution()[static_cast<std::size_t>(i)]);
  }
}

TYPED_TEST(DirectionalBound, RefusesNumbersThatAreNotFiniteAndSettingsOutOfRange) {
  using Scalar = TypeParam;
  DirectionalLeastSquares<Scalar, kP> estimator;
  typename decltype(estimator)::Record record;
  const auto w = row_of<Scalar>(Vector::Ones());
  EXPECT_EQ(estimator.update({w}, {Scalar(1)}, record), Status::kNotConfigured);
  typename decltype(estimator)::Config config;
  std::array<Scalar, kP> variance;
  variance.fill(Scalar(1));
  config.forgetting_factor = Scalar(1.1);
  EXPECT_EQ(estimator.configure(config, {}, variance), Status::kOutOfRange);
  config.forgetting_factor = Scalar(0.9);
  config.noise_variance[0] = Scalar(-1);
  EXPECT_EQ(estimator.configure(config, {}, variance), Status::kOutOfRange);
  estimator = make<Scalar>(0.9, 1.0, 1.0);
  ASSERT_EQ(estimator.update({w}, {Scalar(1)}, record), Status::kOk);
  const auto before = estimator.solution();
  for (const Scalar bad : {std::numeric_limits<Scalar>::quiet_NaN(), std::numeric_limits<Scalar>::infinity(),
                           std::numeric_limits<Scalar>::max()}) {
    auto broken = w;
    broken[1] = bad;
    EXPECT_EQ(estimator.update({w}, {bad}, record), Status::kNonFiniteInput);
    EXPECT_EQ(estimator.update({broken}, {Scalar(1)}, record), Status::kNonFiniteInput);
  }
  EXPECT_EQ(estimator.solution(), before);
}

}  // namespace
}  // namespace heft
