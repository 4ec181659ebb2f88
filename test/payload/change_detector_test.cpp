/// When cumulative sums of innovations call a change of load.
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "change_detector.hpp"

namespace heft::payload {
namespace {

constexpr double kPeriod = 0.01;

TEST(ChangeDetector, CallsALastingOffsetAndTellsWhenItBegan) {
  for (const double sign : {1.0, -1.0}) {
    ChangeDetector<2> detector;
    double called = -1;
    for (int k = 0; k < 3000 && called < 0; ++k) {
      const double time = k * kPeriod;
      if (detector.take(1, time < 20 ? 0.5 * std::sin(time) : 8 * sign, time, kPeriod)) called = time;
    }
    EXPECT_NEAR(called, 20.55, 0.1)
        << "threshold 2.5 s over (8 - 3) a second, a little slower as the scatter follows";
    EXPECT_NEAR(detector.since(), 20.0, 0.02);
  }
}

TEST(ChangeDetector, BearsModelErrorBelowTheDriftForEver) {
  ChangeDetector<1> detector;
  for (int k = 0; k < 1000000; ++k) {
    ASSERT_FALSE(detector.take(0, 2.9, k * kPeriod, kPeriod)) << k;
  }
}

TEST(ChangeDetector, ColouredNoiseSeldomLooksLikeAChange) {
  std::mt19937 generator(1);
  std::normal_distribution<double> normal;
  // 10 hours of residual correlated over 0.5 s: as large as the model's own, and up to three times as large.
  for (const double scatter : {1.0, 1.5, 2.0, 3.0}) {
    ChangeDetector<1> detector;
    double e = 0;
    int alarms = 0;
    for (int k = 0; k < 3600000; ++k) {
      e = 0.98 * e + std::sqrt(1 - 0.98 * 0.98) * normal(generator);
      if (!detector.take(0, scatter * e, k * kPeriod, kPeriod)) continue;
      ++alarms;
      detector.reset();
    }
    EXPECT_LE(alarms, scatter > 1.0 ? 5 : 0) << "scatter " << scatter;
  }
}

TEST(ChangeDetector, AShortSpikeHoweverHighIsNone) {
  ChangeDetector<1> detector;
  for (int k = 0; k < 1000; ++k) {
    ASSERT_FALSE(detector.take(0, k >= 500 && k < 530 ? 1e6 : 0, k * kPeriod, kPeriod));
  }
}

TEST(ChangeDetector, ForgetsWhatAJointSaidWhenItRests) {
  ChangeDetector<1> detector;
  for (int k = 0; k < 1000; ++k) {
    ASSERT_FALSE(detector.take(0, 8, k * kPeriod, kPeriod));
    if (k % 40 == 39) detector.rest(0);
  }
}

}  // namespace
}  // namespace heft::payload
