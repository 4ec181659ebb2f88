#include "heft/core/filter/state_variable_filter.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "heft/core/filter/aligned_motion.hpp"

namespace heft {
namespace {

using V = JointVector<double, 1>;

TEST(StateVariableFilter, HasTheResponseOfThreeEqualPoles) {
  StateVariableFilter<double, 1> filter;
  ASSERT_EQ(filter.configure(20.0), Status::kOk);
  const double omega = 2 * std::numbers::pi * 20.0;
  const double w = 2 * std::numbers::pi * 3.0;
  const std::complex<double> s(0, w);
  const std::complex<double> gain = std::pow(omega / (s + omega), 3);
  for (int n = 0; n < 4000; ++n) {
    const double t = 0.0005 * n;
    ASSERT_EQ(filter.update(V(std::sin(w * t)), 0.0005), Status::kOk);
    if (n > 2000) {
      const std::complex<double> turn = std::exp(s * t);
      EXPECT_NEAR(filter.value()[0], (gain * turn).imag(), 2e-5);
      EXPECT_NEAR(filter.derivative()[0], (gain * s * turn).imag(), 4e-4);
      EXPECT_NEAR(filter.second_derivative()[0], (gain * s * s * turn).imag(), 2e-2);
    }
  }
  EXPECT_TRUE(filter.settled());
}

TEST(StateVariableFilter, JitterDoesNotShowOnARamp) {
  StateVariableFilter<double, 1> filter;
  ASSERT_EQ(filter.configure(10.0), Status::kOk);
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> step(0.008, 0.016);
  double t = 0;
  for (int n = 0; n < 500; ++n) {
    const double dt = step(random);
    t += dt;
    ASSERT_EQ(filter.update(V(2 * t + 1), dt), Status::kOk);
    if (n > 200) {
      EXPECT_NEAR(filter.derivative()[0], 2.0, 1e-9);
      EXPECT_NEAR(filter.second_derivative()[0], 0.0, 1e-7);
      EXPECT_NEAR(filter.value()[0], 2 * (t - filter.delay()) + 1, 1e-9);
    }
  }
}

TEST(StateVariableFilter, RefusesBadNumbersAndRestartsAfterAGap) {
  StateVariableFilter<double, 1> filter;
  EXPECT_EQ(filter.configure(0.0), Status::kOutOfRange);
  ASSERT_EQ(filter.configure(10.0), Status::kOk);
  ASSERT_EQ(filter.update(V(1.0), 0.01), Status::kOk);
  ASSERT_EQ(filter.update(V(2.0), 0.01), Status::kOk);
  const double before = filter.value()[0];
  EXPECT_EQ(filter.configure(0.0), Status::kOutOfRange);
  EXPECT_EQ(filter.configure(std::nan("")), Status::kOutOfRange);
  EXPECT_EQ(filter.update(V(std::nan("")), 0.01), Status::kNonFiniteInput);
  EXPECT_EQ(filter.update(V(1.0), 0.0), Status::kOutOfRange);
  EXPECT_EQ(filter.update(V(1.0), -0.01), Status::kOutOfRange);
  EXPECT_EQ(filter.value()[0], before);
  ASSERT_EQ(filter.update(V(5.0), 100.0), Status::kOk);
  EXPECT_EQ(filter.value()[0], 5.0);
  EXPECT_EQ(filter.derivative()[0], 0.0);
  EXPECT_FALSE(filter.settled());
}

/// A block of inertia 1 on a sine, at 100 samples a second: half a sample is 6 % of the acceleration, and must not be seen.
TEST(AlignedMotion, TorqueThatActedBetweenTwoSamplesMeetsItsAcceleration) {
  AlignedMotion<double, 1> aligned;
  ASSERT_EQ(aligned.configure(20.0, 0.0), Status::kOk);
  constexpr double kPeriod = 0.01, w = 4 * std::numbers::pi;
  double worst = 0.0;
  for (int k = 0; k < 500; ++k) {
    const double t = k * kPeriod, between = t - 0.5 * kPeriod;
    ASSERT_EQ(aligned.update(V(std::sin(w * t)), V(w * std::cos(w * t)), V(std::sin(w * t)),
                             V(-w * w * std::sin(w * between)), kPeriod),
              Status::kOk);
    if (k <= 100) continue;
    worst = std::max(worst, std::abs(aligned.tau()[0] - aligned.qdd()[0]));
    EXPECT_NEAR(aligned.qdd()[0], aligned.qdd_ref()[0], 1e-9);
  }
  EXPECT_TRUE(aligned.settled());
  EXPECT_LT(worst, 0.02 * w * w);  // lines between samples instead of the sine: 1.1 %
}

TEST(AlignedMotion, ARefusedSampleLeavesNoTrace) {
  AlignedMotion<double, 1> struck, untouched;
  ASSERT_EQ(struck.configure(20.0, 0.01), Status::kOk);
  ASSERT_EQ(untouched.configure(20.0, 0.01), Status::kOk);
  EXPECT_EQ(struck.configure(20.0, -1.0), Status::kOutOfRange);
  EXPECT_EQ(struck.configure(std::nan(""), 0.01), Status::kOutOfRange);
  const auto refuse = [](const V&, const V&, V&) { return Status::kSingular; };
  for (int k = 0; k < 100; ++k) {
    const V q(std::sin(0.1 * k)), qd(std::cos(0.1 * k));
    ASSERT_EQ(struck.update(q, qd, q, q, 0.01), Status::kOk);
    ASSERT_EQ(untouched.update(q, qd, q, q, 0.01), Status::kOk);
    EXPECT_EQ(struck.update(V(9.0), qd, q, q, 0.0), Status::kOutOfRange);
    EXPECT_EQ(struck.update(V(9.0), V(std::nan("")), q, q, 0.01), Status::kNonFiniteInput);
    EXPECT_EQ(struck.update(V(9.0), qd, q, q, 0.01, refuse), Status::kSingular);
    EXPECT_EQ(struck.qdd(), untouched.qdd());
    EXPECT_EQ(struck.tau(), untouched.tau());
    EXPECT_EQ(struck.sign(), untouched.sign());
  }
}

}  // namespace
}  // namespace heft
