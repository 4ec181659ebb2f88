// Long runs of the recursive estimators in both precisions. What they guard against shows only after the deferred gain
// has wrapped (every 13 816 samples at λ = 0.999), after hours at rest, or for glitches of one size at one moment.
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "heft/core/estimate/recursive_least_squares.hpp"
#include "support/terminal_link_faults.hpp"

namespace heft {
namespace {

using test::Glitch;
using test::struck;
using test::terminal_link_run;
using test::TerminalLinkSample;

/// Ten minutes of motion at 5 ms with and without payload, made once.
const std::vector<TerminalLinkSample>& motion(bool loaded) {
  static const std::vector<TerminalLinkSample> with = terminal_link_run(120000, 1.0, 41, true);
  static const std::vector<TerminalLinkSample> without = terminal_link_run(120000, 1.0, 42, false, 700.0);
  return loaded ? with : without;
}
const std::vector<TerminalLinkSample>& judged(bool loaded) {
  static const std::vector<TerminalLinkSample> with = terminal_link_run(400, 0.0, 43, true, 20.0);
  static const std::vector<TerminalLinkSample> without = terminal_link_run(400, 0.0, 44, false, 20.0);
  return loaded ? with : without;
}

template <typename Case>
class LongRun : public ::testing::Test {
 public:
  using Estimator = typename Case::Estimator;

  static Estimator started(double forgetting, double gate = 8) {
    typename Case::Config config;
    config.forgetting_factor = static_cast<typename Case::Scalar>(forgetting);
    config.gate = static_cast<typename Case::Scalar>(gate);
    Estimator estimator;
    EXPECT_EQ(Case::configure(estimator, config), Status::kOk);
    return estimator;
  }
  static void run(Estimator& estimator, bool loaded, std::size_t samples) {
    for (std::size_t n = 0; n < samples; ++n) {
      ASSERT_EQ(Case::update(estimator, motion(loaded)[n]), Status::kOk);
    }
  }
  static double error(const Estimator& estimator, bool loaded) {
    return Case::torque_error(estimator, judged(loaded));
  }
  /// Samples without payload until the torque is right within 5 %; `most` when it never is.
  static std::size_t samples_to_follow(Estimator& estimator, std::size_t most) {
    for (std::size_t n = 0; n < most; ++n) {
      EXPECT_EQ(Case::update(estimator, motion(false)[n]), Status::kOk);
      if (n % 100 == 99 && error(estimator, false) < 0.05) return n + 1;
    }
    return most;
  }
};
TYPED_TEST_SUITE(LongRun, test::TerminalLinkCases);

TYPED_TEST(LongRun, FollowsARemovedPayloadAsFastAfterManyWrapsAsAfterNone) {
  for (const std::size_t before : {4000U, 14500U, 28000U, 60000U, 120000U}) {
    auto estimator = this->started(0.999);
    this->run(estimator, true, before);
    EXPECT_LT(this->error(estimator, true), 0.02) << before;
    // The payload is some twenty times the 5 % that are left: three memories of 1000 samples.
    EXPECT_LE(this->samples_to_follow(estimator, 6000), 3500U) << "after " << before << " samples";
  }
}

TYPED_TEST(LongRun, FollowsWithALongMemoryAfterItsWrap) {
  auto estimator = this->started(0.9999);  // wraps after 138 000 samples
  this->run(estimator, true, 120000);
  this->run(estimator, true, 60000);
  ASSERT_LT(this->error(estimator, true), 0.02);
  EXPECT_LE(this->samples_to_follow(estimator, 60000), 40000U);
}

TYPED_TEST(LongRun, GlitchesOfEverySizeAndMomentLeaveTheEstimateUsable) {
  const double largest = static_cast<double>(std::numeric_limits<typename TypeParam::Scalar>::max());
  const double sizes[] = {1e2, 1e3, 1e4, 1e6, 1e7, 1e8, 1e10, 1e15, 1e25, largest};
  for (const double forgetting : {1.0, 0.999}) {
    for (const Glitch glitch : {Glitch::kTorque, Glitch::kMeasured, Glitch::kInstrument}) {
      for (const double size : sizes) {
        for (const std::size_t at :
             {std::size_t{0}, std::size_t{15}, std::size_t{16}, std::size_t{150}, std::size_t{2500}}) {
          auto estimator = this->started(forgetting);
          double worst = 0;
          for (std::size_t n = 0; n < 6000; ++n) {
            const TerminalLinkSample& s = motion(true)[n];
            const Status status = TypeParam::update(estimator, n == at ? struck(s, glitch, size) : s);
            ASSERT_TRUE(status == Status::kOk || (n == at && status == Status::kNonFiniteInput));
            if (n > 3000 && n % 50 == 0) worst = std::max(worst, this->error(estimator, true));
          }
          ASSERT_LT(worst, 0.10) << "λ " << forgetting << " glitch " << static_cast<int>(glitch) << " of "
                                 << size << " at " << at;
          ASSERT_EQ(estimator.source(), EstimateSource::kInstrumental) << size << " at " << at;
        }
      }
    }
  }
}

TYPED_TEST(LongRun, BurstsOfGlitchesAreOutlasted) {
  for (const Glitch glitch : {Glitch::kTorque, Glitch::kMeasured, Glitch::kInstrument}) {
    for (const double size : {1e4, 1e6, 1e15}) {
      auto estimator = this->started(0.999);
      for (std::size_t n = 0; n < 9000; ++n) {
        const bool burst = (n >= 40 && n < 60) || (n >= 3000 && n < 3100);
        static_cast<void>(
            TypeParam::update(estimator, burst ? struck(motion(true)[n], glitch, size) : motion(true)[n]));
      }
      EXPECT_LT(this->error(estimator, true), 0.05) << static_cast<int>(glitch) << " of " << size;
    }
  }
}

TYPED_TEST(LongRun, TenHoursAtRestCostNothing) {
  auto estimator = this->started(0.999);
  this->run(estimator, true, 6000);
  const double before = this->error(estimator, true);
  TerminalLinkSample rest = motion(true)[5999];
  rest.qd.setConstant(1e-3);
  rest.qdd.setZero();
  for (int n = 0; n < 7200000; ++n) {
    rest.measured.setConstant(n % 7 - 3);
    ASSERT_EQ(TypeParam::update(estimator, rest), Status::kOk);
  }
  EXPECT_NEAR(this->error(estimator, true), before, 0.01);
  EXPECT_LE(this->samples_to_follow(estimator, 6000), 3500U);
}

template <typename Scalar>
class LongStandstill : public ::testing::Test {};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(LongStandstill, Scalars);

TYPED_TEST(LongStandstill, RecursiveLeastSquaresStaysWithinWhatItClaims) {
  constexpr int kP = 6;
  using Rls = RecursiveLeastSquares<TypeParam, kP>;
  for (const double forgetting : {0.9999, 0.98}) {
    Rls estimator;
    typename Rls::Config config;
    config.forgetting_factor = static_cast<TypeParam>(forgetting);
    config.noise_variance = static_cast<TypeParam>(0.25);
    typename Rls::Row variance;
    variance.fill(TypeParam(100));
    ASSERT_EQ(estimator.configure(config, {}, variance), Status::kOk);
    std::mt19937_64 random(9);
    std::normal_distribution<double> normal;
    typename Rls::Record record;
    const auto move = [&](int rows) {
      for (int n = 0; n < rows; ++n) {
        typename Rls::Row w;
        double y = 0.5 * normal(random);
        for (std::size_t i = 0; i < kP; ++i) {
          w[i] = static_cast<TypeParam>(normal(random));
          y += static_cast<double>(i + 1) * static_cast<double>(w[i]);
        }
        ASSERT_EQ(estimator.update(w, static_cast<TypeParam>(y), TypeParam(0), record), Status::kOk);
      }
    };
    move(2000);
    const typename Rls::Row same{TypeParam(0.3), TypeParam(-1),  TypeParam(0.7),
                                 TypeParam(2),   TypeParam(0.1), TypeParam(1)};
    double y = 0;
    for (std::size_t i = 0; i < kP; ++i) y += static_cast<double>(i + 1) * static_cast<double>(same[i]);
    for (int n = 0; n < 20000000; ++n) {
      // Uniform noise of the same variance: the drift comes from rounding, not from the distribution.
      const double noise = 0.5 * std::sqrt(12.0) * (static_cast<double>(random() >> 11) * 0x1p-53 - 0.5);
      ASSERT_EQ(estimator.update(same, static_cast<TypeParam>(y + noise), TypeParam(0), record), Status::kOk);
    }
    for (int i = 0; i < kP; ++i) {
      const double deviation = std::sqrt(static_cast<double>(estimator.variance(i)));
      EXPECT_LE(deviation, 10.001) << "the initial one";
      EXPECT_NEAR(static_cast<double>(estimator.solution()[static_cast<std::size_t>(i)]), i + 1,
                  2 * deviation)
          << "parameter " << i << " λ " << forgetting;
    }
    move(static_cast<int>(12 / (1 - forgetting)));  // 12 memories
    for (int i = 0; i < kP; ++i) {
      EXPECT_NEAR(static_cast<double>(estimator.solution()[static_cast<std::size_t>(i)]), i + 1, 0.6)
          << "parameter " << i << " λ " << forgetting;
    }
  }
}

}  // namespace
}  // namespace heft
