/// Headers that `heft export` wrote while this test was built, against the robots they come from.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include <gtest/gtest.h>

#include "exported/diagnosed_scara.hpp"
#include "exported/franka.hpp"
#include "exported/scara.hpp"
#include "heft/core/converted.hpp"
#include "heft/core/denavit_hartenberg.hpp"
#include "heft/core/dynamics/arm_torque.hpp"
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
    EXPECT_FLOAT_EQ(kThresholds.joints[j].moving, static_cast<float>(file->joints[j].moving));
    EXPECT_FLOAT_EQ(kThresholds.joints[j].top_speed, static_cast<float>(file->joints[j].top_speed));
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
  int intervals = 0;
  for (std::size_t k = 0; k < kEffects.size(); ++k) {
    EXPECT_EQ(kEffects[k].kind, robot.effects[k].kind);
    EXPECT_EQ(kEffects[k].joint, robot.effects[k].joint);
    EXPECT_EQ(kEffects[k].parameters, robot.effects[k].parameters);
    for (const auto interval :
         {&SeenWithin<double>::velocity, &SeenWithin<double>::load, &SeenWithin<double>::position,
          &SeenWithin<double>::temperature}) {
      const auto [low, high] = kEffects[k].seen.*interval;
      EXPECT_EQ(low, (robot.effects[k].seen.*interval).low);
      EXPECT_EQ(high, (robot.effects[k].seen.*interval).high);
      if (low > std::numeric_limits<double>::lowest()) ++intervals;
    }
  }
  EXPECT_EQ(intervals, 5);  // that the file states
  ASSERT_EQ(Header::kElasticities.size(), 1U);
  EXPECT_EQ(Header::kElasticities[0].joint, robot.elasticities[0].joint);
  EXPECT_EQ(Header::kElasticities[0].stiffness, robot.elasticities[0].stiffness);
  EXPECT_EQ(Header::kElasticities[0].damping, robot.elasticities[0].damping);
  EXPECT_EQ(Header::kElasticities[0].motor_inertia, robot.elasticities[0].motor_inertia);
  ASSERT_EQ(Header::kCables.size(), 1U);
  EXPECT_EQ(Header::kCables[0].driving, robot.cables[0].driving);
  EXPECT_EQ(Header::kCables[0].driven, robot.cables[0].driven);
  EXPECT_EQ(Header::kCables[0].ratio, robot.cables[0].ratio);
  EXPECT_EQ(Header::kCables[0].stiffness, robot.cables[0].stiffness);
  EXPECT_EQ(Header::kCables[0].neutral, robot.cables[0].neutral);
  EXPECT_EQ(Header::kCables[0].seen.low, robot.cables[0].seen.low);
  EXPECT_EQ(Header::kCables[0].seen.high, robot.cables[0].seen.high);
  EXPECT_EQ(Header::kTorqueDelay, robot.torque_delay);
  EXPECT_EQ(exported::Scara::kEffects.size(), 0U);
  EXPECT_EQ(exported::Scara::kCouplings.size(), 0U);
}

/// A motion of the SCARA that turns back many times.
struct Motion {
  Eigen::VectorXd time;
  Eigen::MatrixXd q, qd, qdd;
};

Motion scara_motion() {
  const Eigen::Index rows = 400;
  Motion m{Eigen::VectorXd(rows), Eigen::MatrixXd(rows, 4), Eigen::MatrixXd(rows, 4),
           Eigen::MatrixXd(rows, 4)};
  for (Eigen::Index k = 0; k < rows; ++k) {
    m.time[k] = 0.01 * static_cast<double>(k);
    for (Eigen::Index j = 0; j < 4; ++j) {
      const double w = 2.0 + static_cast<double>(j), a = j == 2 ? 0.05 : 0.6;
      m.q(k, j) = a * std::sin(w * m.time[k]);
      m.qd(k, j) = a * w * std::cos(w * m.time[k]);
      m.qdd(k, j) = -a * w * w * std::sin(w * m.time[k]);
    }
  }
  return m;
}

/// Largest difference between what firmware computes from the header and MotionTorque, against the largest torque.
/// @param loaded  with a payload at the flange and a tilted base as well
template <typename Scalar>
double firmware_error(bool loaded) {
  using Torque = ArmTorque<exported::DiagnosedScara, Scalar>;
  using Vector = typename Torque::Vector;
  model::Robot robot = diagnosed_scara();
  // Elastic joints move on the host alone; on both sides their motors count.
  for (const Elasticity<double>& elasticity : robot.elasticities) {
    robot.joints[static_cast<std::size_t>(elasticity.joint)].actuation.rotor_inertia +=
        elasticity.motor_inertia;
  }
  robot.elasticities.clear();
  robot.torque_delay = 0.0;
  Torque firmware;
  typename Torque::Config config;
  config.sign_width = static_cast<Scalar>(0.05);
  EXPECT_EQ(firmware.configure(config), Status::kOk);
  if (loaded) {
    const std::array<double, 3> com{0.02, -0.03, 0.08}, gravity{1.5, -2.0, -9.5};
    const std::array<double, 6> inertia{0.004, 0.0002, 0.005, -0.0001, 0.0003, 0.003};
    EXPECT_EQ(firmware.set_payload(Scalar(1.3), converted<Scalar>(com), converted<Scalar>(inertia)),
              Status::kOk);
    EXPECT_EQ(firmware.set_gravity(converted<Scalar>(gravity)), Status::kOk);
    robot.gravity = gravity;
    const PseudoInertia<double> body = moved(to_pseudo_inertia(make_inertial_parameters(1.3, com, inertia)),
                                             robot.tip_rotation, robot.tip_position);
    const InertialParameters<double> payload = to_inertial_parameters(body);
    for (std::size_t i = 0; i < payload.size(); ++i) robot.joints.back().link[i] += payload[i];
  }
  const Motion motion = scara_motion();
  const Eigen::MatrixXd warm = Eigen::MatrixXd::Constant(motion.time.size(), 4, 40.0);
  firmware.set_temperature(Vector::Constant(Scalar(40)));
  const Eigen::MatrixXd expected = model::MotionTorque(robot).torque(
      motion.time, motion.q, motion.qd, motion.qdd, static_cast<double>(config.sign_width), {}, warm);
  double error = 0.0;
  for (Eigen::Index k = 0; k < motion.time.size(); ++k) {
    const Vector q = motion.q.row(k).template cast<Scalar>(), qd = motion.qd.row(k).template cast<Scalar>(),
                 qdd = motion.qdd.row(k).template cast<Scalar>();
    Vector tau;
    EXPECT_EQ(firmware.update(Scalar(0.01), q, qd, qdd, tau), Status::kOk);
    error =
        std::max(error, (tau.template cast<double>() - expected.row(k).transpose()).cwiseAbs().maxCoeff());
  }
  return error / expected.cwiseAbs().maxCoeff();
}

TEST(ExportedArm, ComputesTheHostsTorque) {
  for (const bool loaded : {false, true}) {
    EXPECT_LT(firmware_error<double>(loaded), 1e-12) << loaded;
    EXPECT_LT(firmware_error<float>(loaded), 1e-5) << loaded;
  }
}

TEST(ExportedArm, IsTheRobotOfTheUrdf) {
  expect_same<exported::Franka>(urdf::load_urdf(urdf::resolve_robot("panda")));
  expect_same<exported::Scara>(urdf::load_urdf(urdf::resolve_robot("scara")));
}

}  // namespace
}  // namespace heft
