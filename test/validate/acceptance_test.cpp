#include "heft/validate/acceptance.hpp"

#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace heft::validate {
namespace {

using ::testing::HasSubstr;
using Rank = host::Verdict;

TEST(Campaign, IsGoodWhenEveryCriterionIsMet) {
  std::vector<Criterion> criteria = acceptance_criteria();
  EXPECT_EQ(judge(criteria).verdict, Rank::kDoubtful);
  for (Criterion& criterion : criteria) judge(criterion, criterion.at_least ? 99.0 : 0.1);
  EXPECT_EQ(judge(criteria).verdict, Rank::kGood);
  judge(criteria[1], 3.1);
  EXPECT_EQ(judge(criteria).verdict, Rank::kBad);
  EXPECT_THAT(judge(criteria).reasons, ::testing::ElementsAre(HasSubstr("torque prediction: 3.1 %")));
}

}  // namespace
}  // namespace heft::validate
