// Moving-horizon estimation on simulated arms whose truth is known: a pendulum in closed form, and a UR5 whose friction
// falls while it warms up, with outliers and gaps in its torque.
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Core>

#include "drifting_log.hpp"
#include "heft/core/estimate/recursive_least_squares.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/identify/moving_horizon.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/model/physical_links.hpp"
#include "heft/model/robot_of.hpp"
#include "heft/report/moving_horizon.hpp"
#include "identify/horizon_window.hpp"
#include "support/arms.hpp"

namespace heft::identify {
namespace {

using bench::DriftingLog;
using bench::DriftingSample;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using ::testing::HasSubstr;

HorizonSample sample_of(const DriftingSample& s) { return {s.time, s.q, s.qd, s.tau}; }

model::Robot cold_ur5() { return model::robot_of(DriftingLog::model(), "ur5"); }

bool is_step(HorizonStatus status) {
  return status == HorizonStatus::kUpdated || status == HorizonStatus::kNotExcited;
}

/// Physically possible as written out here: pseudo-inertia positive definite, friction not negative.
bool is_possible(const HorizonEstimate& estimate) {
  const model::Robot robot = estimate.robot();
  for (const model::RobotJoint& joint : robot.joints) {
    const auto& p = joint.link;
    const double half = 0.5 * (p[kIxx] + p[kIyy] + p[kIzz]);
    Eigen::Matrix4d P;
    P << half - p[kIxx], -p[kIxy], -p[kIxz], p[kMcx],  //
        -p[kIxy], half - p[kIyy], -p[kIyz], p[kMcy],   //
        -p[kIxz], -p[kIyz], half - p[kIzz], p[kMcz],   //
        p[kMcx], p[kMcy], p[kMcz], p[kMass];
    if (!(eigenvalues_of(P)[0] > 0.0)) return false;
    if (!(joint.actuation.coulomb_friction >= 0.0) || !(joint.actuation.viscous_friction >= 0.0))
      return false;
  }
  return true;
}

/// A pendulum's torque written out: link of mass m, centre c along −z, inertia J about the axis y; friction.
struct Pendulum {
  double m{1.0}, c{0.5}, J{0.25}, coulomb{0.4}, viscous{0.2};
  double noise{0.0};
  std::mt19937 random{1};

  HorizonSample at(double t, double period = 0.002) {
    const auto motion = [](double time) {
      return std::array<double, 3>{1.2 * std::sin(1.5 * time) + 0.5 * std::sin(3.1 * time),
                                   1.8 * std::cos(1.5 * time) + 1.55 * std::cos(3.1 * time),
                                   -2.7 * std::sin(1.5 * time) - 4.805 * std::sin(3.1 * time)};
    };
    const auto [q, qd, qdd] = motion(t - 0.5 * period);
    const double sign = qd > 0.0 ? 1.0 : -1.0;
    const double tau = J * qdd + m * 9.81 * c * std::sin(q) + coulomb * sign + viscous * qd +
                       noise * std::normal_distribution<double>()(random);
    const auto [q_now, qd_now, qdd_now] = motion(t);
    return {t, VectorXd::Constant(1, q_now), VectorXd::Constant(1, qd_now), VectorXd::Constant(1, tau)};
  }
};

model::Robot pendulum_prior() {
  model::Robot robot = test::pendulum();
  robot.joints[0].link = test::body(0.7, {0, 0, -0.4}, {0.02, 0, 0.02, 0, 0, 0.01});
  robot.joints[0].actuation = {0.0, 0.2, 0.0, 0.0};  // nothing is known of its viscous friction
  return robot;
}

TEST(Widened, IsTheInformationAfterARandomWalk) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  const MatrixXd W = MatrixXd::NullaryExpr(40, 5, [&] { return normal(random); });
  const VectorXd y = VectorXd::NullaryExpr(40, [&] { return normal(random); });
  regression::TriangularFactor factor(5);
  factor.add(W, y);
  VectorXd walk(5);
  walk << 0.3, 0.0, 0.01, 0.0, 2.0;
  const regression::TriangularFactor wider = widened(factor, walk);
  const MatrixXd one = MatrixXd::Identity(5, 5);
  const MatrixXd covariance = solve_square(W.transpose() * W, one) + MatrixXd(walk.cwiseAbs2().asDiagonal());
  EXPECT_LT((wider.information() - solve_square(covariance, one)).cwiseAbs().maxCoeff(), 1e-10);
  const VectorXd least = least_squares(W, y);
  EXPECT_LT(wider.gradient(least).cwiseAbs().maxCoeff(), 1e-10);
}

TEST(Widened, KeepsSilenceAboutWhatNoRowShows) {
  regression::TriangularFactor factor(2);
  factor.add(MatrixXd::Ones(1, 2), VectorXd::Ones(1));  // the sum alone
  const regression::TriangularFactor wider = widened(factor, VectorXd::Constant(2, 1.0));
  // The sum's variance was 1 and grows by 2; the difference remains unknown.
  EXPECT_LT((wider.information() - MatrixXd::Constant(2, 2, 1.0 / 3.0)).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(MovingHorizon, FindsAPendulumInClosedForm) {
  MovingHorizon horizon(pendulum_prior());
  Pendulum truth;
  truth.noise = 0.02;
  int updates = 0;
  for (int k = 1; k <= 5000; ++k) updates += horizon.push(truth.at(0.002 * k)) == HorizonStatus::kUpdated;
  EXPECT_GE(updates, 60);
  const HorizonEstimate& found = horizon.estimate();
  ASSERT_TRUE(found.usable());
  const model::Robot robot = found.robot();
  // Of a pendulum about y the torque shows m c and the inertia about y; the link frame lies on the axis.
  EXPECT_NEAR(robot.joints[0].link[kMcz], -truth.m * truth.c, 0.005);
  EXPECT_NEAR(robot.joints[0].link[kIyy], truth.J, 0.005);
  EXPECT_NEAR(robot.joints[0].actuation.coulomb_friction, truth.coulomb, 0.02);
  EXPECT_NEAR(robot.joints[0].actuation.viscous_friction, truth.viscous, 0.02);
  EXPECT_TRUE(is_possible(found));
}

TEST(MovingHorizon, FollowsFrictionThatFallsThroughOutliersAndAGap) {
  DriftingLog log({});
  MovingHorizon horizon(cold_ur5());
  const auto arm = DriftingLog::with_tool(0.5);
  double squares = 0.0, mean = 0.0, speed = 0.0, worst = 0.0, worst_viscous = 0.0;
  int count = 0, refused = 0, steps = 0;
  for (double time = 0.0; time < 50.0;) {
    const DriftingSample s = log.next();
    time = s.time;
    const HorizonStatus status = horizon.push(sample_of(s));
    refused += status == HorizonStatus::kNotFinite;
    if (!is_step(status)) continue;
    ++steps;
    const HorizonEstimate& found = horizon.estimate();
    ASSERT_TRUE(is_possible(found)) << time;
    if (time < 6.0) continue;
    for (int j = 0; j < 6; ++j) {
      const JointActuation<double>& cold = arm.actuation[static_cast<std::size_t>(j)];
      const double error = found.value(10 + j) / (cold.coulomb_friction * s.friction) - 1.0;
      const double viscous = found.value(16 + j) / (cold.viscous_friction * s.friction) - 1.0;
      squares += error * error;
      mean += error * s.friction;
      speed += 0.3 / 20.0 * std::exp(-time / 20.0);
      worst = std::max(worst, std::abs(error));
      worst_viscous = std::max(worst_viscous, std::abs(viscous));
      ++count;
    }
  }
  EXPECT_EQ(refused, 250);  // half a second of NaN at 500 Hz
  EXPECT_GE(steps, 450);
  // Friction loses 22 % in this time. Left at the cold arm's, it would be 30 % too large in the end.
  EXPECT_LT(std::sqrt(squares / count), 0.03);
  EXPECT_LT(worst, 0.10);
  EXPECT_LT(worst_viscous, 0.30);
  // Behind by about half the window, 1.5 s, and the filter's 24 ms.
  EXPECT_GT(mean / speed, 0.0);
  EXPECT_LT(mean / speed, 3.0);
  EXPECT_NEAR(horizon.estimate().value(0), arm.links[5][kMass], 0.01);
}

/// A log that an unconstrained fit answers with bodies that cannot exist: a wrist of 19 g, friction of nearly nothing, noise of
/// 30 % of the largest torque.
DriftingLog::Config hard_log(int seed) {
  DriftingLog::Config config;
  config.rate = 100.0;
  config.noise = 0.3;
  config.tool = 0.0;
  config.seed = seed;
  return config;
}

TEST(MovingHorizon, KeepsEveryStepOfAThousandPossibleWhereLeastSquaresDoesNot) {
  model::Robot light = cold_ur5();
  for (double& value : light.joints[5].link) value *= 0.1;
  DriftingLog log(hard_log(1));
  HorizonOptions options;
  options.friction_drift = options.link_drift = 20.0;  // forgets within a second: each window has its say
  MovingHorizon horizon(light, options);

  const model::Dynamics dynamics(light);
  RecursiveLeastSquares<double, 10> plain;
  RecursiveLeastSquares<double, 10>::Record record;
  RecursiveLeastSquares<double, 10>::Row prior{}, variance{};
  variance.fill(1.0);
  ASSERT_EQ(plain.configure({0.995}, prior, variance), Status::kOk);
  VectorXd qd_before = VectorXd::Zero(6);
  int steps = 0, updates = 0, plain_impossible = 0;
  double least_friction = kInfinity;
  while (steps < 1000) {
    const DriftingSample s = log.next();
    const VectorXd qdd = (s.qd - qd_before) * 100.0;
    qd_before = s.qd;
    if (s.tau.allFinite()) {
      // The last link alone, everything else known: the easier task.
      const MatrixXd Y = dynamics.regressor(s.q, s.qd, qdd);
      VectorXd known = dynamics.parameters();
      known.segment<10>(50).setZero();
      const VectorXd left = s.tau - Y * known;
      for (int j = 0; j < 6; ++j) {
        RecursiveLeastSquares<double, 10>::Row row;
        for (int k = 0; k < 10; ++k) row[static_cast<std::size_t>(k)] = Y(j, 50 + k);
        ASSERT_EQ(plain.update(row, left[j], 1.0, record), Status::kOk);
      }
    }
    const HorizonStatus status = horizon.push(sample_of(s));
    if (!is_step(status)) continue;
    ++steps;
    updates += status == HorizonStatus::kUpdated;
    ASSERT_TRUE(is_possible(horizon.estimate())) << "step " << steps;
    for (int i = 10; i < 22; ++i) least_friction = std::min(least_friction, horizon.estimate().value(i));
    ASSERT_GT(horizon.estimate().smallest_eigenvalue, 0.0) << "step " << steps;
    plain_impossible += !model::is_physical(plain.solution());
  }
  EXPECT_EQ(updates, 1000);
  EXPECT_LT(least_friction, 0.01);  // of 0.4 and more: the limit was reached
  EXPECT_GT(plain_impossible, 500);
}

TEST(MovingHorizon, IntervalsHoldTheTruth) {
  int inside = 0, all = 0;
  const auto arm = DriftingLog::with_tool(0.5);
  HorizonOptions options;
  options.friction_drift = 1e-6;  // nothing drifts here
  options.link_drift = 0.0;
  for (int seed = 1; seed <= 12; ++seed) {
    DriftingLog::Config config;
    config.drift = 0.0;
    config.burst = config.gap = kInfinity;
    config.noise = 0.03;
    config.rate = 250.0;
    config.seed = seed;
    DriftingLog log(config);
    MovingHorizon horizon(cold_ur5(), options);
    for (int k = 0; k < 2000; ++k) horizon.push(sample_of(log.next()));
    const HorizonEstimate& found = horizon.estimate();
    for (int i = 0; i < 22; ++i) {
      const std::size_t joint = static_cast<std::size_t>((i - 10) % 6);
      const double truth = i < 10   ? arm.links[5][static_cast<std::size_t>(i)]
                           : i < 16 ? arm.actuation[joint].coulomb_friction
                                    : arm.actuation[joint].viscous_friction;
      if (!found.determined[static_cast<std::size_t>(i)]) continue;
      inside += found.interval(i).contains(truth);
      ++all;
    }
  }
  EXPECT_GT(all, 200);
  // 95 % of about 250; parameters of a run are correlated, so the binomial scatter of 1.4 % is three times that at most.
  EXPECT_GT(inside, 0.90 * all);
  EXPECT_LT(inside, 0.999 * all);
}

TEST(MovingHorizon, StaysWhereItIsWhileTheArmRests) {
  MovingHorizon horizon(pendulum_prior());
  Pendulum truth;
  truth.noise = 0.02;
  double time = 0.0;
  for (int k = 0; k < 3000; ++k) horizon.push(truth.at(time += 0.002));
  // A minute and a half at rest, held by any torque within friction.
  const HorizonEstimate before = horizon.estimate();
  HorizonSample rest = truth.at(time);
  rest.qd.setZero();
  rest.tau[0] += 0.3;
  HorizonStatus last{};
  for (int k = 0; k < 4500; ++k) {
    rest.time = time += 0.02;
    if (const HorizonStatus status = horizon.push(rest); is_step(status)) last = status;
  }
  EXPECT_EQ(last, HorizonStatus::kNotExcited);
  // The window took a few rows more while it came to rest; since then nothing.
  EXPECT_NEAR(horizon.estimate().value(10), before.value(10), 0.3 * before.interval(10).half_width());
  EXPECT_GT(horizon.estimate().std[10], 1.5 * before.std[10]);
  truth.coulomb = 0.3;
  for (int k = 0; k < 3000; ++k) horizon.push(truth.at(time += 0.002));
  EXPECT_NEAR(horizon.estimate().value(10), 0.3, 0.02);
}

TEST(MovingHorizon, RefusesBadSamplesWithoutATrace) {
  MovingHorizon with(pendulum_prior());
  Pendulum truth;
  truth.noise = 0.02;
  for (int k = 1; k <= 2500; ++k) with.push(truth.at(0.002 * k));
  MovingHorizon without = with;
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  for (int k = 2501; k <= 4000; ++k) {
    const HorizonSample good = truth.at(0.002 * k);
    for (const double bad : {kNan, std::numeric_limits<double>::infinity(), 1e300}) {
      HorizonSample sample = good;
      sample.tau[0] = bad;
      ASSERT_EQ(with.push(sample), HorizonStatus::kNotFinite);
      sample = good;
      sample.q[0] = bad;
      ASSERT_EQ(with.push(sample), HorizonStatus::kNotFinite);
    }
    HorizonSample late = good;
    late.time = 0.002 * (k - 1);
    ASSERT_EQ(with.push(late), HorizonStatus::kTimeNotIncreasing);
    ASSERT_EQ(with.push(good), without.push(good));
  }
  EXPECT_EQ(with.estimate().values, without.estimate().values);
  EXPECT_EQ(with.estimate().std, without.estimate().std);
}

TEST(MovingHorizon, AJointThatMovesLaterDoesNotOutweighTheOthers) {
  const model::Robot truth = test::planar_two_link();
  model::Robot prior = truth;
  for (model::RobotJoint& joint : prior.joints) joint.actuation = {0.0, 0.5, 0.5, 0.0};
  MovingHorizon horizon(prior, {});
  const model::Dynamics dynamics(truth);
  std::mt19937 random(2);
  std::normal_distribution<double> noise(0.0, 0.2);
  VectorXd q(2), qd(2), qdd(2);
  for (int k = 1; k <= 2500; ++k) {
    const double t = 0.002 * k, w = 4.0;
    const double since = std::max(0.0, t - 4.0);  // the second joint stands for four seconds
    q << 0.6 * std::sin(w * t), since > 0 ? 0.4 * (1 - std::cos(3.0 * since)) : 0.0;
    qd << 0.6 * w * std::cos(w * t), since > 0 ? 1.2 * std::sin(3.0 * since) : 0.0;
    qdd << -0.6 * w * w * std::sin(w * t), since > 0 ? 3.6 * std::cos(3.0 * since) : 0.0;
    VectorXd tau = dynamics.joint_torque(q, qd, qdd);
    for (double& value : tau) value += noise(random);
    horizon.push({t, q, qd, tau});
    if (!(t > 4.1) || !horizon.estimate().usable()) continue;
    EXPECT_TRUE(horizon.estimate().noise_std[1] == 0.0 || horizon.estimate().noise_std[1] > 1e-3) << t;
    for (int i = 0; i < static_cast<int>(horizon.estimate().unknown.size()); ++i) {
      if (!horizon.estimate().determined[static_cast<std::size_t>(i)]) continue;
      EXPECT_GT(horizon.estimate().interval(i).half_width(), 1e-4) << t << horizon.estimate().name(i);
    }
  }
}

TEST(MovingHorizon, BoundsTheIterationsOfAStep) {
  HorizonOptions options;
  options.max_iterations = 3;
  options.reweightings = 2;
  DriftingLog log({});
  MovingHorizon horizon(cold_ur5(), options);
  int steps = 0, first = 0;
  for (double time = 0.0; time < 12.0;) {
    const DriftingSample s = log.next();
    time = s.time;
    if (!is_step(horizon.push(sample_of(s)))) continue;
    if (++steps == 1) {
      first = horizon.estimate().iterations;
    } else {
      ASSERT_LE(horizon.estimate().iterations, 6);
    }
    ASSERT_TRUE(is_possible(horizon.estimate()));
  }
  EXPECT_GT(steps, 80);
  EXPECT_LE(first, 18);  // the first window has six rounds
  EXPECT_NEAR(horizon.estimate().value(0), DriftingLog::with_tool(0.5).links[5][kMass], 0.03);
}

TEST(MovingHorizon, LiftsBaseParametersToPossibleLinks) {
  const model::Robot truth = test::planar_two_link();
  model::Robot prior = truth;
  for (model::RobotJoint& joint : prior.joints) {
    for (double& value : joint.link) value *= 0.8;
    joint.actuation = {0.0, 0.5, 0.5, 0.0};
  }
  HorizonOptions options;
  options.links = {0, 1};
  MovingHorizon horizon(prior, options);
  const model::Dynamics dynamics(truth);
  for (int k = 1; k <= 2000; ++k) {
    const double t = 0.005 * k;
    VectorXd q(2), qd(2), qdd(2);
    const auto motion = [&](double time) {
      q << std::sin(2.0 * time), 0.8 * std::sin(3.3 * time + 1.0);
      qd << 2.0 * std::cos(2.0 * time), 2.64 * std::cos(3.3 * time + 1.0);
      qdd << -4.0 * std::sin(2.0 * time), -8.712 * std::sin(3.3 * time + 1.0);
    };
    motion(t - 0.0025);
    const VectorXd tau = dynamics.inverse_dynamics(q, qd, qdd) + 0.3 * qd.array().sign().matrix();
    motion(t);
    horizon.push({t, q, qd, tau});
  }
  ASSERT_TRUE(horizon.estimate().usable());
  EXPECT_TRUE(is_possible(horizon.estimate()));
  const model::Dynamics found(horizon.estimate().robot());
  VectorXd q(2);
  q << 0.4, -0.9;
  // The filtered motion costs a few thousandths of the torque, about 40 N·m.
  EXPECT_LT((found.gravity_torque(q) - dynamics.gravity_torque(q)).cwiseAbs().maxCoeff(), 0.15);
  EXPECT_LT((found.mass_matrix(q) - dynamics.mass_matrix(q)).cwiseAbs().maxCoeff(), 0.03);
}

TEST(MovingHorizon, WritesItsModelWithStandardDeviations) {
  MovingHorizon horizon(pendulum_prior());
  EXPECT_FALSE(horizon.estimate().usable());
  Pendulum truth;
  for (int k = 1; k <= 2500; ++k) horizon.push(truth.at(0.002 * k));
  const model::ModelFile file = horizon.estimate().model_file();
  EXPECT_EQ(file.provenance.method, "moving-horizon");
  ASSERT_TRUE(file.standard_deviations.has_value());
  // Ten of the link, then rotor inertia, Coulomb, viscous, offset.
  EXPECT_TRUE(std::isnan((*file.standard_deviations)[10]));
  EXPECT_DOUBLE_EQ((*file.standard_deviations)[11], horizon.estimate().std[10]);
  EXPECT_DOUBLE_EQ(file.actuation[0].coulomb_friction, horizon.estimate().value(10));
}

TEST(MovingHorizon, IsReportedInWordsAndAsJson) {
  MovingHorizon horizon(pendulum_prior());
  EXPECT_EQ(report::brief(horizon.estimate()), "The samples do not determine any parameter yet.");
  EXPECT_THAT(report::json(horizon.estimate()), HasSubstr("\"time\": null"));
  Pendulum truth;
  for (int k = 1; k <= 2500; ++k) horizon.push(truth.at(0.002 * k));
  const HorizonEstimate& found = horizon.estimate();
  const auto determined = std::count(found.determined.begin(), found.determined.end(), true);
  EXPECT_THAT(report::brief(found),
              HasSubstr("determine " + std::to_string(determined) + " of 12 parameters"));
  EXPECT_THAT(report::full(found), HasSubstr("Fc1"));
  EXPECT_THAT(report::full(found), HasSubstr("robot"));  // most of the link is not seen by one joint
  EXPECT_THAT(report::json(found), HasSubstr("\"name\": \"Fv1\""));
  EXPECT_THAT(report::page(found).html(), HasSubstr("Parameters while the arm moves"));
}

TEST(MovingHorizon, SaysWhichSettingIsWrong) {
  const auto message = [](model::Robot robot, const HorizonOptions& options) {
    try {
      const MovingHorizon horizon(robot, options);
    } catch (const ModelError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_THAT(message(pendulum_prior(), {.window = 0.1}),
              HasSubstr("the window is 0.1 s; expected 0.5 to 60 s"));
  EXPECT_THAT(message(pendulum_prior(), {.links = {1}}), HasSubstr("link 1; expected links from 0 to 0"));
  EXPECT_THAT(message(pendulum_prior(), {.max_iterations = 0}), HasSubstr("the number of iterations is 0"));
  model::Robot late = pendulum_prior();
  late.torque_delay = 0.01;
  EXPECT_THAT(message(late, {}), HasSubstr("torque delay"));
  EXPECT_EQ(message(pendulum_prior(), {}), "accepted");
  MovingHorizon horizon(pendulum_prior());
  EXPECT_THROW(horizon.push({1.0, VectorXd::Zero(2), {}, VectorXd::Zero(2)}), ModelError);
}

}  // namespace
}  // namespace heft::identify
