/// Commands that close the loop, as a user runs them.
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heft/host/file.hpp"
#include "heft/model/model_file.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/json_file.hpp"
#include "support/run_heft.hpp"
#include "support/temporary_folder.hpp"

namespace heft {
namespace {

using test::json_of;
using test::Outcome;
using test::run_heft;
using ::testing::HasSubstr;

TEST(Demo, FindsTheLoadWithinItsInterval) {
  const test::TemporaryFolder folder;
  for (const char* mass : {"0.5", "2", "4"}) {
    const Outcome outcome = run_heft({"demo", "-o", folder.path("demo"), "--mass", mass});
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    const nlohmann::json result = json_of(folder.path("demo/results.json"));
    const double value = result["mass"]["value"], half = result["mass"]["half_width_95"],
                 truth = result["mass"]["true"];
    EXPECT_DOUBLE_EQ(truth, std::stod(mass));
    EXPECT_NEAR(value, truth, half);
    EXPECT_LT(half, 0.05);
    EXPECT_LT(result["converged_after"].get<double>(), 2.0);
    for (std::size_t a = 0; a < 3; ++a) {
      EXPECT_NEAR(result["com"]["value"][a].get<double>(), result["com"]["true"][a].get<double>(), 0.01);
    }
  }
}

TEST(Demo, CorrectionBringsTheTrackingErrorBack) {
  const test::TemporaryFolder folder;
  const Outcome outcome = run_heft({"demo", "-o", folder.path("demo"), "--json", "-"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const nlohmann::json errors = nlohmann::json::parse(outcome.out)["rms_tracking_error"];
  const double before = errors["before_grasp"], without = errors["after_grasp_uncorrected"],
               with = errors["after_grasp_corrected"];
  EXPECT_GT(without, 5 * before);
  EXPECT_LT(with, 2 * before);
  EXPECT_THAT(outcome.err, HasSubstr("report.html"));
  EXPECT_THAT(host::read_file(folder.path("demo/report.html"), "page"), HasSubstr("</html>"));
}

TEST(Demo, RefusesAFolderThatIsAFile) {
  const test::TemporaryFolder folder;
  folder.write("taken", "");
  const Outcome outcome = run_heft({"demo", "-o", folder.path("taken")});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("expected a folder"));
}

TEST(Reproduce, RefusesAPublicationItDoesNotKnow) {
  const Outcome outcome = run_heft({"reproduce", "nothing", "-o", "x"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("terminal-link"));
}

constexpr const char* kPick = R"({
  "robot": "ur5e", "duration": 10.0, "sample_rate": 1000, "seed": 3,
  "rotor_inertia": [0.7, 0.7, 0.7, 0.12, 0.12, 0.12],
  "reference": {"kind": "fourier", "q0": [0.1, -1.1, 1.1, -0.4, 0.6, 0.0],
    "amplitude": [[0.4, 0.1], [0.3, 0.1], [0.3, 0.1], [0.5, 0.1], [0.5, 0.1], [0.8, 0.1]],
    "frequency_hz": [[0.2, 0.9], [0.25, 0.8], [0.3, 0.7], [0.35, 0.9], [0.4, 0.8], [0.45, 0.7]],
    "phase": [[0.0, 1.0], [0.5, 0.0], [1.0, 2.0], [1.5, 0.3], [2.0, 0.1], [2.5, 1.2]], "ramp": 1.5},
  "sensors": {"encoder_resolution": 2e-5, "velocity": "differenced", "velocity_cutoff_hz": 100},
  "controller": {"kind": "track", "bandwidth_hz": 3},
  "payload": [{"event": "grasp", "time": 4.0, "mass": 1.5, "com": [0.0, 0.02, 0.05], "inertia": [0.004, 0, 0.003, 0, 0, 0.004]}]
})";

TEST(Track, EstimatedLoadTracksBest) {
  const test::TemporaryFolder folder;
  folder.write("pick.json", kPick);
  const Outcome outcome = run_heft({"track", "--scenario", folder.path("pick.json"), "--from", "2", "--json",
                                    folder.path("out.json"), "--report", folder.path("page.html")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const nlohmann::json result = json_of(folder.path("out.json"));
  ASSERT_EQ(result["controllers"].size(), 5U);
  std::vector<double> total;
  for (const auto& controller : result["after_last_payload_event"]["controllers"]) {
    double squares = 0;
    for (const auto& v : controller["rms_error"]) squares += v.get<double>() * v.get<double>();
    total.push_back(std::sqrt(squares));
  }
  ASSERT_EQ(total.size(), 5U);
  EXPECT_LT(total[1], total[0]);        // gravity helps PD
  EXPECT_LT(total[2], total[1]);        // computed torque helps more
  EXPECT_LT(total[3], 0.5 * total[2]);  // and the load most
  EXPECT_LT(total[4], 0.5 * total[2]);  // however it becomes known
  EXPECT_NEAR(result["load"]["mass"]["value"].get<double>(), 1.5,
              result["load"]["mass"]["half_width_95"].get<double>());
}

/// Nothing but the load's mass differs between the runs; the grasp is early, so that a short movement shows it.
constexpr const char* kLoads = R"({
  "robot": "ur5e", "duration": 4.0, "sample_rate": 1000, "log_rate": 250, "seed": 3,
  "rotor_inertia": [0.7, 0.7, 0.7, 0.12, 0.12, 0.12],
  "friction": {"coulomb": [5, 5, 4, 1.5, 1.5, 1.2], "viscous": [4, 4, 3, 1, 1, 0.8]},
  "reference": {"kind": "fourier", "q0": [0.1, -1.1, 1.1, -0.4, 0.6, 0.0],
    "amplitude": [[0.4, 0.1], [0.3, 0.1], [0.3, 0.1], [0.5, 0.1], [0.5, 0.1], [0.8, 0.1]],
    "frequency_hz": [[0.2, 0.9], [0.25, 0.8], [0.3, 0.7], [0.35, 0.9], [0.4, 0.8], [0.45, 0.7]],
    "phase": [[0.0, 1.0], [0.5, 0.0], [1.0, 2.0], [1.5, 0.3], [2.0, 0.1], [2.5, 1.2]], "ramp": 1.5},
  "sensors": {"encoder_resolution": 2e-5, "velocity": "differenced", "velocity_cutoff_hz": 100,
    "torque_noise": [0.5, 0.5, 0.5, 0.1, 0.1, 0.1]},
  "controller": {"kind": "track", "bandwidth_hz": 3},
  "payload": [{"event": "grasp", "time": 1.0, "mass": 2.0, "com": [0.0, 0.02, 0.05], "inertia": [0.006, 0, 0.006, 0, 0, 0.006]}]
})";

TEST(Track, WhereTheArmIsWrongTheEstimatedOneLeavesAFractionOfTheErrorWithEveryLoad) {
  const test::TemporaryFolder folder;
  folder.write("loads.json", kLoads);
  const Outcome outcome = run_heft({"track", "--scenario", folder.path("loads.json"), "--from", "2.5",
                                    "--wrong-model", "0.1,0.3", "--seed", "1", "--loads", "0,2,5", "--json",
                                    folder.path("out.json"), "--report", folder.path("page.html")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("Load of 5 kg"));
  EXPECT_THAT(outcome.out, HasSubstr("tool, largest [mm]"));
  EXPECT_THAT(outcome.out, HasSubstr("by 10 to 30 % each, drawn with seed 1"));
  const nlohmann::json result = json_of(folder.path("out.json"));
  EXPECT_EQ(result["wrong_model"]["most"], 0.3);
  ASSERT_EQ(result["loads"].size(), 3U);
  for (const auto& load : result["loads"]) {
    std::map<std::string, double> joints, tool;
    for (const auto& run : load["controllers"]) {
      double squares = 0;
      for (const auto& v : run["rms_error"]) squares += v.get<double>() * v.get<double>();
      joints[run["controller"]] = std::sqrt(squares);
      tool[run["controller"]] = run["tool_rms_error"];
      EXPECT_GE(run["tool_max_error"].get<double>(), run["tool_rms_error"].get<double>());
    }
    ASSERT_EQ(joints.size(), 7U);
    const double estimated = joints["computed torque, arm estimated"];
    EXPECT_LT(estimated, 0.1 * joints["computed torque, nominal"]) << load["mass"];
    EXPECT_LT(estimated, 0.02 * joints["PD"]) << load["mass"];
    EXPECT_LT(tool["computed torque, arm estimated"], 0.4 * tool["computed torque, nominal"]) << load["mass"];
    // What the arm is in truth is the best without a load, and does not know of one.
    EXPECT_LT(joints["computed torque, identified"],
              (load["mass"] == 0 ? 0.2 : 1.0) * joints["computed torque, nominal"]);
  }
}

/// Stick-slip, a Stribeck effect that nobody declared, and 5 kg 12 cm off the last axis, gripped and put down again.
TEST(Track, TheEstimatedArmIsNoWorseThanTheNominalOneAfterALoadIsPutDown) {
  const test::TemporaryFolder folder;
  folder.write("pick.json", run_heft({"simulate", "--example"}).out);
  const Outcome outcome = run_heft({"track", "--scenario", folder.path("pick.json"), "--wrong-model",
                                    "0.1,0.3", "--loads", "5", "--json", folder.path("out.json")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("Verdict: good"));
  const nlohmann::json load = json_of(folder.path("out.json"))["loads"][0];
  const auto compare = [](const nlohmann::json& runs, const char* what) {
    std::map<std::string, double> squares;
    for (const auto& run : runs)
      for (const auto& v : run[what]) squares[run["controller"]] += v.get<double>() * v.get<double>();
    return std::sqrt(squares["computed torque, arm estimated"] / squares["computed torque, nominal"]);
  };
  EXPECT_LT(compare(load["controllers"], "rms_error"), 0.1);
  EXPECT_LT(compare(load["controllers"], "max_error"), 0.2);
  EXPECT_LT(compare(load["after_last_payload_event"]["controllers"], "rms_error"), 0.2);
}

TEST(Track, RefusesAWrongModelAndLoadsThatMakeNoSense) {
  const test::TemporaryFolder folder;
  folder.write("loads.json", kLoads);
  std::string bare = kLoads;
  bare.resize(bare.find(",\n  \"payload\""));
  folder.write("bare.json", bare + "}");
  const auto refused = [&](const std::string& scenario, const std::vector<std::string>& options, int code) {
    std::vector<std::string> line{"track", "--scenario", folder.path(scenario)};
    line.insert(line.end(), options.begin(), options.end());
    const Outcome outcome = run_heft(line);
    EXPECT_EQ(outcome.exit_code, code) << outcome.out;
    return outcome.err;
  };
  for (const char* shares : {"0.3,0.1", "0.1,1"})
    EXPECT_THAT(refused("loads.json", {"--wrong-model", shares}, 2), HasSubstr("--wrong-model: found"));
  EXPECT_THAT(refused("bare.json", {"--loads", "2"}, 3), HasSubstr("found no grasp"));
}

TEST(Track, WorksOnAnArmWithAPrismaticAxis) {
  const test::TemporaryFolder folder;
  folder.write(
      "scara.json",
      R"({"robot": "scara", "duration": 3.0, "reference": {"kind": "fourier", "q0": [0.3, 0.8, 0.05, 0.0],
    "amplitude": [[0.5], [0.5], [0.03], [0.6]], "frequency_hz": [[0.5], [0.6], [0.7], [0.4]], "phase": [[0], [1], [2], [3]], "ramp": 1.0}})");
  const Outcome outcome = run_heft({"track", "--scenario", folder.path("scara.json"), "--json", "-"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(nlohmann::json::parse(outcome.out)["controllers"][3]["rms_error"].size(), 4U);
}

constexpr const char* kScaraWith = R"({
  "robot": "scara", "duration": 6.0, "sample_rate": 1000,
  "reference": {"kind": "fourier", "q0": [0.3, 0.8, 0.05, 0.0], "amplitude": [[0.5], [0.5], [0.03], [0.6]],
    "frequency_hz": [[0.4], [0.5], [0.45], [0.35]], "phase": [[0], [1], [2], [3]], "ramp": 1.0},
  "effects": [EFFECT]
})";

/// Error of computed torque at a joint (from 1) under an effect, without and with the effect in the model.
std::vector<double> errors_with(const std::string& effect, std::size_t joint, const model::Robot& informed) {
  const test::TemporaryFolder folder;
  std::string scenario = kScaraWith;
  scenario.replace(scenario.find("EFFECT"), 6, effect);
  folder.write("s.json", scenario);
  std::vector<double> errors;
  for (const bool with : {false, true}) {
    model::Robot believed = urdf::load_urdf(urdf::resolve_robot("scara"));
    model::write_model(folder.path("m.json"), model::make_model(with ? informed : believed));
    const Outcome outcome = run_heft({"track", "--scenario", folder.path("s.json"), "--model",
                                      folder.path("m.json"), "--from", "1.5", "--json", "-"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    if (outcome.exit_code != 0) return {1.0, 1.0};
    errors.push_back(
        nlohmann::json::parse(outcome.out)["controllers"][2]["rms_error"][joint - 1].get<double>());
  }
  return errors;
}

template <typename Effect>
model::Robot scara_with(int joint, EffectParameters<double> parameters) {
  model::Robot robot = urdf::load_urdf(urdf::resolve_robot("scara"));
  robot.effects = {{joint_effect_kind<Effect>(), joint, parameters}};
  return robot;
}

TEST(Track, FeedsTheModelsEffectsForward) {
  std::vector<double> errors = errors_with(R"({"kind": "stribeck", "joint": 2, "Fs": 3.0, "vs": 0.6})", 2,
                                           scara_with<Stribeck>(1, {3.0, 0.6}));
  EXPECT_LT(errors[1], 0.2 * errors[0]);
  errors = errors_with(R"({"kind": "ripple", "joint": 1, "A": 4.0, "n": 12, "phase": 0.5})", 1,
                       scara_with<Ripple>(0, {4.0, 12, 0.5}));
  EXPECT_LT(errors[1], 0.2 * errors[0]);
  errors =
      errors_with(R"({"kind": "hysteresis", "joint": 2, "x0": 0.15})", 2, scara_with<Hysteresis>(1, {0.15}));
  EXPECT_LT(errors[1], 0.2 * errors[0]);
}

TEST(Track, LeadsTheMotorsOfElasticJoints) {
  model::Robot robot = urdf::load_urdf(urdf::resolve_robot("scara"));
  robot.elasticities = {{1, 400.0, 1.0, 0.1}};
  const std::vector<double> errors = errors_with(
      R"({"kind": "elasticity", "joint": 2, "stiffness": 400, "damping": 1.0, "motor_inertia": 0.1})", 2,
      robot);
  EXPECT_LT(errors[1], 0.2 * errors[0]);
}

TEST(Track, AsksForAReference) {
  const test::TemporaryFolder folder;
  folder.write("s.json",
               R"({"robot": "ur5e", "duration": 1.0, "initial": {"position": [0, 0, 0, 0, 0, 0]}})");
  const Outcome outcome = run_heft({"track", "--scenario", folder.path("s.json")});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("/reference: found none"));
}

TEST(Track, RefusesUnknownSettings) {
  const test::TemporaryFolder folder;
  std::string text = kPick;
  text.replace(text.find("bandwidth_hz"), 12, "bandwith_hz");
  folder.write("s.json", text);
  const Outcome outcome = run_heft({"track", "--scenario", folder.path("s.json")});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("bandwidth_hz"));
}

}  // namespace
}  // namespace heft
