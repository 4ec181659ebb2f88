#include "heft/drive/torque_constants.hpp"

#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "drive_log.hpp"
#include "heft/host/error.hpp"

namespace heft::drive {
namespace {

using test::drive_log;
using test::drive_logs;

TEST(TorqueConstants, ComeFromTheStandstillOfADriveThatReportsItsTargets) {
  const TorqueConstants found =
      from_targets(drive_logs({drive_log({.constant = 10.7, .target_current = true, .rest = 3.0})}));
  ASSERT_EQ(found.joints.size(), 2U);
  for (const JointConstant& joint : found.joints) {
    EXPECT_EQ(joint.from, From::kStandstill);
    EXPECT_NEAR(joint.constant.value, 10.7, 1e-6);
  }
  EXPECT_EQ(found.judgement.verdict, host::Verdict::kGood);
}

// Friction that grows with the load has the sign of the velocity: with motion in one direction under load it passes for
// another constant (by up to its share, 16 %) in a plain regression.
TEST(TorqueConstants, FromMotionAreNotLedAstrayByFrictionThatGrowsWithTheLoad) {
  const TorqueConstants found = from_targets(drive_logs({drive_log({}), drive_log({.seed = 2})}));
  for (const JointConstant& joint : found.joints) {
    ASSERT_TRUE(joint.known()) << joint.missing;
    EXPECT_EQ(joint.from, From::kMotion);
    EXPECT_NEAR(joint.constant.value, 10.0, 0.05);
    EXPECT_NEAR(joint.load_friction, 0.16, 0.01);
    EXPECT_LT(joint.constant.lower, 10.0);
    EXPECT_GT(joint.constant.upper, 10.0);
  }
}

TEST(TorqueConstants, LeaveOutALogWithALoadThatTheControllerDoesNotKnowOf) {
  const TorqueConstants found = from_targets(drive_logs(
      {drive_log({.seed = 1}), drive_log({.unknown_load = 0.25, .seed = 2}), drive_log({.seed = 3})}));
  EXPECT_NEAR(found.joints[0].constant.value, 10.0, 0.05);
  ASSERT_EQ(found.joints[0].logs.size(), 3U);
  EXPECT_TRUE(found.joints[0].logs[0].agrees);
  EXPECT_FALSE(found.joints[0].logs[1].agrees);
  EXPECT_EQ(found.judgement.verdict, host::Verdict::kDoubtful);
  ASSERT_FALSE(found.judgement.reasons.empty());
  EXPECT_NE(found.judgement.reasons[0].find("drive-2.csv"), std::string::npos) << found.judgement.reasons[0];
}

TEST(TorqueConstants, AreNotKnownWhereTwoLogsContradictOneAnother) {
  const TorqueConstants found =
      from_targets(drive_logs({drive_log({.seed = 1}), drive_log({.unknown_load = 0.25, .seed = 2})}));
  EXPECT_FALSE(found.joints[0].known());
  EXPECT_NE(found.joints[0].missing.find("the logs differ"), std::string::npos) << found.joints[0].missing;
  EXPECT_FALSE(found.usable());
}

TEST(TorqueConstants, OfAJointThatNothingLoadsAreNotKnownAndTheMissingMotionIsNamed) {
  data::Log log = drive_log({});
  for (auto& [name, values] : log.extra)
    if (name == "tauref2") values.setZero();
  const TorqueConstants found = from_targets(drive_logs({log}));
  EXPECT_TRUE(found.joints[0].known());
  EXPECT_FALSE(found.joints[1].known());
  EXPECT_NE(found.joints[1].missing.find("record a motion"), std::string::npos);
  EXPECT_EQ(found.judgement.verdict, host::Verdict::kDoubtful);
  EXPECT_TRUE(found.usable());
}

TEST(TorqueConstants, WithAFlippedSignAreRefusedByThatName) {
  data::Log log = drive_log({});
  log.current.col(1) *= -1.0;
  const TorqueConstants found = from_targets(drive_logs({log}));
  EXPECT_TRUE(found.joints[0].known());
  EXPECT_FALSE(found.joints[1].known());
  EXPECT_NE(found.joints[1].missing.find("sign"), std::string::npos) << found.joints[1].missing;
}

bool has_reason(const TorqueConstants& found, const std::string& words) {
  for (const std::string& reason : found.judgement.reasons)
    if (reason.find(words) != std::string::npos) return true;
  return false;
}

TEST(TorqueConstants, OfTwoArmsAreDoubted) {
  const data::Log one = drive_log({.constant = 10.0, .target_current = true, .rest = 3.0});
  const TorqueConstants mixed = from_targets(drive_logs({one, drive_log({.constant = 11.5, .seed = 2})}));
  EXPECT_EQ(mixed.judgement.verdict, host::Verdict::kDoubtful);
  EXPECT_TRUE(has_reason(mixed, "expected logs of one arm"));
  const TorqueConstants alike = from_targets(drive_logs({one, drive_log({.constant = 10.0, .seed = 2})}));
  EXPECT_EQ(alike.judgement.verdict, host::Verdict::kGood);
}

TEST(TorqueConstants, FromATargetTorqueThatIsTheCurrentAreDoubted) {
  data::Log log = drive_log({});
  for (auto& [name, values] : log.extra) values = 10.0 * log.current.col(name == "tauref1" ? 0 : 1);
  const TorqueConstants found = from_targets(drive_logs({log}));
  EXPECT_TRUE(has_reason(found, "the measured current times a constant"));
}

TEST(TorqueConstants, FromMilliamperesAreNoted) {
  data::Log log = drive_log({});
  log.current *= 1000.0;
  const TorqueConstants found = from_targets(drive_logs({log}));
  ASSERT_FALSE(found.notes.empty());
  EXPECT_NE(found.notes.back().find("mA"), std::string::npos) << found.notes.back();
}

// Chance alone makes the current of such a joint fall significantly with its target torque in some logs of a hundred.
TEST(TorqueConstants, OfAJointWithoutLoadAreNotCalledFlipped) {
  for (std::uint32_t seed = 1; seed <= 60; ++seed) {
    data::Log log = drive_log({.duration = 20.0, .seed = seed});
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    double slow = 0.0;
    for (auto& [name, values] : log.extra) {
      if (name != "tauref2") continue;
      for (double& value : values) value = slow = 0.95 * slow + 0.02 * normal(random);
    }
    const TorqueConstants found = from_targets(drive_logs({log}));
    EXPECT_EQ(found.joints[1].missing.find("sign"), std::string::npos) << seed;
  }
}

TEST(TorqueConstants, NeedTargetTorqueAndCurrent) {
  data::Log log = drive_log({});
  log.extra.clear();
  try {
    from_targets(drive_logs({log}));
    FAIL() << "a log without target torque was taken";
  } catch (const DataError& error) {
    EXPECT_NE(std::string(error.what()).find("tauref1"), std::string::npos) << error.what();
  }
}

TEST(TorqueConstants, ScaleOfTorqueIsThatOfTheConstantAssumed) {
  data::Log log = drive_log({.seed = 4});
  log.tau = 10.4 * log.current;  // made with a constant 4 % too large
  const data::LogSet logs = drive_logs({log});
  const std::vector<statistics::Interval> scales = torque_scales(logs.given());
  ASSERT_EQ(scales.size(), 2U);
  for (const statistics::Interval& scale : scales) EXPECT_NEAR(scale.value, 1.04, 0.005);
}

TEST(TorqueConstants, ThatAreMissingAreTakenFromTheCallerOrRefused) {
  EXPECT_EQ(completed({10.0, kNaN}, {3.0}), (std::vector<double>{10.0, 3.0}));
  EXPECT_EQ(completed({10.0, kNaN}, {3.0, 4.0}), (std::vector<double>{10.0, 4.0}));
  try {
    completed({10.0, kNaN}, {});
    FAIL() << "a constant that nobody knows was used";
  } catch (const DataError& error) {
    EXPECT_NE(std::string(error.what()).find("joint 2"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace heft::drive
