/// heft excite as a user runs it, and its motion on a simulated arm.
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <sstream>
#include <regex>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heft/core/friction/friction.hpp"
#include "heft/data/log.hpp"
#include "heft/host/file.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/sim/simulator.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/json_file.hpp"
#include "support/run_heft.hpp"
#include "support/temporary_folder.hpp"

namespace heft {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using test::json_of;
using test::Outcome;
using test::run_heft;
using ::testing::AllOf;
using ::testing::HasSubstr;

VectorXd vector_of(const nlohmann::json& json) {
  const auto values = json.get<std::vector<double>>();
  return Eigen::Map<const VectorXd>(values.data(), static_cast<Index>(values.size()));
}

MatrixXd matrix_of(const nlohmann::json& json) {
  MatrixXd m(static_cast<Index>(json.size()), static_cast<Index>(json[0].size()));
  for (std::size_t i = 0; i < json.size(); ++i) m.row(static_cast<Index>(i)) = vector_of(json[i]);
  return m;
}

/// Two links of 2 and 1 kg, turning about y in the x-z plane: quick to design for.
constexpr const char* kExcitedArm = R"(<?xml version="1.0"?>
<robot name="two_links">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.25 0 0"/><mass value="2"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.05"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0.25 0 0"/><mass value="1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.03"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.8"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="60" velocity="3"/><dynamics friction="0.5" damping="0.25"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.5 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="30" velocity="3"/><dynamics friction="0.5" damping="0.25"/></joint>
</robot>
)";

class Excite : public ::testing::Test {
 protected:
  Outcome run(std::vector<std::string> more = {}, const std::string& limits = "") {
    folder_.write("arm.urdf", kExcitedArm);
    std::vector<std::string> arguments{"excite",
                                       "--urdf",
                                       folder_.path("arm.urdf"),
                                       "-o",
                                       folder_.path("out.csv"),
                                       "--duration",
                                       "8",
                                       "--starts",
                                       "2",
                                       "--compare",
                                       "5",
                                       "--json",
                                       folder_.path("out.json")};
    if (!limits.empty()) {
      folder_.write("limits.json", limits);
      more.insert(more.end(), {"--limits", folder_.path("limits.json")});
    }
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_heft(arguments);
  }
  /// One message, no files, this exit code.
  std::string refusal(int exit_code, const std::string& limits, const std::vector<std::string>& more = {}) {
    const Outcome bad = run(more, limits);
    EXPECT_EQ(bad.exit_code, exit_code) << bad.err;
    for (const char* file : {"out.csv", "out.json"})
      EXPECT_FALSE(std::filesystem::exists(folder_.path(file))) << file;
    return bad.err;
  }
  nlohmann::json result() const { return json_of(folder_.path("out.json")); }

  test::TemporaryFolder folder_;
};

/// Computed torque from the arm's own model; friction for the velocity that is wanted.
class ComputedTorque : public sim::Controller {
 public:
  explicit ComputedTorque(const model::Robot& robot) : dynamics_(robot) {}
  void control(double, const sim::Measurement& now, Eigen::Ref<VectorXd> torque) override {
    constexpr double kNatural = 30.0;  // [rad/s]
    const VectorXd wanted =
        now.qdd_ref + kNatural * kNatural * (now.q_ref - now.q) + 2.0 * kNatural * (now.qd_ref - now.qd);
    torque = dynamics_.inverse_dynamics(now.q, now.qd, wanted);
    for (Index j = 0; j < torque.size(); ++j) {
      torque[j] += friction_torque(dynamics_.robot().joints[static_cast<std::size_t>(j)].actuation,
                                   now.qd_ref[j], 0.02);
    }
  }

 private:
  model::Dynamics dynamics_;
};

TEST(ExciteUr10e, MotionMeetsItsTargetsAndKeepsItsLimitsOnTheSimulatedArm) {
  const test::TemporaryFolder folder;
  const Outcome outcome =
      run_heft({"excite", "--urdf", "ur10e", "--duration", "20", "--harmonics", "5", "--compare", "100", "-o",
                folder.path("out.csv"), "--json", folder.path("out.json")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  // On a slow machine a line every ten seconds says how far the design is.
  EXPECT_EQ(std::regex_replace(outcome.err, std::regex("heft: designing [0-9]+ % after [0-9]+ s\n"), ""), "");
  const nlohmann::json result = json_of(folder.path("out.json"));
  EXPECT_EQ(result["parameters"].size(), 48U);
  EXPECT_LE(result["condition_number"].get<double>(), 15.0);
  EXPECT_LE(result["condition_number_unweighted_rows"].get<double>(), 15.0);
  EXPECT_EQ(result["random"]["count"], 100);
  EXPECT_GE(result["random"]["std_reduction_percent"].get<double>(), 60.0);
  EXPECT_GE(result["random"]["std_principal_axes_reduction_percent"].get<double>(), 60.0);
  EXPECT_TRUE(result["reached"]["inside"].get<bool>());

  // The motion from the JSON's scenario reference, on an arm that sticks and slips, through sensors with noise.
  const model::Robot robot = urdf::load_urdf(urdf::resolve_robot("ur10e"));
  const nlohmann::json& reference = result["trajectory"]["reference"];
  sim::SimulationSettings settings;
  settings.robot = robot;
  settings.loads = sim::friction_of(robot);
  settings.duration = 20.0;
  settings.sample_rate = 500.0;
  settings.initial_position = vector_of(result["trajectory"]["start"]);
  settings.torque_limit = sim::effort_limits_of(robot);
  settings.reference =
      sim::make_fourier({vector_of(reference["q0"]), matrix_of(reference["amplitude"]),
                         matrix_of(reference["frequency_hz"]), matrix_of(reference["phase"])});
  settings.controller = std::make_shared<ComputedTorque>(robot);
  settings.sensors.encoder_quantum = VectorXd::Constant(6, 2e-5);
  settings.sensors.position_noise = VectorXd::Constant(6, 1e-5);
  settings.sensors.velocity = sim::VelocitySource::kDifferenced;
  settings.sensors.velocity_cutoff_hz = 50.0;
  settings.sensors.torque_noise = VectorXd::Constant(6, 0.3);
  settings.seed = 1;
  const data::Log log = sim::simulate(settings).log;

  ASSERT_GT(log.num_samples(), 9000);
  for (Index j = 0; j < 6; ++j) {
    const model::RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
    EXPECT_GT(log.q.col(j).minCoeff(), joint.lower) << j;
    EXPECT_LT(log.q.col(j).maxCoeff(), joint.upper) << j;
    EXPECT_LT(log.qd.col(j).cwiseAbs().maxCoeff(), joint.velocity_limit) << j;
    EXPECT_LT(log.tau.col(j).cwiseAbs().maxCoeff(), joint.effort_limit) << j;
    // It is this motion that was simulated, and it used what it may.
    EXPECT_LT((log.q.col(j) - log.qref.col(j)).cwiseAbs().maxCoeff(), 0.02) << j;
  }
  EXPECT_GT((log.qd.cwiseAbs().colwise().maxCoeff().transpose().array() /
             Eigen::Array<double, 6, 1>(2.09, 2.09, 3.14, 3.14, 3.14, 3.14))
                .maxCoeff(),
            0.85);
}

TEST_F(Excite, WritesALogThatDynamicsAgreesWith) {
  const Outcome done = run({"--rate", "50", "--report", folder_.path("out.html")});
  ASSERT_EQ(done.exit_code, 0) << done.err;
  EXPECT_THAT(done.out, AllOf(HasSubstr("Condition number"), HasSubstr("columns scaled to norm 1"),
                              HasSubstr("standard deviation"),
                              HasSubstr("Rehearsed on the simulated arm: all limits kept"),
                              HasSubstr("Speed of tool and link origins: 1.5 m/s")));
  EXPECT_THAT(host::read_file(folder_.path("out.html"), "page"),
              AllOf(HasSubstr("</html>"), HasSubstr("Limits")));
  data::LogRequirements needs;
  needs.num_joints = 2;
  needs.velocity = needs.acceleration = needs.torque = true;
  const data::Log log = data::read_log(folder_.path("out.csv"), needs);
  EXPECT_EQ(log.num_samples(), 401);
  EXPECT_DOUBLE_EQ(log.time[400], 8.0);
  for (const Index row : {Index{0}, Index{400}}) {
    EXPECT_EQ(log.qd.row(row).cwiseAbs().maxCoeff(), 0.0) << "friction takes the sign of any velocity";
    EXPECT_LT(log.qdd.row(row).cwiseAbs().maxCoeff(), 1e-9);
  }
  ASSERT_EQ(run_heft({"dynamics", "--urdf", folder_.path("arm.urdf"), "--log", folder_.path("out.csv"), "-o",
                      folder_.path("tau.csv")})
                .exit_code,
            0);
  std::istringstream lines(host::read_file(folder_.path("tau.csv"), "torque"));
  std::string line;
  std::getline(lines, line);
  for (Index i = 0; std::getline(lines, line); ++i) {
    double time = 0, a = 0, b = 0;
    ASSERT_EQ(std::sscanf(line.c_str(), "%lf,%lf,%lf", &time, &a, &b), 3);
    EXPECT_NEAR(a, log.tau(i, 0), 1e-9);
    EXPECT_NEAR(b, log.tau(i, 1), 1e-9);
  }
}

TEST_F(Excite, KeepsTheLimitsOfTheFile) {
  const Outcome done =
      run({}, R"({"lower": [-1, -0.5], "upper": 1.5, "velocity": [1.2, 2], "acceleration": 2.5,
                                   "torque": [25, 8], "margin": 0.02, "floor": 0.3, "clearance": 0.1})");
  ASSERT_EQ(done.exit_code, 0) << done.err;
  data::LogRequirements needs;
  needs.velocity = needs.acceleration = needs.torque = true;
  const data::Log log = data::read_log(folder_.path("out.csv"), needs);
  EXPECT_GT(log.q.col(0).minCoeff(), -1.0);
  EXPECT_GT(log.q.col(1).minCoeff(), -0.5);
  EXPECT_LT(log.q.maxCoeff(), 1.5);
  EXPECT_LT(log.qd.col(0).cwiseAbs().maxCoeff(), 1.2 * 0.98);
  EXPECT_LT(log.qd.col(1).cwiseAbs().maxCoeff(), 2.0 * 0.98);
  EXPECT_LT(log.qdd.cwiseAbs().maxCoeff(), 2.5 * 0.98);
  EXPECT_LT(log.tau.col(0).cwiseAbs().maxCoeff(), 25 * 0.98);
  EXPECT_LT(log.tau.col(1).cwiseAbs().maxCoeff(), 8 * 0.98);
  // Joint 1 is 0.8 m up; a positive turn about y lowers what points along x.
  const auto elbow = 0.8 - 0.5 * log.q.col(0).array().sin();
  EXPECT_GT(elbow.minCoeff(), 0.4);
  EXPECT_NEAR(result()["limits"]["floor"].get<double>(), 0.3, 1e-12);
}

TEST_F(Excite, ASecondMotionAddsToAGivenLog) {
  ASSERT_EQ(run({"--seed", "3"}).exit_code, 0);
  const double alone = result()["std_geometric_mean"];
  host::write_file_atomically(folder_.path("first.csv"), host::read_file(folder_.path("out.csv"), "log"));
  const Outcome done = run({"--seed", "3", "--given", folder_.path("first.csv")});
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const nlohmann::json json = result();
  EXPECT_NEAR(json["given"]["std_geometric_mean"].get<double>() / alone, 1.0, 0.05);
  EXPECT_LT(json["std_geometric_mean"].get<double>(), 0.75 * alone);
  EXPECT_THAT(done.out, HasSubstr("The given logs alone"));
}

TEST_F(Excite, PayloadOnlySeeksTheLastLink) {
  ASSERT_EQ(run({"--payload-only"}).exit_code, 0);
  for (const nlohmann::json& parameter : result()["parameters"]) {
    EXPECT_THAT(parameter["name"].get<std::string>(), ::testing::EndsWith("2"));
  }
}

TEST_F(Excite, SaysWhatIsWrongWithItsInput) {
  EXPECT_THAT(refusal(3, R"({"velocity": [1, 0]})"),
              AllOf(HasSubstr("limits.json: /velocity"), HasSubstr("found")));
  EXPECT_THAT(refusal(3, R"({"lower": 2, "upper": 1})"),
              AllOf(HasSubstr("limits.json: joint 1 (shoulder)"), HasSubstr("expected lower < upper")));
  EXPECT_THAT(refusal(3, R"({"velocty": 1})"), AllOf(HasSubstr("velocty"), HasSubstr("velocity")));
  EXPECT_THAT(refusal(4, R"({"floor": 9})"),
              AllOf(HasSubstr("no position found"), HasSubstr("no safe motion"), HasSubstr("height of")));
  EXPECT_THAT(refusal(3, R"({"floor": 1e300})"),
              AllOf(HasSubstr("floor: found 1e+300"), HasSubstr("expected a length")));
  EXPECT_THAT(refusal(3, R"({"obstacles": [{"lower": [0, 0, 0], "upper": [1, 1]}]})"),
              AllOf(HasSubstr("limits.json"), HasSubstr("/upper")));
  EXPECT_THAT(refusal(3, R"({"obstacles": [{"lower": [0, 0, 2], "upper": [1, 1, 1]}]})"),
              AllOf(HasSubstr("obstacle 1"), HasSubstr("along z")));
  EXPECT_THAT(refusal(4, R"({"obstacles": [{"name": "safe", "lower": [-3, -3, -3], "upper": [3, 3, 3]}]})"),
              AllOf(HasSubstr("no safe motion"), HasSubstr("from safe")));
  EXPECT_THAT(refusal(3, R"({"torque": 0.3})"), HasSubstr("Coulomb friction alone"));
  EXPECT_THAT(refusal(3, R"({"start": [0, 4]})"),
              AllOf(HasSubstr("joint 2 (elbow): start: found 4"), HasSubstr("limits")));
  EXPECT_THAT(refusal(3, R"({"lower": 0.1, "upper": 0.2})", {"--start", "0.15,0.3"}),
              HasSubstr("joint 2 (elbow): start: found 0.3"));
  EXPECT_THAT(refusal(3, "", {"--harmonics", "1"}),
              AllOf(HasSubstr("harmonics: found 1"), HasSubstr("at least 2")));
  EXPECT_THAT(refusal(4, R"({"lower": 0.1, "upper": 0.10001})"),
              AllOf(HasSubstr("undetermined: "), HasSubstr("wider limits")));
  EXPECT_THAT(refusal(3, "", {"--given", folder_.path("none.csv")}), HasSubstr("none.csv"));
  EXPECT_EQ(run({"--cost", "best"}).exit_code, 2);
}

TEST_F(Excite, RefusesWorkWithoutEndAtOnce) {
  EXPECT_THAT(refusal(3, "", {"--rate", "1e8"}),
              AllOf(HasSubstr("found 8e+08 rows"), HasSubstr("lower rate")));
  EXPECT_EQ(run({"--harmonics", "100"}).exit_code, 2);
}

TEST_F(Excite, RefusesOptionsThatDoNotGoTogether) {
  EXPECT_EQ(run({"--speeds", "3"}).exit_code, 2);
  folder_.write("arm.urdf", kExcitedArm);
  const Outcome mixed = run_heft({"excite", "--urdf", folder_.path("arm.urdf"), "--for", "friction",
                                  "--harmonics", "3", "-o", folder_.path("out.csv")});
  EXPECT_EQ(mixed.exit_code, 2);
  EXPECT_THAT(mixed.err, HasSubstr("--harmonics is for --for parameters only"));
  EXPECT_EQ(run({"--payload", "1,2"}).exit_code, 2);
  EXPECT_EQ(run({"--write-urscript", folder_.path("p.script")}).exit_code, 2) << "two joints";
}

TEST_F(Excite, LeadsFromAPoseAndBackAndItsFilesSayTheSame) {
  const Outcome done = run({"--from", "0,0.5", "--payload", "0.5,0,0,0.1", "--write-ros",
                            folder_.path("out.yaml"), "--tool-speed", "0.6"});
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const nlohmann::json json = result();
  ASSERT_EQ(json["phases"].size(), 3U);
  EXPECT_EQ(json["phases"][0]["name"], "approach");
  EXPECT_EQ(json["verdict"], "good");
  EXPECT_LE(json["reached"]["tool_speed"].get<double>(), 0.6);
  EXPECT_LE(json["rehearsal"]["tool_speed"].get<double>(), 0.6);
  EXPECT_TRUE(json["rehearsal"]["passed"].get<bool>());
  data::LogRequirements needs;
  needs.velocity = true;
  const data::Log log = data::read_log(folder_.path("out.csv"), needs);
  for (const Index row : {Index{0}, Index{log.num_samples() - 1}}) {
    EXPECT_NEAR(log.q(row, 0), 0.0, 1e-6);
    EXPECT_NEAR(log.q(row, 1), 0.5, 1e-3);
  }
  EXPECT_THAT(host::read_file(folder_.path("out.yaml"), "trajectory"),
              HasSubstr("joint_names: [\"shoulder\", \"elbow\"]"));

  // The CSV runs on the simulated arm.
  const Outcome replay = run_heft({"simulate", "--urdf", folder_.path("arm.urdf"), "--replay",
                                   folder_.path("out.csv"), "-o", folder_.path("replay.csv")});
  ASSERT_EQ(replay.exit_code, 0) << replay.err;
  const data::Log run_log = data::read_log(folder_.path("replay.csv"), needs);
  EXPECT_NEAR(run_log.time[run_log.num_samples() - 1], log.time[log.num_samples() - 1], 0.02);
  EXPECT_LT((run_log.q - run_log.qref).cwiseAbs().maxCoeff(), 0.01);
  EXPECT_EQ(run_heft({"simulate", "-o", folder_.path("x.csv")}).exit_code, 2)
      << "neither scenario nor replay";
}

TEST_F(Excite, StrokesForFrictionAreListed) {
  folder_.write("arm.urdf", kExcitedArm);
  const Outcome done = run_heft({"excite", "--urdf", folder_.path("arm.urdf"), "--for", "friction",
                                 "--speeds", "2", "--stroke", "1", "-o", folder_.path("out.csv"), "--json",
                                 folder_.path("out.json"), "--report", folder_.path("out.html")});
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const nlohmann::json json = result();
  EXPECT_EQ(json["strokes"].size(), 8U);
  EXPECT_EQ(json["strokes"][0]["speed"].get<double>(), -json["strokes"][1]["speed"].get<double>());
  EXPECT_THAT(host::read_file(folder_.path("out.html"), "page"), HasSubstr("Stretches at constant speed"));
}

}  // namespace
}  // namespace heft
