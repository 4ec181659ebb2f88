/// The heft command as a user runs it: texts, exit codes, files.
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heft/host/file.hpp"
#include "support/measured_data.hpp"
#include "support/run_heft.hpp"
#include "support/temporary_folder.hpp"

namespace heft {
namespace {

using test::Outcome;
using test::run_heft;
using test::shell_quote;
using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

/// Two links of 2 and 1 kg, turning about y in the x-z plane, length 0.5 m, friction at the second joint.
constexpr const char* kArm = R"(<?xml version="1.0"?>
<robot name="two_links">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.25 0 0"/><mass value="2"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.05"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0.25 0 0"/><mass value="1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.03"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="100" velocity="3"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.5 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="100" velocity="3"/><dynamics friction="0.5" damping="0.25"/></joint>
</robot>
)";

constexpr const char* kLog =
    "time,q1,q2,qd1,qd2,qdd1,qdd2\n"
    "0,0,0,0,0,0,0\n"
    "0.01,0,0,0,2,0,0\n"
    "0.02,-1.5707963267948966,0,0,-2,0,0\n";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  if (at == std::string::npos) throw std::logic_error("not in the text: " + from);
  return text.replace(at, from.size(), to);
}

/// Rows of numbers under a header line.
struct Csv {
  std::vector<std::string> header;
  std::vector<std::vector<double>> rows;
};

std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream stream(line);
  std::string cell;
  while (std::getline(stream, cell, ',')) cells.push_back(cell);
  return cells;
}

Csv parse_csv(const std::string& text) {
  Csv csv;
  std::istringstream lines(text);
  std::string line;
  std::getline(lines, line);
  csv.header = split(line);
  while (std::getline(lines, line)) {
    std::vector<double> row;
    for (const std::string& cell : split(line)) row.push_back(std::stod(cell));
    csv.rows.push_back(row);
  }
  return csv;
}

// Help and usage ---------------------------------------------------------------------------------------------

TEST(Command, HelpListsEveryCommandOfTheContract) {
  const Outcome run = run_heft({"--help"});
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(run.err, IsEmpty());
  for (const char* name : {"dynamics", "simulate", "excite", "identify", "validate", "diagnose", "payload",
                           "track", "stiffness", "export", "reproduce", "demo"}) {
    EXPECT_THAT(run.out, HasSubstr(std::string("\n  ") + name)) << name;
  }
  EXPECT_THAT(run.out, HasSubstr("Exit codes"));
}

TEST(Command, EveryReadyCommandExplainsItself) {
  for (const std::string name :
       {"dynamics", "simulate", "excite", "identify", "validate", "diagnose", "export"}) {
    const Outcome run = run_heft({name, "--help"});
    EXPECT_EQ(run.exit_code, 0) << name;
    EXPECT_THAT(run.out, AllOf(HasSubstr("Example: heft " + name), HasSubstr("--output"))) << name;
    EXPECT_THAT(run.err, IsEmpty()) << name;
  }
}

TEST(Command, SaysItsVersion) {
  const Outcome run = run_heft({"--version"});
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(run.out, ContainsRegex("^heft [0-9]+\\.[0-9]+\\.[0-9]+"));
}

TEST(Command, SaysWhatItIsBuiltWith) {
  const Outcome run = run_heft({"--version"});
  for (const char* library : {"Eigen 3.", "SUNDIALS ", "Ceres 2", "fmt "})
    EXPECT_THAT(run.out, HasSubstr(library));
}

TEST(Command, ManPagesHoldEveryOptionOfTheHelpText) {
  const std::string pages = run_heft({"--man"}).out;
  EXPECT_THAT(pages, HasSubstr(".TH HEFT 1"));
  for (const std::string name : {"identify", "diagnose", "payload", "export", "torque-constants"}) {
    const Outcome page = run_heft({"--man", name});
    ASSERT_EQ(page.exit_code, 0) << name;
    std::string text;  // as a reader sees it: hyphens of options are marked as such
    for (std::size_t k = 0; k < page.out.size(); ++k) {
      if (page.out[k] != '\\' || page.out[k + 1] != '-') text += page.out[k];
    }
    EXPECT_THAT(pages, HasSubstr("\\fBheft")) << name;
    const std::string help = run_heft({name, "--help"}).out;
    int options = 0;
    for (std::size_t at = 0; (at = help.find("\n  --", at)) != std::string::npos; ++at, ++options) {
      const std::string option = help.substr(at + 3, help.find_first_of(" ,\n", at + 3) - at - 3);
      EXPECT_THAT(text, HasSubstr(option)) << name;
    }
    EXPECT_GT(options, 4) << name;
  }
  EXPECT_EQ(run_heft({"--man", "weigh"}).exit_code, 2);
}

/// What bash offers for a line whose last word is to be completed.
std::string completed(const std::string& line) {
  const test::TemporaryFolder folder;
  folder.write("heft.bash", run_heft({"--completion", "bash"}).out);
  folder.write("run.csv", "");
  const std::string script = "cd " + folder.path("") + "; . ./heft.bash; COMP_WORDS=(" + line +
                             "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _heft; echo \"${COMPREPLY[*]}\"";
  folder.write("ask", script);
  const std::string out = folder.path("out");
  EXPECT_EQ(std::system(("bash " + folder.path("ask") + " > " + out + " 2>&1").c_str()), 0);
  return host::read_file(out, "completion");
}

TEST(Command, BashCompletesCommandsOptionsWordsRobotsAndFiles) {
  EXPECT_EQ(completed("heft tor"), "torque-constants\n");
  EXPECT_EQ(completed("heft identify --val"), "--validate\n");
  EXPECT_EQ(completed("heft export --format m"), "mjcf\n");
  EXPECT_EQ(completed("heft identify --urdf pan"), "panda\n");
  EXPECT_EQ(completed("heft identify --log ru"), "run.csv\n");
  EXPECT_EQ(completed("heft compare ru"), "run.csv\n");
  EXPECT_EQ(completed("heft identify --band 3"), "\n") << "a number that nobody can know";
  EXPECT_EQ(run_heft({"--completion", "fish"}).exit_code, 2);
  EXPECT_THAT(run_heft({"--completion", "zsh"}).out, HasSubstr("#compdef heft"));
}

TEST(Command, WrongUsageEndsWithTwo) {
  EXPECT_EQ(run_heft({}).exit_code, 2);
  EXPECT_EQ(run_heft({"--bogus"}).exit_code, 2);
  EXPECT_EQ(run_heft({"dynamics"}).exit_code, 2);
  EXPECT_EQ(run_heft({"dynamics", "--urdf"}).exit_code, 2);
  EXPECT_EQ(run_heft({"dynamics", "--bogus", "1"}).exit_code, 2);
  const Outcome missing = run_heft({"dynamics", "--log", "L.csv", "-o", "x.csv"});
  EXPECT_EQ(missing.exit_code, 2);
  EXPECT_THAT(missing.err, AllOf(HasSubstr("--urdf"), HasSubstr("heft dynamics --help")));
  const Outcome choice =
      run_heft({"dynamics", "--urdf", "u", "--log", "L.csv", "-o", "x.csv", "--what", "power"});
  EXPECT_EQ(choice.exit_code, 2);
  EXPECT_THAT(choice.err, AllOf(HasSubstr("power"), HasSubstr("gravity")));
  EXPECT_EQ(run_heft({"dynamics", "--urdf", "u", "--log", "L.csv", "-o", "x.csv", "--band", "-3"}).exit_code,
            2);
  EXPECT_EQ(
      run_heft({"dynamics", "--urdf", "u", "--log", "L.csv", "-o", "x.csv", "--mount", "1,2"}).exit_code, 2);
}

TEST(Command, UnknownCommandNamesTheNearest) {
  const Outcome near = run_heft({"dinamics", "--urdf", "x"});
  EXPECT_EQ(near.exit_code, 2);
  EXPECT_THAT(near.err, AllOf(HasSubstr("dinamics"), HasSubstr("did you mean 'dynamics'")));
  const Outcome far = run_heft({"frobnicate"});
  EXPECT_EQ(far.exit_code, 2);
  EXPECT_THAT(far.err, Not(HasSubstr("did you mean")));
}

// dynamics ---------------------------------------------------------------------------------------------------

class Dynamics : public ::testing::Test {
 protected:
  /// Runs dynamics with the arm and the log, -o out.csv.
  Outcome run(std::vector<std::string> more = {}, const std::string& log = kLog,
              const std::string& arm = kArm) {
    folder_.write("arm.urdf", arm);
    folder_.write("log.csv", log);
    std::vector<std::string> arguments{"dynamics",
                                       "--urdf",
                                       folder_.path("arm.urdf"),
                                       "--log",
                                       folder_.path("log.csv"),
                                       "-o",
                                       folder_.path("out.csv")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_heft(arguments);
  }
  Csv result() const { return parse_csv(host::read_file(folder_.path("out.csv"), "result")); }

  /// Bad input: exit code 3, one message, no output file of any kind.
  std::string refusal(const std::string& log, const std::string& arm = kArm,
                      std::vector<std::string> more = {}) {
    more.insert(more.end(), {"--json", folder_.path("out.json"), "--report", folder_.path("out.html")});
    const Outcome bad = run(more, log, arm);
    EXPECT_EQ(bad.exit_code, 3) << bad.err;
    EXPECT_THAT(bad.out, IsEmpty());
    EXPECT_EQ(folder_.num_entries(), 2U) << "only the two inputs may be there";
    // Notes aside, one message.
    std::istringstream lines(bad.err);
    std::string line, message;
    int count = 0;
    while (std::getline(lines, line)) {
      if (line.rfind("heft: note:", 0) == 0) continue;
      message += line + "\n";
      ++count;
    }
    EXPECT_EQ(count, 1) << bad.err;
    return message;
  }

  test::TemporaryFolder folder_;
};

TEST_F(Dynamics, GivesTheTorqueOfTheClosedForm) {
  const Outcome done = run();
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const Csv csv = result();
  EXPECT_EQ(csv.header, (std::vector<std::string>{"time", "tau1", "tau2"}));
  ASSERT_EQ(csv.rows.size(), 3U);
  // Stretched out along x at rest; a positive turn about y lowers the arm, so holding it is a negative torque.
  EXPECT_NEAR(csv.rows[0][1], -9.81 * (2 * 0.25 + 1 * 0.75), 1e-12);
  EXPECT_NEAR(csv.rows[0][2], -9.81 * 0.25, 1e-12);
  // The second joint turns at 2 rad/s: friction 0.5 + 0.25 * 2, no force across the shoulder when stretched.
  EXPECT_NEAR(csv.rows[1][2], -9.81 * 0.25 + 1.0, 1e-12);
  EXPECT_NEAR(csv.rows[1][1], -9.81 * 1.25, 1e-12);
  // Upright there is no gravity torque left.
  EXPECT_NEAR(csv.rows[2][1], 0.0, 1e-12);
  EXPECT_NEAR(csv.rows[2][2], -1.0, 1e-12);
}

TEST_F(Dynamics, ASensorBehindTheGearSeesNoFriction) {
  ASSERT_EQ(run({"--torque-at", "joint"}).exit_code, 0);
  EXPECT_NEAR(result().rows[1][2], -9.81 * 0.25, 1e-12);
}

TEST_F(Dynamics, GravityNeedsPositionsOnly) {
  const Outcome done = run({"--what", "gravity"}, "time,q1,q2\n0,0,0\n0.5,0,0\n");
  ASSERT_EQ(done.exit_code, 0) << done.err;
  EXPECT_THAT(done.err, Not(HasSubstr("derived")));
  EXPECT_EQ(result().header, (std::vector<std::string>{"time", "g1", "g2"}));
  EXPECT_NEAR(result().rows[1][1], -9.81 * 1.25, 1e-12);
}

TEST_F(Dynamics, OneRowIsEnoughWhenNothingIsDerived) {
  const Outcome done = run({}, "time,q1,q2,qd1,qd2,qdd1,qdd2,tau1,tau2\n0,0,0,0,0,0,0,1,1\n");
  ASSERT_EQ(done.exit_code, 0) << done.err;
  EXPECT_EQ(result().rows.size(), 1U);
}

TEST_F(Dynamics, UnderACeilingGravityTurnsRound) {
  ASSERT_EQ(run({"--what", "gravity", "--mount", "3.141592653589793,0,0"}).exit_code, 0);
  EXPECT_NEAR(result().rows[0][1], 9.81 * 1.25, 1e-12);
}

TEST_F(Dynamics, RegressorTimesParametersIsTheTorque) {
  ASSERT_EQ(run().exit_code, 0);
  const Csv torque = result();
  ASSERT_EQ(run({"--what", "regressor"}).exit_code, 0);
  const Csv regressor = result();
  ASSERT_EQ(regressor.header.size(), 1U + 2U * 28U);
  EXPECT_EQ(regressor.header[1], "Y1_m1");
  EXPECT_EQ(regressor.header[10], "Y1_Izz1");
  EXPECT_EQ(regressor.header[11], "Y1_m2");
  EXPECT_EQ(regressor.header[21], "Y1_rotor1");
  EXPECT_EQ(regressor.header[28], "Y1_offset2");
  EXPECT_EQ(regressor.header[29], "Y2_m1");
  // m, mc, inertia about the link-frame origin; then rotor, Coulomb, viscous, offset of both joints.
  const std::vector<double> parameters{2,
                                       0.5,
                                       0,
                                       0,
                                       0.01,
                                       0,
                                       0.05 + 2 * 0.0625,
                                       0,
                                       0,
                                       0.05 + 2 * 0.0625,
                                       1,
                                       0.25,
                                       0,
                                       0,
                                       0.01,
                                       0,
                                       0.03 + 0.0625,
                                       0,
                                       0,
                                       0.03 + 0.0625,
                                       0,
                                       0,
                                       0,
                                       0.5,
                                       0,
                                       0.25,
                                       0,
                                       0};
  for (std::size_t k = 0; k < torque.rows.size(); ++k) {
    for (std::size_t j = 0; j < 2; ++j) {
      double sum = 0;
      for (std::size_t p = 0; p < 28; ++p) sum += regressor.rows[k][1 + 28 * j + p] * parameters[p];
      EXPECT_NEAR(sum, torque.rows[k][1 + j], 1e-12);
    }
  }
  ASSERT_EQ(run({"--what", "regressor", "--torque-at", "joint"}).exit_code, 0);
  EXPECT_EQ(result().header.size(), 1U + 2U * 20U);
}

TEST_F(Dynamics, DerivesVelocityAndAccelerationAndSaysSo) {
  std::string log = "time,q1,q2\n";
  for (int k = 0; k < 400; ++k)
    log += fmt::format("{},{:.17g},0\n", 0.01 * k, 0.5 * std::sin(3.0 * 0.01 * k));
  const Outcome done = run({"--torque-at", "joint"}, log);
  ASSERT_EQ(done.exit_code, 0) << done.err;
  EXPECT_THAT(done.err, AllOf(HasSubstr("note"), HasSubstr("velocity and acceleration derived")));
  // The stretched arm as one body: inertia about the shoulder times acceleration plus gravity.
  const double inertia = 0.05 + 2 * 0.0625 + 0.03 + 0.75 * 0.75;
  const Csv csv = result();
  for (const std::size_t k : {100U, 200U, 300U}) {
    const double t = 0.01 * static_cast<double>(k), q = 0.5 * std::sin(3 * t), qdd = -4.5 * std::sin(3 * t);
    EXPECT_NEAR(csv.rows[k][1], inertia * qdd - 9.81 * 1.25 * std::cos(q), 0.02) << "sample " << k;
  }
}

TEST_F(Dynamics, AModelReplacesTheParameters) {
  const std::string zero = "[0,0,0,0,0,0,0,0,0,0]";
  folder_.write("model.json",
                R"({"format": "heft-model", "version": 1, "robot": "two_links", "links": [{"parameters": )" +
                    zero + R"(}, {"parameters": )" + zero +
                    R"(}], "joints": [{"friction_offset": 3}, {"coulomb_friction": 7}]})");
  const Outcome done = run({"--model", folder_.path("model.json")});
  ASSERT_EQ(done.exit_code, 0) << done.err;
  EXPECT_EQ(result().rows[1], (std::vector<double>{0.01, 3, 7}));
  EXPECT_EQ(result().rows[2], (std::vector<double>{0.02, 3, -7}));
}

TEST_F(Dynamics, ABadModelNamesFileAndPath) {
  folder_.write("model.json", R"({"format": "heft-model", "version": 1, "links": [{"parameters": [1]}]})");
  const Outcome bad = run({"--model", folder_.path("model.json")});
  EXPECT_EQ(bad.exit_code, 3);
  EXPECT_THAT(bad.err, AllOf(HasSubstr("model.json: /links/0/parameters"), HasSubstr("ten numbers")));
  EXPECT_FALSE(std::filesystem::exists(folder_.path("out.csv")));
}

TEST_F(Dynamics, WritesToStandardOutputWhenAsked) {
  folder_.write("arm.urdf", kArm);
  folder_.write("log.csv", kLog);
  const Outcome done =
      run_heft({"dynamics", "--urdf", folder_.path("arm.urdf"), "--log", folder_.path("log.csv"), "-o", "-"});
  EXPECT_EQ(done.exit_code, 0);
  EXPECT_EQ(parse_csv(done.out).rows.size(), 3U) << done.out;
  EXPECT_THAT(done.out, Not(HasSubstr("two_links")));
  EXPECT_THAT(done.err, HasSubstr("two_links"));
}

TEST_F(Dynamics, ComparesWithMeasuredTorque) {
  std::string log = "time,q1,q2,qd1,qd2,qdd1,qdd2,tau1,tau2\n";
  for (int k = 0; k < 300; ++k) {
    // One newton metre too much on the second joint, in turns plus and minus.
    log += fmt::format("{:.2f},0,0,0,0,0,0,{:.17g},{:.17g}\n", 0.01 * k, -9.81 * 1.25,
                       -9.81 * 0.25 + (k % 2 ? 1 : -1));
  }
  const Outcome done = run({"--json", "-", "--report", folder_.path("page.html"), "--band", "5"}, log);
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const auto json = nlohmann::json::parse(done.out).at("logs").at(0);
  EXPECT_NEAR(json.at("rmse").at(0).get<double>(), 0.0, 1e-12);
  EXPECT_NEAR(json.at("rmse").at(1).get<double>(), 1.0, 1e-12);
  EXPECT_LT(json.at("rmse_in_band").at(1).get<double>(), 0.01) << "a 50 Hz error is outside a 5 Hz band";
  EXPECT_NEAR(json.at("rmse_percent_of_max").at(1).get<double>(), 100.0 / (9.81 * 0.25 + 1), 1e-9);
  EXPECT_EQ(json.at("band_hz").get<double>(), 5.0);
  EXPECT_THAT(host::read_file(folder_.path("page.html"), "report"),
              AllOf(HasSubstr("RMSE"), HasSubstr("Joint 2")));
}

TEST_F(Dynamics, TakesSeveralLogs) {
  // The same motion with another line end: a copy of a log is refused.
  std::string second = kLog;
  second.insert(second.find('\n'), "\r");
  folder_.write("second.csv", second);
  const Outcome done = run({"--log", folder_.path("second.csv")});
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const Csv csv = result();
  EXPECT_EQ(csv.header[0], "log");
  ASSERT_EQ(csv.rows.size(), 6U);
  EXPECT_EQ(csv.rows[2][0], 1.0);
  EXPECT_EQ(csv.rows[3][0], 2.0);
}

// Bad logs: each case of the log contract ---------------------------------------------------------------------

TEST_F(Dynamics, RefusesAMissingLog) {
  folder_.write("arm.urdf", kArm);
  const Outcome bad = run_heft({"dynamics", "--urdf", folder_.path("arm.urdf"), "--log",
                                folder_.path("none.csv"), "-o", folder_.path("out.csv")});
  EXPECT_EQ(bad.exit_code, 3);
  EXPECT_THAT(bad.err, AllOf(HasSubstr("none.csv"), HasSubstr("cannot read")));
  EXPECT_EQ(folder_.num_entries(), 1U);
}

TEST_F(Dynamics, RefusesAMissingColumn) {
  EXPECT_THAT(refusal(replaced(kLog, "time,", "when,")), AllOf(HasSubstr("log.csv:1"), HasSubstr("time")));
  EXPECT_THAT(refusal(replaced(kLog, ",q1,q2", ",q1,other")),
              AllOf(HasSubstr("log.csv"), HasSubstr("two_links")));
  EXPECT_THAT(refusal(replaced(kLog, ",q1,q2", ",q2,q3")), AllOf(HasSubstr("log.csv:1"), HasSubstr("q1")));
}

TEST_F(Dynamics, RefusesARaggedRow) {
  EXPECT_THAT(refusal(replaced(kLog, "0.01,0,0,0,2,0,0", "0.01,0,0,0,2,0")), HasSubstr("log.csv:3"));
  EXPECT_THAT(refusal(replaced(kLog, "0.01,0,0,0,2,0,0", "0.01,0,0,0,2,0,0,8")), HasSubstr("log.csv:3"));
}

TEST_F(Dynamics, RefusesTextWhereANumberIsDue) {
  EXPECT_THAT(refusal(replaced(kLog, "0.01,0,0,0,2", "0.01,0,0,0,fast")),
              AllOf(HasSubstr("log.csv:3"), HasSubstr("qd2"), HasSubstr("fast")));
}

TEST_F(Dynamics, RefusesNanAndInfinity) {
  for (const std::string value : {"nan", "NaN", "inf", "-inf", "1e999"}) {
    EXPECT_THAT(refusal(replaced(kLog, "0.01,0,0,0,2", "0.01,0,0,0," + value)),
                AllOf(HasSubstr("log.csv:3"), HasSubstr("qd2")))
        << value;
  }
}

TEST_F(Dynamics, RefusesTimeThatDoesNotIncrease) {
  EXPECT_THAT(refusal(replaced(kLog, "0.02,", "0.01,")), AllOf(HasSubstr("log.csv:4"), HasSubstr("time")));
  EXPECT_THAT(refusal(replaced(kLog, "0.02,", "0.001,")),
              AllOf(HasSubstr("log.csv:4"), HasSubstr("increas")));
}

TEST_F(Dynamics, RefusesTooFewSamples) {
  EXPECT_THAT(refusal(""), HasSubstr("log.csv"));
  EXPECT_THAT(refusal("time,q1,q2\n"), HasSubstr("log.csv"));
  EXPECT_THAT(refusal("time,q1,q2\n0,0,0\n"), AllOf(HasSubstr("log.csv"), HasSubstr("sample")));
  // Derivatives need more than two.
  EXPECT_THAT(refusal("time,q1,q2\n0,0,0\n1,1,1\n"), AllOf(HasSubstr("log.csv"), HasSubstr("sample")));
}

TEST_F(Dynamics, RefusesAJointCountThatIsNotTheRobots) {
  const std::string message = refusal("time,q1,q2,q3\n0,0,0,0\n1,0,0,0\n2,0,0,0\n");
  EXPECT_THAT(message, AllOf(HasSubstr("log.csv"), HasSubstr("3"), HasSubstr("2"), HasSubstr("two_links")));
}

TEST_F(Dynamics, RefusesAnUnwritableOutput) {
  folder_.write("arm.urdf", kArm);
  folder_.write("log.csv", kLog);
  const Outcome bad = run_heft({"dynamics", "--urdf", folder_.path("arm.urdf"), "--log",
                                folder_.path("log.csv"), "-o", folder_.path("no/such/folder/out.csv")});
  EXPECT_EQ(bad.exit_code, 3);
  EXPECT_THAT(bad.err, AllOf(HasSubstr("no/such/folder/out.csv"), HasSubstr("folder")));
}

// Bad robots -------------------------------------------------------------------------------------------------

TEST_F(Dynamics, RefusesAnUnknownRobot) {
  folder_.write("log.csv", kLog);
  const Outcome bad = run_heft({"dynamics", "--urdf", "no_such_robot", "--log", folder_.path("log.csv"), "-o",
                                folder_.path("out.csv")});
  EXPECT_EQ(bad.exit_code, 3);
  EXPECT_THAT(bad.err, AllOf(HasSubstr("no_such_robot"), HasSubstr("ur5")));
  EXPECT_EQ(folder_.num_entries(), 1U);
}

TEST_F(Dynamics, RefusesABrokenUrdf) {
  EXPECT_THAT(refusal(kLog, replaced(kArm, "</robot>", "")), HasSubstr("arm.urdf"));
  EXPECT_THAT(refusal(kLog, "not a robot"), HasSubstr("arm.urdf"));
  EXPECT_THAT(refusal(kLog, ""), HasSubstr("arm.urdf"));
  EXPECT_THAT(refusal(kLog, replaced(kArm, "mass value=\"2\"", "mass value=\"heavy\"")),
              AllOf(HasSubstr("arm.urdf"), HasSubstr("upper")));
}

TEST_F(Dynamics, RefusesALoop) {
  const std::string loop =
      replaced(kArm, "</robot>",
               "<joint name=\"bar\" type=\"revolute\"><parent link=\"lower\"/><child link=\"upper\"/>"
               "<axis xyz=\"0 1 0\"/><limit effort=\"1\" velocity=\"1\"/></joint></robot>");
  EXPECT_THAT(refusal(kLog, loop), AllOf(HasSubstr("arm.urdf"), HasSubstr("upper")));
}

TEST_F(Dynamics, RefusesAnUnknownJoint) {
  EXPECT_THAT(
      refusal(kLog, replaced(kArm, "name=\"elbow\" type=\"revolute\"", "name=\"elbow\" type=\"wobbly\"")),
      AllOf(HasSubstr("arm.urdf"), HasSubstr("elbow")));
  EXPECT_THAT(refusal(kLog, replaced(kArm, "<child link=\"lower\"/>", "<child link=\"nowhere\"/>")),
              AllOf(HasSubstr("arm.urdf"), HasSubstr("nowhere")));
  EXPECT_THAT(refusal(kLog, kArm, {"--tip", "hand"}), AllOf(HasSubstr("arm.urdf"), HasSubstr("hand")));
}

TEST_F(Dynamics, RefusesMassThatIsZeroOrNegative) {
  for (const std::string mass : {"0", "-2"}) {
    EXPECT_THAT(refusal(kLog, replaced(kArm, "mass value=\"1\"", "mass value=\"" + mass + "\"")),
                AllOf(HasSubstr("arm.urdf"), HasSubstr("lower"), HasSubstr("mass")))
        << mass;
  }
}

// Reference vectors ------------------------------------------------------------------------------------------

/// URDF of a reference arm given by Denavit-Hartenberg parameters: link frames have the axes of DH frame i and
/// their origin at O_{i-1}, on the joint's axis.
std::string urdf_of(const nlohmann::json& arm, double unit) {
  std::string urdf = "<robot name=\"reference\"><link name=\"link0\"/>\n";
  const std::size_t n = arm.at("mass").size();
  for (std::size_t i = 0; i < n; ++i) {
    const double alpha = arm.at("dh").at("alpha").at(i).get<double>();
    const auto& r = arm.at("r").at(i);
    const auto& com = arm.at("com").at(i);
    const auto& I = arm.at("inertia_com").at(i);
    const auto number = [](const nlohmann::json& value) { return value.get<double>(); };
    urdf += fmt::format(
        "<link name=\"link{}\"><inertial><origin xyz=\"{:.17g} {:.17g} {:.17g}\"/><mass "
        "value=\"{:.17g}\"/><inertia "
        "ixx=\"{:.17g}\" ixy=\"{:.17g}\" ixz=\"{:.17g}\" iyy=\"{:.17g}\" iyz=\"{:.17g}\" "
        "izz=\"{:.17g}\"/></inertial></link>\n",
        i + 1, number(r[0]) + number(com[0]), number(r[1]) + number(com[1]), number(r[2]) + number(com[2]),
        unit * number(arm.at("mass").at(i)), unit * number(I[0][0]), unit * number(I[0][1]),
        unit * number(I[0][2]), unit * number(I[1][1]), unit * number(I[1][2]), unit * number(I[2][2]));
    const std::array<double, 3> origin =
        i == 0 ? std::array<double, 3>{}
               : std::array<double, 3>{number(arm.at("r").at(i - 1)[0]), number(arm.at("r").at(i - 1)[1]),
                                       number(arm.at("r").at(i - 1)[2])};
    urdf += fmt::format(
        "<joint name=\"joint{0}\" type=\"continuous\"><parent link=\"link{1}\"/><child link=\"link{0}\"/>"
        "<origin xyz=\"{2:.17g} {3:.17g} {4:.17g}\" rpy=\"{5:.17g} 0 0\"/><axis xyz=\"0 {6:.17g} {7:.17g}\"/>"
        "<dynamics friction=\"{8:.17g}\" damping=\"{9:.17g}\"/></joint>\n",
        i + 1, i, origin[0], origin[1], origin[2], alpha, std::sin(alpha), std::cos(alpha),
        unit * number(arm.at("coulomb").at(i)), unit * number(arm.at("viscous").at(i)));
  }
  return urdf + "</robot>\n";
}

/// An arm of the reference vectors and heft's own URDF of it.
struct ReferenceArm {
  const char* file;
  const char* robot;
  double unit;  ///< kilograms in the file's unit of mass
  friend std::ostream& operator<<(std::ostream& out, const ReferenceArm& arm) { return out << arm.file; }
};

class Reference : public Dynamics, public ::testing::WithParamInterface<ReferenceArm> {};

TEST_P(Reference, TorqueEqualsTheReferenceVectors) {
  const std::string file = fmt::format("{}/{}.json", HEFT_REFERENCE_DIR, GetParam().file);
  HEFT_NEEDS_MEASURED_DATA(file);
  const auto arm = nlohmann::json::parse(host::read_file(file, "reference"));
  const double unit = GetParam().unit;
  std::string log = "time";
  for (const char* name : {"q", "qd", "qdd"}) {
    for (int j = 1; j <= 6; ++j) log += fmt::format(",{}{}", name, j);
  }
  for (const auto& state : arm.at("states")) {
    log += fmt::format("\n{}", state.at("id").get<int>());
    for (const char* name : {"q", "qd", "qdd"}) {
      for (const auto& value : state.at(name)) log += fmt::format(",{:.17g}", value.get<double>());
    }
  }
  folder_.write("log.csv", log + "\n");
  const std::string written = folder_.write("arm.urdf", urdf_of(arm, unit));
  for (const std::string& urdf : {written, std::string(GetParam().robot)}) {
    for (const std::string at : {"joint", "motor"}) {
      const Outcome done = run_heft({"dynamics", "--urdf", urdf, "--log", folder_.path("log.csv"),
                                     "--torque-at", at, "-o", folder_.path("out.csv")});
      ASSERT_EQ(done.exit_code, 0) << done.err;
      const Csv csv = result();
      ASSERT_EQ(csv.rows.size(), arm.at("states").size());
      for (std::size_t k = 0; k < csv.rows.size(); ++k) {
        const auto& expected = arm.at("states").at(k).at(at == "joint" ? "tau_rigid" : "tau");
        double largest = 0, error = 0;
        for (std::size_t j = 0; j < 6; ++j) {
          largest = std::max(largest, std::abs(unit * expected[j].get<double>()));
          error = std::max(error, std::abs(csv.rows[k][j + 1] - unit * expected[j].get<double>()));
        }
        EXPECT_LT(error, 1e-12 * largest) << urdf << ", torque at " << at << ", state " << k;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Arms, Reference,
                         ::testing::Values(ReferenceArm{"ur5", "ur5", 1.0},
                                           ReferenceArm{"paper6r", "kawasaki6r", 1e-3}),
                         [](const auto& arm) { return std::string(arm.param.file); });

// simulate ---------------------------------------------------------------------------------------------------

constexpr const char* kScenario = R"({
  "robot": "arm.urdf", "duration": 0.5, "sample_rate": 200, "seed": 3,
  "initial": {"position": [0.3, -0.2]},
  "reference": {"kind": "quintic", "from": [0.3, -0.2], "to": [0.5, 0.1], "duration": 0.4},
  "controller": {"kind": "pd_gravity", "kp": 200, "kd": 8},
  "sensors": {"torque_noise": 0.01},
  "payload": [{"event": "grasp", "time": 0.25, "mass": 0.5}]
})";

TEST(Simulate, WritesALogThatDynamicsReads) {
  const test::TemporaryFolder folder;
  const std::string arm = folder.write("arm.urdf", kArm);
  const std::string scenario = folder.write("pick.json", kScenario);
  const Outcome done = run_heft({"simulate", "--scenario", scenario, "-o", folder.path("log.csv"), "--json",
                                 folder.path("result.json"), "--report", folder.path("page.html")});
  ASSERT_EQ(done.exit_code, 0) << done.err;
  EXPECT_THAT(done.out, AllOf(HasSubstr("two_links"), HasSubstr("grasp at 0.25"), HasSubstr("log.csv"),
                              HasSubstr("page.html")));
  const auto json = nlohmann::json::parse(host::read_file(folder.path("result.json"), "result"));
  int num_grasps = 0;
  for (const auto& event : json.at("events")) {
    EXPECT_EQ(event.at("kind") == "grasp", event.at("joint").is_null()) << event;
    num_grasps += event.at("kind") == "grasp";
  }
  EXPECT_EQ(num_grasps, 1);
  EXPECT_EQ(json.at("rms_tracking_error").size(), 2U);
  EXPECT_THAT(host::read_file(folder.path("page.html"), "report"), HasSubstr("grasp"));
  const Outcome dynamics = run_heft({"dynamics", "--urdf", arm, "--log", folder.path("log.csv"), "-o", "-"});
  EXPECT_EQ(dynamics.exit_code, 0) << dynamics.err;
  EXPECT_GE(parse_csv(dynamics.out).rows.size(), 100U);
}

TEST(Simulate, TheSameSeedGivesTheSameLog) {
  const test::TemporaryFolder folder;
  folder.write("arm.urdf", kArm);
  const std::string scenario = folder.write("pick.json", kScenario);
  const Outcome first = run_heft({"simulate", "--scenario", scenario, "-o", "-"});
  const Outcome second = run_heft({"simulate", "--scenario", scenario, "-o", "-"});
  ASSERT_EQ(first.exit_code, 0) << first.err;
  EXPECT_EQ(first.out, second.out);
  EXPECT_THAT(first.out, HasSubstr("time,q1"));
}

TEST(Simulate, RefusesABadScenario) {
  const test::TemporaryFolder folder;
  folder.write("arm.urdf", kArm);
  const auto refusal = [&](const std::string& text) {
    const std::string scenario = folder.write("pick.json", text);
    const Outcome bad = run_heft({"simulate", "--scenario", scenario, "-o", folder.path("log.csv")});
    EXPECT_EQ(bad.exit_code, 3) << bad.err;
    EXPECT_FALSE(std::filesystem::exists(folder.path("log.csv")));
    return bad.err;
  };
  EXPECT_THAT(refusal("{"), HasSubstr("pick.json"));
  EXPECT_THAT(refusal(replaced(kScenario, "\"duration\": 0.5", "\"duration\": -1")),
              AllOf(HasSubstr("pick.json"), HasSubstr("/duration")));
  EXPECT_THAT(refusal(replaced(kScenario, "\"kp\": 200", "\"kp\": [1, 2, 3]")),
              AllOf(HasSubstr("pick.json"), HasSubstr("/controller/kp")));
  EXPECT_THAT(refusal(replaced(kScenario, "arm.urdf", "nobody")), HasSubstr("nobody"));
  EXPECT_THAT(run_heft({"simulate", "--scenario", folder.path("none.json"), "-o", "-"}).err,
              HasSubstr("none.json"));
}

// README -----------------------------------------------------------------------------------------------------

TEST(Readme, TheExampleGivesWhatItShows) {
  const std::string text = host::read_file(HEFT_SOURCE_DIR "/README.md", "README");
  const std::string fence = "```console\n";
  const std::size_t begin = text.find(fence);
  ASSERT_NE(begin, std::string::npos);
  std::istringstream block(
      text.substr(begin + fence.size(), text.find("```", begin + fence.size()) - begin - fence.size()));
  std::string line, script, shown;
  while (std::getline(block, line)) {
    if (line.rfind("$ ", 0) == 0) {
      script += line.substr(2) + "\n";
    } else {
      shown += line + "\n";
    }
  }
  const test::TemporaryFolder folder;
  script = replaced(script, "build/tools/heft", shell_quote(HEFT_COMMAND));
  ASSERT_EQ(std::system(("cd " + shell_quote(folder.path("")) + " && { " + script + "} >out 2>err").c_str()),
            0);
  const Csv expected = parse_csv(shown);
  const Csv got = parse_csv(host::read_file(folder.path("out"), "output"));
  EXPECT_EQ(got.header, expected.header);
  ASSERT_EQ(got.rows.size(), expected.rows.size());
  ASSERT_FALSE(got.rows.empty());
  for (std::size_t k = 0; k < got.rows.size(); ++k) {
    ASSERT_EQ(got.rows[k].size(), expected.rows[k].size());
    for (std::size_t j = 0; j < got.rows[k].size(); ++j)
      EXPECT_NEAR(got.rows[k][j], expected.rows[k][j], 1e-9);
  }
}

// export -----------------------------------------------------------------------------------------------------

TEST(Export, FrictionScalesNeedTheControllersFriction) {
  const test::TemporaryFolder folder;
  const Outcome without =
      run_heft({"export", "--urdf", "ur5e", "--format", "ur-friction", "-o", folder.path("a.script")});
  EXPECT_EQ(without.exit_code, 2);
  EXPECT_THAT(without.err, HasSubstr("expected --controller MODEL.json"));
  const Outcome elsewhere = run_heft({"export", "--urdf", "ur5e", "--format", "mjcf", "--controller",
                                      folder.write("c.json", "{}"), "-o", folder.path("a.xml")});
  EXPECT_EQ(elsewhere.exit_code, 2);
  EXPECT_THAT(elsewhere.err, HasSubstr("expected --format ur-friction"));
}

TEST(Export, RefusesNamesThatAreNotCpp) {
  const test::TemporaryFolder folder;
  const std::string arm = folder.write("arm.urdf", kArm);
  const Outcome type =
      run_heft({"export", "--urdf", arm, "--name", "two links", "-o", folder.path("arm.hpp")});
  EXPECT_EQ(type.exit_code, 3);
  EXPECT_THAT(type.err, AllOf(HasSubstr("--name"), HasSubstr("two links"), HasSubstr("TwoLinks")));
  EXPECT_EQ(
      run_heft({"export", "--urdf", arm, "--namespace", "a::b", "-o", folder.path("good.hpp")}).exit_code, 0);
  EXPECT_EQ(run_heft({"export", "--urdf", arm, "--namespace", "a::", "-o", folder.path("bad.hpp")}).exit_code,
            3);
  EXPECT_EQ(
      run_heft({"export", "--urdf", arm, "--namespace", "a::;b", "-o", folder.path("bad.hpp")}).exit_code, 3);
  EXPECT_FALSE(std::filesystem::exists(folder.path("bad.hpp")));
}

}  // namespace
}  // namespace heft
