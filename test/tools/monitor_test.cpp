/// heft monitor as a user runs it: what it refuses, and what it writes for others.
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heft/host/file.hpp"
#include "support/run_heft.hpp"
#include "support/temporary_folder.hpp"

namespace heft {
namespace {

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
