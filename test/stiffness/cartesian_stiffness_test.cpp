// Compliance and stiffness of the tool: closed forms of the planar arm, exact statics, sag taken back.
#include "heft/stiffness/cartesian_stiffness.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/LU>

#include "heft/host/error.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "stiffness/planar_arm.hpp"

namespace heft::stiffness {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

model::Robot ur5() { return urdf::load_urdf(HEFT_URDF_DIR "/ur5.urdf"); }

const VectorXd kUr5Stiffness = (VectorXd(6) << 2.1e4, 1.8e4, 1.6e4, 5.2e3, 4.1e3, 3.3e3).finished();

VectorXd random_vector(Eigen::Index n, double size, std::mt19937_64& random) {
  std::uniform_real_distribution<double> uniform(-size, size);
  return VectorXd::NullaryExpr(n, [&] { return uniform(random); });
}

TEST(CartesianStiffness, ComplianceOfThePlanarArmIsTheClosedForm) {
  std::mt19937_64 random(71);
  std::uniform_real_distribution<double> size(0.2, 1.2), log_k(3.0, 5.0);
  for (int i = 0; i < 100; ++i) {
    const double l1 = size(random), l2 = size(random);
    const double k1 = std::pow(10.0, log_k(random)), k2 = std::pow(10.0, log_k(random));
    const VectorXd q = random_vector(2, 3.0, random);
    const model::Kinematics kinematics(planar_arm({l1, l2}));
    const CartesianStiffness found = cartesian_stiffness(kinematics, q, vector({k1, k2}));
    const double s1 = std::sin(q[0]), c1 = std::cos(q[0]), s12 = std::sin(q[0] + q[1]),
                 c12 = std::cos(q[0] + q[1]);
    // Equation (71).
    const double x = l1 * s1 + l2 * s12, y = l1 * c1 + l2 * c12;
    Eigen::Matrix2d C;
    C << x * x / k1 + l2 * l2 * s12 * s12 / k2, -x * y / k1 - l2 * l2 * c12 * s12 / k2,
        -x * y / k1 - l2 * l2 * c12 * s12 / k2, y * y / k1 + l2 * l2 * c12 * c12 / k2;
    const Eigen::Matrix2d block = found.compliance.topLeftCorner<2, 2>();
    ASSERT_LE((block - C).cwiseAbs().maxCoeff(), 1e-12 * C.cwiseAbs().maxCoeff());
    // Equations (77) to (81).
    const Eigen::Matrix2d C2 = C * C;
    const double a1 = C2(0, 0), a2 = C2(1, 1), a3 = C2(0, 1);
    const double root = std::sqrt((a1 - a2) * (a1 - a2) + 4.0 * a3 * a3);
    const double largest = 0.5 * (a1 + a2 + root);
    // The smaller one without cancellation: product of the two is det C².
    const double least = C2.determinant() / largest;
    const PrincipalDeflections principal = principal_deflections(block);
    ASSERT_NEAR(principal.magnitudes[0], std::sqrt(largest), 1e-12 * std::sqrt(largest));
    ASSERT_NEAR(principal.magnitudes[1], std::sqrt(least), 1e-12 * std::sqrt(largest));
    // First eigenvector of C²: (a3, λ - a1) or (λ - a2, a3), whichever is longer.
    Eigen::Vector2d e1(a3, largest - a1);
    if (a1 > a2) e1 = {largest - a2, a3};
    e1.normalize();
    ASSERT_NEAR(std::abs(e1.dot(principal.forces.col(0))), 1.0, 1e-12);
    ASSERT_NEAR(e1.dot(principal.forces.col(1)), 0.0, 1e-12);
    // In principal axes the compliance is diagonal.
    const Eigen::Matrix2d E = principal.forces;
    const Eigen::Matrix2d diagonal = E.transpose() * block * E;
    ASSERT_NEAR(diagonal(0, 1), 0.0, 1e-12 * principal.magnitudes[0]);
    ASSERT_NEAR(diagonal(0, 0), principal.magnitudes[0], 1e-12 * principal.magnitudes[0]);
    ASSERT_NEAR(diagonal(1, 1), principal.magnitudes[1], 1e-12 * principal.magnitudes[0]);
    // The force pushes where the tool goes: directions agree for a symmetric compliance.
    ASSERT_NEAR(principal.forces.col(0).dot(principal.directions.col(0)), 1.0, 1e-12);
  }
}

TEST(CartesianStiffness, NoUnitForceDeflectsMoreThanTheExtremes) {
  std::mt19937_64 random(72);
  const model::Kinematics kinematics(ur5());
  const Eigen::Matrix3d C = cartesian_stiffness(kinematics, random_vector(6, 2.0, random), kUr5Stiffness)
                                .compliance.topLeftCorner<3, 3>();
  const PrincipalDeflections principal = principal_deflections(C);
  double most = 0.0, least = 1.0;
  for (int i = 0; i < 2000; ++i) {
    const double deflection = (C * random_vector(3, 1.0, random).normalized()).norm();
    most = std::max(most, deflection);
    least = std::min(least, deflection);
  }
  EXPECT_LE(most, principal.magnitudes[0] * (1.0 + 1e-12));
  EXPECT_GE(least, principal.magnitudes[2] * (1.0 - 1e-12));
  EXPECT_GT(most, 0.99 * principal.magnitudes[0]);
}

TEST(CartesianStiffness, PrincipalForcesBringPrincipalDeflectionsOfAnyCompliance) {
  std::mt19937_64 random(76);
  for (int i = 0; i < 50; ++i) {
    const MatrixXd C = random_vector(9, 1.0, random).reshaped(3, 3);  // not symmetric, as under a load
    const PrincipalDeflections principal = principal_deflections(C);
    for (int k = 0; k < 3; ++k) {
      ASSERT_LE((C * principal.forces.col(k) - principal.magnitudes[k] * principal.directions.col(k)).norm(),
                1e-14);
      ASSERT_GT(principal.forces.col(k).maxCoeff(), -principal.forces.col(k).minCoeff());
    }
    ASSERT_LE((principal.forces.transpose() * principal.forces - MatrixXd::Identity(3, 3)).norm(), 1e-14);
  }
}

TEST(CartesianStiffness, OutlineIsTheShadowOfTheEllipsoid) {
  std::mt19937_64 random(73);
  const model::Kinematics kinematics(ur5());
  const Eigen::Matrix3d C = cartesian_stiffness(kinematics, random_vector(6, 2.0, random), kUr5Stiffness)
                                .compliance.topLeftCorner<3, 3>();
  Eigen::Matrix<double, 3, 2> plane;
  plane << 1, 0, 0, 0, 0, 1;  // seen along y
  const MatrixXd outline = ellipsoid_outline(C, plane, 361);
  ASSERT_EQ(outline.rows(), 361);
  EXPECT_EQ(outline.row(0), outline.row(360));
  // The ellipsoid's reach along a direction u is |Cᵀ P u|: the outline touches it and goes no further.
  for (int k = 0; k < 12; ++k) {
    const Eigen::Vector2d u(std::cos(0.5 * k), std::sin(0.5 * k));
    const double reach = (C.transpose() * plane * u).norm();
    EXPECT_NEAR((outline * u).maxCoeff(), reach, 1e-4 * reach);
    EXPECT_LE((outline * u).maxCoeff(), reach * (1.0 + 1e-12));
  }
}

TEST(CartesianStiffness, InverseOfTheComplianceWithAndWithoutLoad) {
  std::mt19937_64 random(74);
  const model::Kinematics kinematics(ur5());
  const VectorXd q = vector({0.3, -1.2, 1.4, -0.7, 1.1, 0.2});
  const Vector6d wrench = vector({20, -30, -40, 2, 1, -3});
  for (const bool loaded : {false, true}) {
    const CartesianStiffness found = loaded ? cartesian_stiffness(kinematics, q, kUr5Stiffness, wrench)
                                            : cartesian_stiffness(kinematics, q, kUr5Stiffness);
    ASSERT_TRUE(found.has_stiffness) << found.note;
    EXPECT_TRUE(found.stable);
    EXPECT_THAT(found.note, testing::IsEmpty());
    EXPECT_LE((found.compliance * found.stiffness - Matrix6d::Identity()).cwiseAbs().maxCoeff(), 1e-9);
  }
}

TEST(CartesianStiffness, UnderLoadIsTheSlopeOfTheExactDeflection) {
  const model::Kinematics kinematics(ur5());
  // Soft joints, so that K_C counts.
  const VectorXd stiffness = 0.02 * kUr5Stiffness;
  const VectorXd motors = vector({0.3, -1.2, 1.4, -0.7, 1.1, 0.2});
  const Vector6d wrench = vector({10, -15, -20, 1, 0.5, -1.5});
  const VectorXd links = motors + exact_deflection(kinematics, motors, stiffness, wrench).joint;
  const CartesianStiffness around = cartesian_stiffness(kinematics, links, stiffness, wrench);
  const CartesianStiffness without = cartesian_stiffness(kinematics, links, stiffness);
  Matrix6d slope;
  for (int k = 0; k < 6; ++k) {
    Vector6d more = wrench, less = wrench;
    more[k] += 1e-3;
    less[k] -= 1e-3;
    // Joint deflections differ by little, so that the tool's motion is J times it.
    slope.col(k) = kinematics.jacobian(links) *
                   (exact_deflection(kinematics, motors, stiffness, more).joint -
                    exact_deflection(kinematics, motors, stiffness, less).joint) /
                   2e-3;
  }
  const double scale = slope.cwiseAbs().maxCoeff();
  EXPECT_LE((around.compliance - slope).cwiseAbs().maxCoeff(), 1e-7 * scale);
  EXPECT_GT((without.compliance - slope).cwiseAbs().maxCoeff(), 1e-2 * scale);
}

TEST(CartesianStiffness, SaysWhyThereIsNone) {
  const model::Kinematics kinematics(ur5());
  VectorXd q = vector({0.3, -1.2, 1.4, -0.7, 0.0, 0.2});  // wrist straight
  CartesianStiffness found = cartesian_stiffness(kinematics, q, kUr5Stiffness);
  EXPECT_FALSE(found.has_stiffness);
  EXPECT_THAT(found.note, testing::HasSubstr("singular"));
  EXPECT_TRUE(std::isnan(found.stiffness(0, 0)));
  EXPECT_TRUE(found.compliance.allFinite());
  q[4] = 1e-4;  // near, but not there
  EXPECT_TRUE(cartesian_stiffness(kinematics, q, kUr5Stiffness).has_stiffness);
  VectorXd rigid = kUr5Stiffness;
  rigid[2] = std::numeric_limits<double>::infinity();
  q[4] = 1.0;
  found = cartesian_stiffness(kinematics, q, rigid);
  EXPECT_FALSE(found.has_stiffness);
  EXPECT_THAT(found.note, testing::HasSubstr("5 of 6"));
}

TEST(CartesianStiffness, LoadThatOvercomesTheSpringsIsNotStable) {
  // A weight on top of an upright pendulum: holds while k > F l.
  const model::Kinematics kinematics(planar_arm({0.5}));
  Vector6d push = Vector6d::Zero();
  push[0] = -100.0;  // along the link, towards the joint
  EXPECT_TRUE(cartesian_stiffness(kinematics, vector({0.0}), vector({50.1}), push).stable);
  const CartesianStiffness gone = cartesian_stiffness(kinematics, vector({0.0}), vector({49.9}), push);
  EXPECT_FALSE(gone.stable);
  EXPECT_THAT(gone.note, testing::HasSubstr("give way"));
  EXPECT_THROW(exact_deflection(kinematics, vector({0.0}), vector({49.9}), push), InputError);
  // A load that turns the joint by more than a radian is refused too: no spring is meant for that.
  EXPECT_THROW(exact_deflection(kinematics, vector({0.0}), vector({50.0}), vector({0, 500, 0, 0, 0, 0})),
               InputError);
  // The pull of the same size straightens: compliance l² / (k + F l).
  push[0] = 100.0;
  EXPECT_NEAR(cartesian_stiffness(kinematics, vector({0.0}), vector({50.0}), push).compliance(1, 1),
              0.25 / 100.0, 1e-15);
}

TEST(CartesianStiffness, RefusesWhatIsNoStiffness) {
  const model::Kinematics kinematics(planar_arm({0.5, 0.5}));
  const auto message = [&](const VectorXd& stiffness) -> std::string {
    try {
      cartesian_stiffness(kinematics, vector({0.0, 1.0}), stiffness);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(message(vector({1e4, 0.0})), testing::HasSubstr("stiffness of joint 2 is 0"));
  EXPECT_THAT(message(vector({-1e4, 1e4})), testing::HasSubstr("joint 1"));
  EXPECT_THAT(message(vector({1e4, std::nan("")})), testing::HasSubstr("joint 2"));
  EXPECT_THAT(message(vector({1e4})), testing::HasSubstr("1 stiffnesses"));
}

TEST(Deflection, ExactIsTheEquilibriumAndTendsToTheLinearOne) {
  std::mt19937_64 random(75);
  const model::Kinematics kinematics(ur5());
  for (const WrenchFrame frame : {WrenchFrame::kBase, WrenchFrame::kTool}) {
    for (int i = 0; i < 20; ++i) {
      const VectorXd q = random_vector(6, 3.0, random);
      const Vector6d wrench = random_vector(6, 50.0, random);
      const ToolDeflection exact = exact_deflection(kinematics, q, kUr5Stiffness, wrench, frame);
      const VectorXd links = q + exact.joint;
      const VectorXd residual =
          kUr5Stiffness.cwiseProduct(exact.joint) - kinematics.joint_torque(links, wrench, frame);
      // Rounding of q + δ alone is 1e-16 times a stiffness of 2e4.
      ASSERT_LE(residual.cwiseAbs().maxCoeff(), 1e-10);
      ASSERT_LE((exact.tool.head<3>() - (kinematics.tip(links).position - kinematics.tip(q).position)).norm(),
                1e-15);
      // The difference is of second order in the load.
      const auto gap = [&](double share) {
        return (exact_deflection(kinematics, q, kUr5Stiffness, share * wrench, frame).tool -
                linear_deflection(kinematics, q, kUr5Stiffness, share * wrench, frame).tool)
            .norm();
      };
      ASSERT_LE(gap(1.0), 0.05 * exact.tool.norm());
      ASSERT_NEAR(gap(1e-1) / gap(1.0), 1e-2, 2e-3);
    }
  }
}

TEST(Deflection, WrenchInToolAxesIsTurnedOnce) {
  const model::Kinematics kinematics(ur5());
  const VectorXd q = vector({0.3, -1.2, 1.4, -0.7, 1.1, 0.2});
  const Vector6d wrench = vector({1, 2, 3, 0.1, 0.2, 0.3});
  const Eigen::Matrix3d R = kinematics.tip(q).rotation;
  Vector6d in_base;
  in_base << R * wrench.head<3>(), R * wrench.tail<3>();
  EXPECT_LE((linear_deflection(kinematics, q, kUr5Stiffness, wrench, WrenchFrame::kTool).tool -
             linear_deflection(kinematics, q, kUr5Stiffness, in_base).tool)
                .norm(),
            1e-18);
}

MatrixXd path_of_the_ur5() {
  MatrixXd path(15, 6);
  for (int i = 0; i < 15; ++i) {
    const double s = i / 14.0;
    path.row(i) << 0.4 + s, -1.4 + 0.9 * s, 1.6 - 0.8 * s, -0.5 * s, 1.2 - 0.3 * s, 2.0 * s;
  }
  return path;
}

TEST(Sag, CompensationPutsTheLoadedToolBackOnThePath) {
  const model::Kinematics kinematics(ur5());
  for (const bool own_weight : {false, true}) {
    const SagLoad load{5.0, {0.02, -0.03, 0.12}, own_weight};
    const PathSag sag = sag_along_path(kinematics, path_of_the_ur5(), kUr5Stiffness, load);
    EXPECT_LE(sag.left, 1e-9);
    // It has something to take back, and takes it down.
    EXPECT_GT(sag.tool.leftCols(3).rowwise().norm().maxCoeff(), 5e-4);
    EXPECT_LT(sag.tool.col(2).maxCoeff(), 0.0);
    EXPECT_GT((sag.compensated - path_of_the_ur5()).cwiseAbs().maxCoeff(), 1e-3);
  }
}

// The equilibrium by another way: the least potential energy, found by relaxation with torques of the
// dynamics alone, the payload put into the last link.
TEST(Sag, AgreesWithTheArmThatCarriesThePayloadAsPartOfItsLastLink) {
  const model::Robot robot = ur5();
  const model::Kinematics kinematics(robot);
  const SagLoad load{5.0, {0.02, -0.03, 0.12}, true};
  const MatrixXd path = path_of_the_ur5();
  const PathSag sag = sag_along_path(kinematics, path, kUr5Stiffness, load);
  model::Robot loaded = robot;
  const ToolFrame<double> at_com = model::tool_beyond_tip(robot, load.payload_com);
  InertialParameters<double>& last = loaded.joints.back().link;
  last[kMass] += load.payload_mass;
  last[kMcx] += load.payload_mass * at_com.position[0];
  last[kMcy] += load.payload_mass * at_com.position[1];
  last[kMcz] += load.payload_mass * at_com.position[2];
  const model::Dynamics dynamics(loaded);
  for (Eigen::Index i = 0; i < path.rows(); ++i) {
    const VectorXd q = path.row(i).transpose();
    VectorXd links = q;
    for (int k = 0; k < 60; ++k) links = q - dynamics.gravity_torque(links).cwiseQuotient(kUr5Stiffness);
    ASSERT_LE((links - q - sag.joint.row(i).transpose()).cwiseAbs().maxCoeff(), 1e-13);
    const VectorXd motors = q + dynamics.gravity_torque(q).cwiseQuotient(kUr5Stiffness);
    ASSERT_LE((motors - sag.compensated.row(i).transpose()).cwiseAbs().maxCoeff(), 1e-13);
  }
}

TEST(Sag, RefusesWhatCannotHangThere) {
  const model::Kinematics kinematics(ur5());
  EXPECT_THROW(sag_along_path(kinematics, MatrixXd::Zero(3, 5), kUr5Stiffness, {}), InputError);
  EXPECT_THROW(sag_along_path(kinematics, path_of_the_ur5(), kUr5Stiffness, {-1.0, {0, 0, 0}, false}),
               InputError);
  try {
    // Stiffness per degree taken for stiffness per radian, and less.
    sag_along_path(kinematics, path_of_the_ur5(), 1e-3 * kUr5Stiffness, {5.0, {0, 0, 0.1}, false});
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("too soft"));
  }
}

}  // namespace
}  // namespace heft::stiffness
