/// Runge-Kutta from sample to sample against its referee: CVODE, restarted at every sample, with a tolerance of 1e-12.
#include <cmath>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "heft/sim/simulator.hpp"
#include "sim/extra_column.hpp"
#include "support/tracking_arm.hpp"

namespace heft::sim {
namespace {

using Eigen::VectorXd;

struct ClosedLoop {
  std::string name;
  double duration;
  void (*change)(SimulationSettings&);
  int events;    ///< at least so many happen
  double bound;  ///< of the error, in tolerances: how much the motion makes of an error
};

std::ostream& operator<<(std::ostream& out, const ClosedLoop& c) { return out << c.name; }

void without_friction(SimulationSettings& s) { s.loads.clear(); }
void with_friction(SimulationSettings&) {}
void with_break_away_above_coulomb(SimulationSettings& s) {
  for (std::size_t i = 0; i < 6; ++i) {
    const auto& drive = s.robot.joints[i].actuation;
    s.loads[i].effects.front() =
        std::make_shared<CoulombFriction>(drive.coulomb_friction, 1.3 * drive.coulomb_friction);
  }
}
/// The reference reverses slowly, so that every joint sticks at its turning points.
void sticking(SimulationSettings& s) {
  with_break_away_above_coulomb(s);
  FourierMotion slow;
  slow.q0 = s.initial_position;
  slow.amplitude = VectorXd::Constant(6, 0.05);
  slow.frequency_hz = VectorXd::LinSpaced(6, 0.4, 0.9);
  slow.phase = VectorXd::Zero(6);
  s.reference = ramp_in(make_fourier(slow), slow.q0, 0.5);
}
void with_effects(SimulationSettings& s) {
  s.robot.effects = {{joint_effect_kind<Stribeck>(), 1, {2.0, 0.05}},
                     {joint_effect_kind<Hysteresis>(), 2, {0.02, 0.0}},
                     {joint_effect_kind<LoadFriction>(), 0, {0.05}}};
  s.loads = friction_of(s.robot);
}
void with_an_elastic_joint(SimulationSettings& s) { s.robot.elasticities = {{1, 9000.0, 4.0, 0.5}}; }
void with_payloads(SimulationSettings& s) {
  PayloadEvent grasp, release;
  grasp.time = 0.70035;  // between two samples
  grasp.body = {2.0, {0.02, 0.1, 0.01}, 0.004 * Eigen::Matrix3d::Identity()};
  release.grasp = false;
  release.time = 1.2;
  release.joint = 3;
  release.position = s.initial_position[3] - 0.1;
  s.payload_events = {grasp, release};
}
void at_the_torque_limit(SimulationSettings& s) { s.torque_limit *= 0.4; }
void with_slow_samples(SimulationSettings& s) {
  s.sample_rate = 50.0;  // 20 ms: several steps a sample
  VectorXd kp(6), kd(6);
  kp << 300, 300, 200, 30, 30, 30;
  kd << 40, 40, 30, 5, 5, 5;
  s.controller = std::make_shared<PdController>(kp, kd, std::make_shared<ForwardDynamics>(s.robot));
}

SimulationSettings closed_loop(const ClosedLoop& c) {
  FourierMotion motion;
  motion.q0 = VectorXd::LinSpaced(6, -1.0, 1.0);
  motion.amplitude = VectorXd::Constant(6, 0.35);
  motion.frequency_hz = VectorXd::LinSpaced(6, 0.4, 0.8);
  motion.phase = VectorXd::LinSpaced(6, 0.0, 5.0);
  SimulationSettings s = test::tracking_arm(motion, c.duration);
  c.change(s);
  return s;
}

SimulationResult run(SimulationSettings s, SolverMethod method, double tolerance) {
  s.solver.method = method;
  s.solver.relative_tolerance = tolerance;
  s.solver.absolute_tolerance = 0.1 * tolerance;
  s.solver.restart_at_samples = true;
  return simulate(s);
}

class RungeKutta : public ::testing::TestWithParam<ClosedLoop> {};

TEST_P(RungeKutta, AgreesWithCvodeAtATighterTolerance) {
  const ClosedLoop& c = GetParam();
  const SimulationSettings settings = closed_loop(c);
  const SimulationResult referee = run(settings, SolverMethod::kAdams, 1e-12);
  for (const double tolerance : {1e-6, 1e-8, 1e-10}) {
    const SimulationResult result = run(settings, SolverMethod::kRungeKutta, tolerance);
    const double error = (result.log.q - referee.log.q).cwiseAbs().maxCoeff();
    EXPECT_LT(error, c.bound * std::max(tolerance, 1e-10)) << "tolerance " << tolerance;
    // The same things happen at the same times.
    ASSERT_EQ(result.events.size(), referee.events.size()) << "tolerance " << tolerance;
    for (std::size_t k = 0; k < result.events.size(); ++k) {
      EXPECT_EQ(result.events[k].kind, referee.events[k].kind);
      EXPECT_EQ(result.events[k].joint, referee.events[k].joint);
      EXPECT_NEAR(result.events[k].time, referee.events[k].time, 3e3 * c.bound * std::max(tolerance, 1e-10));
    }
  }
  EXPECT_GE(referee.events.size(), static_cast<std::size_t>(c.events));
}

// The bound is that of Simulation.ClosedLoopWithFrictionConvergesAsTheToleranceTightens: the loop makes that much of an error.
INSTANTIATE_TEST_SUITE_P(
    Cases, RungeKutta,
    ::testing::Values(ClosedLoop{"NoFriction", 2.0, without_friction, 0, 300.0},
                      ClosedLoop{"Friction", 2.0, with_friction, 12, 300.0},
                      ClosedLoop{"Sticking", 2.0, sticking, 30, 300.0},
                      ClosedLoop{"Effects", 1.5, with_effects, 6, 300.0},
                      ClosedLoop{"ElasticJoint", 1.0, with_an_elastic_joint, 6, 300.0},
                      ClosedLoop{"Payloads", 2.0, with_payloads, 2, 300.0},
                      ClosedLoop{"TorqueLimit", 1.5, at_the_torque_limit, 6, 300.0},
                      ClosedLoop{"SlowSamples", 2.0, with_slow_samples, 6, 300.0}),
    [](const auto& instance) { return instance.param.name; });

TEST(RungeKuttaAlone, KeepsTheEnergyOfAFreeArm) {
  class Nothing : public Controller {
   public:
    void control(double, const Measurement&, Eigen::Ref<VectorXd> torque) override { torque.setZero(); }
  };
  SimulationSettings s;
  s.robot = test::six_joint_arm();
  s.duration = 4.0;
  s.initial_position.resize(6);
  s.initial_position << 0.3, -0.8, 0.9, 0.4, -0.5, 0.2;
  s.controller = std::make_shared<Nothing>();
  s.log_truth = true;
  double last = 1.0;
  for (const double tolerance : {1e-6, 1e-8, 1e-10}) {
    const SimulationResult result = run(s, SolverMethod::kRungeKutta, tolerance);
    const VectorXd& kinetic = extra(result.log, "kinetic_energy");
    const VectorXd energy = kinetic + extra(result.log, "potential_energy");
    const double drift = (energy.array() - energy[0]).abs().maxCoeff() / kinetic.maxCoeff();
    EXPECT_LT(drift, 300.0 * tolerance);
    EXPECT_LE(drift, last);
    last = drift;
  }
}

TEST(RungeKuttaAlone, TakesOneStepASampleAtTheUsualTolerance) {
  const SimulationResult result =
      run(closed_loop({"", 1.0, with_friction, 0, 0.0}), SolverMethod::kRungeKutta, 1e-8);
  // Beside one a sample, two for every change between sticking and slipping.
  EXPECT_LE(result.counts.steps, 1000 + 2 * static_cast<long>(result.events.size()));
  EXPECT_EQ(result.counts.failed_steps, 0);
}

TEST(RungeKuttaAlone, IsChosenForAControllerWithoutAnythingStiff) {
  const auto evaluations = [](SimulationSettings s, SolverMethod method) {
    s.solver.method = method;
    return simulate(s).counts.evaluations;
  };
  const SimulationSettings usual = closed_loop({"", 0.3, with_friction, 0, 0.0});
  SimulationSettings smooth = usual, elastic = usual, coupled = usual, open = usual;
  smooth.loads = friction_of(smooth.robot, SignModel::kSmooth);
  with_an_elastic_joint(elastic);
  coupled.robot.couplings = {{4, 5, 1.0, 0.0, 0.5, 0.2}};
  open.controller = nullptr;
  EXPECT_EQ(evaluations(usual, SolverMethod::kAutomatic), evaluations(usual, SolverMethod::kRungeKutta));
  EXPECT_NE(evaluations(usual, SolverMethod::kAutomatic), evaluations(usual, SolverMethod::kAdams));
  for (const SimulationSettings& s : {smooth, elastic, coupled, open})
    EXPECT_EQ(evaluations(s, SolverMethod::kAutomatic), evaluations(s, SolverMethod::kAdams));
}

}  // namespace
}  // namespace heft::sim
