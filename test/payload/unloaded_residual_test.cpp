/// What an arm without load is taken to explain of its torque: also what was found in it beyond rigid bodies and friction.
/// The logs come from the simulator, whose friction, gears and springs are its own.
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "heft/model/dynamics.hpp"
#include "heft/model/without_effects.hpp"
#include "heft/sim/reference.hpp"
#include "heft/sim/simulator.hpp"
#include "payload/payload_run.hpp"
#include "support/arms.hpp"

namespace heft::payload {
namespace {

/// Holds an arm on its reference well enough to log a motion.
class Follow final : public sim::Controller {
 public:
  explicit Follow(const model::Robot& robot) : dynamics_(robot) {}
  void control(double, const sim::Measurement& m, Eigen::Ref<Eigen::VectorXd> torque) override {
    const Eigen::VectorXd wanted = m.qdd_ref + 100.0 * (m.q_ref - m.q) + 20.0 * (m.qd_ref - m.qd);
    torque = dynamics_.joint_torque(m.q, m.qd, wanted, 0.01);
  }

 private:
  model::Dynamics dynamics_;
};

/// Both joints go round at the same rate, a third of a turn apart, so that friction on their common motion does not average
/// out against gravity.
data::Log simulated(const model::Robot& robot, const std::vector<sim::PayloadEvent>& loads = {}) {
  sim::SimulationSettings settings;
  settings.robot = robot;
  settings.loads = sim::friction_of(robot, sim::SignModel::kSmooth);
  settings.duration = 40.0;
  settings.sample_rate = 200.0;
  settings.log_rate = 100.0;
  const Eigen::Index n = robot.num_joints();
  sim::FourierMotion motion{Eigen::VectorXd::Constant(n, 1.0), Eigen::MatrixXd(n, 2), Eigen::MatrixXd(n, 2),
                            Eigen::MatrixXd(n, 2)};
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto k = static_cast<double>(i);
    motion.amplitude.row(i) << 0.6, 0.1;
    motion.frequency_hz.row(i) << 0.2, 0.6 + 0.07 * k;
    motion.phase.row(i) << 2.0 * k, 1.3 * k;
  }
  settings.initial_position = motion.q0;
  settings.reference = sim::ramp_in(sim::make_fourier(motion), motion.q0, 1.5);
  settings.controller = std::make_shared<Follow>(robot);
  settings.payload_events = loads;
  settings.sensors.torque_noise = Eigen::VectorXd::Constant(n, 0.3);
  return sim::simulate(settings).log;
}

sim::PayloadEvent grasp(double mass) {
  sim::PayloadEvent event;
  event.body.mass = mass;
  event.body.com = Eigen::Vector3d(0.3, 0.1, 0.0);
  event.body.inertia = Eigen::Matrix3d::Identity() * 0.01;
  return event;
}

/// Estimates with the model that the arm has, and with the same one without what was found beyond rigid bodies and
/// declared friction.
std::pair<PayloadRun, PayloadRun> with_and_without(const model::Robot& arm, const data::Log& log) {
  return {run_payload(arm, log, {}), run_payload(model::without_effects(arm), log, {})};
}

TEST(UnloadedResidual, FindsNoLoadInStribeckFrictionAndCoupledGears) {
  model::Robot arm = test::planar_two_link();
  arm.effects = {{joint_effect_kind<Stribeck>(), 0, {3.0, 0.2}},
                 {joint_effect_kind<Stribeck>(), 1, {1.5, 0.2}}};
  arm.couplings = {{0, 1, 1.0, 0.05, 4.0, 1.0}};
  const auto [with, without] = with_and_without(arm, simulated(arm));
  ASSERT_TRUE(with.mass.identifiable);
  EXPECT_LT(std::abs(with.mass.value), with.mass.half_width());
  EXPECT_LT(with.mass.half_width(), 0.05);
  EXPECT_GT(std::abs(without.mass.value), 2.0 * without.mass.half_width()) << "this motion is no test";
}

TEST(UnloadedResidual, WeighsALoadWhoseTorqueComesLate) {
  model::Robot arm = test::planar_two_link();
  arm.torque_delay = 0.05;
  const auto [with, without] = with_and_without(arm, simulated(arm, {grasp(1.5)}));
  EXPECT_NEAR(with.mass.value, 1.5, with.mass.half_width());
  EXPECT_LT(with.mass.half_width(), 0.3 * without.mass.half_width())
      << "the delay is what the residual is made of";
}

TEST(UnloadedResidual, WeighsALoadOnElasticJoints) {
  model::Robot arm = test::planar_two_link();
  arm.elasticities = {{0, 2000.0, 10.0, 0.3}, {1, 1200.0, 5.0, 0.2}};
  const auto [with, without] = with_and_without(arm, simulated(arm, {grasp(0.5)}));
  // By how much the load itself bends the joints is left out: half a per cent of it here.
  EXPECT_NEAR(with.mass.value, 0.5, 0.005);
  EXPECT_GT(std::abs(without.mass.value - 0.5), 2.0 * without.mass.half_width()) << "this motion is no test";
}

}  // namespace
}  // namespace heft::payload
