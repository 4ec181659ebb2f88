/// What a stretch of time must show to be a contact, and how often noise alone shows it.
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "effects/contact.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kBin = 0.02;

/// Residuals of three joints whose Jacobian is the identity, with weight 1, as their sums over bins of one row.
/// @param memory  correlation of one bin's residual with that of the next
ForceSums noise_of(unsigned seed, Index bins, double memory, double push = 0.0) {
  std::mt19937 random(seed);
  std::normal_distribution<double> draw(0.0, 1.0);
  const auto three = [&] { return Vector3d(draw(random), draw(random), draw(random)); };
  ForceSums sums{kBin, {Matrix3d::Zero()}, {Vector3d::Zero()}, {0.0}, {}};
  Vector3d state = three();
  for (Index b = 0; b < bins; ++b) {
    state = memory * state + std::sqrt(1.0 - memory * memory) * three();
    const bool pushed = b >= bins / 2 && b < bins / 2 + 25;
    const Vector3d r = state - (pushed ? Vector3d(0.0, push, 0.0) : Vector3d::Zero());
    sums.normal.push_back(sums.normal.back() + Matrix3d::Identity());
    sums.right.push_back(sums.right.back() - r);
    sums.power.push_back(sums.power.back() + r.squaredNorm());
  }
  return sums;
}

TEST(Contact, IsFoundWhereItIs) {
  const Touch touch = best_touch(noise_of(1, 1000, 0.9, 20.0), {});
  EXPECT_NEAR(static_cast<double>(touch.first), 500.0, 1.0);
  EXPECT_NEAR(static_cast<double>(touch.count), 25.0, 2.0);
  EXPECT_NEAR(touch.force.y(), 20.0, 3.0 * touch.std.y());
  EXPECT_LT(touch.std.y(), 2.0);
  EXPECT_GT(touch.std.y(), 0.2) << "white noise would give 0.2: correlation counts";
  EXPECT_LT(touch.p_value, 1e-6);
  EXPECT_GT(touch.p_value, 0.0);
}

/// p is an upper limit for the chance of a false alarm: of logs of noise alone no more than that share fall below it,
/// also where the noise is correlated over several bins.
TEST(Contact, OfNoiseAloneHasNoSmallP) {
  for (const double memory : {0.0, 0.8}) {
    int below_tenth = 0;
    constexpr int kLogs = 300;
    for (unsigned seed = 0; seed < kLogs; ++seed)
      below_tenth += best_touch(noise_of(seed, 1000, memory), {}).p_value < 0.1;
    // 30 if p were exact; Bonferroni over stretches that overlap leaves next to none (0 of 300 when this was written).
    EXPECT_LT(below_tenth, 10) << memory;
  }
}

TEST(Contact, HasALargerPInALogWithLessToCompareWith) {
  const double in_long = best_touch(noise_of(1, 2000, 0.0, 3.0), {}).p_value;
  const double in_short = best_touch(noise_of(1, 150, 0.0, 3.0), {}).p_value;
  EXPECT_GT(in_short, 1e3 * in_long);
}

TEST(Contact, NeedsStretchesToCompareWith) {
  EXPECT_EQ(best_touch(noise_of(1, 20, 0.0, 9.0), {}).count, 0);
  const Touch first = best_touch(noise_of(1, 1000, 0.0, 20.0), {});
  const Touch second =
      best_touch(noise_of(1, 1000, 0.0, 20.0), {{first.first - 5, first.first + first.count + 5}});
  EXPECT_LT(second.statistic, 0.1 * first.statistic);
  EXPECT_TRUE(second.first >= first.first + first.count + 5 ||
              second.first + second.count <= first.first - 5);
}

}  // namespace
}  // namespace heft::diagnose
