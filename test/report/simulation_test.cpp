/// Simulations and torques along logs in words, as JSON, as pages.
#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heft/report/dynamics.hpp"
#include "heft/report/simulation.hpp"

namespace heft {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using Kind = sim::SimulationEvent::Kind;

/// Two joints for three seconds: the first 3 mrad beside its reference, the second on it.
sim::Simulation simulated_example() {
  sim::Simulation simulation;
  simulation.robot = "two-joints";
  simulation.source = "/data/pick.json";
  data::Log& log = simulation.result.log;
  log.time = Eigen::VectorXd::LinSpaced(4, 2.0, 5.0);
  log.q = Eigen::MatrixXd::Zero(4, 2);
  log.qref = log.q;
  log.qref.col(0) << 0.003, -0.003, 0.003, -0.003;
  log.tau = Eigen::MatrixXd::Zero(4, 2);
  log.tau(2, 1) = -7.0;
  simulation.result.events = {{2.5, Kind::kStick, 0},
                              {3.25, Kind::kGrasp, -1},
                              {4.0, Kind::kSlip, 0},
                              {4.5, Kind::kStick, 1},
                              {4.75, Kind::kRelease, -1}};
  simulation.result.counts.steps = 17;
  return simulation;
}

TEST(Simulation, KnowsItsErrorsTorquesAndEvents) {
  const sim::Simulation simulation = simulated_example();
  EXPECT_EQ(simulation.duration(), 3.0);
  EXPECT_EQ(simulation.times_stuck(), 2);
  EXPECT_EQ(simulation.payload_events().size(), 2U);
  EXPECT_NEAR(simulation.tracking_error()[0], 0.003, 1e-15);
  EXPECT_EQ(simulation.tracking_error()[1], 0.0);
  EXPECT_EQ(simulation.largest_torque()[1], 7.0);
}

TEST(Simulation, SaysWhatHappened) {
  EXPECT_EQ(report::brief(simulated_example()), "3 s simulated, 2 payload events.");
  EXPECT_THAT(report::full(simulated_example()),
              AllOf(HasSubstr("two-joints simulated for 3 s: 4 samples, 2 payload events, 2 times a joint "
                              "came to stick\n  grasp at 3.2500 s\n  release at 4.7500 s\n"),
                    HasSubstr("0.003"), HasSubstr("7.00")));
  const auto json = nlohmann::json::parse(report::json(simulated_example()));
  EXPECT_EQ(json.at("scenario"), "/data/pick.json");
  EXPECT_FALSE(json.contains("replay"));
  EXPECT_EQ(json.at("events").size(), 5U);
  EXPECT_TRUE(json.at("events").at(1).at("joint").is_null());
  EXPECT_EQ(json.at("events").at(3).at("joint"), 2);
  EXPECT_EQ(json.at("solver").at("steps"), 17);
  EXPECT_NEAR(json.at("rms_tracking_error").at(0).get<double>(), 0.003, 1e-15);
  EXPECT_THAT(report::page(simulated_example()).html(),
              AllOf(HasSubstr("two-joints: simulation"), HasSubstr("pick.json"), Not(HasSubstr("/data/"))));
}

TEST(Simulation, WithoutAReferenceHasNoTrackingError) {
  sim::Simulation simulation = simulated_example();
  simulation.is_replay = true;
  simulation.result.log.qref.resize(0, 0);
  EXPECT_EQ(simulation.tracking_error().size(), 0);
  const auto json = nlohmann::json::parse(report::json(simulation));
  EXPECT_FALSE(json.contains("rms_tracking_error"));
  EXPECT_EQ(json.at("replay"), "/data/pick.json");
  EXPECT_THAT(report::full(simulation), HasSubstr("–"));
}

/// Two rows of one joint.
validate::LogDynamics along(const std::string& path, double torque) {
  validate::LogDynamics one;
  one.log.path = path;
  one.log.time = Eigen::Vector2d(0.0, 0.5);
  one.log.q = Eigen::MatrixXd::Zero(2, 1);
  one.values = Eigen::Vector2d(-0.0, torque);
  return one;
}

TEST(Dynamics, IsWrittenRowByRow) {
  validate::InverseDynamics dynamics;
  dynamics.robot = "pendulum";
  dynamics.columns = {"tau1"};
  dynamics.logs = {along("a.csv", 0.1)};
  EXPECT_EQ(report::csv(dynamics), "time,tau1\n0,0\n0.5,0.1\n");
  EXPECT_EQ(report::brief(dynamics), "pendulum: torque with rotor inertia and friction for 2 rows of 1 log.");
  dynamics.logs.push_back(along("b.csv", -3.0));
  EXPECT_EQ(report::csv(dynamics), "log,time,tau1\n1,0,0\n1,0.5,0.1\n2,0,0\n2,0.5,-3\n");
  EXPECT_EQ(report::full(dynamics),
            "a.csv: torque with rotor inertia and friction of pendulum for 2 rows\n"
            "b.csv: torque with rotor inertia and friction of pendulum for 2 rows\n");
  const auto json = nlohmann::json::parse(report::json(dynamics));
  EXPECT_EQ(json.at("torque_at"), "motor");
  EXPECT_EQ(json.at("logs").at(1).at("max_abs"), nlohmann::json({3.0}));
  EXPECT_THAT(
      report::page(dynamics).html(),
      AllOf(HasSubstr("2 logs"), HasSubstr("Largest torque with rotor inertia and friction: 3.000 N·m.")));
}

}  // namespace
}  // namespace heft
