// One rule of trust: what is green has earned it.
#include "heft/validate/judgement.hpp"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace heft::validate {
namespace {

using Eigen::VectorXd;
using ::testing::AllOf;
using ::testing::HasSubstr;
using Rank = host::Verdict;

/// A score of joints whose torque varies by 1 about its mean and reaches `largest`, with these errors; in band
/// unless stated otherwise.
Score score_of(const VectorXd& error, double largest, double band = 5.0) {
  Score score;
  score.rmse = score.rmse_in_band = error;
  score.band = band;
  score.torque_variance = VectorXd::Ones(error.size());
  score.max_torque = VectorXd::Constant(error.size(), largest);
  score.percent_of_max = score.in_band_percent_of_max = 100.0 * error / largest;
  return score;
}

Score score_of(double error, double largest) { return score_of(VectorXd::Constant(1, error), largest); }

TEST(ExplainedShare, IsOneLessErrorAgainstVariation) {
  const VectorXd share = explained_share(score_of(Eigen::Vector3d(0.0, 0.5, 1.0), 3.0));
  EXPECT_TRUE(share.isApprox(Eigen::Vector3d(1.0, 0.75, 0.0)));
}

TEST(ExplainedShare, LeavesNoiseAboveTheBandOutOfErrorAndTorque) {
  // Torque of variance 1, 0.36 of it noise above the band that no model explains; of the rest half is explained.
  Score score = score_of(0.0, 3.0);
  score.rmse_in_band[0] = std::sqrt(0.32);
  score.rmse[0] = std::sqrt(0.32 + 0.36);
  EXPECT_NEAR(explained_share(score)[0], 0.5, 1e-12);
  score.band = 0.0;
  EXPECT_NEAR(explained_share(score)[0], 1.0 - 0.68, 1e-12);
}

TEST(Prediction, IsGoodDoubtfulOrBadAtTheStatedLimits) {
  // Largest torque 3: an error of e is 33 e % of it.
  const double good = std::sqrt(1.0 - kGoodShare), bad = std::sqrt(1.0 - kBadShare);
  EXPECT_EQ(judge_prediction({score_of(0.99 * good, 3.0)}).verdict, Rank::kGood);
  EXPECT_EQ(judge_prediction({score_of(1.01 * good, 3.0)}).verdict, Rank::kDoubtful);
  EXPECT_EQ(judge_prediction({score_of(0.99 * bad, 3.0)}).verdict, Rank::kDoubtful);
  EXPECT_EQ(judge_prediction({score_of(1.01 * bad, 3.0)}).verdict, Rank::kBad);
}

TEST(Prediction, IsNotHeldAgainstAJointWhoseTorqueHardlyChanges) {
  // As large an error as the variation, of a torque that is 50 times as large: a vertical axis that holds a weight.
  EXPECT_EQ(judge_prediction({score_of(1.0, 50.0)}).verdict, Rank::kGood);
  EXPECT_EQ(judge_prediction({score_of(1.0, 20.0)}).verdict, Rank::kDoubtful);
  EXPECT_EQ(judge_prediction({score_of(1.0, 9.0)}).verdict, Rank::kBad);
}

TEST(Prediction, IsJudgedOnTheWorstLogOfEachJoint) {
  const Score one = score_of(Eigen::Vector2d(0.9, 0.1), 3.0),
              other = score_of(Eigen::Vector2d(0.1, 0.5), 3.0);
  const host::Judgement judgement = judge_prediction({one, other});
  EXPECT_EQ(judgement.verdict, Rank::kBad);
  EXPECT_THAT(judgement.reasons,
              ::testing::ElementsAre(HasSubstr("joint 1 (19 % explained, off by 30 % of its largest torque)"),
                                     HasSubstr("joint 2 (75 % explained")));
}

TEST(Prediction, OfATorqueThatNeverChangesIsNoProof) {
  Score silent = score_of(Eigen::Vector2d(0.0, 0.0), 3.0);
  silent.torque_variance[1] = 0.0;
  EXPECT_EQ(judge_prediction({silent}).verdict, Rank::kDoubtful);
  silent.torque_variance.setZero();
  EXPECT_EQ(judge_prediction({silent}).verdict, Rank::kBad);
}

TEST(Model, NeedsHalfItsParametersDetermined) {
  EXPECT_EQ(judge_model({58, 29}).verdict, Rank::kGood);
  EXPECT_EQ(judge_model({58, 28}).verdict, Rank::kDoubtful);
  EXPECT_EQ(judge_model({58, 8}).verdict, Rank::kDoubtful);
  EXPECT_EQ(judge_model({58, 7}).verdict, Rank::kBad);
}

TEST(Model, WithAnImpossibleLinkIsNotGood) {
  ModelFacts facts{58, 58, true, 1.044, {}};
  facts.mass.poses = 10000;
  EXPECT_EQ(judge_model(facts).verdict, Rank::kGood);
  facts.mass.not_positive = 1;
  const host::Judgement judgement = judge_model(facts);
  EXPECT_EQ(judgement.verdict, Rank::kDoubtful);
  EXPECT_THAT(judgement.reasons,
              ::testing::ElementsAre(
                  AllOf(HasSubstr("1 of 10000 poses"), HasSubstr("--method physical"), HasSubstr("2.2 %"))));
  facts.mass.not_positive = 0;
  facts.physically_consistent = false;
  EXPECT_EQ(judge_model(facts).verdict, Rank::kDoubtful);
  // Unless links that can exist do as well.
  facts.physical_cost_ratio = 1.01;
  EXPECT_EQ(judge_model(facts).verdict, Rank::kGood);
}

TEST(Truth, IsHeldAgainstTheInterval) {
  EXPECT_EQ(judge_against_truth("the mass", 2.8, 0.1, 2.85).verdict, Rank::kGood);
  EXPECT_EQ(judge_against_truth("the mass", 2.8, 0.1, 2.95).verdict, Rank::kDoubtful);
  EXPECT_EQ(judge_against_truth("the mass", 2.8, 0.1, 3.2).verdict, Rank::kBad);
  EXPECT_EQ(judge_against_truth("the mass", 2.8, std::numeric_limits<double>::quiet_NaN(), 2.8).verdict,
            Rank::kBad);
}

TEST(Improvement, IsNotARise) {
  EXPECT_EQ(judge_improvement("a", 1.04, "b", 1.0).verdict, Rank::kGood);
  EXPECT_EQ(judge_improvement("a", 1.5, "b", 1.0).verdict, Rank::kDoubtful);
  EXPECT_EQ(judge_improvement("a", 4.0, "b", 1.0).verdict, Rank::kBad);
  EXPECT_EQ(judge_improvement("a", std::numeric_limits<double>::quiet_NaN(), "b", 1.0).verdict, Rank::kBad);
}

}  // namespace
}  // namespace heft::validate
