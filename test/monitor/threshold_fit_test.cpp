// The tail and the shape of thresholds against laws that are known.
#include "threshold_fit.hpp"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "heft/host/numbers.hpp"
#include "push_delay.hpp"

namespace heft::monitor {
namespace {

/// Deviations of exponential size over a form of speed, `rows` a block.
Part exponential_part(const Shape& form, int blocks, int rows, unsigned seed) {
  std::mt19937 random(seed);
  std::exponential_distribution<double> size(1.0);
  std::uniform_real_distribution<double> uniform;
  Part part;
  part.size.resize(blocks * rows);
  part.circumstance.setZero(blocks * rows, kCircumstances);
  for (int k = 0; k < blocks * rows; ++k) {
    part.circumstance(k, 0) = 1.0;
    part.circumstance(k, 1) = uniform(random);
    part.size[k] = size(random) * part.circumstance.row(k).dot(form);
    part.block.push_back(k / rows);
  }
  return part;
}

TEST(ThresholdTail, StatesTheRateAtWhichExponentialMaximaExceedALevel) {
  // Of 20 exponential numbers one exceeds k with the probability 1 − (1 − e^{−k})^20, which is 20 e^{−k} far out.
  Shape one = Shape::Zero();
  one[0] = 1.0;
  const Tail tail = tail_of(block_maxima({exponential_part(one, 4000, 20, 1)}, one));
  EXPECT_EQ(tail.blocks, 4000);
  const double rate = 1e-6, exact = std::log(20 / rate);
  EXPECT_NEAR(tail.level(rate), exact, 0.05 * exact);
  EXPECT_NEAR(tail.log_rate(tail.level(rate)), std::log(rate), 1e-9);
  // Ten extrapolated standard deviations of the mean excess of 800 maxima.
  EXPECT_NEAR(tail.log_rate_std(tail.level(rate)), std::log(0.2 / rate) / std::sqrt(800.0), 0.1);
}

TEST(ThresholdShape, FollowsTheCircumstanceThatScalesTheDeviation) {
  Shape form = Shape::Zero();
  form[0] = 0.5, form[1] = 3.0;
  const Shape found = fit_shape({exponential_part(form, 1000, 20, 2)});
  EXPECT_NEAR(found[1] / found[0], 6.0, 1.0);  // a tenth of the constant is scatter
  EXPECT_TRUE((found.array() >= 0.0).all());
  for (int c = 2; c < kCircumstances; ++c) EXPECT_EQ(found[c], 0.0) << c;
}

TEST(PushDelay, IsThatOfARampBehindALowPass) {
  // Without an offset that follows: R (t − (1 − e^{−Kt}) / K) = threshold.
  const double K = 50.0, t = push_delay(K, 5.0, 1.0, 0.0);
  EXPECT_NEAR(kPushRate * (t - (1 - std::exp(-K * t)) / K), 1.0, 0.02);
  EXPECT_TRUE(
      std::isnan(push_delay(K, 5.0, 7.0, kInfinity)));  // the offset lags by kPushRate / 5 = 6 N·m only
}

}  // namespace
}  // namespace heft::monitor
