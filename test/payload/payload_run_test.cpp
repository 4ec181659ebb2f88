/// The load at the flange, found in logs whose load is known.
#include <array>
#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/error.hpp"
#include "heft/model/at_sensor.hpp"
#include "heft/model/dynamics.hpp"
#include "payload/payload_run.hpp"
#include "payload/recursive_fit.hpp"
#include "support/arms.hpp"
#include "support/synthetic_log.hpp"
#include "support/temporary_folder.hpp"

namespace heft::payload {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const InertialParameters<double> kLoad =
    test::body(1.5, {0.04, 0.11, -0.05}, {0.01, 0.001, 0.008, -0.002, 0.0005, 0.012});

test::SyntheticSettings noisy() {
  test::SyntheticSettings settings;
  settings.noise = 0.01;
  settings.jitter = 0.3;
  return settings;
}

/// Statistics of a model without load, as its fit gives them.
statistics::ResidualStatistics residual_of(const model::Robot& robot, test::SyntheticSettings settings) {
  settings.noise_seed = 1000;
  settings.robot_at = {};
  return fit_recursively(robot, {test::synthetic_log(robot, settings)}).residual;
}

PayloadRun run_on(const model::Robot& arm, const model::Robot& truth, const test::SyntheticSettings& settings,
                  int k = 1) {
  PayloadRunOptions options;
  options.first_joint = k;
  options.residual = residual_of(arm, settings);
  return run_payload(arm, test::synthetic_log(truth, settings), options);
}

void expect_within_interval(const std::vector<Estimated>& estimated, const Eigen::VectorXd& truth,
                            double widths = 2.0) {
  ASSERT_EQ(estimated.size(), static_cast<std::size_t>(truth.size()));
  for (std::size_t i = 0; i < estimated.size(); ++i) {
    EXPECT_TRUE(estimated[i].identifiable) << i;
    EXPECT_NEAR(estimated[i].value, truth[static_cast<Eigen::Index>(i)], widths * estimated[i].half_width())
        << i;
  }
}

TEST(PayloadRun, FindsTheLoadInsideItsInterval) {
  const model::Robot arm = test::six_joint_arm();
  for (const int k : {1, 2, 3, 4}) {
    const PayloadRun run = run_on(arm, test::carrying(arm, kLoad), noisy(), k);
    EXPECT_TRUE(run.mass_visible);
    expect_within_interval({run.mass}, Eigen::VectorXd::Constant(1, 1.5));
    EXPECT_LT(run.mass.half_width(), 0.1) << "k = " << k;
    for (std::size_t i = 0; i < 10; ++i)
      EXPECT_NEAR(run.on_last_link[i], kLoad[i], 0.03) << "k = " << k << ", parameter " << i;
    EXPECT_TRUE(run.changes.empty());
    EXPECT_TRUE(run.missing.empty());
    ASSERT_TRUE(run.converged_at.has_value());
    EXPECT_LT(*run.converged_at, 15.0);
  }
}

TEST(PayloadRun, StatesTheLoadInTheFlangeFrame) {
  // The tip of this arm is 82.3 mm out along y; turned by a quarter about x on top.
  model::Robot arm = test::six_joint_arm();
  arm.tip_rotation = test::roll_pitch_yaw(std::acos(0.0), 0, 0);
  const PayloadRun run = run_on(arm, test::carrying(arm, kLoad), noisy());
  // Link axes to tip axes: x, z, -y. Centre (0.04, 0.11 - 0.0823, -0.05).
  expect_within_interval(run.com, Eigen::Vector3d(0.04, -0.05, -(0.11 - 0.0823)));
  const double y = 0.11 - 0.0823;
  // About the centre of mass in link axes, turned: Ixx, Ixy ← Ixz, Iyy ← Izz, Ixz ← −Ixy, Iyz ← −Iyz, Izz ←
  // Iyy.
  const auto turned = test::body(1.5, {0.04, -0.05, -y}, {0.01, -0.002, 0.012, -0.001, -0.0005, 0.008});
  expect_within_interval(run.inertia, Eigen::Map<const Eigen::VectorXd>(turned.data() + 4, 6));
}

TEST(PayloadRun, FindsNothingWhereThereIsNothing) {
  const model::Robot arm = test::six_joint_arm();
  const PayloadRun run = run_on(arm, arm, noisy());
  expect_within_interval({run.mass}, Eigen::VectorXd::Zero(1));
  EXPECT_FALSE(run.com[0].identifiable) << "no centre of no mass";
  EXPECT_TRUE(std::isnan(run.com[0].value));
}

TEST(PayloadRun, WristRowsTellTheFirstMomentButNotTheMass) {
  const model::Robot arm = test::six_joint_arm();
  const PayloadRun run = run_on(arm, test::carrying(arm, kLoad), noisy(), 5);
  EXPECT_FALSE(run.mass_visible);
  EXPECT_FALSE(run.mass.identifiable);
  EXPECT_TRUE(std::isnan(run.mass.std));
  EXPECT_THAT(run.missing,
              AllOf(HasSubstr("joints 5 to 6 does not depend on the mass"), HasSubstr("--rows")));
  for (std::size_t i = 1; i < 4; ++i) EXPECT_NEAR(run.on_last_link[i], kLoad[i], 0.01);
}

TEST(PayloadRun, TheRecursionEndsWhereTheBlocksDo) {
  // The result comes from block sums, the history from core's recursion: two ways to one estimate.
  const model::Robot arm = test::six_joint_arm();
  const PayloadRun run = run_on(arm, test::carrying(arm, kLoad), noisy());
  EXPECT_NEAR(run.mass_history[run.samples - 1], run.mass.value, 1e-8);
  EXPECT_NEAR(run.mass_history[run.samples - 1], run.on_last_link[0], 1e-8);
}

TEST(PayloadRun, FrictionThatChangedDoesNotPassForLoad) {
  const model::Robot arm = test::six_joint_arm();
  model::Robot warm = test::carrying(arm, kLoad);
  for (auto& joint : warm.joints) {
    joint.actuation.coulomb_friction *= 1.3;
    joint.actuation.viscous_friction *= 0.7;
  }
  const PayloadRun run = run_on(arm, warm, noisy());
  expect_within_interval({run.mass}, Eigen::VectorXd::Constant(1, 1.5));
  for (std::size_t i = 0; i < 6; ++i) {
    const double expected = 0.3 * arm.joints[i].actuation.coulomb_friction;
    EXPECT_NEAR(run.coulomb_change[i].value, expected,
                std::max(0.25 * expected, 2 * run.coulomb_change[i].half_width()))
        << "joint " << i + 1;
  }
}

TEST(PayloadRun, AModelsOwnErrorWidensTheInterval) {
  const model::Robot arm = test::six_joint_arm();
  const test::SyntheticSettings settings = noisy();
  test::SyntheticSettings empty = settings;
  empty.noise_seed = empty.motion_seed = 5;
  const RecursiveFit fit = fit_recursively(arm, {test::synthetic_log(arm, empty)});
  model::Robot fitted = arm;
  model::apply(fit.model, fitted);
  PayloadRunOptions options;
  options.residual = fit.residual;
  const data::Log log = test::synthetic_log(test::carrying(arm, kLoad), settings);
  const PayloadRun without = run_payload(fitted, log, options);
  options.model_covariance = fit.model.covariance;
  const PayloadRun with = run_payload(fitted, log, options);
  EXPECT_DOUBLE_EQ(with.mass.value, without.mass.value);
  EXPECT_EQ(without.mass_std_model, 0.0);
  EXPECT_GT(with.mass_std_model, 0.2 * with.mass_std_residual) << "fitted to one log as long as this one";
  EXPECT_NEAR(with.mass.std, std::hypot(with.mass_std_residual, with.mass_std_model), 1e-12);
  options.zero_mass_std = 0.5;
  EXPECT_NEAR(run_payload(fitted, log, options).mass.std, std::hypot(with.mass.std, 0.5), 1e-12);
  expect_within_interval({with.mass}, Eigen::VectorXd::Constant(1, 1.5));
}

TEST(PayloadRun, SeesALoadTakenUpAndPutDown) {
  const model::Robot arm = test::six_joint_arm();
  const model::Robot loaded = test::carrying(arm, kLoad);
  test::SyntheticSettings settings = noisy();
  settings.duration = 75;
  settings.robot_at = [&](double time) -> const model::Robot& {
    return time < 25 || time > 50 ? arm : loaded;
  };
  const PayloadRun run = run_on(arm, arm, settings);
  ASSERT_EQ(run.changes.size(), 2U);
  EXPECT_NEAR(run.changes[0].time, 25, 0.5);
  EXPECT_NEAR(run.changes[0].mass_before, 0, 0.1);
  EXPECT_NEAR(run.changes[0].mass, 1.5, 0.1);
  EXPECT_NEAR(run.changes[1].time, 50, 0.5);
  EXPECT_NEAR(run.changes[1].mass, 0, 0.1);
  EXPECT_NEAR(run.mass.value, 0, 0.1);
  EXPECT_DOUBLE_EQ(run.load_since, run.changes[1].time);
  ASSERT_TRUE(run.converged_at.has_value());
  EXPECT_GT(*run.converged_at, 50);
}

TEST(PayloadRun, AContactIsNoChangeOfLoad) {
  // Somebody leans on the forearm for a second.
  const model::Robot arm = test::six_joint_arm();
  data::Log log = test::synthetic_log(arm, noisy());
  for (Eigen::Index k = 1500; k < 1600; ++k) log.tau.row(k).head(3).array() += 60.0;
  PayloadRunOptions options;
  options.residual = residual_of(arm, noisy());
  const PayloadRun run = run_payload(arm, log, options);
  EXPECT_TRUE(run.changes.empty());
  expect_within_interval({run.mass}, Eigen::VectorXd::Zero(1));
}

TEST(PayloadRun, ALoadTakenUpAtTheVeryEndIsCalledButNotWeighed) {
  const model::Robot arm = test::six_joint_arm();
  const model::Robot loaded = test::carrying(arm, kLoad);
  test::SyntheticSettings settings = noisy();
  settings.robot_at = [&](double time) -> const model::Robot& { return time < 29 ? arm : loaded; };
  const PayloadRun run = run_on(arm, arm, settings);
  ASSERT_EQ(run.changes.size(), 1U);
  EXPECT_NEAR(run.changes[0].time, 29, 0.5);
  EXPECT_TRUE(std::isnan(run.changes[0].mass));
  EXPECT_FALSE(run.mass.identifiable);
  EXPECT_THAT(run.missing, HasSubstr("after the last change of load"));
}

TEST(PayloadRun, ImplausibleSamplesLeaveNoTrace) {
  const model::Robot arm = test::six_joint_arm();
  const data::Log log = test::synthetic_log(test::carrying(arm, kLoad), noisy());
  PayloadRunOptions options;
  options.residual = residual_of(arm, noisy());
  const PayloadRun clean = run_payload(arm, log, options);
  data::Log spoilt = log;
  spoilt.tau(900, 2) = 1e6;
  spoilt.tau(1200, 4) = std::numeric_limits<double>::quiet_NaN();
  spoilt.q(1500, 1) += 3.0;
  spoilt.qd(1800, 0) = std::numeric_limits<double>::infinity();
  const PayloadRun run = run_payload(arm, spoilt, options);
  EXPECT_EQ(run.left_out, 4);
  EXPECT_EQ(clean.left_out, 0);
  EXPECT_NEAR(run.mass.value, clean.mass.value, 0.002);
  EXPECT_TRUE(run.changes.empty());
}

TEST(PayloadRun, SpikesWithinTheTorqueRangeAreGatedOut) {
  const model::Robot arm = test::six_joint_arm();
  const data::Log log = test::synthetic_log(test::carrying(arm, kLoad), noisy());
  PayloadRunOptions options;
  options.residual = residual_of(arm, noisy());
  data::Log spoilt = log;
  for (Eigen::Index k = 1000; k < 3000; k += 250) spoilt.tau(k, 1) += 700.0;
  const PayloadRun run = run_payload(arm, spoilt, options);
  EXPECT_EQ(run.left_out, 0);
  EXPECT_GT(run.rows_rejected[1], 20);
  EXPECT_TRUE(run.changes.empty());
  expect_within_interval({run.mass}, Eigen::VectorXd::Constant(1, 1.5));
}

TEST(PayloadRun, AGapInTheLogIsBridged) {
  const model::Robot arm = test::six_joint_arm();
  data::Log log = test::synthetic_log(test::carrying(arm, kLoad), noisy());
  const Eigen::Index from = 1200, to = 1800, tail = log.num_samples() - to;
  for (Eigen::MatrixXd data::Log::*channel : {&data::Log::q, &data::Log::qd, &data::Log::tau}) {
    Eigen::MatrixXd kept((log.*channel).rows() - (to - from), 6);
    kept << (log.*channel).topRows(from), (log.*channel).bottomRows(tail);
    log.*channel = kept;
  }
  Eigen::VectorXd time(log.q.rows());
  time << log.time.head(from), log.time.tail(tail);
  log.time = time;
  PayloadRunOptions options;
  options.residual = residual_of(arm, noisy());
  const PayloadRun run = run_payload(arm, log, options);
  expect_within_interval({run.mass}, Eigen::VectorXd::Constant(1, 1.5));
  EXPECT_TRUE(run.changes.empty());
}

TEST(PayloadRun, WorksWithoutVelocitiesAndWithoutStatisticsOfTheModel) {
  const model::Robot arm = test::six_joint_arm();
  test::SyntheticSettings settings = noisy();
  settings.with_velocity = false;
  const PayloadRun run = run_payload(arm, test::synthetic_log(test::carrying(arm, kLoad), settings), {});
  expect_within_interval({run.mass}, Eigen::VectorXd::Constant(1, 1.5));
}

TEST(PayloadRun, TorqueBehindTheGearNeedsNoFriction) {
  model::Robot arm = test::six_joint_arm();
  model::Robot rigid = test::carrying(arm, kLoad);
  for (auto& joint : rigid.joints) joint.actuation = {};
  PayloadRunOptions options;
  options.torque_at_joint = true;
  const PayloadRun run = run_payload(model::at_sensor(arm), test::synthetic_log(rigid, noisy()), options);
  expect_within_interval({run.mass}, Eigen::VectorXd::Constant(1, 1.5));
  EXPECT_NEAR(run.coulomb_change[5].value, 0, 1e-3);
}

TEST(PayloadRun, StandingStillSaysWhatToRecord) {
  const model::Robot arm = test::six_joint_arm();
  test::SyntheticSettings settings = noisy();
  settings.amplitude = 1e-4;
  const PayloadRun run = run_on(arm, test::carrying(arm, kLoad), settings);
  EXPECT_FALSE(run.mass.identifiable);
  EXPECT_EQ(run.rows_used.sum(), 0);
  EXPECT_EQ(run.on_last_link[0], 0.0);
  EXPECT_THAT(run.missing, AllOf(HasSubstr("does not move"), HasSubstr("record a motion")));
  EXPECT_FALSE(run.converged_at.has_value());
}

TEST(PayloadRun, OneMovingJointDoesNotTellTheMass) {
  const model::Robot arm = test::six_joint_arm();
  const model::Robot loaded = test::carrying(arm, kLoad);
  data::Log log = test::synthetic_log(loaded, noisy());
  const model::Dynamics dynamics(loaded);
  for (Eigen::Index k = 0; k < log.num_samples(); ++k) {
    for (const Eigen::Index i : {0, 2, 3, 4, 5}) {
      log.q(k, i) = 0.3;
      log.qd(k, i) = 0.0;
    }
    log.tau.row(k) = dynamics.joint_torque(log.q.row(k), log.qd.row(k), Eigen::VectorXd::Zero(6));
  }
  PayloadRunOptions options;
  options.residual = residual_of(arm, noisy());
  const PayloadRun run = run_payload(arm, log, options);
  EXPECT_FALSE(run.mass.identifiable);
  EXPECT_THAT(run.missing,
              AllOf(HasSubstr("joints 1, 3, 4, 5, 6 at rest"), HasSubstr("joint 2 moving alone")));
}

TEST(PayloadRun, WorksOnOtherArms) {
  for (const model::Robot& arm : {test::planar_two_link(), test::scara_arm()}) {
    const auto load = test::body(0.8, {0.05, 0.0, 0.1}, {0.002, 0, 0.002, 0, 0, 0.002});
    const PayloadRun run = run_on(arm, test::carrying(arm, load), noisy());
    expect_within_interval({run.mass}, Eigen::VectorXd::Constant(1, 0.8));
  }
}

TEST(PayloadRun, RefusesRowsTheArmDoesNotHave) {
  const model::Robot arm = test::six_joint_arm();
  const data::Log log = test::synthetic_log(arm, {});
  for (const int k : {0, 7, -1}) {
    PayloadRunOptions options;
    options.first_joint = k;
    EXPECT_THAT(test::message_of<DataError>([&] { run_payload(arm, log, options); }),
                HasSubstr("expected 1 to 6"));
  }
  EXPECT_THAT(test::message_of<DataError>([&] { run_payload(test::scara_arm(), log, {}); }),
              HasSubstr("expected 4 of each"));
  data::Log bare = log;
  bare.tau.resize(0, 0);
  EXPECT_THAT(test::message_of<DataError>([&] { run_payload(arm, bare, {}); }), HasSubstr("0 torques"));
}

}  // namespace
}  // namespace heft::payload
