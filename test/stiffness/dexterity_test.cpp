// Dexterity, characteristic lengths, reach, maps and the choice of poses: closed forms, arms known to be
// isotropic, and the UR5 of the publication that dexterity.hpp cites.
#include "heft/stiffness/dexterity.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/LU>

#include "heft/host/error.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "stiffness/planar_arm.hpp"
#include "support/ur5_dh_table.hpp"

namespace heft::stiffness {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using test::ur5_of_dh_table;

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kTurn = 2.0 * std::numbers::pi;

TEST(FrobeniusCondition, IsTheDefinitionForSquareWideAndTall) {
  std::mt19937_64 random(81);
  std::normal_distribution<double> normal;
  for (const auto& [rows, cols] : {std::pair{6, 6}, std::pair{6, 7}, std::pair{6, 4}, std::pair{2, 3}}) {
    const MatrixXd M = MatrixXd::NullaryExpr(rows, cols, [&] { return normal(random); });
    const MatrixXd S = rows <= cols ? MatrixXd(M * M.transpose()) : MatrixXd(M.transpose() * M);
    const double expected = std::sqrt(S.trace() * S.inverse().trace()) / static_cast<double>(S.rows());
    EXPECT_NEAR(frobenius_condition(M), expected, 1e-11 * expected) << rows << " × " << cols;
  }
  EXPECT_NEAR(frobenius_condition(3.0 * MatrixXd::Identity(6, 6)), 1.0, 1e-15);
  MatrixXd singular = MatrixXd::Identity(6, 6);
  singular(5, 5) = 0.0;
  EXPECT_EQ(frobenius_condition(singular), std::numeric_limits<double>::infinity());
  EXPECT_EQ(dexterity(singular, 1.0), 0.0);
}

TEST(FrobeniusCondition, TwoLinksAreIsotropicWithLengthsOfRootTwoToOneAt135Degrees) {
  // Salisbury and Craig's finger: l1 = √2 l2.
  const model::Kinematics arm(planar_arm({std::numbers::sqrt2 * 0.3, 0.3}));
  for (const double q1 : {0.0, 1.0}) {
    const MatrixXd J = arm.jacobian(vector({q1, 135.0 * kDegree})).topRows(2);
    EXPECT_NEAR(frobenius_condition(J), 1.0, 1e-14);
  }
  EXPECT_GT(frobenius_condition(arm.jacobian(vector({0.0, 120.0 * kDegree})).topRows(2)), 1.01);
}

TEST(FrobeniusCondition, ThreeJointsAroundTheTipAreIsotropicWithTheRadiusOverRootTwo) {
  // Joints at the corners of an equilateral triangle, tip in its centre at the distance r: rows of velocity
  // have the square 3 r²/2, the row of rotation 3, and all are at right angles: L = r/√2 makes them one.
  const double side = 0.6, r = side / std::numbers::sqrt3;
  const model::Kinematics arm(planar_arm({side, side, r}));
  const VectorXd q = vector({0.4, 120.0 * kDegree, 150.0 * kDegree});
  const MatrixXd J = arm.jacobian(q);
  for (int j = 0; j < 3; ++j) ASSERT_NEAR(J.col(j).head(3).norm(), r, 1e-14);
  const auto planar = [&](double L) {
    const MatrixXd N = normalised_jacobian(J, L);
    return MatrixXd((MatrixXd(3, 3) << N.row(0), N.row(1), N.row(5)).finished());
  };
  EXPECT_NEAR(frobenius_condition(planar(r / std::numbers::sqrt2)), 1.0, 1e-14);
  EXPECT_GT(frobenius_condition(planar(r)), 1.01);
  EXPECT_NEAR(rms_axis_distance(J), r, 1e-14);
  // The search for arms of fewer than six joints finds the same length.
  EXPECT_NEAR(least_condition_length(J), r / std::numbers::sqrt2, 1e-7);
}

TEST(CharacteristicLength, OfTheSixJointArmDesignedToBeIsotropicIsItsLinkLength) {
  // Six equal links, offsets and right-angled twists (the DIESTRO arm, a = d = 50 mm).
  const model::Robot robot = model::make_standard_dh_robot("diestro", {{0.05, 0.05, 1, 0},
                                                                       {0.05, 0.05, -1, 0},
                                                                       {0.05, 0.05, 1, 0},
                                                                       {0.05, 0.05, -1, 0},
                                                                       {0.05, 0.05, 1, 0},
                                                                       {0.05, 0.05, -1, 0}});
  const model::Kinematics arm(robot);
  const CharacteristicLength found = characteristic_length(arm);
  EXPECT_NEAR(found.length, 0.05, 1e-7);
  EXPECT_NEAR(found.condition, 1.0, 1e-9);
  // There J_N J_Nᵀ = σ² E (97), and the rms distance of the axes is the length (101).
  const MatrixXd N = normalised_jacobian(arm.jacobian(found.q), found.length);
  EXPECT_LE((N * N.transpose() - 2.0 * MatrixXd::Identity(6, 6)).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_NEAR(rms_axis_distance(arm.jacobian(found.q)), 0.05, 1e-7);
}

TEST(CharacteristicLength, OfAPoseIsTheLeastOverAllLengths) {
  const model::Kinematics arm(ur5_of_dh_table());
  const MatrixXd J = arm.jacobian(vector({0.0, 2.0, 1.5, 0.8, 0.8, 0.8}));
  const double L = least_condition_length(J);
  const double least = frobenius_condition(normalised_jacobian(J, L));
  for (const double factor : {0.5, 0.99, 1.01, 2.0}) {
    EXPECT_GT(frobenius_condition(normalised_jacobian(J, factor * L)), least * (1.0 + 1e-6));
  }
  EXPECT_TRUE(std::isnan(least_condition_length(arm.jacobian(VectorXd::Zero(6)))));  // singular
}

TEST(Reach, OfThePlanarArmIsTheSumOfItsLinks) {
  EXPECT_NEAR(maximum_reach(model::Kinematics(planar_arm({0.5, 0.4, 0.3}))).value, 1.2, 1e-12);
}

TEST(Reach, KeepsTheJointLimits) {
  model::Robot robot = planar_arm({0.5, 0.4});
  robot.joints[1].lower = 0.5;
  robot.joints[1].upper = 2.5;
  // Law of cosines at the limit nearest to straight.
  EXPECT_NEAR(maximum_reach(model::Kinematics(robot)).value, std::sqrt(0.25 + 0.16 + 0.4 * std::cos(0.5)),
              1e-12);
  PoseSearch anywhere;
  anywhere.keep_limits = false;
  EXPECT_NEAR(maximum_reach(model::Kinematics(robot), anywhere).value, 0.9, 1e-12);
}

TEST(Reach, OfAPrismaticJointEndsAtItsLimitAndNeedsOne) {
  model::Robot robot = planar_arm({0.5, 0.4});
  robot.joints[0].joint.type = JointType::kPrismatic;  // along z
  EXPECT_THROW(maximum_reach(model::Kinematics(robot)), InputError);
  robot.joints[0].lower = -0.7;
  robot.joints[0].upper = 0.3;
  EXPECT_NEAR(maximum_reach(model::Kinematics(robot)).value, std::hypot(0.9, 0.7), 1e-12);
}

TEST(Reach, OfThePublishedUr5IsMoreThanItsPoseGives) {
  const model::Kinematics arm(ur5_of_dh_table());
  // The published pose and its 1019.2 mm: d1 - a2 - a3 + d5 up, d4 + d6 aside.
  const VectorXd pose = kDegree * vector({0, -90, 0, -90, 0, 0});
  const double stated = arm.tip(pose).position.norm();
  EXPECT_NEAR(stated, std::hypot(0.08916 + 0.425 + 0.39225 + 0.09465, 0.10915 + 0.0823), 1e-14);
  EXPECT_NEAR(stated, 1.0192, 5e-5);
  // With the fifth joint turned by s, the fourth keeps d5 and d6 sin s in line: closed form, scanned.
  double most = 0.0;
  for (int k = 0; k <= 180000; ++k) {
    const double s = k * 1e-3 * kDegree;
    most = std::max(most, std::hypot(0.08916 + 0.425 + 0.39225 + std::hypot(0.09465, 0.0823 * std::sin(s)),
                                     0.10915 + 0.0823 * std::cos(s)));
  }
  const PoseValue found = maximum_reach(arm);
  EXPECT_NEAR(found.value, most, 1e-9);
  EXPECT_NEAR(found.value, 1.03839, 5e-6);
  EXPECT_NEAR(arm.tip(found.q).position.norm(), found.value, 1e-12);
  // The pose is stationary all the same: no step of one joint away from it gains anything to first order.
  const VectorXd gradient = arm.jacobian(pose).topRows(3).transpose() * arm.tip(pose).position;
  EXPECT_LE(gradient.cwiseAbs().maxCoeff(), 1e-15);
  // The same arm from its URDF.
  EXPECT_NEAR(maximum_reach(model::Kinematics(urdf::load_urdf(HEFT_URDF_DIR "/ur5.urdf"))).value, most, 1e-3);
}

/// The map of table 4 over joints 2 and 3, a point a degree.
DexterityMap published_map(double length) {
  return dexterity_map(model::Kinematics(ur5_of_dh_table()), kDegree * vector({0, 0, 0, 45, 45, 45}),
                       {1, 0.0, kTurn, 180}, {2, 0.0, kTurn, 180}, length);
}

TEST(DexterityMap, AsPublishedComesOutWithLengthsInMillimetresOverAFewTenthsOfThem) {
  // J in mm over L = 0.8488 "metre", taken as a number: as J in metres over 0.8488 mm.
  const DexterityMap map = published_map(0.8488e-3);
  // High values of 0.0035 to 0.005 in the publication.
  EXPECT_GT(map.dexterity.maxCoeff(), 0.005);
  EXPECT_LT(map.dexterity.maxCoeff(), 0.006);
  const std::vector<DexterityZone> found = zones(map, 0.0035);
  ASSERT_EQ(found.size(), 2U);
  // Its zones -237°..-152° (123°..208°) and -89°..23° (271°..383°) by 100°..172° lie in these.
  for (const double middle : {0.5 * (123.0 + 208.0), 0.5 * (271.0 + 383.0)}) {
    bool inside = false;
    for (const DexterityZone& zone : found) {
      inside = inside || (zone.first_low < middle * kDegree && middle * kDegree < zone.first_high &&
                          zone.second_low < 136.0 * kDegree && 136.0 * kDegree < zone.second_high);
    }
    EXPECT_TRUE(inside) << middle;
  }
  EXPECT_NEAR(found[0].second_low / kDegree, 86.0, 4.0);
  EXPECT_NEAR(found[0].second_high / kDegree, 168.0, 4.0);
  const MatrixXd J = model::Kinematics(ur5_of_dh_table()).jacobian(found[0].q);
  EXPECT_NEAR(dexterity(J, 0.8488e-3), found[0].best, 1e-12);
  // "Four areas": a lower threshold shows the other two.
  EXPECT_EQ(zones(map, 0.0025).size(), 4U);
  // In consistent units the values are a hundred times larger and the best zones elsewhere.
  const DexterityMap metres = published_map(0.8488);
  EXPECT_NEAR(metres.dexterity.maxCoeff(), 0.426, 0.001);
  EXPECT_GT(zones(metres, 0.3)[0].second_low, 180.0 * kDegree);
}

TEST(DexterityMap, RepeatsAfterHalfATurnOfTheSecondJointAndIsSingularWithTheElbowStraight) {
  // Axes 1 and 2 meet: half a turn about axis 2 maps axis 1 onto itself.
  const DexterityMap map = published_map(0.2);
  EXPECT_TRUE(map.first_wraps && map.second_wraps);
  EXPECT_LE((map.dexterity.topRows(90) - map.dexterity.bottomRows(90)).cwiseAbs().maxCoeff(), 1e-10);
  EXPECT_LE(map.dexterity.col(0).maxCoeff(), 1e-10);
  EXPECT_LE(map.dexterity.col(90).maxCoeff(), 1e-10);
}

DexterityMap drawn_map(const std::vector<std::string>& picture, bool wraps) {
  DexterityMap map;
  const auto rows = static_cast<Eigen::Index>(picture.size()),
             cols = static_cast<Eigen::Index>(picture[0].size());
  map.q = VectorXd::Zero(3);
  map.first = {0, 0.0, kTurn, static_cast<int>(rows)};
  map.second = {2, 0.0, kTurn, static_cast<int>(cols)};
  map.first_wraps = map.second_wraps = wraps;
  map.first_values = VectorXd::NullaryExpr(rows, [&](Eigen::Index i) { return kTurn * i / rows; });
  map.second_values = VectorXd::NullaryExpr(cols, [&](Eigen::Index i) { return kTurn * i / cols; });
  map.dexterity = MatrixXd::NullaryExpr(rows, cols, [&](Eigen::Index i, Eigen::Index k) {
    return 0.1 * (picture[static_cast<std::size_t>(i)][static_cast<std::size_t>(k)] - '0');
  });
  return map;
}

TEST(Zones, AreFoundAndJoinedAcrossAWholeTurn) {
  const std::vector<std::string> picture = {"5000000006",  //
                                            "0000000005",  //
                                            "0008000000",  //
                                            "0000000000",  //
                                            "5000000005"};
  const double row = kTurn / 5.0, col = kTurn / 10.0;
  const std::vector<DexterityZone> round = zones(drawn_map(picture, true), 0.45);
  ASSERT_EQ(round.size(), 2U);
  EXPECT_DOUBLE_EQ(round[0].best, 0.8);
  EXPECT_EQ(round[0].points, 1);
  EXPECT_DOUBLE_EQ(round[0].first_low, 2 * row);
  EXPECT_DOUBLE_EQ(round[0].first_high, 2 * row);
  EXPECT_DOUBLE_EQ(round[0].q[2], 3 * col);
  EXPECT_EQ(round[1].points, 5);
  EXPECT_DOUBLE_EQ(round[1].share, 0.1);
  EXPECT_DOUBLE_EQ(round[1].first_low, 4 * row);
  EXPECT_DOUBLE_EQ(round[1].first_high, kTurn + row);
  EXPECT_DOUBLE_EQ(round[1].second_low, 9 * col);
  EXPECT_DOUBLE_EQ(round[1].second_high, kTurn);
  EXPECT_DOUBLE_EQ(round[1].q[0], 0.0);
  EXPECT_DOUBLE_EQ(round[1].q[2], 9 * col);
  // Without the turn the corners are four, and one of them has two points.
  EXPECT_EQ(zones(drawn_map(picture, false), 0.45).size(), 5U);
  EXPECT_TRUE(zones(drawn_map(picture, true), 0.9).empty());
}

TEST(DexterityMap, RefusesWhatIsNoMap) {
  const model::Kinematics arm(ur5_of_dh_table());
  const VectorXd q = VectorXd::Zero(6);
  EXPECT_THROW(dexterity_map(arm, q, {6, 0, 1, 5}, {2, 0, 1, 5}, 0.2), InputError);
  EXPECT_THROW(dexterity_map(arm, q, {2, 0, 1, 5}, {2, 0, 1, 5}, 0.2), InputError);
  EXPECT_THROW(dexterity_map(arm, q, {1, 1, 1, 5}, {2, 0, 1, 5}, 0.2), InputError);
  EXPECT_THROW(dexterity_map(arm, q, {1, 0, 1, 1}, {2, 0, 1, 5}, 0.2), InputError);
  EXPECT_THROW(dexterity_map(arm, q, {1, 0, 1, 5}, {2, 0, 1, 5}, 0.0), InputError);
  EXPECT_THROW(dexterity_map(arm, VectorXd::Zero(5), {1, 0, 1, 5}, {2, 0, 1, 5}, 0.2), InputError);
}

TEST(ComplianceRows, TimesCompliancesAreTheDisplacement) {
  const model::Kinematics arm(ur5_of_dh_table());
  const MatrixXd J = arm.jacobian(vector({0.3, -1.2, 1.4, -0.7, 1.1, 0.2}));
  const Eigen::Matrix<double, 6, 1> wrench = vector({10, -20, -30, 1, 2, -3});
  const VectorXd x = vector({5e-5, 6e-5, 7e-5, 2e-4, 2.5e-4, 3e-4});
  const VectorXd displacement = J * x.asDiagonal() * J.transpose() * wrench;
  const MatrixXd all = compliance_rows(J, wrench, MatrixXd::Identity(6, 6));
  EXPECT_LE((all * x - displacement).cwiseAbs().maxCoeff(), 1e-16);
  // Element of (110).
  EXPECT_DOUBLE_EQ(all(2, 4), J(2, 4) * J.col(4).dot(wrench));
  MatrixXd wire = MatrixXd::Zero(1, 6);
  wire.leftCols(3) << 0.6, 0.0, 0.8;
  EXPECT_NEAR((compliance_rows(J, wrench, wire) * x)(0), 0.6 * displacement[0] + 0.8 * displacement[2],
              1e-16);
}

std::vector<PoseCandidate> tracker_candidates(int count, std::uint32_t seed,
                                              const Eigen::Vector3d& hook = {0.15, 0.1, 0.1}) {
  const model::Kinematics arm(ur5_of_dh_table(), model::tool_beyond_tip(ur5_of_dh_table(), hook));
  const Eigen::Matrix<double, 6, 1> weight = vector({0, 0, -50, 0, 0, 0});
  MatrixXd position = MatrixXd::Identity(3, 6) / 2e-5;
  return pose_candidates(
      arm, 0.2, count, [&](const VectorXd& q) { return compliance_rows(arm.jacobian(q), weight, position); },
      seed);
}

/// Of the information of some candidates.
template <typename Chosen>
double determinant(const std::vector<PoseCandidate>& candidates, const Chosen& chosen) {
  MatrixXd M = MatrixXd::Zero(candidates[0].rows.cols(), candidates[0].rows.cols());
  for (const auto k : chosen) {
    const MatrixXd& rows = candidates[static_cast<std::size_t>(k)].rows;
    M += rows.transpose() * rows;
  }
  return M.determinant();
}

// The vertical load leaves the first joint's torque at zero: five compliances are left to know.
std::vector<PoseCandidate> without_first_joint(std::vector<PoseCandidate> candidates) {
  for (PoseCandidate& candidate : candidates) candidate.rows = candidate.rows.rightCols(5).eval();
  return candidates;
}

TEST(ChoosePoses, FindsTheBestOfAllChoicesOfAFew) {
  const auto candidates = without_first_joint(tracker_candidates(14, 3));
  const PoseChoice choice = choose_poses(candidates, 3);
  ASSERT_EQ(choice.chosen.size(), 3U);
  double best = 0.0;
  for (int a = 0; a < 14; ++a) {
    for (int b = a + 1; b < 14; ++b) {
      for (int c = b + 1; c < 14; ++c) best = std::max(best, determinant(candidates, std::array{a, b, c}));
    }
  }
  EXPECT_NEAR(determinant(candidates, choice.chosen), best, 1e-9 * best);
  EXPECT_NEAR(choice.log_determinant, std::log(best), 1e-8);
}

TEST(ChoosePoses, AreFarBetterThanPosesTakenAtRandomAndKeepTheThreshold) {
  const auto candidates = without_first_joint(tracker_candidates(400, 4));
  const PoseChoice choice = choose_poses(candidates, 6, 0.2);
  for (const int k : choice.chosen) EXPECT_GE(candidates[static_cast<std::size_t>(k)].dexterity, 0.2);
  std::vector<int> sorted = choice.chosen;
  std::sort(sorted.begin(), sorted.end());
  EXPECT_EQ(std::unique(sorted.begin(), sorted.end()), sorted.end());  // no pose twice
  std::mt19937_64 random(5);
  std::vector<double> random_choices;
  for (int i = 0; i < 201; ++i) {
    std::array<std::size_t, 6> taken;
    for (std::size_t& k : taken) {
      do k = random() % candidates.size();
      while (candidates[k].dexterity < 0.2);
    }
    random_choices.push_back(determinant(candidates, taken));
    EXPECT_LT(random_choices.back(), std::exp(choice.log_determinant));
  }
  // A hundred times the determinant of a usual choice: each of five variances 2.5 times smaller.
  std::sort(random_choices.begin(), random_choices.end());
  EXPECT_LT(random_choices[100], 1e-2 * std::exp(choice.log_determinant));
}

TEST(ChoosePoses, TakeNoPoseTwice) {
  std::vector<PoseCandidate> candidates(3);
  candidates[0].rows = 100.0 * MatrixXd::Identity(2, 2);  // twice this would be best
  candidates[1].rows = vector({1.0, 0.0}).transpose();
  candidates[2].rows = vector({0.0, 2.0}).transpose();
  EXPECT_THAT(choose_poses(candidates, 2).chosen, testing::UnorderedElementsAre(0, 2));
}

TEST(ChoosePoses, DoNotDependOnTheUnitsOfTheCompliances) {
  auto candidates = without_first_joint(tracker_candidates(60, 6));
  const std::vector<int> before = choose_poses(candidates, 4).chosen;
  for (PoseCandidate& candidate : candidates) {
    candidate.rows = candidate.rows * vector({1e-3, 1e3, 1.0, 57.3, 1e-6}).asDiagonal();
  }
  EXPECT_EQ(choose_poses(candidates, 4).chosen, before);
}

TEST(ChoosePoses, SaysWhatStaysOpen) {
  const auto message = [](const std::vector<PoseCandidate>& candidates, int count,
                          double least) -> std::string {
    try {
      choose_poses(candidates, count, least);
    } catch (const NotIdentifiableError& error) {
      return std::string("open: ") + error.what();
    } catch (const InputError& error) {
      return std::string("input: ") + error.what();
    }
    return "";
  };
  // A vertical load and an upright first axis: joint 1 never has torque.
  EXPECT_THAT(message(tracker_candidates(30, 7), 6, 0.0),
              testing::AllOf(testing::StartsWith("open: "), testing::HasSubstr("loads joint 1 ")));
  // Hung on the last axis the weight has no torque about it either.
  EXPECT_THAT(message(tracker_candidates(30, 7, {0, 0, 0.1}), 6, 0.0),
              testing::HasSubstr("loads joint 1, 6 "));
  const auto candidates = without_first_joint(tracker_candidates(30, 7));
  EXPECT_THAT(message(candidates, 31, 0.0), testing::StartsWith("input: 31 poses"));
  EXPECT_THAT(message(candidates, 2, 0.99), testing::HasSubstr("lower the threshold"));
  // Three measurements for five compliances.
  EXPECT_THAT(message(candidates, 1, 0.0),
              testing::AllOf(testing::StartsWith("open: "), testing::HasSubstr("5 compliances")));
}

}  // namespace
}  // namespace heft::stiffness
