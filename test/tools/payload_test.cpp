/// heft payload as a user runs it: results, files, messages, exit codes.
#include <array>
#include <cmath>
#include <filesystem>
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

using test::Outcome;
using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

/// Runs `heft payload` with these arguments and no terminal.
Outcome run_payload(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "payload");
  return test::run_heft(arguments);
}

/// Two links turning about y in the upright plane.
constexpr const char* kPayloadArm = R"(<?xml version="1.0"?>
<robot name="two_links">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.25 0 0"/><mass value="2"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.05"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0.25 0 0"/><mass value="1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.03"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="100" velocity="10"/><dynamics friction="1" damping="0.5"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.5 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="100" velocity="10"/><dynamics friction="0.5" damping="0.25"/></joint>
</robot>
)";
constexpr double kGrippedMass = 0.8;

class PayloadCommand : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_.write("arm.urdf", kPayloadArm);
    const model::Robot robot = urdf::load_urdf(path("arm.urdf"));
    settings_.noise = 0.01;
    data::write_log(path("empty.csv"), test::synthetic_log(robot, settings_));
    settings_.noise_seed = settings_.motion_seed = 2;
    data::write_log(path("empty2.csv"), test::synthetic_log(robot, settings_));
    settings_.noise_seed = settings_.motion_seed = 3;
    const auto load = test::body(kGrippedMass, {0.3, 0, 0.05}, {0.001, 0, 0.002, 0, 0, 0.001});
    log_ = test::synthetic_log(test::carrying(robot, load), settings_);
    data::write_log(path("carrying.csv"), log_);
    settings_.amplitude = 1e-4;
    data::write_log(path("still.csv"), test::synthetic_log(robot, settings_));
  }
  std::string path(const char* name) const { return folder_.path(name); }
  Outcome run(std::vector<std::string> more) const {
    more.insert(more.begin(), {"--urdf", path("arm.urdf")});
    return run_payload(more);
  }
  nlohmann::json json(const char* name) const {
    return nlohmann::json::parse(host::read_file(path(name), "result"));
  }

  test::TemporaryFolder folder_;
  test::SyntheticSettings settings_;
  data::Log log_;
};

TEST_F(PayloadCommand, AsksWhetherTheLogsAreInterchangedWhenTheLoadWeighsLessThanNothing) {
  const Outcome done = run({"--baseline", path("carrying.csv"), "--log", path("empty.csv"), "--json",
                            path("out.json"), "--report", path("page.html"), "-o", path("model.json")});
  EXPECT_EQ(done.exit_code, 4);
  EXPECT_THAT(done.err, AllOf(HasSubstr("the estimated mass is negative (-0."), HasSubstr("kg ±"),
                              HasSubstr("are --baseline and --log interchanged?")));
  EXPECT_THAT(done.out,
              AllOf(HasSubstr("Verdict: bad"), HasSubstr("The load of this log is impossible: -0.")));
  const nlohmann::json result = json("out.json");
  EXPECT_EQ(result.at("verdict"), "bad");
  EXPECT_THAT(result.at("reasons").at(0).get<std::string>(), HasSubstr("mass is negative"));
  EXPECT_FALSE(result.at("mass").at("identifiable").get<bool>());
  EXPECT_TRUE(result.at("mass").at("value").is_null()) << "no number to go on with";
  EXPECT_TRUE(result.at("com").at("value").at(0).is_null());
  EXPECT_THAT(host::read_file(path("page.html"), "page"), HasSubstr("<div class=\"verdict bad\">"));
  EXPECT_FALSE(std::filesystem::exists(path("model.json"))) << "the model contradicts the log";
}

TEST_F(PayloadCommand, WeighsTheLoadFromABaselineLogAlone) {
  const Outcome done = run({"--baseline", path("empty.csv"), "--log", path("carrying.csv"), "--json",
                            path("out.json"), "--report", path("page.html"), "--true-mass", "0.8"});
  ASSERT_EQ(done.exit_code, 0) << done.err;
  EXPECT_THAT(done.out,
              AllOf(HasSubstr("recursive least squares over all joints"), HasSubstr("The load weighs 0."),
                    HasSubstr("true 0.8"), HasSubstr("frame of the last link, lower"),
                    HasSubstr("RMSE: measured torque as logged, unfiltered"), HasSubstr("No zero check"),
                    HasSubstr("torque scale"), ContainsRegex("blocks of [0-9.]+ s")));
  const nlohmann::json result = json("out.json");
  EXPECT_EQ(result.at("verdict"), "good") << result.at("reasons");
  EXPECT_EQ(result.at("torque_scale").at("value").size(), 2U);
  EXPECT_TRUE(result.at("mass").at("identifiable").get<bool>());
  const double mass = result.at("mass").at("value"), half = result.at("mass").at("half_width_95");
  EXPECT_NEAR(mass, kGrippedMass, 2 * half);
  EXPECT_LT(half, 0.1);
  EXPECT_GT(result.at("mass").at("std").get<double>(), 0.0);
  EXPECT_NEAR(result.at("com").at("value").at(0).get<double>(), 0.3, 0.03);
  EXPECT_TRUE(result.at("com").at("value").at(1).is_null()) << "nothing in the plane shows y";
  EXPECT_FALSE(result.at("com").at("identifiable").at(1).get<bool>());
  EXPECT_EQ(result.at("inertia").at("value").size(), 6U);
  EXPECT_EQ(result.at("rows"), 1);
  EXPECT_EQ(result.at("samples"), log_.num_samples());
  EXPECT_TRUE(result.at("converged_at").is_number());
  EXPECT_TRUE(result.at("changes").empty());
  for (const std::size_t j : {0U, 1U}) {
    EXPECT_LT(result.at("rmse_after").at(j).get<double>(),
              0.6 * result.at("rmse_before").at(j).get<double>());
    EXPECT_LT(result.at("rmse_in_band_after").at(j).get<double>(),
              0.6 * result.at("rmse_in_band_before").at(j).get<double>());
  }
  EXPECT_THAT(host::read_file(path("page.html"), "page"),
              AllOf(HasSubstr("Mass of the load"), HasSubstr("Torque error over time"),
                    HasSubstr("Model of the arm without load")));
}

TEST_F(PayloadCommand, TheModelItWritesServesNextTime) {
  const Outcome first = run({"--baseline", path("empty.csv"), "--log", path("carrying.csv"), "-o",
                             path("model.json"), "--json", path("a.json")});
  ASSERT_EQ(first.exit_code, 0) << first.err;
  const Outcome second =
      run({"--model", path("model.json"), "--log", path("carrying.csv"), "--json", path("b.json")});
  ASSERT_EQ(second.exit_code, 0) << second.err;
  const nlohmann::json a = json("a.json"), b = json("b.json");
  EXPECT_NEAR(a.at("mass").at("value").get<double>(), b.at("mass").at("value").get<double>(), 1e-12);
  EXPECT_NEAR(a.at("mass").at("std").get<double>(), b.at("mass").at("std").get<double>(), 1e-12);
  EXPECT_EQ(a.at("rmse_before"), b.at("rmse_before"));
  // The URDF itself is a model too: it has no covariance, and the text says what that means.
  nlohmann::json bare = json("model.json");
  bare.erase("residual");
  bare.erase("covariance");
  bare.erase("standard_deviations");
  folder_.write("bare.json", bare.dump());
  const Outcome third =
      run({"--model", path("bare.json"), "--log", path("carrying.csv"), "--json", path("c.json")});
  ASSERT_EQ(third.exit_code, 0) << third.err;
  EXPECT_THAT(third.out, HasSubstr("no covariance"));
  EXPECT_NEAR(json("c.json").at("mass").at("value").get<double>(), kGrippedMass, 0.05);
}

TEST_F(PayloadCommand, SaysSoWhenThereIsNoLoad) {
  const Outcome done = run({"--baseline", path("empty.csv"), "--log", path("empty2.csv")});
  ASSERT_EQ(done.exit_code, 0) << done.err;
  EXPECT_THAT(done.out, HasSubstr("No load detected: "));
}

TEST_F(PayloadCommand, ZeroChecksComeFromOtherLogsWithoutLoad) {
  const Outcome named = run({"--baseline", path("empty.csv"), "--zero", path("empty2.csv"), "--log",
                             path("carrying.csv"), "--json", path("out.json")});
  ASSERT_EQ(named.exit_code, 0) << named.err;
  EXPECT_THAT(named.out,
              AllOf(HasSubstr("Zero check, " + path("empty2.csv")), Not(HasSubstr("No zero check"))));
  EXPECT_EQ(json("out.json").at("zero_checks").size(), 1U);
  const Outcome in_turn = run({"--baseline", path("empty.csv"), "--baseline", path("empty2.csv"), "--log",
                               path("carrying.csv"), "--json", path("out.json")});
  ASSERT_EQ(in_turn.exit_code, 0) << in_turn.err;
  EXPECT_EQ(json("out.json").at("zero_checks").size(), 2U);
}

TEST_F(PayloadCommand, SeveralLogsGiveAList) {
  const Outcome done = run({"--baseline", path("empty.csv"), "--log", path("carrying.csv"), "--log",
                            path("empty2.csv"), "--json", "-"});
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const nlohmann::json list = nlohmann::json::parse(done.out);
  ASSERT_EQ(list.size(), 2U);
  EXPECT_NEAR(list[0].at("mass").at("value").get<double>(), kGrippedMass, 0.05);
  EXPECT_NEAR(list[1].at("mass").at("value").get<double>(), 0, 0.05);
}

TEST_F(PayloadCommand, CurrentsServeAsTorque) {
  data::Log log = log_;
  log.current = log.tau / 0.5;
  log.tau.resize(0, 0);
  data::write_log(path("current.csv"), log);
  const Outcome done = run({"--baseline", path("empty.csv"), "--log", path("current.csv"),
                            "--torque-constant", "0.5", "--json", path("out.json")});
  ASSERT_EQ(done.exit_code, 0) << done.err;
  EXPECT_NEAR(json("out.json").at("mass").at("value").get<double>(), kGrippedMass, 0.05);
  const Outcome without = run({"--baseline", path("empty.csv"), "--log", path("current.csv")});
  EXPECT_EQ(without.exit_code, 3);
  EXPECT_THAT(without.err, AllOf(HasSubstr("current.csv:1"), HasSubstr("'tau1' is missing"),
                                 HasSubstr("torque constant")));
}

TEST_F(PayloadCommand, StandingStillEndsWithFourAndTheMotionToRecord) {
  const Outcome done =
      run({"--baseline", path("empty.csv"), "--log", path("still.csv"), "--json", path("out.json")});
  EXPECT_EQ(done.exit_code, 4);
  EXPECT_THAT(done.err, AllOf(HasSubstr("still.csv: the load cannot be determined"),
                              HasSubstr("does not move"), HasSubstr("record a motion")));
  EXPECT_THAT(done.out, Not(HasSubstr("weighs")));
  const nlohmann::json result = json("out.json");
  EXPECT_FALSE(result.at("mass").at("identifiable").get<bool>());
  EXPECT_TRUE(result.at("mass").at("value").is_null());
  EXPECT_TRUE(result.at("converged_at").is_null());
  EXPECT_FALSE(result.contains("rmse_after")) << "no improvement by a load nobody knows";
}

TEST_F(PayloadCommand, ABaselineThatStandsStillEndsWithFour) {
  const Outcome done =
      run({"--baseline", path("still.csv"), "--log", path("carrying.csv"), "-o", path("model.json")});
  EXPECT_EQ(done.exit_code, 4);
  EXPECT_THAT(done.err, AllOf(HasSubstr("still.csv: no model can be fitted"), HasSubstr("joint 1, 2"),
                              HasSubstr("record a motion")));
  EXPECT_FALSE(std::filesystem::exists(path("model.json")));
}

TEST_F(PayloadCommand, RowsThatCannotShowTheMassSaySo) {
  const Outcome done = run({"--baseline", path("empty.csv"), "--log", path("carrying.csv"), "--rows", "2"});
  EXPECT_EQ(done.exit_code, 4);
  EXPECT_THAT(done.err, AllOf(HasSubstr("joint 2 does not depend on the mass"), HasSubstr("--rows")));
}

TEST_F(PayloadCommand, WrongUsageEndsWithTwo) {
  const Outcome neither = run({"--log", path("carrying.csv")});
  EXPECT_EQ(neither.exit_code, 2);
  EXPECT_THAT(neither.err,
              AllOf(HasSubstr("--model"), HasSubstr("--baseline"), HasSubstr("heft payload --help")));
  const Outcome both =
      run({"--log", path("carrying.csv"), "--model", path("m.json"), "--baseline", path("empty.csv")});
  EXPECT_EQ(both.exit_code, 2);
  EXPECT_THAT(both.err, HasSubstr("either --model"));
  const Outcome nothing_to_write =
      run({"--log", path("carrying.csv"), "--model", path("m.json"), "-o", path("x.json")});
  EXPECT_EQ(nothing_to_write.exit_code, 2);
  EXPECT_THAT(nothing_to_write.err, HasSubstr("--output writes the model"));
  for (const char* k : {"0", "-1", "two"}) {
    const Outcome rows = run({"--baseline", path("empty.csv"), "--log", path("carrying.csv"), "--rows", k});
    EXPECT_EQ(rows.exit_code, 2) << k;
    EXPECT_THAT(rows.err, HasSubstr("--rows")) << k;
  }
  const Outcome no_log = run({"--baseline", path("empty.csv")});
  EXPECT_EQ(no_log.exit_code, 2);
  EXPECT_THAT(no_log.err, HasSubstr("--log"));
}

TEST_F(PayloadCommand, BadInputEndsWithThreeAndWritesNothing) {
  const auto refused = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--json", path("out.json"), "--report", path("page.html")});
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 3) << outcome.err;
    EXPECT_THAT(outcome.out, IsEmpty());
    EXPECT_FALSE(std::filesystem::exists(path("out.json")));
    EXPECT_FALSE(std::filesystem::exists(path("page.html")));
    return outcome.err;
  };
  EXPECT_THAT(refused({"--baseline", path("empty.csv"), "--log", path("carrying.csv"), "--rows", "3"}),
              HasSubstr("--rows 3: robot \"two_links\" has 2 joints; expected 1 to 2"));
  EXPECT_THAT(refused({"--baseline", path("empty.csv"), "--log", path("none.csv")}), HasSubstr("none.csv"));
  EXPECT_THAT(refused({"--baseline", path("none.csv"), "--log", path("carrying.csv")}),
              HasSubstr("none.csv"));
  folder_.write("three.csv", "time,q1,q2,q3,tau1,tau2,tau3\n0,0,0,0,0,0,0\n1,0,0,0,0,0,0\n");
  EXPECT_THAT(refused({"--baseline", path("empty.csv"), "--log", path("three.csv")}),
              AllOf(HasSubstr("three.csv:1"), HasSubstr("two_links")));
  folder_.write("nan.csv", "time,q1,q2,tau1,tau2\n0,0,0,0,0\n1,0,nan,0,0\n");
  EXPECT_THAT(refused({"--baseline", path("empty.csv"), "--log", path("nan.csv")}), HasSubstr("nan.csv:3"));
  EXPECT_THAT(refused({"--model", path("none.json"), "--log", path("carrying.csv")}), HasSubstr("none.json"));
  ASSERT_EQ(run({"--baseline", path("empty.csv"), "--log", path("carrying.csv"), "-o", path("model.json")})
                .exit_code,
            0);
  nlohmann::json model = json("model.json");
  model["residual"]["std"] = {0.1};
  folder_.write("bad.json", model.dump());
  EXPECT_THAT(refused({"--model", path("bad.json"), "--log", path("carrying.csv")}),
              HasSubstr("bad.json: /residual/std: expected 2 numbers, one a joint"));
  model["residual"]["std"] = {0.1, -1};
  folder_.write("bad.json", model.dump());
  EXPECT_THAT(refused({"--model", path("bad.json"), "--log", path("carrying.csv")}),
              HasSubstr("bad.json: /residual/std/1: found -1; expected a number above 0"));
}

TEST_F(PayloadCommand, WritesNoLoadThatItDoesNotKnow) {
  const Outcome plane =
      run({"--baseline", path("empty.csv"), "--log", path("carrying.csv"), "--write", "kuka"});
  EXPECT_EQ(plane.exit_code, 4);
  EXPECT_THAT(plane.err, HasSubstr("carrying.csv: the centre of mass along y is not known"));
  const Outcome none = run({"--baseline", path("empty.csv"), "--log", path("empty2.csv"), "--write",
                            "ur-script", "--write-to", path("load.script")});
  EXPECT_EQ(none.exit_code, 4);
  EXPECT_THAT(none.err, HasSubstr("no load is clear of zero"));
  EXPECT_FALSE(std::filesystem::exists(path("load.script")));
}

/// Numbers of a call of URScript.
std::vector<double> numbers_of(const std::string& script) {
  std::vector<double> numbers;
  for (std::size_t at = 0; (at = script.find_first_of("-0123456789", at)) != std::string::npos;) {
    std::size_t length = 0;
    numbers.push_back(std::stod(script.substr(at), &length));
    at += length;
  }
  return numbers;
}

TEST(PayloadOnUr5e, IsWrittenForEveryController) {
  const test::TemporaryFolder folder;
  model::Robot robot = urdf::load_urdf(urdf::resolve_robot("ur5e"));
  for (model::RobotJoint& joint : robot.joints)
    joint.actuation = {.rotor_inertia = 0.2, .coulomb_friction = 1.0, .viscous_friction = 1.0};
  test::SyntheticSettings settings;
  settings.noise = 0.002;
  settings.amplitude = 1.0;
  data::write_log(folder.path("empty.csv"), test::synthetic_log(robot, settings));
  settings.noise_seed = settings.motion_seed = 2;
  // The flange is turned like the last link.
  const std::array<double, 3>& tip = robot.tip_position;
  const auto load =
      test::body(2.0, {tip[0] + 0.02, tip[1] - 0.03, tip[2] + 0.08}, {0.01, 0, 0.012, 0, 0, 0.008});
  data::write_log(folder.path("carrying.csv"), test::synthetic_log(test::carrying(robot, load), settings));
  const auto run = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"--urdf", "ur5e", "--log", folder.path("carrying.csv")});
    return run_payload(more);
  };
  const Outcome first =
      run({"--baseline", folder.path("empty.csv"), "-o", folder.path("bare.json"), "--write", "ur-script",
           "--write-to", folder.path("load.script"), "--transition-time", "0.2"});
  ASSERT_EQ(first.exit_code, 0) << first.err;
  EXPECT_THAT(first.out, AllOf(HasSubstr("URScript set_target_payload"), HasSubstr("set_target_payload(")));
  const std::vector<double> numbers = numbers_of(host::read_file(folder.path("load.script"), "script"));
  ASSERT_EQ(numbers.size(), 11U);
  EXPECT_NEAR(numbers[0], 2.0, 0.02);
  EXPECT_NEAR(numbers[1], 0.02, 0.003);
  EXPECT_NEAR(numbers[2], -0.03, 0.003);
  EXPECT_NEAR(numbers[3], 0.08, 0.003);
  EXPECT_EQ(numbers[10], 0.2);
  for (const auto& [format, words] :
       std::vector<std::pair<const char*, const char*>>{{"ur-ros2", "transition_time: 0"},
                                                        {"franka", "robot.setLoad("},
                                                        {"franka-desk", "\"centerOfMass\""},
                                                        {"kuka", "LOAD_DATA[1]={M "},
                                                        {"abb", "PERS loaddata"},
                                                        {"fanuc", "PAYLOAD INERTIA X"},
                                                        {"urdf", "<parent link=\"tool0\"/>"},
                                                        {"mjcf", "<body name=\"payload\">"}}) {
    const Outcome done = run({"--model", folder.path("bare.json"), "--write", format});
    EXPECT_EQ(done.exit_code, 0) << format << ": " << done.err;
    EXPECT_THAT(done.out, HasSubstr(words)) << format;
  }
  const Outcome two =
      run({"--model", folder.path("bare.json"), "--log", folder.path("empty.csv"), "--write", "abb"});
  EXPECT_EQ(two.exit_code, 2);
  EXPECT_THAT(two.err, HasSubstr("expected one --log"));
  EXPECT_EQ(run({"--model", folder.path("bare.json"), "--write", "comau"}).exit_code, 2);
  EXPECT_EQ(run({"--model", folder.path("bare.json"), "--write-to", folder.path("x")}).exit_code, 2);
}

TEST(PayloadOnUr10e, WeighsTheKnownLoadOnMeasuredLogs) {
  const std::string folder = HEFT_DATA_DIR "/ur10e-dynamic-calibration/";
  HEFT_NEEDS_MEASURED_DATA(folder);
  const test::TemporaryFolder results;
  const Outcome done =
      run_payload({"--urdf", folder + "robot.urdf", "--baseline", folder + "exc-12h-50s.csv", "--zero",
                   folder + "exc-10h-20s.csv", "--log", folder + "exc-14h-50s-load2p805kg.csv", "--log",
                   folder + "exc-14h-50s.csv", "--json", results.path("out.json")});
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const nlohmann::json list = nlohmann::json::parse(host::read_file(results.path("out.json"), "result"));
  EXPECT_NEAR(list[0].at("mass").at("value").get<double>(), 2.805, 0.05 * 2.805);
  EXPECT_NEAR(list[1].at("mass").at("value").get<double>(), 0, 0.05);
  // Joint 1 turns about the vertical: it hardly feels the load. The others lose seven tenths of their error.
  for (const std::size_t j : {1U, 2U, 3U, 4U, 5U}) {
    EXPECT_LT(list[0].at("rmse_after").at(j).get<double>(),
              0.35 * list[0].at("rmse_before").at(j).get<double>())
        << "joint " << j + 1;
  }
}

}  // namespace
}  // namespace heft
