/// Headers that `heft export` wrote while this test was built, against the robots they come from.
#include <algorithm>
#include <cmath>
#include <cstddef>

#include <gtest/gtest.h>

#include "exported/diagnosed_scara.hpp"
#include "exported/franka.hpp"
#include "exported/scara.hpp"
#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/effects/effect_feed_forward.hpp"
#include "heft/core/monitor/contact_monitor.hpp"
#include "heft/model/model_file.hpp"
#include "heft/model/motion_torque.hpp"
#include "heft/monitor/monitor.hpp"
#include "heft/urdf/urdf_import.hpp"

namespace heft {
namespace {

/// Every number of a description against the URDF's; `snap` is what may have been rounded to 0 or ±1.
template <typename Description>
void expect_same(const model::Robot& robot) {
  constexpr auto kModel = Description::kModel;  // a constant expression, or this does not compile
  ASSERT_EQ(robot.num_joints(), kModel.kNumJoints);
  constexpr double kSnap = 1e-12;
  for (std::size_t j = 0; j < kModel.joints.size(); ++j) {
    const auto& joint = robot.joints[j].joint;
    EXPECT_EQ(kModel.joints[j].type, joint.type);
    EXPECT_EQ(kModel.joints[j].position, joint.position);
    EXPECT_EQ(kModel.links[j], robot.joints[j].link);
    for (std::size_t k = 0; k < 9; ++k) EXPECT_NEAR(kModel.joints[j].rotation[k], joint.rotation[k], kSnap);
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(kModel.joints[j].axis[k], joint.axis[k], kSnap);
    EXPECT_EQ(kModel.actuation[j].rotor_inertia, robot.joints[j].actuation.rotor_inertia);
    EXPECT_EQ(kModel.actuation[j].coulomb_friction, robot.joints[j].actuation.coulomb_friction);
    EXPECT_EQ(kModel.actuation[j].viscous_friction, robot.joints[j].actuation.viscous_friction);
    EXPECT_EQ(kModel.actuation[j].friction_offset, robot.joints[j].actuation.friction_offset);
  }
  EXPECT_EQ(kModel.gravity, robot.gravity);
  EXPECT_EQ(Description::kTipPosition, robot.tip_position);
}

/// The robot that diagnosed_scara.hpp was made of.
model::Robot diagnosed_scara() {
  model::Robot robot = urdf::load_urdf(urdf::resolve_robot("scara"));
  model::apply(model::read_model(HEFT_DIAGNOSED_SCARA), robot);
  return robot;
}

TEST(ExportedArm, CarriesTheThresholdsOfContactsToTheMonitor) {
  constexpr ContactThresholds<float, 4> kThresholds = exported::DiagnosedScara::kThresholds.cast<float>();
  const auto file = monitor::thresholds_of(model::read_model(HEFT_DIAGNOSED_SCARA));
  ASSERT_TRUE(file.has_value());
  EXPECT_FLOAT_EQ(kThresholds.bandwidth, static_cast<float>(file->bandwidth));
  ASSERT_EQ(file->joints.size(), kThresholds.joints.size());
  for (std::size_t j = 0; j < kThresholds.joints.size(); ++j) {
    EXPECT_FLOAT_EQ(kThresholds.joints[j].constant, static_cast<float>(file->joints[j].constant));
    EXPECT_FLOAT_EQ(kThresholds.joints[j].rest_speed, static_cast<float>(file->joints[j].rest_speed));
  }
  ContactMonitor<float, 4> core;
  ContactMonitor<float, 4>::Config config;
  config.thresholds = kThresholds;
  EXPECT_EQ(core.configure(config), Status::kOk);
}

TEST(ExportedArm, HoldsEverythingOfAModel) {
  using Header = exported::DiagnosedScara;
  constexpr auto kEffects = Header::kEffects;
  const model::Robot robot = diagnosed_scara();
  expect_same<Header>(robot);
  ASSERT_EQ(kEffects.size(), static_cast<std::size_t>(kNumJointEffects));  // the file holds one of every kind
  ASSERT_EQ(robot.effects.size(), kEffects.size());
  for (std::size_t k = 0; k < kEffects.size(); ++k) {
    EXPECT_EQ(kEffects[k].kind, robot.effects[k].kind);
    EXPECT_EQ(kEffects[k].joint, robot.effects[k].joint);
    EXPECT_EQ(kEffects[k].parameters, robot.effects[k].parameters);
  }
  ASSERT_EQ(Header::kElasticities.size(), 1U);
  EXPECT_EQ(Header::kElasticities[0].joint, robot.elasticities[0].joint);
  EXPECT_EQ(Header::kElasticities[0].stiffness, robot.elasticities[0].stiffness);
  EXPECT_EQ(Header::kElasticities[0].damping, robot.elasticities[0].damping);
  EXPECT_EQ(Header::kElasticities[0].motor_inertia, robot.elasticities[0].motor_inertia);
  EXPECT_EQ(Header::kTorqueDelay, robot.torque_delay);
  EXPECT_EQ(exported::Scara::kEffects.size(), 0U);
  EXPECT_EQ(exported::Scara::kCouplings.size(), 0U);
}

/// Largest difference between what firmware computes from the header and MotionTorque, against the largest torque.
template <typename Scalar>
double firmware_error() {
  using Header = exported::DiagnosedScara;
  using Arm = StaticArm<Scalar, Header>;
  using Vector = typename Arm::Vector;
  model::Robot robot = diagnosed_scara();
  robot.elasticities.clear();  // their motion is the host's
  robot.torque_delay = 0.0;
  const Eigen::Index rows = 400;
  Eigen::VectorXd time(rows);
  Eigen::MatrixXd q(rows, 4), qd(rows, 4), qdd(rows, 4);
  for (Eigen::Index k = 0; k < rows; ++k) {
    time[k] = 0.01 * static_cast<double>(k);
    for (Eigen::Index j = 0; j < 4; ++j) {
      const double w = 2.0 + static_cast<double>(j), a = j == 2 ? 0.05 : 0.6;
      q(k, j) = a * std::sin(w * time[k]);
      qd(k, j) = a * w * std::cos(w * time[k]);
      qdd(k, j) = -a * w * w * std::sin(w * time[k]);
    }
  }
  constexpr double kWidth = 0.05;
  const Eigen::MatrixXd expected = model::MotionTorque(robot).torque(time, q, qd, qdd, kWidth);

  const ConstantParameters<Scalar, Header> parameters;
  std::array<JointActuation<Scalar>, 4> actuation;
  for (std::size_t j = 0; j < 4; ++j) {
    const auto& from = Header::kModel.actuation[j];
    actuation[j] = {static_cast<Scalar>(from.rotor_inertia), static_cast<Scalar>(from.coulomb_friction),
                    static_cast<Scalar>(from.viscous_friction), static_cast<Scalar>(from.friction_offset)};
  }
  EffectFeedForward<Scalar, 4, Header::kEffects.size()> effects;
  EXPECT_EQ(effects.configure(Header::kEffects), Status::kOk);
  double error = 0.0;
  for (Eigen::Index k = 0; k < rows; ++k) {
    const Vector position = q.row(k).template cast<Scalar>(), velocity = qd.row(k).template cast<Scalar>(),
                 acceleration = qdd.row(k).template cast<Scalar>();
    const Vector rigid = inverse_dynamics<Arm>(parameters, position, velocity, acceleration);
    Vector tau = rigid;
    const auto width = static_cast<Scalar>(kWidth);
    for (int j = 0; j < 4; ++j) {
      const JointActuation<Scalar>& joint = actuation[static_cast<std::size_t>(j)];
      tau[j] += joint.rotor_inertia * acceleration[j] + friction_torque(joint, velocity[j], width);
    }
    for (const GearCoupling<double>& c : Header::kCouplings) {
      const GearCoupling<Scalar> coupling{c.driving,
                                          c.driven,
                                          static_cast<Scalar>(c.ratio),
                                          static_cast<Scalar>(c.rotor_inertia),
                                          static_cast<Scalar>(c.coulomb_friction),
                                          static_cast<Scalar>(c.viscous_friction)};
      const Scalar shared = gear_coupling_torque(
          coupling, shared_motion(coupling, velocity[c.driving], velocity[c.driven]),
          shared_motion(coupling, acceleration[c.driving], acceleration[c.driven]), width);
      tau[c.driven] += shared;
      tau[c.driving] += coupling.ratio * shared;
    }
    EXPECT_EQ(effects.add_torque(static_cast<Scalar>(time[k]), position, velocity, acceleration, rigid,
                                 actuation, width, tau),
              Status::kOk);
    error =
        std::max(error, (tau.template cast<double>() - expected.row(k).transpose()).cwiseAbs().maxCoeff());
  }
  return error / expected.cwiseAbs().maxCoeff();
}

TEST(ExportedArm, ComputesTheHostsTorque) {
  EXPECT_LT(firmware_error<double>(), 1e-12);
  EXPECT_LT(firmware_error<float>(), 1e-5);
}

TEST(ExportedArm, IsTheRobotOfTheUrdf) {
  expect_same<exported::Franka>(urdf::load_urdf(urdf::resolve_robot("panda")));
  expect_same<exported::Scara>(urdf::load_urdf(urdf::resolve_robot("scara")));
}

}  // namespace
}  // namespace heft
