/// heft payload - as a user runs it: rows through a pipe, a line when something changes.
#include <cstdlib>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heft/data/log.hpp"
#include "heft/host/file.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/arms.hpp"
#include "support/measured_data.hpp"
#include "support/run_heft.hpp"
#include "support/synthetic_log.hpp"
#include "support/temporary_folder.hpp"

namespace heft {
namespace {

using Json = nlohmann::json;
using test::lines_of;
using test::Outcome;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double kLiveMass = 1.2;

/// A SCARA without load and with one, and its model.
class PayloadStream : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new test::TemporaryFolder;
    const model::Robot robot = urdf::load_urdf(urdf::resolve_robot("scara"));
    const model::Robot loaded =
        test::carrying(robot, test::body(kLiveMass, {0.02, 0, 0.03}, {0.002, 0, 0.002, 0, 0, 0.002}));
    test::SyntheticSettings settings;
    settings.noise = 0.01;
    settings.amplitude = 0.3;
    data::write_log(folder_->path("empty.csv"), test::synthetic_log(robot, settings));
    settings.motion_seed = settings.noise_seed = 2;
    data::write_log(folder_->path("carrying.csv"), test::synthetic_log(loaded, settings));
    const Outcome done = run({"payload", "--urdf", "scara", "--baseline", "empty.csv", "--log",
                              "carrying.csv", "--json", "whole.json", "-o", "bare.json"});
    ASSERT_EQ(done.exit_code, 0) << done.err;
  }
  static void TearDownTestSuite() { delete folder_; }

  static Outcome run(const std::vector<std::string>& arguments) {
    return test::run_heft(arguments, folder_->path(""));
  }
  static Outcome piped(const std::string& arguments, const std::string& input) {
    return test::piped_heft(arguments, input, folder_->path(""));
  }
  static std::string read(const std::string& name) { return host::read_file(folder_->path(name), "output"); }

  static constexpr const char* kStream = "payload - --urdf scara --model bare.json";
  static test::TemporaryFolder* folder_;
};
test::TemporaryFolder* PayloadStream::folder_ = nullptr;

TEST_F(PayloadStream, GivesTheLoadOfTheLogInLinesOfJson) {
  const Outcome live = piped(std::string(kStream) + " --json -", read("carrying.csv"));
  ASSERT_EQ(live.exit_code, 0) << live.err;
  const std::vector<std::string> lines = lines_of(live.out);
  ASSERT_GE(lines.size(), 2U) << live.out;
  const Json first = Json::parse(lines.front()), last = Json::parse(lines.back()),
             whole = Json::parse(read("whole.json"));
  EXPECT_EQ(first.at("event"), "known");
  EXPECT_LT(first.at("time").get<double>(), 15.0);
  EXPECT_NEAR(first.at("mass").at("value").get<double>(), kLiveMass, 0.15 * kLiveMass);
  EXPECT_EQ(last.at("event"), "end_of_stream");
  EXPECT_TRUE(last.at("mass").at("identifiable").get<bool>());
  const double mass = last.at("mass").at("value").get<double>(),
               of_log = whole.at("mass").at("value").get<double>();
  EXPECT_NEAR(mass, of_log, last.at("mass").at("half_width_95").get<double>());
  EXPECT_NEAR(mass, of_log, whole.at("mass").at("half_width_95").get<double>());
  EXPECT_EQ(last.at("changes"), whole.at("changes"));
  EXPECT_EQ(last.at("samples"), whole.at("samples"));
  EXPECT_THAT(live.err, HasSubstr("the load: 1."));  // the same in words
  const Outcome fitted = piped("payload - --urdf scara --baseline empty.csv --json -", read("carrying.csv"));
  EXPECT_EQ(lines_of(fitted.out).back(), lines.back());
}

TEST_F(PayloadStream, SaysTheLoadWithTheRowThatShowsItWhileTheRecorderRuns) {
  const Outcome whole = piped(std::string(kStream) + " --json -", read("carrying.csv"));
  const double time = Json::parse(lines_of(whole.out).front()).at("time").get<double>();
  test::Recorder recorder(kStream, folder_->path(""));
  ASSERT_TRUE(recorder.running());
  const std::vector<std::string> rows = lines_of(read("carrying.csv"));
  std::size_t row = 0;
  recorder.write(rows[row++]);
  while (std::atof(rows[row].c_str()) < time + 1e-9) recorder.write(rows[row++]);
  EXPECT_THAT(recorder.wait_for_words(), HasSubstr("the load: 1."));
  EXPECT_EQ(recorder.stop(), 0) << read("live.err");
  EXPECT_THAT(read("live.out"), HasSubstr("The load since 0.000 s: 1."));
}

TEST_F(PayloadStream, OutlivesRowsThatCannotBeUsedAndNamesThem) {
  std::vector<std::string> rows = lines_of(read("carrying.csv"));
  const std::string rest = rows[400].substr(rows[400].find(','));
  rows.insert(rows.begin() + 400, {"3.99,1", "nan" + rest, "0.001" + rest});
  std::string text;
  for (const std::string& row : rows) text += row + "\n";
  const Outcome clean = piped(std::string(kStream) + " --json -", read("carrying.csv")),
                live = piped(std::string(kStream) + " --json -", text);
  EXPECT_EQ(live.exit_code, 0) << live.err;
  for (const char* where : {"-:401: ", "-:402: column 'time'", "-:403: column 'time'"})
    EXPECT_THAT(live.err, HasSubstr(where));
  const Json a = Json::parse(lines_of(clean.out).back()), b = Json::parse(lines_of(live.out).back());
  EXPECT_EQ(b.at("mass"), a.at("mass"));
  EXPECT_EQ(b.at("refused").get<int>(), a.at("refused").get<int>() + 3);
}

TEST_F(PayloadStream, EndsWithAReasonWhereItIsNoneOrShowsNothing) {
  const auto expect = [](const Outcome& done, int code, const char* text) {
    EXPECT_EQ(done.exit_code, code) << done.err;
    EXPECT_THAT(done.err, HasSubstr(text));
  };
  expect(piped(kStream, "hello\n1\n"), 3, "-:1: ");
  const std::string log = read("carrying.csv");
  std::size_t end = 0;
  for (int line = 0; line < 51; ++line) end = log.find('\n', end) + 1;
  expect(piped(kStream, log.substr(0, end)), 4, "did not determine the load");
  expect(piped(std::string(kStream) + " --log carrying.csv", ""), 2, "--log does not go with '-'");
  expect(piped(std::string(kStream) + " --json out.json", ""), 2, "--json -");
  expect(piped("payload - --urdf scara", ""), 2, "--baseline NOLOAD.csv");
  expect(piped("payload --urdf scara --model bare.json", ""), 2, "'-' for rows on standard input");
  expect(piped(std::string(kStream) + " --rows 9", log), 3, "expected 1 to 4");
  expect(piped(std::string(kStream) + " --band 400", log), 3, "choose a lower cut-off");
  expect(piped("payload carrying.csv --urdf scara --model bare.json", log), 2, "--log carrying.csv");
  std::string backwards = log.substr(0, log.find('\n') + 1);
  const std::vector<std::string> rows = lines_of(log);
  for (std::size_t k = rows.size() - 1; k > 0; --k) backwards += rows[k] + "\n";
  expect(piped(kStream, backwards), 4, "most rows were left out");
  EXPECT_THAT(piped(std::string(kStream) + " --torque-constant 2", log).err,
              HasSubstr("torque constants are for logs without them"));
}

// 2.805 kg, with the torque constants taken off as the logs without load show them.
TEST(PayloadStreamOfUr10e, FindsTheKnownLoadWhileItIsPipedIn) {
  const std::string folder = HEFT_DATA_DIR "/ur10e-dynamic-calibration/";
  HEFT_NEEDS_MEASURED_DATA(folder);
  const test::TemporaryFolder here;
  const std::string robot = folder + "robot.urdf", load = folder + "exc-14h-50s-load2p805kg.csv";
  const Outcome fitted = test::run_heft({"payload", "--urdf", robot, "--baseline", folder + "exc-12h-50s.csv",
                                         "--log", load, "-o", "bare.json"},
                                        here.path(""));
  ASSERT_EQ(fitted.exit_code, 0) << fitted.err;
  const std::string with =
      "payload - --urdf " + test::shell_quote(robot) + " --model bare.json --json - --rows ";
  for (const int k : {1, 4}) {
    const Outcome live =
        test::piped_heft(with + std::to_string(k), host::read_file(load, "log"), here.path(""));
    ASSERT_EQ(live.exit_code, 0) << live.err;
    const std::vector<std::string> lines = lines_of(live.out);
    for (const std::string& line : lines) {
      const Json event = Json::parse(line);
      EXPECT_NEAR(event.at("mass").at("value").get<double>(), 2.805, 0.15 * 2.805) << line;
    }
    EXPECT_LT(Json::parse(lines.front()).at("time").get<double>(), k == 1 ? 10.0 : 11.0);
    const Json mass = Json::parse(lines.back()).at("mass");
    EXPECT_NEAR(mass.at("value").get<double>(), 2.805, 0.03 * 2.805) << "k = " << k;
    EXPECT_NEAR(mass.at("value").get<double>(), 2.805, mass.at("half_width_95").get<double>()) << "k = " << k;
  }
  const Outcome pushed =
      test::piped_heft(with + "1", host::read_file(folder + "push-pose-1.csv", "log"), here.path(""));
  EXPECT_EQ(pushed.exit_code, 4) << "a person who pushes is no load";
  EXPECT_EQ(lines_of(pushed.out).size(), 1U) << pushed.out;
}

}  // namespace
}  // namespace heft
