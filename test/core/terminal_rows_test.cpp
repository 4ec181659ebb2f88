#include "heft/core/dynamics/terminal_rows.hpp"

#include <gtest/gtest.h>
#include <Eigen/Core>

#include "heft/core/control/terminal_link_cycle.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/model/named_arms.hpp"
#include "support/random_arm.hpp"

namespace heft {
namespace {

using test::Random;

/// An arm whose first two axes are parallel and whose geometry has no right angles beyond: the run of parallel axes
/// starts at the base, and constants are general.
constexpr ArmModel<double, 5> make_skew_arm() {
  const std::array<DenavitHartenberg<double>, 5> table = {{{0.3, 0.1, 0, 1},
                                                           {0.25, -0.2, 0.6, 0.8},
                                                           {-0.1, 0.15, -0.28, 0.96},
                                                           {0.12, 0.05, 0, 1},
                                                           {0.0, 0.07, 0.8, -0.6}}};
  std::array<InertialParameters<double>, 5> links{};
  for (std::size_t j = 0; j < 5; ++j) {
    const double s = 1.0 + 0.3 * static_cast<double>(j);
    links[j] = make_inertial_parameters<double>(s, {0.05 * s, -0.04, 0.03},
                                                {0.02, 0.001, 0.03, -0.002, 0.003, 0.025});
  }
  return make_standard_dh_arm<double, 5>(table, links);
}
struct SkewArm {
  static constexpr ArmModel<double, 5> kModel = make_skew_arm();
};

/// Reduced parameters of links First.. in the order of the layout, friction zero.
template <typename Arm, int First>
std::array<double, static_cast<std::size_t>(TerminalLayout<Arm, First>::kParameters)> layout_parameters() {
  using Layout = TerminalLayout<Arm, First>;
  std::array<double, static_cast<std::size_t>(Layout::kParameters)> x{};
  const auto links = reduced_links(Arm::Description::kModel);
  [&]<int... R>(std::integer_sequence<int, R...>) {
    (
        [&] {
          std::size_t column = static_cast<std::size_t>(Layout::inertial(R));
          for (std::size_t e = 0; e < 10; ++e) {
            if (structural::kReducedPattern<typename Arm::Description, First + R>[e]) {
              x[column++] = links[First + R][e];
            }
          }
        }(),
        ...);
  }
  (std::make_integer_sequence<int, Layout::kRows>{});
  return x;
}

template <typename Description, int First>
void expect_rows_give_the_torque() {
  using Arm = StaticArm<double, Description>;
  using Layout = TerminalLayout<Arm, First>;
  constexpr int kN = Arm::kNumJoints;
  const DynamicArm<double, kN> dynamic(Description::kModel);
  const ReducedParameters<double, Description> parameters{reduced_links(Description::kModel)};
  const auto x = layout_parameters<Arm, First>();
  Random random(31 + First);
  for (int n = 0; n < 50; ++n) {
    const auto q = test::random_vector<kN>(random, 3), qd = test::random_vector<kN>(random, 3),
               a = test::random_vector<kN>(random, 5), b = test::random_vector<kN>(random, 5);
    std::array<TerminalRows<double, Layout>, 2> own{}, shared{}, from_joints{};
    terminal_rows<Arm, First, 2>(terminal_trigonometry<Arm, First>(q), q, qd, {a, b}, 0.0, own);
    terminal_rows<Arm, First, 2>(terminal_trigonometry<Arm, First>(joint_trigonometry<Arm>(q)), q, qd,
                                 AccelerationPair<typename Arm::Vector>{a, b}, 0.0, from_joints);
    typename Arm::Vector tau;
    inverse_dynamics_with_rows<Arm, First>(parameters, joint_trigonometry<Arm>(q), q, qd, b, a, 0.0, tau,
                                           shared);
    const auto expected_a = inverse_dynamics(dynamic, q, qd, a),
               expected_b = inverse_dynamics(dynamic, q, qd, b);
    EXPECT_LT((tau - expected_b).norm(), 1e-12 * expected_b.norm());
    for (std::size_t c = 0; c < 2; ++c) {
      const auto& expected = c == 0 ? expected_a : expected_b;
      for (int r = 0; r < Layout::kRows; ++r) {
        const auto& row = own[c][static_cast<std::size_t>(r)];
        double torque = 0;
        for (std::size_t p = 0; p < row.size(); ++p) {
          torque += row[p] * x[p];
          EXPECT_NEAR(row[p], shared[c][static_cast<std::size_t>(r)][p], 1e-11)
              << "row " << r << " column " << p;
          EXPECT_NEAR(row[p], from_joints[c][static_cast<std::size_t>(r)][p], 1e-11)
              << "row " << r << " column " << p;
        }
        EXPECT_NEAR(torque, expected[First + r], 1e-12 * expected.norm())
            << "k " << First + 1 << " row " << r;
      }
    }
  }
}

TEST(TerminalRows, TimesReducedParametersEqualTheTorquesForEveryK) {
  expect_rows_give_the_torque<model::KawasakiArm, 0>();
  expect_rows_give_the_torque<model::KawasakiArm, 1>();
  expect_rows_give_the_torque<model::KawasakiArm, 2>();
  expect_rows_give_the_torque<model::KawasakiArm, 3>();
  expect_rows_give_the_torque<model::KawasakiArm, 4>();
  expect_rows_give_the_torque<model::KawasakiArm, 5>();
  expect_rows_give_the_torque<model::Ur5Arm, 4>();
  expect_rows_give_the_torque<model::Ur5Arm, 3>();
}

TEST(TerminalRows, HoldOnAnArmWithoutRightAngles) {
  expect_rows_give_the_torque<SkewArm, 0>();
  expect_rows_give_the_torque<SkewArm, 2>();
  expect_rows_give_the_torque<SkewArm, 4>();
}

template <typename Description, int First>
Eigen::Index rank_of_stacked_rows() {
  using Arm = StaticArm<double, Description>;
  using Layout = TerminalLayout<Arm, First>;
  constexpr int kN = Arm::kNumJoints;
  Random random(41);
  Eigen::MatrixXd stacked(300 * Layout::kRows, Layout::kParameters);
  for (int n = 0; n < 300; ++n) {
    const auto q = test::random_vector<kN>(random, 3), qd = test::random_vector<kN>(random, 3),
               a = test::random_vector<kN>(random, 5);
    std::array<TerminalRows<double, Layout>, 1> rows{};
    terminal_rows<Arm, First, 1>(terminal_trigonometry<Arm, First>(q), q, qd, {a}, 0.0, rows);
    for (int r = 0; r < Layout::kRows; ++r) {
      for (int p = 0; p < Layout::kParameters; ++p) {
        stacked(n * Layout::kRows + r, p) = rows[0][static_cast<std::size_t>(r)][static_cast<std::size_t>(p)];
      }
    }
  }
  return Layout::kParameters - static_cast<int>(complement_of(triangle_of(stacked).transpose(), 1e-10).cols());
}

TEST(TerminalRows, EveryParameterOfTheLayoutIsIdentifiable) {
  // core/estimate/README.md, section 7: 9 (n − k + 1) for k ≥ 2, 48 for k = 1 on six joints.
  EXPECT_EQ((rank_of_stacked_rows<model::KawasakiArm, 5>()), 9);
  EXPECT_EQ((rank_of_stacked_rows<model::KawasakiArm, 4>()), 18);
  EXPECT_EQ((rank_of_stacked_rows<model::KawasakiArm, 3>()), 27);
  EXPECT_EQ((rank_of_stacked_rows<model::KawasakiArm, 2>()), 36);
  EXPECT_EQ((rank_of_stacked_rows<model::KawasakiArm, 1>()), 45);
  EXPECT_EQ((rank_of_stacked_rows<model::KawasakiArm, 0>()), 48);
  EXPECT_EQ((rank_of_stacked_rows<model::Ur5Arm, 4>()), 18);
  using Arm = StaticArm<double, model::KawasakiArm>;
  static_assert(TerminalLayout<Arm, 4>::kParameters == 18);
  static_assert(TerminalLayout<Arm, 0>::kParameters == 48);
}

}  // namespace
}  // namespace heft
