#include "heft/core/inertia.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/model/named_arms.hpp"
#include "support/random_arm.hpp"

namespace heft {
namespace {

using test::Random;

TEST(PseudoInertia, RoundTripsInertialParameters) {
  Random random(1);
  for (int n = 0; n < 100; ++n) {
    const auto p = test::random_body(random);
    const auto back = to_inertial_parameters(to_pseudo_inertia(p));
    for (std::size_t i = 0; i < 10; ++i) {
      EXPECT_NEAR(back[i], p[i], 1e-15);
    }
  }
}

TEST(PseudoInertia, MovedBodyKeepsItsInertiaAboutTheCentreOfMass) {
  Random random(2);
  const auto p = test::random_body(random);
  const Eigen::Matrix3d R = Eigen::AngleAxisd(0.7, test::random_direction(random)).toRotationMatrix();
  std::array<double, 9> rows{};
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      rows[static_cast<std::size_t>(3 * r + c)] = R(r, c);
    }
  }
  const Eigen::Vector3d shift(0.3, -0.1, 0.7);
  const auto m = to_inertial_parameters(moved(to_pseudo_inertia(p), rows, {shift[0], shift[1], shift[2]}));
  const auto about_com = [](const InertialParameters<double>& q) {
    const Eigen::Vector3d c = Eigen::Vector3d(q[1], q[2], q[3]) / q[0];
    Eigen::Matrix3d I;
    I << q[4], q[5], q[7], q[5], q[6], q[8], q[7], q[8], q[9];
    return Eigen::Matrix3d(I - q[0] * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose()));
  };
  EXPECT_LT((about_com(m) - R * about_com(p) * R.transpose()).norm(), 1e-14);
  const Eigen::Vector3d com = Eigen::Vector3d(p[1], p[2], p[3]) / p[0];
  const Eigen::Vector3d com_moved = Eigen::Vector3d(m[1], m[2], m[3]) / m[0];
  EXPECT_LT((com_moved - (R * com + shift)).norm(), 1e-14);
}

/// Reduction of random arms, revolute and mixed, general axes.
class Reduction : public ::testing::TestWithParam<double> {};

TEST_P(Reduction, ChangesNoTorque) {
  Random random(3);
  for (int n = 0; n < 50; ++n) {
    ArmModel<double, 5> arm = test::random_arm<5>(random, GetParam());
    if (n % 2 == 0) {
      // Gravity along the first axis: the case in which only one parameter of link 1 is left.
      auto& first = arm.joints[0];
      first.type = JointType::kRevolute;
      const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(first.rotation.data());
      const Eigen::Vector3d g = -9.81 * (R * Eigen::Map<const Eigen::Vector3d>(first.axis.data()));
      arm.gravity = {g[0], g[1], g[2]};
    }
    ArmModel<double, 5> reduced = arm;
    const auto links = reduced_links(arm);
    for (std::size_t j = 0; j < 5; ++j) {
      reduced.links[j] = to_inertial_parameters(links[j]);
    }
    const DynamicArm<double, 5> full(arm), small(reduced);
    const auto q = test::random_vector<5>(random, 3), qd = test::random_vector<5>(random, 2),
               qdd = test::random_vector<5>(random, 5);
    const auto a = inverse_dynamics(full, q, qd, qdd);
    const auto b = inverse_dynamics(small, q, qd, qdd);
    EXPECT_LT((a - b).norm(), 1e-12 * a.norm()) << "arm " << n;
  }
}

INSTANTIATE_TEST_SUITE_P(RevoluteAndMixed, Reduction, ::testing::Values(0.0, 0.4));

TEST(Reduction, LeavesSevenParametersALinkAndOneForAVerticalFirstAxis) {
  const auto links = reduced_links(model::Ur5Arm::kModel);
  for (std::size_t j = 0; j < 6; ++j) {
    int count = 0;
    for (const double v : links[j]) {
      count += std::abs(v) > 1e-12 ? 1 : 0;
    }
    EXPECT_LE(count, j == 0 ? 1 : 7) << "link " << j + 1;
  }
}

}  // namespace
}  // namespace heft
