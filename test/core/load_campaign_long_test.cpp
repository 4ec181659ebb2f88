/// What the load observer claims, in hundreds of runs and in hours.
#include <gtest/gtest.h>

#include "load_campaign.hpp"

namespace heft::test {
namespace {

template <typename Scalar>
class LoadCampaigns : public ::testing::Test {};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(LoadCampaigns, Scalars);

TYPED_TEST(LoadCampaigns, IntervalsHoldTheTruthIn93To97RunsOfAHundred) {
  for (const double seconds : {5.0, 10.0, 30.0}) {
    const auto found = LoadCampaign<TypeParam>::coverage(500, seconds, correlated_work());
    for (std::size_t i = 0; i < 4; ++i) {
      EXPECT_GE(found.held[i], 465) << (i == 0 ? "mass" : "centre of mass") << " after " << seconds << " s";
      EXPECT_LE(found.held[i], 485) << (i == 0 ? "mass" : "centre of mass") << " after " << seconds << " s";
    }
    EXPECT_LE(found.unknown, 5);
    EXPECT_LE(found.changes, 1);
  }
}

TYPED_TEST(LoadCampaigns, FiveSecondsOfMotionWeighALoadToTwoPercentAndFiveMillimetres) {
  const auto found = LoadCampaign<TypeParam>::coverage(500, 5.0, ordinary_work(), 2.0);
  EXPECT_EQ(found.mass_within_2_percent, found.runs);
  EXPECT_GE(found.com_within_5_mm, found.runs * 95 / 100);
  EXPECT_EQ(found.unknown, 0);
}

TYPED_TEST(LoadCampaigns, EveryGraspAndReleaseIsSeenWithinHalfASecondOfMotion) {
  // Half a kilogram hides behind correlated noise of 1.5 N·m.
  for (const double lightest : {0.5, 1.0}) {
    const auto found = LoadCampaign<TypeParam>::changes_seen(
        60, lightest < 1.0 ? ordinary_work() : correlated_work(), lightest);
    EXPECT_GT(found.true_ones, 800);
    EXPECT_EQ(found.missed, 0) << lightest;
    EXPECT_EQ(found.false_ones, 0) << lightest;
    EXPECT_LT(found.slowest, 0.5) << lightest;
  }
}

TYPED_TEST(LoadCampaigns, TenHoursGiveAtMostOneFalseAlarm) {
  EXPECT_LE(LoadCampaign<TypeParam>::false_alarms(10.0, correlated_work()), 1);
}

/// Friction a fifth higher than the model has it, and little noise that would hide it.
TYPED_TEST(LoadCampaigns, FrictionThatTheModelDoesNotKnowIsNoOtherLoad) {
  PickAndPlaceSettings settings = ordinary_work();
  settings.noise = 0.002;
  for (const double error : {-0.2, 0.2}) {
    settings.friction_error = error;
    EXPECT_EQ(LoadCampaign<TypeParam>::false_alarms(1.0, settings), 0) << error;
  }
}

}  // namespace
}  // namespace heft::test
