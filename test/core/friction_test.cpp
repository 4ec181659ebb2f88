#include "heft/core/friction/friction.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "heft/core/status.hpp"

namespace heft {
namespace {

TEST(VelocitySign, IsSharpWithWidthZero) {
  EXPECT_EQ(velocity_sign(0.0, 0.0), 0.0);
  EXPECT_EQ(velocity_sign(1e-300, 0.0), 1.0);
  EXPECT_EQ(velocity_sign(-1e-300, 0.0), -1.0);
  EXPECT_TRUE(std::isnan(velocity_sign(std::nan(""), 0.0)));
}

TEST(VelocitySign, IsCloseToTanhOddAndWithinOne) {
  for (double v = -1.0; v <= 1.0; v += 0.001) {
    const double s = velocity_sign(v, 0.1);
    EXPECT_NEAR(s, std::tanh(v / 0.1), 0.025);
    EXPECT_LE(std::abs(s), 1.0);
    EXPECT_EQ(s, -velocity_sign(-v, 0.1));
  }
  EXPECT_TRUE(std::isnan(velocity_sign(std::nan(""), 0.1)));
}

TEST(FrictionTorque, AddsItsThreeParts) {
  const JointActuation<double> joint{0.0, 2.0, 3.0, -0.5};
  EXPECT_DOUBLE_EQ(friction_torque(joint, 4.0, 0.0), 2 + 12 - 0.5);
  EXPECT_DOUBLE_EQ(friction_torque(joint, -4.0, 0.0), -2 - 12 - 0.5);
  EXPECT_DOUBLE_EQ(friction_torque(joint, 0.0, 0.0), -0.5);
}

TEST(StatusText, EveryStatusHasAName) {
  for (const Status s : {Status::kOk, Status::kNonFiniteInput, Status::kOutOfRange, Status::kNotConfigured,
                         Status::kSingular, Status::kNotPositiveDefinite, Status::kNotExcited}) {
    EXPECT_STRNE(to_string(s), "unknown status");
  }
}

}  // namespace
}  // namespace heft
