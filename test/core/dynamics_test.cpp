#include "heft/core/dynamics/inverse_dynamics.hpp"

#include <numbers>

#include <gtest/gtest.h>

#include "heft/core/dynamics/joint_space.hpp"
#include "heft/core/dynamics/regressor.hpp"
#include "heft/model/named_arms.hpp"
#include "support/random_arm.hpp"

namespace heft {
namespace {

using test::Random;

/// Axes of every kind, two prismatic ones, and bodies of one kilogram a metre away, whose numbers are known ones.
struct MixedArm {
  static constexpr ArmModel<double, 6> kModel = [] {
    ArmModel<double, 6> arm;
    arm.joints[0].axis = {0, 0.6, 0.8};
    arm.joints[1].type = JointType::kPrismatic;
    arm.joints[1].axis = {0, 1, 0};
    arm.joints[2].axis = {1, 0, 0};
    arm.joints[3].axis = {0.36, 0.48, -0.8};
    arm.joints[4].type = JointType::kPrismatic;
    arm.joints[4].axis = {-0.6, 0, 0.8};
    arm.joints[5].axis = {0, -1, 0};
    for (std::size_t j = 0; j < 6; ++j) {
      arm.joints[j].position = {j % 2 == 0 ? 1.0 : 0.3, 0, j % 3 == 0 ? -1.0 : 0.0};
      arm.links[j] = make_inertial_parameters<double>(1.0, {0, 1, j == 5 ? 1.0 : 0.0}, {0.1, 0, 0.05, 0, 0, 0.1});
    }
    return arm;
  }();
};

/// Compile-time geometry against run-time geometry on the same arm.
template <typename Description>
class StaticArmTest : public ::testing::Test {};
using DynamicsDescriptions = ::testing::Types<model::KawasakiArm, model::KawasakiArmWithPayload, model::Ur5Arm, MixedArm>;
TYPED_TEST_SUITE(StaticArmTest, DynamicsDescriptions);

TYPED_TEST(StaticArmTest, GivesTheTorquesOfTheRunTimeArm) {
  using Arm = StaticArm<double, TypeParam>;
  const DynamicArm<double, 6> dynamic(TypeParam::kModel);
  const ReducedParameters<double, TypeParam> live{reduced_links(TypeParam::kModel)};
  Random random(5);
  for (int n = 0; n < 200; ++n) {
    const auto q = test::random_vector<6>(random, 3), qd = test::random_vector<6>(random, 3),
               qdd = test::random_vector<6>(random, 10);
    const auto expected = inverse_dynamics(dynamic, q, qd, qdd);
    const double size = expected.cwiseAbs().maxCoeff();
    const auto constant = inverse_dynamics<Arm>(ConstantParameters<double, TypeParam>{}, q, qd, qdd);
    const auto reduced = inverse_dynamics<Arm>(live, q, qd, qdd);
    EXPECT_LT((constant - expected).cwiseAbs().maxCoeff(), 1e-12 * size) << "state " << n;
    EXPECT_LT((reduced - expected).cwiseAbs().maxCoeff(), 1e-12 * size) << "state " << n;
  }
}

TYPED_TEST(StaticArmTest, MassMatrixAndBiasMakeUpTheTorque) {
  using Arm = StaticArm<double, TypeParam>;
  const ConstantParameters<double, TypeParam> parameters;
  const DynamicArm<double, 6> dynamic(TypeParam::kModel);
  Random random(6);
  for (int n = 0; n < 100; ++n) {
    const auto q = test::random_vector<6>(random, 3), qd = test::random_vector<6>(random, 3),
               qdd = test::random_vector<6>(random, 10);
    const auto trig = joint_trigonometry<Arm>(q);
    MassMatrix<double, 6> mass, run_time_mass;
    mass_matrix<Arm>(parameters, trig, q, mass);
    mass_matrix(dynamic, joint_trigonometry<DynamicArm<double, 6>>(q), q, run_time_mass);
    typename Arm::Vector bias, gravity, zero_velocity;
    bias_torque<Arm>(parameters, trig, q, qd, bias);
    gravity_torque<Arm>(parameters, trig, q, gravity);
    bias_torque<Arm>(parameters, trig, q, Arm::Vector::Zero(), zero_velocity);
    const auto tau = inverse_dynamics<Arm>(parameters, q, qd, qdd);
    EXPECT_LT((mass * qdd + bias - tau).norm(), 1e-12 * tau.norm());
    EXPECT_LT((mass - run_time_mass).norm(), 1e-13 * mass.norm());
    EXPECT_LT((mass - mass.transpose()).norm(), 1e-15 + 1e-14 * mass.norm());
    EXPECT_GT(mass.eval().selfadjointView<Eigen::Lower>().eigenvalues().minCoeff(), 0.0);
    EXPECT_LT((gravity - zero_velocity).norm(), 1e-14 + 1e-13 * gravity.norm());
  }
}

TYPED_TEST(StaticArmTest, ForwardThenInverseDynamicsReturnsTheTorque) {
  using Arm = StaticArm<double, TypeParam>;
  const ConstantParameters<double, TypeParam> parameters;
  const typename Arm::Vector rotor = Arm::Vector::Constant(0.01);
  Random random(7);
  for (int n = 0; n < 200; ++n) {
    const auto q = test::random_vector<6>(random, 3), qd = test::random_vector<6>(random, 3),
               tau = test::random_vector<6>(random, 10);
    const auto trig = joint_trigonometry<Arm>(q);
    MassMatrix<double, 6> mass;
    mass_matrix<Arm>(parameters, trig, q, mass);
    typename Arm::Vector bias, qdd;
    bias_torque<Arm>(parameters, trig, q, qd, bias);
    ASSERT_EQ((forward_dynamics<double, 6>(mass, bias, rotor, tau, qdd)), Status::kOk);
    const typename Arm::Vector back = inverse_dynamics<Arm>(parameters, q, qd, qdd) + rotor.cwiseProduct(qdd);
    EXPECT_LT((back - tau).norm(), 1e-10 * tau.norm());
  }
}

TEST(ForwardDynamics, RefusesAMassMatrixThatIsNotPositiveAndKeepsTheOutput) {
  MassMatrix<double, 2> mass;
  mass << 1, 2, 2, 1;
  JointVector<double, 2> qdd(7, 8);
  const JointVector<double, 2> zero = JointVector<double, 2>::Zero();
  EXPECT_EQ((forward_dynamics<double, 2>(mass, zero, zero, zero, qdd)), Status::kNotPositiveDefinite);
  EXPECT_EQ(qdd, (JointVector<double, 2>(7, 8)));
}

/// A planar two-link arm has a closed form (Spong and Vidyasagar): links in the vertical plane, axes along y.
TEST(DynamicArm, EqualsTheClosedFormOfTheTwoLinkArm) {
  ArmModel<double, 2> arm;
  const double l1 = 0.7, c1 = 0.3, c2 = 0.25, m1 = 2.1, m2 = 1.3, i1 = 0.05, i2 = 0.03;
  arm.joints[0].axis = {0, -1, 0};
  arm.joints[1].axis = {0, -1, 0};
  arm.joints[1].position = {l1, 0, 0};
  arm.links[0] = make_inertial_parameters<double>(m1, {c1, 0, 0}, {0, 0, i1, 0, 0, 0});
  arm.links[1] = make_inertial_parameters<double>(m2, {c2, 0, 0}, {0, 0, i2, 0, 0, 0});
  const DynamicArm<double, 2> dynamic(arm);
  Random random(8);
  for (int n = 0; n < 50; ++n) {
    const auto q = test::random_vector<2>(random, 3), qd = test::random_vector<2>(random, 3),
               qdd = test::random_vector<2>(random, 5);
    const double h = m2 * l1 * c2;
    const double d11 = m1 * c1 * c1 + m2 * (l1 * l1 + c2 * c2) + 2 * h * std::cos(q[1]) + i1 + i2;
    const double d12 = m2 * c2 * c2 + h * std::cos(q[1]) + i2;
    const double d22 = m2 * c2 * c2 + i2;
    const double s = h * std::sin(q[1]);
    const double g = 9.81;
    const JointVector<double, 2> expected(
        d11 * qdd[0] + d12 * qdd[1] - s * (2 * qd[0] * qd[1] + qd[1] * qd[1]) +
            g * ((m1 * c1 + m2 * l1) * std::cos(q[0]) + m2 * c2 * std::cos(q[0] + q[1])),
        d12 * qdd[0] + d22 * qdd[1] + s * qd[0] * qd[0] + g * m2 * c2 * std::cos(q[0] + q[1]));
    EXPECT_LT((inverse_dynamics(dynamic, q, qd, qdd) - expected).norm(), 1e-12);
  }
}

TEST(DynamicArm, PredictionIsUnchangedWhenALinkFrameIsTurned) {
  // The same arm with the axes of link 2 turned by R: joint, inertia and the next joint's placement follow.
  Random random(9);
  const ArmModel<double, 4> arm = test::random_arm<4>(random, 0.25);
  ArmModel<double, 4> turned = arm;
  const Eigen::Matrix3d R = Eigen::AngleAxisd(1.1, test::random_direction(random)).toRotationMatrix();
  using Rows = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  auto& joint = turned.joints[1];
  Eigen::Map<Rows>(joint.rotation.data()) =
      Eigen::Map<const Rows>(arm.joints[1].rotation.data()) * R.transpose();
  Eigen::Map<Eigen::Vector3d>(joint.axis.data()) =
      R * Eigen::Map<const Eigen::Vector3d>(arm.joints[1].axis.data());
  std::array<double, 9> rows{};
  Eigen::Map<Rows>(rows.data()) = R;
  turned.links[1] = to_inertial_parameters(moved(to_pseudo_inertia(arm.links[1]), rows, {0, 0, 0}));
  Eigen::Map<Rows>(turned.joints[2].rotation.data()) =
      R * Eigen::Map<const Rows>(arm.joints[2].rotation.data());
  Eigen::Map<Eigen::Vector3d>(turned.joints[2].position.data()) =
      R * Eigen::Map<const Eigen::Vector3d>(arm.joints[2].position.data());
  const DynamicArm<double, 4> a(arm), b(turned);
  for (int n = 0; n < 20; ++n) {
    const auto q = test::random_vector<4>(random, 3), qd = test::random_vector<4>(random, 3),
               qdd = test::random_vector<4>(random, 5);
    const auto expected = inverse_dynamics(a, q, qd, qdd);
    EXPECT_LT((inverse_dynamics(b, q, qd, qdd) - expected).norm(), 1e-12 * expected.norm());
  }
}

/// Axes of all joints z, the next axis turned against the one before by this angle.
ArmModel<double, 6> twisted_arm(Random& random, double twist) {
  ArmModel<double, 6> arm = test::random_arm<6>(random, 0.3);
  for (auto& joint : arm.joints) {
    const auto about_z = [&] { return Eigen::AngleAxisd(test::uniform(random, -3, 3), Eigen::Vector3d::UnitZ()); };
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(joint.rotation.data()) =
        (about_z() * Eigen::AngleAxisd(twist, Eigen::Vector3d::UnitX()) * about_z()).toRotationMatrix();
    joint.axis = {0, 0, 1};
  }
  return arm;
}

TEST(DynamicArm, TorquesAndMassesAreThoseOfTheRowsWhateverTheTwist) {
  constexpr double kPi = std::numbers::pi;
  // Rows are made in other frames than torques and masses. Common normals of the nearly parallel axes are far away.
  Random random(12);
  for (const double twist : {0.0, 1e-17, 1e-15, 1e-9, 1e-4, 0.7, kPi / 2, -kPi / 2, 3.0, kPi - 1e-9, kPi}) {
    const ArmModel<double, 6> model = twisted_arm(random, twist);
    DynamicArm<double, 6> arm(model);
    arm.set_link(3, model.links[2]);
    arm.set_gravity({1, -5, 7});
    const auto links = test::stacked_links(arm.model());
    const auto q = test::random_vector<6>(random, 3), qd = test::random_vector<6>(random, 3),
               qdd = test::random_vector<6>(random, 10);
    const auto trig = joint_trigonometry<DynamicArm<double, 6>>(q);
    LinkRegressor<double, 6> Y;
    link_regressor(arm, trig, q, qd, qdd, Y);
    const JointVector<double, 6> expected = Y * links;
    EXPECT_LT((inverse_dynamics(arm, q, qd, qdd) - expected).norm(), 1e-14 * expected.norm()) << "twist " << twist;

    MassMatrix<double, 6> mass, columns;
    mass_matrix(arm, trig, q, mass);
    arm.set_gravity({0, 0, 0});
    for (int c = 0; c < 6; ++c) {
      const JointVector<double, 6> rest = JointVector<double, 6>::Zero(), one = JointVector<double, 6>::Unit(c);
      link_regressor(arm, trig, q, rest, one, Y);
      columns.col(c) = Y * links;
    }
    EXPECT_LT((mass - columns).norm(), 1e-14 * mass.norm()) << "twist " << twist;
  }
}

TEST(DynamicArm, HandlesAnAxisAlongMinusZ) {
  ArmModel<double, 1> up, down;
  up.links[0] = make_inertial_parameters<double>(1.5, {0.3, 0.1, -0.2}, {0.01, 0, 0.02, 0, 0, 0.03});
  down.links[0] = up.links[0];
  up.gravity = down.gravity = {3, -4, 5};
  down.joints[0].axis = {0, 0, -1};
  const DynamicArm<double, 1> a(up), b(down);
  using V = JointVector<double, 1>;
  EXPECT_NEAR(inverse_dynamics(a, V(0.4), V(1.0), V(2.0))[0],
              -inverse_dynamics(b, V(-0.4), V(-1.0), V(-2.0))[0], 1e-13);
}

TEST(ModifiedDh, EqualsStandardDhForTheSameBodies) {
  // One joint, twist zero: the two conventions describe the same motion with the same link frame.
  const std::array<DenavitHartenberg<double>, 2> standard = {{{0.3, 0, 0, 1}, {0, 0, 0, 1}}};
  const std::array<DenavitHartenberg<double>, 2> modified = {{{0, 0, 0, 1}, {0.3, 0, 0, 1}}};
  Random random(10);
  const auto body1 = test::random_body(random), body2 = test::random_body(random);
  // Standard frames sit at the far end: shift body 1 back by its link length.
  const auto far =
      to_inertial_parameters(moved(to_pseudo_inertia(body1), {1, 0, 0, 0, 1, 0, 0, 0, 1}, {-0.3, 0, 0}));
  const DynamicArm<double, 2> a(make_standard_dh_arm<double, 2>(standard, {far, body2}));
  const DynamicArm<double, 2> b(make_modified_dh_arm<double, 2>(modified, {body1, body2}));
  const auto q = test::random_vector<2>(random, 3), qd = test::random_vector<2>(random, 3),
             qdd = test::random_vector<2>(random, 5);
  EXPECT_LT((inverse_dynamics(a, q, qd, qdd) - inverse_dynamics(b, q, qd, qdd)).norm(), 1e-13);
}

TEST(StaticArm, WorksInFloat) {
  using Arm = StaticArm<float, model::Ur5Arm>;
  Random random(13);
  const auto q = test::random_vector<6>(random, 3), qd = test::random_vector<6>(random, 2),
             qdd = test::random_vector<6>(random, 5);
  const auto exact = inverse_dynamics(DynamicArm<double, 6>(model::Ur5Arm::kModel), q, qd, qdd);
  const auto single =
      inverse_dynamics<Arm>(ConstantParameters<float, model::Ur5Arm>{}, q.cast<float>().eval(),
                            qd.cast<float>().eval(), qdd.cast<float>().eval());
  EXPECT_LT((single.cast<double>() - exact).cwiseAbs().maxCoeff(), 2e-6 * exact.cwiseAbs().maxCoeff());
}

}  // namespace
}  // namespace heft
