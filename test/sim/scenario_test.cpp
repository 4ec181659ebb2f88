#include "heft/sim/scenario.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
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

struct BadScenario {
  const char* keys;
  const char* path;
  const char* found;
  const char* expected;
};

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

TEST(Scenario, ExampleOfTheReadmeWithEffectsRuns) {
  const std::string readme = host::read_file(std::string(HEFT_SOURCE_DIR) + "/src/sim/README.md", "text");
  const std::size_t begin = readme.rfind("```json\n") + 8;
  const std::string example = readme.substr(begin, readme.find("```", begin) - begin);
  const Scenario scenario = parse_scenario(example, "README.md", load_robot);
  const SimulationSettings& s = scenario.settings;
  ASSERT_EQ(s.robot.effects.size(), 1u);
  EXPECT_EQ(s.robot.effects[0].joint, 1);
  ASSERT_EQ(s.robot.elasticities.size(), 1u);
  EXPECT_EQ(s.robot.elasticities[0].stiffness, 9000.0);
  ASSERT_EQ(s.robot.couplings.size(), 1u);
  EXPECT_EQ(s.robot.couplings[0].coulomb_friction, 0.5);
  EXPECT_EQ(s.robot.torque_delay, 0.004);
  EXPECT_NEAR(s.gravity->norm(), 9.81, 1e-12);
  EXPECT_GT(s.gravity->x(), 0.0);
  EXPECT_EQ(s.tool_wrench(0.2).force.norm(), 0.0);
  EXPECT_EQ(s.tool_wrench(0.5).force, Eigen::Vector3d(10, 0, -5));
  EXPECT_LT(s.tool_wrench(0.33).force.norm(), 11.0);
  EXPECT_GT(s.tool_wrench(0.33).force.norm(), 1.0);
  EXPECT_EQ(s.tool_wrench(0.71).force.norm(), 0.0);
  ASSERT_EQ(s.payload_events.size(), 1u);
  EXPECT_EQ(s.payload_events[0].time, 0.5);
  const data::Log log = run_scenario(scenario);
  EXPECT_EQ(log.num_samples(), 1001);
  bool bends = false;
  for (const auto& [name, values] : log.extra) bends = bends || (name == "qlink1" && values != log.q.col(0));
  EXPECT_TRUE(bends);
}

TEST(Scenario, EveryJointEffectActsAtItsJoint) {
  // A block that is pulled along: torque beyond m a, by the formulas.
  struct Case {
    const char* keys;
    std::function<double(double t, double q, double v, double a)> torque;
  };
  const Case cases[] = {
      {R"("kind": "stribeck", "Fs": 3.0, "vs": 0.2)",
       [](double, double, double v, double) { return 3.0 * std::exp(-v * v / 0.04); }},
      {R"("kind": "offset", "tau0": -2.0)", [](double, double, double, double) { return -2.0; }},
      {R"("kind": "offset", "tau0": -2.0, "variant": "asymmetric")",
       [](double, double, double, double) { return -2.0; }},
      {R"("kind": "viscous_nonlinear", "c": 1.5, "p": 3)",
       [](double, double, double v, double) { return 1.5 * v * v * v; }},
      {R"("kind": "load_friction", "mu": 0.3)",
       [](double, double, double, double a) { return 0.3 * std::abs(2.0 * a); }},
      {R"("kind": "rotor_inertia", "Ia": 0.7)", [](double, double, double, double a) { return 0.7 * a; }},
      {R"("kind": "spring", "k": 8.0, "q0": 0.1)",
       [](double, double q, double, double) { return 8.0 * (q - 0.1); }},
      {R"("kind": "ripple", "A": 0.5, "n": 30, "phase": 1.0)",
       [](double, double q, double, double) { return 0.5 * std::sin(30.0 * q + 1.0); }},
      {R"("kind": "hysteresis", "x0": 0.02)",
       [](double, double q, double, double) { return -1.0 * std::exp(-q / 0.02); }},
      {R"("kind": "hysteresis", "x0": 0.02, "sharp": 0.25)",
       [](double, double q, double, double) { return -0.75 * std::exp(-q / 0.02); }},
      {R"("kind": "friction_drift", "alpha_c": 0.5, "alpha_v": 2.0, "T": 0.3)",
       [](double t, double, double v, double) { return std::exp(-t / 0.3) * (0.5 * 1.0 + 2.0 * 0.4 * v); }},
      {R"("kind": "friction_temperature", "kc": -0.02, "kv": 0.03, "T0": 25)",
       [](double t, double, double v, double) {
         return (-0.02 + 0.03 * v) * (40.0 - 20.0 * std::exp(-t / 0.5) - 25.0);
       }}};
  for (const Case& one : cases) {
    const std::string json = R"({"robot": "slider", "duration": 0.1, "torque": {"offset": 12},
        "initial": {"position": 0, "velocity": 0.3}, "friction": {"coulomb": 1.0, "viscous": 0.4},
        "temperature": {"start": 20, "end": 40, "time_constant": 0.5},
        "effects": [{"joint": 1, )" +
                             std::string(one.keys) + "}]}";
    const data::Log log = run_scenario(parse_scenario(json, "arm.json", load_robot));
    double largest = 0.0;
    for (Eigen::Index k = 0; k < log.time.size(); ++k) {
      const double q = log.q(k, 0), v = log.qd(k, 0), a = log.qdd(k, 0);
      ASSERT_GT(v, 0.0);
      ASSERT_NEAR(log.temperature(k, 0), 40.0 - 20.0 * std::exp(-log.time[k] / 0.5), 1e-9);
      const double expected = one.torque(log.time[k], q, v, a);
      EXPECT_NEAR(log.tau(k, 0) - 2.0 * a - 1.0 - 0.4 * v, expected, 1e-7) << one.keys << " " << log.time[k];
      largest = std::max(largest, std::abs(expected));
    }
    EXPECT_GT(largest, 0.01) << one.keys;
  }
}

TEST(Scenario, EffectsScaleTheFrictionThatIsSimulated) {
  // F_c of the first joint is 5 by the robot, 2 by the scenario, or nothing.
  const auto drift = [](const std::string& friction) {
    const std::string json =
        R"({"robot": "ur5e", "duration": 1, "initial": {"position": 0}, )" + friction +
        R"("effects": [{"kind": "friction_drift", "joint": 1, "alpha_c": 0.5, "T": 1}]})";
    const Scenario scenario = parse_scenario(json, "arm.json", load_robot);
    return scenario.settings.loads[0].effects.back()->torque({0.0, 0.0, 1.0, 1.0}, nullptr);
  };
  EXPECT_EQ(drift(""), 2.5);
  EXPECT_EQ(drift(R"("friction": {"coulomb": 2}, )"), 1.0);
  EXPECT_EQ(drift(R"("friction": "none", )"), 0.0);
  EXPECT_EQ(drift(R"("friction": {"model": "none"}, )"), 0.0);
}

TEST(Scenario, CouplesAnyPairOfJoints) {
  const auto couplings = [](const std::string& effect) {
    return parse_scenario(R"({"robot": "arm", "duration": 0.1, "initial": {"position": 0}, "effects": [)" +
                              effect + "]}",
                          "arm.json", [](const std::string&) { return test::six_joint_arm(); })
        .settings.robot.couplings;
  };
  const auto named = couplings(
      R"({"kind": "wrist_coupling", "driving": 2, "driven": 4, "Fc": 1}, {"kind": "wrist_coupling", "Fv": 2})");
  ASSERT_EQ(named.size(), 2U);
  EXPECT_EQ(named[0].driving, 1);
  EXPECT_EQ(named[0].driven, 3);
  EXPECT_EQ(named[0].coulomb_friction, 1.0);
  // As scenarios without a pair have always meant.
  EXPECT_EQ(named[1].driving, 4);
  EXPECT_EQ(named[1].driven, 5);
  EXPECT_EQ(named[1].viscous_friction, 2.0);
}

TEST(Scenario, PutsACableOverAnyTwoJoints) {
  const auto cables = [](const std::string& keys) {
    return parse_scenario(R"({"robot": "arm", "duration": 0.1, "initial": {"position": 0}, "effects": [{"kind": "cable", )" +
                              keys + "}]}",
                          "arm.json", [](const std::string&) { return test::six_joint_arm(); })
        .settings.robot.cables;
  };
  const auto cable = cables(R"("driving": 2, "driven": 4, "k": 3, "x0": 0.1, "ratio": -0.5)");
  ASSERT_EQ(cable.size(), 1U);
  EXPECT_EQ(cable[0].driving, 1);
  EXPECT_EQ(cable[0].driven, 3);
  EXPECT_EQ(cable[0].stiffness, 3.0);
  EXPECT_EQ(cable[0].neutral, 0.1);
  EXPECT_EQ(cable[0].ratio, -0.5);
  EXPECT_THROW(cables(R"("driving": 2, "driven": 2, "k": 3)"), Error);
  EXPECT_THROW(cables(R"("driving": 2, "driven": 4, "k": -3)"), Error);
  EXPECT_THROW(cables(R"("driving": 2, "k": 3)"), Error);
}

TEST(Scenario, MessagesOfEffectsNamePathFoundAndExpected) {
  const BadScenario cases[] = {
      {R"("effects": {})", "/effects", "{}", "an array of objects"},
      {R"("effects": [{"kind": "stribek", "joint": 1}])", "/effects/0/kind", "\"stribek\"",
       "\"base_tilt\", \"cable\", \"contact\", \"delay\", \"elasticity\", \"friction_curve\", \"friction_drift\", \"friction_temperature\", \"hysteresis\", "
       "\"load_friction\", \"offset\", \"payload_change\", \"ripple\", \"rotor_inertia\", \"spring\", "
       "\"stribeck\", \"torque_scale\", \"viscous_nonlinear\", \"wrist_coupling\""},
      {R"("effects": [{"kind": "friction_temperature", "joint": 1, "kc": 1, "T0": 20}])", "/effects/0/kind",
       "\"friction_temperature\"", "\"temperature\""},
      {R"("effects": [{"kind": "stribeck", "joint": 2, "Fs": 1, "vs": 1}])", "/effects/0/joint", "2",
       "from 1 to 1"},
      {R"("effects": [{"kind": "stribeck", "joint": 1, "Fs": 1}])", "/effects/0/vs", "nothing",
       "greater than 0"},
      {R"("effects": [{"kind": "stribeck", "joint": 1, "Fs": -1, "vs": 1}])", "/effects/0/Fs", "-1",
       "at least 0"},
      {R"("effects": [{"kind": "stribeck", "joint": 1, "Fs": 1, "vs": 1, "vz": 1}])", "/effects/0/vz",
       "unknown key", "did you mean \"vs\"?"},
      {R"("effects": [{"kind": "load_friction", "joint": 1, "mu": 1.5}])", "/effects/0/mu", "1.5", "below 1"},
      {R"("effects": [{"kind": "offset", "joint": 1, "tau0": 1, "variant": "odd"}])", "/effects/0/variant",
       "\"odd\"", "\"asymmetric\""},
      {R"("effects": [{"kind": "elasticity", "joint": 1, "stiffness": 0, "motor_inertia": 1}])",
       "/effects/0/stiffness", "0", "greater than 0"},
      {R"("effects": [{"kind": "elasticity", "joint": 1, "stiffness": 1, "motor_inertia": 1},
                      {"kind": "elasticity", "joint": 1, "stiffness": 1, "motor_inertia": 1}])",
       "/effects/1/joint", "1", "once"},
      {R"("effects": [{"kind": "elasticity", "joint": 1, "stiffness": 1, "motor_inertia": 1, "gap": -1}])",
       "/effects/0/gap", "-1", "at least 0"},
      {R"("effects": [{"kind": "elasticity", "joint": 1, "stiffness": 1, "motor_inertia": 1, "gap": 2}])",
       "/effects/0/gap", "2", "at most 0.5 rad"},
      {R"("effects": [{"kind": "delay", "delay": -1}])", "/effects/0/delay", "-1", "at least 0"},
      {R"("effects": [{"kind": "delay", "delay": 0}, {"kind": "delay", "delay": 0}])", "/effects/1/kind",
       "a second time", "once"},
      {R"("effects": [{"kind": "wrist_coupling", "Fc": 1}])", "/effects/0/kind", "an arm of 1 joints",
       "5 and 6"},
      {R"("base_tilt": {"tilt_deg": 1}, "effects": [{"kind": "base_tilt", "tilt_deg": 1}])",
       "/effects/0/kind", "and the key \"base_tilt\"", "one of the two"},
      {R"("payload": [], "effects": [{"kind": "payload_change", "event": "dropped", "time": 1, "mass": 1}])",
       "/effects/0/kind", "and the key \"payload\"", "one of the two"},
      {R"("effects": [{"kind": "payload_change", "event": "lost", "time": 1, "mass": 1}])",
       "/effects/0/event", "\"lost\"", "\"dropped\""},
      {R"("effects": [{"kind": "contact", "events": [{"t0": 1, "duration": 0, "force": [1, 0, 0]}]}])",
       "/effects/0/events/0/duration", "0", "greater than 0"}};
  for (const BadScenario& bad : cases) {
    EXPECT_THAT(message_of(slider_scenario(bad.keys)),
                AllOf(HasSubstr(std::string("arm.json: ") + bad.path + ": found "), HasSubstr(bad.found),
                      HasSubstr(bad.expected), HasSubstr("; ")))
        << bad.keys;
  }
}

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
