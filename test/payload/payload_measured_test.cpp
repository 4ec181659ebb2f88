/// The load on measured logs of a UR10e: 2.805 kg, and none.
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/data/log.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "payload/payload_run.hpp"
#include "payload/recursive_fit.hpp"
#include "support/measured_data.hpp"

namespace heft::payload {
namespace {

using ::testing::HasSubstr;

constexpr double kMass = 2.805;
/// What the torque constants are uncertain by, in mass: they differ by up to 3 % from joint to joint.
constexpr double kTorqueScale = 0.02 * kMass;

class MeasuredUr10e : public ::testing::Test {
 protected:
  void SetUp() override { HEFT_NEEDS_MEASURED_DATA(folder()); }
  static std::string folder() { return HEFT_DATA_DIR "/ur10e-dynamic-calibration"; }
  static model::Robot robot() { return urdf::load_urdf(folder() + "/robot.urdf"); }
  static data::Log log(const std::string& name) {
    data::LogRequirements needs;
    needs.num_joints = 6;
    needs.torque = true;
    return data::read_log(folder() + "/" + name + ".csv", needs);
  }

  /// Load found on a log by the model of another one.
  static PayloadRun run(const std::string& name, int k = 1, const std::string& baseline = "exc-12h-50s") {
    const RecursiveFit fit = fit_recursively(robot(), {log(baseline)});
    model::Robot arm = robot();
    model::apply(fit.model, arm);
    PayloadRunOptions options;
    options.first_joint = k;
    options.residual = fit.residual;
    options.model_covariance = fit.model.covariance;
    return run_payload(arm, log(name), options);
  }
};

TEST_F(MeasuredUr10e, WeighsTheKnownLoad) {
  for (const int k : {1, 2, 3, 4}) {
    const PayloadRun found = run("exc-14h-50s-load2p805kg", k);
    ASSERT_TRUE(found.mass.identifiable);
    EXPECT_NEAR(found.mass.value, kMass, 0.05 * kMass) << "k = " << k;
    EXPECT_NEAR(found.mass.value, kMass, found.mass.half_width() + kTorqueScale) << "k = " << k;
    EXPECT_LT(found.mass.half_width(), 0.1) << "k = " << k;
    EXPECT_TRUE(found.changes.empty());
  }
}

TEST_F(MeasuredUr10e, WeighsTheKnownLoadWhateverItsModelWasFittedTo) {
  for (const char* baseline : {"exc-8h-20s", "exc-10h-20s", "exc-12h-40s", "exc-14h-50s", "ptp-10-points"}) {
    const PayloadRun found = run("exc-14h-50s-load2p805kg", 1, baseline);
    EXPECT_NEAR(found.mass.value, kMass, found.mass.half_width() + kTorqueScale) << baseline;
    EXPECT_NEAR(found.mass.value, kMass, 0.03 * kMass) << baseline;
    EXPECT_LT(found.mass.half_width(), 0.12) << baseline;
  }
}

// The torque is current times constants that are 1 to 6 % off against the controller's own target torque, joint by joint.
TEST_F(MeasuredUr10e, WithTheScaleOfItsTorqueTheMassIsRightWhicheverJointsAreAsked) {
  const auto path = [](const char* name) { return folder() + "/" + name + ".csv"; };
  data::LogFiles files;
  files.train = {path("exc-12h-50s"), path("exc-12h-40s"), path("exc-8h-20s")};
  files.judge = {path("exc-14h-50s-load2p805kg"), path("exc-10h-20s"), path("exc-12h-20s"),
                 path("exc-14h-50s")};
  const data::LogSet logs = data::open_logs(robot().joint_specs(), files);
  const UnloadedArm arm = fit_unloaded(robot(), logs);
  ASSERT_EQ(arm.drive_scale.size(), 6U);
  for (const int k : {1, 2, 3, 4}) {
    Options options;
    options.first_joint = k;
    const Payload weighed = estimate(arm, logs.judge().front(), options);
    const PayloadRun& found = weighed.run;
    ASSERT_TRUE(found.mass.identifiable) << "k = " << k;
    // A controller states it after 9 s; from wrist torques alone, which say less, after 10 s. It is right from then on.
    ASSERT_NE(weighed.first_stated(), nullptr) << "k = " << k;
    EXPECT_LT(weighed.first_stated()->time, 10.0) << "k = " << k;
    EXPECT_NEAR(weighed.first_stated()->load.mass.value, kMass, 0.1 * kMass) << "k = " << k;
    for (const LiveEvent& event : weighed.live) {
      EXPECT_NEAR(event.load.mass.value, kMass, 0.15 * kMass) << "k = " << k;
      EXPECT_TRUE(event.load.mass.contains(kMass)) << "k = " << k;
    }
    EXPECT_NEAR(found.mass.value, kMass, 0.03 * kMass) << "k = " << k;
    EXPECT_TRUE(found.mass.contains(kMass)) << "k = " << k;
    EXPECT_LT(found.mass.half_width(), 0.25) << "k = " << k;
  }
  for (std::size_t l = 1; l < logs.judge().size(); ++l) {
    const Payload weighed = estimate(arm, logs.judge()[l]);
    const PayloadRun& found = weighed.run;
    ASSERT_FALSE(weighed.live.empty()) << logs.judge()[l].path;
    for (const LiveEvent& event : weighed.live) {
      EXPECT_TRUE(event.load.mass.contains(0.0)) << logs.judge()[l].path;
    }
    EXPECT_LT(std::abs(found.mass.value), 0.15) << logs.judge()[l].path;
    EXPECT_TRUE(found.mass.contains(0.0)) << logs.judge()[l].path;
  }
}

TEST_F(MeasuredUr10e, FindsNoLoadWhereThereIsNone) {
  for (const char* name : {"exc-8h-20s", "exc-10h-20s", "exc-12h-20s", "exc-12h-30s", "exc-12h-40s",
                           "exc-14h-50s", "ptp-10-points"}) {
    const PayloadRun found = run(name);
    ASSERT_TRUE(found.mass.identifiable) << name;
    EXPECT_LT(std::abs(found.mass.value), 0.05) << name;
    EXPECT_LT(std::abs(found.mass.value), found.mass.half_width()) << name;
    EXPECT_TRUE(found.changes.empty()) << name;
  }
}

TEST_F(MeasuredUr10e, OneJointAtATimeDoesNotTellTheMass) {
  for (const char* name : {"jointwise-j2", "jointwise-j5"}) {
    const PayloadRun found = run(name);
    EXPECT_FALSE(found.mass.identifiable) << name;
    EXPECT_THAT(found.missing, HasSubstr("at rest")) << name;
    EXPECT_TRUE(found.changes.empty()) << name;
  }
}

TEST_F(MeasuredUr10e, APersonWhoPushesTheStandingArmIsNoLoad) {
  const PayloadRun found = run("push-pose-1");
  EXPECT_FALSE(found.mass.identifiable);
  EXPECT_TRUE(found.changes.empty());
  EXPECT_EQ(found.rows_used.sum(), 0);
  EXPECT_THAT(found.missing, HasSubstr("does not move"));
}

TEST_F(MeasuredUr10e, ALoadTakenUpHalfWayIsSeenAtOnce) {
  // Both logs follow the same trajectory, 1.18 s apart: the empty one until 28 s, then the loaded one.
  const data::Log empty = log("exc-14h-50s"), loaded = log("exc-14h-50s-load2p805kg");
  constexpr double kShift = 1.18, kGrasp = 28.0;
  Eigen::Index head = 0, from = 0;
  while (empty.time[head] < kGrasp) ++head;
  while (loaded.time[from] - kShift < kGrasp + 0.005) ++from;
  const Eigen::Index tail = loaded.num_samples() - from;
  data::Log spliced;
  spliced.path = "spliced";
  spliced.time.resize(head + tail);
  spliced.time << empty.time.head(head), loaded.time.tail(tail).array() - kShift;
  for (Eigen::MatrixXd data::Log::*channel : {&data::Log::q, &data::Log::qd, &data::Log::tau}) {
    (spliced.*channel).resize(head + tail, 6);
    spliced.*channel << (empty.*channel).topRows(head), (loaded.*channel).bottomRows(tail);
  }
  const RecursiveFit fit = fit_recursively(robot(), {log("exc-12h-50s")});
  model::Robot arm = robot();
  model::apply(fit.model, arm);
  PayloadRunOptions options;
  options.residual = fit.residual;
  options.model_covariance = fit.model.covariance;
  const PayloadRun found = run_payload(arm, spliced, options);
  UnloadedArm unloaded;
  unloaded.robot = arm;
  unloaded.residual = fit.residual;
  unloaded.covariance = fit.model.covariance;
  LiveLoad live(unloaded);
  std::vector<LiveEvent> events;
  for (Eigen::Index k = 0; k < spliced.time.size(); ++k) {
    if (const auto event =
            live.push({spliced.time[k], spliced.q.row(k), spliced.qd.row(k), spliced.tau.row(k)}))
      events.push_back(*event);
  }
  ASSERT_EQ(events.size(), 3U);
  EXPECT_TRUE(events[0].load.mass.contains(0.0));
  EXPECT_EQ(events[1].kind, LiveEvent::Kind::kChange);
  EXPECT_NEAR(events[1].time, kGrasp, 0.5);
  EXPECT_EQ(events[2].kind, LiveEvent::Kind::kAttached);
  EXPECT_NEAR(events[2].load.mass.value, kMass, 0.15 * kMass);
  ASSERT_EQ(found.changes.size(), 1U);
  EXPECT_NEAR(found.changes[0].time, kGrasp, 0.2);
  EXPECT_NEAR(found.changes[0].mass_before, 0, 0.1);
  EXPECT_NEAR(found.mass.value, kMass, found.mass.half_width() + kTorqueScale);
  EXPECT_LT(found.mass.half_width(), 0.2);
  ASSERT_TRUE(found.converged_at.has_value());
  EXPECT_LT(*found.converged_at, kGrasp + 5);
}

/// An arm whose torque scale differs from joint to joint by a factor of two (its README): the model of the bare arm takes that
/// up, and no load is left over in the run that it was not fitted to.
TEST(MeasuredAirBot, FindsNoLoadInTheRunThatItsModelHasNotSeen) {
  const std::string folder = HEFT_DATA_DIR "/airbot-play";
  HEFT_NEEDS_MEASURED_DATA(folder);
  data::LogRequirements needs;
  needs.num_joints = 6;
  needs.torque = true;
  const data::Log chirp = data::read_log(folder + "/chirp.csv", needs);
  const data::Log trapezoidal = data::read_log(folder + "/trapezoidal.csv", needs);
  for (const bool swapped : {false, true}) {
    model::Robot arm = urdf::load_urdf(folder + "/robot.urdf");
    const RecursiveFit fit = fit_recursively(arm, {swapped ? trapezoidal : chirp});
    model::apply(fit.model, arm);
    PayloadRunOptions options;
    options.residual = fit.residual;
    options.model_covariance = fit.model.covariance;
    const PayloadRun found = run_payload(arm, swapped ? chirp : trapezoidal, options);
    EXPECT_LT(std::abs(found.mass.value), found.mass.half_width()) << swapped;
    // Of an arm of 3 kg: a load of a finger's weight would show.
    EXPECT_LT(found.mass.half_width(), 0.03) << swapped;
    EXPECT_TRUE(found.changes.empty()) << swapped;
  }
}

}  // namespace
}  // namespace heft::payload
