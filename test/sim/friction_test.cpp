// Coulomb friction with true sticking, against closed forms.
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "heft/sim/simulator.hpp"
#include "sim/extra_column.hpp"
#include "support/arms.hpp"

namespace heft::sim {
namespace {

using Eigen::VectorXd;

/// Spring whose far end moves at a constant speed.
class DraggedSpring : public JointEffect {
 public:
  DraggedSpring(double stiffness, double speed) : stiffness_(stiffness), speed_(speed) {}
  double torque(const JointPoint& p, const double*) const override {
    return -stiffness_ * (speed_ * p.time - p.position);
  }

 private:
  double stiffness_, speed_;
};

class Torque : public Controller {
 public:
  explicit Torque(VectorXd torque) : torque_(std::move(torque)) {}
  void control(double, const Measurement&, Eigen::Ref<VectorXd> torque) override { torque = torque_; }

 private:
  VectorXd torque_;
};

SimulationSettings at_rest(const model::Robot& robot, double duration) {
  SimulationSettings s;
  s.robot = robot;
  s.duration = duration;
  s.initial_position = VectorXd::Zero(robot.num_joints());
  s.loads.resize(static_cast<std::size_t>(robot.num_joints()));
  s.log_truth = true;
  return s;
}

std::shared_ptr<const JointEffect> dry(double coulomb, double breakaway) {
  return std::make_shared<CoulombFriction>(coulomb, breakaway);
}

TEST(Friction, BlockOnADraggedSpringSticksAndSlipsAtTheTimesOfTheClosedForm) {
  // Extension y of the spring: rises at V while the block sticks, until k y = Fs. Slipping,
  // y − Fc/k = A cos ωτ + (V/ω) sin ωτ with A = (Fs − Fc)/k; the block stops after
  // ωτ = 2 (π − atan(A ω / V)) with y − Fc/k = −A, and sticks for 2 A / V.
  const double m = 2.0, k = 50.0, V = 0.1, Fc = 3.0, Fs = 5.0;
  SimulationSettings s = at_rest(test::slider(m), 30.0);
  s.loads[0].effects = {dry(Fc, Fs), std::make_shared<DraggedSpring>(k, V)};
  s.solver.relative_tolerance = 1e-10;
  s.solver.absolute_tolerance = 1e-12;
  const double w = std::sqrt(k / m), A = (Fs - Fc) / k;
  const double slipping = 2.0 * (std::numbers::pi - std::atan(A * w / V)) / w, sticking = 2.0 * A / V;
  std::vector<double> expected;
  for (double t = Fs / (k * V);; t += sticking) {
    if (t > s.duration) break;
    expected.push_back(t);
    t += slipping;
    if (t > s.duration) break;
    expected.push_back(t);
  }
  ASSERT_GT(expected.size(), 30u);

  for (double rate : {10.0, 1000.0}) {
    s.sample_rate = rate;
    const SimulationResult result = simulate(s);
    ASSERT_EQ(result.events.size(), expected.size()) << "at " << rate << " Hz";
    for (std::size_t i = 0; i < expected.size(); ++i) {
      EXPECT_NEAR(result.events[i].time, expected[i], 1e-7) << "event " << i;
      EXPECT_EQ(result.events[i].kind,
                i % 2 == 0 ? SimulationEvent::Kind::kSlip : SimulationEvent::Kind::kStick);
    }
  }
}

TEST(Friction, AThrownBlockStopsWhereCoulombFrictionStopsItAndStays) {
  const double m = 2.0, Fc = 3.0, v0 = 1.5;
  SimulationSettings s = at_rest(test::slider(m), 3.0);
  s.loads[0].effects = {dry(Fc, Fc)};
  s.initial_velocity = VectorXd::Constant(1, v0);
  const SimulationResult result = simulate(s);
  ASSERT_EQ(result.events.size(), 1u);
  EXPECT_NEAR(result.events[0].time, m * v0 / Fc, 1e-9);
  const double stop = result.log.q(3000, 0);
  EXPECT_NEAR(stop, 0.5 * m * v0 * v0 / Fc, 1e-9);
  EXPECT_EQ(result.log.q(1001, 0), stop);
  EXPECT_EQ(result.log.qd(1001, 0), 0.0);
}

TEST(Friction, StickingHoldsAPendulumAgainstGravityWithoutCreep) {
  SimulationSettings s = at_rest(test::pendulum(), 10.0);
  s.initial_position[0] = 1.1;
  const double load = 0.5 * 9.81 * std::sin(1.1);
  s.loads[0].effects = {dry(0.8 * load, 1.02 * load)};
  const SimulationResult free = simulate(s);
  EXPECT_TRUE((free.log.q.array() == 1.1).all());
  EXPECT_TRUE(free.events.empty());
  EXPECT_NEAR(extra(free.log, "friction_true1")[5000], -load, 1e-12);
  // The same under a controller that holds its torque from sample to sample.
  s.controller = std::make_shared<Torque>(VectorXd::Constant(1, 0.01));
  const SimulationResult held = simulate(s);
  EXPECT_TRUE((held.log.q.array() == 1.1).all());
}

TEST(Friction, APendulumBeyondItsBreakAwayLevelFalls) {
  SimulationSettings s = at_rest(test::pendulum(), 1.0);
  s.initial_position[0] = 1.1;
  const double load = 0.5 * 9.81 * std::sin(1.1);
  s.loads[0].effects = {dry(0.8 * load, 0.98 * load)};
  const SimulationResult result = simulate(s);
  EXPECT_NEAR(result.log.qdd(0, 0), -0.2 * load / 0.25, 1e-10);
  EXPECT_LT(result.log.q(1000, 0), 1.0);
}

TEST(Friction, SmoothSignCreepsAtTheSpeedOfItsFormula) {
  // Constant load F below Fc on a block: Fc tanh(v/ε) = F.
  const double F = 2.0, Fc = 3.0, epsilon = 1e-3;
  SimulationSettings s = at_rest(test::slider(2.0), 1.0);
  s.loads[0].sign = SignModel::kSmooth;
  s.loads[0].smooth_speed = epsilon;
  s.loads[0].effects = {dry(Fc, Fc)};
  s.solver.method = SolverMethod::kBdf;
  s.controller = std::make_shared<Torque>(VectorXd::Constant(1, F));
  EXPECT_NEAR(simulate(s).log.qd(1000, 0), epsilon * std::atanh(F / Fc), 1e-10);
}

TEST(Friction, TwoStuckJointsStartOneAfterTheOther) {
  // Horizontal two-link arm, stretched out. Joint 1 is loaded by a torque that grows, joint 2 only by the
  // reaction M12 q̈1, which it holds until that passes its level. Rounding aside q2 = 0, so no centrifugal term.
  model::Robot robot = test::planar_two_link();
  robot.gravity = {0.0, 0.0, 0.0};
  const double far = 0.02 + 1.5 * 0.25 * 0.25, coupling = 1.5 * 0.5 * 0.25;
  const double M11 = 0.03 + 2.0 * 0.04 + 1.5 * 0.25 + far + 2.0 * coupling, M12 = far + coupling;
  const double Fs1 = 2.5, Fc1 = 2.0, Fs2 = 1.0, Fc2 = 0.8, rate = 4.0;
  SimulationSettings s = at_rest(robot, 2.0);
  s.loads[0].effects = {dry(Fc1, Fs1)};
  s.loads[1].effects = {dry(Fc2, Fs2)};
  s.torque = [rate](double t, Eigen::Ref<VectorXd> torque) { torque[0] = rate * t; };
  const SimulationResult result = simulate(s);
  ASSERT_GE(result.events.size(), 2u);
  EXPECT_EQ(result.events[0].joint, 0);
  EXPECT_EQ(result.events[0].kind, SimulationEvent::Kind::kSlip);
  EXPECT_NEAR(result.events[0].time, Fs1 / rate, 1e-7);
  EXPECT_EQ(result.events[1].joint, 1);
  EXPECT_EQ(result.events[1].kind, SimulationEvent::Kind::kSlip);
  EXPECT_NEAR(result.events[1].time, (Fc1 + Fs2 * M11 / M12) / rate, 1e-6);
  // The reaction throws joint 2 backwards.
  const auto after = static_cast<Eigen::Index>(result.events[1].time * 1000.0) + 20;
  EXPECT_LT(result.log.qd(after, 1), 0.0);
  EXPECT_EQ(result.log.q(static_cast<Eigen::Index>(result.events[1].time * 1000.0), 1), 0.0);
}

TEST(Friction, AllSixJointsStuckCarryTheArmExactly) {
  SimulationSettings s = at_rest(test::six_joint_arm(), 10.0);
  s.initial_position << 0.3, -0.8, 0.9, 0.4, -0.5, 0.2;
  const ForwardDynamics dynamics(s.robot);
  const VectorXd gravity = dynamics.gravity_torque(s.initial_position);
  for (std::size_t i = 0; i < 6; ++i) s.loads[i].effects = {dry(70.0, 70.0)};
  ASSERT_LT(gravity.cwiseAbs().maxCoeff(), 70.0);
  s.sample_rate = 100.0;
  const SimulationResult result = simulate(s);
  EXPECT_TRUE(result.events.empty());
  for (int i = 0; i < 6; ++i) {
    EXPECT_TRUE((result.log.q.col(i).array() == s.initial_position[i]).all()) << "joint " << i + 1;
    EXPECT_NEAR(extra(result.log, "friction_true" + std::to_string(i + 1))[500], -gravity[i], 1e-11);
  }
}

TEST(Friction, AccelerationsFromRestSatisfyCoulombsLawOnEveryJoint) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  for (const model::Robot& robot : {test::planar_two_link(), test::scara_arm(), test::six_joint_arm()}) {
    const int n = robot.num_joints();
    int stuck = 0, slipping = 0;
    for (int draw = 0; draw < 500; ++draw) {
      SimulationSettings s = at_rest(robot, 0.001);
      s.gravity = Eigen::Vector3d(3.0 * u(random), 3.0 * u(random), -9.81);
      VectorXd torque(n), level(n);
      for (int i = 0; i < n; ++i) {
        s.initial_position[i] = 2.0 * u(random);
        level[i] = 5.0 + 4.9 * u(random);
        torque[i] = 15.0 * u(random);
        s.loads[static_cast<std::size_t>(i)].effects = {dry(level[i], level[i])};
      }
      s.controller = std::make_shared<Torque>(torque);
      const data::Log log = simulate(s).log;
      for (int i = 0; i < n; ++i) {
        const double friction = extra(log, "friction_true" + std::to_string(i + 1))[0];
        if (log.qdd(0, i) == 0.0) {
          EXPECT_LE(std::abs(friction), level[i] * (1.0 + 2e-9))
              << robot.name << " draw " << draw << " joint " << i + 1;
          ++stuck;
        } else {
          EXPECT_EQ(friction, std::copysign(level[i], log.qdd(0, i)))
              << robot.name << " draw " << draw << " joint " << i + 1;
          ++slipping;
        }
      }
    }
    EXPECT_GT(stuck, 50) << robot.name;
    EXPECT_GT(slipping, 50) << robot.name;
  }
}

TEST(Friction, AControlledJointComesToRestWithoutChatter) {
  // Position control stops short of its target where the spring of the controller no longer breaks away.
  SimulationSettings s = at_rest(test::pendulum(), 10.0);
  s.reference = make_hold(VectorXd::Constant(1, 0.4));
  s.loads[0].effects = {dry(0.3, 0.4), std::make_shared<ViscousFriction>(0.05, 0.0)};
  s.controller = std::make_shared<PdController>(VectorXd::Constant(1, 20.0), VectorXd::Constant(1, 0.5),
                                                std::make_shared<ForwardDynamics>(s.robot));
  const SimulationResult result = simulate(s);
  EXPECT_LT(result.events.size(), 40u);
  ASSERT_FALSE(result.events.empty());
  EXPECT_EQ(result.events.back().kind, SimulationEvent::Kind::kStick);
  EXPECT_LT(result.events.back().time, 5.0);
  EXPECT_EQ(result.log.q(10000, 0), result.log.q(6000, 0));
  EXPECT_LE(std::abs(20.0 * (0.4 - result.log.q(10000, 0))), 0.4 * (1.0 + 1e-9));
}

TEST(Friction, AReversalUnderLoadPassesStandstillWithOneSwitch) {
  // Thrown up a slope steeper than friction: it turns at once.
  SimulationSettings s = at_rest(test::slider(1.0), 1.0);
  s.gravity = Eigen::Vector3d(-5.0, 0.0, -8.0);
  s.loads[0].effects = {dry(2.0, 2.5)};
  s.initial_velocity = VectorXd::Constant(1, 1.0);
  const SimulationResult result = simulate(s);
  ASSERT_EQ(result.events.size(), 1u);
  EXPECT_EQ(result.events[0].kind, SimulationEvent::Kind::kSlip);
  EXPECT_NEAR(result.events[0].time, 1.0 / 7.0, 1e-9);
  EXPECT_NEAR(result.log.qd(1000, 0), -3.0 * (1.0 - 1.0 / 7.0), 1e-8);
}

}  // namespace
}  // namespace heft::sim
