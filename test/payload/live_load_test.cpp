/// The load of a stream of rows: what is said, when, and that it is what the whole log says.
#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/data/live_log.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "heft/payload/payload.hpp"
#include "heft/report/payload.hpp"
#include "support/arms.hpp"
#include "support/synthetic_log.hpp"
#include "support/temporary_folder.hpp"

namespace heft::payload {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using Kind = LiveEvent::Kind;

constexpr double kCarried = 0.8;

data::Log log_of(const model::Robot& robot, std::uint32_t seed,
                 std::function<const model::Robot&(double)> robot_at = {}, double duration = 30.0) {
  test::SyntheticSettings settings;
  settings.noise = 0.01;
  settings.jitter = 0.2;
  settings.duration = duration;
  settings.motion_seed = settings.noise_seed = seed;
  settings.robot_at = std::move(robot_at);
  data::Log log = test::synthetic_log(robot, settings);
  log.path = "log " + std::to_string(seed);
  return log;
}

data::LiveRow row_of(const data::Log& log, Eigen::Index k) {
  data::LiveRow row{log.time[k], log.q.row(k), {}, log.tau.row(k)};
  if (log.qd.cols() > 0) row.qd = log.qd.row(k);
  return row;
}

std::vector<LiveEvent> push(LiveLoad& live, const data::Log& log) {
  std::vector<LiveEvent> events;
  for (Eigen::Index k = 0; k < log.time.size(); ++k) {
    if (const std::optional<LiveEvent> event = live.push(row_of(log, k))) events.push_back(*event);
  }
  return events;
}

std::vector<Kind> kinds_of(const std::vector<LiveEvent>& events) {
  std::vector<Kind> kinds;
  for (const LiveEvent& event : events) {
    if (event.kind != Kind::kCorrected) kinds.push_back(event.kind);
  }
  return kinds;
}

class LiveLoadOf : public ::testing::Test {
 protected:
  static UnloadedArm fitted(const model::Robot& robot, std::vector<data::Log> empty) {
    return fit_unloaded(robot, data::log_set(robot.joint_specs(), std::move(empty), {}));
  }

  const model::Robot arm_ = test::planar_two_link();
  const model::Robot loaded_ =
      test::carrying(arm_, test::body(kCarried, {0.3, 0, 0}, {0, 0, 0.001, 0, 0, 0.001}));
  const model::Robot heavier_ =
      test::carrying(arm_, test::body(2.0, {0.2, 0.05, 0}, {0, 0, 0.002, 0, 0, 0.002}));
  static const UnloadedArm& fitted_once() {
    static const UnloadedArm arm = fitted(
        test::planar_two_link(), {log_of(test::planar_two_link(), 1), log_of(test::planar_two_link(), 2)});
    return arm;
  }
  const UnloadedArm& unloaded_ = fitted_once();
};

TEST_F(LiveLoadOf, AStreamIsTheLoadOfItsLogAndKnownBeforeItsEnd) {
  data::Log log = log_of(loaded_, 3);
  log.time.array() += 100.0;
  LiveLoad live(unloaded_);
  const std::vector<LiveEvent> events = push(live, log);
  ASSERT_FALSE(events.empty());
  EXPECT_EQ(events.front().kind, Kind::kKnown);
  EXPECT_LT(events.front().time, 110.0);
  EXPECT_TRUE(events.front().load.mass.contains(kCarried));
  EXPECT_NEAR(events.front().load.mass.value, kCarried, 0.15 * kCarried);
  const LiveSummary summary = live.end(7);
  ASSERT_TRUE(summary.load.has_value());
  const Payload weighed = estimate(unloaded_, data::log_set(arm_.joint_specs(), {}, {log}).judge().front());
  const PayloadRun& whole = weighed.run;
  ASSERT_NE(weighed.first_stated(), nullptr);
  EXPECT_EQ(report::brief(*weighed.first_stated()), report::brief(events.front())) << "the same code";
  EXPECT_TRUE(whole.mass.contains(summary.load->mass.value));
  EXPECT_TRUE(summary.load->mass.contains(whole.mass.value));
  EXPECT_TRUE(summary.load->mass.contains(kCarried));
  EXPECT_LT(summary.load->mass.half_width(), 0.15);
  EXPECT_NEAR(summary.load->com[0].value, whole.com[0].value, 0.02);
  EXPECT_TRUE(summary.load->com[0].contains(0.3));
  EXPECT_EQ(summary.samples, log.num_samples());
  EXPECT_EQ(summary.refused, 7);
  EXPECT_DOUBLE_EQ(summary.load_since, log.time[0]);
  EXPECT_THAT(summary.changes, IsEmpty());
  EXPECT_THAT(summary.unanswered, IsEmpty());
}

TEST_F(LiveLoadOf, WhatARowBringsAboutIsSaidWithThatRow) {
  const data::Log log = log_of(loaded_, 3);
  LiveLoad whole(unloaded_), cut(unloaded_);
  const LiveEvent first = push(whole, log).front();
  std::optional<LiveEvent> last;
  for (Eigen::Index k = 0; log.time[k] <= first.time; ++k) {
    EXPECT_FALSE(last.has_value());
    last = cut.push(row_of(log, k));
  }
  ASSERT_TRUE(last.has_value());
  EXPECT_EQ(report::brief(*last), report::brief(first));
}

TEST_F(LiveLoadOf, SaysWhatIsAttachedReplacedAndDetached) {
  const auto carried = [&](double t) -> const model::Robot& {
    return t < 14.0 ? arm_ : t < 29.0 ? loaded_ : t < 44.0 ? heavier_ : arm_;
  };
  LiveLoad live(unloaded_);
  const std::vector<LiveEvent> events = push(live, log_of(arm_, 5, carried, 60.0));

  ASSERT_THAT(kinds_of(events), ElementsAre(Kind::kKnown, Kind::kChange, Kind::kAttached, Kind::kChange,
                                            Kind::kReplaced, Kind::kChange, Kind::kDetached));
  EXPECT_TRUE(events.front().load.mass.contains(0.0));
  const LiveSummary summary = live.end();
  ASSERT_EQ(summary.changes.size(), 3U);
  for (std::size_t c = 0; c < 3; ++c)
    EXPECT_NEAR(summary.changes[c].time, 14.0 + 15.0 * static_cast<double>(c), 0.5) << c;
  EXPECT_NEAR(summary.changes[0].mass, kCarried, 0.15 * kCarried);
  for (const LiveEvent& event : events) {
    const double truth = event.kind == Kind::kAttached   ? kCarried
                         : event.kind == Kind::kReplaced ? 2.0
                                                         : kNaN;
    if (std::isnan(truth)) continue;
    EXPECT_TRUE(event.load.mass.contains(truth)) << report::brief(event);
  }
  EXPECT_NEAR(summary.changes[1].mass_before, kCarried, 0.3 * kCarried);
  EXPECT_NEAR(summary.changes[1].mass, 2.0, 0.15 * 2.0);
  ASSERT_TRUE(summary.load.has_value());
  EXPECT_TRUE(summary.load->mass.contains(0.0));
  EXPECT_FALSE(summary.changing);
}

// A recorder that booted at zero is set to the time of day, and something else is carried since.
TEST_F(LiveLoadOf, AClockThatIsSetForwardStartsAnew) {
  constexpr double kDay = 1.7e9;
  LiveLoad live(unloaded_);
  const std::vector<LiveEvent> before = push(live, log_of(loaded_, 3));
  ASSERT_FALSE(before.empty());
  data::Log later = log_of(heavier_, 4);
  later.time.array() += kDay;
  const std::vector<LiveEvent> after = push(live, later);
  ASSERT_FALSE(after.empty());
  const LiveSummary summary = live.end();
  ASSERT_TRUE(summary.load.has_value());
  EXPECT_TRUE(summary.load->mass.contains(2.0)) << report::brief(summary);
  EXPECT_GE(summary.load_since, kDay - 1.0);
  EXPECT_NEAR(summary.seconds, 60.0, 0.1);
}

TEST_F(LiveLoadOf, TimeInMillisecondsIsRefused) {
  data::Log log = log_of(loaded_, 3);
  log.time *= 1000.0;
  LiveLoad live(unloaded_);
  try {
    push(live, log);
    FAIL() << "took milliseconds for seconds";
  } catch (const DataError& error) {
    EXPECT_THAT(error.what(), HasSubstr("milliseconds"));
  }
}

TEST_F(LiveLoadOf, NothingIsCarriedWhereNothingIs) {
  LiveLoad live(unloaded_);
  const std::vector<LiveEvent> events = push(live, log_of(arm_, 6));
  ASSERT_FALSE(events.empty());
  for (const LiveEvent& event : events) EXPECT_TRUE(event.load.mass.contains(0.0)) << report::brief(event);
  EXPECT_THAT(report::brief(live.end()), HasSubstr("No load: "));
}

// Rows at uneven times, as recorders write them. Fewer than 16 of 20 intervals come by chance once in four hundred.
TEST_F(LiveLoadOf, IntervalsHoldTheLoadFromTheFirstOneOn) {
  const model::Robot arm = test::six_joint_arm();
  const model::Robot truth =
      test::carrying(arm, test::body(1.5, {0.04, 0.11, -0.05}, {0.01, 0.001, 0.008, -0.002, 0.0005, 0.012}));
  test::SyntheticSettings settings;
  settings.noise = 0.01;
  settings.jitter = 0.3;
  const UnloadedArm fit = fitted(arm, {test::synthetic_log(arm, settings)});
  settings.duration = 6.0;
  int held = 0, of = 0;
  for (std::uint32_t seed = 10; seed < 20; ++seed) {
    settings.motion_seed = settings.noise_seed = seed;
    LiveLoad live(fit);
    const std::vector<LiveEvent> events = push(live, test::synthetic_log(truth, settings));
    ASSERT_FALSE(events.empty()) << seed;
    held += events.front().load.mass.contains(1.5) ? 1 : 0;
    held += live.end().load.value().mass.contains(1.5) ? 1 : 0;
    of += 2;
  }
  EXPECT_GE(held, 16) << "of " << of;
}

TEST_F(LiveLoadOf, FrictionThatChangedDoesNotPassForLoad) {
  model::Robot warm = loaded_;
  for (model::RobotJoint& joint : warm.joints) {
    joint.actuation.coulomb_friction *= 1.3;
    joint.actuation.viscous_friction *= 0.7;
  }
  LiveLoad live(unloaded_);
  push(live, log_of(warm, 7));
  const LiveSummary summary = live.end();
  ASSERT_TRUE(summary.load.has_value());
  EXPECT_TRUE(summary.load->mass.contains(kCarried)) << report::brief(summary);
}

TEST_F(LiveLoadOf, TheTorqueScaleIsTakenOffTheLoad) {
  const Eigen::Vector2d scale(1.08, 1.06);
  const auto scaled = [&](data::Log log) {
    log.tau = log.tau * scale.asDiagonal();
    return log;
  };
  UnloadedArm arm = fitted(arm_, {scaled(log_of(arm_, 1))});
  const data::Log log = scaled(log_of(loaded_, 8));
  LiveLoad as_measured(arm);
  push(as_measured, log);
  for (Eigen::Index j = 0; j < 2; ++j)
    arm.drive_scale.push_back(statistics::Interval::around(scale[j], 0.005));
  LiveLoad live(arm);
  push(live, log);
  const double measured = as_measured.end().load.value().mass.value,
               found = live.end().load.value().mass.value;
  EXPECT_NEAR(found, kCarried, 0.02);
  EXPECT_GT(measured, 1.05 * found);
}

TEST_F(LiveLoadOf, RowsThatNoSuchArmCanHaveAreNamedOnceAndChangeNothing) {
  UnloadedArm limited = unloaded_;
  for (model::RobotJoint& joint : limited.robot.joints)
    joint.effort_limit = 200.0, joint.velocity_limit = 20.0;
  const data::Log log = log_of(loaded_, 3);
  LiveLoad clean(limited), live(limited);
  push(clean, log);
  std::vector<LiveEvent> events;
  for (Eigen::Index k = 0; k < log.time.size(); ++k) {
    if (k >= 1500 && k < 1503) {
      data::LiveRow broken = row_of(log, k - 1);
      broken.time += 1e-4 * static_cast<double>(k - 1499);
      broken.tau[1] = 1e5;
      if (const auto event = live.push(broken)) events.push_back(*event);
    }
    if (const auto event = live.push(row_of(log, k)); event && event->kind == Kind::kRefused) ADD_FAILURE();
  }
  ASSERT_FALSE(events.empty());
  EXPECT_EQ(events.front().kind, Kind::kRefused);
  EXPECT_EQ(events.front().joint, 1);
  EXPECT_THAT(report::brief(events.front()), HasSubstr("joint 2: torque"));
  const LiveSummary a = clean.end(), b = live.end();
  EXPECT_EQ(b.refused, a.refused + 3);
  EXPECT_DOUBLE_EQ(b.load.value().mass.value, a.load.value().mass.value);
}

TEST_F(LiveLoadOf, AClockThatIsSetBackStartsTheFiltersAnewAndKeepsWhatWasSaid) {
  data::Log log = log_of(loaded_, 3);
  LiveLoad live(unloaded_);
  const std::size_t before = push(live, log).size();
  EXPECT_GT(before, 0U);
  log = log_of(loaded_, 4);  // from 0 s again
  for (const LiveEvent& event : push(live, log))
    EXPECT_EQ(event.kind, Kind::kCorrected) << report::brief(event);
  EXPECT_TRUE(live.end().load.value().mass.contains(kCarried));
}

TEST_F(LiveLoadOf, VelocitiesThatAreMissingAreDerived) {
  data::Log log = log_of(loaded_, 3);
  log.qd.resize(0, 0);
  LiveLoad live(unloaded_);
  push(live, log);
  const LiveSummary summary = live.end();
  ASSERT_TRUE(summary.load.has_value());
  EXPECT_TRUE(summary.load->mass.contains(kCarried)) << report::brief(summary);
}

TEST_F(LiveLoadOf, AStreamThatShowsNothingSaysWhatIsMissing) {
  LiveLoad nothing(unloaded_);
  EXPECT_THAT(nothing.end().unanswered, HasSubstr("0 rows are too few"));
  data::Log rest = log_of(loaded_, 3);
  for (Eigen::Index k = 0; k < rest.time.size(); ++k) {
    rest.q.row(k) = rest.q.row(0);
    rest.qd.row(k).setZero();
    rest.tau.row(k) = rest.tau.row(0);
  }
  // Without friction a rest would show the mass: the difference of the two torques is that of its weight alone.
  UnloadedArm rubbing = unloaded_;
  for (model::RobotJoint& joint : rubbing.robot.joints) joint.actuation.coulomb_friction = 5.0;
  LiveLoad resting(rubbing);
  for (const LiveEvent& event : push(resting, rest)) ADD_FAILURE() << report::brief(event);
  EXPECT_THAT(resting.end().unanswered, HasSubstr("move several joints"));
  Options rows;
  rows.first_joint = 3;
  EXPECT_THAT(test::message_of<InputError>([&] { LiveLoad(unloaded_, rows); }), HasSubstr("expected 1 to 2"));
}

TEST_F(LiveLoadOf, AnArmThatWasFittedWithALoadMakesNoNegativeLoad) {
  LiveLoad live(fitted(arm_, {log_of(loaded_, 1), log_of(loaded_, 2)}));
  const std::vector<LiveEvent> events = push(live, log_of(arm_, 3));
  ASSERT_FALSE(events.empty());
  EXPECT_EQ(events.front().kind, Kind::kImpossible);
  const LiveSummary summary = live.end();
  EXPECT_FALSE(summary.load.has_value());
  EXPECT_THAT(summary.unanswered, HasSubstr("the mass is negative"));
}

}  // namespace
}  // namespace heft::payload
