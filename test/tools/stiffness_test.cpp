// heft stiffness as a user runs it.
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "heft/data/log.hpp"
#include "heft/host/file.hpp"
#include "heft/model/model_file.hpp"
#include "heft/stiffness/cartesian_stiffness.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/json_file.hpp"
#include "support/measured_data.hpp"
#include "support/run_heft.hpp"
#include "support/temporary_folder.hpp"

namespace heft {
namespace {

using Eigen::Index;
using Eigen::Vector3d;
using Eigen::VectorXd;
using test::json_of;
using test::Outcome;
using test::run_heft;
using ::testing::HasSubstr;

const VectorXd& true_stiffness() {
  static const VectorXd k = (VectorXd(6) << 12e3, 9e3, 8e3, 4e3, 3.5e3, 5e3).finished();
  return k;
}

/// Fills the empty columns dx..rz of a planned file with what an arm of these stiffnesses does.
std::string measured(const std::string& plan) {
  const model::Robot robot = urdf::load_urdf(urdf::resolve_robot("ur5"));
  const model::Kinematics kinematics(robot);
  std::istringstream lines(plan);
  std::string line, text;
  std::getline(lines, line);
  text = line + "\n";
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 1e-5);
  while (std::getline(lines, line)) {
    std::istringstream fields(line);
    std::vector<std::string> field;
    for (std::string f; std::getline(fields, f, ',');) field.push_back(f);
    VectorXd q(6);
    stiffness::Vector6d wrench;
    for (int j = 0; j < 6; ++j) q[j] = std::stod(field[static_cast<std::size_t>(1 + j)]);
    for (int r = 0; r < 6; ++r) wrench[r] = std::stod(field[static_cast<std::size_t>(8 + r)]);
    const auto exact = stiffness::exact_deflection(kinematics, q, true_stiffness(), wrench);
    text += line.substr(0, line.size() - 6);
    for (int r = 0; r < 6; ++r) {
      char value[40];
      std::snprintf(value, sizeof value, ",%.9g", exact.tool[r] + noise(random));
      text += value;
    }
    text += "\n";
  }
  return text;
}

class StiffnessCommand : public ::testing::Test {
 protected:
  Outcome refuse(const std::string& rows, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"stiffness", "--urdf", "ur5", "--measurements",
                                       folder_.write("m.csv", rows)};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_heft(arguments);
  }
  test::TemporaryFolder folder_;
};

TEST_F(StiffnessCommand, PlansPosesAndFindsTheStiffnessFromTheFilledFile) {
  const Outcome plan = run_heft({"stiffness", "--urdf", "ur5", "--plan", "20", "--pull", "30,20,-40", "--com",
                                 "0.4,0,0", "-o", folder_.path("plan.csv")});
  ASSERT_EQ(plan.exit_code, 0) << plan.err;
  const std::string planned = host::read_file(folder_.path("plan.csv"), "plan");
  EXPECT_EQ(std::count(planned.begin(), planned.end(), '\n'), 21);

  const std::string file = folder_.write("filled.csv", measured(planned));
  const Outcome fit = run_heft({"stiffness", "--urdf", "ur5", "--measurements", file, "--complementary",
                                "--json", folder_.path("k.json"), "--report", folder_.path("k.html"), "-o",
                                folder_.path("elastic.json"), "--payload", "5"});
  ASSERT_EQ(fit.exit_code, 0) << fit.err;
  const nlohmann::json json = json_of(folder_.path("k.json"));
  for (std::size_t j = 0; j < 6; ++j) {
    const double k = true_stiffness()[static_cast<Index>(j)];
    EXPECT_NEAR(json["stiffness"][j].get<double>() / k, 1.0, 0.02) << j + 1;
    EXPECT_LT(json["stiffness_low"][j].get<double>(), json["stiffness_high"][j].get<double>());
  }
  EXPECT_EQ(json["poses"].size(), 20u);
  EXPECT_GT(json["tool"][0]["sag"][2].get<double>(), -0.1);
  EXPECT_LT(json["tool"][0]["sag"][2].get<double>(), 0.0);
  EXPECT_THAT(fit.out, HasSubstr("6 of 6 joints have a stiffness"));
  EXPECT_THAT(host::read_file(folder_.path("k.html"), "page"), HasSubstr("Stiffness of the joints"));

  // What was found goes on into the simulator and back.
  const model::ModelFile model = model::read_model(folder_.path("elastic.json"));
  ASSERT_EQ(model.elasticities.size(), 6u);
  EXPECT_EQ(model.elasticities[3].joint, 3);
  EXPECT_NEAR(model.elasticities[3].stiffness, 4e3, 80.0);
}

TEST_F(StiffnessCommand, SagsUnderPayloadAndMakesUpForIt) {
  data::Log path;
  path.time = VectorXd::LinSpaced(50, 0.0, 1.0);
  path.q.resize(50, 6);
  for (Index i = 0; i < 50; ++i) {
    path.q.row(i) << 0.1, -1.2 + 0.01 * static_cast<double>(i), 1.3, -1.5, -1.5, 0.2;
  }
  data::write_log(folder_.path("path.csv"), path);
  const Outcome outcome = run_heft({"stiffness", "--urdf", "ur5", "--stiffness", "12e3,9e3,8e3,4e3,3.5e3,inf",
                                    "--payload", "5", "--path", folder_.path("path.csv"), "--compensated",
                                    folder_.path("command.csv"), "--json", folder_.path("k.json")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const nlohmann::json json = json_of(folder_.path("k.json"));
  EXPECT_GT(json["path"]["sag_max"].get<double>(), 1e-3);
  EXPECT_LT(json["path"]["left"].get<double>(), 1e-9);
  const data::Log command = data::read_log(folder_.path("command.csv"), {});
  EXPECT_GT((command.q - path.q).cwiseAbs().maxCoeff(), 1e-4);
  EXPECT_EQ((command.q - path.q).col(5).cwiseAbs().maxCoeff(), 0.0);
}

TEST_F(StiffnessCommand, TakesThePublishedDeflectionsAsAnyOther) {
  const Outcome singular =
      run_heft({"stiffness", "--urdf", "ur5", "--measurements", "ur5-stiffness/tool.csv"});
  EXPECT_EQ(singular.exit_code, 4);
  EXPECT_THAT(singular.err, HasSubstr("poses 1, 5 are singular"));
  const Outcome kept = run_heft({"stiffness", "--urdf", "ur5", "--measurements", "ur5-stiffness/tool.csv",
                                 "--keep-singular", "--groups", "1-3,4-6", "--json", "-"});
  ASSERT_EQ(kept.exit_code, 0) << kept.err;
  const nlohmann::json json = nlohmann::json::parse(kept.out);
  EXPECT_NEAR(json["stiffness"][0].get<double>(), 8857.0, 20.0);
  EXPECT_NEAR(json["stiffness"][5].get<double>(), 3869.0, 20.0);
  EXPECT_TRUE(json["residual"]["accepted"].is_null());
}

TEST_F(StiffnessCommand, WritesNoStiffnessThatItDoesNotHave) {
  const Outcome kept =
      run_heft({"stiffness", "--urdf", "ur5", "--measurements", "ur5-stiffness/tool.csv", "--keep-singular",
                "-o", folder_.path("model.json"), "--json", folder_.path("k.json")});
  EXPECT_EQ(kept.exit_code, 4);
  EXPECT_THAT(kept.out, AllOf(HasSubstr("0 of 6 joints have a stiffness"), HasSubstr("Verdict: bad")));
  EXPECT_THAT(kept.err, AllOf(HasSubstr("nothing was written to"), HasSubstr("--groups")));
  EXPECT_FALSE(std::filesystem::exists(folder_.path("model.json")));
  const nlohmann::json json = json_of(folder_.path("k.json"));
  EXPECT_EQ(json["verdict"], "bad");
  for (const auto& stiffness : json["stiffness"]) EXPECT_TRUE(stiffness.is_null()) << stiffness;
}

TEST_F(StiffnessCommand, SaysInPageAndJsonThatRotorInertiaIsMissing) {
  const std::string data = std::string(HEFT_DATA_DIR) + "/kr300-weigand";
  HEFT_NEEDS_MEASURED_DATA(data);
  const Outcome outcome = run_heft({"stiffness", "--urdf", data + "/robot.urdf", "--log", data + "/run-a.csv",
                                    "--log", data + "/run-b.csv", "--json", folder_.path("k.json"),
                                    "--report", folder_.path("page.html")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const nlohmann::json json = json_of(folder_.path("k.json"));
  EXPECT_EQ(json["verdict"], "doubtful");
  EXPECT_THAT(json.at("reasons").at(0).get<std::string>(), HasSubstr("no rotor inertia is known"));
  const std::string page = host::read_file(folder_.path("page.html"), "page");
  EXPECT_THAT(page,
              AllOf(HasSubstr("<div class=\"verdict doubtful\">"), HasSubstr("no rotor inertia is known")));
  // How the page came to be, at its end; paths nowhere else.
  EXPECT_THAT(page, AllOf(HasSubstr("heft stiffness --urdf"), HasSubstr("UTC, heft"), HasSubstr("commit"),
                          HasSubstr("250 samples a second, 10 s")));
  EXPECT_THAT(page, HasSubstr("run-a.csv, run-b.csv</p>"));
}

TEST_F(StiffnessCommand, RefusesBadInputWithTheExitCodeOfTheContract) {
  const std::string header = "q1,q2,q3,q4,q5,q6,fx,fy,fz,dx,dy,dz\n";
  const struct {
    std::string rows;
    int exit_code;
    const char* expected;
  } cases[] = {
      {"q1,q2,q3,q4,q5,q6,force,dx\n0,-1,1,0,1,0,50,1e-4\n", 3, "the wrench has no direction"},
      {header + "0,-1,9,0,1,0,10,10,-40,1e-4,0,0\n", 3, "outside its limits"},
      {header + "0,-1,1,0,1,0,10,10,-40,1e-4,0,x\n", 3, "column 'dz': found 'x'"},
      {header + "0,-1,1,0,0,0,10,10,-40,1e-4,0,0\n", 4, "singular"},
      {header + "0,-1,1,0.3,1,0,10,10,-40,1e-4,0,0\n", 4, "3 different readings for 6 unknowns"},
  };
  for (const auto& c : cases) {
    const Outcome outcome = refuse(c.rows, {"-o", folder_.path("model.json")});
    EXPECT_EQ(outcome.exit_code, c.exit_code) << c.rows << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(c.expected));
    EXPECT_FALSE(std::filesystem::exists(folder_.path("model.json")));
  }
  EXPECT_EQ(run_heft({"stiffness", "--urdf", "ur5"}).exit_code, 2);
  EXPECT_EQ(refuse(header, {"--groups", "1-3,3-6"}).exit_code, 3);
  EXPECT_EQ(refuse(cases[4].rows, {"--groups", "1-3,3-6"}).exit_code, 3);
}

// A joint is elastic only where a log that the fit has not seen says so.
TEST_F(StiffnessCommand, RefusesToJudgeOnTheLogThatWasFitted) {
  data::Log log;
  log.time = VectorXd::LinSpaced(2001, 0.0, 20.0);
  log.q.resize(log.time.size(), 6);
  log.tau.resize(log.time.size(), 6);
  for (Index j = 0; j < 6; ++j) {
    const double rate = 0.7 + 0.3 * static_cast<double>(j);
    log.q.col(j) = 0.4 * (rate * log.time.array()).sin();
    log.tau.col(j) = 10.0 * (rate * log.time.array() + 1.0).cos();
  }
  // A part of it, on another clock.
  data::Log part;
  part.time = log.time.segment(400, 1200).array() + 100.0;
  part.q = log.q.middleRows(400, 1200);
  part.tau = log.tau.middleRows(400, 1200);
  const std::string train = folder_.path("train.csv"), judged = folder_.path("part.csv");
  data::write_log(train, log);
  data::write_log(judged, part);
  const Outcome same = run_heft({"stiffness", "--urdf", "ur5", "--log", train, "--validate", train});
  EXPECT_EQ(same.exit_code, 3) << same.out;
  EXPECT_THAT(same.err, HasSubstr("not judged on the log it was fitted to"));
  const Outcome shifted = run_heft({"stiffness", "--urdf", "ur5", "--log", train, "--validate", judged});
  EXPECT_EQ(shifted.exit_code, 3) << shifted.out;
  EXPECT_THAT(shifted.err, HasSubstr("a part of " + train + ", which the model is fitted to"));
}

TEST_F(StiffnessCommand, ReadsTheEncodersOfALargeRobot) {
  const std::string data = std::string(HEFT_DATA_DIR) + "/kr300-weigand";
  HEFT_NEEDS_MEASURED_DATA(data);
  const Outcome outcome = run_heft({"stiffness", "--urdf", data + "/robot.urdf", "--log", data + "/run-a.csv",
                                    "--log", data + "/run-b.csv", "--rotor-inertia", "607,844,751,83,98,40",
                                    "--json", folder_.path("k.json")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const nlohmann::json json = json_of(folder_.path("k.json"));
  ASSERT_EQ(json["joints"].size(), 3u);
  for (const auto& joint : json["joints"]) {
    EXPECT_EQ(joint["by_log"].size(), 2u);
    EXPECT_TRUE(joint["agreement"]["agrees"].get<bool>());
    EXPECT_GT(joint["stiffness_low"].get<double>(), 1e6);
  }
}

TEST_F(StiffnessCommand, FindsAnElasticJointFromTheMotorsSide) {
  const std::string data = std::string(HEFT_DATA_DIR) + "/undeclared-examples/example-elasticity";
  HEFT_NEEDS_MEASURED_DATA(data);
  const nlohmann::json truth = json_of(data + "/truth.json");
  const Outcome outcome = run_heft({"stiffness", "--urdf", data + "/robot.urdf", "--log", data + "/train.csv",
                                    "--validate", data + "/validate.csv", "--json", folder_.path("k.json")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const nlohmann::json json = json_of(folder_.path("k.json"));
  ASSERT_EQ(json["joints"].size(), 1u) << outcome.out;
  const auto& expected = truth["effects"][0];
  EXPECT_EQ(json["joints"][0]["joint"], expected["joint"]);
  EXPECT_NEAR(
      json["joints"][0]["stiffness"].get<double>() / expected["parameters"]["stiffness"].get<double>(), 1.0,
      0.15);
}

}  // namespace
}  // namespace heft
