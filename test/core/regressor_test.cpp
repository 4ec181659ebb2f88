#include "heft/core/dynamics/regressor.hpp"

#include <gtest/gtest.h>

#include "heft/core/dynamics/lumped_regressor.hpp"
#include "heft/model/named_arms.hpp"
#include "support/random_arm.hpp"

namespace heft {
namespace {

using test::Random;

TEST(Regressor, TimesParametersEqualsInverseDynamicsOnRandomArms) {
  Random random(21);
  for (int n = 0; n < 40; ++n) {
    const ArmModel<double, 5> model = test::random_arm<5>(random, 0.3);
    const DynamicArm<double, 5> arm(model);
    const auto q = test::random_vector<5>(random, 3), qd = test::random_vector<5>(random, 3),
               qdd = test::random_vector<5>(random, 5);
    FullRegressor<double, 5> Y;
    full_regressor<double, 5>(arm, q, qd, qdd, 0.0, Y);
    Eigen::Matrix<double, 70, 1> x;
    x.head<50>() = test::stacked_links(model);
    JointVector<double, 5> expected = inverse_dynamics(arm, q, qd, qdd);
    for (int i = 0; i < 5; ++i) {
      const auto& actuation = model.actuation[static_cast<std::size_t>(i)];
      x[50 + i] = actuation.rotor_inertia;
      x[55 + i] = actuation.coulomb_friction;
      x[60 + i] = actuation.viscous_friction;
      x[65 + i] = actuation.friction_offset;
      expected[i] += actuation.rotor_inertia * qdd[i] + friction_torque(actuation, qd[i], 0.0);
    }
    EXPECT_LT((Y * x - expected).norm(), 1e-12 * expected.norm()) << "arm " << n;
  }
}

// Axes along coordinate axes of their frames: turned inside, too, but by an exchange of columns.
TEST(Regressor, TimesParametersEqualsInverseDynamicsForAxesOfEveryDirection) {
  test::Random random(29);
  constexpr std::array<std::array<double, 3>, 6> kAxes = {
      {{0, 1, 0}, {0, 0, -1}, {1, 0, 0}, {0, -1, 0}, {-1, 0, 0}, {0, 0, 1}}};
  for (int n = 0; n < 20; ++n) {
    ArmModel<double, 6> model = test::random_arm<6>(random, 0.3);
    for (std::size_t j = 0; j < 6; ++j) model.joints[j].axis = kAxes[(j + static_cast<std::size_t>(n)) % 6];
    const DynamicArm<double, 6> arm(model);
    for (int j = 0; j < 6; ++j) ASSERT_TRUE(arm.exchange(j).exact);
    const auto q = test::random_vector<6>(random, 3), qd = test::random_vector<6>(random, 2),
               qdd = test::random_vector<6>(random, 5);
    LinkRegressor<double, 6> Y;
    link_regressor(arm, joint_trigonometry<DynamicArm<double, 6>>(q), q, qd, qdd, Y);
    const JointVector<double, 6> tau = inverse_dynamics(arm, q, qd, qdd);
    EXPECT_LT((Y * test::stacked_links(model) - tau).cwiseAbs().maxCoeff(), 1e-11 * tau.cwiseAbs().maxCoeff())
        << n;
    Eigen::Matrix<double, 6, 10> last;
    last_link_regressor(arm, joint_trigonometry<DynamicArm<double, 6>>(q), q, qd, qdd, last);
    EXPECT_EQ(last, Y.rightCols<10>()) << n;
  }
}

TEST(Regressor, ColumnsAreDerivativesOfTheTorque) {
  // Column by column: inverse dynamics is linear in the parameters, so a unit of one gives its column.
  Random random(22);
  const ArmModel<double, 4> model = test::random_arm<4>(random, 0.25);
  const auto q = test::random_vector<4>(random, 3), qd = test::random_vector<4>(random, 3),
             qdd = test::random_vector<4>(random, 5);
  LinkRegressor<double, 4> Y;
  const DynamicArm<double, 4> arm(model);
  link_regressor(arm, joint_trigonometry<DynamicArm<double, 4>>(q), q, qd, qdd, Y);
  for (std::size_t j = 0; j < 4; ++j) {
    for (std::size_t k = 0; k < 10; ++k) {
      ArmModel<double, 4> unit = model;
      for (auto& link : unit.links) {
        link.fill(0);
      }
      unit.links[j][k] = 1;
      const auto column = inverse_dynamics(DynamicArm<double, 4>(unit), q, qd, qdd);
      EXPECT_LT((Y.col(static_cast<Eigen::Index>(10 * j + k)) - column).norm(), 1e-12 * (1 + column.norm()))
          << "link " << j + 1 << " parameter " << k;
    }
  }
}

TEST(Regressor, CompileTimeAndRunTimeGeometryAgree) {
  Random random(23);
  using Arm = StaticArm<double, model::Ur5Arm>;
  const DynamicArm<double, 6> dynamic(model::Ur5Arm::kModel);
  for (int n = 0; n < 50; ++n) {
    const auto q = test::random_vector<6>(random, 3), qd = test::random_vector<6>(random, 3),
               qdd = test::random_vector<6>(random, 5);
    FullRegressor<double, 6> a, b;
    full_regressor<Arm>(q, qd, qdd, 0.0, a);
    full_regressor<double, 6>(dynamic, q, qd, qdd, 0.0, b);
    EXPECT_LT((a - b).cwiseAbs().maxCoeff(), 1e-12 * b.cwiseAbs().maxCoeff());
  }
}

TEST(LumpedRegressor, TimesLumpsEqualsTheTorqueWithFriction) {
  Random random(24);
  const auto& model = model::Ur5Arm::kModel;
  const DynamicArm<double, 6> arm(model);
  const auto x = lumped_parameters(model);
  for (int n = 0; n < 50; ++n) {
    const auto q = test::random_vector<6>(random, 3), qd = test::random_vector<6>(random, 3),
               qdd = test::random_vector<6>(random, 5);
    LinkRegressor<double, 6> Y;
    link_regressor(arm, joint_trigonometry<DynamicArm<double, 6>>(q), q, qd, qdd, Y);
    LumpedRegressor<double, 6> W;
    lumped_regressor<double, 6>(Y, qd, 0.0, W);
    JointVector<double, 6> expected = inverse_dynamics(arm, q, qd, qdd);
    for (int i = 0; i < 6; ++i) {
      expected[i] += friction_torque(model.actuation[static_cast<std::size_t>(i)], qd[i], 0.0);
    }
    EXPECT_LT((W * x - expected).norm(), 1e-12 * expected.norm());
  }
}

TEST(LumpedRegressor, TwelfthColumnMakesUpForTheTerminalMass) {
  // (39'): a change of link 6 shows as R Δx + c Δm; without the mass column it does not.
  Random random(25);
  const DynamicArm<double, 6> before(model::KawasakiArm::kModel),
      after(model::KawasakiArmWithPayload::kModel);
  const auto x0 = lumped_parameters(model::KawasakiArm::kModel);
  const auto x1 = lumped_parameters(model::KawasakiArmWithPayload::kModel);
  const double mass =
      model::KawasakiArmWithPayload::kModel.links[5][kMass] - model::KawasakiArm::kModel.links[5][kMass];
  EXPECT_NEAR(mass, 0.06, 1e-15);
  for (int n = 0; n < 20; ++n) {
    const auto q = test::random_vector<6>(random, 3), qd = test::random_vector<6>(random, 3),
               qdd = test::random_vector<6>(random, 5);
    LinkRegressor<double, 6> Y;
    link_regressor(before, joint_trigonometry<DynamicArm<double, 6>>(q), q, qd, qdd, Y);
    LumpedRegressor<double, 6> W;
    lumped_regressor<double, 6>(Y, qd, 0.0, W);
    const JointVector<double, 6> change =
        inverse_dynamics(after, q, qd, qdd) - inverse_dynamics(before, q, qd, qdd);
    const JointVector<double, 6> nine = W.block<6, 9>(0, 55) * (x1 - x0).segment<9>(55);
    const JointVector<double, 6> column = terminal_mass_column<double, 6>(Y);
    EXPECT_LT((nine + mass * column - change).norm(), 1e-14);
    EXPECT_LT(std::abs(column[5]) + std::abs(column[4]), 1e-15)
        << "rows 5 and 6 of this arm do not see the mass";
    EXPECT_GT((nine - change).norm(), 1e-3);
  }
}

}  // namespace
}  // namespace heft
