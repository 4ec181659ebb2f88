/// heft identify as a user runs it: results, files, messages, exit codes.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heft/data/log.hpp"
#include "heft/model/model_file.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/fourier_log.hpp"
#include "support/run_heft.hpp"

namespace heft {
namespace {

using test::Outcome;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class IdentifyCommand : public ::testing::Test {
 protected:
  void SetUp() override {
    truth_ = urdf::load_urdf(HEFT_URDF_DIR "/scara.urdf");
    for (model::RobotJoint& joint : truth_.joints) joint.actuation = {0.05, 0.8, 0.6, 0.1};
    // The prismatic joint moves by centimetres.
    log_ = test::fourier_log(truth_, {.duration = 20.0, .amplitude = 0.05, .base_frequency = 0.3});
    write("a.csv", log_);
  }
  void write(const char* name, const data::Log& log) const { data::write_log(path(name), log); }
  std::string path(const std::string& name) const { return folder_.path(name.c_str()); }
  Outcome identify(std::vector<std::string> more) const {
    more.insert(more.begin(), {"identify", "--urdf", "scara"});
    return test::run_heft(more);
  }
  /// The log's text with one thing changed.
  std::string text() const { return host::read_file(path("a.csv"), "log"); }

  test::TemporaryFolder folder_;
  model::Robot truth_;
  data::Log log_;
};

TEST_F(IdentifyCommand, GivesAModelThatDynamicsReproducesTheTorqueWith) {
  const Outcome fitted = identify({"--log", path("a.csv"), "--split", "0", "--ridge", "0", "-o",
                                   path("m.json"), "--json", path("r.json"), "--report", path("r.html"),
                                   "--write-urdf", path("out.urdf"), "--allow-impossible"});
  ASSERT_EQ(fitted.exit_code, 0) << fitted.err;
  const auto json = nlohmann::json::parse(host::read_file(path("r.json"), "result"));
  for (const char* field : {"rmse", "rmse_percent_of_max", "r2"})
    EXPECT_EQ(json.at(field).size(), 4U) << field;
  EXPECT_GT(json.at("base_parameters").size(), 10U);
  EXPECT_TRUE(json.at("condition_number").is_number());
  EXPECT_TRUE(json.at("physically_consistent").is_boolean());
  EXPECT_THAT(host::read_file(path("r.html"), "report"),
              AllOf(HasSubstr("<svg"), HasSubstr("Base parameters"), HasSubstr("\"name\":\"residuals-")));

  // The model alone, without the URDF, gives the torques.
  const Outcome predicted =
      test::run_heft({"dynamics", "--model", path("m.json"), "--log", path("a.csv"), "-o", path("t.csv")});
  ASSERT_EQ(predicted.exit_code, 0) << predicted.err;
  std::istringstream table(host::read_file(path("t.csv"), "torque"));
  std::string line;
  std::getline(table, line);
  ASSERT_EQ(line, "time,tau1,tau2,tau3,tau4");
  double worst = 0.0;
  Eigen::Index row = 0;
  for (; std::getline(table, line); ++row) {
    std::istringstream fields(line);
    std::string field;
    std::getline(fields, field, ',');
    for (Eigen::Index j = 0; std::getline(fields, field, ','); ++j) {
      worst = std::max(worst, std::abs(std::stod(field) - log_.tau(row, j)));
    }
  }
  EXPECT_EQ(row, log_.tau.rows());
  EXPECT_LT(worst, 1e-9 * log_.tau.cwiseAbs().maxCoeff());
}

TEST_F(IdentifyCommand, CutsASingleLogInTwoAndSaysSo) {
  const Outcome fitted = identify({"--log", path("a.csv")});
  ASSERT_EQ(fitted.exit_code, 0) << fitted.err;
  EXPECT_THAT(fitted.out,
              AllOf(HasSubstr("given. Fitted to the first 70 % of the motion, judged on the rest."),
                    HasSubstr("Held out: ")));
}

TEST_F(IdentifyCommand, BeginsWithAVerdictThatPageAndJsonShare) {
  const Outcome unjudged = identify(
      {"--log", path("a.csv"), "--split", "0", "--json", path("r.json"), "--report", path("r.html")});
  ASSERT_EQ(unjudged.exit_code, 0) << unjudged.err;
  EXPECT_THAT(unjudged.out,
              AllOf(::testing::StartsWith("On its own training logs"), HasSubstr("Verdict: doubtful\n  - "),
                    HasSubstr("give one with --validate")));
  const auto json = nlohmann::json::parse(host::read_file(path("r.json"), "result"));
  EXPECT_EQ(json.at("verdict"), "doubtful");
  EXPECT_FALSE(json.at("reasons").empty());
  EXPECT_THAT(host::read_file(path("r.html"), "report"),
              AllOf(HasSubstr("<div class=\"verdict doubtful\">"),
                    HasSubstr("<p class=\"subtitle\">wls on a.csv</p>"), HasSubstr("heft identify --urdf"),
                    HasSubstr("samples a second, ")));
}

TEST_F(IdentifyCommand, TakesTheLogsReferenceForInstruments) {
  // The measured position has noise, the commanded one has none.
  data::Log noisy = log_;
  noisy.qref = log_.q;
  noisy.qd.resize(0, 0), noisy.qdd.resize(0, 0);
  std::mt19937 random(5);
  std::normal_distribution<double> normal(0.0, 1e-5);
  for (double& q : noisy.q.reshaped()) q += normal(random);
  write("noisy.csv", noisy);
  const auto values = [&](const char* instruments) {
    const Outcome done = identify({"--log", path("noisy.csv"), "--method", "iv", "--instruments", instruments,
                                   "--json", path("r.json")});
    EXPECT_EQ(done.exit_code, 0) << done.err;
    const auto json = nlohmann::json::parse(host::read_file(path("r.json"), "result"));
    std::vector<double> result;
    for (const auto& parameter : json.at("base_parameters"))
      result.push_back(parameter.at("value").get<double>());
    return result;
  };
  const std::vector<double> reference = values("reference");
  EXPECT_GT(reference.size(), 10U);
  EXPECT_NE(reference, values("simulated"));
}

TEST_F(IdentifyCommand, NamesTheReferenceThatALogLacks) {
  const Outcome refused = identify({"--log", path("a.csv"), "--method", "iv", "--instruments", "reference"});
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("a.csv"), HasSubstr("no commanded positions qref1 to qref4"),
                                 HasSubstr("use simulated instruments")));
}

TEST_F(IdentifyCommand, GivesTheErrorOverTheMotionAlone) {
  // 10 s at rest before the motion, where the torque is another one.
  constexpr Eigen::Index kRest = 1000;
  const Eigen::Index rows = log_.time.size();
  const double step = log_.time[1] - log_.time[0];
  data::Log rested;
  rested.time = Eigen::VectorXd::LinSpaced(kRest + rows, 0.0, step * static_cast<double>(kRest + rows - 1));
  rested.q.resize(kRest + rows, 4), rested.tau.resize(kRest + rows, 4);
  rested.q << log_.q.row(0).replicate(kRest, 1), log_.q;
  rested.tau << (log_.tau.row(0).array() + 3.0).matrix().replicate(kRest, 1), log_.tau;
  rested.tau.array() += 1e-3;  // measured again: the samples fitted to are not judged on
  write("rested.csv", rested);
  const Outcome done =
      identify({"--log", path("a.csv"), "--validate", path("rested.csv"), "--json", path("r.json")});
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const auto json = nlohmann::json::parse(host::read_file(path("r.json"), "result"));
  for (std::size_t j = 0; j < 4; ++j) {
    EXPECT_LT(json.at("rmse_moving").at(j).get<double>(), 0.5 * json.at("rmse").at(j).get<double>()) << j;
    EXPECT_LT(json.at("rmse_in_band_moving").at(j).get<double>(), json.at("rmse_in_band").at(j).get<double>())
        << j;
  }
  const std::size_t held_out = done.out.find("Held out");
  ASSERT_NE(held_out, std::string::npos);
  EXPECT_THAT(done.out.substr(held_out),
              HasSubstr("Over the motion alone, standstill at the ends cut: RMSE "));
  EXPECT_THAT(done.out.substr(0, held_out), Not(HasSubstr("Over the motion alone")));
}

TEST_F(IdentifyCommand, DoesNotJudgeAModelOnItsTrainingLog) {
  const Outcome refused = identify({"--log", path("a.csv"), "--validate", path("a.csv")});
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_THAT(refused.err, HasSubstr("a model is not judged on the log it was fitted to"));
}

TEST_F(IdentifyCommand, NamesTheMissingColumn) {
  std::string changed = text();
  changed.replace(changed.find("tau3"), 4, "moo3");
  folder_.write("b.csv", changed.c_str());
  const Outcome refused = identify({"--log", path("b.csv"), "-o", path("m.json")});
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("b.csv:1"), HasSubstr("tau3")));
  EXPECT_FALSE(std::filesystem::exists(path("m.json")));
}

TEST_F(IdentifyCommand, RecognisesDegrees) {
  data::Log log = log_;
  log.q.leftCols(2) *= 57.29577951308232;
  log.qd.leftCols(2) *= 57.29577951308232;
  log.q.rightCols(1) *= 57.29577951308232;
  log.qd.rightCols(1) *= 57.29577951308232;
  log.q.leftCols(2) *= 8.0;  // larger than any limit
  log.qd.leftCols(2) *= 8.0;
  log.qdd.resize(log.q.rows(), 0);
  write("b.csv", log);
  const Outcome refused = identify({"--log", path("b.csv")});
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("degrees"), HasSubstr("q1"), HasSubstr("rad")));
}

TEST_F(IdentifyCommand, RefusesARepeatedTimeStamp) {
  std::string changed = text();
  const std::size_t second = changed.find('\n', changed.find('\n') + 1) + 1,
                    third = changed.find('\n', second) + 1;
  changed.insert(third, changed.substr(second, third - second));
  folder_.write("b.csv", changed.c_str());
  const Outcome refused = identify({"--log", path("b.csv")});
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("b.csv:4"), HasSubstr("time")));
}

TEST_F(IdentifyCommand, RefusesNotANumber) {
  std::string changed = text();
  const std::size_t line = changed.find('\n', 3000) + 1, comma = changed.find(',', line) + 1;
  changed.replace(comma, changed.find(',', comma) - comma, "nan");
  folder_.write("b.csv", changed.c_str());
  const Outcome refused = identify({"--log", path("b.csv")});
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("'q1'"), HasSubstr("finite")));
}

TEST_F(IdentifyCommand, NamesAJointThatNeverMoved) {
  data::Log log = log_;
  log.q.col(1).setConstant(0.4);
  log.qd.col(1).setZero();
  log.qdd.col(1).setZero();
  test::put_torque(log, truth_);
  write("b.csv", log);
  const Outcome fitted = identify({"--log", path("b.csv"), "--split", "0"});
  EXPECT_EQ(fitted.exit_code, 0) << fitted.err;
  EXPECT_THAT(fitted.out, HasSubstr("joint 2 never moved: move it"));
}

TEST_F(IdentifyCommand, EndsWithCodeFourWhenNothingMoves) {
  data::Log log = log_;
  log.q.rowwise() = log_.q.row(0);
  log.qd.setZero();
  log.qdd.setZero();
  test::put_torque(log, truth_);
  write("b.csv", log);
  const Outcome refused = identify({"--log", path("b.csv"), "-o", path("m.json")});
  EXPECT_EQ(refused.exit_code, 4);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("no joint moves"), HasSubstr("heft excite")));
  EXPECT_FALSE(std::filesystem::exists(path("m.json")));
}

TEST_F(IdentifyCommand, RefusesALogShorterThanItsUnknowns) {
  data::Log log = log_;
  const auto keep = Eigen::Index{12};
  log.time.conservativeResize(keep);
  for (Eigen::MatrixXd* channel : {&log.q, &log.qd, &log.qdd, &log.tau})
    channel->conservativeResize(keep, Eigen::NoChange);
  write("b.csv", log);
  const Outcome refused = identify({"--log", path("b.csv")});
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_THAT(refused.err,
              AllOf(HasSubstr("12 samples"), HasSubstr("unknowns"), HasSubstr("record a longer log")));
}

TEST_F(IdentifyCommand, WarnsOfAnImpossibleInertia) {
  std::string urdf = host::read_file(HEFT_URDF_DIR "/scara.urdf", "URDF");
  const std::size_t izz = urdf.find("izz=\"") + 5;
  urdf.replace(izz, urdf.find('"', izz) - izz, "9.0");
  folder_.write("arm.urdf", urdf.c_str());
  // Physical fits repair the prior; the user hears of it.
  const Outcome fitted = test::run_heft(
      {"identify", "--urdf", path("arm.urdf"), "--log", path("a.csv"), "--method", "physical"});
  EXPECT_EQ(fitted.exit_code, 0) << fitted.err;
  EXPECT_THAT(fitted.err, AllOf(HasSubstr("arm.urdf:"), HasSubstr("< Izz=9"), HasSubstr("check units")));
  EXPECT_THAT(fitted.out, HasSubstr("an impossible inertia"));
}

}  // namespace
}  // namespace heft
