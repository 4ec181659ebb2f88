#include "heft/data/log_set.hpp"

#include <filesystem>
#include <fstream>
#include <functional>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/data/log_part.hpp"
#include "heft/host/error.hpp"
#include "support/temporary_folder.hpp"

namespace heft::data {
namespace {

using heft::test::message_of;
using heft::test::TemporaryFolder;
using std::numbers::pi;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr double kDegrees = 180.0 / pi;

std::vector<JointSpec> joints() { return {3, {JointType::kRevolute, -3.05, 3.05, 3.0, 100.0}}; }

/// Three joints in sines of up to 2.4 rad and 2 rad/s at 250 Hz for 16 s, with qd, qdd and tau, all with noise.
Log sound_log(unsigned seed, double from = 0.0) {
  Log log;
  log.path = "run.csv";
  const int rows = 4000;
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 1.0);
  log.time = Eigen::VectorXd::LinSpaced(rows, from, from + (rows - 1) / 250.0);
  for (Eigen::MatrixXd* channel : {&log.q, &log.qd, &log.qdd, &log.tau}) channel->resize(rows, 3);
  for (int k = 0; k < rows; ++k) {
    for (int joint = 0; joint < 3; ++joint) {
      const double amplitude = 1.0 + 0.7 * joint;
      const double omega = 2.0 * pi * (0.23 - 0.05 * joint);
      const double phase = omega * (k / 250.0) + joint + seed;
      log.q(k, joint) = amplitude * std::sin(phase) + 1e-5 * noise(random);
      log.qd(k, joint) = amplitude * omega * std::cos(phase) + 0.01 * noise(random);
      log.qdd(k, joint) = -amplitude * omega * omega * std::sin(phase) + 0.05 * noise(random);
      log.tau(k, joint) = 30.0 * std::sin(phase) + noise(random);
    }
  }
  return log;
}

Log rows_of(const Log& log, Eigen::Index first, Eigen::Index count) {
  return part_of(log, log.time[first] - 1e-6, log.time[first + count - 1] + 1e-6);
}

Log after(Log log, double seconds) {
  log.time.array() += seconds;
  return log;
}

class LogSets : public testing::Test {
 protected:
  std::string file(const std::string& name, const Log& log) {
    const std::string path = folder_.path(name);
    write_log(path, log);
    return path;
  }
  /// Why a log is not accepted to judge on beside another to fit to; both ways, from files and from memory.
  std::string refusal(const Log& train, const Log& judge) {
    const std::string of_memory = message_of<DataError>([&] { (void)log_set(joints(), {train}, {judge}); });
    LogFiles files;
    files.train = {file("train.csv", train)};
    files.judge = {file("judge.csv", judge)};
    const std::string of_files = message_of<DataError>([&] { (void)open_logs(joints(), files); });
    EXPECT_EQ(of_memory.empty(), of_files.empty()) << of_memory << "\n" << of_files;
    return of_files;
  }

  TemporaryFolder folder_;
};

TEST_F(LogSets, KeepsLogsOfOtherMotionsApart) {
  LogFiles files;
  files.train = {file("a.csv", sound_log(1)), file("b.csv", sound_log(2))};
  files.judge = {file("c.csv", sound_log(3))};
  const LogSet logs = open_logs(joints(), files);
  ASSERT_EQ(logs.train().size(), 2u);
  ASSERT_EQ(logs.judge().size(), 1u);
  EXPECT_EQ(logs.judge()[0].path, files.judge[0]);
  EXPECT_EQ(read(logs.judge()[0]).tau, sound_log(3).tau);
  EXPECT_EQ(stream(logs.train()[1]).summary().samples, 4000);
  EXPECT_THAT(logs.notes(), IsEmpty());
  EXPECT_EQ(logs.how(), "judged on logs that the fit has not seen");
}

TEST_F(LogSets, RefusesTheSameFileUnderAnotherName) {
  LogFiles files;
  files.train = {file("a.csv", sound_log(1))};
  files.judge = {folder_.path("./a.csv")};
  EXPECT_THAT(message_of<DataError>([&] { (void)open_logs(joints(), files); }),
              AllOf(HasSubstr("the same file as"), HasSubstr("expected a log that the fit has not seen")));
}

TEST_F(LogSets, RefusesACopyWhateverItsClockShows) {
  EXPECT_THAT(refusal(sound_log(1), sound_log(1)), HasSubstr("the same samples as"));
  EXPECT_THAT(refusal(sound_log(1), after(sound_log(1), 1234.5)), HasSubstr("the same samples as"));
}

// Two changes that are one bit each, the highest, do not cancel.
TEST_F(LogSets, TakesALogThatDiffersInTheSignsOfTwoTorques) {
  Log other = sound_log(1);
  other.tau.leftCols(2) *= -1.0;
  EXPECT_THAT(refusal(sound_log(1), other), IsEmpty());
}

TEST_F(LogSets, RefusesAPartOfATrainingLogAndTheWholeOfAPart) {
  const Log whole = sound_log(1), part = after(rows_of(whole, 1500, 900), -6.0);
  EXPECT_THAT(refusal(whole, part), HasSubstr("a part of"));
  EXPECT_THAT(refusal(part, whole), HasSubstr("holds all of"));
}

TEST_F(LogSets, RefusesLogsThatOverlap) {
  const Log whole = sound_log(1);
  EXPECT_THAT(refusal(rows_of(whole, 0, 2500), rows_of(whole, 2480, 1500)), HasSubstr("holds a part of"));
  EXPECT_THAT(refusal(rows_of(whole, 0, 2500), rows_of(whole, 2500, 1500)), IsEmpty());
}

TEST_F(LogSets, AcceptsLogsThatBeginAtRestInTheSamePose) {
  Log a = sound_log(1), b = sound_log(2);
  for (Log* log : {&a, &b}) {
    log->q.rowwise() -= log->q.row(200).eval();
    log->q.topRows(200).setZero();
    log->tau.topRows(200).setConstant(3.0);
    log->qd.resize(0, 0);
    log->qdd.resize(0, 0);
  }
  const std::vector<JointSpec> unlimited(3);
  EXPECT_NO_THROW((void)log_set(unlimited, {a}, {b}));
}

TEST_F(LogSets, FindsAShortPartOfALongLog) {
  // Longer than the number of runs of rows that are kept one by one.
  Log whole;
  whole.path = "long.csv";
  const int rows = 1'500'000;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> step(-1e-4, 1e-4);
  whole.time = Eigen::VectorXd::LinSpaced(rows, 0.0, (rows - 1) / 1000.0);
  whole.q.resize(rows, 1);
  whole.tau.resize(rows, 1);
  double q = 0.0;
  for (int k = 0; k < rows; ++k) {
    q += step(random);
    whole.q(k, 0) = q;
    whole.tau(k, 0) = 10.0 * step(random);
  }
  const Log part = rows_of(whole, 1'234'567, 400);
  const std::vector<JointSpec> joint(1);
  EXPECT_THAT(message_of<DataError>([&] { (void)log_set(joint, {whole}, {part}); }), HasSubstr("a part of"));
}

TEST_F(LogSets, RefusesUnitSlips) {
  const auto slip = [&](const std::function<void(Log&)>& change) {
    Log log = sound_log(1);
    change(log);
    LogFiles files;
    files.judge = {file("slip.csv", log)};
    const std::string of_files = message_of<DataError>([&] { (void)open_logs(joints(), files); });
    EXPECT_EQ(of_files.empty(), message_of<DataError>([&] { (void)log_set(joints(), {log}, {}); }).empty());
    return of_files;
  };
  EXPECT_THAT(slip([](Log&) {}), IsEmpty());
  EXPECT_THAT(slip([](Log& log) { log.q *= kDegrees, log.qd *= kDegrees, log.qdd *= kDegrees; }),
              HasSubstr("degrees"));
  EXPECT_THAT(slip([](Log& log) { log.time *= 1000.0; }), HasSubstr("milliseconds"));
  EXPECT_THAT(slip([](Log& log) { log.qd = -log.qd; }), HasSubstr("sign"));
  EXPECT_THAT(slip([](Log& log) { log.qd *= kDegrees; }), HasSubstr("degrees"));
}

TEST_F(LogSets, SplitsASingleLogOfWhichNoSampleIsInBothParts) {
  LogFiles files;
  files.train = {file("a.csv", sound_log(1))};
  files.split = 0.6;
  const LogSet logs = open_logs(joints(), files);
  ASSERT_EQ(logs.train().size(), 1u);
  ASSERT_EQ(logs.judge().size(), 1u);
  const Log first = read(logs.train()[0]), second = read(logs.judge()[0]);
  EXPECT_EQ(first.num_samples() + second.num_samples(), 4000);
  EXPECT_LT(first.time[first.num_samples() - 1], second.time[0]);
  EXPECT_NEAR(first.num_samples(), 2400, 60);
  EXPECT_GT(logs.train()[0].cutoff, 0.0);
  EXPECT_EQ(logs.train()[0].cutoff, logs.judge()[0].cutoff);
  EXPECT_EQ(stream(logs.judge()[0]).summary().cutoff, logs.train()[0].cutoff);
  EXPECT_EQ(logs.how(), "fitted to the first 60 % of the motion, judged on the rest");
  EXPECT_THAT(logs.train_paths(), ElementsAre(files.train[0]));

  files.split = 0.0;
  EXPECT_THAT(open_logs(joints(), files).judge(), IsEmpty());
}

TEST_F(LogSets, RefusesLogsThatAModelHasSeen) {
  LogFiles files;
  files.judge = {file("judge.csv", rows_of(sound_log(1), 500, 1000))};
  const LogSet logs = open_logs(joints(), files);
  std::vector<std::string> notes;
  refuse_seen(logs, {"/nowhere/a.csv", file("other.csv", sound_log(2))}, &notes);
  EXPECT_THAT(
      notes,
      ElementsAre(HasSubstr("/nowhere/a.csv: the model was fitted to this log, which cannot be read")));
  const std::string train = file("train.csv", sound_log(1));
  EXPECT_THAT(message_of<DataError>([&] { refuse_seen(logs, {train}); }),
              AllOf(HasSubstr("judge.csv: a part of"), HasSubstr("which the model is fitted to")));
  EXPECT_THAT(message_of<DataError>([&] { refuse_seen(logs, {files.judge[0]}); }),
              HasSubstr("the same file"));
}

TEST_F(LogSets, LeavesOutRatesThatContradictThePositions) {
  Log log = sound_log(1);
  log.qdd.col(1) = sound_log(9).tau.col(0);
  LogFiles files;
  files.judge = {file("a.csv", log)};
  const LogSet logs = open_logs(joints(), files);
  std::vector<std::string> notes;
  const Log whole = read(logs.judge()[0], &notes);
  EXPECT_EQ(whole.qd.cols(), 3);
  EXPECT_EQ(whole.qdd.cols(), 0);
  EXPECT_THAT(notes, ElementsAre(HasSubstr("it is not used")));
  const MotionLog motion = read_motion(logs.judge()[0]);
  EXPECT_TRUE(motion.motion.acceleration_derived);
  EXPECT_EQ(motion.log.qdd.cols(), 3);
}

// Samples on an even clock, stamped by whoever received them.
TEST_F(LogSets, PlaceSamplesThatTheStampsMisplace) {
  const auto stamped_late = [](Log log) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> late(0.0, 0.4 / 250.0);
    for (double& t : log.time) t += late(random);
    return log;
  };
  const Log train = stamped_late(sound_log(1)), judge = stamped_late(sound_log(2));
  LogFiles files;
  files.train = {file("a.csv", train)};
  files.judge = {file("b.csv", judge)};
  const LogSet of_files = open_logs(joints(), files), of_memory = log_set(joints(), {train}, {judge});
  const auto scatter = [](const Eigen::VectorXd& time) {
    const Eigen::Index steps = time.size() - 1;
    return ((time.tail(steps) - time.head(steps)).array() * 250.0 - 1.0).abs().maxCoeff();
  };
  for (const LogSet* logs : {&of_files, &of_memory}) {
    const Log placed = read(logs->train()[0]);
    EXPECT_LT(scatter(placed.time), 0.01);
    EXPECT_EQ(placed.q, train.q);
    Eigen::Index rows = 0;
    stream(logs->train()[0]).for_each([&](const MotionChunk& piece) {
      EXPECT_EQ(piece.row_time, placed.time.segment(rows, piece.row_time.size()));
      rows += piece.row_time.size();
    });
    EXPECT_EQ(rows, train.num_samples());
    EXPECT_EQ(stream(logs->train()[0]).summary().begin, placed.time[0]);
    ASSERT_EQ(logs->notes().size(), 2u) << "one a log";
    EXPECT_THAT(logs->notes()[0], HasSubstr("samples are placed accordingly"));
    EXPECT_THAT(stream(logs->train()[0]).summary().notes, IsEmpty()) << "it was told when they were opened";
  }
  EXPECT_EQ(read(of_files.judge()[0]).time, read(of_memory.judge()[0]).time);

  // Cut in two, it is placed before.
  files.judge.clear();
  const LogSet parts = open_logs(joints(), files);
  EXPECT_LT(scatter(read(parts.train()[0]).time), 0.01);
  // Who opens a single log is told by its stream.
  EXPECT_THAT(MotionStream(files.train[0], {}).summary().notes, ElementsAre(HasSubstr("samples are placed accordingly")));
  // A caller's log in memory is what the caller says.
  EXPECT_GT(scatter(train.time), 0.1);
  EXPECT_TRUE(MotionStream(train).summary().notes.empty());
}

TEST_F(LogSets, RefusesWhatIsNoLogOfTheRobot) {
  LogFiles files;
  files.judge = {file("a.csv", sound_log(1))};
  files.robot = "twolink";
  EXPECT_THAT(message_of<DataError>([&] { (void)open_logs(std::vector<JointSpec>(2), files); }),
              HasSubstr("twolink"));
  EXPECT_THAT(message_of<DataError>([&] { (void)log_set(std::vector<JointSpec>(2), {sound_log(1)}, {}); }),
              HasSubstr("3 joints; expected 2"));
  Log ragged = sound_log(1);
  ragged.tau.conservativeResize(100, 3);
  EXPECT_THAT(message_of<DataError>([&] { (void)log_set(joints(), {ragged}, {}); }),
              HasSubstr("tau is 100 x 3"));
}

}  // namespace
}  // namespace heft::data
