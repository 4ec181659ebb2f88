// The seeded cases that diagnosis is tested with.
#include "support/undeclared_case.hpp"

#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

namespace heft::test {
namespace {

TEST(UndeclaredCase, WithoutEffectLeavesTheNoiseToTheDeclaredModel) {
  const UndeclaredCase c = make_undeclared_case("none", "scara4", 3);
  EXPECT_TRUE(c.effects.empty());
  EXPECT_EQ(c.kind, "none");
  ASSERT_EQ(c.robot.num_joints(), 4);
  EXPECT_EQ(c.robot.joints[2].joint.type, JointType::kPrismatic);
  EXPECT_NEAR(static_cast<double>(c.validate.time.size()) / c.rate, 20.0, 1e-9);
  EXPECT_EQ(c.train.qd.cols(), c.has_qd ? 4 : 0);
  for (int i = 0; i < 4; ++i) {
    const auto k = static_cast<std::size_t>(i);
    // 7 % for what 20 s leave to chance.
    EXPECT_NEAR(c.baseline_validate[i], c.noise_floor[i], 0.07 * c.noise_floor[i]) << i;
    const double limit = c.robot.joints[k].effort_limit;
    EXPECT_GT(c.noise_floor[i], 0.003 * limit);
    EXPECT_LT(c.noise_floor[i], 0.0105 * limit);
    const double step = i == 2 ? 5e-6 : 2e-5;
    for (Eigen::Index row = 0; row < c.train.q.rows(); row += 97) {
      const double counts = c.train.q(row, i) / step;
      EXPECT_NEAR(counts, std::round(counts), 1e-6);
    }
    // The last link carries the tool, which is off by itself: the sum can be nearer.
    const double off = std::abs(c.truth.joints[k].link[kMass] / c.robot.joints[k].link[kMass] - 1.0);
    EXPECT_LT(off, 0.2501);
    if (i < 3) {
      EXPECT_GT(off, 0.0999);
    }
  }
}

TEST(UndeclaredCase, EffectExceedsTheNoiseAtItsJoint) {
  const UndeclaredCase c = make_undeclared_case("stribeck+spring", "scara4", 2);
  ASSERT_EQ(c.effects.size(), 2u);
  EXPECT_NE(c.effects[0].joint, c.effects[1].joint);
  for (const UndeclaredEffect& effect : c.effects) {
    EXPECT_GT(c.excess_train[effect.main_joint], 0.9) << effect.kind;
    EXPECT_LT(c.excess_train[effect.main_joint], 7.0) << effect.kind;
  }
}

TEST(UndeclaredCase, IsTheSameForTheSameSeed) {
  const UndeclaredCase first = make_undeclared_case("hysteresis", "scara4", 1);
  const UndeclaredCase again = make_undeclared_case("hysteresis", "scara4", 1);
  EXPECT_EQ(first.train.tau, again.train.tau);
  EXPECT_EQ(first.validate.q, again.validate.q);
  EXPECT_EQ(first.effects[0].parameters, again.effects[0].parameters);
}

TEST(UndeclaredCase, RefusesNamesThatDoNotExist) {
  EXPECT_THROW(make_undeclared_case("stiction", "scara4", 1), std::invalid_argument);
  EXPECT_THROW(make_undeclared_case("none", "arm9", 1), std::invalid_argument);
  EXPECT_THROW(make_undeclared_case("wrist_coupling", "scara4", 1), std::invalid_argument);
  EXPECT_THROW(make_undeclared_case("base_tilt", "scara4", 1, CaseMotion::kExciting, {9.81, 0.0, 0.0}), std::invalid_argument);
}

}  // namespace
}  // namespace heft::test
