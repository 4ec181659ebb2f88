#include <cmath>
#include <memory>
#include <random>

#include <gtest/gtest.h>

#include "heft/sim/simulator.hpp"
#include "sim/extra_column.hpp"
#include "support/arms.hpp"

namespace heft::sim {
namespace {

using Eigen::VectorXd;

/// A swinging pendulum: motion that no sensor setting can change.
SimulationSettings swinging() {
  SimulationSettings s;
  s.robot = test::pendulum();
  s.duration = 20.0;
  s.initial_position = VectorXd::Constant(1, 1.0);
  s.seed = 42;
  s.log_truth = true;
  return s;
}

double deviation(const VectorXd& error) { return std::sqrt((error.array() - error.mean()).square().mean()); }

TEST(Sensors, ExactByDefault) {
  const data::Log log = simulate(swinging()).log;
  EXPECT_EQ(log.q.col(0), extra(log, "q_true1"));
  EXPECT_EQ(log.qd.col(0), extra(log, "qd_true1"));
  EXPECT_EQ(log.qdd.col(0), extra(log, "qdd_true1"));
  EXPECT_EQ(log.tau.col(0), extra(log, "tau_true1"));
  EXPECT_EQ(log.current.cols(), 0);
}

TEST(Sensors, EncoderReadsWholeSteps) {
  SimulationSettings s = swinging();
  s.sensors.encoder_quantum = VectorXd::Constant(1, 1e-3);
  const data::Log log = simulate(s).log;
  const VectorXd steps = log.q.col(0) / 1e-3;
  EXPECT_LT((steps.array() - steps.array().round()).abs().maxCoeff(), 1e-9);
  EXPECT_LE((log.q.col(0) - extra(log, "q_true1")).cwiseAbs().maxCoeff(), 0.5e-3 + 1e-12);
}

TEST(Sensors, NoiseHasTheStatedDeviation) {
  SimulationSettings s = swinging();
  s.sensors.position_noise = VectorXd::Constant(1, 1e-3);
  s.sensors.velocity_noise = VectorXd::Constant(1, 0.02);
  s.sensors.acceleration_noise = VectorXd::Constant(1, 10.0);
  s.sensors.torque_noise = VectorXd::Constant(1, 0.5);
  const data::Log log = simulate(s).log;
  // Standard error of a deviation from 20000 samples is 0.5 %.
  EXPECT_NEAR(deviation(log.q.col(0) - extra(log, "q_true1")), 1e-3, 0.02e-3);
  EXPECT_NEAR(deviation(log.qd.col(0) - extra(log, "qd_true1")), 0.02, 0.0004);
  EXPECT_NEAR(deviation(log.qdd.col(0) - extra(log, "qdd_true1")), 10.0, 0.2);
  EXPECT_NEAR(deviation(log.tau.col(0) - extra(log, "tau_true1")), 0.5, 0.01);
}

TEST(Sensors, OneSeedGivesOneLogAndAnotherAnother) {
  SimulationSettings s = swinging();
  s.sensors.position_noise = VectorXd::Constant(1, 1e-3);
  s.sensors.sampling_jitter = 1e-4;
  const data::Log a = simulate(s).log, b = simulate(s).log;
  EXPECT_EQ(a.q, b.q);
  EXPECT_EQ(a.time, b.time);
  s.seed = 43;
  EXPECT_NE(simulate(s).log.q, a.q);
}

TEST(Sensors, OneNoiseSwitchedOnLeavesTheOthersAsTheyWere) {
  SimulationSettings s = swinging();
  s.sensors.acceleration_noise = VectorXd::Constant(1, 10.0);
  const data::Log before = simulate(s).log;
  s.sensors.torque_noise = VectorXd::Constant(1, 0.5);
  s.sensors.position_noise = VectorXd::Constant(1, 1e-3);
  EXPECT_EQ(simulate(s).log.qdd, before.qdd);
}

TEST(Sensors, DifferencedVelocityIsTheFilteredDifferenceOfThePositions) {
  SimulationSettings s = swinging();
  s.sensors.encoder_quantum = VectorXd::Constant(1, 1e-4);
  s.sensors.velocity = VelocitySource::kDifferenced;
  s.sensors.velocity_cutoff_hz = 40.0;
  s.sensors.acceleration = AccelerationSource::kDifferenced;
  const data::Log log = simulate(s).log;
  const double share = 1.0 - std::exp(-2.0 * M_PI * 40.0 * 1e-3);
  double velocity = 0.0;
  for (int k = 1; k < log.num_samples(); ++k) {
    const double last = velocity;
    velocity += share * ((log.q(k, 0) - log.q(k - 1, 0)) / (log.time[k] - log.time[k - 1]) - velocity);
    ASSERT_NEAR(log.qd(k, 0), velocity, 1e-10);
    ASSERT_NEAR(log.qdd(k, 0), (velocity - last) / (log.time[k] - log.time[k - 1]), 1e-7);
  }
  EXPECT_LT(deviation(log.qd.col(0) - extra(log, "qd_true1")), 0.1);
}

TEST(Sensors, TorqueIsReportedInStepsAndAsCurrent) {
  SimulationSettings s = swinging();
  s.torque = [](double t, Eigen::Ref<VectorXd> torque) { torque[0] = std::sin(t); };
  s.sensors.torque_quantum = VectorXd::Constant(1, 0.01);
  s.sensors.torque_constant = VectorXd::Constant(1, 12.5);
  const data::Log log = simulate(s).log;
  const VectorXd steps = log.tau.col(0) / 0.01;
  EXPECT_LT((steps.array() - steps.array().round()).abs().maxCoeff(), 1e-9);
  EXPECT_LE((log.tau.col(0) - extra(log, "tau_true1")).cwiseAbs().maxCoeff(), 0.005 + 1e-12);
  EXPECT_LT((12.5 * log.current - log.tau).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(Sensors, JitterMovesTheSamplesAndTheLogSaysWhere) {
  SimulationSettings s = swinging();
  s.duration = 2.0;
  s.solver.relative_tolerance = 1e-11;
  s.solver.absolute_tolerance = 1e-12;
  s.sensors.sampling_jitter = 3e-4;
  const data::Log log = simulate(s).log;
  const VectorXd nominal = VectorXd::LinSpaced(log.num_samples(), 0.0, 2.0);
  const double largest = (log.time - nominal).cwiseAbs().maxCoeff();
  EXPECT_GT(largest, 2e-4);
  EXPECT_LE(largest, 3e-4 + 1e-12);
  // Positions belong to the time in the log: a quadratic through neighbours finds them.
  SimulationSettings fine = s;
  fine.sensors = {};
  fine.sample_rate = 1e4;
  const data::Log truth = simulate(fine).log;
  for (int k = 100; k < 1900; k += 100) {
    const auto row = static_cast<Eigen::Index>(std::lround(log.time[k] * 1e4));
    const double dt = log.time[k] - truth.time[row];
    EXPECT_NEAR(log.q(k, 0), truth.q(row, 0) + dt * truth.qd(row, 0) + 0.5 * dt * dt * truth.qdd(row, 0),
                1e-9);
  }
}

}  // namespace
}  // namespace heft::sim
