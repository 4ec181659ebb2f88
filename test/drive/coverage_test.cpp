// Intervals of torque constants against their claim.
#include <gtest/gtest.h>

#include "drive_log.hpp"
#include "heft/drive/torque_constants.hpp"

namespace heft::drive {
namespace {

TEST(TorqueConstants, FromMotionLieInTheirIntervalNinetyFiveTimesOfAHundred) {
  constexpr int kRuns = 300;
  int covered = 0, known = 0;
  for (int run = 0; run < kRuns; ++run) {
    const TorqueConstants found =
        from_targets(test::drive_logs({test::drive_log({.duration = 60.0,
                                                        .load_friction = 0.06,
                                                        .noise = 0.1,
                                                        .seed = static_cast<std::uint32_t>(run + 1)})}));
    for (const JointConstant& joint : found.joints) {
      if (!joint.known()) continue;
      ++known;
      if (joint.constant.lower <= 10.0 && 10.0 <= joint.constant.upper) ++covered;
    }
  }
  EXPECT_EQ(known, 2 * kRuns);
  // Of 600 at 95 %, 570 are expected, with a standard deviation of 5.3.
  EXPECT_GE(covered, 570 - 3 * 6);
  EXPECT_LE(covered, 570 + 3 * 6);
}

}  // namespace
}  // namespace heft::drive
