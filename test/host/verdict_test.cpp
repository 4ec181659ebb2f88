#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/verdict.hpp"

namespace heft::host {
namespace {

TEST(Verdict, IsTheWorstOfItsReasonsAndNamesTheWorstFirst) {
  Judgement judgement;
  EXPECT_EQ(judgement.verdict, Verdict::kGood);
  judgement.add(Verdict::kDoubtful, "first doubt");
  judgement.add(Verdict::kBad, "wrong");
  judgement.add(Verdict::kDoubtful, "second doubt");
  EXPECT_EQ(judgement.verdict, Verdict::kBad);
  EXPECT_FALSE(judgement.usable());
  EXPECT_THAT(judgement.reasons, testing::ElementsAre("wrong", "first doubt", "second doubt"));
}

TEST(Verdict, TakesOverAnotherJudgement) {
  Judgement doubt, judgement;
  doubt.add(Verdict::kDoubtful, "doubt");
  judgement.add(doubt);
  EXPECT_EQ(judgement.verdict, Verdict::kDoubtful);
  EXPECT_TRUE(judgement.usable());
  judgement.add(Verdict::kBad, "wrong");
  EXPECT_THAT(judgement.reasons, testing::ElementsAre("wrong", "doubt"));
}

TEST(Verdict, HasTheWordsOfTheContract) {
  EXPECT_STREQ(to_string(Verdict::kGood), "good");
  EXPECT_STREQ(to_string(Verdict::kDoubtful), "doubtful");
  EXPECT_STREQ(to_string(Verdict::kBad), "bad");
}

}  // namespace
}  // namespace heft::host
