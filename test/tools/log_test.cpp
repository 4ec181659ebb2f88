/// heft log as a user runs it, and logs of other programs given to another command.
#include <filesystem>
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

using ::testing::AllOf;
using ::testing::HasSubstr;

const std::string kSource = HEFT_SOURCE_DIR;
const std::string kForeign = kSource + "/test/data/foreign/";

std::string text_of(const std::string& path) { return host::read_file(path, "file"); }

TEST(LogCommand, SaysHowALogWasUnderstood) {
  const test::Outcome outcome = test::run_heft({"log", kForeign + "units.csv"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("units.csv: CSV, 120 rows of 4 joints at 50 Hz over 2.38 s"),
                                 HasSubstr("time in milliseconds, positions in degrees and millimetres"),
                                 HasSubstr("torque-constants: missing target torque tauref1..")));
}

TEST(LogCommand, NamesTorqueThatWasCommanded) {
  const test::Outcome outcome = test::run_heft({"log", kForeign + "rtde.csv"});
  EXPECT_THAT(outcome.out,
              HasSubstr("equal to the target torque (tauref1..) to the last bit: commanded, not measured"));
}

TEST(LogCommand, DescribesAsJson) {
  const test::TemporaryFolder folder;
  const std::string file = folder.path("log.json");
  ASSERT_EQ(test::run_heft({"log", kForeign + "own.csv", "--json", file}).exit_code, 0);
  const auto json = nlohmann::json::parse(text_of(file));
  EXPECT_EQ(json["logs"][0]["usable"], false);
  EXPECT_EQ(json["logs"][0]["rows"], 120);
  EXPECT_EQ(json["logs"][0]["missing"]["dynamics, retime, simulate --replay"], "time");
}

TEST(LogCommand, ConvertsToHeftsCsvToTheLastBit) {
  const test::TemporaryFolder folder;
  const std::string expected = folder.path("expected.csv"), out = folder.path("out.csv");
  ASSERT_EQ(test::run_heft({"log", kForeign + "run.csv", "-o", expected}).exit_code, 0);
  EXPECT_THAT(text_of(expected), HasSubstr("time,q1,q2,q3,q4,tau1,tau2,tau3,tau4,qd1"));
  for (const char* name : {"semicolon.csv", "tabs.txt", "run.csv.gz", "savetxt.txt"}) {
    ASSERT_EQ(test::run_heft({"log", kForeign + name, "-o", out}).exit_code, 0) << name;
    EXPECT_EQ(text_of(out), text_of(expected)) << name;
  }
}

TEST(LogCommand, JoinsOneFileASignal) {
  const test::TemporaryFolder folder;
  const std::string out = folder.path("out.csv");
  const test::Outcome joined = test::run_heft({"log", kForeign + "q.csv", kForeign + "tau.csv", "-o", out});
  ASSERT_EQ(joined.exit_code, 0) << joined.err;
  EXPECT_THAT(
      joined.out,
      HasSubstr("118 rows written, 1 without a partner in the other logs left out; stamps of rows that were "
                "joined differ by up to 0.0005 s"));
  EXPECT_THAT(text_of(out), HasSubstr("time,q1,q2,q3,q4,tau1,tau2,tau3,tau4\n0.02,0.05676,"));
  const std::string other = folder.write("other.csv", "time,torque_0\n100,1\n101,1\n");
  const std::string none = folder.path("none.csv");
  const test::Outcome apart = test::run_heft({"log", kForeign + "q.csv", other, "-o", none});
  EXPECT_EQ(apart.exit_code, 3);
  EXPECT_THAT(apart.err, HasSubstr("0 rows of 120 have a partner in every other log"));
  EXPECT_FALSE(std::filesystem::exists(none));
  EXPECT_THAT(test::run_heft({"log", kForeign + "q.csv", kForeign + "run.csv", "-o", none}).err,
              HasSubstr("run.csv: column 'q1' is in " + kForeign + "q.csv too"));
}

TEST(LogCommand, ABadRowLeavesNothingBehind) {
  const test::TemporaryFolder folder;
  const std::string bad = folder.write("bad.csv", "time;q1\n0;1\n1;x\n"), out = folder.path("out.csv");
  const test::Outcome outcome = test::run_heft({"log", bad, "-o", out});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("bad.csv:3: column 'q1': found 'x'"));
  EXPECT_FALSE(std::filesystem::exists(out));
  EXPECT_EQ(test::run_heft({"log", bad, "-o", out, "--json", "-"}).exit_code, 2);
}

TEST(LogCommand, AnyCommandTakesALogOfAnotherProgram) {
  const test::TemporaryFolder folder;
  const auto gravity = [&](const std::string& log, const std::vector<std::string>& options) {
    std::vector<std::string> words{
        "dynamics", "--urdf", "scara", "--what", "gravity", "--log", log, "-o", folder.path("g.csv")};
    words.insert(words.end(), options.begin(), options.end());
    const test::Outcome outcome = test::run_heft(words);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return text_of(folder.path("g.csv")) + "\n" + outcome.err;
  };
  const std::string expected = gravity(kForeign + "run.csv", {});
  EXPECT_THAT(gravity(kForeign + "plotjuggler.csv", {}),
              HasSubstr("plotjuggler.csv: read as CSV: time from __time, q from /joint_states/"));
  EXPECT_EQ(gravity(kForeign + "plotjuggler.csv", {}).substr(0, 2000), expected.substr(0, 2000));
  EXPECT_EQ(gravity(kForeign + "own.csv", {"--map", "time=k,q=pose", "--map", "tau=load"}).substr(0, 2000),
            expected.substr(0, 2000));
  const test::Outcome piped = test::piped_heft("dynamics --urdf scara --what gravity --log - -o g.csv",
                                               text_of(kForeign + "run.csv.gz"), folder.path("."));
  EXPECT_EQ(piped.exit_code, 0) << piped.err;
  EXPECT_EQ(text_of(folder.path("g.csv")).substr(0, 2000), expected.substr(0, 2000));
}

}  // namespace
}  // namespace heft
