// What acts in addition to rigid bodies and the declared friction, against the formulas written out here.
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/error.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/sim/simulator.hpp"
#include "sim/extra_column.hpp"
#include "support/arms.hpp"

namespace heft::sim {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

MatrixXd extras(const data::Log& log, const std::string& name, int n) {
  MatrixXd all(log.time.size(), n);
  for (int i = 0; i < n; ++i) {
    const auto it = std::find_if(log.extra.begin(), log.extra.end(),
                                 [&](const auto& e) { return e.first == name + std::to_string(i + 1); });
    if (it == log.extra.end()) throw std::runtime_error("no column " + name);
    all.col(i) = it->second;
  }
  return all;
}

heft::JointEffect<double> effect(const char* id, int joint, EffectParameters<double> parameters) {
  return {joint_effect_kind(std::string_view(id)), joint, parameters};
}

/// The six-joint arm under PD control along sums of sines, with the smooth sign.
SimulationSettings moving_arm(const model::Robot& robot, double duration) {
  SimulationSettings s;
  s.robot = robot;
  s.duration = duration;
  s.log_rate = 200.0;
  FourierMotion motion;
  motion.q0.resize(6);
  motion.q0 << 0.1, -1.1, 1.1, -0.4, 0.6, 0.0;
  motion.amplitude = MatrixXd::Constant(6, 2, 0.1);
  motion.amplitude.col(0) << 0.4, 0.3, 0.3, 0.5, 0.5, 0.8;
  motion.frequency_hz.resize(6, 2);
  motion.frequency_hz << 0.4, 1.3, 0.45, 1.2, 0.5, 1.1, 0.55, 1.3, 0.6, 1.2, 0.65, 1.1;
  motion.phase = MatrixXd::Zero(6, 2);
  motion.phase.col(1).setLinSpaced(6, 0.3, 2.8);
  s.reference = make_fourier(motion);
  s.initial_position.resize(6);
  s.initial_velocity.resize(6);
  VectorXd qdd(6);
  s.reference->evaluate(0.0, s.initial_position, s.initial_velocity, qdd);
  VectorXd kp(6), kd(6);
  kp << 3000, 3000, 2000, 300, 300, 300;
  kd << 150, 150, 100, 15, 15, 15;
  s.controller = std::make_shared<PdController>(kp, kd, std::make_shared<ForwardDynamics>(robot));
  s.loads = friction_of(robot, SignModel::kSmooth);
  s.solver = {SolverMethod::kBdf, 1e-6, 1e-8};
  s.log_truth = true;
  return s;
}

/// Torque that is left of a log row by row when rigid bodies, rotors and the declared friction are taken off.
MatrixXd undeclared(const data::Log& log, const model::Robot& robot) {
  const model::Dynamics dynamics(robot);
  MatrixXd left(log.tau.rows(), log.tau.cols());
  for (Eigen::Index k = 0; k < left.rows(); ++k) {
    left.row(k) = log.tau.row(k) - dynamics
                                       .inverse_dynamics(log.q.row(k).transpose(), log.qd.row(k).transpose(),
                                                         log.qdd.row(k).transpose())
                                       .transpose();
    for (int i = 0; i < robot.num_joints(); ++i) {
      const JointActuation<double>& a = robot.joints[static_cast<std::size_t>(i)].actuation;
      left(k, i) -= a.rotor_inertia * log.qdd(k, i) + a.coulomb_friction * std::tanh(log.qd(k, i) / 1e-3) +
                    a.viscous_friction * log.qd(k, i);
    }
  }
  return left;
}

// Rounding of torques of 100 N·m through two recursions.
constexpr double kRowTolerance = 1e-8;

TEST(UndeclaredEffects, MotorTorqueExceedsTheDeclaredModelByTheirFormulas) {
  model::Robot robot = test::six_joint_arm();
  robot.effects = {effect("stribeck", 0, {3.0, 0.2}),          effect("offset", 1, {-2.5}),
                   effect("viscous_nonlinear", 2, {1.5, 0.6}), effect("load_friction", 1, {0.12}),
                   effect("rotor_inertia", 3, {0.07}),         effect("spring", 4, {2.0, 0.3}),
                   effect("ripple", 5, {0.5, 12.0, 0.4}),      effect("friction_drift", 2, {0.8, 0.4, 1.5})};
  const data::Log log = simulate(moving_arm(robot, 2.0)).log;
  const MatrixXd left = undeclared(log, robot);
  const model::Dynamics dynamics(robot);
  double moved = 0.0;
  for (Eigen::Index k = 0; k < left.rows(); ++k) {
    const VectorXd q = log.q.row(k), v = log.qd.row(k), a = log.qdd.row(k);
    const VectorXd s = (v / 1e-3).array().tanh();
    const double t = log.time[k];
    const VectorXd load = dynamics.inverse_dynamics(q, v, a);
    EXPECT_NEAR(left(k, 0), 3.0 * std::exp(-v[0] * v[0] / 0.04) * s[0], kRowTolerance);
    EXPECT_NEAR(left(k, 1), -2.5 + 0.12 * std::abs(load[1]) * s[1], kRowTolerance);
    EXPECT_NEAR(left(k, 2),
                1.5 * std::pow(std::abs(v[2]), 0.6) * s[2] +
                    std::exp(-t / 1.5) * (4.0 * 0.8 * s[2] + 1.5 * 0.4 * v[2]),
                kRowTolerance);
    EXPECT_NEAR(left(k, 3), 0.07 * a[3], kRowTolerance);
    EXPECT_NEAR(left(k, 4), 2.0 * (q[4] - 0.3), kRowTolerance);
    EXPECT_NEAR(left(k, 5), 0.5 * std::sin(12.0 * q[5] + 0.4), kRowTolerance);
    moved = std::max(moved, std::abs(left(k, 1) + 2.5));
  }
  EXPECT_GT(moved, 3.0);  // the load friction was there
}

TEST(UndeclaredEffects, HysteresisTurnsTheFrictionOverWithinItsTravel) {
  model::Robot robot = test::six_joint_arm();
  robot.effects = {effect("hysteresis", 0, {0.03})};
  const data::Log log = simulate(moving_arm(robot, 2.5)).log;
  const MatrixXd left = undeclared(log, robot);
  const double coulomb = 5.0, x0 = 0.03;
  double z = 0.0, largest = 0.0;
  for (Eigen::Index k = 0; k < left.rows(); ++k) {
    if (k > 0) {
      // Exact over a step in one direction: z − s decays over the travel.
      const double travel = log.q(k, 0) - log.q(k - 1, 0), s = travel > 0.0 ? 1.0 : -1.0;
      z = s + (z - s) * std::exp(-std::abs(travel) / x0);
    }
    const double expected = coulomb * (z - std::tanh(log.qd(k, 0) / 1e-3));
    // A reversal within a step of 5 ms is known from its ends only: some 1e-4 of travel.
    EXPECT_NEAR(left(k, 0), expected, 2e-2 * coulomb) << log.time[k];
    largest = std::max(largest, std::abs(expected));
  }
  EXPECT_GT(largest, 1.5 * coulomb);
}

TEST(UndeclaredEffects, AsymmetricFrictionLeavesAJointAtRestAlone) {
  const AsymmetricFriction friction(0.7);
  EXPECT_EQ(friction.torque({0.0, 0.0, 0.3, 1.0}, nullptr), 0.7);
  EXPECT_EQ(friction.torque({0.0, 0.0, -0.3, -1.0}, nullptr), 0.7);
  EXPECT_EQ(friction.torque({0.0, 0.0, 0.0, 0.0}, nullptr), 0.0);
  EXPECT_EQ(friction.breakaway({0.0, 0.0, 0.0, 0.0}, 1, nullptr), 0.7);
  EXPECT_EQ(friction.breakaway({0.0, 0.0, 0.0, 0.0}, -1, nullptr), -0.7);
}

TEST(UndeclaredEffects, LoadFrictionFollowsTheLoadThroughItsZeroDespiteTheRotor) {
  // Level rail: the load is m a alone and changes its sign with the torque, before or after the motor's does.
  const double m = 2.0, rotor = 3.0, mu = 0.4;
  SimulationSettings s;
  s.robot = test::slider(m);
  s.robot.joints[0].actuation.rotor_inertia = rotor;
  s.robot.joints[0].actuation.viscous_friction = 5.0;
  s.robot.effects = {effect("load_friction", 0, {mu})};
  s.loads = friction_of(s.robot, SignModel::kSmooth);
  s.solver = {SolverMethod::kBdf, 1e-6, 1e-8};
  s.duration = 1.5;
  s.initial_position = VectorXd::Zero(1);
  s.initial_velocity = VectorXd::Constant(1, 0.5);
  s.torque = [&](double t, Eigen::Ref<VectorXd> torque) { torque[0] = 4.0 * std::sin(9.0 * t); };
  s.log_truth = true;
  const data::Log log = simulate(s).log;
  int backward = 0, forward = 0;
  for (Eigen::Index k = 0; k < log.time.size(); ++k) {
    const double a = log.qdd(k, 0), v = log.qd(k, 0);
    EXPECT_NEAR(log.tau(k, 0), (m + rotor) * a + 5.0 * v + mu * std::abs(m * a) * std::tanh(v / 5e-4), 1e-10);
    EXPECT_NEAR(extra(log, "kinetic_energy")[k], 0.5 * (m + rotor) * v * v, 1e-12);
    (a < 0.0 ? backward : forward) += 1;
  }
  EXPECT_GT(backward, 300);
  EXPECT_GT(forward, 300);
}

TEST(UndeclaredEffects, BlockOnASlopeStartsWhenItsLoadFrictionIsOvercome) {
  // The drive holds m g sin α = L and pulls ever harder: the block starts at τ = L + Fc + μ L, and slips with
  // τ = L + m a + Fc + μ (L + m a).
  const double m = 2.0, slope = 3.0, Fc = 1.0, mu = 0.2, rise = 2.0;
  SimulationSettings s;
  s.robot = test::slider(m);
  s.robot.joints[0].actuation.coulomb_friction = Fc;
  s.robot.effects = {effect("load_friction", 0, {mu})};
  s.loads = friction_of(s.robot);
  s.gravity = Vector3d(-slope, 0.0, -9.0);
  s.duration = 3.0;
  s.initial_position = VectorXd::Zero(1);
  s.torque = [&](double t, Eigen::Ref<VectorXd> torque) { torque[0] = m * slope + rise * t; };
  const SimulationResult result = simulate(s);
  ASSERT_EQ(result.events.size(), 1u);
  EXPECT_EQ(result.events[0].kind, SimulationEvent::Kind::kSlip);
  EXPECT_NEAR(result.events[0].time, (Fc + mu * m * slope) / rise, 1e-8);
  const Eigen::Index last = result.log.time.size() - 1;
  const double passed = m * (slope + result.log.qdd(last, 0));
  EXPECT_GT(result.log.qdd(last, 0), 0.5);
  EXPECT_NEAR(result.log.tau(last, 0), passed * (1.0 + mu) + Fc, 1e-9);
}

TEST(UndeclaredEffects, RefusesEffectsThatDoNotFitTheArm) {
  model::Robot robot = test::slider(1.0);
  robot.effects = {effect("spring", 3, {1.0, 0.0})};
  EXPECT_THROW(friction_of(robot), ModelError);
  EXPECT_THROW(make_joint_effect(effect("rotor_inertia", 0, {1.0}), {}), ModelError);
  EXPECT_THROW(make_joint_effect({kNumJointEffects, 0, {}}, {}), ModelError);
  SimulationSettings s;
  s.initial_position = VectorXd::Zero(1);
  s.robot = test::slider(1.0);
  s.robot.elasticities = {{0, -1.0, 0.0, 1.0}};
  EXPECT_THROW(simulate(s), ModelError);
  s.robot.elasticities = {{0, 1.0, 0.0, 1.0, -0.1}};
  EXPECT_THROW(simulate(s), ModelError);
  s.robot.elasticities = {{0, 1.0, 0.0, 1.0}, {0, 1.0, 0.0, 1.0}};
  EXPECT_THROW(simulate(s), ModelError);
  s.robot.elasticities.clear();
  s.robot.couplings = {{0, 1}};
  EXPECT_THROW(simulate(s), ModelError);
  s.robot.couplings.clear();
  s.robot.effects = {effect("load_friction", 0, {1.0})};
  s.loads = friction_of(s.robot);
  EXPECT_THROW(simulate(s), ModelError);
}

TEST(GearCouplings, SharedMotorTakesItsTorqueFromBothJoints) {
  model::Robot robot = test::six_joint_arm();
  GearCoupling<double> wrist;
  wrist.driving = 4;
  wrist.driven = 5;
  wrist.ratio = -0.8;
  wrist.rotor_inertia = 0.05;
  wrist.coulomb_friction = 0.9;
  wrist.viscous_friction = 0.3;
  GearCoupling<double> other;
  other.driving = 1;
  other.driven = 4;
  other.ratio = 0.5;
  other.rotor_inertia = 0.03;
  robot.couplings = {wrist, other};
  const data::Log log = simulate(moving_arm(robot, 1.5)).log;
  const MatrixXd left = undeclared(log, robot);
  for (Eigen::Index k = 0; k < left.rows(); ++k) {
    const double v = log.qd(k, 5) - 0.8 * log.qd(k, 4), a = log.qdd(k, 5) - 0.8 * log.qdd(k, 4);
    const double T = 0.05 * a + 0.9 * std::tanh(v / 1e-3) + 0.3 * v;
    const double U = 0.03 * (log.qdd(k, 4) + 0.5 * log.qdd(k, 1));
    EXPECT_NEAR(left(k, 5), T, kRowTolerance);
    EXPECT_NEAR(left(k, 4), U - 0.8 * T, kRowTolerance);
    EXPECT_NEAR(left(k, 1), 0.5 * U, kRowTolerance);
    EXPECT_NEAR(left(k, 0), 0.0, kRowTolerance);
  }
}

TEST(Cables, PullAtBothOfTheirJoints) {
  model::Robot robot = test::six_joint_arm();
  robot.cables = {{3, 5, -0.8, 4.0, 0.3}};
  const data::Log log = simulate(moving_arm(robot, 1.0)).log;
  const MatrixXd left = undeclared(log, robot);
  for (Eigen::Index k = 0; k < left.rows(); ++k) {
    const double T = 4.0 * (log.q(k, 5) - 0.8 * log.q(k, 3) - 0.3);
    EXPECT_NEAR(left(k, 5), T, kRowTolerance);
    EXPECT_NEAR(left(k, 3), -0.8 * T, kRowTolerance);
    EXPECT_NEAR(left(k, 4), 0.0, kRowTolerance);
  }
}

TEST(Cables, KeepTheEnergyOfAnArmWithoutFriction) {
  SimulationSettings s;
  s.robot = test::planar_two_link();
  s.robot.cables = {{0, 1, 0.6, 20.0, 0.5}};
  s.duration = 2.0;
  s.initial_position = VectorXd::Zero(2);
  s.log_truth = true;
  const data::Log log = simulate(s).log;
  const auto column = [&](const std::string& name) {
    return std::find_if(log.extra.begin(), log.extra.end(), [&](const auto& e) { return e.first == name; })->second;
  };
  const VectorXd energy = column("kinetic_energy") + column("potential_energy");
  EXPECT_GT(column("kinetic_energy").maxCoeff(), 1.0);
  EXPECT_LT((energy.array() - energy[0]).abs().maxCoeff(), 1e-5);
}

TEST(TorqueDelay, ChannelReportsTheTorqueOfBefore) {
  model::Robot robot = test::six_joint_arm();
  SimulationSettings s = moving_arm(robot, 0.3);
  s.log_rate = 0.0;
  const data::Log prompt = simulate(s).log;
  // Less than a sample, and 3.4 samples.
  for (const int whole : {0, 3}) {
    s.robot.torque_delay = 1e-3 * whole + 4e-4;
    const data::Log late = simulate(s).log;
    EXPECT_EQ(prompt.q, late.q);
    EXPECT_EQ(extras(late, "tau_true", 6), prompt.tau);
    for (Eigen::Index k = whole + 1; k < late.tau.rows(); ++k) {
      // On the line between the two samples around.
      const VectorXd expected = 0.4 * prompt.tau.row(k - whole - 1) + 0.6 * prompt.tau.row(k - whole);
      EXPECT_LT((late.tau.row(k).transpose() - expected).cwiseAbs().maxCoeff(), 1e-9);
    }
    // Before the first sample there is nothing.
    for (Eigen::Index k = 0; k <= whole; ++k) EXPECT_EQ(late.tau.row(k), prompt.tau.row(0));
  }
}

TEST(TorqueDelay, OpenLoopTorqueIsReadFromItsFunction) {
  SimulationSettings s;
  s.robot = test::slider(2.0);
  s.robot.torque_delay = 0.0125;
  s.duration = 0.2;
  s.initial_position = VectorXd::Zero(1);
  s.torque = [](double t, Eigen::Ref<VectorXd> torque) { torque[0] = std::sin(20.0 * t); };
  const data::Log log = simulate(s).log;
  for (Eigen::Index k = 0; k < log.time.size(); ++k) {
    EXPECT_NEAR(log.tau(k, 0), std::sin(20.0 * std::max(0.0, log.time[k] - 0.0125)), 1e-15);
    EXPECT_NEAR(log.qdd(k, 0), std::sin(20.0 * log.time[k]) / 2.0, 1e-12);
  }
}

TEST(ShakingBase, FreeBlockMovesAgainstIt) {
  // Gravity a sin ωt along the rail: q = a/ω (t − sin(ωt)/ω).
  const double a = 2.0, w = 40.0;
  SimulationSettings s;
  s.robot = test::slider(3.0);
  s.duration = 1.0;
  s.initial_position = VectorXd::Zero(1);
  s.gravity_of_time = [&](double t) { return Vector3d(a * std::sin(w * t), 0.0, -9.81); };
  const data::Log log = simulate(s).log;
  for (Eigen::Index k = 0; k < log.time.size(); ++k) {
    const double t = log.time[k];
    EXPECT_NEAR(log.q(k, 0), a / w * (t - std::sin(w * t) / w), 1e-7);
  }
}

TEST(Disturbance, IsATorqueThatTheMotorsBringUp) {
  const model::Robot robot = test::six_joint_arm();
  SimulationSettings s = moving_arm(robot, 0.5);
  s.disturbance = [](double t, const Eigen::Ref<const VectorXd>& q, const Eigen::Ref<const VectorXd>& qd,
                     Eigen::Ref<VectorXd> torque) { torque[2] = 3.0 * qd[0] + q[1] + std::sin(30.0 * t); };
  const data::Log log = simulate(s).log;
  const MatrixXd left = undeclared(log, robot);
  for (Eigen::Index k = 0; k < left.rows(); ++k) {
    EXPECT_NEAR(left(k, 2), 3.0 * log.qd(k, 0) + log.q(k, 1) + std::sin(30.0 * log.time[k]), kRowTolerance);
    EXPECT_NEAR(left(k, 1), 0.0, kRowTolerance);
  }
}

// ------------------------------------------------------------------------------------------- elastic joints

TEST(ElasticJoint, RowsSatisfyTheEquationsOfMotorAndLink) {
  model::Robot robot = test::six_joint_arm();
  robot.joints[1].actuation.rotor_inertia = 0.2;
  const double rotor = 0.2;
  robot.elasticities = {{1, 9000.0, 4.0, 0.9}, {3, 400.0, 0.2, 0.05}};
  robot.effects = {effect("load_friction", 1, {0.1})};
  const data::Log log = simulate(moving_arm(robot, 1.5)).log;
  const MatrixXd x = extras(log, "qlink", 6), xd = extras(log, "qdlink", 6), xdd = extras(log, "qddlink", 6);
  const model::Dynamics dynamics(robot);
  double bend = 0.0;
  for (Eigen::Index k = 0; k < x.rows(); ++k) {
    const VectorXd bodies =
        dynamics.inverse_dynamics(x.row(k).transpose(), xd.row(k).transpose(), xdd.row(k).transpose());
    for (int i = 0; i < 6; ++i) {
      const JointActuation<double>& a = robot.joints[static_cast<std::size_t>(i)].actuation;
      const double friction =
          a.coulomb_friction * std::tanh(log.qd(k, i) / 1e-3) + a.viscous_friction * log.qd(k, i);
      if (i == 1 || i == 3) {
        const Elasticity<double>& e = robot.elasticities[i == 1 ? 0 : 1];
        const double spring = e.stiffness * (log.q(k, i) - x(k, i)) + e.damping * (log.qd(k, i) - xd(k, i));
        EXPECT_NEAR(bodies[i], spring, kRowTolerance);
        const double motor = e.motor_inertia + (i == 1 ? rotor : a.rotor_inertia);
        const double with_load = i == 1 ? 0.1 * std::abs(spring) * std::tanh(log.qd(k, i) / 1e-3) : 0.0;
        EXPECT_NEAR(log.tau(k, i), motor * log.qdd(k, i) + friction + with_load + spring, 10 * kRowTolerance);
        bend = std::max(bend, std::abs(log.q(k, i) - x(k, i)));
      } else {
        EXPECT_EQ(log.q(k, i), x(k, i));
        EXPECT_NEAR(log.tau(k, i), bodies[i] + a.rotor_inertia * log.qdd(k, i) + friction, kRowTolerance);
      }
    }
  }
  EXPECT_GT(bend, 5e-3);
}

TEST(ElasticJoint, FreeSwingKeepsItsEnergyAndDampingTakesIt) {
  model::Robot robot = test::six_joint_arm();
  SimulationSettings s;
  s.robot = robot;
  s.robot.elasticities = {{0, 5000.0, 0.0, 0.8}, {1, 8000.0, 0.0, 0.9}, {4, 300.0, 0.0, 0.04}};
  s.duration = 2.0;
  s.log_rate = 200.0;
  s.initial_position.resize(6);
  s.initial_position << 0.0, -1.0, 0.8, 0.3, 0.5, 0.0;
  s.log_truth = true;
  const auto energy = [&] {
    const data::Log log = simulate(s).log;
    return (extra(log, "kinetic_energy") + extra(log, "potential_energy")).eval();
  };
  const VectorXd kept = energy();
  // The swing turns over tens of joules.
  EXPECT_LT((kept.array() - kept[0]).abs().maxCoeff(), 2e-5);
  for (Elasticity<double>& e : s.robot.elasticities) e.damping = 1.0;
  const VectorXd taken = energy();
  EXPECT_LT(taken[taken.size() - 1], taken[0] - 1e-3);
  for (Eigen::Index k = 1; k < taken.size(); ++k) EXPECT_LT(taken[k], taken[k - 1] + 2e-7);
}

TEST(ElasticJoint, FreeSwingKeepsItsEnergyWithPlay) {
  SimulationSettings s;
  s.robot = test::six_joint_arm();
  s.robot.elasticities = {{1, 8000.0, 0.0, 0.9, 0.02}, {4, 300.0, 0.0, 0.04, 0.03}};
  s.duration = 2.0;
  s.log_rate = 200.0;
  s.initial_position.resize(6);
  s.initial_position << 0.0, -1.0, 0.8, 0.3, 0.5, 0.0;
  s.log_truth = true;
  const data::Log log = simulate(s).log;
  const VectorXd energy = extra(log, "kinetic_energy") + extra(log, "potential_energy");
  EXPECT_LT((energy.array() - energy[0]).abs().maxCoeff(), 2e-4);
  const VectorXd bend = log.q.col(4) - extra(log, "qlink5");
  EXPECT_GT(bend.maxCoeff(), 0.015);
  EXPECT_LT(bend.minCoeff(), -0.015) << "or no flank was left";
}

/// Mean angular frequency with which a series passes its level upwards.
double angular_frequency(const VectorXd& time, const VectorXd& value, double level) {
  double first = -1.0, last = -1.0;
  int turns = 0;
  for (Eigen::Index k = 1; k < value.size(); ++k) {
    if (!(value[k - 1] < level && value[k] >= level)) continue;
    const double at =
        time[k - 1] + (time[k] - time[k - 1]) * (level - value[k - 1]) / (value[k] - value[k - 1]);
    if (first < 0.0) {
      first = at;
    } else {
      last = at;
      ++turns;
    }
  }
  return 2.0 * std::numbers::pi * turns / (last - first);
}

/// Adams and BDF alike.
class ElasticJointBy : public testing::TestWithParam<SolverMethod> {};

TEST_P(ElasticJointBy, RingsAtTheFrequenciesOfTheClosedForm) {
  const double K = 800.0, motor = 0.5, link = 2.0, force = 3.0;
  SimulationSettings s;
  s.solver.method = GetParam();
  s.robot = test::slider(link);
  s.robot.elasticities = {{0, K, 0.0, motor}};
  s.duration = 3.0;
  s.sample_rate = 2000.0;
  s.initial_position = VectorXd::Zero(1);
  s.log_truth = true;
  const auto stretch = [](const data::Log& log) { return (log.q.col(0) - extra(log, "qlink1")).eval(); };

  // A push on the motor of a free arm: stretch F/K · m/(J + m) (1 − cos ωt).
  s.torque = [&](double, Eigen::Ref<VectorXd> torque) { torque[0] = force; };
  data::Log log = simulate(s).log;
  double expected = std::sqrt(K * (1.0 / motor + 1.0 / link));
  EXPECT_NEAR(angular_frequency(log.time, stretch(log), force / K * link / (motor + link)), expected,
              1e-3 * expected);

  // Link held by its mass.
  s.robot = test::slider(1e9);
  s.robot.elasticities = {{0, K, 0.0, motor}};
  log = simulate(s).log;
  expected = std::sqrt(K / motor);
  EXPECT_NEAR(angular_frequency(log.time, log.q.col(0), force / K), expected, 1e-3 * expected);

  // Motor held by friction, link pulled.
  s.robot = test::slider(link);
  s.robot.elasticities = {{0, K, 0.0, motor}};
  s.torque = nullptr;
  s.loads.resize(1);
  s.loads[0].effects = {std::make_shared<CoulombFriction>(100.0, 100.0)};
  s.tool_wrench = [&](double) { return Wrench{Vector3d(force, 0.0, 0.0), Vector3d::Zero()}; };
  const SimulationResult held = simulate(s);
  EXPECT_EQ(held.log.q.col(0).cwiseAbs().maxCoeff(), 0.0);
  EXPECT_TRUE(held.events.empty());
  expected = std::sqrt(K / link);
  EXPECT_NEAR(angular_frequency(held.log.time, -stretch(held.log), force / K), expected, 1e-3 * expected);

  // A pull that friction cannot hold sets the motor in motion.
  s.loads[0].effects = {std::make_shared<CoulombFriction>(4.0, 4.0)};
  const SimulationResult slipped = simulate(s);
  ASSERT_FALSE(slipped.events.empty());
  // K F/K (1 − cos ωt) = 4 N
  EXPECT_NEAR(slipped.events[0].time, std::acos(1.0 - 4.0 / force) / expected, 1e-6);
}

TEST_P(ElasticJointBy, BouncesBetweenTheFlanksOfItsPlay) {
  // A link pushed off while the motor stands still: across the play with v, half a swing at each flank.
  const double K = 2000.0, link = 2.0, force = 2.0, push = 0.05, gap = 0.01;
  SimulationSettings s;
  s.solver.method = GetParam();
  s.robot = test::slider(link);
  s.robot.elasticities = {{0, K, 0.0, 0.5, gap}};
  s.duration = 4.0;
  s.sample_rate = 2000.0;
  s.initial_position = VectorXd::Zero(1);
  s.log_truth = true;
  s.loads.resize(1);
  s.loads[0].effects = {std::make_shared<CoulombFriction>(100.0, 100.0)};
  s.tool_wrench = [&](double t) { return Wrench{Vector3d(t < push ? force : 0.0, 0.0, 0.0), Vector3d::Zero()}; };
  const data::Log log = simulate(s).log;
  const double v = force / link * push;
  const double period = 2.0 * gap / v + 2.0 * std::numbers::pi / std::sqrt(K / link);
  const VectorXd place = extra(log, "qlink1");
  EXPECT_NEAR(angular_frequency(log.time, place, 0.0), 2.0 * std::numbers::pi / period, 2e-3 * 2.0 * std::numbers::pi / period);
  EXPECT_NEAR(place.maxCoeff(), 0.5 * gap + v * std::sqrt(link / K), 1e-5);
}

INSTANTIATE_TEST_SUITE_P(Solvers, ElasticJointBy, testing::Values(SolverMethod::kAdams, SolverMethod::kBdf),
                         [](const auto& method) {
                           return method.param == SolverMethod::kAdams ? "adams" : "bdf";
                         });

TEST(ElasticJoint, TendsToTheRigidOneAsItsStiffnessGrows) {
  model::Robot robot = test::six_joint_arm();
  robot.joints[1].actuation.rotor_inertia = 0.7;
  const auto run = [](const model::Robot& arm) {
    SimulationSettings s = moving_arm(arm, 0.6);
    s.solver.relative_tolerance = 1e-9;
    s.solver.absolute_tolerance = 1e-11;
    return simulate(s).log;
  };
  const data::Log rigid = run(robot);
  std::vector<double> off;
  for (double stiffness : {1e4, 1e5, 1e6}) {
    model::Robot elastic = robot;
    elastic.joints[1].actuation.rotor_inertia = 0.0;
    elastic.elasticities = {{1, stiffness, 1.4 * std::sqrt(stiffness * 0.7), 0.7}};
    const data::Log log = run(elastic);
    off.push_back((log.q - rigid.q).cwiseAbs().maxCoeff());
  }
  // The bend falls with 1/K, what the ringing of the start does with its duration, 1/√K.
  EXPECT_LT(off[1], 0.35 * off[0]);
  EXPECT_LT(off[2], 0.35 * off[1]);
  EXPECT_LT(off[2], 1e-4);
  EXPECT_GT(off[0], 1e-4);
}

TEST(ElasticJoint, StartsAtRestWhereItsSpringHoldsTheArm) {
  SimulationSettings s;
  s.robot = test::pendulum();
  const double K = 40.0, q = 0.7;
  s.robot.elasticities = {{0, K, 0.0, 0.1}};
  s.loads.resize(1);
  s.loads[0].effects = {std::make_shared<CoulombFriction>(50.0, 50.0)};
  s.duration = 0.5;
  s.initial_position = VectorXd::Constant(1, q);
  s.log_truth = true;
  const data::Log log = simulate(s).log;
  // 1 kg at 0.5 m: K (θ − x) = m g l sin x.
  const VectorXd& x = extra(log, "qlink1");
  EXPECT_NEAR(K * (q - x[0]), 9.81 * 0.5 * std::sin(x[0]), 1e-9);
  EXPECT_LT((x.array() - x[0]).abs().maxCoeff(), 1e-8);
}

}  // namespace
}  // namespace heft::sim
