#include "heft/data/log_checks.hpp"

#include <cmath>
#include <filesystem>
#include <numbers>
#include <random>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/data/differentiate.hpp"
#include "heft/data/motion_stream.hpp"
#include "heft/host/error.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/measured_data.hpp"
#include "support/temporary_folder.hpp"

namespace heft::data {
namespace {

using heft::test::message_of;
using heft::test::TemporaryFolder;
using std::numbers::pi;
using testing::AllOf;
using testing::AnyOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr double kDegreesPerRadian = 180.0 / pi;

/// Three joints in sines of up to 2.5 rad and 2 rad/s at 250 Hz, with qd, qdd and tau.
Log sound_log() {
  Log log;
  log.path = "run.csv";
  const int rows = 3000;
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0.0, 1.0);
  log.time = Eigen::VectorXd::LinSpaced(rows, 0.0, (rows - 1) / 250.0);
  for (Eigen::MatrixXd* channel : {&log.q, &log.qd, &log.qdd, &log.tau}) channel->resize(rows, 3);
  for (int k = 0; k < rows; ++k) {
    for (int joint = 0; joint < 3; ++joint) {
      const double amplitude = 1.0 + 0.7 * joint;
      const double omega = 2.0 * pi * (0.23 - 0.05 * joint);
      const double phase = omega * log.time[k] + joint;
      log.q(k, joint) = amplitude * std::sin(phase) + 1e-5 * noise(random);
      log.qd(k, joint) = amplitude * omega * std::cos(phase) + 0.01 * noise(random);
      log.qdd(k, joint) = -amplitude * omega * omega * std::sin(phase) + 0.05 * noise(random);
      log.tau(k, joint) = 30.0 * std::sin(phase) + noise(random);
    }
  }
  return log;
}

JointLimits limits() {
  JointLimits result;
  result.lower = Eigen::Vector3d(-3.05, -3.05, -3.05);
  result.upper = Eigen::Vector3d(3.05, 3.05, 3.05);
  result.velocity = Eigen::Vector3d::Constant(3.0);
  result.effort = Eigen::Vector3d::Constant(100.0);
  return result;
}

std::vector<std::string> messages(const std::vector<LogFinding>& findings, Severity severity) {
  std::vector<std::string> result;
  for (const LogFinding& finding : findings) {
    if (finding.severity == severity) result.push_back(finding.message);
  }
  return result;
}

/// The only error, with every message in the failure.
std::string only_error(const Log& log, const JointLimits& with = limits()) {
  const std::vector<std::string> errors = messages(check_log(log, with), Severity::kError);
  EXPECT_EQ(errors.size(), 1u) << testing::PrintToString(errors);
  return errors.empty() ? "" : errors.front();
}

std::string only_note(const Log& log, const JointLimits& with = limits()) {
  const std::vector<LogFinding> findings = check_log(log, with);
  const std::vector<std::string> notes = messages(findings, Severity::kNote);
  EXPECT_THAT(messages(findings, Severity::kError), IsEmpty());
  EXPECT_EQ(notes.size(), 1u) << testing::PrintToString(notes);
  return notes.empty() ? "" : notes.front();
}

void drop_rates(Log& log) {
  log.qd.resize(0, 0);
  log.qdd.resize(0, 0);
}

TEST(LogChecks, FindNothingInASoundLog) {
  EXPECT_THAT(check_log(sound_log(), limits()), IsEmpty());
  EXPECT_THAT(check_log(sound_log()), IsEmpty());
}

TEST(LogChecks, DoNotTakeAGapInTimeForAnotherUnit) {
  // Pause while the arm moves on: over five seconds the velocity at either end says nothing of the way in between.
  Log log = sound_log();
  const Eigen::Index at = 1500;
  for (Eigen::Index k = at; k < log.time.size(); ++k) log.time[k] += 5.0;
  for (int joint = 0; joint < 3; ++joint) log.q.col(joint).tail(log.time.size() - at).array() += 1.5;
  JointLimits wide = limits();
  wide.lower *= 3.0;
  wide.upper *= 3.0;
  EXPECT_THAT(check_log(log, wide), IsEmpty());
  // The unit is still seen on the rest.
  log.qd *= kDegreesPerRadian;
  EXPECT_THAT(only_error(log, wide), HasSubstr("about 180/pi"));
}

TEST(LogChecks, NamePositionsInDegreesByTheLimits) {
  Log log = sound_log();
  log.q *= kDegreesPerRadian;
  drop_rates(log);
  EXPECT_THAT(
      only_error(log),
      AllOf(HasSubstr("run.csv: column 'q3': q3 reaches 137.5, the limits are +-3.05 rad; 137.5 is 2.4 "
                      "rad in degrees (likewise q1 and q2)"),
            HasSubstr("expected rad; multiply q1 to q3 by pi/180")));
}

TEST(LogChecks, SayWhenTheVelocityIsInDegreesToo) {
  Log log = sound_log();
  log.q *= kDegreesPerRadian;
  log.qd *= kDegreesPerRadian;
  log.qdd *= kDegreesPerRadian;
  EXPECT_THAT(only_error(log), HasSubstr("multiply q1 to q3 and qd1 to qd3 by pi/180"));
}

TEST(LogChecks, NamePositionsInDegreesByTheVelocity) {
  Log log = sound_log();
  log.q *= kDegreesPerRadian;
  EXPECT_THAT(only_error(log, {}),
              AllOf(HasSubstr("run.csv: column 'q1': q1, q2 and q3 change 57.3 times as fast as qd says"),
                    HasSubstr("multiply q1 to q3 by pi/180")));
}

TEST(LogChecks, NamePositionsInDegreesByTheirSpeed) {
  Log log = sound_log();
  log.q *= kDegreesPerRadian;
  drop_rates(log);
  const JointLimits unlimited;
  EXPECT_THAT(only_error(log, unlimited), AllOf(HasSubstr("column 'q1': q1, q2 and q3 move with up to 82"),
                                                HasSubstr("faster than any arm"), HasSubstr("1.44 rad")));
}

TEST(LogChecks, DoNotTakeAJointOfAnotherRobotForDegrees) {
  Log log = sound_log();
  log.q.col(1).array() += 4.0;  // 5.7 is beyond 1.5 times the limit, but then joint 1 would not be in degrees
  const JointLimits with = limits();
  Log shifted = log;
  shifted.q.col(1).array() -= 1.5;
  EXPECT_THAT(only_note(shifted, with), HasSubstr("column 'q2': q2 is outside the limits"));
}

TEST(LogChecks, NameVelocitiesInDegrees) {
  Log log = sound_log();
  log.qd.col(1) *= kDegreesPerRadian;
  log.qdd.col(1) *= kDegreesPerRadian;
  EXPECT_THAT(only_error(log),
              AllOf(HasSubstr("run.csv: column 'qd2': qd2 is 57.3 times the derivative of q"),
                    HasSubstr("expected rad/s; multiply qd2 by pi/180")));
}

TEST(LogChecks, NameAccelerationsInDegrees) {
  Log log = sound_log();
  log.qdd *= kDegreesPerRadian;
  EXPECT_THAT(only_error(log),
              AllOf(HasSubstr("column 'qdd1': qdd1, qdd2 and qdd3 are 5"),
                    HasSubstr("times the derivative of qd, about 180/pi"), HasSubstr("expected rad/s^2")));
}

TEST(LogChecks, NameAVelocityOfTheOtherSign) {
  Log log = sound_log();
  log.qd.col(2) *= -1.0;
  log.qdd.col(2) *= -1.0;
  EXPECT_THAT(only_error(log), AllOf(HasSubstr("column 'qd3': qd3 is minus the derivative of q"),
                                     HasSubstr("change the sign")));
}

TEST(LogChecks, NameAVelocityThatBelongsToAnotherJoint) {
  Log log = sound_log();
  log.qd.col(0).swap(log.qd.col(2));
  log.qdd.col(0).swap(log.qdd.col(2));
  EXPECT_THAT(only_note(log), HasSubstr("qd1 and qd3 have nothing to do with the derivative of q"));
}

TEST(LogChecks, NameAVelocityOfTheMotor) {
  Log log = sound_log();
  log.qd *= 101.0;
  log.qdd *= 101.0;
  EXPECT_THAT(only_note(log), AllOf(HasSubstr("101 times the derivative of q"), HasSubstr("motor side")));
}

TEST(LogChecks, NameTimeInMillisecondsByTheVelocity) {
  Log log = sound_log();
  log.time *= 1e3;
  EXPECT_THAT(only_error(log), AllOf(HasSubstr("run.csv: column 'time': qd1, qd2 and qd3 are 999.9 times"),
                                     HasSubstr("0.25 samples a second: time in milliseconds"),
                                     HasSubstr("expected seconds; divide time by 1000")));
  log.time *= 1e3;
  EXPECT_THAT(only_error(log), HasSubstr("time in microseconds"));
  log.time *= 1e-3;
  log.q *= kDegreesPerRadian;
  EXPECT_THAT(only_error(log, {}), HasSubstr("time in milliseconds (and q in degrees)"));
}

TEST(LogChecks, NameTimeInMillisecondsByTheSlowMotion) {
  Log log = sound_log();
  log.time *= 1e3;
  drop_rates(log);
  EXPECT_THAT(only_error(log), AllOf(HasSubstr("0.25 samples a second of a motion of"),
                                     HasSubstr("time in milliseconds"), HasSubstr("divide time by 1000")));
}

TEST(LogChecks, DoNotTakeASlowRecordingForMilliseconds) {
  // Poses held for ten seconds each, one row a second.
  Log log;
  log.path = "poses.csv";
  log.time = Eigen::VectorXd::LinSpaced(200, 0.0, 199.0);
  log.q.resize(200, 1);
  for (int k = 0; k < 200; ++k) log.q(k, 0) = 0.8 * std::sin(0.7 * (k / 10)) + 1e-5 * std::sin(3.0 * k);
  EXPECT_THAT(only_note(log, {}), HasSubstr("1 samples a second; expected 50 or more"));
}

TEST(LogChecks, NameAClockThatRunsAtAnotherRate) {
  Log log = sound_log();
  log.time *= 20.0;  // 250 Hz labelled 12.5 Hz
  EXPECT_THAT(only_error(log), AllOf(HasSubstr("column 'time'"), HasSubstr("qd is 20 times"),
                                     HasSubstr("divide time by 20"), HasSubstr("250 samples a second")));
}

TEST(LogChecks, SayWhyARecordedRateIsNotUsed) {
  const auto reason = [](const Log& log) {
    LogCheck check(log.path, log.num_joints());
    check.add(log.time, log.q, log.qd, log.qdd, log.tau);
    return check.unusable_rate();
  };
  Log log = sound_log();
  EXPECT_EQ(reason(log), "");
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0.0, 20.0);
  for (int k = 0; k < log.num_samples(); ++k) log.qdd(k, 1) = noise(random);
  EXPECT_THAT(reason(log), HasSubstr("qdd2 has nothing to do with the derivative of qd"));
  log.qdd = 1.5 * sound_log().qdd;
  EXPECT_THAT(reason(log), AllOf(HasSubstr("qdd1 is 1."), HasSubstr("times the derivative of qd")));
}

TEST(LogChecks, NamePositionsThatStartAgainAtEachTurn) {
  Log log = sound_log();
  drop_rates(log);
  for (int k = 0; k < log.num_samples(); ++k) {
    const double turning = 0.9 * log.time[k];
    log.q(k, 1) = turning - 2.0 * pi * std::floor(turning / (2.0 * pi));
  }
  EXPECT_THAT(only_error(log, {}), AllOf(HasSubstr("column 'q2': q2 jumps by -6.28 at time 6.98"),
                                         HasSubstr("1 such jumps"), HasSubstr("one turn")));
}

TEST(LogChecks, NoteAJointThatNeverMoved) {
  Log log = sound_log();
  log.q.col(1).setConstant(0.4);
  log.qd.col(1).setZero();
  log.qdd.col(1).setZero();
  EXPECT_THAT(only_note(log), AllOf(HasSubstr("run.csv: joint 2 never moves (q2 stays within 0 rad)"),
                                    HasSubstr("log a motion of it")));
}

TEST(LogChecks, NoteTorquesInAnotherUnit) {
  Log log = sound_log();
  log.tau *= 1000.0;
  EXPECT_THAT(only_note(log), AllOf(HasSubstr("with a limit of 100 Nm"), HasSubstr("mNm")));
  log.tau *= 1e-6;
  EXPECT_THAT(only_note(log), HasSubstr("kNm"));
  log.tau *= 2.5e3;  // up to 80
  JointLimits with = limits();
  with.effort = Eigen::Vector3d(900.0, 300.0, 20.0);
  EXPECT_THAT(only_note(log, with), AllOf(HasSubstr("column 'tau3'"), HasSubstr("per cent")));
}

TEST(LogChecks, NoteRowsThatRepeatTheRowBefore) {
  Log log = sound_log();
  for (int k = 0; k < log.num_samples(); ++k) {
    for (Eigen::MatrixXd* channel : {&log.q, &log.qd, &log.qdd, &log.tau}) {
      channel->row(k) = channel->row(k - k % 4).eval();
    }
  }
  EXPECT_THAT(only_note(log), HasSubstr("75 % of the rows repeat the row before"));
}

TEST(LogChecks, NoteStampsThatComeLate) {
  Log log = sound_log();
  const double period = log.time[1] - log.time[0];
  for (int k = 200; k + 1 < log.num_samples(); k += 500) log.time[k] += 0.7 * period;
  EXPECT_THAT(only_note(log), AllOf(HasSubstr("run.csv: column 'time': "), HasSubstr("stamps come late by more than half a step"),
                                    HasSubstr(fmt::format("the first at {:.6g} s", log.time[200]))));
  // One in a hundred rows lost is no stamp that comes late.
  const Log whole = sound_log();
  std::vector<int> kept;
  for (int k = 0; k < whole.num_samples(); ++k) {
    if (k % 100 != 37) kept.push_back(k);
  }
  Log lossy = whole;
  lossy.time = whole.time(kept);
  for (Eigen::MatrixXd Log::*channel : {&Log::q, &Log::qd, &Log::qdd, &Log::tau}) lossy.*channel = (whole.*channel)(kept, Eigen::all);
  EXPECT_THAT(messages(check_log(lossy, limits()), Severity::kNote), IsEmpty());
}

TEST(LogChecks, NoteCoarsePositions) {
  Log log = sound_log();
  const double step = 0.05 / kDegreesPerRadian;
  log.q.col(2) = (log.q.col(2).array() / step).round() * step;
  EXPECT_THAT(only_note(log), HasSubstr("column 'q3': q3 comes in steps of 0.000873 rad (0.05 degrees)"));
}

/// The values of a column repeated over some rows.
void hold(Eigen::MatrixXd& channel, int joint, int from, int rows) {
  channel.col(joint).segment(from, rows).setConstant(channel(from, joint));
}

TEST(LogChecks, NameJumpsOfAPositionRatherThanDegrees) {
  Log log = sound_log();
  for (int k = 500; k < 3000; k += 500) log.q(k, 1) += 1.0;
  EXPECT_THAT(only_error(log),
              AllOf(HasSubstr("run.csv: column 'q2': q2 jumps by 0.992 rad from one row to the next at 2 s"),
                    HasSubstr("where 3 is the limit (10 such jumps until 10.004 s)"), HasSubstr("remove the wrong rows")));
  log.q *= kDegreesPerRadian;  // and in degrees the unit is named, whatever jumps
  EXPECT_THAT(only_error(log), HasSubstr("by pi/180"));
}

TEST(LogChecks, SayWhereRowsWereRepeatedInMotion) {
  const auto repeated = [](int rows) {
    Log log = sound_log();
    for (Eigen::MatrixXd* channel : {&log.q, &log.qd, &log.qdd, &log.tau}) {
      for (int joint = 0; joint < 3; ++joint) hold(*channel, joint, 1000, rows);
    }
    return log;
  };
  EXPECT_THAT(only_error(repeated(60)), AllOf(HasSubstr("at 4.24 s after 0.236 s at one value"), HasSubstr("; likewise q2 and q3")));
  // Little of a motion is a note.
  EXPECT_THAT(only_note(repeated(8)), HasSubstr("at 4.032 s after 0.028 s at one value"));
}

TEST(LogChecks, TakeNoStepOfAnEncoderForAJump) {
  Log log = sound_log();
  drop_rates(log);
  // In one row 0.03 rad are 7.5 rad/s.
  log.q = (log.q.array() / 0.03).round() * 0.03;
  EXPECT_THAT(only_note(log), HasSubstr("in steps of 0.03 rad"));
}

TEST(LogChecks, NoteATorqueThatStaysAtOneValue) {
  Log log = sound_log();
  hold(log.tau, 2, 1000, 1500);
  EXPECT_THAT(only_note(log), AllOf(HasSubstr("run.csv: column 'tau3': tau3 stays at exactly "), HasSubstr("from 4 to 9.996 s, while q3 moves by "),
                                    HasSubstr("(50 % of the log in 1 such stretch)")));
  hold(log.tau, 0, 1000, 500);
  EXPECT_THAT(only_note(log), HasSubstr("column 'tau1': tau1 stays at exactly"));
  EXPECT_THAT(only_note(log), HasSubstr("; likewise tau3"));
}

TEST(LogChecks, NoteATorqueThatIsCut) {
  Log log = sound_log();
  log.tau.col(1) = log.tau.col(1).cwiseMin(10.0).cwiseMax(-10.0);
  EXPECT_THAT(only_note(log), AllOf(HasSubstr("run.csv: column 'tau2': tau2 is cut at "), HasSubstr("stretches of up to "),
                                    HasSubstr("while q2 moves")));
}

TEST(LogChecks, TakeNoTorqueAtOneAccelerationForOneThatIsHeld) {
  // Without noise: masses and friction at one speed, or one acceleration, ask for one torque.
  Log log = sound_log();
  log.qd.resize(0, 0);
  log.qdd.resize(0, 0);
  for (int k = 0; k < log.num_samples(); ++k) {
    const double t = std::fmod(log.time[k], 4.0), back = t < 2.0 ? t : 4.0 - t;
    log.q(k, 0) = back;
    log.tau(k, 0) = t < 2.0 ? 3.0 : -3.0;
    log.q(k, 1) = t < 2.0 ? 0.5 * t * t : 2.0 + 2.0 * (t - 2.0) - 0.5 * (t - 2.0) * (t - 2.0) - (t - 2.0) * 2.0;
    log.tau(k, 1) = t < 2.0 ? 10.0 : -10.0;
    log.tau(k, 2) = 2.0 * std::round(log.tau(k, 2) / 2.0);  // coarse
  }
  for (const std::string& note : messages(check_log(log, limits()), Severity::kNote)) EXPECT_THAT(note, Not(HasSubstr("exactly")));
}

TEST(LogChecks, NoteATorqueOfSingleRows) {
  Log log = sound_log();
  log.tau(700, 0) = 3000.0;
  log.tau(1700, 0) = -3000.0;
  EXPECT_THAT(only_note(log), HasSubstr("run.csv: column 'tau1': tau1 is 3000 in one row at 2.8 s (2 such rows until 6.8 s)"));
  log.tau.block(700, 0, 3, 1).setConstant(3000.0);  // a torque that lasts is one
  EXPECT_THAT(messages(check_log(log, limits()), Severity::kNote), IsEmpty());
}

TEST(LogChecks, LookAtMetresOfAPrismaticJointAsMetres) {
  Log log = sound_log();
  JointLimits with = limits();
  with.prismatic = {true, true, true};
  log.q *= 10.0;
  drop_rates(log);
  EXPECT_THAT(only_note(log, with), HasSubstr("outside the limits"));
}

TEST(LogChecks, GiveTheSameInPartsAndThroughAStream) {
  Log log = sound_log();
  log.q *= kDegreesPerRadian;
  log.q.col(1).setConstant(3.0);
  hold(log.tau, 0, 900, 500);
  log.tau(2000, 2) = 1e3;
  const std::vector<LogFinding> whole = check_log(log, limits());
  const TemporaryFolder folder;
  write_log(folder.path("run.csv"), log);
  const MotionStream stream(folder.path("run.csv"), {});
  const std::vector<LogFinding> streamed = stream.check(limits());
  ASSERT_EQ(streamed.size(), whole.size());
  ASSERT_GE(whole.size(), 4u);
  for (std::size_t k = 0; k < whole.size(); ++k) {
    EXPECT_EQ(streamed[k].severity, whole[k].severity);
    const std::string at = folder.path("run.csv");
    EXPECT_EQ("run.csv" + streamed[k].message.substr(at.size()), whole[k].message);
  }
  EXPECT_THAT(message_of<DataError>([&] { refuse_errors(streamed); }), HasSubstr("rad in degrees"));
  EXPECT_NO_THROW(refuse_errors({{Severity::kNote, "only a note"}}));
}

/// The limits of a robot as a URDF gives them.
JointLimits limits_of(const model::Robot& robot) {
  JointLimits result;
  const auto n = static_cast<Eigen::Index>(robot.joints.size());
  for (Eigen::VectorXd* values : {&result.lower, &result.upper, &result.velocity, &result.effort})
    values->resize(n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const model::RobotJoint& joint = robot.joints[static_cast<std::size_t>(k)];
    result.lower[k] = joint.lower;
    result.upper[k] = joint.upper;
    result.velocity[k] = joint.velocity_limit;
    result.effort[k] = joint.effort_limit;
  }
  return result;
}

TEST(LogChecks, FindNothingButRestingJointsInTheMeasuredLogs) {
  const std::filesystem::path folder = HEFT_DATA_DIR;
  HEFT_NEEDS_MEASURED_DATA(folder);
  int count = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().extension() != ".csv") continue;
    SCOPED_TRACE(entry.path().string());
    const Log log = read_log(entry.path().string(), {});
    const std::filesystem::path urdf = entry.path().parent_path() / "robot.urdf";
    JointLimits with;
    if (std::filesystem::exists(urdf)) with = limits_of(urdf::load_urdf(urdf.string()));
    const std::vector<LogFinding> findings = check_log(log, with);
    EXPECT_THAT(messages(findings, Severity::kError), IsEmpty());
    // What the READMEs of these logs say as well: joints at rest, coarse encoders, repeated rows, a recorded
    // acceleration that is noise.
    const std::string name = entry.path().filename().string();
    const bool traps = name.find("recorded-qdd") != std::string::npos || name.find("target") == 0;
    for (const std::string& note : messages(findings, Severity::kNote)) {
      EXPECT_THAT(
          note,
          AnyOf(HasSubstr("never move"), HasSubstr("in steps of"), HasSubstr("of the rows repeat"),
                traps ? HasSubstr("nothing to do with the derivative of qd") : HasSubstr("never move")));
    }
    ++count;

    // The same log in degrees, or in milliseconds, is found out, where anything moves.
    if ((log.q.colwise().maxCoeff() - log.q.colwise().minCoeff()).maxCoeff() < 0.3) continue;
    Log slipped = log;
    slipped.q *= kDegreesPerRadian;
    EXPECT_THAT(message_of<DataError>([&] { refuse_errors(check_log(slipped, with)); }),
                HasSubstr("by pi/180"));
    slipped = log;
    slipped.time *= 1e3;
    EXPECT_THAT(message_of<DataError>([&] { refuse_errors(check_log(slipped, with)); }),
                HasSubstr("time in milliseconds"));
  }
  EXPECT_GE(count, 10);
}

}  // namespace
}  // namespace heft::data
