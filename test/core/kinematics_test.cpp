// Kinematics and statics of core against finite differences and the spring's own definition.
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "heft/core/kinematics/geometric_jacobian.hpp"
#include "heft/core/kinematics/joint_deflection.hpp"
#include "support/random_arm.hpp"

namespace heft {
namespace {

using test::Random;
using test::uniform;

constexpr int kN = 6;
using Arm = ArmModel<double, kN>;
using Vector = Eigen::Matrix<double, kN, 1>;
using Square = Eigen::Matrix<double, kN, kN>;
using Wrench = ToolWrench<double>;

ToolFrame<double> random_tool(Random& random) {
  const Eigen::Matrix3d R =
      Eigen::AngleAxisd(uniform(random, -3, 3), test::random_direction(random)).toRotationMatrix();
  ToolFrame<double> tool;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) tool.rotation[static_cast<std::size_t>(3 * r + c)] = R(r, c);
    tool.position[static_cast<std::size_t>(r)] = uniform(random, -0.3, 0.3);
  }
  return tool;
}

// Central difference of a function of the pose along joint j, with Richardson's step: error of order h⁴.
template <typename Function>
auto derivative(const Function& f, const Vector& q, int j) {
  constexpr double kStep = 1e-3;
  const auto central = [&](double h) {
    Vector ahead = q, behind = q;
    ahead[j] += h;
    behind[j] -= h;
    return ((f(ahead) - f(behind)) / (2.0 * h)).eval();
  };
  return ((4.0 * central(0.5 * kStep) - central(kStep)) / 3.0).eval();
}

/// Error of the differences above at arms of a few metres: h⁴ terms 1e-12, cancellation 1e-12.
constexpr double kDifference = 2e-10;
/// Some hundred operations one after the other in double precision, on numbers up to 6.
constexpr double kRounding = 5e-14;

TEST(ChainKinematics, JacobianIsTheDerivativeOfThePlacement) {
  Random random(31);
  for (int k = 0; k < 200; ++k) {
    const Arm arm = test::random_arm<kN>(random, k < 60 ? 0.0 : 0.4);
    const ToolFrame<double> tool = random_tool(random);
    const Vector q = test::random_vector<kN>(random, 3.0);
    const auto chain = chain_kinematics(arm, tool, q);
    const GeometricJacobian<double, kN> J = geometric_jacobian(chain);
    for (int j = 0; j < kN; ++j) {
      const Eigen::Vector3d velocity =
          derivative([&](const Vector& at) { return chain_kinematics(arm, tool, at).position; }, q, j);
      const Eigen::Matrix3d turn =
          derivative([&](const Vector& at) { return chain_kinematics(arm, tool, at).rotation; }, q, j);
      // Ṙ Rᵀ = [ω]×.
      const Eigen::Matrix3d S = turn * chain.rotation.transpose();
      const Eigen::Vector3d omega(S(2, 1), S(0, 2), S(1, 0));
      ASSERT_LE((J.block<3, 1>(0, j) - velocity).cwiseAbs().maxCoeff(), kDifference)
          << "arm " << k << " joint " << j;
      ASSERT_LE((J.block<3, 1>(3, j) - omega).cwiseAbs().maxCoeff(), kDifference)
          << "arm " << k << " joint " << j;
    }
    ASSERT_LE(
        (chain.rotation.transpose() * chain.rotation - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff(),
        1e-14);
  }
}

TEST(ChainKinematics, OriginsLieOnTheAxesThatTurnTheTip) {
  Random random(32);
  const Arm arm = test::random_arm<kN>(random, 0.0);
  const ToolFrame<double> tool = random_tool(random);
  const Vector q = test::random_vector<kN>(random, 3.0);
  const auto chain = chain_kinematics(arm, tool, q);
  for (int j = 0; j < kN; ++j) {
    // Turned by 0.7 about axis j through its origin the tip must arrive where the chain says.
    Vector turned = q;
    turned[j] += 0.7;
    const Eigen::Vector3d axis = chain.axes.col(j), origin = chain.origins.col(j);
    const Eigen::Vector3d expected = origin + Eigen::AngleAxisd(0.7, axis) * (chain.position - origin);
    EXPECT_LE((chain_kinematics(arm, tool, turned).position - expected).norm(), kRounding);
  }
}

TEST(ChainKinematics, JacobianInToolAxesIsTheSameMotionSeenFromTheTool) {
  Random random(33);
  for (int k = 0; k < 50; ++k) {
    const Arm arm = test::random_arm<kN>(random, 0.3);
    const auto chain = chain_kinematics(arm, random_tool(random), test::random_vector<kN>(random, 3.0));
    const auto J = geometric_jacobian(chain);
    const auto J_tool = in_frame(chain.rotation, J);
    const Vector qd = test::random_vector<kN>(random, 1.0);
    const Wrench in_base = J * qd, in_tool = J_tool * qd;
    ASSERT_LE((chain.rotation * in_tool.head<3>() - in_base.head<3>()).norm(), kRounding);
    ASSERT_LE((chain.rotation * in_tool.tail<3>() - in_base.tail<3>()).norm(), kRounding);
  }
}

TEST(ChainKinematics, LastFrameOfADenavitHartenbergTableIsTheTool) {
  // Product of Rz(q) Tz(d) Tx(a) Rx(α), the definition of the table.
  Random random(34);
  std::array<DenavitHartenberg<double>, kN> table;
  for (auto& row : table) {
    const double alpha = uniform(random, -3, 3);
    row = {uniform(random, -0.5, 0.5), uniform(random, -0.5, 0.5), std::sin(alpha), std::cos(alpha)};
  }
  const Arm arm = make_standard_dh_arm<double, kN>(table, {});
  const Vector q = test::random_vector<kN>(random, 3.0);
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  for (int j = 0; j < kN; ++j) {
    const auto& row = table[static_cast<std::size_t>(j)];
    T = T * Eigen::AngleAxisd(q[j], Eigen::Vector3d::UnitZ()) * Eigen::Translation3d(row.a, 0, row.d) *
        Eigen::AngleAxisd(std::atan2(row.sin_alpha, row.cos_alpha), Eigen::Vector3d::UnitX());
  }
  const auto chain = chain_kinematics(arm, standard_dh_tool(table.back()), q);
  EXPECT_LE((chain.position - T.translation()).norm(), kRounding);
  EXPECT_LE((chain.rotation - T.linear()).norm(), kRounding);
}

TEST(Statics, TorqueTimesMotionIsThePowerOfTheWrench) {
  Random random(35);
  for (int k = 0; k < 50; ++k) {
    const auto chain = chain_kinematics(test::random_arm<kN>(random, 0.3), random_tool(random),
                                        test::random_vector<kN>(random, 3.0));
    const auto J = geometric_jacobian(chain);
    const Vector qd = test::random_vector<kN>(random, 1.0);
    const Wrench wrench = test::random_vector<6>(random, 20.0);
    ASSERT_NEAR(joint_torque(J, wrench).dot(qd), wrench.dot(J * qd), 1e-12);
  }
}

TEST(Statics, ComplementaryStiffnessIsTheDerivativeOfTheTorque) {
  Random random(36);
  for (int k = 0; k < 200; ++k) {
    const Arm arm = test::random_arm<kN>(random, k < 60 ? 0.0 : 0.4);
    const ToolFrame<double> tool = random_tool(random);
    const Vector q = test::random_vector<kN>(random, 3.0);
    const Wrench wrench = test::random_vector<6>(random, 1.0);
    const auto chain = chain_kinematics(arm, tool, q);
    const Square constant = complementary_stiffness(chain, wrench, WrenchFrame::kBase);
    const Square following = complementary_stiffness(chain, wrench, WrenchFrame::kTool);
    for (int j = 0; j < kN; ++j) {
      const Vector of_constant = derivative(
          [&](const Vector& at) {
            return joint_torque(geometric_jacobian(chain_kinematics(arm, tool, at)), wrench);
          },
          q, j);
      const Vector of_following = derivative(
          [&](const Vector& at) {
            const auto there = chain_kinematics(arm, tool, at);
            return joint_torque(in_frame(there.rotation, geometric_jacobian(there)), wrench);
          },
          q, j);
      ASSERT_LE((constant.col(j) - of_constant).cwiseAbs().maxCoeff(), kDifference)
          << "arm " << k << " joint " << j;
      ASSERT_LE((following.col(j) - of_following).cwiseAbs().maxCoeff(), kDifference)
          << "arm " << k << " joint " << j;
    }
  }
}

TEST(Statics, ComplementaryStiffnessOfAWeightIsSymmetric) {
  Random random(37);
  double largest_with_moment = 0.0;
  for (int k = 0; k < 50; ++k) {
    const auto chain = chain_kinematics(test::random_arm<kN>(random, 0.3), random_tool(random),
                                        test::random_vector<kN>(random, 3.0));
    Wrench wrench = test::random_vector<6>(random, 1.0);
    const Square with_moment = complementary_stiffness(chain, wrench);
    largest_with_moment =
        std::max(largest_with_moment, (with_moment - with_moment.transpose()).cwiseAbs().maxCoeff());
    wrench.tail<3>().setZero();
    const Square K = complementary_stiffness(chain, wrench);
    ASSERT_LE((K - K.transpose()).cwiseAbs().maxCoeff(), kRounding);
  }
  EXPECT_GT(largest_with_moment, 0.1);
}

TEST(Statics, ComplianceIsDisplacementByTheJointsSprings) {
  Random random(38);
  for (int k = 0; k < 50; ++k) {
    const auto J = geometric_jacobian(chain_kinematics(test::random_arm<kN>(random, 0.3), random_tool(random),
                                                       test::random_vector<kN>(random, 3.0)));
    Vector compliance;
    for (int j = 0; j < kN; ++j) compliance[j] = uniform(random, 0.0, 1e-3);
    const Wrench wrench = test::random_vector<6>(random, 20.0);
    const auto C = cartesian_compliance(J, compliance);
    const Vector deflection = compliance.cwiseProduct(joint_torque(J, wrench));
    ASSERT_LE((C * wrench - J * deflection).cwiseAbs().maxCoeff(), 1e-15);
    ASSERT_EQ(C, C.transpose());
  }
}

TEST(Statics, FloatAgreesWithDouble) {
  Random random(39);
  for (int k = 0; k < 50; ++k) {
    const Arm arm = test::random_arm<kN>(random, 0.3);
    const ToolFrame<double> tool = random_tool(random);
    const Vector q = test::random_vector<kN>(random, 3.0);
    const Wrench wrench = test::random_vector<6>(random, 1.0);
    ArmModel<float, kN> arm_float;
    ToolFrame<float> tool_float;
    for (std::size_t j = 0; j < kN; ++j) {
      arm_float.joints[j].type = arm.joints[j].type;
      for (std::size_t i = 0; i < 9; ++i)
        arm_float.joints[j].rotation[i] = static_cast<float>(arm.joints[j].rotation[i]);
      for (std::size_t i = 0; i < 3; ++i) {
        arm_float.joints[j].position[i] = static_cast<float>(arm.joints[j].position[i]);
        arm_float.joints[j].axis[i] = static_cast<float>(arm.joints[j].axis[i]);
      }
    }
    for (std::size_t i = 0; i < 9; ++i) tool_float.rotation[i] = static_cast<float>(tool.rotation[i]);
    for (std::size_t i = 0; i < 3; ++i) tool_float.position[i] = static_cast<float>(tool.position[i]);
    const auto chain = chain_kinematics(arm, tool, q);
    const auto chain_float = chain_kinematics<float, kN>(arm_float, tool_float, q.cast<float>());
    // Arms reach some 6 m; a dozen rotations of single precision.
    constexpr double kTolerance = 2e-5;
    const auto J = geometric_jacobian(chain);
    const auto J_float = geometric_jacobian(chain_float);
    ASSERT_LE((J_float.cast<double>() - J).cwiseAbs().maxCoeff(), kTolerance);
    const ToolWrench<float> wrench_float = wrench.cast<float>();
    for (const WrenchFrame frame : {WrenchFrame::kBase, WrenchFrame::kTool}) {
      ASSERT_LE((complementary_stiffness(chain_float, wrench_float, frame).cast<double>() -
                 complementary_stiffness(chain, wrench, frame))
                    .cwiseAbs()
                    .maxCoeff(),
                kTolerance);
    }
  }
}

TEST(ChainKinematics, GarbageAngleMakesThePlacementNan) {
  Random random(40);
  const Arm arm = test::random_arm<kN>(random, 0.0);
  Vector q = Vector::Zero();
  q[2] = 1e9;
  EXPECT_TRUE(std::isnan(chain_kinematics(arm, ToolFrame<double>{}, q).position[0]));
}

TEST(JointDeflection, CommandPutsTheLinkWhereItShouldBe) {
  const Eigen::Vector3d desired(0.3, -1.2, 0.5), torque(12.0, -40.0, 3.0);
  const Eigen::Vector3d stiffness(1.5e4, 8e3, std::numeric_limits<double>::infinity());
  Eigen::Vector3d command, deflection;
  ASSERT_EQ((compensated_command<double, 3>(desired, torque, stiffness, command)), Status::kOk);
  ASSERT_EQ((joint_deflection<double, 3>(torque, stiffness, deflection)), Status::kOk);
  // K (θ - x) = τ at the link position x = q_des.
  for (int j = 0; j < 2; ++j) EXPECT_NEAR(stiffness[j] * (command[j] - desired[j]), torque[j], 1e-9);
  EXPECT_EQ(command[2], desired[2]);
  EXPECT_EQ(deflection[2], 0.0);
}

TEST(JointDeflection, RefusesImpossibleSpringsAndLeavesTheAnswerAlone) {
  const Eigen::Vector2d torque(1.0, 2.0), good(1e3, 1e4);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Eigen::Vector2d answer(7.0, 8.0);
  EXPECT_EQ((joint_deflection<double, 2>(torque, {1e3, 0.0}, answer)), Status::kOutOfRange);
  EXPECT_EQ((joint_deflection<double, 2>(torque, {-1e3, 1e4}, answer)), Status::kOutOfRange);
  EXPECT_EQ((joint_deflection<double, 2>(torque, {1e3, nan}, answer)), Status::kNonFiniteInput);
  EXPECT_EQ((joint_deflection<double, 2>({nan, 1.0}, good, answer)), Status::kNonFiniteInput);
  EXPECT_EQ((compensated_command<double, 2>({0.0, nan}, torque, good, answer)), Status::kNonFiniteInput);
  EXPECT_EQ((compensated_command<double, 2>({0.0, 0.0}, torque, {0.0, 1.0}, answer)), Status::kOutOfRange);
  EXPECT_EQ(answer, Eigen::Vector2d(7.0, 8.0));
}

}  // namespace
}  // namespace heft
