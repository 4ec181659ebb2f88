#include "heft/core/dynamics/torque_derivatives.hpp"

#include <gtest/gtest.h>

#include "heft/core/converted.hpp"
#include "heft/model/named_arms.hpp"
#include "support/random_arm.hpp"

namespace heft {
namespace {

using test::Random;

/// Central differences of the inverse dynamics: error h² and 1e-16 / h of torques of some 100 N·m.
TEST(TorqueDerivatives, EqualDifferencesOfTheInverseDynamics) {
  Random random(1);
  constexpr double kStep = 1e-5;
  for (int n = 0; n < 50; ++n) {
    const DynamicArm<double, 6> arm(test::random_arm<6>(random, 0.3));
    const auto q = test::random_vector<6>(random, 3), qd = test::random_vector<6>(random, 2),
               qdd = test::random_vector<6>(random, 5);
    TorqueDerivatives<double, 6> found;
    torque_derivatives(arm, joint_trigonometry<DynamicArm<double, 6>>(q), q, qd, qdd, found);
    using Vector = JointVector<double, 6>;
    const auto torque = [&](const Vector& at, const Vector& speed) {
      return inverse_dynamics(arm, at, speed, qdd);
    };
    for (int j = 0; j < 6; ++j) {
      const Vector e = kStep * Vector::Unit(j);
      const Vector dq = (torque(q + e, qd) - torque(q - e, qd)) / (2 * kStep);
      const Vector dqd = (torque(q, qd + e) - torque(q, qd - e)) / (2 * kStep);
      EXPECT_LT((found.dq.col(j) - dq).norm(), 1e-7 * (1 + found.dq.norm())) << "column " << j;
      EXPECT_LT((found.dqd.col(j) - dqd).norm(), 1e-8 * (1 + found.dqd.norm())) << "column " << j;
    }
  }
}

/// The wrist of a UR5 has a thousandth of the shoulder's inertia.
TEST(TorqueDerivatives, AreRightInFloatDownToTheWrist) {
  Random random(2);
  const DynamicArm<double, 6> exact(model::Ur5Arm::kModel);
  const DynamicArm<float, 6> single(converted<float>(model::Ur5Arm::kModel));
  for (int n = 0; n < 20; ++n) {
    const auto q = test::random_vector<6>(random, 3), qd = test::random_vector<6>(random, 2),
               qdd = test::random_vector<6>(random, 5);
    TorqueDerivatives<double, 6> expected;
    torque_derivatives(exact, joint_trigonometry<DynamicArm<double, 6>>(q), q, qd, qdd, expected);
    const JointVector<float, 6> qf = q.cast<float>(), qdf = qd.cast<float>(), qddf = qdd.cast<float>();
    TorqueDerivatives<float, 6> found;
    torque_derivatives(single, joint_trigonometry<DynamicArm<float, 6>>(qf), qf, qdf, qddf, found);
    for (int i = 0; i < 6; ++i) {
      EXPECT_LT((found.dq.row(i).cast<double>() - expected.dq.row(i)).norm(),
                1e-4 * expected.dq.row(i).norm())
          << "joint " << i;
      EXPECT_LT((found.dqd.row(i).cast<double>() - expected.dqd.row(i)).norm(),
                1e-4 * expected.dqd.row(i).norm())
          << "joint " << i;
    }
  }
}

}  // namespace
}  // namespace heft
