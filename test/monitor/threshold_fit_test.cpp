// Scales and tail of thresholds against laws that are known.
#include "threshold_fit.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "heft/core/monitor/contact_thresholds.hpp"
#include "heft/host/numbers.hpp"
#include "push_delay.hpp"

namespace heft::monitor {
namespace {

/// Two joints at 200 Hz, whose torque from outside is noise: the first turns round every two seconds, and its noise is
/// `turning` for a tenth of a second after; the second rests.
Balance free_motion(double moving, double turning, unsigned seed, double seconds = 60.0) {
  constexpr double kPeriod = 0.005;
  std::mt19937 random(seed);
  std::normal_distribution<double> noise;
  const auto rows = static_cast<Eigen::Index>(seconds / kPeriod);
  Balance balance;
  balance.time = Eigen::VectorXd::LinSpaced(rows, 0.0, seconds - kPeriod);
  balance.period = Eigen::VectorXd::Constant(rows, kPeriod);
  balance.outside.setZero(rows, 2);
  balance.explained.setZero(rows, 2);
  balance.qd.setZero(rows, 2);
  for (Eigen::Index k = 0; k < rows; ++k) {
    const double since = std::fmod(balance.time[k], 2.0);
    balance.qd(k, 0) = std::fmod(balance.time[k], 4.0) < 2.0 ? 1.0 : -1.0;
    balance.outside(k, 0) = (since < 0.1 ? turning : moving) * noise(random);
    balance.outside(k, 1) = 0.1 * noise(random);
  }
  return balance;
}

const Eigen::VectorXd kLeastSpeed = Eigen::VectorXd::Constant(2, 0.01);

TEST(ThresholdTail, StatesTheRateAtWhichExponentialMaximaExceedALevel) {
  // Of 20 exponential numbers one exceeds k with the probability 1 − (1 − e^{−k})^20, which is 20 e^{−k} far out.
  std::mt19937 random(1);
  std::exponential_distribution<double> size(1.0);
  std::vector<double> maxima(4000, 0.0);
  for (double& most : maxima) {
    for (int k = 0; k < 20; ++k) most = std::max(most, size(random));
  }
  Tail tail = tail_of(maxima);
  EXPECT_EQ(tail.blocks, 4000);
  EXPECT_NEAR(tail.shape, 0.0, 0.15);  // maxima of twenty are nearly exponential at their upper fifth
  tail.shape = 0.0;
  const double rate = 1e-6, exact = std::log(20 / rate);
  EXPECT_NEAR(tail.level(rate), exact, 0.05 * exact);
  EXPECT_NEAR(tail.log_rate(tail.level(rate)), std::log(rate), 1e-9);
  // Ten extrapolated standard deviations of the mean excess of 800 maxima.
  EXPECT_NEAR(tail.log_rate_std(tail.level(rate)), std::log(0.2 / rate) / std::sqrt(800.0), 0.1);
}

TEST(ThresholdTail, OfABoundedLawReachesLessFar) {
  // Excesses over u of a uniform law are uniform: shape -1, which the bound makes -0.25.
  std::mt19937 random(2);
  std::uniform_real_distribution<double> size;
  std::vector<double> maxima(1000);
  for (double& most : maxima) most = size(random);
  const Tail tail = tail_of(maxima);
  EXPECT_EQ(tail.shape, -0.25);
  EXPECT_NEAR(tail.from, 0.8, 0.03);
  const double far = tail.level(1e-6);
  EXPECT_GT(far, 1.0);
  // From u = 0.8 by s / 0.25 at most, s = 1.25 b, b = 0.1.
  EXPECT_LT(far, 1.3 + 0.03);
}

TEST(ThresholdScales, AreThoseOfWhatTheJointDoes) {
  const Balance log = free_motion(0.5, 3.0, 2);
  const Thresholds scales = scales_of({&log}, kLeastSpeed, 50.0);
  ASSERT_EQ(scales.joints.size(), 2U);
  const JointThreshold<double>& joint = scales.joints[0];
  // Noise behind the low-pass has the standard deviation σ √(a / (2 − a)), a = 1 − e^{−Kh}. Of the maxima of a hundred
  // samples, some thirty of them independent, one in fifty lies beyond 3.4 standard deviations.
  const double a = 1 - std::exp(-50.0 * 0.005), sigma = 0.5 * std::sqrt(a / (2 - a));
  EXPECT_NEAR(joint.moving, 3.4 * sigma, 0.6 * sigma);
  // What is slower than A leaves the change: e^{-Kh} forgets a mean of 5 time constants, which holds a sixth of the variance.
  EXPECT_LT(joint.moving_change, joint.moving);
  EXPECT_GT(joint.moving_change, 0.8 * joint.moving);
  EXPECT_GT(joint.turning, 3.0 * joint.moving);
  EXPECT_LT(joint.turning, 9.0 * joint.moving);
  EXPECT_DOUBLE_EQ(joint.top_speed, 1.0);
  EXPECT_DOUBLE_EQ(joint.rest_speed, 0.01);
  EXPECT_LT(scales.joints[1].rest, joint.moving);
}

TEST(ThresholdScales, OfAPhaseThatAJointNeverShowsAreThoseOfTheOthers) {
  Balance log = free_motion(0.5, 3.0, 3);
  log.outside.col(1).setConstant(2.0);
  const JointThreshold<double> still = scales_of({&log}, kLeastSpeed, 50.0).joints[1];
  EXPECT_NEAR(still.rest, 2.0, 1e-6);
  EXPECT_NEAR(still.moving, still.rest, 1e-9);
  EXPECT_NEAR(still.turning, still.rest, 1e-9);
}

// A wrist that sticks must not raise the thresholds of the elbow.
TEST(ThresholdBlocks, OfAChangeAreThoseOfEachJoint) {
  Balance quiet = free_motion(0.5, 0.5, 4), also = free_motion(0.5, 0.5, 5);
  for (Eigen::Index k = 0; k < also.outside.rows(); ++k) {
    if (std::fmod(also.time[k], 7.0) < 0.2) also.outside(k, 1) += 5.0;
  }
  const BlockMaxima maxima = block_maxima({&quiet, &also}, kLeastSpeed, 50.0);
  const auto largest = [](const std::vector<double>& of) { return *std::max_element(of.begin(), of.end()); };
  EXPECT_GT(largest(maxima.rest_change[1]), 3.0);
  EXPECT_LT(largest(maxima.motion_change[0]), 2.0);
}

TEST(ThresholdBlocks, OfALogAreMeasuredByTheScalesOfTheOthers) {
  const Balance quiet = free_motion(0.5, 0.5, 4), also = free_motion(0.5, 0.5, 5),
                loud = free_motion(1.5, 1.5, 6);
  const auto largest = [](const std::vector<const Balance*>& logs) {
    const std::vector<double> maxima = block_maxima(logs, kLeastSpeed, 50.0).motion;
    return *std::max_element(maxima.begin(), maxima.end());
  };
  EXPECT_GT(largest({&quiet, &also, &loud}), 1.8 * largest({&quiet, &also}));
  EXPECT_LT(largest({&loud}), 1.5 * largest({&quiet, &also}));
}

TEST(PushDelay, IsThatOfARampBehindALowPass) {
  Thresholds filters;
  filters.bandwidth = 50.0;
  const double K = filters.bandwidth, A = filters.adaptation;
  // By the residual: R (t − (1 − e^{−Kt}) / K) = threshold.
  const double t = push_delay(filters, 1.0, kInfinity);
  EXPECT_NEAR(kPushRate * (t - (1 - std::exp(-K * t)) / K), 1.0, 0.02);
  // By its change: R ((1 − e^{−At}) / A − (1 − e^{−Kt}) / K) K / (K − A), which reaches R / A.
  const double s = push_delay(filters, kInfinity, 1.0);
  EXPECT_NEAR(kPushRate * ((1 - std::exp(-A * s)) / A - (1 - std::exp(-K * s)) / K) * K / (K - A), 1.0, 0.02);
  EXPECT_TRUE(std::isnan(push_delay(filters, kInfinity, 1.1 * kPushRate / A)));
  EXPECT_DOUBLE_EQ(push_delay(filters, 1.0, 1.0), std::min(s, t));
}

}  // namespace
}  // namespace heft::monitor
