/// heft monitor as a user runs it: what it refuses, and what it writes for others.
#include <chrono>
#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heft/host/file.hpp"
#include "support/run_heft.hpp"
#include "support/temporary_folder.hpp"

namespace heft {
namespace {

using test::lines_of;
using test::Outcome;
using test::run_heft;
using ::testing::AllOf;
using ::testing::HasSubstr;

/// A model and three logs of it: two free, one touched.
class MonitorCommand : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new test::TemporaryFolder;
    const std::string inputs = HEFT_SOURCE_DIR "/test/golden/inputs/";
    for (const char* log : {"train", "judge", "touched"}) {
      ASSERT_EQ(
          run({"simulate", "--scenario", inputs + log + ".json", "-o", std::string(log) + ".csv"}).exit_code,
          0);
    }
    ASSERT_EQ(run({"identify", "--urdf", "scara", "--log", "train.csv", "--split", "0", "-o", "arm.json"})
                  .exit_code,
              0);
    ASSERT_EQ(run({"monitor", "--model", "arm.json", "--learn", "judge.csv", "-o", "watched.json"}).exit_code,
              0);
  }
  static void TearDownTestSuite() { delete folder_; }

  static Outcome run(const std::vector<std::string>& arguments) {
    return run_heft(arguments, folder_->path(""));
  }

  static std::string read(const std::string& name) { return host::read_file(folder_->path(name), "output"); }
  /// heft with `input` on its standard input.
  static Outcome piped(const std::string& arguments, const std::string& input) {
    return test::piped_heft(arguments, input, folder_->path(""));
  }

  static test::TemporaryFolder* folder_;
};
test::TemporaryFolder* MonitorCommand::folder_ = nullptr;

TEST_F(MonitorCommand, WritesContactsWithTheFieldsThatScriptsRelyOn) {
  const Outcome done = run({"monitor", "--model", "watched.json", "--log", "touched.csv", "--json", "-"});
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const nlohmann::json json = nlohmann::json::parse(done.out);
  ASSERT_EQ(json.at("contacts").size(), 2U);  // the scenario pushes at 4 s and at 8 s, with flanks of 60 ms
  EXPECT_NEAR(json.at("contacts")[0].at("begin").get<double>(), 4.0, 0.06);
  EXPECT_NEAR(json.at("contacts")[1].at("begin").get<double>(), 8.0, 0.06);
  for (const nlohmann::json& contact : json.at("contacts")) {
    EXPECT_GT(contact.at("end").get<double>(), contact.at("begin").get<double>());
    EXPECT_FALSE(contact.at("joints").empty());
    EXPECT_GT(contact.at("peak").get<double>(), 0.0);
  }
  for (const char* field : {"value", "low", "high"})
    EXPECT_TRUE(json.at("false_alarms_per_hour").contains(field));
  EXPECT_EQ(json.at("thresholds").size(), 4U);
  EXPECT_EQ(json.at("delay").size(), 4U);
}

TEST_F(MonitorCommand, AStreamGivesTheContactsOfTheLog) {
  const Outcome whole = run({"monitor", "--model", "watched.json", "--log", "touched.csv", "--json", "-"});
  const Outcome live = piped("monitor - --model watched.json --json -", read("touched.csv"));
  ASSERT_EQ(live.exit_code, 0) << live.err;
  const std::vector<std::string> lines = lines_of(live.out);
  ASSERT_EQ(lines.size(), 5U) << live.out;  // two contacts begin and end; the summary
  const nlohmann::json contacts = nlohmann::json::parse(whole.out).at("contacts");
  ASSERT_EQ(contacts.size(), 2U);
  EXPECT_EQ(nlohmann::json::parse(lines[4]).at("contacts"), contacts);
  for (std::size_t k = 0; k < 2; ++k) {
    const nlohmann::json begins = nlohmann::json::parse(lines[2 * k]),
                         ends = nlohmann::json::parse(lines[2 * k + 1]);
    EXPECT_EQ(begins.at("event"), "begins");
    EXPECT_EQ(begins.at("time"), contacts[k].at("begin"));
    EXPECT_EQ(begins.at("joint"), contacts[k].at("joint"));
    EXPECT_EQ(begins.at("direction"), contacts[k].at("direction"));
    EXPECT_EQ(ends.at("event"), "ends");
    EXPECT_EQ(ends.at("time"), contacts[k].at("end"));
    EXPECT_EQ(ends.at("peak"), contacts[k].at("peak"));
  }
}

TEST_F(MonitorCommand, AStreamTellsOfAContactWithTheRowThatShowsIt) {
  const Outcome whole = run({"monitor", "--model", "watched.json", "--log", "touched.csv", "--json", "-"});
  const double begin = nlohmann::json::parse(whole.out).at("contacts").at(0).at("begin").get<double>();
  test::Recorder recorder("monitor - --model watched.json", folder_->path(""));
  ASSERT_TRUE(recorder.running());
  const std::vector<std::string> rows = lines_of(read("touched.csv"));
  std::size_t row = 0;
  recorder.write(rows[row++]);
  while (std::atof(rows[row].c_str()) < begin - 1e-9) recorder.write(rows[row++]);
  recorder.hand_over();
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  EXPECT_EQ(recorder.said(), "");
  recorder.write(rows[row]);  // the row whose sample begins the contact, and none behind it
  const std::string told = recorder.wait_for_words();
  EXPECT_THAT(told, HasSubstr("contact begins on joint"));
  EXPECT_EQ(lines_of(told).size(), 1U) << told;
  EXPECT_EQ(recorder.stop(), 0) << read("live.err");
  EXPECT_THAT(read("live.out"), HasSubstr("1 contact, the first at"));
}

TEST_F(MonitorCommand, AStreamOutlivesRowsThatCannotBeUsed) {
  std::vector<std::string> rows = lines_of(read("touched.csv"));
  const std::string good = rows[400];
  const std::string rest = good.substr(good.find(','));
  // Lines 401 to 405 of what is read: too few fields, not a number, time that goes back, nothing, a field too many.
  rows.insert(rows.begin() + 400, {"3.99,1", "nan" + rest, "0.001" + rest, "", good + ",7"});
  std::string text;
  for (const std::string& row : rows) text += row + "\n";
  text += rows.back().substr(0, 12);  // the recorder was stopped inside a row
  const Outcome clean = piped("monitor - --model watched.json --json -", read("touched.csv"));
  const Outcome live = piped("monitor - --model watched.json --json -", text);
  EXPECT_EQ(live.exit_code, 0) << live.err;
  for (const char* where : {"-:401: ", "-:402: column 'time'", "-:403: column 'time'", "-:405: "})
    EXPECT_THAT(live.err, HasSubstr(where));
  const nlohmann::json a = nlohmann::json::parse(lines_of(clean.out).back()),
                       b = nlohmann::json::parse(lines_of(live.out).back());
  EXPECT_EQ(b.at("contacts"), a.at("contacts"));
  EXPECT_EQ(b.at("samples"), a.at("samples"));
  EXPECT_EQ(b.at("refused").get<int>() - a.at("refused").get<int>(), 5);
}

TEST_F(MonitorCommand, AStreamWhoseTorqueContradictsTheRobotIsRefusedAsALogIs) {
  std::string text;
  for (std::string row : lines_of(read("touched.csv"))) {
    std::size_t field = 0;
    for (int comma = 0; comma < 7; ++comma) field = row.find(',', field) + 1;  // tau3
    if (!text.empty()) row.insert(field, "-");
    const std::size_t twice = row.find("--", field);
    if (twice == field) row.erase(field, 2);
    text += row + "\n";
  }
  host::write_file_atomically(folder_->path("flipped.csv"), text);
  const char* said = "the torque contradicts the robot: tau3 fits with the opposite sign";
  const Outcome live = piped("monitor - --model watched.json", text),
                log = run({"monitor", "--model", "watched.json", "--log", "flipped.csv"});
  EXPECT_EQ(live.exit_code, 3) << live.out;
  EXPECT_EQ(log.exit_code, 3) << log.out;
  EXPECT_THAT(live.err, HasSubstr(std::string("-: ") + said));
  EXPECT_THAT(log.err, HasSubstr(std::string("flipped.csv: ") + said));
  EXPECT_THAT(live.out, testing::Not(HasSubstr("samples taken")));
  const Outcome accepted = piped("monitor - --model watched.json --accept-torque", text);
  EXPECT_EQ(accepted.exit_code, 0) << accepted.err;
  EXPECT_THAT(accepted.err, HasSubstr("warning: -: tau3 fits with the opposite sign"));
}

TEST_F(MonitorCommand, AStreamThatIsNoLogEndsAtItsHeader) {
  const Outcome live = piped("monitor - --model watched.json", "hello\n1\n");
  EXPECT_EQ(live.exit_code, 3);
  EXPECT_THAT(live.err, AllOf(HasSubstr("-:1: "), HasSubstr("expected")));
  EXPECT_EQ(piped("monitor - --model watched.json --log touched.csv", "").exit_code, 2);
  EXPECT_EQ(piped("monitor - --model watched.json --json out.json", "").exit_code, 2);
  EXPECT_EQ(piped("monitor - --model watched.json --report out.html", "").exit_code, 2);
  const Outcome misplaced = piped("monitor touched.csv --model watched.json", "");
  EXPECT_EQ(misplaced.exit_code, 2);
  EXPECT_THAT(misplaced.err, HasSubstr("--log touched.csv"));
}

// "Nothing touched the arm" is an answer, and rows that were not judged give none.
TEST_F(MonitorCommand, AStreamInWhichNothingCouldBeJudgedIsNoGoodNews) {
  const std::vector<std::string> rows = lines_of(read("touched.csv"));
  std::string first = rows[0] + "\n", backwards = first;
  for (std::size_t k = 1; k < 4; ++k) first += rows[k] + "\n";
  for (std::size_t k = rows.size() - 1; k > 0; --k) backwards += rows[k] + "\n";
  for (const std::string& text : {rows[0] + "\n", first, backwards}) {
    const Outcome live = piped("monitor - --model watched.json", text);
    EXPECT_EQ(live.exit_code, 4) << live.out;
    EXPECT_THAT(live.err, HasSubstr("-: nothing could be judged: "));
    EXPECT_THAT(live.out, testing::Not(HasSubstr("Nothing touched")));
  }
}

TEST_F(MonitorCommand, ThresholdsOfTheMotorsTorqueAreNoneOfASensors) {
  const Outcome done = run({"monitor", "--model", "watched.json", "--log", "touched.csv", "--torque-at",
                            "joint", "--accept-torque"});
  EXPECT_EQ(done.exit_code, 3) << done.out;
  EXPECT_THAT(done.err, HasSubstr("found thresholds of torque at the motor; expected the joint"));
}

TEST_F(MonitorCommand, RefusesLogsThatItKnowsAlready) {
  for (const char* log : {"judge.csv", "train.csv"}) {
    const Outcome done = run({"monitor", "--model", "watched.json", "--log", log});
    EXPECT_EQ(done.exit_code, 3) << log;
    EXPECT_THAT(done.err, AllOf(HasSubstr(log), HasSubstr("expected"))) << log;
  }
  const Outcome both = run({"monitor", "--model", "arm.json", "--learn", "judge.csv", "--log", "judge.csv"});
  EXPECT_NE(both.exit_code, 0);
}

TEST_F(MonitorCommand, SaysWhatIsMissing) {
  const auto expect = [](const Outcome& done, int code, const char* text) {
    EXPECT_EQ(done.exit_code, code) << done.err;
    EXPECT_THAT(done.err, HasSubstr(text));
  };
  expect(run({"monitor", "--log", "touched.csv"}), 2, "give one with --model");
  expect(run({"monitor", "--model", "arm.json"}), 2, "--learn FREE.csv");
  expect(run({"monitor", "--model", "watched.json", "--log", "touched.csv", "-o", "x.json"}), 2,
         "nothing to write");
  expect(run({"monitor", "--model", "arm.json", "--log", "touched.csv"}), 3, "learn them with --learn");
  expect(run({"monitor", "--model", "arm.json", "--learn", "judge.csv", "--rate", "0"}), 2, "--rate");
}

TEST_F(MonitorCommand, ALogWithoutTorqueIsRefusedBeforeAnythingIsLearnt) {
  std::string text = host::read_file(folder_->path("judge.csv"), "log");
  const std::size_t at = text.find("tau1");
  ASSERT_NE(at, std::string::npos);
  text.replace(at, 4, "tauX");
  host::write_file_atomically(folder_->path("without.csv"), text);
  const Outcome done = run({"monitor", "--model", "arm.json", "--learn", "without.csv"});
  EXPECT_EQ(done.exit_code, 3);
  EXPECT_THAT(done.err, HasSubstr("without.csv"));
}

TEST_F(MonitorCommand, TheModelWithThresholdsIsStillAModel) {
  EXPECT_EQ(run({"validate", "--model", "watched.json", "--log", "judge.csv"}).exit_code, 0);
  const Outcome header = run({"export", "--model", "watched.json", "-o", "-"});
  EXPECT_EQ(header.exit_code, 0);
  EXPECT_THAT(header.out, HasSubstr("kThresholds"));
  EXPECT_THAT(run({"export", "--model", "arm.json", "-o", "-"}).out,
              ::testing::Not(HasSubstr("kThresholds")));
}

}  // namespace
}  // namespace heft
