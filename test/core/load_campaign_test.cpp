/// The load observer at ordinary work, in short: load_campaign_long_test.cpp does the same at length.
#include <gtest/gtest.h>

#include "load_campaign.hpp"

namespace heft::test {
namespace {

TEST(LoadCampaign, FiveSecondsOfMotionWeighALoadToTwoPercentAndFiveMillimetres) {
  const auto found = LoadCampaign<float>::coverage(25, 5.0, ordinary_work(), 2.0);
  EXPECT_EQ(found.mass_within_2_percent, found.runs);
  EXPECT_GE(found.com_within_5_mm, found.runs - 3);
  EXPECT_EQ(found.changes, 0);
}

TEST(LoadCampaign, IntervalsHoldTheTruthWhereResidualsAreCorrelated) {
  const auto found = LoadCampaign<double>::coverage(60, 5.0, correlated_work());
  // Of 60 at 95 %, 57 are expected with a standard deviation of 1.7.
  for (const int held : found.held) EXPECT_GE(held, 57 - 5);
  EXPECT_LT(found.held[0] + found.held[1] + found.held[2] + found.held[3], 4 * 60);
}

TEST(LoadCampaign, EveryGraspAndReleaseIsSeenSoonAndNothingElse) {
  const auto found = LoadCampaign<float>::changes_seen(4, ordinary_work(), 0.5);
  EXPECT_GT(found.true_ones, 40);
  EXPECT_EQ(found.missed, 0);
  EXPECT_EQ(found.false_ones, 0);
  EXPECT_LT(found.slowest, 0.5);
}

}  // namespace
}  // namespace heft::test
