// Which stiffness is good, doubtful or bad.
#include "heft/stiffness/judgement.hpp"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace heft::stiffness {
namespace {

using ::testing::HasSubstr;
using Rank = host::Verdict;

TEST(Stiffness, WithOneOpenEndIsNone) {
  StiffnessFit fit;
  StiffnessEstimate known;
  known.determined = true;
  known.group = 0;
  known.stiffness.value = 1e4, known.stiffness.lower = 8e3, known.stiffness.upper = 1.3e4;
  StiffnessEstimate open = known;
  open.stiffness.upper = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(known.has_stiffness());
  EXPECT_FALSE(open.has_stiffness());
  fit.joints = {known, known};
  fit.left_out_rms = 1e-5;
  StiffnessDiagnosis diagnosis;
  diagnosis.mean_rms = 1e-4;
  EXPECT_EQ(judge(fit, diagnosis).verdict, Rank::kGood);
  fit.joints = {known, open};
  EXPECT_THAT(judge(fit, diagnosis).reasons, ::testing::ElementsAre(HasSubstr("joint 2 is not determined")));
  fit.joints = {open, open};
  EXPECT_FALSE(judge(fit, diagnosis).usable());
  fit.joints = {known, known};
  fit.left_out_rms = 2e-4;
  EXPECT_FALSE(judge(fit, diagnosis).usable());
}

TEST(EncoderStiffness, WithoutRotorInertiaIsDoubtful) {
  JointEncoderFit fit;
  JointStiffness joint;
  joint.identifiable = true;
  joint.stiffness.value = 1e6, joint.stiffness.lower = 8e5, joint.stiffness.upper = 1.3e6;
  fit.pooled = {joint};
  EXPECT_EQ(judge(fit, true).verdict, Rank::kGood);
  EXPECT_THAT(judge(fit, false).reasons, ::testing::ElementsAre(HasSubstr("--rotor-inertia")));
  fit.pooled[0].stiffness.upper = 4e6;
  EXPECT_EQ(judge(fit, true).verdict, Rank::kDoubtful);
  fit.pooled[0].identifiable = false;
  EXPECT_FALSE(judge(fit, true).usable());
}

}  // namespace
}  // namespace heft::stiffness
