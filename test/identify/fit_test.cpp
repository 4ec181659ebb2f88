// Fits of whole models against truth that is known: closed-form motion, torque of the run-time dynamics.
#include <cmath>
#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/error.hpp"
#include "heft/identify/fit.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/fourier_log.hpp"

namespace heft::identify {
namespace {

using test::fourier_log;

model::Robot robot_named(const std::string& name) {
  return urdf::load_urdf(std::string(HEFT_URDF_DIR) + "/" + name + ".urdf");
}

/// Two links about parallel horizontal axes, with friction.
model::Robot small_arm() {
  model::Robot robot;
  robot.name = "small";
  robot.joints.resize(2);
  for (model::RobotJoint& joint : robot.joints) {
    joint.joint.axis = {0.0, 1.0, 0.0};
    // 4 kg, centre of mass 0.2 m out.
    joint.link = {4.0, 0.8, 0.0, 0.0, 0.01, 0.0, 0.22, 0.0, 0.0, 0.22};
    joint.actuation = {0.0, 2.0, 1.0, 0.0};
  }
  robot.joints[1].joint.position = {0.5, 0.0, 0.0};
  return robot;
}

FitOptions quick() {
  FitOptions options;
  options.test_bias = false;
  options.link_parameters = false;
  return options;
}

TEST(Fit, OfALogWithoutNoiseAndFrictionIsExactToABillionth) {
  for (const char* name : {"ur10e", "panda", "scara"}) {
    model::Robot truth = robot_named(name);
    for (model::RobotJoint& joint : truth.joints) joint.actuation = {};
    const data::MotionStream stream(fourier_log(truth, {.seed = 5}));
    model::Robot prior = truth;
    for (model::RobotJoint& joint : prior.joints) {
      for (double& value : joint.link) value *= 1.2;
    }
    FitOptions options;
    options.test_bias = false;
    options.structure.rotor_inertia = options.structure.coulomb = options.structure.viscous =
        options.structure.offset = false;
    options.ridge_from_condition = 0.0;
    const Fit fit = identify::fit(prior, {&stream}, options);
    const Eigen::VectorXd beta = fit.base.regrouping * fit.columns->values(truth);
    EXPECT_LT((fit.beta - beta).cwiseAbs().maxCoeff(), 1e-9) << name << ", condition " << fit.condition;
    // The link parameters, whatever they are, give the torques of another motion.
    const data::Log other = fourier_log(truth, {.duration = 2.0, .rate = 50.0, .seed = 99});
    const model::Dynamics dynamics(fit.robot);
    for (Eigen::Index i = 0; i < other.time.size(); ++i) {
      const Eigen::VectorXd tau = dynamics.joint_torque(
          other.q.row(i).transpose(), other.qd.row(i).transpose(), other.qdd.row(i).transpose());
      ASSERT_LT((tau - other.tau.row(i).transpose()).norm(), 1e-9 * std::max(1.0, other.tau.row(i).norm()))
          << name;
    }
  }
}

TEST(Fit, FindsFrictionRotorAndAGearCoupling) {
  model::Robot truth = robot_named("ur10e");
  double some = 0.3;
  for (model::RobotJoint& joint : truth.joints) {
    joint.actuation = {some, 5.0 * some, 3.0 * some, -some};
    some += 0.1;
  }
  truth.couplings.push_back({4, 5, 1.0, 0.05, 1.5, 0.6});
  const data::MotionStream stream(fourier_log(truth, {.duration = 60.0, .rate = 200.0, .seed = 6}));
  FitOptions options = quick();
  options.structure.couplings.push_back({4, 5, 1.0, 0.0, 0.0, 0.0});
  options.ridge_from_condition = 0.0;
  const Fit fit = identify::fit(truth, {&stream}, options);
  const Eigen::VectorXd beta = fit.base.regrouping * fit.columns->values(truth);
  // Coulomb columns jump: torque and column go through the same filter, so they still match.
  EXPECT_LT((fit.beta - beta).cwiseAbs().maxCoeff(), 1e-7);
}

/// A log of daily work: a move of 1 s, a rest of 0.8 s, and so on. At rest friction holds what it likes, up to its level.
data::Log point_to_point_log(const model::Robot& robot, std::uint64_t seed) {
  constexpr double kRate = 200.0, kMove = 1.0, kRest = 0.8;
  constexpr int kMoves = 20;
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> pose(-1.2, 1.2), part(-1.0, 1.0), encoder(-5e-6, 5e-6);
  const Eigen::Index n = robot.num_joints(), rows_a_move = static_cast<Eigen::Index>((kMove + kRest) * kRate);
  data::Log log;
  log.path = "work.csv";
  log.time = Eigen::VectorXd::LinSpaced(kMoves * rows_a_move, 0.0, kMoves * (kMove + kRest) - 1.0 / kRate);
  log.q.resize(log.time.size(), n);
  log.qd = log.qdd = log.q;
  Eigen::VectorXd from = Eigen::VectorXd::Zero(n), to(n);
  for (int move = 0; move < kMoves; ++move, from = to) {
    for (double& angle : to) angle = pose(random);
    for (Eigen::Index k = 0; k < rows_a_move; ++k) {
      const double u = std::min(1.0, static_cast<double>(k) / (kRate * kMove)), w = u * u;
      const Eigen::Index row = move * rows_a_move + k;
      log.q.row(row) = (from + (to - from) * (w * u * (10.0 - 15.0 * u + 6.0 * w))).transpose();
      log.qd.row(row) = ((to - from) * (30.0 * w * (1.0 - 2.0 * u + w) / kMove)).transpose();
      log.qdd.row(row) = ((to - from) * (60.0 * u * (1.0 - 3.0 * u + 2.0 * w) / (kMove * kMove))).transpose();
    }
  }
  test::put_torque(log, robot);
  for (Eigen::Index j = 0; j < n; ++j) {
    double held = 0.0;
    for (Eigen::Index k = 0; k < log.time.size(); ++k) {
      if (k % rows_a_move == 0) held = part(random) * robot.joints[static_cast<std::size_t>(j)].actuation.coulomb_friction;
      if (k % rows_a_move >= static_cast<Eigen::Index>(kMove * kRate)) log.tau(k, j) += held;
      log.q(k, j) += encoder(random);
    }
  }
  log.qd.resize(0, 0), log.qdd.resize(0, 0);
  return log;
}

TEST(Fit, OfDailyWorkHasTheFrictionOfTheMotion) {
  const model::Robot truth = small_arm();
  const data::MotionStream stream(point_to_point_log(truth, 3));
  const Fit fit = identify::fit(truth, {&stream}, quick());
  int found = 0;
  for (std::size_t k = 0; k < fit.base.kept.size(); ++k) {
    if ((*fit.columns)[fit.base.kept[k]].kind != regression::ColumnKind::kCoulomb) continue;
    EXPECT_NEAR(fit.beta[static_cast<Eigen::Index>(k)], 2.0, 0.05) << "rests are 44 % of the rows";
    ++found;
  }
  EXPECT_EQ(found, 2);
}

TEST(Fit, RefusesALogInWhichNothingMoves) {
  data::Log log = fourier_log(small_arm(), {.duration = 10.0, .amplitude = 0.0});
  const data::MotionStream stream(std::move(log));
  try {
    (void)identify::fit(small_arm(), {&stream}, quick());
    FAIL() << "no refusal";
  } catch (const NotIdentifiableError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("no joint moves"));
    EXPECT_THAT(error.what(), testing::HasSubstr("record a motion"));
  }
}

TEST(Fit, NamesAJointThatNeverMovedAndTheMotionThatIsMissing) {
  data::Log log = fourier_log(small_arm(), {.duration = 30.0, .seed = 2});
  log.q.col(1).setConstant(0.3);
  log.qd.col(1).setZero();
  log.qdd.col(1).setZero();
  test::put_torque(log, small_arm());
  const data::MotionStream stream(std::move(log));
  const Fit fit = identify::fit(small_arm(), {&stream}, quick());
  EXPECT_THAT(fit.missing, testing::Contains(testing::HasSubstr("joint 2 never moved")));
  for (int i = 0; i < fit.base.count(); ++i) {
    const std::string& name = (*fit.columns)[fit.base.kept[static_cast<std::size_t>(i)]].name;
    const bool determined = fit.determined[static_cast<std::size_t>(i)];
    EXPECT_FALSE(determined && (name == "Fc2" || name == "Fv2")) << name;
    EXPECT_TRUE(determined || (name != "Fc1" && name != "Fv1")) << name;
  }
}

TEST(Fit, RefusesALogShorterThanItsUnknowns) {
  data::Log log = fourier_log(robot_named("ur10e"), {.duration = 0.2, .base_frequency = 1.0});
  const data::MotionStream stream(std::move(log));
  try {
    (void)identify::fit(robot_named("ur10e"), {&stream}, quick());
    FAIL() << "no refusal";
  } catch (const DataError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("synthetic.csv: 20 samples for 58 unknowns"));
    EXPECT_THAT(error.what(), testing::HasSubstr("record a longer log"));
  }
}

/// First-order coloured noise with the given correlation time, variance 1.
Eigen::VectorXd coloured(Eigen::Index samples, double period, double correlation, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const double a = std::exp(-period / correlation);
  Eigen::VectorXd e(samples);
  double state = normal(random);
  for (Eigen::Index i = 0; i < samples; ++i) {
    e[i] = state;
    state = a * state + std::sqrt(1.0 - a * a) * normal(random);
  }
  return e;
}

TEST(FitIntervals, CoverTheTruthAsOftenAsTheyClaim) {
  // 500 experiments whose residual is correlated over 0.1 s (joint 1) and 0.25 s (joint 2): intervals that took
  // samples as independent would cover less than half of the time.
  const model::Robot truth = small_arm();
  constexpr int kExperiments = 500;
  long covered = 0, all = 0;
  std::vector<long> each;
  for (int k = 0; k < kExperiments; ++k) {
    std::mt19937_64 random(1000 + static_cast<std::uint64_t>(k));
    data::Log log = fourier_log(truth, {.rate = 50.0, .seed = 77 + static_cast<std::uint64_t>(k % 10)});
    log.tau.col(0) += 1.0 * coloured(log.time.size(), 0.02, 0.10, random);
    log.tau.col(1) += 0.5 * coloured(log.time.size(), 0.02, 0.25, random);
    const data::MotionStream stream(std::move(log));
    const Fit fit = identify::fit(truth, {&stream}, quick());
    const Eigen::VectorXd beta = fit.base.regrouping * fit.columns->values(truth);
    each.resize(static_cast<std::size_t>(beta.size()), 0);
    for (Eigen::Index i = 0; i < beta.size(); ++i) {
      const bool inside = std::abs(fit.beta[i] - beta[i]) <= fit.half_width[i];
      covered += inside ? 1 : 0;
      each[static_cast<std::size_t>(i)] += inside ? 1 : 0;
      ++all;
    }
  }
  const double share = static_cast<double>(covered) / static_cast<double>(all);
  RecordProperty("coverage", std::to_string(share));
  EXPECT_GE(share, 0.93);
  EXPECT_LE(share, 0.97);
  for (std::size_t i = 0; i < each.size(); ++i) {
    EXPECT_GE(static_cast<double>(each[i]) / kExperiments, 0.91) << "parameter " << i;
  }
}

}  // namespace
}  // namespace heft::identify
