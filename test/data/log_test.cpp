#include "heft/data/log.hpp"

#include <cmath>
#include <filesystem>
#include <limits>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/data/log_part.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "support/measured_data.hpp"
#include "support/temporary_folder.hpp"

namespace heft::data {
namespace {

using heft::test::message_of;
using heft::test::TemporaryFolder;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// What read_log says of a file with this content, with the folder's name taken off.
std::string refusal(const std::string& content, const LogRequirements& needs = {}) {
  const TemporaryFolder folder;
  const std::string path = folder.write("log.csv", content);
  const std::string message = message_of<DataError>([&] { read_log(path, needs); });
  EXPECT_EQ(message.substr(0, path.size()), path) << "the message must begin with the file";
  return message.empty() ? message : "log.csv" + message.substr(path.size());
}

Log read(const std::string& content, const LogRequirements& needs = {},
         std::vector<std::string>* notes = nullptr) {
  const TemporaryFolder folder;
  return read_log(folder.write("log.csv", content), needs, notes);
}

LogRequirements with_torque() {
  LogRequirements needs;
  needs.torque = true;
  return needs;
}

// --- what is read ---

TEST(Log, ReadsEveryChannelOfTheContract) {
  const Log log = read(
      "time,q1,q2,tau1,tau2,i1,i2,qd1,qd2,qdd1,qdd2,qref1,qref2,qdref1,qdref2,temp1,temp2\n"
      "0.5,1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16\n"
      "0.7,-1,-2,-3,-4,-5,-6,-7,-8,-9,-10,-11,-12,-13,-14,-15,-16\n");
  ASSERT_EQ(log.num_samples(), 2);
  ASSERT_EQ(log.num_joints(), 2);
  EXPECT_EQ(log.time, Eigen::Vector2d(0.5, 0.7));
  double expected = 1.0;
  for (const Eigen::MatrixXd* channel :
       {&log.q, &log.tau, &log.current, &log.qd, &log.qdd, &log.qref, &log.qdref, &log.temperature}) {
    ASSERT_EQ(channel->rows(), 2);
    ASSERT_EQ(channel->cols(), 2);
    for (int joint = 0; joint < 2; ++joint, ++expected) {
      EXPECT_EQ((*channel)(0, joint), expected);
      EXPECT_EQ((*channel)(1, joint), -expected);
    }
  }
  EXPECT_TRUE(log.extra.empty());
}

TEST(Log, TakesColumnsInAnyOrder) {
  const Log log = read("q2,tau1,time,q1,tau2\n2,3,0,1,4\n2,3,1,1,4\n");
  EXPECT_EQ(log.q.row(0), Eigen::RowVector2d(1, 2));
  EXPECT_EQ(log.tau.row(1), Eigen::RowVector2d(3, 4));
}

TEST(Log, LeavesAbsentChannelsEmpty) {
  const Log log = read("time,q1\n0,1\n1,2\n");
  EXPECT_EQ(log.qd.cols(), 0);
  EXPECT_EQ(log.tau.cols(), 0);
  EXPECT_EQ(log.temperature.cols(), 0);
}

TEST(Log, AcceptsWhatEditorsAndSpreadsheetsLeaveBehind) {
  const Log plain = read("time,q1,q2\n0,1.5,-2e-3\n0.1,2,30\n");
  for (const char* text : {"time,q1,q2\r\n0,1.5,-2e-3\r\n0.1,2,30\r\n",          // carriage returns
                           "time,q1,q2\n0,1.5,-2e-3\n0.1,2,30",                  // no line end at the end
                           "time,q1,q2\n0,1.5,-2e-3\n0.1,2,30\n\n",              // a blank line at the end
                           "time,q1,q2\r\n0,1.5,-2e-3\r\n0.1,2,30\r\n\r\n  \n",  // several
                           " time , q1,\tq2\n 0 ,  1.5 ,-2e-3 \n0.1\t,2, 30\n",  // spaces
                           "\"time\",\"q1\",\"q2\"\n0,1.5,-2e-3\n0.1,2,30\n",    // quoted names
                           "\xEF\xBB\xBFtime,q1,q2\n0,1.5,-2e-3\n0.1,2,30\n",    // byte-order mark
                           "time,q1,q2\n+0,+1.5,-0.002E+00\n1e-1,.2E1,3e+1\n"}) {
    const Log log = read(text);
    EXPECT_EQ(log.time, plain.time) << text;
    EXPECT_EQ(log.q, plain.q) << text;
  }
}

TEST(Log, TakesNumbersTooSmallForADoubleAsZero) {
  EXPECT_EQ(read("time,q1\n0,1e-400\n1,-1e-400\n").q.col(0), Eigen::Vector2d(0, 0));
}

TEST(Log, KeepsUnknownColumnsAndSaysSoOnce) {
  std::vector<std::string> notes;
  const Log log = read("time,q1,force1,mode,q2,qlink2\n0,1,5,auto,2,7\n1,1,6,hold,2,8\n", {}, &notes);
  ASSERT_EQ(log.extra.size(), 2u);
  EXPECT_EQ(log.extra[0].first, "force1");
  EXPECT_EQ(log.extra[0].second, Eigen::Vector2d(5, 6));
  EXPECT_EQ(log.extra[1].first, "qlink2");
  EXPECT_EQ(log.extra[1].second, Eigen::Vector2d(7, 8));
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_THAT(notes[0], HasSubstr("columns carried along without use: force1;"));
  EXPECT_THAT(notes[0], HasSubstr("ignored because they do not hold numbers only: mode ('auto' in line 2)"));
}

TEST(Log, SaysWhichJointOfAGroupOfColumnsIsMissing) {
  std::vector<std::string> notes;
  const Log log = read("time,q1,q2,temp1,qd2\n0,1,5,20,2\n1,1,6,21,2\n", {}, &notes);
  EXPECT_EQ(log.temperature.size(), 0);
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_THAT(notes[0], HasSubstr("columns qd.. ignored because qd1 is missing; columns temp.. ignored because temp2 is missing"));
}

TEST(Log, SaysNothingOfColumnsThatSomeQuestionUses) {
  std::vector<std::string> notes;
  const Log log = read("time,q1,tauref1,iref1,qlink1\n0,1,5,1,2\n1,1,6,2,2\n", {}, &notes);
  EXPECT_EQ(log.extra.size(), 3u);
  EXPECT_TRUE(notes.empty());
}

TEST(Log, LetsGoOfAnUnknownColumnThatTurnsToTextLate) {
  const Log log = read("time,q1,a,b\n0,1,5,7\n1,1,nan,8\n2,1,5,9\n");
  ASSERT_EQ(log.extra.size(), 1u);
  EXPECT_EQ(log.extra[0].first, "b");
  EXPECT_EQ(log.extra[0].second, Eigen::Vector3d(7, 8, 9));
}

TEST(Log, CarriesAnIncompleteOptionalChannelAlong) {
  std::vector<std::string> notes;
  const Log log = read("time,q1,q2,temp1\n0,1,2,30\n1,1,2,31\n", {}, &notes);
  EXPECT_EQ(log.temperature.cols(), 0);
  ASSERT_EQ(log.extra.size(), 1u);
  EXPECT_EQ(log.extra[0].first, "temp1");
  ASSERT_EQ(notes.size(), 1u);
}

TEST(Log, HasNoNoteWhenEveryColumnIsKnown) {
  std::vector<std::string> notes;
  read("time,q1\n0,1\n1,2\n", {}, &notes);
  EXPECT_THAT(notes, IsEmpty());
}

TEST(Log, MakesTorqueFromCurrent) {
  LogRequirements needs = with_torque();
  needs.torque_constant = {10.0, 20.0};
  const Log log = read("time,q1,q2,i1,i2\n0,0,0,1,2\n1,0,0,3,4\n", needs);
  EXPECT_EQ(log.tau.row(0), Eigen::RowVector2d(10, 40));
  EXPECT_EQ(log.tau.row(1), Eigen::RowVector2d(30, 80));
  EXPECT_EQ(log.current.row(1), Eigen::RowVector2d(3, 4));
  needs.torque_constant = {-2.0};
  EXPECT_EQ(read("time,q1,q2,i1,i2\n0,0,0,1,2\n1,0,0,3,4\n", needs).tau.row(1), Eigen::RowVector2d(-6, -8));
}

TEST(Log, PrefersLoggedTorqueToCurrent) {
  LogRequirements needs = with_torque();
  needs.torque_constant = {10.0};
  EXPECT_EQ(read("time,q1,i1,tau1\n0,0,1,5\n1,0,1,6\n", needs).tau.col(0), Eigen::Vector2d(5, 6));
}

// --- what is refused, word by word where people will read it ---

TEST(Log, RefusesAMissingFile) {
  const TemporaryFolder folder;
  const std::string path = folder.path("none.csv");
  EXPECT_EQ(message_of<DataError>([&] { read_log(path, {}); }),
            path + ": cannot read the log: No such file or directory; check the path");
}

TEST(Log, RefusesAnEmptyFile) {
  EXPECT_EQ(refusal(""),
            "log.csv: the log is empty; expected a header line (time,q1,...) and rows of numbers");
  EXPECT_THAT(refusal(" \r\n\n"), HasSubstr("the log is empty"));
}

TEST(Log, RefusesALogThatWasCutInsideItsLastNumber) {
  const auto log = [](const char* last) {
    std::string text = "time,q1\n";
    for (int k = 0; k < 10; ++k) text += std::to_string(k) + ",-1.250\n";
    return text + last;
  };
  EXPECT_EQ(
      refusal(log("10,-1.2")),
      "log.csv:12: column 'q1': found '-1.2' and the end of the file; expected 3 decimals as in every row "
      "before, and a line feed: the log was cut inside this number; remove the line");
  EXPECT_THAT(refusal(log("10,-1")), HasSubstr("cut inside this number"));
  // Whole numbers, and logs whose numbers are as long as they need to be, are read whether or not a line feed ends them.
  for (const char* last : {"10,-1.250", "10,-1.25\n", "10,-1\n"})
    EXPECT_EQ(read(log(last)).num_samples(), 11);
  EXPECT_EQ(read("time,q1\n0,1.25\n1,1.5\n2,1").num_samples(), 3);
}

TEST(Log, RefusesWhatIsNoTextBeforeItFillsTheMemory) {
  EXPECT_THAT(refusal(std::string(400000, '\0')), HasSubstr("log.csv:1: found a zero byte"));
  EXPECT_THAT(refusal("time,q1\n0,1\n" + std::string(1000, '\0')), HasSubstr("log.csv:1: found a zero byte"));
  EXPECT_THAT(refusal("time,q1\n0,1\n" + std::string(40 << 20, '1')),
              HasSubstr("log.csv:3: found a line of more than 16 million bytes"));
}

TEST(Log, RefusesALogWithoutTime) {
  EXPECT_EQ(
      refusal("clock,q1\n0,1\n1,2\n"),
      "log.csv:1: column 'time' is missing; found clock, q1; expected a column time [s]; add it, say which column it is "
      "(--map time=COLUMN), or give the rate of the rows (--map time=500Hz)");
}

TEST(Log, RefusesALogWithoutPositions) {
  EXPECT_EQ(refusal("time,qd1\n0,1\n1,2\n"),
            "log.csv:1: column 'q1' is missing; found time, qd1; expected joint positions q1, q2, ... [rad, "
            "m]; add them");
}

TEST(Log, RefusesAGapInThePositions) {
  EXPECT_EQ(refusal("time,q1,q3\n0,1,1\n1,2,1\n"),
            "log.csv:1: column 'q2' is missing though 'q3' is there; expected q1 to q3 without a gap; add or "
            "rename it");
}

TEST(Log, RefusesMissingTorque) {
  EXPECT_EQ(refusal("time,q1,q2,tau1\n0,1,1,1\n1,2,1,1\n", with_torque()),
            "log.csv:1: column 'tau2' is missing; found time, q1, q2, tau1; expected joint torques [Nm, N] "
            "tau1 to tau2; "
            "add the measured torques");
  EXPECT_THAT(refusal("time,q1,i1\n0,1,1\n1,2,1\n", with_torque()),
              HasSubstr("or give the torque constant [Nm/A]"));
  LogRequirements needs = with_torque();
  needs.torque_constant = {3.0};
  EXPECT_THAT(refusal("time,q1,q2,i1\n0,1,1,1\n1,2,1,1\n", needs), HasSubstr("or all currents i1.."));
}

TEST(Log, RefusesMissingVelocityAndAcceleration) {
  LogRequirements needs;
  needs.velocity = true;
  EXPECT_EQ(refusal("time,q1\n0,1\n1,2\n", needs),
            "log.csv:1: column 'qd1' is missing; found time, q1; expected joint velocities [rad/s, m/s] qd1 "
            "to qd1; "
            "add them or let them be derived from q");
  needs.acceleration = true;
  EXPECT_THAT(refusal("time,q1,qd1\n0,1,1\n1,2,1\n", needs),
              HasSubstr("log.csv:1: column 'qdd1' is missing"));
}

TEST(Log, RefusesTorqueConstantsThatDoNotFit) {
  LogRequirements needs = with_torque();
  needs.torque_constant = {1.0, 2.0, 3.0};
  EXPECT_THAT(refusal("time,q1,q2,i1,i2\n0,1,1,1,1\n1,2,1,1,1\n", needs),
              HasSubstr("3 torque constants were given, the log has 2 joints; expected 1 or 2"));
  for (const double constant : {0.0, std::numeric_limits<double>::quiet_NaN()}) {
    needs.torque_constant = {constant};
    EXPECT_THAT(refusal("time,q1,i1\n0,1,1\n1,1,1\n", needs),
                HasSubstr("cannot be used; expected a finite value"));
  }
}

TEST(Log, RefusesARaggedRow) {
  EXPECT_EQ(refusal("time,q1,q2\n0,1,1\n1,2\n2,1,1\n"),
            "log.csv:3: column 'q2' is missing: found 2 fields; expected 3 as in the header; complete or "
            "remove the row");
  EXPECT_EQ(refusal("time,q1,q2\n0,1,1\n1,2,3,4\n"),
            "log.csv:3: column 'q2' is followed by more fields: found 4; expected 3 as in the header; "
            "remove the surplus (a decimal comma also looks like this)");
  EXPECT_THAT(refusal("time,q1,q2\n0,1,1\n1,2,\n2,1"),
              HasSubstr("log.csv:3: column 'q2': found an empty field"));
  EXPECT_THAT(refusal("time,q1,q2\n0,1,1\n1,"),
              HasSubstr("log.csv:3: column 'q2' is missing: found 2 fields"));
  EXPECT_THAT(refusal("time,q1,mode\n0,1,a\n1,2\n2,1,a\n"), HasSubstr("log.csv:3: column 'mode' is missing"));
}

TEST(Log, RefusesABlankLineBetweenRows) {
  EXPECT_EQ(refusal("time,q1\n0,1\n\n \n1,2\n"),
            "log.csv:3: column 'time': found a blank line between rows; expected 2 fields in every row; "
            "remove the blank line");
}

TEST(Log, RefusesTextWhereANumberIsDue) {
  EXPECT_EQ(refusal("time,q1,q2\n0,1,1\n1,abc,2\n"),
            "log.csv:3: column 'q1': found 'abc'; expected a number (decimal point, no unit); correct or "
            "remove the row");
  EXPECT_THAT(refusal("time,q1\n0,1\n1,12deg\n"), HasSubstr("log.csv:3: column 'q1': found '12deg'"));
  EXPECT_THAT(refusal("time,q1\n0,1\n1,1 2\n"), HasSubstr("log.csv:3: column 'q1': found '1 2'"));
  EXPECT_THAT(refusal("time,q1\n0,1\n1,0x10\n"), HasSubstr("found '0x10'"));
  EXPECT_THAT(refusal("time,q1\n0,1\n1,+-1\n"), HasSubstr("found '+-1'"));
  EXPECT_THAT(refusal("time,q1\n0,1\n1,-\n"), HasSubstr("found '-'"));
}

TEST(Log, RefusesNumbersThatAreNotFinite) {
  EXPECT_EQ(
      refusal("time,q1,tau1\n0,1,1\n1,1,NaN\n"),
      "log.csv:3: column 'tau1': found 'NaN'; expected a finite number; remove the row or repair the value");
  EXPECT_THAT(refusal("time,q1\n0,1\n1,-inf\n"),
              HasSubstr("log.csv:3: column 'q1': found '-inf'; expected a finite"));
  EXPECT_THAT(refusal("time,q1\nnan,1\n1,1\n"), HasSubstr("log.csv:2: column 'time': found 'nan'"));
  EXPECT_THAT(refusal("time,q1\n0,1\n1,1e999\n"),
              HasSubstr("log.csv:3: column 'q1': found '1e999', which is too large"));
}

TEST(Log, RefusesTimeThatDoesNotIncrease) {
  EXPECT_EQ(
      refusal("time,q1\n0,1\n0.13,1\n0.12,1\n"),
      "log.csv:4: column 'time': found 0.12 after 0.13 (line 3); expected time to increase with every row; "
      "remove repeated rows or sort the log");
  EXPECT_THAT(refusal("time,q1\n0,1\n0.5,1\n0.5,1\n"),
              HasSubstr("log.csv:4: column 'time': found 0.5 after 0.5 (line 3)"));
}

TEST(Log, RefusesTooFewSamples) {
  EXPECT_EQ(refusal("time,q1\n0,1\n"),
            "log.csv:2: column 'time': the log ends after 1 samples; expected at least 2; give a longer log");
  EXPECT_THAT(refusal("time,q1\n"), HasSubstr("log.csv:1: column 'time': the log ends after 0 samples"));
  LogRequirements needs;
  needs.min_samples = 4;
  EXPECT_THAT(refusal("time,q1\n0,1\n1,1\n2,1\n", needs), HasSubstr("after 3 samples; expected at least 4"));
  needs.min_samples = 3;
  EXPECT_EQ(read("time,q1\n0,1\n1,1\n2,1\n", needs).num_samples(), 3);
}

TEST(Log, RefusesAJointCountThatIsNotTheRobots) {
  LogRequirements needs;
  needs.num_joints = 3;
  needs.robot_name = "ur5e";
  EXPECT_EQ(refusal("time,q1,q2\n0,1,1\n1,1,1\n", needs),
            "log.csv:1: column 'q2': the log has 2 joints (q1 to q2), robot 'ur5e' has 3; expected q1 to q3; "
            "give the log of this robot or name the right URDF, base and tip link");
  needs.num_joints = 2;
  EXPECT_EQ(read("time,q1,q2\n0,1,1\n1,1,1\n", needs).num_joints(), 2);
}

TEST(Log, RefusesColumnsThatAreThereTwice) {
  EXPECT_EQ(
      refusal("time,q1,q2,q1\n0,1,1,1\n1,1,1,1\n"),
      "log.csv:1: column 'q1' is there twice (fields 2 and 4); expected every name once; rename or drop one");
}

TEST(Log, RefusesRowsSeparatedByAnotherLetterThanTheHeader) {
  EXPECT_EQ(
      refusal("time,q1\n0;1\n1;1\n"),
      "log.csv:2: found fields separated by semicolons though those of the header are by commas; expected one in all "
      "lines; write the log anew");
  EXPECT_THAT(refusal("time;q1\n0\t1\n"), HasSubstr("log.csv:2: column 'q1' is missing: found 1 fields"));
}

TEST(Log, RefusesALogWithoutHeader) {
  EXPECT_THAT(
      refusal("0.5,1,2\n1,1,2\n"),
      HasSubstr("log.csv:1: column 1: found the number '0.5' where a name is due; expected a header line"));
}

TEST(Log, SurvivesAFileThatIsNoTextAtAll) {
  std::mt19937 random(7);
  std::string noise;
  for (int k = 0; k < 4096; ++k) noise += static_cast<char>(random() & 255);
  EXPECT_THAT(refusal(noise), HasSubstr("log.csv:1:"));
}

// --- what is written ---

TEST(Log, WritesTheContractsColumnOrder) {
  Log log =
      read("mode,qdd1,temp1,qd1,time,i1,tau1,q1,qref1,qdref1\n1,2,3,4,0,5,6,7,8,9\n1,2,3,4,1,5,6,7,8,9\n");
  const std::string csv = to_csv(log);
  EXPECT_EQ(csv.substr(0, csv.find('\n')), "time,q1,tau1,i1,qd1,qdd1,qref1,qdref1,temp1,mode");
}

TEST(Log, ReadsBackExactlyWhatItWrote) {
  std::mt19937_64 random(20240117);
  std::uniform_real_distribution<double> mantissa(-1.0, 1.0);
  std::uniform_int_distribution<int> exponent(-300, 300);
  Log log;
  const int rows = 200;
  log.time = Eigen::VectorXd::LinSpaced(rows, -0.1, 1.0 / 3.0);
  log.q =
      Eigen::MatrixXd::NullaryExpr(rows, 3, [&] { return std::ldexp(mantissa(random), exponent(random)); });
  log.tau = Eigen::MatrixXd::NullaryExpr(rows, 3, [&] { return mantissa(random); });
  log.extra.emplace_back("odd", Eigen::VectorXd::LinSpaced(rows, 0, 1));
  const TemporaryFolder folder;
  write_log(folder.path("out.csv"), log);
  const Log back = read_log(folder.path("out.csv"), with_torque());
  EXPECT_EQ(back.time, log.time);
  EXPECT_EQ(back.q, log.q);
  EXPECT_EQ(back.tau, log.tau);
  ASSERT_EQ(back.extra.size(), 1u);
  EXPECT_EQ(back.extra[0].second, log.extra[0].second);
}

TEST(Log, DoesNotWriteChannelsOfUnequalLength) {
  Log log;
  log.time = Eigen::Vector3d(0, 1, 2);
  log.q = Eigen::MatrixXd::Zero(2, 1);
  EXPECT_THAT(message_of<Error>([&] { to_csv(log); }), HasSubstr("q has 2 rows, time has 3"));
}

TEST(PartOf, HoldsEveryColumnOfTheRowsBetween) {
  Log log;
  log.path = "run.csv";
  log.time = Eigen::VectorXd::LinSpaced(11, 0.0, 1.0);
  log.q = Eigen::MatrixXd::Random(11, 2);
  log.tau = Eigen::MatrixXd::Random(11, 2);
  log.qref = Eigen::MatrixXd::Random(11, 2);
  log.extra.emplace_back("qlink2", Eigen::VectorXd::LinSpaced(11, 5.0, 6.0));
  const Log part = part_of(log, 0.25, 0.6);
  EXPECT_EQ(part.path, "run.csv [0.3 s, 0.5 s]");
  EXPECT_EQ(part.time, Eigen::VectorXd(log.time.segment(3, part.time.size())));
  EXPECT_GE(part.time[0], 0.25);
  EXPECT_LT(part.time[part.time.size() - 1], 0.6);
  EXPECT_EQ(part.q, Eigen::MatrixXd(log.q.middleRows(3, part.time.size())));
  EXPECT_EQ(part.tau, Eigen::MatrixXd(log.tau.middleRows(3, part.time.size())));
  EXPECT_EQ(part.qref, Eigen::MatrixXd(log.qref.middleRows(3, part.time.size())));
  EXPECT_EQ(part.qd.size(), 0);
  ASSERT_EQ(part.extra.size(), 1U);
  EXPECT_EQ(part.extra[0].first, "qlink2");
  EXPECT_EQ(part.extra[0].second, Eigen::VectorXd(log.extra[0].second.segment(3, part.time.size())));
  EXPECT_EQ(part_of(log, -1.0, 9.0).q, log.q);
  EXPECT_EQ(part_of(log, 2.0, 9.0).num_samples(), 0);
  EXPECT_EQ(part_of(log, 0.6, 0.2).num_samples(), 0);
}

TEST(Log, ReadsTheMeasuredLogs) {
  const std::filesystem::path folder = HEFT_DATA_DIR;
  HEFT_NEEDS_MEASURED_DATA(folder);
  int count = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().extension() != ".csv") continue;
    SCOPED_TRACE(entry.path().string());
    std::vector<std::string> notes;
    const Log log = read_log(entry.path().string(), with_torque(), &notes);
    EXPECT_GE(log.num_samples(), 1000);
    EXPECT_EQ(log.tau.cols(), log.num_joints());
    EXPECT_TRUE(log.q.allFinite());
    EXPECT_LE(notes.size(), 1u);
    ++count;
  }
  EXPECT_GE(count, 10);
}

}  // namespace
}  // namespace heft::data
