/// heft diagnose as a user runs it: results, files, messages, exit codes.
#include <cmath>
#include <filesystem>
#include <random>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heft/data/log.hpp"
#include "heft/model/model_file.hpp"
#include "heft/model/motion_torque.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/fourier_log.hpp"
#include "support/run_heft.hpp"

namespace heft {
namespace {

using test::Outcome;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

constexpr double kNoise = 0.15;  ///< on the torque, standard deviation [N·m, N]

/// Heft's SCARA with friction, whose second joint has Stribeck friction that nobody declared.
class DiagnoseCommand : public ::testing::Test {
 protected:
  void SetUp() override {
    truth_ = urdf::load_urdf(HEFT_URDF_DIR "/scara.urdf");
    for (model::RobotJoint& joint : truth_.joints) joint.actuation = {0.0, 2.0, 1.5, 0.0};
  }
  void add_stribeck() {
    JointEffect<double> effect;
    effect.kind = joint_effect_kind("stribeck");
    effect.joint = 1;
    effect.parameters = {3.0, 0.06};
    truth_.effects = {effect};
  }
  /// A motion with its measured torque, noise included.
  data::Log log(std::uint64_t seed, double duration = 24.0) const {
    data::Log made = test::fourier_log(
        truth_,
        {.duration = duration, .rate = 200.0, .seed = seed, .amplitude = 0.3, .base_frequency = 0.12});
    // The sliding joint moves by centimetres, within its limits.
    for (Eigen::MatrixXd* channel : {&made.q, &made.qd, &made.qdd}) channel->col(2) *= 0.25;
    made.q.col(2).array() += 0.1;
    model::MotionTorque torque(truth_);
    made.tau = torque.torque(made.time, made.q, made.qd, made.qdd, 5e-4);
    std::mt19937_64 random(seed + 100);
    std::normal_distribution<double> normal(0.0, kNoise);
    for (double& tau : made.tau.reshaped()) tau += normal(random);
    made.qd.resize(0, 0), made.qdd.resize(0, 0);
    return made;
  }
  void write(const char* name, const data::Log& written) const { data::write_log(path(name), written); }
  std::string path(const std::string& name) const { return folder_.path(name); }
  Outcome diagnose(std::vector<std::string> more) const {
    more.insert(more.begin(), {"diagnose", "--urdf", "scara"});
    return test::run_heft(more);
  }
  /// Runs on a.csv and b.csv, asking for every file; what it writes must not be there afterwards.
  std::string refusal(int exit_code) const {
    const Outcome bad = diagnose({"--log", path("a.csv"), "--validate", path("b.csv"), "-o", path("m.json"),
                                  "--json", path("r.json"), "--report", path("r.html")});
    EXPECT_EQ(bad.exit_code, exit_code) << bad.err;
    EXPECT_THAT(bad.out, IsEmpty());
    for (const char* file : {"m.json", "r.json", "r.html"})
      EXPECT_FALSE(std::filesystem::exists(path(file))) << file;
    return bad.err;
  }

  test::TemporaryFolder folder_;
  model::Robot truth_;
};

TEST_F(DiagnoseCommand, NamesTheEffectProvesItAndWritesTheExtendedModel) {
  add_stribeck();
  write("a.csv", log(1, 30.0));
  write("b.csv", log(2));
  const Outcome done = diagnose({"--log", path("a.csv"), "--validate", path("b.csv"), "-o", path("m.json"),
                                 "--json", path("r.json"), "--report", path("r.html")});
  ASSERT_EQ(done.exit_code, 0) << done.err;
  EXPECT_THAT(done.out, AllOf(StartsWith("Joint 2 lacks Stribeck friction: adding it cuts its error"),
                              HasSubstr("--validate " + path("b.csv"))));
  const auto json = nlohmann::json::parse(host::read_file(path("r.json"), "result"));
  ASSERT_EQ(json.at("effects").size(), 1U) << json.at("effects");
  const auto& effect = json.at("effects").at(0);
  EXPECT_EQ(effect.at("kind"), "stribeck");
  EXPECT_EQ(effect.at("joint"), 2);
  EXPECT_NEAR(effect.at("parameters").at("Fs").get<double>(), 3.0, 0.6);
  EXPECT_NEAR(effect.at("parameters").at("vs").get<double>(), 0.06, 0.02);
  EXPECT_LT(effect.at("p_value").get<double>(), 1e-3);
  EXPECT_LT(effect.at("delta_bic").get<double>(), -20.0);
  EXPECT_LT(effect.at("validate_rmse_after").get<double>(), effect.at("validate_rmse_before").get<double>());
  EXPECT_TRUE(json.at("unexplained").empty()) << json.at("unexplained");
  for (const char* which : {"train", "validate"}) {
    for (const char* field : {"rmse_before", "rmse_after", "rmse_in_band_before", "rmse_in_band_after",
                              "r2_before", "r2_after"}) {
      EXPECT_EQ(json.at(which).at(field).size(), 4U) << which << ' ' << field;
    }
  }
  EXPECT_GT(json.at("band_hz").get<double>(), 0.0);
  EXPECT_THAT(
      host::read_file(path("r.html"), "report"),
      AllOf(HasSubstr("Joint 2 lacks Stribeck friction"), HasSubstr("<svg"), HasSubstr("Against velocity")));

  // The extended model alone, behind the same low-pass, leaves nothing but noise on the validation log.
  // Reversals, where the width of the friction's sign counts, are left out.
  const Outcome predicted = test::run_heft({"dynamics", "--model", path("m.json"), "--log", path("b.csv"),
                                            "--band", json.at("cutoff_hz").dump(), "-o", path("t.csv")});
  ASSERT_EQ(predicted.exit_code, 0) << predicted.err;
  const data::Log measured = log(2);
  std::istringstream table(host::read_file(path("t.csv"), "torque"));
  std::string line, field;
  std::getline(table, line);
  double squares = 0.0;
  Eigen::Index count = 0;
  for (Eigen::Index row = 0; std::getline(table, line); ++row) {
    if (measured.time[row] < 0.5 || measured.time[row] > 23.4) continue;
    if (std::abs(measured.q(row + 1, 1) - measured.q(row - 1, 1)) < 1e-4) continue;
    std::istringstream fields(line);
    for (int column = 0; column < 3; ++column) std::getline(fields, field, ',');
    squares += std::pow(std::stod(field) - measured.tau(row, 1), 2);
    ++count;
  }
  EXPECT_NEAR(std::sqrt(squares / static_cast<double>(count)), kNoise, 0.05 * kNoise);
  EXPECT_EQ(model::read_model(path("m.json")).provenance.method, "diagnose");

  // The model judged by itself: the same figures, since it knows how its logs were read.
  const Outcome judged = test::run_heft(
      {"validate", "--model", path("m.json"), "--log", path("b.csv"), "--json", path("v.json")});
  ASSERT_EQ(judged.exit_code, 0) << judged.err;
  const auto again = nlohmann::json::parse(host::read_file(path("v.json"), "result"));
  const auto& validate = json.at("validate");
  for (std::size_t j = 0; j < 4; ++j) {
    const double rmse = validate.at("rmse_after").at(j), band = validate.at("rmse_in_band_after").at(j);
    EXPECT_NEAR(again.at("rmse").at(j).get<double>(), rmse, 1e-6 * rmse);
    EXPECT_NEAR(again.at("rmse_in_band").at(j).get<double>(), band, 1e-3 * band);
  }
  EXPECT_LT(validate.at("relative_error_in_band_after").get<double>(),
            validate.at("relative_error_in_band_before").get<double>());
  EXPECT_GT(validate.at("r2_in_band_after").at(1).get<double>(), validate.at("r2_after").at(1).get<double>());
}

TEST_F(DiagnoseCommand, LooksAnewForWhatTheModelHoldsAlready) {
  add_stribeck();
  write("a.csv", log(1, 30.0));
  write("b.csv", log(2));
  const std::vector<std::string> logs{"--log", path("a.csv"), "--validate", path("b.csv")};
  const auto findings = [&](std::vector<std::string> more) {
    more.insert(more.end(), logs.begin(), logs.end());
    more.insert(more.end(), {"--json", path("r.json")});
    const Outcome done = test::run_heft(more);
    EXPECT_EQ(done.exit_code, 0) << done.err;
    auto json = nlohmann::json::parse(host::read_file(path("r.json"), "result"));
    return std::pair(done.out, json);
  };
  const auto [words, fresh] = findings({"diagnose", "--urdf", "scara", "-o", path("m.json")});
  // One note, about the logs of the last fit, and none about the model's own effects.
  const std::size_t note = words.find("Note:");
  EXPECT_THAT(words, HasSubstr("Note: the model written "));
  EXPECT_EQ(words.find("Note:", note + 1), std::string::npos) << words;
  // The same arm with what was found, and with a rotor that it has not got: that is identified again, without a word.
  model::ModelFile extended = model::read_model(path("m.json"));
  extended.actuation[2].rotor_inertia = 5.0;
  model::write_model(path("m2.json"), extended);
  const auto [again, json] = findings({"diagnose", "--model", path("m2.json"), "-o", path("m3.json")});
  EXPECT_THAT(again, HasSubstr("Note: the model's own stribeck in joint 2: not kept but searched for again"));
  constexpr double kNearNothing = 0.1;  // of the 5 kg that the file claims
  EXPECT_NEAR(model::read_model(path("m3.json")).actuation[2].rotor_inertia, 0.0, kNearNothing);
  ASSERT_EQ(json.at("effects").size(), 1U) << json.at("effects");
  EXPECT_EQ(json.at("effects")[0].at("kind"), "stribeck");
  EXPECT_EQ(json.at("effects")[0].at("joint"), 2);
  for (std::size_t j = 0; j < 4; ++j) {
    for (const char* field : {"rmse_before", "rmse_after"}) {
      const double value = fresh.at("validate").at(field)[j];
      EXPECT_NEAR(json.at("validate").at(field)[j].get<double>(), value, 1e-3 * value) << field << j + 1;
    }
  }
}

TEST_F(DiagnoseCommand, FindsAMotorThatTurnsWithThePairOfJointsAskedFor) {
  // A SCARA has no wrist of joints 5 and 6, so that no pair is looked for unasked.
  truth_.couplings = {{.driving = 0, .driven = 1, .coulomb_friction = 4.0, .viscous_friction = 2.0}};
  write("a.csv", log(1));
  write("b.csv", log(2));
  const Outcome done = diagnose(
      {"--log", path("a.csv"), "--validate", path("b.csv"), "--coupling", "1,2", "--json", path("r.json")});
  ASSERT_EQ(done.exit_code, 0) << done.err;
  EXPECT_THAT(done.out, HasSubstr("--coupling 1,2")) << "the line that gives the same result";
  const auto json = nlohmann::json::parse(host::read_file(path("r.json"), "result"));
  ASSERT_EQ(json.at("effects").size(), 1U) << json.at("effects");
  const auto& effect = json.at("effects").at(0);
  EXPECT_EQ(effect.at("kind"), "wrist_coupling");
  EXPECT_EQ(effect.at("joint"), 1);
  EXPECT_EQ(effect.at("driven_joint"), 2);
  // The noise of 0.15 N·m lets both vary by a few hundredths from log to log.
  EXPECT_NEAR(effect.at("parameters").at("Fc").get<double>(), 4.0, 0.2);
  EXPECT_NEAR(effect.at("parameters").at("Fv").get<double>(), 2.0, 0.2);
}

TEST_F(DiagnoseCommand, RefusesACouplingThatIsNotOneOfTwoJointsOfTheArm) {
  write("a.csv", log(1, 5.0));
  write("b.csv", log(2, 5.0));
  const auto refused = [&](const std::string& coupling, int exit_code) {
    const Outcome bad =
        diagnose({"--log", path("a.csv"), "--validate", path("b.csv"), "--coupling", coupling});
    EXPECT_EQ(bad.exit_code, exit_code) << bad.err;
    EXPECT_THAT(bad.out, IsEmpty());
    return bad.err;
  };
  EXPECT_THAT(refused("1,5", 3), HasSubstr("joints 1 and 5: expected two different joints of 1 to 4"));
  EXPECT_THAT(refused("2,2", 3), HasSubstr("joints 2 and 2: expected two different joints of 1 to 4"));
  EXPECT_THAT(refused("2", 2), HasSubstr("--coupling 2: expected two joints"));
}

TEST_F(DiagnoseCommand, SaysThatNothingIsMissing) {
  write("a.csv", log(1));
  write("b.csv", log(2));
  const Outcome done = diagnose({"--log", path("a.csv"), "--validate", path("b.csv"), "--json", "-"});
  ASSERT_EQ(done.exit_code, 0) << done.err;
  EXPECT_THAT(done.err, HasSubstr("Nothing is missing")) << "standard output carries the JSON";
  EXPECT_TRUE(nlohmann::json::parse(done.out).at("effects").empty());
}

TEST_F(DiagnoseCommand, WantsALogToJudgeOn) {
  write("a.csv", log(1, 5.0));
  const Outcome wrong = diagnose({"--log", path("a.csv")});
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, AllOf(HasSubstr("--validate LOG.csv"), HasSubstr("cut it in two")));
}

TEST_F(DiagnoseCommand, RefusesAValidationLogThatItTrainsOn) {
  write("a.csv", log(1, 5.0));
  const Outcome same = diagnose({"--log", path("a.csv"), "--validate", path("a.csv")});
  EXPECT_EQ(same.exit_code, 3);
  EXPECT_THAT(same.err, AllOf(HasSubstr("given to --log and to --validate"), HasSubstr("not seen")));
  // A copy, its clock put forward.
  data::Log copy = log(1, 5.0);
  copy.time.array() += 100.0;
  write("b.csv", copy);
  EXPECT_THAT(refusal(3), AllOf(HasSubstr("b.csv: the same samples as "), HasSubstr("a.csv")));
}

TEST_F(DiagnoseCommand, RefusesAPartOfATrainingLog) {
  const data::Log whole = log(1, 8.0);
  data::Log part;
  part.time = whole.time.segment(700, 600);
  part.q = whole.q.middleRows(700, 600);
  part.tau = whole.tau.middleRows(700, 600);
  write("a.csv", whole);
  write("b.csv", part);
  EXPECT_THAT(refusal(3), AllOf(HasSubstr("b.csv: a part of "), HasSubstr("a.csv")));
  write("a.csv", part);
  write("b.csv", whole);
  EXPECT_THAT(refusal(3), AllOf(HasSubstr("b.csv: holds all of "), HasSubstr("a.csv")));
}

TEST_F(DiagnoseCommand, EndsWithCodeFourWhenNothingMoves) {
  data::Log still = log(1, 5.0);
  still.q.rowwise() = Eigen::RowVectorXd(still.q.row(0));
  write("a.csv", still);
  write("b.csv", log(2, 5.0));
  EXPECT_THAT(refusal(4), AllOf(HasSubstr("a.csv: no joint moves"), HasSubstr("back and forth"),
                                HasSubstr("heft excite")));
}

TEST_F(DiagnoseCommand, EndsWithCodeFourWhenOneJointMovesAlone) {
  data::Log one = log(1, 12.0);
  for (const int still : {0, 2, 3}) one.q.col(still).setConstant(0.1);
  write("a.csv", one);
  write("b.csv", log(2, 5.0));
  EXPECT_THAT(refusal(4),
              AllOf(HasSubstr("a.csv: joints 1, 3 and 4 of 4 hardly move"), HasSubstr("heft excite")));
}

TEST_F(DiagnoseCommand, EndsWithCodeFourAfterAMoment) {
  write("a.csv", log(1, 0.6));
  write("b.csv", log(2, 5.0));
  EXPECT_THAT(refusal(4), AllOf(HasSubstr("s determine "), HasSubstr("at least 20 s"), HasSubstr("Missing")));
}

TEST_F(DiagnoseCommand, DoesNotJudgeOnAMoment) {
  write("a.csv", log(1, 12.0));
  write("b.csv", log(2, 1.5));
  EXPECT_THAT(refusal(4), AllOf(HasSubstr("b.csv: 1.5 s "), HasSubstr("too little to judge")));
}

TEST_F(DiagnoseCommand, NamesTheMissingColumn) {
  write("a.csv", log(1, 5.0));
  write("b.csv", log(2, 5.0));
  std::string text = host::read_file(path("b.csv"), "log");
  text.replace(text.find("tau3"), 4, "moo3");
  folder_.write("b.csv", text);
  EXPECT_THAT(refusal(3), AllOf(HasSubstr("b.csv:1"), HasSubstr("tau3")));
}

}  // namespace
}  // namespace heft
