/// Thresholds learnt from synthetic logs, contacts found in others, and which logs are refused.
#include "heft/monitor/monitor.hpp"

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/error.hpp"
#include "support/arms.hpp"
#include "support/synthetic_log.hpp"

namespace heft::monitor {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

data::Log log_of(const model::Robot& robot, const std::string& name, std::uint32_t seed,
                 double seconds = 30.0) {
  test::SyntheticSettings settings;
  settings.duration = seconds;
  settings.sample_rate = 200.0;
  settings.noise = 0.01;
  settings.motion_seed = settings.noise_seed = seed;
  data::Log log = test::synthetic_log(robot, settings);
  log.path = name;
  return log;
}

/// A push of `torque` on one joint between two times; what pushes along q takes load off the motor.
void push(data::Log& log, Eigen::Index joint, double torque, double from, double to) {
  for (Eigen::Index k = 0; k < log.time.size(); ++k) {
    if (log.time[k] >= from && log.time[k] < to) log.tau(k, joint) -= torque;
  }
}

class Monitor : public ::testing::Test {
 protected:
  data::LogSet set(std::vector<data::Log> train, std::vector<data::Log> judge) const {
    return data::log_set(arm_.joint_specs(), std::move(train), std::move(judge));
  }
  Thresholds learnt(const Options& options = {}) const {
    return learn(file_, arm_, set({free_, other_}, {}), options);
  }

  const model::Robot arm_ = test::planar_two_link();
  const model::ModelFile file_ = model::make_model(arm_);
  const data::Log free_ = log_of(arm_, "free", 1), other_ = log_of(arm_, "other", 2),
                  run_ = log_of(arm_, "run", 3);
};

TEST_F(Monitor, FindsPushesWithTheirJointAndDirectionAndNothingElse) {
  data::Log pushed = run_;
  push(pushed, 1, 3.0, 10.0, 10.6);
  push(pushed, 0, -8.0, 20.0, 20.5);
  const Thresholds thresholds = learnt();
  EXPECT_TRUE(thresholds.usable());
  const Contacts found = monitor(file_, arm_, set({}, {pushed}), thresholds).front();
  ASSERT_EQ(found.contacts.size(), 2U);
  EXPECT_EQ(found.contacts[0].joint, 1);
  EXPECT_EQ(found.contacts[0].direction, 1);
  EXPECT_NEAR(found.contacts[0].begin, 10.0, 0.1);
  EXPECT_NEAR(found.contacts[0].end, 10.6, 0.5);
  EXPECT_NEAR(found.contacts[0].peak, 3.0, 1.0);
  EXPECT_EQ(found.contacts[1].joint, 0);
  EXPECT_EQ(found.contacts[1].direction, -1);
  EXPECT_NEAR(found.judged_seconds, 30.0, 1.0);
  EXPECT_TRUE(found.usable());
}

TEST_F(Monitor, RowsThatArriveGiveTheContactsOfTheLog) {
  data::Log pushed = run_;
  push(pushed, 1, 3.0, 10.0, 10.6);
  const Thresholds thresholds = learnt();
  for (const bool velocity : {true, false}) {
    if (!velocity) pushed.qd.resize(0, 0);
    const Contacts found = monitor(file_, arm_, set({}, {pushed}), thresholds).front();
    LiveContacts live(file_, arm_, thresholds);
    std::vector<LiveContact> events;
    double began = 0.0;
    for (Eigen::Index k = 0; k < pushed.time.size(); ++k) {
      data::LiveRow row{pushed.time[k], pushed.q.row(k), {}, pushed.tau.row(k)};
      if (velocity) row.qd = pushed.qd.row(k);
      for (const LiveContact& event : live.push(row)) {
        events.push_back(event);
        if (!event.ended) began = row.time;
      }
    }
    const LiveSummary summary = live.end();
    ASSERT_EQ(found.contacts.size(), 1U);
    ASSERT_EQ(summary.contacts.size(), 1U);
    ASSERT_EQ(events.size(), 2U);
    EXPECT_EQ(began, found.contacts[0].begin);
    EXPECT_EQ(events[1].contact.end, found.contacts[0].end);
    EXPECT_NEAR(events[1].contact.peak, found.contacts[0].peak, 1e-9);
    EXPECT_EQ(events[1].contact.joints, found.contacts[0].joints);
    EXPECT_NEAR(summary.judged_seconds, found.judged_seconds, 1e-9);
    EXPECT_EQ(summary.samples, pushed.time.size());
  }
}

TEST_F(Monitor, AClockThatIsSetEndsTheContactAndStartsAnew) {
  data::Log pushed = run_;
  push(pushed, 1, 3.0, 10.0, 10.6);
  LiveContacts live(file_, arm_, learnt());
  std::vector<LiveContact> events;
  const auto push_rows = [&](double until, double shift) {
    for (Eigen::Index k = 0; pushed.time[k] < until; ++k) {
      const data::LiveRow row{pushed.time[k] + shift, pushed.q.row(k), pushed.qd.row(k), pushed.tau.row(k)};
      for (const LiveContact& event : live.push(row)) events.push_back(event);
    }
  };
  push_rows(10.3, 0.0);
  ASSERT_EQ(events.size(), 1U);
  push_rows(9.0, -5.0);
  ASSERT_EQ(events.size(), 2U);
  EXPECT_TRUE(events[1].ended);
  EXPECT_NEAR(live.end().judged_seconds, 10.3 + 9.0, 2.0);
}

/// Friction of every joint beyond the viscous.
struct GrowingTorque {
  const char* name;
  double coulomb;   ///< dry friction, sharp where the model's is smooth, as a multiple of the arm's own
  double stribeck;  ///< what the log's friction has more than the model's near standstill [N·m]
  double slowest;   ///< bound of the delay [s]
};

class MonitorOfSixJoints : public ::testing::TestWithParam<GrowingTorque> {};

// White torque noise of 0.2 % of each joint's largest torque: 0.1 N·m at the elbow.
TEST_P(MonitorOfSixJoints, FindsAGrowingTorqueAtTheElbowSoon) {
  model::Robot arm = test::six_joint_arm();
  for (model::RobotJoint& joint : arm.joints) joint.actuation.coulomb_friction *= GetParam().coulomb;
  const model::ModelFile file = model::make_model(arm);
  const auto log = [&](const std::string& name, std::uint32_t seed) {
    test::SyntheticSettings settings;
    settings.duration = 20.0;
    settings.sample_rate = 1000.0;
    settings.noise = 0.002;
    settings.correlation = 1e-5;
    settings.motion_seed = settings.noise_seed = seed;
    data::Log made = test::synthetic_log(arm, settings);
    made.path = name;
    for (Eigen::Index j = 0; j < made.qd.cols(); ++j) {
      for (Eigen::Index k = 0; k < made.qd.rows(); ++k) {
        const double speed = made.qd(k, j);
        made.tau(k, j) += GetParam().stribeck * std::exp(-std::abs(speed) / 0.05) * (speed > 0 ? 1.0 : -1.0);
      }
    }
    return made;
  };
  const Thresholds thresholds =
      learn(file, arm, data::log_set(arm.joint_specs(), {log("a", 1), log("b", 2), log("c", 3)}, {}));
  int found = 0;
  for (const double begin : {6.0, 9.5, 14.0}) {
    data::Log pushed = log("pushed", 4);
    for (Eigen::Index k = 0; k < pushed.time.size(); ++k) {
      const double since = pushed.time[k] - begin;
      if (since > 0.0 && since < 0.3) pushed.tau(k, 2) -= kPushRate * since;
    }
    const Contacts contacts =
        monitor(file, arm, data::log_set(arm.joint_specs(), {}, {pushed}), thresholds).front();
    ASSERT_FALSE(contacts.contacts.empty()) << begin;
    std::printf("%s: %.0f ms\n", GetParam().name, 1e3 * (contacts.contacts[0].begin - begin));
    EXPECT_EQ(contacts.contacts[0].joint, 2);
    EXPECT_GT(contacts.contacts[0].begin, begin);
    EXPECT_LE(contacts.contacts[0].begin, begin + GetParam().slowest);
    // A joint that turns round during the push may end the contact and show the end of the push as another.
    EXPECT_LT(contacts.contacts.back().begin, begin + 0.4);
    EXPECT_LE(contacts.contacts.size(), GetParam().coulomb > 0 ? 2U : 1U) << begin;
    ++found;
  }
  EXPECT_EQ(found, 3);
}

INSTANTIATE_TEST_SUITE_P(Frictions, MonitorOfSixJoints,
                         ::testing::Values(GrowingTorque{"Viscous", 0.0, 0.0, 0.020},
                                           GrowingTorque{"SharpDry", 1.0, 0.0, 0.020},
                                           GrowingTorque{"Stribeck", 1.0, 2.0, 0.020}),
                         [](const auto& given) { return std::string(given.param.name); });

TEST_F(Monitor, CountsFalseAlarmsOfALogKnownToBeFreeWithTheExactInterval) {
  Options options;
  options.known_free = true;
  const Contacts found = monitor(file_, arm_, set({}, {run_}), learnt(), options).front();
  EXPECT_TRUE(found.contacts.empty());
  EXPECT_EQ(found.false_alarms.value, 0.0);
  EXPECT_EQ(found.false_alarms.lower, 0.0);
  EXPECT_NEAR(found.false_alarms.upper, 3.689 * 3600.0 / found.judged_seconds,
              0.01 * found.false_alarms.upper);
}

TEST_F(Monitor, FewerFalseAlarmsAllowedMakeHigherThresholds) {
  Options often, seldom;
  often.false_alarms_per_hour = 10.0;
  seldom.false_alarms_per_hour = 0.1;
  const Thresholds low = learnt(often), high = learnt(seldom);
  ASSERT_EQ(low.joints.size(), 2U);
  if (low.bandwidth == high.bandwidth) {
    for (std::size_t j = 0; j < 2; ++j) EXPECT_GT(high.joints[j].moving, low.joints[j].moving) << j;
  }
  EXPECT_LT(high.expected.value, low.expected.value);
  EXPECT_LE(low.expected.value, 10.0);
  EXPECT_LT(low.expected.lower, low.expected.value);
  EXPECT_GT(low.expected.upper, low.expected.value);
}

TEST_F(Monitor, ThresholdsSurviveTheModelFile) {
  const Thresholds thresholds = learnt();
  const model::ModelFile written =
      model::parse_model(model::to_json(thresholds.model_file(file_)), "watched.json");
  const std::optional<Thresholds> read = thresholds_of(written);
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(read->bandwidth, thresholds.bandwidth);
  EXPECT_EQ(read->load_rate, thresholds.load_rate);
  EXPECT_EQ(read->largest_step, thresholds.largest_step);
  EXPECT_EQ(read->logs, thresholds.logs);
  EXPECT_EQ(read->expected.upper, thresholds.expected.upper);
  ASSERT_EQ(read->joints.size(), thresholds.joints.size());
  for (std::size_t j = 0; j < read->joints.size(); ++j) {
    EXPECT_EQ(read->joints[j].moving, thresholds.joints[j].moving);
    EXPECT_EQ(read->joints[j].turning, thresholds.joints[j].turning);
    EXPECT_EQ(read->joints[j].rest, thresholds.joints[j].rest);
    EXPECT_EQ(read->joints[j].top_speed, thresholds.joints[j].top_speed);
  }
  EXPECT_FALSE(thresholds_of(file_).has_value());  // a file of before
}

TEST_F(Monitor, NamesThePlaceOfAThresholdThatMeansNothing) {
  model::ModelFile file = learnt().model_file(file_);
  file.path = "watched.json";
  const auto message = [&](const std::string& from, const std::string& to) {
    model::ModelFile wrong = file;
    const std::size_t at = wrong.other_fields.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    wrong.other_fields.replace(at, from.size(), to);
    try {
      static_cast<void>(thresholds_of(wrong));
    } catch (const ModelError& error) {
      return std::string(error.what());
    }
    return std::string("nothing was thrown");
  };
  EXPECT_THAT(
      message("\"torque_at\":\"motor\"", "\"torque_at\":\"tool\""),
      AllOf(HasSubstr("watched.json: /contact_thresholds/torque_at: found \"tool\""), HasSubstr("expected")));
  EXPECT_THAT(message("\"adaptation\":10.0", "\"adaptation\":-1"),
              HasSubstr("/contact_thresholds/adaptation: found -1"));
  EXPECT_THAT(
      message("\"moving_change\"", "\"offset_limit\""),
      AllOf(HasSubstr("/contact_thresholds/joints/0"), HasSubstr("as heft monitor --learn writes it")));
}

TEST_F(Monitor, RefusesALogThatTheThresholdsWereLearntFrom) {
  const Thresholds thresholds = learnt();
  try {
    static_cast<void>(monitor(file_, arm_, set({free_}, {free_}), thresholds));
    FAIL() << "judged on a log to learn from";
  } catch (const DataError& error) {
    EXPECT_THAT(error.what(), HasSubstr("free"));
  }
}

TEST_F(Monitor, LogsThatTheModelWasFittedToMakeDoubledAndDoubtfulThresholds) {
  model::ModelFile fitted = file_;
  fitted.provenance.logs = {"free"};
  const Thresholds unseen = learnt(), seen = learn(fitted, arm_, set({free_, other_}, {}));
  EXPECT_EQ(seen.judgement.verdict, host::Verdict::kDoubtful);
  EXPECT_THAT(seen.judgement.reasons.front(), HasSubstr("which the model was fitted to"));
  for (std::size_t j = 0; j < 2; ++j) EXPECT_DOUBLE_EQ(seen.joints[j].moving, 2.0 * unseen.joints[j].moving);
}

TEST_F(Monitor, TooLittleFreeMotionIsNotIdentifiable) {
  try {
    static_cast<void>(learn(file_, arm_, set({log_of(arm_, "short", 4, 5.0)}, {})));
    FAIL() << "learnt from five seconds";
  } catch (const NotIdentifiableError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("found 5 s"), HasSubstr("expected 10 s"), HasSubstr("record")));
  }
}

// Its residual says nothing of motion, and thresholds from it would never be exceeded.
TEST_F(Monitor, AnArmThatStandsIsNotIdentifiable) {
  data::Log standing = log_of(arm_, "standing", 4, 60.0);
  for (Eigen::Index k = 0; k < standing.time.size(); ++k) {
    standing.q.row(k) = standing.q.row(0);
    standing.tau.row(k) = standing.tau.row(0);
  }
  standing.qd.setZero();
  try {
    static_cast<void>(learn(file_, arm_, set({standing}, {})));
    FAIL() << "learnt from an arm that stands";
  } catch (const NotIdentifiableError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("0 s of motion in 60 s"), HasSubstr("record")));
  }
}

TEST_F(Monitor, AModelThatDoesNotHoldIsBad) {
  model::Robot heavy = test::carrying(arm_, test::body(3.0, {0.3, 0, 0}, {0, 0, 0.01, 0, 0, 0.01}));
  const Contacts found = monitor(file_, arm_, set({}, {log_of(heavy, "heavy", 5)}), learnt()).front();
  ASSERT_FALSE(found.contacts.empty());
}

TEST_F(Monitor, WorksWithoutMeasuredVelocities) {
  const auto bare = [](data::Log log) {
    log.qd.resize(0, 0);
    return log;
  };
  data::Log pushed = bare(run_);
  push(pushed, 1, 4.0, 10.0, 10.6);
  const Thresholds thresholds = learn(file_, arm_, set({bare(free_), bare(other_)}, {}));
  const Contacts found = monitor(file_, arm_, set({}, {pushed}), thresholds).front();
  ASSERT_EQ(found.contacts.size(), 1U);
  EXPECT_NEAR(found.contacts[0].begin, 10.0, 0.15);
  EXPECT_THAT(found.notes.back(), HasSubstr("no velocities"));
}

}  // namespace
}  // namespace heft::monitor
