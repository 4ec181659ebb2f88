#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "heft/drive/torque_constants.hpp"
#include "support/measured_data.hpp"

namespace heft::drive {
namespace {

TorqueConstants of(const std::string& arm, const std::vector<std::string>& runs) {
  std::vector<std::string> paths;
  for (const std::string& run : runs)
    paths.push_back((std::filesystem::path(HEFT_DATA_DIR) / arm / (run + ".csv")).string());
  return from_targets(open_logs(paths));
}

/// Joints (from 0) whose constants two sets of runs show to 2 %; each pair within 2 %.
std::vector<int> agreeing(const TorqueConstants& a, const TorqueConstants& b) {
  std::vector<int> joints;
  for (std::size_t j = 0; j < a.joints.size(); ++j) {
    const auto sharp = [](const JointConstant& joint) {
      return joint.known() && joint.constant.upper - joint.constant.lower < 0.04 * joint.constant.value;
    };
    if (!sharp(a.joints[j]) || !sharp(b.joints[j])) continue;
    EXPECT_NEAR(a.joints[j].constant.value / b.joints[j].constant.value, 1.0, 0.02) << "joint " << j + 1;
    joints.push_back(static_cast<int>(j));
  }
  return joints;
}

// tau = K i with the controller's own K; its README gives them.
TEST(TorqueConstantsMeasured, OfAUr5AgreeBetweenRunsAndWithTheControllersOwn) {
  HEFT_NEEDS_MEASURED_DATA(HEFT_DATA_DIR "/ur5-kufieta");
  const TorqueConstants a = of("ur5-kufieta", {"no1", "no3-fast", "no6-slow"}),
                        b = of("ur5-kufieta", {"no2", "no7", "no8", "no9"});
  EXPECT_GE(agreeing(a, b).size(), 3U);
  const double own[] = {10.706, 10.667, 10.208, 11.896};
  for (std::size_t j = 1; j < 5; ++j) {
    ASSERT_TRUE(a.joints[j].known()) << a.joints[j].missing;
    EXPECT_NEAR(a.joints[j].constant.value, own[j - 1], 0.002 * own[j - 1]) << "joint " << j + 1;
  }
}

TEST(TorqueConstantsMeasured, OfAUr10eAgreeBetweenRuns) {
  HEFT_NEEDS_MEASURED_DATA(HEFT_DATA_DIR "/ur10e-dynamic-calibration");
  const std::string arm = "ur10e-dynamic-calibration";
  const TorqueConstants a = of(arm, {"exc-8h-20s", "exc-12h-20s", "exc-10h-20s", "exc-12h-30s"});
  const TorqueConstants b = of(arm, {"exc-12h-40s", "exc-12h-50s", "exc-14h-50s", "ptp-10-points"});
  EXPECT_GE(agreeing(a, b).size(), 3U);
}

TEST(TorqueConstantsMeasured, LeaveOutTheRunWithALoad) {
  HEFT_NEEDS_MEASURED_DATA(HEFT_DATA_DIR "/ur10e-dynamic-calibration");
  const std::string arm = "ur10e-dynamic-calibration";
  const TorqueConstants clean = of(arm, {"exc-12h-50s", "exc-14h-50s", "ptp-10-points"});
  const TorqueConstants mixed =
      of(arm, {"exc-12h-50s", "exc-14h-50s", "ptp-10-points", "exc-14h-50s-load2p805kg"});
  EXPECT_GE(agreeing(clean, mixed).size(), 3U);
  ASSERT_FALSE(mixed.judgement.reasons.empty());
  EXPECT_NE(mixed.judgement.reasons[0].find("load2p805kg"), std::string::npos);
}

}  // namespace
}  // namespace heft::drive
