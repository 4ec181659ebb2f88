#include "heft/sim/forward_dynamics.hpp"

#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "heft/host/error.hpp"
#include "support/arms.hpp"

namespace heft::sim {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Textbook two-link arm, gravity along −y; numbers of test::planar_two_link().
struct TwoLink {
  double m1 = 2.0, m2 = 1.5, l1 = 0.5, c1 = 0.2, c2 = 0.25, I1 = 0.03, I2 = 0.02, g = 9.81;

  Matrix2d mass_matrix(double q2) const {
    const double coupling = m2 * l1 * c2 * std::cos(q2);
    const double far = I2 + m2 * c2 * c2;
    Matrix2d M;
    M << I1 + m1 * c1 * c1 + m2 * l1 * l1 + far + 2.0 * coupling, far + coupling, far + coupling, far;
    return M;
  }
  Vector2d bias(const Vector2d& q, const Vector2d& qd) const {
    const double h = m2 * l1 * c2 * std::sin(q[1]);
    const double g2 = m2 * g * c2 * std::cos(q[0] + q[1]);
    return {-h * (2.0 * qd[0] * qd[1] + qd[1] * qd[1]) + (m1 * c1 + m2 * l1) * g * std::cos(q[0]) + g2,
            h * qd[0] * qd[0] + g2};
  }
};

TEST(ForwardDynamics, EqualsTheClosedFormOfTwoLinks) {
  const ForwardDynamics dynamics(test::planar_two_link());
  const TwoLink two;
  for (double q1 : {-2.0, 0.3, 1.1}) {
    for (double q2 : {-1.2, 0.0, 2.5}) {
      const Vector2d q(q1, q2), qd(1.3 - q2, 0.7 * q1), tau(3.0, -2.0);
      const Vector2d expected = two.mass_matrix(q2).inverse() * (tau - two.bias(q, qd));
      const VectorXd found = dynamics.acceleration(q, qd, tau);
      EXPECT_LT((found - expected).norm(), 1e-12 * expected.norm()) << "q = " << q.transpose();
    }
  }
}

TEST(ForwardDynamics, KeepsLockedJointsAtRestAndReportsWhatTheyHold) {
  const ForwardDynamics dynamics(test::planar_two_link());
  const TwoLink two;
  const Vector2d q(0.4, 1.0), qd(0.8, 0.0), tau(5.0, 1.5);
  const Vector2d h = two.bias(q, qd);
  const auto M = two.mass_matrix(q[1]);
  const bool locked[2] = {false, true};
  Vector2d qdd, excess;
  dynamics.acceleration(q.data(), qd.data(), tau.data(), locked, nullptr, qdd.data(), excess.data());
  const double free = (tau[0] - h[0]) / M(0, 0);
  EXPECT_NEAR(qdd[0], free, 1e-12 * std::abs(free));
  EXPECT_EQ(qdd[1], 0.0);
  EXPECT_EQ(excess[0], 0.0);
  EXPECT_NEAR(excess[1], tau[1] - h[1] - M(1, 0) * free, 1e-12);
}

TEST(ForwardDynamics, AddsForceAndMomentAtTheTool) {
  model::Robot robot = test::planar_two_link();
  robot.tip_position = {0.4, 0.0, 0.0};
  const ForwardDynamics dynamics(robot);
  const Vector2d q(0.7, -1.1), qd(0.3, -0.6), tau(1.0, 2.0);
  Wrench wrench;
  wrench.force = Vector3d(7.0, -4.0, 2.0);
  wrench.moment = Vector3d(0.5, 0.2, 3.0);
  // Jacobian transpose of the planar arm by hand; the moment about z loads both joints alike.
  const Vector3d elbow(0.5 * std::cos(q[0]), 0.5 * std::sin(q[0]), 0.0);
  const Vector3d tip = elbow + Vector3d(0.4 * std::cos(q[0] + q[1]), 0.4 * std::sin(q[0] + q[1]), 0.0);
  const Vector2d load(tip.cross(wrench.force).z() + 3.0, (tip - elbow).cross(wrench.force).z() + 3.0);
  Vector2d found;
  dynamics.acceleration(q.data(), qd.data(), tau.data(), nullptr, &wrench, found.data(), nullptr);
  const VectorXd expected = dynamics.acceleration(q, qd, tau + load);
  EXPECT_LT((found - expected).norm(), 1e-12 * expected.norm());
}

TEST(ForwardDynamics, RefusesARobotWithoutJoints) {
  model::Robot robot;
  robot.name = "empty";
  try {
    const ForwardDynamics dynamics(robot);
    FAIL();
  } catch (const ModelError& e) {
    EXPECT_THAT(e.what(),
                testing::AllOf(testing::HasSubstr("\"empty\""), testing::HasSubstr("no moving joint")));
  }
}

TEST(ForwardDynamics, RefusesAnAxisThatIsNotOfUnitLength) {
  model::Robot robot = test::planar_two_link();
  robot.joints[1].joint.axis = {0.0, 0.0, 0.9};
  try {
    const ForwardDynamics dynamics(robot);
    FAIL();
  } catch (const ModelError& e) {
    EXPECT_THAT(e.what(),
                testing::AllOf(testing::HasSubstr("joint \"joint2\""), testing::HasSubstr("length 0.9")));
  }
}

TEST(ForwardDynamics, RefusesANegativeMass) {
  model::Robot robot = test::planar_two_link();
  robot.joints[0].link[kMass] = -2.0;
  try {
    const ForwardDynamics dynamics(robot);
    FAIL();
  } catch (const ModelError& e) {
    EXPECT_THAT(e.what(), testing::AllOf(testing::HasSubstr("joint1_link"), testing::HasSubstr("-2")));
  }
}

}  // namespace
}  // namespace heft::sim
