#include "heft/core/dynamics/lagrangian.hpp"

#include <gtest/gtest.h>

#include "heft/core/dynamics/joint_space.hpp"
#include "heft/core/dynamics/loaded_torque.hpp"
#include "heft/model/named_arms.hpp"
#include "support/random_arm.hpp"

namespace heft {
namespace {

using test::Random;

template <int N>
using Terms = LagrangianTerms<double, N>;

template <int N>
Terms<N> terms_of(const DynamicArm<double, N>& arm, const JointVector<double, N>& q,
                  const JointVector<double, N>& qd) {
  Terms<N> terms;
  lagrangian_terms(arm, joint_trigonometry<DynamicArm<double, N>>(q), q, qd, terms);
  return terms;
}

template <int N>
MassMatrix<double, N> mass_of(const DynamicArm<double, N>& arm, const JointVector<double, N>& q) {
  MassMatrix<double, N> mass;
  mass_matrix(arm, joint_trigonometry<DynamicArm<double, N>>(q), q, mass);
  return mass;
}

TEST(Lagrangian, MomentumIsMassMatrixTimesVelocity) {
  Random random(1);
  for (int n = 0; n < 50; ++n) {
    const DynamicArm<double, 5> arm(test::random_arm<5>(random, 0.3));
    const auto q = test::random_vector<5>(random, 2), qd = test::random_vector<5>(random, 2);
    const JointVector<double, 5> expected = mass_of(arm, q) * qd;
    EXPECT_LT((terms_of(arm, q, qd).momentum - expected).norm(), 1e-12 * expected.norm()) << n;
  }
}

TEST(Lagrangian, GradientIsThatOfTheEnergies) {
  // Kinetic energy by central differences of the mass matrix, potential energy by the gravity torque.
  Random random(2);
  for (int n = 0; n < 50; ++n) {
    const DynamicArm<double, 5> arm(test::random_arm<5>(random, 0.3));
    const auto q = test::random_vector<5>(random, 2), qd = test::random_vector<5>(random, 2);
    JointVector<double, 5> expected;
    gravity_torque(arm, joint_trigonometry<DynamicArm<double, 5>>(q), q, expected);
    expected = -expected;
    const double h = 1e-5;
    for (int j = 0; j < 5; ++j) {
      JointVector<double, 5> up = q, down = q;
      up[j] += h, down[j] -= h;
      expected[j] += 0.5 * (qd.dot(mass_of(arm, up) * qd) - qd.dot(mass_of(arm, down) * qd)) / (2 * h);
    }
    EXPECT_LT((terms_of(arm, q, qd).gradient - expected).norm(), 1e-7 * (1 + expected.norm())) << n;
  }
}

template <typename Description>
class StaticLagrangian : public ::testing::Test {};
using Descriptions = ::testing::Types<model::KawasakiArm, model::KawasakiArmWithPayload, model::Ur5Arm>;
TYPED_TEST_SUITE(StaticLagrangian, Descriptions);

TYPED_TEST(StaticLagrangian, IsThatOfTheRunTimeArm) {
  using Arm = StaticArm<double, TypeParam>;
  const DynamicArm<double, 6> dynamic(TypeParam::kModel);
  Random random(3);
  for (int n = 0; n < 50; ++n) {
    const auto q = test::random_vector<6>(random, 3), qd = test::random_vector<6>(random, 2);
    const auto expected = terms_of(dynamic, q, qd);
    const auto trig = joint_trigonometry<Arm>(q);
    Terms<6> found;
    lagrangian_terms<Arm>(ConstantParameters<double, TypeParam>{}, trig, q, qd, found);
    EXPECT_LT((found.momentum - expected.momentum).norm(), 1e-12 * expected.momentum.norm()) << n;
    EXPECT_LT((found.gradient - expected.gradient).norm(), 1e-12 * (1 + expected.gradient.norm())) << n;
    LoadColumns<double, 6> columns, run_time;
    load_columns<Arm>(trig, q, columns);
    load_columns(dynamic, joint_trigonometry<DynamicArm<double, 6>>(q), q, run_time);
    EXPECT_LT((columns - run_time).norm(), 1e-12 * run_time.norm()) << n;
  }
}

/// Both torques of one pass against inverse dynamics of the arm, and of the arm with the body on its last link.
template <int N, typename TwoTorques>
void expect_two_torques(ArmModel<double, N> model, const InertialParameters<double>& body,
                        const JointVector<double, N>& q, const JointVector<double, N>& qd,
                        const JointVector<double, N>& qdd, const TwoTorques& both) {
  const JointVector<double, N> rest = JointVector<double, N>::Zero();
  const JointVector<double, N> expected_bias = inverse_dynamics(DynamicArm<double, N>(model), q, qd, rest);
  for (std::size_t k = 0; k < body.size(); ++k) model.links[N - 1][k] += body[k];
  const JointVector<double, N> expected = inverse_dynamics(DynamicArm<double, N>(model), q, qd, qdd);
  JointVector<double, N> bias, loaded;
  both(bias, loaded);
  EXPECT_LT((bias - expected_bias).norm(), 1e-12 * (1 + expected_bias.norm()));
  EXPECT_LT((loaded - expected).norm(), 1e-12 * (1 + expected.norm()));
}

TEST(LoadedTorque, IsThatOfTheArmAndOfTheArmWithABodyAtAnAcceleration) {
  Random random(5);
  for (int n = 0; n < 50; ++n) {  // a third of the joints prismatic
    const ArmModel<double, 5> model = test::random_arm<5>(random, 0.3);
    const DynamicArm<double, 5> arm(model);
    const InertialParameters<double> body = test::random_body(random);
    const auto q = test::random_vector<5>(random, 2), qd = test::random_vector<5>(random, 2),
               qdd = test::random_vector<5>(random, 9);
    expect_two_torques<5>(model, body, q, qd, qdd, [&](auto& bias, auto& loaded) {
      loaded_torque(arm, joint_trigonometry<DynamicArm<double, 5>>(q), q, qd, qdd, body, bias, loaded);
    });
  }
}

TYPED_TEST(StaticLagrangian, LoadedTorqueIsThatOfTheRunTimeArm) {
  using Arm = StaticArm<double, TypeParam>;
  Random random(6);
  for (int n = 0; n < 50; ++n) {
    const InertialParameters<double> body = test::random_body(random);
    const auto q = test::random_vector<6>(random, 3), qd = test::random_vector<6>(random, 2),
               qdd = test::random_vector<6>(random, 9);
    const auto& g = TypeParam::kModel.gravity;
    expect_two_torques<6>(TypeParam::kModel, body, q, qd, qdd, [&](auto& bias, auto& loaded) {
      loaded_torque<Arm>(ConstantParameters<double, TypeParam>{}, joint_trigonometry<Arm>(q),
                         {-g[0], -g[1], -g[2]}, q, qd, qdd, body, bias, loaded);
    });
  }
}

TEST(LoadColumns, HoldWhatABodyAddsToGravity) {
  Random random(4);
  for (int n = 0; n < 30; ++n) {
    ArmModel<double, 5> model = test::random_arm<5>(random, 0.3);
    const DynamicArm<double, 5> bare(model);
    const InertialParameters<double> body = test::random_body(random);
    for (std::size_t k = 0; k < body.size(); ++k) model.links[4][k] += body[k];
    const DynamicArm<double, 5> loaded(model);
    const auto q = test::random_vector<5>(random, 2);
    const auto trig = joint_trigonometry<DynamicArm<double, 5>>(q);
    JointVector<double, 5> without, with;
    gravity_torque(bare, trig, q, without);
    gravity_torque(loaded, trig, q, with);
    LoadColumns<double, 5> columns;
    load_columns(bare, trig, q, columns);
    const Eigen::Vector4d x(body[0], body[1], body[2], body[3]);
    EXPECT_LT((columns * x - (with - without)).norm(), 1e-11 * with.norm()) << n;
  }
}

}  // namespace
}  // namespace heft
