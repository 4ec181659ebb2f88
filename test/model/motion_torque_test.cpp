/// Torque along a motion: every effect against its formula, elastic joints against a finely integrated arm written
/// down here, the delay against a ramp.
#include "heft/model/motion_torque.hpp"

#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/error.hpp"
#include "support/arms.hpp"
#include "support/random_arm.hpp"
#include "support/temporary_folder.hpp"

namespace heft::model {
namespace {

using ::testing::HasSubstr;

struct Motion {
  Eigen::VectorXd time;
  Eigen::MatrixXd q, qd, qdd;
};

/// Two joints that start gently from rest at 0.3 and -0.4 rad and reverse several times.
void swing_at(double t, Eigen::Vector2d& q, Eigen::Vector2d& qd, Eigen::Vector2d& qdd) {
  for (int j = 0; j < 2; ++j) {
    // A sin³(w t): position, velocity and acceleration are 0 at the start.
    const double a = j == 0 ? 0.8 : -0.6, w = j == 0 ? 2.0 : 3.1, from = j == 0 ? 0.3 : -0.4;
    const double s = std::sin(w * t), c = std::cos(w * t);
    q[j] = from + a * s * s * s;
    qd[j] = 3 * a * w * s * s * c;
    qdd[j] = 3 * a * w * w * (2 * s * c * c - s * s * s);
  }
}

Motion swing(Eigen::Index rows, double rate) {
  Motion m{Eigen::VectorXd(rows), Eigen::MatrixXd(rows, 2), Eigen::MatrixXd(rows, 2),
           Eigen::MatrixXd(rows, 2)};
  for (Eigen::Index k = 0; k < rows; ++k) {
    m.time[k] = static_cast<double>(k) / rate;
    Eigen::Vector2d q, qd, qdd;
    swing_at(m.time[k], q, qd, qdd);
    m.q.row(k) = q, m.qd.row(k) = qd, m.qdd.row(k) = qdd;
  }
  return m;
}

Robot arm_with_friction() {
  Robot robot = test::planar_two_link();
  robot.joints[0].actuation = {0.2, 1.5, 0.7, 0.1};
  robot.joints[1].actuation = {0.05, 0.8, 0.3, -0.2};
  return robot;
}

template <typename Effect>
JointEffect<double> effect_of(int joint, EffectParameters<double> parameters) {
  return {joint_effect_kind<Effect>(), joint, parameters};
}

/// Torque of the robot with the effect less that without it, at the effect's joint.
template <typename Effect>
Eigen::VectorXd added(const Motion& m, EffectParameters<double> parameters, double sign_width = 0.0) {
  const Robot plain = arm_with_friction();
  Robot robot = plain;
  robot.effects = {effect_of<Effect>(1, parameters)};
  const Eigen::MatrixXd difference = MotionTorque(robot).torque(m.time, m.q, m.qd, m.qdd, sign_width) -
                                     MotionTorque(plain).torque(m.time, m.q, m.qd, m.qdd, sign_width);
  EXPECT_EQ(difference.col(0).cwiseAbs().maxCoeff(), 0.0) << "an effect of joint 2 moved joint 1";
  return difference.col(1);
}

double sign(double v) { return (v > 0) - (v < 0); }

TEST(MotionTorque, IsTheTorqueOfEachInstantWithoutMemory) {
  Robot robot = arm_with_friction();
  robot.couplings = {{0, 1, 0.5, 0.01, 0.2, 0.1}};
  const Motion m = swing(40, 20.0);
  MotionTorque motion(robot);
  const Eigen::MatrixXd torque = motion.torque(m.time, m.q, m.qd, m.qdd, 0.01);
  const Dynamics dynamics(robot);
  for (Eigen::Index k = 0; k < m.time.size(); ++k) {
    EXPECT_EQ(torque.row(k), dynamics.joint_torque(m.q.row(k), m.qd.row(k), m.qdd.row(k), 0.01).transpose());
  }
  EXPECT_EQ(motion.link_q(), m.q);
  EXPECT_EQ(motion.link_qdd(), m.qdd);
}

TEST(MotionTorque, AddsEveryEffectByItsFormula) {
  const Motion m = swing(200, 50.0);
  const Eigen::VectorXd offset = added<Offset>(m, {0.7}), inertia = added<RotorInertia>(m, {0.3}),
                        cubic = added<ViscousNonlinear>(m, {0.2, 3.0}),
                        stribeck = added<Stribeck>(m, {1.1, 0.4}), gear = added<LoadFriction>(m, {0.15}),
                        spring = added<Spring>(m, {2.0, 0.25}),
                        drift = added<FrictionDrift>(m, {0.5, 0.4, 3.0}),
                        ripple = added<Ripple>(m, {0.9, 6.0, 0.4});
  const Dynamics rigid(arm_with_friction());
  const double Fc = 0.8, Fv = 0.3;
  for (Eigen::Index k = 0; k < m.time.size(); ++k) {
    const double t = m.time[k], q = m.q(k, 1), v = m.qd(k, 1), a = m.qdd(k, 1);
    const double load = rigid.inverse_dynamics(m.q.row(k), m.qd.row(k), m.qdd.row(k))[1];
    constexpr double kRounding = 1e-12;
    EXPECT_NEAR(offset[k], 0.7, kRounding);
    EXPECT_NEAR(inertia[k], 0.3 * a, kRounding);
    EXPECT_NEAR(cubic[k], 0.2 * v * v * v, kRounding);
    EXPECT_NEAR(stribeck[k], 1.1 * std::exp(-v * v / 0.16) * sign(v), kRounding);
    EXPECT_NEAR(gear[k], 0.15 * std::abs(load) * sign(v), kRounding);
    EXPECT_NEAR(spring[k], 2.0 * (q - 0.25), kRounding);
    EXPECT_NEAR(drift[k], std::exp(-t / 3.0) * (0.5 * Fc * sign(v) + 0.4 * Fv * v), kRounding);
    EXPECT_NEAR(ripple[k], 0.9 * std::sin(6.0 * q + 0.4), kRounding);
  }
}

TEST(MotionTorque, FollowsTheTemperatureOfAJointRowByRow) {
  const Motion m = swing(100, 50.0);
  Robot robot = arm_with_friction();
  Eigen::MatrixXd temperature(m.time.size(), 2);
  for (Eigen::Index k = 0; k < m.time.size(); ++k) temperature.row(k) << 99.0, 20.0 + 0.2 * static_cast<double>(k);
  temperature(7, 1) = std::nan("");
  robot.effects = {effect_of<FrictionTemperature>(1, {-0.04, -0.02, 25.0})};
  const Eigen::MatrixXd torque = MotionTorque(robot).torque(m.time, m.q, m.qd, m.qdd, 0.0, {}, temperature),
                        plain = MotionTorque(arm_with_friction()).torque(m.time, m.q, m.qd, m.qdd);
  EXPECT_EQ(MotionTorque(robot).torque(m.time, m.q, m.qd, m.qdd), plain);  // not known: as at T0
  for (Eigen::Index k = 0; k < m.time.size(); ++k) {
    const double v = m.qd(k, 1), warmer = k == 7 ? 0.0 : temperature(k, 1) - 25.0;
    EXPECT_NEAR(torque(k, 1) - plain(k, 1), (-0.04 * sign(v) - 0.02 * v) * warmer, 1e-12) << k;
    EXPECT_EQ(torque(k, 0), plain(k, 0));
  }
}

TEST(MotionTorque, ACablePullsAtBothOfItsJoints) {
  const Motion m = swing(100, 50.0);
  Robot robot = arm_with_friction();
  robot.cables = {{0, 1, -0.7, 5.0, 0.2, {-0.1, 0.15}}};
  const Eigen::MatrixXd pull = MotionTorque(robot).torque(m.time, m.q, m.qd, m.qdd) -
                               MotionTorque(arm_with_friction()).torque(m.time, m.q, m.qd, m.qdd);
  int held = 0;
  for (Eigen::Index k = 0; k < m.time.size(); ++k) {
    const double x = m.q(k, 1) - 0.7 * m.q(k, 0), within = std::clamp(x, -0.1, 0.15);
    held += x != within ? 1 : 0;
    EXPECT_NEAR(pull(k, 1), 5.0 * (within - 0.2), 1e-12) << k;
    EXPECT_NEAR(pull(k, 0), -0.7 * 5.0 * (within - 0.2), 1e-12) << k;
    const Eigen::VectorXd q = m.q.row(k), qd = m.qd.row(k), qdd = m.qdd.row(k);
    EXPECT_NEAR(Dynamics(robot).joint_torque(q, qd, qdd)[1] -
                    Dynamics(arm_with_friction()).joint_torque(q, qd, qdd)[1],
                pull(k, 1), 1e-12);
  }
  EXPECT_GT(held, 0);
  EXPECT_LT(held, 100);
  robot.cables[0].driven = 0;
  EXPECT_THROW(MotionTorque{robot}, ModelError);
  robot.cables[0] = {0, 1, 1.0, -5.0};
  EXPECT_THROW(MotionTorque{robot}, ModelError);
}

TEST(Dynamics, AddsWhatOneInstantDetermines) {
  const Motion m = swing(20, 10.0);
  Robot robot = arm_with_friction();
  robot.effects = {effect_of<Stribeck>(0, {1.1, 0.4}), effect_of<LoadFriction>(1, {0.15})};
  Robot more = robot;  // the rest needs more than an instant
  more.effects.push_back(effect_of<Hysteresis>(1, {0.05}));
  more.elasticities = {{0, 500.0, 1.0, 0.25}};
  more.torque_delay = 0.01;
  const Eigen::MatrixXd torque = MotionTorque(robot).torque(m.time, m.q, m.qd, m.qdd, 0.01);
  for (Eigen::Index k = 0; k < m.time.size(); ++k) {
    const Eigen::VectorXd q = m.q.row(k), qd = m.qd.row(k), qdd = m.qdd.row(k);
    EXPECT_LT((Dynamics(robot).joint_torque(q, qd, qdd, 0.01) - torque.row(k).transpose()).norm(), 1e-12);
    const Eigen::Vector2d rest = Dynamics(more).joint_torque(q, qd, qdd, 0.01) - torque.row(k).transpose();
    EXPECT_NEAR(rest[0], 0.25 * qdd[0], 1e-12);
    EXPECT_NEAR(rest[1], 0.0, 1e-12);
  }
}

TEST(MotionTorque, CarriesHysteresisThroughReversals) {
  // There and back in two strokes: z = 1 - e^{-s/x0}, then from there towards -1.
  Motion m{Eigen::VectorXd::LinSpaced(5, 0.0, 0.4), Eigen::MatrixXd::Zero(5, 2), Eigen::MatrixXd::Zero(5, 2),
           Eigen::MatrixXd::Zero(5, 2)};
  m.q.col(1) << 0.0, 0.02, 0.05, 0.04, 0.01;
  m.qd.col(1) << 0.1, 0.2, 0.1, -0.1, -0.2;
  const double x0 = 0.03, Fc = 0.8;
  const Eigen::VectorXd more = added<Hysteresis>(m, {x0});
  const double top = 1 - std::exp(-0.05 / x0);
  const std::vector<double> z{0.0, 1 - std::exp(-0.02 / x0), top, -1 + (top + 1) * std::exp(-0.01 / x0),
                              -1 + (top + 1) * std::exp(-0.04 / x0)};
  for (Eigen::Index k = 0; k < 5; ++k) {
    EXPECT_NEAR(more[k], Fc * (z[static_cast<std::size_t>(k)] - sign(m.qd(k, 1))), 1e-12);
  }
}

TEST(MotionTorque, MemoryGoesByTheDisplacementThatItNames) {
  // The low-passed position says that the joint rests; what was measured shows a small reversal.
  const Eigen::Index rows = 6;
  const Motion m{Eigen::VectorXd::LinSpaced(rows, 0.0, 0.5), Eigen::MatrixXd::Zero(rows, 2),
                 Eigen::MatrixXd::Zero(rows, 2), Eigen::MatrixXd::Zero(rows, 2)};
  Eigen::MatrixXd measured = Eigen::MatrixXd::Zero(rows, 4);  // of both joints by velocity, then held
  measured.col(1) << 0.0, 1e-4, 2e-4, -2e-4, 1e-4, 0.0;
  measured.col(3) << 0.0, 2e-4, 1e-4, -1e-4, 0.0, 3e-4;
  const double x0 = 2e-4, Fc = 0.8;
  const Robot plain = arm_with_friction();
  Robot robot = plain;
  robot.effects = {effect_of<Hysteresis>(1, {x0})};
  const Eigen::MatrixXd without = MotionTorque(plain).torque(m.time, m.q, m.qd, m.qdd);
  const Eigen::MatrixXd by_position = MotionTorque(robot).torque(m.time, m.q, m.qd, m.qdd, 0.0, measured);
  EXPECT_EQ(by_position, without);
  Eigen::MatrixXd torque;
  for (const auto& [displacement, column] :
       {std::pair{Displacement::kVelocity, 1}, std::pair{Displacement::kMeasured, 3}}) {
    robot.effects[0].displacement = displacement;
    torque = MotionTorque(robot).torque(m.time, m.q, m.qd, m.qdd, 0.0, measured);
    double z = 0.0;
    for (Eigen::Index k = 0; k < rows; ++k) {
      const double step = measured(k, column);
      z = sign(step) + (z - sign(step)) * std::exp(-std::abs(step) / x0);
      EXPECT_NEAR(torque(k, 1) - without(k, 1), Fc * z, 1e-12) << k;
    }
  }
  // In pieces the same.
  MotionTorque pieces(robot);
  for (const Eigen::Index k : {0, 3}) {
    EXPECT_EQ(pieces.torque(m.time.segment(k, 3), m.q.middleRows(k, 3), m.qd.middleRows(k, 3),
                            m.qdd.middleRows(k, 3), 0.0, measured.middleRows(k, 3)),
              torque.middleRows(k, 3));
  }
  // A log without velocities leaves the position.
  EXPECT_EQ(MotionTorque(robot).torque(m.time, m.q, m.qd, m.qdd), by_position);
}

/// The second joint rests for 0.6 s and then moves on at 0.2 rad/s.
Motion standing_at_first() {
  const Eigen::Index rows = 100;
  Motion m{Eigen::VectorXd::LinSpaced(rows, 0.0, 0.99), Eigen::MatrixXd::Zero(rows, 2),
           Eigen::MatrixXd::Zero(rows, 2), Eigen::MatrixXd::Zero(rows, 2)};
  for (Eigen::Index k = 60; k < rows; ++k) {
    m.q(k, 1) = 0.002 * static_cast<double>(k - 59);
    m.qd(k, 1) = 0.2;
  }
  return m;
}

TEST(MotionTorque, BeginsWhereFrictionIsSeenToHold) {
  // A joint rests for 0.6 s, held by 0.7 of what can hold it, and then moves on: z = 1 - (1 - 0.7) e^{-s/x0}.
  const double x0 = 0.03, Fc = 0.8, sharp = 0.25, z0 = 0.7;
  Robot robot = arm_with_friction();
  Motion m = standing_at_first();
  const Eigen::Index rows = m.time.size();
  Eigen::MatrixXd measured = MotionTorque(robot).torque(m.time, m.q, m.qd, m.qdd);
  for (Eigen::Index k = 0; k < rows; ++k) {
    const double z = 1 - (1 - z0) * std::exp(-m.q(k, 1) / x0);
    measured(k, 1) += Fc * (1 - sharp) * (z - sign(m.qd(k, 1)));
  }
  robot.effects = {effect_of<Hysteresis>(1, {x0, sharp})};
  MotionTorque motion(robot);
  motion.start_from(m.time, m.q, m.qd, m.qdd, measured);
  EXPECT_LT((motion.torque(m.time, m.q, m.qd, m.qdd) - measured).cwiseAbs().maxCoeff(), 1e-12);
  // Without it the first rows miss what holds the joint; a joint that moves at once reveals nothing.
  motion.reset();
  EXPECT_NEAR((measured - motion.torque(m.time, m.q, m.qd, m.qdd))(0, 1), Fc * (1 - sharp) * z0, 1e-12);
  m.qd.col(1).setConstant(0.2);
  motion.start_from(m.time, m.q, m.qd, m.qdd, measured);
  const Eigen::MatrixXd moving = motion.torque(m.time, m.q, m.qd, m.qdd);
  motion.reset();
  EXPECT_EQ(moving, motion.torque(m.time, m.q, m.qd, m.qdd));
}

TEST(MotionTorque, BeginsWithTwoDistancesThatHoldTogether) {
  // Half of the friction turns over within x1, a quarter within x2, the rest at once: at rest both memories hold with
  // the same part of what they can.
  const double x1 = 0.01, x2 = 0.05, Fc = 0.8, z0 = -0.6;
  Robot robot = arm_with_friction();
  const Motion m = standing_at_first();
  const Eigen::Index rows = m.time.size();
  Eigen::MatrixXd measured = MotionTorque(robot).torque(m.time, m.q, m.qd, m.qdd);
  for (Eigen::Index k = 0; k < rows; ++k) {
    for (const auto& [x, part] : {std::pair(x1, 0.5), std::pair(x2, 0.25)}) {
      measured(k, 1) += Fc * part * (1 - (1 - z0) * std::exp(-m.q(k, 1) / x) - sign(m.qd(k, 1)));
    }
  }
  robot.effects = {effect_of<Hysteresis>(1, {x1, 0.5}), effect_of<Hysteresis>(1, {x2, 0.75})};
  MotionTorque motion(robot);
  motion.start_from(m.time, m.q, m.qd, m.qdd, measured);
  EXPECT_LT((motion.torque(m.time, m.q, m.qd, m.qdd) - measured).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(MotionTorque, BeginsWhereFrictionIsSeenToHoldThoughThePositionIsNoisy) {
  // As above; the position as logged wanders by two thirds of x0 while the joint rests, the velocity does not.
  const double x0 = 0.03, Fc = 0.8, z0 = 0.7;
  Robot robot = arm_with_friction();
  const Eigen::Index rows = 60;
  Motion m{Eigen::VectorXd::LinSpaced(rows, 0.0, 0.59), Eigen::MatrixXd::Zero(rows, 2),
           Eigen::MatrixXd::Zero(rows, 2), Eigen::MatrixXd::Zero(rows, 2)};
  Eigen::MatrixXd held = MotionTorque(robot).torque(m.time, m.q, m.qd, m.qdd);
  held.col(1).array() += Fc * z0;
  robot.effects = {effect_of<Hysteresis>(1, {x0, 0.0})};
  robot.effects[0].displacement = heft::Displacement::kVelocity;
  for (Eigen::Index k = 20; k < 40; ++k) m.q(k, 1) = 0.02;
  // The second joint of this arm feels gravity's change with its position.
  held += MotionTorque(arm_with_friction()).torque(m.time, m.q, m.qd, m.qdd) -
          MotionTorque(arm_with_friction()).torque(m.time, 0.0 * m.q, m.qd, m.qdd);
  MotionTorque motion(robot);
  motion.start_from(m.time, m.q, m.qd, m.qdd, held);
  const Eigen::MatrixXd stands = Eigen::MatrixXd::Zero(rows, heft::kMeasuredDisplacements * 2);
  EXPECT_LT((motion.torque(m.time, m.q, m.qd, m.qdd, 0.0, stands) - held).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(MotionTorque, SmoothsTheSignOfEffectsLikeThatOfFriction) {
  const Motion m = swing(50, 50.0);
  const double width = 2.0;
  const Eigen::VectorXd stribeck = added<Stribeck>(m, {1.1, 0.4}, width);
  for (Eigen::Index k = 0; k < m.time.size(); ++k) {
    const double v = m.qd(k, 1);
    EXPECT_NEAR(stribeck[k], 1.1 * std::exp(-v * v / 0.16) * velocity_sign(v, width), 1e-12);
  }
}

/// Equations of planar_two_link written out: M(q) q̈ + b(q, q̇) = τ.
Eigen::Matrix2d mass_of(const Eigen::Vector2d& q) {
  const double c = std::cos(q[1]);
  const double m11 = 0.03 + 2.0 * 0.04 + 0.02 + 1.5 * (0.25 + 0.0625 + 2 * 0.5 * 0.25 * c);
  const double m12 = 0.02 + 1.5 * (0.0625 + 0.5 * 0.25 * c);
  return (Eigen::Matrix2d() << m11, m12, m12, 0.02 + 1.5 * 0.0625).finished();
}
Eigen::Vector2d bias_of(const Eigen::Vector2d& q, const Eigen::Vector2d& v) {
  const double h = 1.5 * 0.5 * 0.25 * std::sin(q[1]), g = 9.81;
  const double far = 1.5 * 0.25 * g * std::cos(q[0] + q[1]);
  return {-h * (2 * v[0] * v[1] + v[1] * v[1]) + (2.0 * 0.2 + 1.5 * 0.5) * g * std::cos(q[0]) + far,
          h * v[0] * v[0] + far};
}

/// Links on springs: x of the elastic joints integrated in fine steps, motors along `swing`.
struct ElasticArm {
  Eigen::Vector2d K, D, gap;  // K = 0: the joint is rigid
  Eigen::Vector2d x, v;
  double time{0.0};

  /// Torque on the link side and link acceleration at an instant.
  Eigen::Vector2d torque(double t, const Eigen::Vector2d& link, const Eigen::Vector2d& rate,
                         Eigen::Vector2d& acceleration) const {
    Eigen::Vector2d q, qd, qdd;
    swing_at(t, q, qd, qdd);
    Eigen::Vector2d where = q, speed = qd;
    for (int j = 0; j < 2; ++j) {
      if (K[j] > 0) where[j] = link[j], speed[j] = rate[j];
    }
    const Eigen::Matrix2d M = mass_of(where);
    const Eigen::Vector2d b = bias_of(where, speed);
    Eigen::Vector2d tau;
    for (int j = 0; j < 2; ++j) {
      // Flanks of the teeth that do not touch pass nothing on.
      const double bend = q[j] - where[j], play = 0.5 * gap[j];
      tau[j] = play > 0 && std::abs(bend) <= play ? 0.0
                                                  : K[j] * (bend - (bend > 0 ? play : -play)) + D[j] * (qd[j] - speed[j]);
    }
    acceleration = qdd;
    if (K[0] > 0 && K[1] > 0) {
      acceleration = M.inverse() * (tau - b);
    } else if (K[0] > 0) {
      acceleration[0] = (tau[0] - b[0] - M(0, 1) * qdd[1]) / M(0, 0);
      tau[1] = (M * acceleration + b)[1];
    } else {
      acceleration[1] = (tau[1] - b[1] - M(1, 0) * qdd[0]) / M(1, 1);
      tau[0] = (M * acceleration + b)[0];
    }
    return tau;
  }
  void start() {
    Eigen::Vector2d qd, qdd;
    swing_at(0.0, x, qd, qdd);
    v.setZero();
    const Eigen::Vector2d motor = x;
    for (int round = 0; round < 60; ++round) {
      const Eigen::Vector2d b = bias_of(x, v);
      for (int j = 0; j < 2; ++j) {
        if (K[j] > 0) x[j] = motor[j] - b[j] / K[j] - (b[j] > 0 ? 0.5 : -0.5) * gap[j];
      }
    }
  }
  void advance(double to) {
    constexpr double kStep = 1e-4;
    const int steps = std::max(1, static_cast<int>(std::ceil((to - time) / kStep)));
    const double h = (to - time) / steps;
    for (int k = 0; k < steps; ++k) {
      Eigen::Vector2d a1, a2, a3, a4;
      torque(time, x, v, a1);
      torque(time + h / 2, x + h / 2 * v, v + h / 2 * a1, a2);
      torque(time + h / 2, x + h / 2 * (v + h / 2 * a1), v + h / 2 * a2, a3);
      torque(time + h, x + h * (v + h / 2 * a2), v + h * a3, a4);
      x += h * v + h * h / 6 * (a1 + a2 + a3);
      v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
      time += h;
    }
  }
};

/// Largest difference between MotionTorque and the finely integrated arm, against the largest torque of the joint.
double elastic_error(const Eigen::Vector2d& K, const Eigen::Vector2d& D, double rate,
                     const Eigen::Vector2d& gap = Eigen::Vector2d::Zero()) {
  const Motion m = swing(static_cast<Eigen::Index>(2.5 * rate), rate);
  Robot robot = arm_with_friction();
  for (int j = 0; j < 2; ++j) {
    if (K[j] > 0) robot.elasticities.push_back({j, K[j], D[j], 0.4, gap[j]});
  }
  MotionTorque motion(robot);
  const Eigen::MatrixXd torque = motion.torque(m.time, m.q, m.qd, m.qdd, 0.05);
  ElasticArm truth{K, D, gap, {}, {}};
  truth.start();
  double error = 0, deflection = 0;
  for (Eigen::Index k = 0; k < m.time.size(); ++k) {
    truth.advance(m.time[k]);
    Eigen::Vector2d acceleration;
    Eigen::Vector2d expected = truth.torque(m.time[k], truth.x, truth.v, acceleration);
    for (int j = 0; j < 2; ++j) {
      const auto& actuation = robot.joints[static_cast<std::size_t>(j)].actuation;
      expected[j] += friction_torque(actuation, m.qd(k, j), 0.05) +
                     (actuation.rotor_inertia + (K[j] > 0 ? 0.4 : 0.0)) * m.qdd(k, j);
      if (K[j] > 0) {
        EXPECT_NEAR(motion.link_q()(k, j), truth.x[j], 2e-4);
        deflection = std::max(deflection, std::abs(m.q(k, j) - truth.x[j]));
      }
    }
    error = std::max(error, (torque.row(k).transpose() - expected).cwiseAbs().maxCoeff());
  }
  EXPECT_GT(deflection, 1e-3);  // or the test says nothing
  return error / torque.cwiseAbs().maxCoeff();
}

TEST(MotionTorque, IntegratesElasticJoints) {
  // Straight lines between rows: an error of second order in the interval.
  EXPECT_LT(elastic_error({900, 0}, {4, 0}, 500), 1e-4);
  EXPECT_LT(elastic_error({0, 300}, {0, 0.3}, 500), 1e-4);
  EXPECT_LT(elastic_error({2000, 500}, {4, 0.4}, 500), 1e-4);
  EXPECT_LT(elastic_error({2000, 500}, {4, 0.4}, 2000), 1e-5);
}

TEST(MotionTorque, CrossesThePlayOfGears) {
  // Flanks meet between rows, where the torque bends, and with a damper jumps.
  EXPECT_LT(elastic_error({900, 0}, {4, 0}, 2000, {0.01, 0}), 3e-3);
  EXPECT_LT(elastic_error({0, 300}, {0, 0.3}, 2000, {0, 0.02}), 3e-3);
  EXPECT_LT(elastic_error({2000, 500}, {4, 0.4}, 2000, {0.01, 0.02}), 3e-3);
}

TEST(MotionTorque, StiffJointsAreRigidWithTheMotorsInertia) {
  const Motion m = swing(100, 100.0);
  Robot rigid = arm_with_friction();
  Robot robot = rigid;
  robot.elasticities = {{0, 1e12, 0.0, 0.25}};
  rigid.joints[0].actuation.rotor_inertia += 0.25;
  const Eigen::MatrixXd a = MotionTorque(robot).torque(m.time, m.q, m.qd, m.qdd),
                        b = MotionTorque(rigid).torque(m.time, m.q, m.qd, m.qdd);
  EXPECT_LT((a - b).cwiseAbs().maxCoeff(), 1e-7);
}

TEST(MotionTorque, ReadsADelayedChannelEarlier) {
  // Constant acceleration of the outer joint alone at q1 = π/2, no gravity: τ2 = (I + I_a) a + F_v a t.
  Robot robot = arm_with_friction();
  robot.gravity = {0, 0, 0};
  robot.joints[1].actuation = {0.0, 0.0, 0.5, 0.0};
  robot.torque_delay = 0.013;
  const double a = 0.4;
  const Eigen::Index rows = 21;
  Motion m{Eigen::VectorXd::LinSpaced(rows, 0.0, 0.2), Eigen::MatrixXd::Zero(rows, 2),
           Eigen::MatrixXd::Zero(rows, 2), Eigen::MatrixXd::Zero(rows, 2)};
  for (Eigen::Index k = 0; k < rows; ++k) {
    m.q(k, 1) = 0.5 * a * m.time[k] * m.time[k], m.qd(k, 1) = a * m.time[k], m.qdd(k, 1) = a;
  }
  const Eigen::MatrixXd torque = MotionTorque(robot).torque(m.time, m.q, m.qd, m.qdd);
  const double inertia = 0.02 + 1.5 * 0.0625;
  for (Eigen::Index k = 0; k < rows; ++k) {
    const double at = std::max(0.0, m.time[k] - 0.013);
    EXPECT_NEAR(torque(k, 1), inertia * a + 0.5 * a * at, 1e-12);
  }
}

Robot with_everything() {
  Robot robot = arm_with_friction();
  robot.effects = {effect_of<Hysteresis>(0, {0.05}), effect_of<FrictionDrift>(1, {0.5, 0.4, 3.0}),
                   effect_of<Ripple>(1, {0.9, 6.0, 0.4})};
  robot.elasticities = {{1, 300.0, 0.3, 0.1}};
  robot.torque_delay = 0.0047;
  return robot;
}

TEST(MotionTorque, TakesAMotionInPieces) {
  const Motion m = swing(500, 250.0);
  MotionTorque motion(with_everything());
  const Eigen::MatrixXd whole = motion.torque(m.time, m.q, m.qd, m.qdd, 0.01);
  MotionTorque again(with_everything());
  Eigen::MatrixXd pieces(500, 2);
  for (const auto& [from, count] :
       std::vector<std::pair<Eigen::Index, Eigen::Index>>{{0, 123}, {123, 1}, {124, 376}}) {
    pieces.middleRows(from, count) =
        again.torque(m.time.segment(from, count), m.q.middleRows(from, count), m.qd.middleRows(from, count),
                     m.qdd.middleRows(from, count), 0.01);
  }
  EXPECT_EQ((whole - pieces).cwiseAbs().maxCoeff(), 0.0);
  motion.reset();
  EXPECT_EQ(motion.torque(m.time, m.q, m.qd, m.qdd, 0.01), whole);
}

TEST(MotionTorque, ComesToRestAcrossAGap) {
  Motion m = swing(500, 250.0);
  m.time.tail(250).array() += 100.0;
  MotionTorque motion(with_everything());
  const Eigen::MatrixXd torque = motion.torque(m.time, m.q, m.qd, m.qdd, 0.01);
  EXPECT_TRUE(torque.allFinite());
  EXPECT_LT(torque.cwiseAbs().maxCoeff(), 100.0);
}

TEST(MotionTorque, RefusesImpossibleElasticitiesAndEffects) {
  const auto message = [](const std::function<void(Robot&)>& change) {
    Robot robot = arm_with_friction();
    change(robot);
    return test::message_of<ModelError>([&] { MotionTorque motion(robot); });
  };
  EXPECT_THAT(message([](Robot& r) {
                r.elasticities = {{2, 100.0, 0.0, 0.0}};
              }),
              HasSubstr("elasticity of joint 3; expected a joint from 1 to 2"));
  EXPECT_THAT(message([](Robot& r) {
                r.elasticities = {{1, 9.0, 0.0, 0.0}, {1, 8.0, 0.0, 0.0}};
              }),
              HasSubstr("two elasticities of joint 2"));
  EXPECT_THAT(message([](Robot& r) {
                r.elasticities = {{1, 0.0, 0.0, 0.0}};
              }),
              HasSubstr("stiffness 0 of joint 2"));
  EXPECT_THAT(message([](Robot& r) {
                r.elasticities = {{1, 9.0, 0.0, 0.0, -0.01}};
              }),
              HasSubstr("play -0.01 of joint 2; expected 0 or more"));
  EXPECT_THAT(message([](Robot& r) { r.effects = {effect_of<Offset>(-1, {1.0})}; }),
              HasSubstr("effect of joint 0"));
  EXPECT_THAT(message([](Robot& r) { r.effects = {{99, 0, {}}}; }), HasSubstr("effect of kind 99"));
  EXPECT_THAT(message([](Robot& r) { r.torque_delay = -0.001; }), HasSubstr("torque delay -0.001 s"));
}

}  // namespace
}  // namespace heft::model
