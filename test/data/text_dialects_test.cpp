// Logs of other programs, written by them or by Python's libraries (foreign/make.py), read as heft's own CSV is.
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/data/describe_log.hpp"
#include "heft/data/live_log.hpp"
#include "heft/data/log.hpp"
#include "heft/data/log_set.hpp"
#include "heft/data/read_map.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "support/temporary_folder.hpp"

namespace heft::data {
namespace {

using heft::test::message_of;
using heft::test::TemporaryFolder;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

const std::string kFolder = HEFT_SOURCE_DIR "/test/data/foreign/";

Log read(const std::string& path, const ReadAs& as = {}, std::vector<std::string>* notes = nullptr) {
  LogRequirements needs;
  needs.as = as;
  return read_log(path, needs, notes);
}

Log read_text(const std::string& text, const ReadAs& as = {}, std::vector<std::string>* notes = nullptr) {
  const TemporaryFolder folder;
  return read(folder.write("log.csv", text), as, notes);
}

/// What is said of a file with this content, without its folder.
std::string refusal(const std::string& text, const ReadAs& as = {}, int num_joints = 0) {
  const TemporaryFolder folder;
  const std::string path = folder.write("log.csv", text);
  LogRequirements needs;
  needs.as = as;
  needs.num_joints = num_joints;
  const std::string message = message_of<DataError>([&] { read_log(path, needs); });
  EXPECT_TRUE(message.empty() || message.starts_with(path)) << message;
  return message.empty() ? message : "log.csv" + message.substr(path.size());
}

ReadAs mapped(const std::vector<std::string>& words) { return {"", {}, read_map(words)}; }

const Log& run() {
  static const Log log = read(kFolder + "run.csv");
  return log;
}

struct Dialect {
  std::string file;
  std::string note;  ///< in what is told
};

void PrintTo(const Dialect& dialect, std::ostream* out) { *out << dialect.file; }

class Dialects : public testing::TestWithParam<Dialect> {};

TEST_P(Dialects, ReadToTheLastBitAsHeftsCsv) {
  std::vector<std::string> notes;
  const Log log = read(kFolder + GetParam().file,
                       {"", {"shoulder_joint", "elbow_joint", "lift_joint", "roll_joint"}, {}}, &notes);
  EXPECT_EQ(run().num_samples(), 120);
  EXPECT_EQ(log.time, run().time);
  EXPECT_EQ(log.q, run().q);
  EXPECT_EQ(log.tau, run().tau);
  EXPECT_EQ(log.qd, run().qd);
  ASSERT_FALSE(notes.empty());
  EXPECT_THAT(notes.front(), HasSubstr(GetParam().file + ": read as " + GetParam().note));
}

INSTANTIATE_TEST_SUITE_P(
    Text, Dialects,
    testing::Values(
        Dialect{"semicolon.csv", "text separated by semicolons with decimal commas"},
        Dialect{"tabs.txt", "text separated by tabs"}, Dialect{"run.csv.gz", "CSV, packed by gzip"},
        Dialect{"savetxt.txt", "text separated by blanks"},
        Dialect{
            "rtde.csv",
            "text separated by blanks: time from timestamp, q from actual_q_0 to actual_q_3, tau from "
            "actual_current_as_torque_0 to actual_current_as_torque_3, qd from actual_qd_0 to actual_qd_3, qref from "
            "target_q_0 to target_q_3, tauref from target_moment_0 to target_moment_3"},
        Dialect{
            "libfranka.csv",
            "CSV: q from state.q[0] to state.q[3], tau from state.tau_J[0] to state.tau_J[3], qd from state.dq[0] to "
            "state.dq[3], qref from state.q_d[0] to state.q_d[3]; time in milliseconds"},
        Dialect{"rostopic.csv",
                "CSV: time from field.header.stamp, q from field.position0 to field.position3"},
        Dialect{"ros2.csv", "CSV: time from header.stamp.sec, q from position[0] to position[3]"},
        Dialect{"plotjuggler.csv", "CSV: time from __time, q from /joint_states/"}),
    [](const auto& dialect) {
      std::string name = dialect.param.file;
      for (char& c : name) c = c == '.' ? '_' : c;
      return name;
    });

TEST(TextDialects, AnExactHeftCsvGivesNoNote) {
  std::vector<std::string> notes;
  read(kFolder + "run.csv", {}, &notes);
  EXPECT_THAT(notes, IsEmpty());
}

TEST(TextDialects, PandasRowNumbersAreCarriedAlong) {
  const Log log = read(kFolder + "index.csv");
  EXPECT_EQ(log.q, run().q);
  EXPECT_EQ(log.extra.at(0).first, "unnamed_1");
}

TEST(TextDialects, UnitsOfTheHeaderAreConvertedAndNamed) {
  for (const char* file : {"units.csv", "unit_line.csv"}) {
    SCOPED_TRACE(file);
    std::vector<std::string> notes;
    const Log log = read(kFolder + file, {}, &notes);
    EXPECT_EQ(log.time, run().time);
    // Twelve digits were written.
    EXPECT_LT((log.q - run().q).cwiseAbs().maxCoeff(), 1e-11);
    EXPECT_LT((log.qd - run().qd).cwiseAbs().maxCoeff(), 1e-11);
    EXPECT_LT((log.tau - run().tau).cwiseAbs().maxCoeff(), 1e-10);
    ASSERT_EQ(notes.size(), 1U);
    EXPECT_THAT(notes[0],
                AllOf(HasSubstr("time in milliseconds"), HasSubstr("positions in degrees and millimetres")));
  }
  std::vector<std::string> notes;
  read(kFolder + "units.csv", {}, &notes);
  EXPECT_THAT(notes[0], HasSubstr("torques in mN·m and kN, velocities in rpm and mm/s"));
}

TEST(TextDialects, UnitsBehindAName) {
  const Log log = read_text("time_us,q_0_deg,pos_deg_1\n1,180,90\n2,180,90\n");
  EXPECT_EQ(log.num_joints(), 2);
  EXPECT_EQ(log.time[1], 2e-6);
  EXPECT_NEAR(log.q(0, 0), 3.14159265358979, 1e-14);
}

TEST(TextDialects, JointsAreCountedFrom0OrFrom1) {
  const Log zero = read_text("time,q0,q1,tau_0,tau_1,temp1,temp2\n0,1,2,3,4,5,6\n1,1,2,3,4,5,6\n");
  ASSERT_EQ(zero.num_joints(), 2);
  ASSERT_EQ(zero.tau.cols(), 2);
  ASSERT_EQ(zero.temperature.cols(), 2);
  EXPECT_EQ(zero.q.row(0), Eigen::RowVector2d(1, 2));
  EXPECT_EQ(zero.tau.row(0), Eigen::RowVector2d(3, 4));
  EXPECT_EQ(zero.temperature.row(0), Eigen::RowVector2d(5, 6));
  const Log one = read_text("t,joint1_pos,joint2_pos,J1 torque,J2 torque\n0,1,2,3,4\n1,1,2,3,4\n");
  ASSERT_EQ(one.num_joints(), 2);
  ASSERT_EQ(one.tau.cols(), 2);
  EXPECT_EQ(one.q.row(0), Eigen::RowVector2d(1, 2));
  EXPECT_EQ(one.tau.row(0), Eigen::RowVector2d(3, 4));
}

TEST(TextDialects, JointsGoIntoTheRobotsOrderByTheirNames) {
  const char* const text = "time,elbow.pos,gripper.pos,shoulder.pos\n0,2,9,1\n1,2,9,1\n";
  EXPECT_EQ(read_text(text, {"", {"shoulder", "elbow"}, {}}).q.row(0), Eigen::RowVector2d(1, 2));
  EXPECT_EQ(read_text(text).q.row(0), Eigen::RowVector3d(2, 9, 1)) << "of no robot: as they stand";
  EXPECT_THAT(refusal("time,elbow.pos\n0,2\n1,2\n", {"", {"shoulder", "elbow"}, {}}, 2),
              HasSubstr("column 'q1' is missing though 'q2' is there"));
}

TEST(TextDialects, MotorAnglesAndCommandsAreNoPositions) {
  const Log log =
      read_text("t,q_0,motor_position_0,desired_position_0,cmd.q[0],error/q[0]\n0,1,2,3,4,5\n1,1,2,3,4,5\n");
  EXPECT_EQ(log.q(0, 0), 1.0);
  EXPECT_EQ(log.qref(0, 0), 3.0);
  EXPECT_EQ(log.extra.size(), 3U);
}

TEST(TextDialects, ASensorOfAToolIsOfNoJoint) {
  std::vector<std::string> notes;
  const Log log = read_text("time,q1,tool.temperature,current_position\n0,1,2,3\n1,1,2,3\n", {}, &notes);
  EXPECT_EQ(log.temperature.cols(), 0);
  EXPECT_THAT(notes, testing::ElementsAre(
                         HasSubstr("carried along without use: tool.temperature, current_position")));
}

TEST(TextDialects, TwoColumnsThatWouldBeOneAreRefusedWithARemedy) {
  const char* const text = "time,position_0,pos_0\n0,1,2\n1,1,2\n";
  EXPECT_EQ(
      refusal(text),
      "log.csv:1: columns 'position_0' and 'pos_0' would both be q1; expected one; name the one to be used: --map "
      "q=position");
  EXPECT_EQ(read_text(text, mapped({"q=pos"})).q(0, 0), 2.0);
}

TEST(TextDialects, AMapNamesWhatIsNotRecognised) {
  const Log log = read(kFolder + "own.csv", mapped({"time=k", "q=pose", "tau=load"}));
  EXPECT_EQ(log.time, run().time);
  EXPECT_EQ(log.q, run().q);
  EXPECT_EQ(log.tau, run().tau);
  const TemporaryFolder folder;
  const std::string file = folder.write("map.json", R"({"time": "k", "q": "pose", "tau1": "load_3"})");
  const Log by_file = read(kFolder + "own.csv", mapped({file}));
  EXPECT_EQ(by_file.q, run().q);
  EXPECT_EQ(by_file.extra.at(3).first, "tau1") << "one torque of four is no channel";
  EXPECT_EQ(by_file.extra.at(3).second, run().tau.col(3));
  EXPECT_THAT(message_of<InputError>([] { read_map({"tau"}); }),
              HasSubstr("--map tau: found 'tau'; expected heft's name"));
  EXPECT_THAT(message_of<DataError>([] { read(kFolder + "own.csv", mapped({"torque=load"})); }),
              HasSubstr("'torque' is no name of heft; expected one of time, q, tau"));
  EXPECT_THAT(message_of<DataError>([] { read(kFolder + "own.csv", mapped({"q=pos"})); }),
              HasSubstr("--map q=pos: there is no column 'pos'; found k, pose_0"));
  // Misspelt, where the file has a torque by heft's own name.
  EXPECT_THAT(message_of<DataError>([] { read(kFolder + "run.csv", mapped({"tau=efort"})); }),
              HasSubstr("--map tau=efort: there is no column 'efort'; found time, q1"));
  EXPECT_THAT(message_of<DataError>([] { read(kFolder + "binary/none.mcap", mapped({"tau=efort"})); }),
              HasSubstr("--map tau=efort: there is no column 'efort'; found header.stamp, position of"));
}

TEST(TextDialects, TheMessageOfAMissingColumnSuggestsAMap) {
  EXPECT_THAT(
      message_of<DataError>([] { read(kFolder + "own.csv", mapped({"time=k"})); }),
      HasSubstr(
          "column 'q1' is missing; found time, pose_0, pose_1, pose_2, pose_3, load_0, load_1, load_2, load_3; "
          "expected joint positions q1, q2, ... [rad, m]; add them, or say which they are: --map q=pose (pose_0 to "
          "pose_3), --map q=load (load_0 to load_3)"));
}

TEST(TextDialects, ALogWithoutTimeNeedsItsRate) {
  EXPECT_THAT(message_of<DataError>([] { read(kFolder + "lbr.csv"); }),
              AllOf(HasSubstr("column 'time' is missing"), HasSubstr("--map time=500Hz")));
  std::vector<std::string> notes;
  const Log log = read(kFolder + "lbr.csv", mapped({"time=50Hz"}), &notes);
  EXPECT_EQ(log.time, run().time);
  EXPECT_EQ(log.tau, run().tau);
  EXPECT_THAT(notes.at(0), HasSubstr("time from 50 rows a second"));
  EXPECT_THAT(message_of<DataError>([] { read(kFolder + "lbr.csv", mapped({"time=0Hz"})); }),
              HasSubstr("above 0"));
}

TEST(TextDialects, StampsSince1970TellTheirUnitBySize) {
  for (const char* text :
       {"timestamp,q_0\n1700000000123456789,1\n1700000000133456789,1\n",
        "header.stamp.secs,header.stamp.nsecs,q_0\n1700000000,999999000,1\n1700000001,9999000,1\n"}) {
    const Log log = read_text(text);
    EXPECT_EQ(log.time[0], 0.0);
    EXPECT_EQ(log.time[1], 0.01);
  }
  EXPECT_NEAR(read_text("timestamp,q_0\n1700000000123,1\n1700000000133,1\n").time[0], 1700000000.123, 1e-6);
}

TEST(TextDialects, NanosecondsAreTakenForTimeOnlyBesideTheirSeconds) {
  // The name that heft gives the second part of a time, as somebody else's column.
  const std::string rows = "0,7,0.1,1\n1,8,0.2,2\n2,9,0.3,3\n";
  const Log log = read_text("time,time+ns,q1,tau1\n" + rows);
  EXPECT_EQ(log.time, Eigen::Vector3d(0, 1, 2));
  EXPECT_THAT(refusal("at,time+ns,q1,tau1\n" + rows), HasSubstr("time"));
  EXPECT_THAT(refusal("at,header.stamp.nanosec,q1,tau1\n" + rows), HasSubstr("time"));
}

TEST(TextDialects, BadTextIsRefusedWithOneMessage) {
  EXPECT_EQ(
      refusal("time,q1 [furlong]\n0,1\n1,1\n"),
      "log.csv:1: column 'q1 [furlong]': found the unit 'furlong'; expected one of rad, deg, mrad, rev, m, mm, cm for "
      "positions; convert the column, or take the unit out of the header if the numbers are in SI units");
  EXPECT_THAT(refusal("time,q1,qd1 [A]\n0,1,1\n1,1,1\n"),
              HasSubstr("found the unit 'A'; expected one of rad/s, deg/s"));
  EXPECT_EQ(
      refusal("time;q1\n0;1,5\n1;1.5\n"),
      "log.csv:3: found '1.5' with a decimal point though line 2 has decimal commas; expected one mark in all rows; write "
      "the log anew");
  EXPECT_THAT(refusal("time,q1\n0,5,1,5\n1,0,1,5\n"),
              HasSubstr("log.csv:2: column 'q1' is followed by more fields: found 4; expected 2"));
  EXPECT_THAT(refusal("time;q1;tau1\n0;1,5;1\n1;1,5\n"),
              HasSubstr("log.csv:3: column 'tau1' is missing: found 2 fields"));
  EXPECT_THAT(refusal("time q1\n0 1 2\n"), HasSubstr("log.csv:2: column 'q1' is followed by more fields"));
  EXPECT_THAT(refusal("0;1,5\n1;1,5\n"), HasSubstr("found the number '0' where a name is due"));
  EXPECT_THAT(refusal("# of a bench\n0 1.5\n1 1.5\n"), HasSubstr("found the number '0' where a name is due"));
  EXPECT_THAT(refusal("timestamp,q_0\n1700000000123456789,1\n1.5,1\n"),
              HasSubstr("column 'timestamp': found '1.5'; expected a whole"));
}

TEST(TextDialects, ADamagedGzipFileIsRefused) {
  const std::string packed = host::read_file(kFolder + "run.csv.gz", "log");
  const TemporaryFolder folder;
  const std::string cut = folder.write("cut.gz", packed.substr(0, packed.size() / 2));
  EXPECT_THAT(message_of<DataError>([&] { read(cut); }),
              HasSubstr("cut.gz: the gzip file ends before its data do"));
  std::string wrong = packed;
  wrong[packed.size() / 2] = static_cast<char>(wrong[packed.size() / 2] ^ 0x55);
  const std::string damaged = folder.write("damaged.gz", wrong);
  EXPECT_FALSE(message_of<DataError>([&] { read(damaged); }).empty());
  // Two files packed one behind the other are one file.
  const std::string half = folder.write("twice.gz", packed + packed);
  EXPECT_THAT(message_of<DataError>([&] { read(half); }), HasSubstr("twice.gz:122: "));
}

TEST(TextDialects, RowsThatArriveAreReadInTheirUnits) {
  const TemporaryFolder folder;
  const std::string path = folder.write("log.csv", "time;q1;tau1\nms;deg;Nm\n10;180;1,5\n20;x;1\n30;90;2\n");
  LogRequirements needs;
  needs.torque = true;
  std::vector<std::string> notes;
  LiveLog log(path, needs, [&](const std::string& note) { notes.push_back(note); });
  LiveRow row;
  ASSERT_TRUE(log.next(row));
  EXPECT_EQ(row.time, 0.01);
  EXPECT_NEAR(row.q[0], 3.14159265358979, 1e-14);
  EXPECT_EQ(row.tau[0], 1.5);
  ASSERT_TRUE(log.next(row));
  EXPECT_EQ(row.time, 0.03);
  EXPECT_FALSE(log.next(row));
  ASSERT_EQ(notes.size(), 2U);
  EXPECT_THAT(notes[0], HasSubstr("positions in degrees"));
  EXPECT_THAT(notes[1], HasSubstr("log.csv:4: "));
}

// --- seen in published data sets ---

TEST(PublishedLogs, DegreesBesideRpmBesideRadians) {
  const Log log = read_text(
      "time,pos_1 [deg],pos_2 [deg],speed_1 [rpm],speed_2 [rpm],ref_pos_1 [rad],ref_pos_2 [rad]\n0,180,90,30,60,3,1\n1,180,90,30,60,3,1\n");
  EXPECT_NEAR(log.q(0, 1), 1.5707963267949, 1e-13);
  EXPECT_NEAR(log.qd(0, 0), 3.14159265358979, 1e-13);
  EXPECT_EQ(log.qref(0, 0), 3.0);
}

TEST(PublishedLogs, ALastLineThatWasCutIsNamed) {
  EXPECT_THAT(refusal("timestamp actual_q_0 actual_q_1\n0 1 2\n0.008 1 2\n0.016 1"),
              HasSubstr("log.csv:4: column 'q2' is missing: found 2 fields; expected 3"));
}

TEST(PublishedLogs, AFolderOfAnyName) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder.path("机械臂 数据"));
  const std::string path = folder.write("机械臂 数据/一.csv", "time,关节位置_0\n0,1\n1,1\n");
  EXPECT_EQ(read(path, mapped({"q=关节位置"})).q(0, 0), 1.0);
}

TEST(PublishedLogs, TorqueInOneFileAndPositionsInAnother) {
  LogRequirements needs;
  needs.torque = true;
  const TemporaryFolder folder;
  const std::string path = folder.write("q.csv", "time,q_0\n0,1\n1,1\n");
  EXPECT_THAT(message_of<DataError>([&] { read_log(path, needs); }),
              HasSubstr("column 'tau1' is missing; found time, q1"));
}

/// A log of `rows` rows, torque and current of one joint.
std::string torque_log(int rows, double speed, const char* header, double per_ampere) {
  std::string text = std::string(header) + "\n";
  for (int k = 0; k < rows; ++k)
    text += fmt::format("{},{},{},{}\n", 0.01 * k, std::sin(speed * 0.01 * k), std::cos(0.03 * k),
                        std::cos(0.03 * k) / per_ampere);
  return text;
}

TEST(PublishedLogs, TorqueThatRepeatsInAnotherRunWasCommanded) {
  const TemporaryFolder folder;
  const std::string first = folder.write("1.csv", torque_log(300, 0.7, "time,q1,tau1,x", 2.0));
  const std::string second = folder.write("2.csv", torque_log(400, 0.8, "time,q1,tau1,x", 2.0));
  std::vector<LogDescription> logs = describe_logs({first, second});
  EXPECT_EQ(logs[0].torque, TorqueKind::kRepeated);
  EXPECT_EQ(logs[0].repeated_in, second);
  EXPECT_EQ(describe_logs({first, first})[0].torque, TorqueKind::kMeasured)
      << "the same motion has the same torque";
  EXPECT_EQ(describe_logs({first})[0].torque, TorqueKind::kMeasured);
  logs = describe_logs({folder.write("3.csv", torque_log(300, 0.7, "time,q1,tau1,i1", 9.5))});
  EXPECT_EQ(logs[0].torque, TorqueKind::kCurrent);
  EXPECT_NEAR(logs[0].torque_constant.at(0), 9.5, 1e-9);
  logs = describe_logs({folder.write("4.csv", torque_log(300, 0.7, "time,q1,tau1,tauref1", 1.0))});
  EXPECT_EQ(logs[0].torque, TorqueKind::kReference);
}

TEST(PublishedLogs, SixteenBitsOverTwentyFiveRadiansAreNamed) {
  std::string text = "time,q1,tau1\n";
  for (int k = 0; k < 1000; ++k) {
    const double q = std::sin(0.01 * k), tau = 5.0 * std::cos(0.01 * k);
    text += fmt::format("{},{},{}\n", 0.005 * k, std::round(q * 65535 / 25) * 25 / 65535,
                        std::round(tau * 4095 / 60) * 60 / 4095);
  }
  const TemporaryFolder folder;
  const LogDescription log = describe_logs({folder.write("log.csv", text)}).at(0);
  ASSERT_FALSE(log.findings.empty());
  EXPECT_THAT(log.findings[0].message, HasSubstr("in steps of 0.000381 rad"));
  EXPECT_TRUE(log.usable());
}

TEST(PublishedLogs, GapsAndTimeThatGoesBackAreCounted) {
  std::string text = "time,q1\n";
  for (int k = 0; k < 100; ++k)
    text += fmt::format("{},0.{}\n", k < 50 ? k : k + 20 + (k == 70 ? -90 : 0), k);
  const TemporaryFolder folder;
  const LogDescription log = describe_logs({folder.write("log.csv", text)}).at(0);
  EXPECT_EQ(log.rows, 100);
  EXPECT_EQ(log.period, 1.0);
  EXPECT_EQ(log.backwards, 1);
  EXPECT_EQ(log.longest_period, 91.0);
  EXPECT_EQ(log.gaps, 2);
  EXPECT_FALSE(log.usable());
}

}  // namespace
}  // namespace heft::data
