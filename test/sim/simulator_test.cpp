#include "heft/sim/simulator.hpp"

#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/error.hpp"
#include "heft/model/dynamics.hpp"
#include "sim/extra_column.hpp"
#include "support/arms.hpp"
#include "support/tracking_arm.hpp"

namespace heft::sim {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using ::testing::AllOf;
using ::testing::HasSubstr;

/// Spring to a rest position, linear.
class Spring : public JointEffect {
 public:
  explicit Spring(double stiffness) : stiffness_(stiffness) {}
  double torque(const JointPoint& point, const double*) const override { return stiffness_ * point.position; }

 private:
  double stiffness_;
};

/// Torques from a list, one a sample.
class ListController : public Controller {
 public:
  explicit ListController(std::vector<double> torques) : torques_(std::move(torques)) {}
  void control(double, const Measurement&, Eigen::Ref<VectorXd> torque) override {
    torque.setConstant(torques_[std::min(next_++, torques_.size() - 1)]);
  }

 private:
  std::vector<double> torques_;
  std::size_t next_{0};
};

SimulationSettings tight(const model::Robot& robot, double duration) {
  SimulationSettings s;
  s.robot = robot;
  s.duration = duration;
  s.initial_position = VectorXd::Zero(robot.num_joints());
  s.solver.relative_tolerance = 1e-12;
  s.solver.absolute_tolerance = 1e-13;
  s.log_truth = true;
  return s;
}

FourierMotion exciting_motion() {
  FourierMotion motion;
  motion.q0 = VectorXd::LinSpaced(6, -1.0, 1.0);
  motion.amplitude.resize(6, 2);
  motion.frequency_hz.resize(6, 2);
  motion.phase.resize(6, 2);
  for (int i = 0; i < 6; ++i) {
    for (int k = 0; k < 2; ++k) {
      motion.amplitude(i, k) = 0.3 - 0.1 * k;
      motion.frequency_hz(i, k) = 0.3 + 0.05 * i + 0.4 * k;
      motion.phase(i, k) = i + 2.0 * k;
    }
  }
  return motion;
}

SimulationSettings closed_loop(double duration) { return test::tracking_arm(exciting_motion(), duration); }

double relative_drift(const VectorXd& energy, const VectorXd& kinetic) {
  return (energy.array() - energy[0]).abs().maxCoeff() / kinetic.maxCoeff();
}

TEST(Simulation, FrictionlessSixJointArmKeepsItsEnergy) {
  SimulationSettings s = tight(test::six_joint_arm(), 10.0);
  s.initial_position << 0.3, -0.8, 0.9, 0.4, -0.5, 0.2;
  const SimulationResult result = simulate(s);
  const VectorXd& kinetic = extra(result.log, "kinetic_energy");
  const double drift = relative_drift(kinetic + extra(result.log, "potential_energy"), kinetic);
  RecordProperty("relative_energy_drift", std::to_string(drift * 1e12) + "e-12");
  EXPECT_GT(kinetic.maxCoeff(), 10.0);
  EXPECT_LT(drift, 1e-8);
}

TEST(Simulation, FrictionlessScaraOnATiltedBaseKeepsItsEnergy) {
  SimulationSettings s = tight(test::scara_arm(), 10.0);
  s.initial_position << 0.5, 1.2, 0.05, 0.0;
  s.gravity = tilted_gravity({0.0, 0.0, -9.81}, 0.5, 0.7);
  // The quill would fall without end, so it hangs on a spring.
  s.loads.resize(4);
  s.loads[2].effects.push_back(std::make_shared<Spring>(400.0));
  const SimulationResult result = simulate(s);
  const VectorXd& kinetic = extra(result.log, "kinetic_energy");
  const VectorXd& quill = extra(result.log, "q_true3");
  const VectorXd energy = kinetic + extra(result.log, "potential_energy") + 200.0 * quill.cwiseAbs2();
  const double drift = relative_drift(energy, kinetic);
  RecordProperty("relative_energy_drift", std::to_string(drift * 1e12) + "e-12");
  EXPECT_LT(drift, 1e-8);
}

TEST(Simulation, PendulumHasThePeriodOfTheEllipticIntegral) {
  const double amplitude = 2.5;
  const double period = 4.0 * std::sqrt(0.5 / 9.81) * std::comp_ellint_1(std::sin(amplitude / 2.0));
  SimulationSettings s = tight(test::pendulum(), period);
  s.initial_position[0] = amplitude;
  s.sample_rate = 4.0 / period;
  const data::Log log = simulate(s).log;
  ASSERT_EQ(log.num_samples(), 5);
  EXPECT_NEAR(log.q(1, 0), 0.0, 1e-9);
  EXPECT_NEAR(log.q(2, 0), -amplitude, 1e-9);
  EXPECT_NEAR(log.q(3, 0), 0.0, 1e-9);
  EXPECT_NEAR(log.q(4, 0), amplitude, 1e-9);
}

TEST(Simulation, HeldTorquesGiveTheClosedFormOfADampedBlock) {
  // m v' = u − b v with u held over each sample. The torques are white, the worst case for carrying the
  // solver's history across samples.
  const double m = 2.0, b = 3.0, step = 1e-3;
  std::mt19937 random(7);
  std::normal_distribution<double> normal(0.0, 50.0);
  std::vector<double> torques(2000);
  for (double& u : torques) u = normal(random);
  struct Way {
    SolverMethod method;
    bool restart;
    const char* name;
  };
  for (const Way& way : {Way{SolverMethod::kAdams, false, "carrying the history"},
                         Way{SolverMethod::kAdams, true, "restarting"},
                         Way{SolverMethod::kRungeKutta, false, "Runge-Kutta"}}) {
    SimulationSettings s = tight(test::slider(m), 2.0);
    s.loads.resize(1);
    s.loads[0].effects.push_back(std::make_shared<ViscousFriction>(b, 0.0));
    s.controller = std::make_shared<ListController>(torques);
    s.solver.method = way.method;
    s.solver.restart_at_samples = way.restart;
    const data::Log log = simulate(s).log;
    const double decay = std::exp(-b / m * step);
    double x = 0.0, v = 0.0, worst = 0.0;
    for (int k = 0; k < 2000; ++k) {
      const double u = torques[static_cast<std::size_t>(k)];
      x += u / b * step + (v - u / b) * (1.0 - decay) * m / b;
      v = u / b + (v - u / b) * decay;
      worst = std::max({worst, std::abs(log.q(k + 1, 0) - x), std::abs(log.qd(k + 1, 0) - v)});
    }
    // Some 20000 steps, each with a local error up to the tolerance of 1e-12, add up to this order.
    EXPECT_LT(worst, 2e-9) << way.name;
  }
}

TEST(Simulation, EveryLogRowSatisfiesTheEquationsOfMotion) {
  SimulationSettings s = closed_loop(2.0);
  s.log_truth = true;
  PayloadEvent grasp;
  grasp.time = 1.0;
  grasp.body.mass = 2.0;
  grasp.body.com = {0.0, 0.1, 0.02};
  s.payload_events = {grasp};
  const data::Log log = simulate(s).log;
  model::Robot loaded = s.robot;
  const InertialParameters<double> body = inertial_parameters(grasp.body);
  for (std::size_t k = 0; k < body.size(); ++k) loaded.joints.back().link[k] += body[k];
  const model::Dynamics bare(s.robot), heavy(loaded);
  for (int k = 0; k < log.num_samples(); ++k) {
    const VectorXd q = log.q.row(k), qd = log.qd.row(k), qdd = log.qdd.row(k);
    VectorXd tau = (log.time[k] < 1.0 ? bare : heavy).inverse_dynamics(q, qd, qdd);
    for (int i = 0; i < 6; ++i) {
      tau[i] += s.robot.joints[static_cast<std::size_t>(i)].actuation.rotor_inertia * qdd[i] +
                extra(log, "friction_true" + std::to_string(i + 1))[k];
    }
    ASSERT_LT((tau - log.tau.row(k).transpose()).norm(), 1e-9) << "t = " << log.time[k];
  }
}

TEST(Simulation, ClosedLoopWithFrictionConvergesAsTheToleranceTightens) {
  const auto run = [](double tolerance, bool restart) {
    SimulationSettings s = closed_loop(3.0);
    s.solver.method = SolverMethod::kAdams;
    s.solver.relative_tolerance = tolerance;
    s.solver.absolute_tolerance = 0.1 * tolerance;
    s.solver.restart_at_samples = restart;
    return simulate(s).log.q;
  };
  const MatrixXd best = run(1e-12, true);
  double last = 1e-4;
  for (double tolerance : {1e-6, 1e-8, 1e-10}) {
    const double error = (run(tolerance, false) - best).cwiseAbs().maxCoeff();
    // The error follows the tolerance; the factor accounts for the number of steps and the loop's gain.
    EXPECT_LT(error, 300.0 * tolerance) << "tolerance " << tolerance;
    EXPECT_LT(error, last) << "tolerance " << tolerance;
    last = error;
  }
  // Carrying the history across the steps of the torque changes the work, not the answer.
  EXPECT_LT((run(1e-12, false) - best).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(Simulation, CarryingTheHistoryTakesFewerEvaluationsThanRestarting) {
  SimulationSettings s = closed_loop(2.0);
  s.solver.method = SolverMethod::kAdams;
  const long carried = simulate(s).counts.evaluations;
  s.solver.restart_at_samples = true;
  const long restarted = simulate(s).counts.evaluations;
  EXPECT_LT(2 * carried, restarted);
}

TEST(Simulation, AdamsAndBdfAgree) {
  SimulationSettings s = closed_loop(1.0);
  s.solver.relative_tolerance = 1e-10;
  s.solver.absolute_tolerance = 1e-11;
  s.solver.method = SolverMethod::kAdams;
  const MatrixXd adams = simulate(s).log.q;
  s.solver.method = SolverMethod::kBdf;
  EXPECT_LT((simulate(s).log.q - adams).cwiseAbs().maxCoeff(), 1e-7);
}

TEST(Simulation, AGraspedBodyChangesTheHoldingTorqueByItsWeight) {
  SimulationSettings s;
  s.robot = test::six_joint_arm();
  s.duration = 6.0;
  s.initial_position.resize(6);
  s.initial_position << 0.3, -0.6, 0.8, 0.2, 0.5, 0.1;
  s.reference = make_hold(s.initial_position);
  const VectorXd kp = VectorXd::Constant(6, 2000.0), kd = VectorXd::Constant(6, 120.0);
  s.controller = std::make_shared<PdController>(kp, kd, std::make_shared<ForwardDynamics>(s.robot));
  PayloadEvent grasp, release;
  grasp.time = 1.0;
  grasp.body.mass = 3.0;
  grasp.body.com = {0.02, 0.15, -0.03};
  release.grasp = false;
  release.time = 3.5;
  s.payload_events = {grasp, release};
  const SimulationResult result = simulate(s);
  const data::Log& log = result.log;

  ForwardDynamics model(s.robot);
  const auto torque_error = [&](int row) {
    return (log.tau.row(row).transpose() - model.gravity_torque(log.q.row(row).transpose())).norm();
  };
  EXPECT_LT(torque_error(999), 1e-6);
  EXPECT_LT(torque_error(6000), 1e-6);
  EXPECT_GT(torque_error(3499), 5.0);
  model.attach(grasp.body);
  EXPECT_LT(torque_error(3499), 1e-4);
  ASSERT_EQ(result.events.size(), 2u);
  EXPECT_EQ(result.events[0].kind, SimulationEvent::Kind::kGrasp);
  EXPECT_EQ(result.events[0].time, 1.0);
  EXPECT_EQ(result.events[1].kind, SimulationEvent::Kind::kRelease);
  EXPECT_EQ(result.events[1].time, 3.5);
}

TEST(Simulation, AGraspAtAPositionHappensThereAndKeepsTheVelocity) {
  SimulationSettings s = tight(test::slider(2.0), 2.0);
  s.sample_rate = 100.0;
  s.initial_velocity = VectorXd::Constant(1, 0.5);
  PayloadEvent grasp, release;
  grasp.body.mass = 3.0;
  grasp.time = 0.2;
  grasp.joint = 0;
  grasp.position = 0.3;
  release.grasp = false;
  release.joint = 0;
  release.time = 0.2;
  release.position = 0.77;
  s.payload_events = {grasp, release};
  const SimulationResult result = simulate(s);
  ASSERT_EQ(result.events.size(), 2u);
  EXPECT_NEAR(result.events[0].time, 0.6, 1e-12);
  EXPECT_NEAR(result.events[1].time, 1.54, 1e-12);
  EXPECT_LT((result.log.qd.array() - 0.5).abs().maxCoeff(), 1e-13);
  const VectorXd& kinetic = extra(result.log, "kinetic_energy");
  EXPECT_NEAR(kinetic[59], 0.5 * 2.0 * 0.25, 1e-12);
  EXPECT_NEAR(kinetic[100], 0.5 * 5.0 * 0.25, 1e-12);
  EXPECT_NEAR(kinetic[200], 0.5 * 2.0 * 0.25, 1e-12);
}

TEST(Simulation, TorqueStopsAtItsLimit) {
  SimulationSettings s = tight(test::slider(2.0), 0.5);
  s.controller = std::make_shared<ListController>(std::vector<double>{100.0, -100.0, 3.0});
  s.torque_limit = VectorXd::Constant(1, 8.0);
  const data::Log log = simulate(s).log;
  EXPECT_EQ(log.tau(0, 0), 8.0);
  EXPECT_EQ(log.tau(1, 0), -8.0);
  EXPECT_EQ(log.tau(2, 0), 3.0);
  EXPECT_NEAR(log.qdd(0, 0), 4.0, 1e-14);
}

TEST(Simulation, AControllerGetsTheTorqueThatCausedTheMeasuredAcceleration) {
  class Recorder : public Controller {
   public:
    void control(double t, const Measurement& m, Eigen::Ref<VectorXd> torque) override {
      // Pendulum: 0.25 q̈ + 0.5 · 9.81 sin q = τ.
      const double load = 0.25 * m.qdd[0] + 4.905 * std::sin(m.q[0]);
      if (t > 0.0) worst = std::max(worst, std::abs(m.tau[0] - load));
      torque[0] = 3.0 * std::sin(700.0 * t) + 0.3;
    }
    double worst{0.0};
  };
  SimulationSettings s = tight(test::pendulum(), 0.1);
  s.initial_velocity = VectorXd::Constant(1, 3.0);
  const auto controller = std::make_shared<Recorder>();
  s.controller = controller;
  simulate(s);
  EXPECT_LT(controller->worst, 1e-12);
}

TEST(Simulation, OpenLoopTorqueActsContinuously) {
  SimulationSettings s = tight(test::slider(2.0), 1.0);
  s.sample_rate = 10.0;
  s.torque = [](double t, Eigen::Ref<VectorXd> torque) { torque[0] = 2.0 * std::sin(9.0 * t); };
  const data::Log log = simulate(s).log;
  EXPECT_NEAR(log.qd(10, 0), (1.0 - std::cos(9.0)) / 9.0, 1e-11);
  EXPECT_NEAR(log.tau(3, 0), 2.0 * std::sin(2.7), 1e-12);
}

TEST(Simulation, ToolForceMovesTheArm) {
  SimulationSettings s = tight(test::slider(2.0), 1.0);
  s.tool_wrench = [](double t) {
    Wrench wrench;
    wrench.force = {6.0 * t, 50.0, 0.0};
    return wrench;
  };
  EXPECT_NEAR(simulate(s).log.q(1000, 0), 0.5, 1e-11);
}

TEST(Simulation, ExtraStatesOfAnEffectAreIntegrated) {
  // A Maxwell element: spring k in line with a damper c; its state is the force.
  class Maxwell : public JointEffect {
   public:
    double torque(const JointPoint&, const double* state) const override { return state[0]; }
    int num_states() const override { return 1; }
    void initial_state(const JointPoint&, double* state) const override { state[0] = 4.0; }
    void rate(const JointPoint& p, const double* state, double* rate) const override {
      rate[0] = 30.0 * p.velocity - 5.0 * state[0];
    }
  };
  SimulationSettings s = tight(test::slider(2.0), 1.0);
  s.loads.resize(1);
  s.loads[0].effects.push_back(std::make_shared<Maxwell>());
  const data::Log log = simulate(s).log;
  // 2 v' = −f, f' = 30 v − 5 f from v = 0, f = 4: s² + 5 s + 15 = 0.
  const double w = std::sqrt(15.0 - 6.25);
  EXPECT_NEAR(log.qd(1000, 0), -2.0 / w * std::exp(-2.5) * std::sin(w), 1e-11);
}

TEST(Simulation, LogRateThinsTheSameRun) {
  SimulationSettings s = closed_loop(0.5);
  const data::Log all = simulate(s).log;
  s.log_rate = 200.0;
  const data::Log some = simulate(s).log;
  ASSERT_EQ(all.num_samples(), 501);
  ASSERT_EQ(some.num_samples(), 101);
  EXPECT_EQ(some.q.row(40), all.q.row(200));
  EXPECT_EQ(some.qdref.row(40), all.qdref.row(200));
}

TEST(Simulation, NamesTheJointWhoseTorqueIsNotFinite) {
  SimulationSettings s = tight(test::slider(1.0), 1.0);
  s.controller = std::make_shared<ListController>(std::vector<double>{1.0, std::nan("")});
  try {
    simulate(s);
    FAIL();
  } catch (const Error& e) {
    EXPECT_THAT(e.what(), testing::AllOf(testing::HasSubstr("joint 1"), testing::HasSubstr("0.001 s")));
  }
}

/// A torque on the second joint of two that no arm survives.
class Runaway : public Controller {
 public:
  explicit Runaway(double torque) : torque_(torque) {}
  void control(double, const Measurement&, Eigen::Ref<VectorXd> torque) override {
    torque.setZero();
    torque[1] = torque_;
  }

 private:
  double torque_;
};

std::string failure_of(const SimulationSettings& s) {
  try {
    (void)simulate(s);
  } catch (const SimulationError& error) {  // exit code 4
    return error.what();
  }
  return "";
}

TEST(Simulation, EndsWithJointAndTimeWhereTheSolverWouldNotEnd) {
  SimulationSettings s = tight(test::planar_two_link(), 0.1);
  s.controller = std::make_shared<Runaway>(1e9);
  const auto says_why =
      AllOf(HasSubstr("at t = 0.00"), HasSubstr("uses up the solver's steps"),
            HasSubstr("at most 500000 steps a simulated second"), HasSubstr("max_steps_per_second"));
  s.solver.method = SolverMethod::kAdams;
  EXPECT_THAT(failure_of(s), AllOf(HasSubstr("joint 2 "), says_why));
  // Both joints whirl; which of them is faster changes with the time that was reached.
  s.solver.method = SolverMethod::kRungeKutta;
  EXPECT_THAT(failure_of(s), AllOf(HasSubstr("simulation: joint "), says_why));
  // The bound counts time as well: a hundredth of the steps, and an ordinary motion over long samples does not end.
  SimulationSettings slow = tight(test::pendulum(), 20.0);
  slow.initial_position[0] = 1.0;
  slow.sample_rate = 0.5;
  slow.solver.max_steps_per_second = 5e3;
  EXPECT_EQ(failure_of(slow), "");
}

TEST(Simulation, EndsWithJointAndTimeWhereATorqueIsWithoutBound) {
  SimulationSettings s = tight(test::planar_two_link(), 0.1);
  for (const double torque : {1e200, 1e300}) {
    s.controller = std::make_shared<Runaway>(torque);
    EXPECT_THAT(failure_of(s),
                AllOf(HasSubstr("simulation: joint "), HasSubstr(" at t = "), HasSubstr("expected")))
        << torque;
  }
  s.controller = std::make_shared<Runaway>(std::numeric_limits<double>::infinity());
  EXPECT_THAT(failure_of(s), AllOf(HasSubstr("joint 2 at t = 0 s"), HasSubstr("found inf")));
}

TEST(Simulation, RefusesWhatIsFarOutOfScale) {
  const auto message = [](auto change) {
    SimulationSettings s = tight(test::pendulum(), 0.1);
    s.initial_velocity = VectorXd::Zero(1);
    change(s);
    try {
      (void)simulate(s);
    } catch (const ModelError& error) {  // exit code 3
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(
      message([](auto& s) { s.initial_position[0] = 1e300; }),
      AllOf(HasSubstr("initial_position, entry 1"), HasSubstr("found 1e+300"), HasSubstr("at most 10000")));
  EXPECT_THAT(message([](auto& s) { s.initial_velocity[0] = std::nan(""); }),
              HasSubstr("initial_velocity, entry 1"));
  EXPECT_THAT(message([](auto& s) { s.initial_velocity[0] = -1e10; }),
              HasSubstr("initial_velocity, entry 1"));
  EXPECT_THAT(message([](auto& s) { s.gravity = Eigen::Vector3d(0, 0, -1e300); }),
              HasSubstr("gravity, entry 3"));
  EXPECT_THAT(message([](auto& s) { s.solver.max_step = 1e-300; }), HasSubstr("solver.max_step"));
  EXPECT_THAT(message([](auto& s) { s.solver.max_steps_per_second = 0; }), HasSubstr("max_steps_per_second"));
  EXPECT_THAT(
      message([](auto& s) { s.duration = 1e5; }),
      AllOf(HasSubstr("duration"), HasSubstr("GB"), HasSubstr("at most 2 GB"), HasSubstr("log_rate")));
  EXPECT_EQ(message([](auto&) {}), "");
}

TEST(Simulation, RefusesSettingsThatDoNotFitTheRobot) {
  SimulationSettings s = closed_loop(1.0);
  s.initial_position = VectorXd::Zero(4);
  try {
    simulate(s);
    FAIL();
  } catch (const ModelError& e) {
    EXPECT_THAT(e.what(), testing::AllOf(testing::HasSubstr("initial_position"),
                                         testing::HasSubstr("4 values"), testing::HasSubstr("expected 6")));
  }
}

}  // namespace
}  // namespace heft::sim
