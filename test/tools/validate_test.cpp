/// heft validate as a user runs it: models that know their robot, criteria, the simulated campaign.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heft/data/log.hpp"
#include "heft/data/log_part.hpp"
#include "heft/host/file.hpp"
#include "heft/model/dynamics.hpp"
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
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

/// All numbers of a CSV file behind its header.
std::vector<double> numbers_below_header(const std::string& path) {
  std::string text = host::read_file(path, "result");
  std::replace(text.begin(), text.end(), ',', ' ');
  std::istringstream stream(text.substr(text.find('\n')));
  return {std::istream_iterator<double>(stream), std::istream_iterator<double>()};
}

model::Robot ur10e() {
  model::Robot robot = urdf::load_urdf(HEFT_URDF_DIR "/ur10e.urdf");
  for (model::RobotJoint& joint : robot.joints) joint.actuation = {0.5, 3.0, 4.0, 0.2};
  return robot;
}

/// Smooth motion with the torque that the robot needs, plus `offset` on every joint.
data::Log log_of(const model::Robot& robot, double offset = 0.0) {
  const model::Dynamics dynamics(robot);
  const int n = robot.num_joints();
  constexpr int kRows = 1500;
  data::Log log;
  log.time.resize(kRows);
  log.q.resize(kRows, n);
  log.tau.resize(kRows, n);
  Eigen::VectorXd q(n), qd(n), qdd(n);
  for (int k = 0; k < kRows; ++k) {
    const double t = 0.01 * k;
    log.time[k] = t;
    for (int j = 0; j < n; ++j) {
      const double w = 1.0 + 0.2 * j;
      q[j] = 0.3 * j + 0.8 * std::sin(w * t);
      qd[j] = 0.8 * w * std::cos(w * t);
      qdd[j] = -0.8 * w * w * std::sin(w * t);
    }
    log.q.row(k) = q;
    log.tau.row(k) = dynamics.joint_torque(q, qd, qdd).array() + offset;
  }
  return log;
}

TEST(Validate, NeedsNoUrdfWhenTheModelKnowsItsRobot) {
  const test::TemporaryFolder folder;
  model::write_model(folder.path("arm.json"), model::make_model(ur10e()));
  data::write_log(folder.path("unseen.csv"), log_of(ur10e()));
  const Outcome run =
      run_heft({"validate", "--model", folder.path("arm.json"), "--log", folder.path("unseen.csv"), "--json",
                folder.path("out.json"), "--report", folder.path("page.html")},
               "/");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const nlohmann::json result = json_of(folder.path("out.json"));
  for (const char* field : {"rmse", "rmse_in_band", "rmse_percent_of_max", "r2", "quantile_999", "bias"}) {
    ASSERT_EQ(result[field].size(), 6U) << field;
  }
  // The log was made by the model; what is left is the filter of the motion and the friction's sign at reversals.
  for (const auto& percent : result["rmse_percent_of_max"]) EXPECT_LT(percent.get<double>(), 3.0);
  EXPECT_TRUE(result["physically_consistent"].get<bool>());
  EXPECT_TRUE(result.contains("base_parameters"));
  EXPECT_TRUE(result.contains("condition_number"));
  ASSERT_EQ(result["criteria"].size(), 5U);
  EXPECT_EQ(result["criteria"][1]["verdict"], "met");
  EXPECT_EQ(result["criteria"][0]["verdict"], "not judged");
  EXPECT_EQ(result["verdict"], "good") << result["reasons"];
  EXPECT_THAT(run.out, AllOf(HasSubstr("Verdict: good"), ::testing::Not(HasSubstr("not judged")),
                             ::testing::Not(HasSubstr("nan"))))
      << "what logs cannot show is not listed";
  EXPECT_THAT(run.out, AllOf(HasSubstr("torque prediction"), HasSubstr("as logged, unfiltered"),
                             HasSubstr("zero-phase low-pass")));
  EXPECT_THAT(host::read_file(folder.path("page.html"), "page"),
              AllOf(HasSubstr("</html>"), HasSubstr("<svg"), HasSubstr("<p class=\"verdict good\">"),
                    HasSubstr("\"name\":\"residuals-unseen.csv\""), ::testing::Not(HasSubstr("not judged"))));
}

TEST(Validate, GivesTheSameWithTheUrdfNamed) {
  const test::TemporaryFolder folder;
  model::ModelFile model = model::make_model(ur10e());
  data::write_log(folder.path("unseen.csv"), log_of(ur10e(), 2.0));
  model::write_model(folder.path("arm.json"), model);
  model.kinematics.reset();
  model::write_model(folder.path("old.json"), model);
  const std::string log = folder.path("unseen.csv");
  ASSERT_EQ(
      run_heft({"validate", "--model", folder.path("arm.json"), "--log", log, "--json", folder.path("a")})
          .exit_code,
      0);
  ASSERT_EQ(run_heft({"validate", "--urdf", "ur10e", "--model", folder.path("old.json"), "--log", log,
                      "--json", folder.path("b")})
                .exit_code,
            0);
  const nlohmann::json a = json_of(folder.path("a")), b = json_of(folder.path("b"));
  EXPECT_EQ(a["rmse"], b["rmse"]);
  EXPECT_EQ(a["rmse_in_band"], b["rmse_in_band"]);
  for (const auto& bias : a["bias"]) EXPECT_NEAR(bias.get<double>(), 2.0, 0.2);
  // Without either there is no robot.
  const Outcome none = run_heft({"validate", "--model", folder.path("old.json"), "--log", log});
  EXPECT_EQ(none.exit_code, 3);
  EXPECT_THAT(none.err, AllOf(HasSubstr("old.json"), HasSubstr("--urdf")));
}

TEST(Validate, OtherCommandsTakeTheModelAsTheRobotToo) {
  const test::TemporaryFolder folder;
  model::write_model(folder.path("arm.json"), model::make_model(ur10e()));
  data::write_log(folder.path("log.csv"), log_of(ur10e()));
  const std::string arm = folder.path("arm.json"), log = folder.path("log.csv");
  ASSERT_EQ(run_heft({"dynamics", "--model", arm, "--log", log, "-o", folder.path("a.csv")}, "/").exit_code,
            0);
  ASSERT_EQ(
      run_heft({"dynamics", "--urdf", "ur10e", "--model", arm, "--log", log, "-o", folder.path("b.csv")})
          .exit_code,
      0);
  EXPECT_EQ(host::read_file(folder.path("a.csv"), "result"), host::read_file(folder.path("b.csv"), "result"));
  const Outcome header = run_heft({"export", "--model", arm, "-o", folder.path("arm.hpp")}, "/");
  ASSERT_EQ(header.exit_code, 0) << header.err;
  EXPECT_THAT(host::read_file(folder.path("arm.hpp"), "header"), HasSubstr("kModel"));
  // A ceiling turns gravity round without a URDF just as with one.
  const std::vector<std::string> ceiling{"--what", "gravity", "--mount", "3.141592653589793,0,0"};
  std::vector<std::string> with{"dynamics", "--urdf", "ur10e", "--model",           arm,
                                "--log",    log,      "-o",    folder.path("c.csv")},
      without{"dynamics", "--model", arm, "--log", log, "-o", folder.path("d.csv")};
  with.insert(with.end(), ceiling.begin(), ceiling.end());
  without.insert(without.end(), ceiling.begin(), ceiling.end());
  ASSERT_EQ(run_heft(with).exit_code, 0);
  ASSERT_EQ(run_heft(without).exit_code, 0);
  const std::vector<double> c = numbers_below_header(folder.path("c.csv")),
                            d = numbers_below_header(folder.path("d.csv"));
  ASSERT_EQ(c.size(), d.size());
  ASSERT_GT(c.size(), 10000U);
  double largest = 0.0, difference = 0.0;
  for (std::size_t k = 0; k < c.size(); ++k) {
    largest = std::max(largest, std::abs(c[k]));
    difference = std::max(difference, std::abs(c[k] - d[k]));
  }
  EXPECT_GT(largest, 50.0);
  EXPECT_LT(difference, 1e-9);  // a quarter turn is rounded in one of them
  const Outcome tip = run_heft({"export", "--model", arm, "--tip", "flange", "-o", folder.path("x.hpp")});
  EXPECT_EQ(tip.exit_code, 2);
  EXPECT_THAT(tip.err, HasSubstr("--urdf"));
}

TEST(Validate, DynamicsGoesByTheDisplacementThatAnEffectNames) {
  // A position that shows nothing of how joint 2 settles, and a velocity that does.
  const test::TemporaryFolder folder;
  constexpr double kX0 = 1e-3;
  data::Log log = log_of(ur10e());
  log.q.col(1).setZero();
  log.qd.setZero(log.num_samples(), 6);
  log.qd.col(1).segment(700, 10).setConstant(0.01);
  log.qd.col(1).segment(710, 3).setConstant(-0.01);
  data::write_log(folder.path("log.csv"), log);
  const auto predicted_by = [&](Displacement displacement) {
    model::Robot robot = ur10e();
    robot.effects = {{joint_effect_kind<Hysteresis>(), 1, {kX0, 0.0}, displacement}};
    model::write_model(folder.path("arm.json"), model::make_model(robot));
    EXPECT_EQ(run_heft({"dynamics", "--model", folder.path("arm.json"), "--log", folder.path("log.csv"), "-o",
                        folder.path("tau.csv")})
                  .exit_code,
              0);
    return numbers_below_header(folder.path("tau.csv"));
  };
  const std::vector<double> velocity = predicted_by(Displacement::kVelocity),
                            position = predicted_by(Displacement::kPosition);
  ASSERT_EQ(velocity.size(), 7U * static_cast<std::size_t>(log.num_samples()));
  double z = 0.0;
  for (Eigen::Index k = 1; k < log.num_samples(); ++k) {
    const double step = 0.5 * (log.qd(k, 1) + log.qd(k - 1, 1)) * (log.time[k] - log.time[k - 1]);
    z = Hysteresis::memory({kX0, 0.0}, z, step);
    const auto at = static_cast<std::size_t>(7 * k + 2);
    ASSERT_NEAR(velocity[at] - position[at], ur10e().joints[1].actuation.coulomb_friction * z, 1e-6) << k;
  }
  EXPECT_GT(z, 0.1);
}

TEST(Validate, JudgesAtTheSensorTheModelWasFittedTo) {
  const test::TemporaryFolder folder;
  model::Robot robot = ur10e();
  for (model::RobotJoint& joint : robot.joints) joint.actuation.rotor_inertia = 0.0;
  model::ModelFile model = model::make_model(robot);
  model.fit.emplace();
  model.fit->method = "wls";
  model.fit->torque_at = "joint";
  model.fit->base_parameters = {{"Izz1*", "kg·m²", "Izz1 + Iyy2", 1.5, 0.1, 0.2, true}};
  model.fit->condition_number = 12.0;
  model.fit->physically_consistent = true;
  model.provenance.logs = {folder.path("gone.csv")};
  model::write_model(folder.path("arm.json"), model);
  data::write_log(folder.path("unseen.csv"), log_of(robot));
  const Outcome run = run_heft({"validate", "--model", folder.path("arm.json"), "--log",
                                folder.path("unseen.csv"), "--json", folder.path("out.json")});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err, AllOf(HasSubstr("gone.csv"), HasSubstr("cannot be read here")));
  const nlohmann::json result = json_of(folder.path("out.json"));
  EXPECT_EQ(result["torque_at"], "joint");
  EXPECT_EQ(result["base_parameters"][0]["expression"], "Izz1 + Iyy2");
  EXPECT_EQ(result["base_parameters"][0]["std"], 0.1);
  EXPECT_EQ(result["condition_number"], 12.0);
  // The sensor saw the friction that the model has.
  for (const auto& percent : result["rmse_percent_of_max"]) EXPECT_LT(percent.get<double>(), 3.0);
}

TEST(Validate, RefusesLogsThatTheModelWasFittedTo) {
  const test::TemporaryFolder folder;
  const model::Robot robot = ur10e();
  model::ModelFile model = model::make_model(robot);
  model.provenance.logs = {folder.path("seen.csv")};
  model::write_model(folder.path("arm.json"), model);
  data::Log log = log_of(robot);
  data::write_log(folder.path("seen.csv"), log);
  log.time.array() += 1000.0;
  data::write_log(folder.path("copy.csv"), data::part_of(log, 1002.0, 1006.0));
  for (const char* name : {"seen.csv", "copy.csv"}) {
    const Outcome run =
        run_heft({"validate", "--model", folder.path("arm.json"), "--log", folder.path(name)});
    EXPECT_EQ(run.exit_code, 3) << name;
    EXPECT_THAT(run.err, AllOf(HasSubstr(name), HasSubstr("expected a log that the fit has not seen")))
        << name;
  }
}

// Every command that reads a log sees a slip of units.
TEST(EveryCommandThatReadsALog, RefusesDegrees) {
  const test::TemporaryFolder folder;
  data::Log log = log_of(ur10e());
  for (Eigen::MatrixXd* channel : {&log.q, &log.qd, &log.qdd}) *channel *= 57.29577951308232;
  data::write_log(folder.path("degrees.csv"), log);
  for (const char* what : {"torque", "gravity"}) {
    const Outcome run = run_heft({"dynamics", "--urdf", "ur10e", "--log", folder.path("degrees.csv"),
                                  "--what", what, "-o", folder.path("out.csv")});
    EXPECT_EQ(run.exit_code, 3) << what;
    EXPECT_THAT(run.err, AllOf(HasSubstr("degrees"), HasSubstr("expected rad"))) << what;
  }
}

TEST(Validate, SaysWhatIsMissing) {
  EXPECT_THAT(run_heft({"validate"}).err, HasSubstr("--campaign"));
  EXPECT_EQ(run_heft({"validate"}).exit_code, 2);
  const Outcome log = run_heft({"validate", "--urdf", "ur10e"});
  EXPECT_EQ(log.exit_code, 2);
  EXPECT_THAT(log.err, HasSubstr("--log"));
  const Outcome seed = run_heft({"validate", "--urdf", "ur10e", "--log", "x.csv", "--seed", "3"});
  EXPECT_EQ(seed.exit_code, 2);
  EXPECT_THAT(seed.err, HasSubstr("--campaign"));
  const Outcome own = run_heft({"validate", "--campaign", "--log", "x.csv"});
  EXPECT_EQ(own.exit_code, 2);
  EXPECT_THAT(own.err, HasSubstr("makes its own logs"));
}

TEST(Validate, RefusesALogWithoutTorque) {
  const test::TemporaryFolder folder;
  data::Log log = log_of(ur10e());
  log.tau.resize(0, 0);
  data::write_log(folder.path("log.csv"), log);
  const Outcome run = run_heft({"validate", "--urdf", "ur10e", "--log", folder.path("log.csv")});
  EXPECT_EQ(run.exit_code, 3);
  EXPECT_THAT(run.err, AllOf(HasSubstr("log.csv"), HasSubstr("tau1")));
}

}  // namespace
}  // namespace heft
