#include "heft/core/filter/state_variable_filter.hpp"

#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace heft
