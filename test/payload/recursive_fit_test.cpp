/// A full model from logs by recursive least squares.
#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/error.hpp"
#include "heft/model/dynamics.hpp"
#include "payload/recursive_fit.hpp"
#include "support/arms.hpp"
#include "support/synthetic_log.hpp"
#include "support/temporary_folder.hpp"

namespace heft::payload {
namespace {

using ::testing::HasSubstr;

/// The arm with parameters as a URDF would have them: masses and centres somewhat off, no friction, no
/// rotors.
model::Robot as_in_urdf(model::Robot robot) {
  double factor = 1.3;
  for (auto& joint : robot.joints) {
    for (double& value : joint.link) value *= factor;
    factor = 2.0 - factor;
    joint.actuation = {};
  }
  return robot;
}

/// Largest torque error of a fit on a motion it has not seen, as a share of each joint's largest torque.
double worst_error(const model::Robot& truth, const RecursiveFit& fit, std::uint32_t seed) {
  model::Robot fitted = truth;
  model::apply(fit.model, fitted);
  test::SyntheticSettings settings;
  settings.motion_seed = seed;
  settings.duration = 10;
  const data::Log expected = test::synthetic_log(truth, settings),
                  found = test::synthetic_log(fitted, settings);
  return ((expected.tau - found.tau).cwiseAbs().colwise().maxCoeff().array() /
          expected.tau.cwiseAbs().colwise().maxCoeff().array())
      .maxCoeff();
}

TEST(RecursiveFit, FindsTheTorquesOfAnArmItsUrdfGetsWrong) {
  for (const bool with_velocity : {true, false}) {
    const model::Robot truth = test::six_joint_arm();
    test::SyntheticSettings settings;
    settings.jitter = 0.3;
    settings.with_velocity = with_velocity;
    const data::Log log = test::synthetic_log(truth, settings);
    const RecursiveFit fit = fit_recursively(as_in_urdf(truth), {log});
    EXPECT_TRUE(fit.missing.empty());
    EXPECT_EQ(fit.left_out, 0);
    // Velocities differenced from positions are half a sample late, so the sign of friction is too.
    EXPECT_LT(worst_error(truth, fit, 77), with_velocity ? 0.015 : 0.035)
        << "with velocity: " << with_velocity;
    EXPECT_EQ(fit.model.provenance.method, "recursive-least-squares");
  }
}

TEST(RecursiveFit, FindsFrictionAndRotors) {
  const model::Robot truth = test::six_joint_arm();
  test::SyntheticSettings settings;
  settings.noise = 0.01;
  const RecursiveFit fit = fit_recursively(as_in_urdf(truth), {test::synthetic_log(truth, settings)});
  for (std::size_t i = 0; i < 6; ++i) {
    const auto& expected = truth.joints[i].actuation;
    const auto& found = fit.model.actuation[i];
    EXPECT_NEAR(found.coulomb_friction, expected.coulomb_friction, 0.05 * expected.coulomb_friction)
        << "joint " << i + 1;
    EXPECT_NEAR(found.viscous_friction, expected.viscous_friction, 0.1 * expected.viscous_friction)
        << "joint " << i + 1;
    // The first joint's rotor cannot be separated from its link.
    if (i == 0) continue;
    EXPECT_NEAR(found.rotor_inertia, expected.rotor_inertia, 0.1 * expected.rotor_inertia)
        << "joint " << i + 1;
  }
}

TEST(RecursiveFit, NullDirectionsStayAtTheUrdf) {
  // Only the first link's inertia about the vertical axis moves a torque; its mass must stay.
  const model::Robot truth = test::six_joint_arm();
  model::Robot urdf = as_in_urdf(truth);
  const RecursiveFit fit = fit_recursively(urdf, {test::synthetic_log(truth, {})});
  EXPECT_NEAR(fit.model.links[0][kMass], urdf.joints[0].link[kMass], 1e-6);
  EXPECT_TRUE(std::isnan((*fit.model.standard_deviations)[0]));
  EXPECT_LT(fit.determined, 84);
  EXPECT_LE(fit.determined, fit.determinable);
}

TEST(RecursiveFit, DeterminesWhatTheMotionCan) {
  // UR geometry: 36 inertial combinations, the rotors of joints 3 to 6 (those of 1 and 2 go with their
  // links), 18 of friction.
  const RecursiveFit fit =
      fit_recursively(test::six_joint_arm(), {test::synthetic_log(test::six_joint_arm(), {})});
  EXPECT_EQ(fit.determinable, 58);
  EXPECT_GE(fit.determined, 57);
}

TEST(RecursiveFit, MeasuresTheScatterItLeaves) {
  const model::Robot truth = test::six_joint_arm();
  test::SyntheticSettings settings;
  settings.noise = 0.02;
  settings.correlation = 0.3;
  settings.duration = 60;
  const data::Log clean = test::synthetic_log(truth, [&] {
    auto s = settings;
    s.noise = 0;
    return s;
  }());
  const data::Log log = test::synthetic_log(truth, settings);
  const RecursiveFit fit = fit_recursively(truth, {log});
  const Eigen::RowVectorXd scale = 0.02 * clean.tau.cwiseAbs().colwise().maxCoeff();
  for (Eigen::Index i = 0; i < 6; ++i) {
    // The low-pass takes some of the noise away, the fit a little; 60 s hold a hundred independent values.
    EXPECT_LT(fit.residual.std[i], 1.1 * scale[i]);
    EXPECT_GT(fit.residual.std[i], 0.7 * scale[i]);
  }
  // Twice the time constant. One joint in six can be far off, since slow swings are few in a log.
  Eigen::VectorXd sorted = fit.residual.correlation_time;
  std::sort(sorted.begin(), sorted.end());
  EXPECT_NEAR(sorted[2], 0.6, 0.15);
  EXPECT_NEAR(sorted[3], 0.6, 0.15);
}

// The estimate of a load solves for that change itself: it must not be counted again as a residual that stays.
TEST(RecursiveFit, FrictionThatDiffersFromLogToLogIsNoCorrelationInTime) {
  const auto arm = [](double friction) {
    model::Robot robot = test::planar_two_link();
    for (model::RobotJoint& joint : robot.joints) {
      joint.actuation.coulomb_friction = 2.0 * friction;
      joint.actuation.viscous_friction = friction;
    }
    return robot;
  };
  const auto correlation_time = [&](double friction_of_second) {
    test::SyntheticSettings settings;
    settings.noise = 0.03;
    const data::Log first = test::synthetic_log(arm(1.0), settings);
    settings.motion_seed = settings.noise_seed = 2;
    const data::Log second = test::synthetic_log(arm(friction_of_second), settings);
    return fit_recursively(arm(1.0), {first, second}).residual.correlation_time;
  };
  const Eigen::VectorXd same = correlation_time(1.0), other = correlation_time(0.8);
  // Counted in full it would be 0.45 s more in the second joint.
  for (Eigen::Index i = 0; i < 2; ++i) EXPECT_NEAR(other[i], same[i], 0.15);
}

TEST(RecursiveFit, SeveralLogsTellMoreThanOne) {
  const model::Robot truth = test::six_joint_arm();
  test::SyntheticSettings settings;
  settings.noise = 0.03;
  const data::Log first = test::synthetic_log(truth, settings);
  settings.motion_seed = settings.noise_seed = 2;
  const data::Log second = test::synthetic_log(truth, settings);
  const RecursiveFit one = fit_recursively(as_in_urdf(truth), {first});
  const RecursiveFit both = fit_recursively(as_in_urdf(truth), {first, second});
  EXPECT_LT(worst_error(truth, both, 77), worst_error(truth, one, 77));
  EXPECT_EQ(both.model.provenance.logs.size(), 2U);
}

TEST(RecursiveFit, TorqueBehindTheGearHasNoFriction) {
  model::Robot truth = test::six_joint_arm();
  for (auto& joint : truth.joints) joint.actuation = {};
  RecursiveFitOptions options;
  options.torque_at_joint = true;
  const RecursiveFit fit = fit_recursively(as_in_urdf(truth), {test::synthetic_log(truth, {})}, options);
  for (const auto& drive : fit.model.actuation) {
    EXPECT_EQ(drive.coulomb_friction, 0.0);
    EXPECT_EQ(drive.viscous_friction, 0.0);
    EXPECT_EQ(drive.rotor_inertia, 0.0);
  }
  ASSERT_TRUE(fit.model.fit.has_value());
  EXPECT_EQ(fit.model.fit->torque_at, "joint");
  EXPECT_LT(worst_error(truth, fit, 77), 0.01);
}

TEST(RecursiveFit, WorksForOneJointAndForPrismaticJoints) {
  for (const model::Robot& truth : {test::pendulum(), test::planar_two_link(), test::scara_arm()}) {
    const RecursiveFit fit = fit_recursively(truth, {test::synthetic_log(truth, {})});
    EXPECT_TRUE(fit.missing.empty()) << truth.name;
    EXPECT_LT(worst_error(truth, fit, 77), 0.02) << truth.name;
  }
}

TEST(RecursiveFit, AJointAtRestIsNamed) {
  const model::Robot truth = test::six_joint_arm();
  data::Log log = test::synthetic_log(truth, {});
  log.q.col(3).setConstant(0.2);
  log.qd.col(3).setZero();
  const RecursiveFit fit = fit_recursively(truth, {log});
  ASSERT_EQ(fit.missing.size(), 1U);
  EXPECT_THAT(fit.missing[0], HasSubstr("joint 4 moving for less than 2 s"));
  EXPECT_THAT(fit.missing[0], HasSubstr("record a motion"));
}

TEST(RecursiveFit, RefusesLogsOfAnotherArm) {
  data::Log log = test::synthetic_log(test::scara_arm(), {});
  EXPECT_THAT(test::message_of<DataError>([&] { fit_recursively(test::six_joint_arm(), {log}); }),
              HasSubstr("synthetic.csv: 4 joint positions and 4 torques; expected 6 of each"));
  EXPECT_THAT(test::message_of<DataError>([&] { fit_recursively(test::six_joint_arm(), {}); }),
              HasSubstr("no log given"));
}

}  // namespace
}  // namespace heft::payload
