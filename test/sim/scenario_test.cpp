#include "heft/sim/scenario.hpp"

#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "support/arms.hpp"

namespace heft::sim {
namespace {

using testing::AllOf;
using testing::HasSubstr;

model::Robot load_robot(const std::string& name) {
  if (name == "ur5e") return test::six_joint_arm();
  if (name == "slider") return test::slider(2.0);
  throw ModelError("no robot " + name);
}

/// A scenario of a block with `more` keys.
std::string slider_scenario(const std::string& more) {
  return R"({"robot": "slider", "duration": 0.1, "initial": {"position": 0})" +
         (more.empty() ? "" : ", " + more) + "}";
}

std::string message_of(const std::string& json) {
  try {
    const Scenario scenario = parse_scenario(json, "arm.json", load_robot);
    make_controller(scenario);
  } catch (const ModelError& e) {
    return e.what();
  }
  return "no error";
}

std::string scenario_file(const std::string& name) {
  return host::read_file(std::string(HEFT_SOURCE_DIR) + "/test/sim/scenarios/" + name, "scenario");
}

TEST(Scenario, ExampleOfTheReadmeRuns) {
  const std::string readme = host::read_file(std::string(HEFT_SOURCE_DIR) + "/src/sim/README.md", "text");
  const std::size_t begin = readme.find("```json\n") + 8;
  const std::string example = readme.substr(begin, readme.find("```", begin) - begin);
  const Scenario scenario = parse_scenario(example, "README.md", load_robot);
  EXPECT_EQ(scenario.robot_name, "ur5e");
  EXPECT_EQ(scenario.settings.sensors.torque_constant[4], 8.0);
  EXPECT_EQ(scenario.settings.payload_events[1].joint, 0);
  const SimulationResult result = simulate_scenario(scenario);
  EXPECT_EQ(result.log.num_samples(), 4001);
  EXPECT_EQ(result.log.current.cols(), 6);
  EXPECT_EQ(result.log.path, "README.md");
  int grasps = 0, releases = 0;
  for (const SimulationEvent& event : result.events) {
    grasps += event.kind == SimulationEvent::Kind::kGrasp;
    releases += event.kind == SimulationEvent::Kind::kRelease;
  }
  EXPECT_EQ(grasps, 1);
  EXPECT_EQ(releases, 1);
}

TEST(Scenario, RunsTwiceToTheSameLog) {
  const Scenario scenario = parse_scenario(scenario_file("closed_loop.json"), "closed_loop.json", load_robot);
  const data::Log first = run_scenario(scenario), second = run_scenario(scenario);
  EXPECT_EQ(first.q, second.q);
  EXPECT_EQ(first.tau, second.tau);
  EXPECT_EQ(first.num_samples(), 10001);
  EXPECT_LT((first.q - first.qref).cwiseAbs().maxCoeff(), 0.1);
}

TEST(Scenario, FreeSwingKeepsItsEnergy) {
  const data::Log log = run_scenario(parse_scenario(scenario_file("free_swing.json"), "f", load_robot));
  const std::size_t last = log.extra.size() - 1;
  ASSERT_EQ(log.extra[last].first, "potential_energy");
  const Eigen::VectorXd kinetic = log.extra[last - 1].second;
  const Eigen::VectorXd energy = kinetic + log.extra[last].second;
  EXPECT_LT((energy.array() - energy[0]).abs().maxCoeff(), 1e-8 * kinetic.maxCoeff());
}

TEST(Scenario, SlowMotionSticksAndSlipsWithoutChatter) {
  const SimulationResult result =
      simulate_scenario(parse_scenario(scenario_file("stick_slip.json"), "s", load_robot));
  EXPECT_GT(result.events.size(), 12u);
  EXPECT_LT(result.events.size(), 600u);
  for (std::size_t i = 0; i < result.events.size(); ++i) {
    // A joint that has stopped stays for longer than a moment, or turns at once.
    for (std::size_t k = i + 1; k < result.events.size() && k < i + 6; ++k) {
      if (result.events[k].joint != result.events[i].joint) continue;
      EXPECT_GT(result.events[k].time - result.events[i].time, 1e-4)
          << "joint " << result.events[i].joint + 1;
      break;
    }
  }
}

TEST(Scenario, HandsControllersOfOtherKindsToTheFactory) {
  const Scenario scenario = parse_scenario(slider_scenario(R"("controller": {"kind": "push", "force": 3})"),
                                           "arm.json", load_robot);
  class Push : public Controller {
   public:
    explicit Push(double force) : force_(force) {}
    void control(double, const Measurement&, Eigen::Ref<Eigen::VectorXd> torque) override {
      torque[0] = force_;
    }

   private:
    double force_;
  };
  const data::Log log =
      run_scenario(scenario, [](const ControllerRequest& request, const SimulationSettings&) {
        const double force = request.settings.number("force");
        request.settings.finish();
        return request.kind == "push" ? std::make_shared<Push>(force) : nullptr;
      });
  EXPECT_NEAR(log.qd(100, 0), 0.15, 1e-9);
  EXPECT_THAT(message_of(slider_scenario(R"("controller": {"kind": "push", "force": 3})")),
              AllOf(HasSubstr("arm.json: /controller/kind: found \"push\""), HasSubstr("pd_gravity")));
}

TEST(Scenario, TakesPublishedTrajectoryKeys) {
  const Scenario scenario = parse_scenario(
      R"({"robot": "slider", "duration": 1, "controller": {"kind": "pd", "kp": 1000, "kd": 50},
          "reference": {"kind": "fourier", "q0": [0.1], "amplitude_rad": [[0.2]], "frequency_hz": [[1]], "phase_rad": [[0.5]]}})",
      "arm.json", load_robot);
  EXPECT_NEAR(scenario.settings.initial_position[0], 0.1 + 0.2 * std::sin(0.5), 1e-15);
}

TEST(Scenario, TiltedBaseGainsHorizontalGravity) {
  const Scenario scenario = parse_scenario(
      slider_scenario(R"("base_tilt": {"tilt_deg": 30, "azimuth_deg": 90})"), "arm.json", load_robot);
  EXPECT_LT((*scenario.settings.gravity - Eigen::Vector3d(0.0, 9.81 * 0.5, -9.81 * std::sqrt(0.75))).norm(),
            1e-12);
}

struct BadScenario {
  const char* keys;
  const char* path;
  const char* found;
  const char* expected;
};

TEST(Scenario, MessagesNameFilePathFoundAndExpected) {
  const BadScenario cases[] = {
      {R"("friktion": {})", "/friktion", "unknown key", "did you mean \"friction\"?"},
      {R"("friction": {"coulom": 1})", "/friction/coulom", "unknown key", "did you mean \"coulomb\"?"},
      {R"("friction": {"coulomb": "high"})", "/friction/coulomb", "\"high\"", "one number or an array of 1"},
      {R"("friction": {"coulomb": -1})", "/friction/coulomb", "-1", "at least 0"},
      {R"("friction": {"coulomb": [1, 2]})", "/friction/coulomb", "2 values", "array of 1"},
      {R"("friction": {"coulomb": 3, "breakaway": 2})", "/friction/breakaway", "2 at joint 1",
       "at least the Coulomb level 3"},
      {R"("friction": {"model": "wet"})", "/friction/model", "\"wet\"", "\"stick_slip\""},
      {R"("friction": {"smooth_speed": 1})", "/friction/smooth_speed", "stick_slip", "\"smooth\""},
      {R"("friction": "some")", "/friction", "\"some\"", "\"none\""},
      {R"("sample_rate": 0)", "/sample_rate", "0", "greater than 0"},
      {R"("log_rate": 300)", "/log_rate", "300", "divided by a whole number"},
      {R"("seed": -1)", "/seed", "-1", "a whole number from 0"},
      {R"("truth": 1)", "/truth", "1", "true or false"},
      {R"("reference": {"kind": "spiral"})", "/reference/kind", "\"spiral\"", "\"waypoints\""},
      {R"("reference": {"kind": "quintic", "from": 0, "to": 1})", "/reference/duration", "nothing",
       "a number"},
      {R"("reference": {"kind": "hold", "position": 0, "start": 1})", "/reference/start", "without a ramp",
       "\"ramp\""},
      {R"("reference": {"kind": "waypoints", "times": [0, 1, 1], "points": [[0], [1], [2]]})",
       "/reference/times/2", "1 after 1", "increase"},
      {R"("reference": {"kind": "fourier", "q0": 0, "amplitude": [[1, 2]], "frequency_hz": [[1]], "phase": [[0, 0]]})",
       "/reference/frequency_hz/0", "1 values", "2 numbers"},
      {R"("controller": {"kind": "pd", "kp": 1, "kd": 1})", "/controller/kind", "without a reference",
       "\"reference\""},
      {R"("reference": {"kind": "hold", "position": 0}, "controller": {"kind": "pd", "kp": 1, "ki": 1, "kd": 1})",
       "/controller/ki", "unknown key", "did you mean"},
      {R"("sensors": {"sampling_jitter": 0.001})", "/sensors/sampling_jitter", "0.001",
       "less than half a sample"},
      {R"("sensors": {"velocity_cutoff_hz": 50})", "/sensors/velocity_cutoff_hz", "exact", "differenced"},
      {R"("payload": [{"event": "release"}])", "/payload/0/event", "nothing is held", "in turn"},
      {R"("payload": [{"event": "grasp", "mass": 0}])", "/payload/0/mass", "0", "greater than 0"},
      {R"("payload": [{"event": "grasp", "mass": 1, "joint": 2, "position": 0}])", "/payload/0/joint", "2",
       "from 1 to 1"},
      {R"("payload": [{"event": "grasp", "mass": 1, "inertia": [1, 0, 1, 0, 0, 5]}])", "/payload/0/inertia",
       "principal moments 1, 1, 5", "sum of the other two"},
      {R"("payload": [{"event": "grasp", "mass": 1, "time": 2}, {"event": "release", "time": 1}])",
       "/payload/1/time", "1 s after an event at 2 s", "do not fall"},
      {R"("solver": {"method": "euler"})", "/solver/method", "\"euler\"", "\"adams\", \"bdf\""},
      {R"("solver": {"relative_tolerance": 1e-20})", "/solver/relative_tolerance", "1e-20", "at least 1e-14"},
      {R"("torque_limit": 0)", "/torque_limit", "0", "greater than 0"},
      {R"("gravity": [0, 0])", "/gravity", "2 values", "array of 3"}};
  for (const BadScenario& bad : cases) {
    const std::string message = message_of(slider_scenario(bad.keys));
    EXPECT_THAT(message, AllOf(HasSubstr(std::string("arm.json: ") + bad.path + ": found "),
                               HasSubstr(bad.found), HasSubstr(bad.expected), HasSubstr("; ")))
        << bad.keys;
    EXPECT_EQ(message.find('\n'), std::string::npos) << bad.keys;
  }
}

TEST(Scenario, RefusesTextThatIsNotJsonWithLineAndColumn) {
  EXPECT_THAT(message_of("{\n  \"robot\": \"slider\"\n  \"duration\": 1\n}"),
              AllOf(HasSubstr("arm.json:3:"), HasSubstr("expected a JSON object"), HasSubstr("comma")));
  EXPECT_THAT(message_of("[1, 2]"),
              AllOf(HasSubstr("arm.json: found [1,2]"), HasSubstr("expected a JSON object")));
}

TEST(Scenario, RefusesAMissingRobotDurationOrStart) {
  EXPECT_THAT(message_of("{}"),
              HasSubstr("arm.json: /robot: found nothing, expected a text in quotes; add the key"));
  EXPECT_THAT(message_of(R"({"robot": "slider", "initial": {"position": 0}})"),
              HasSubstr("/duration: found nothing"));
  EXPECT_THAT(message_of(R"({"robot": "slider", "duration": 1})"), HasSubstr("/initial: found nothing"));
}

}  // namespace
}  // namespace heft::sim
