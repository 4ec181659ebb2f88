/// What is said about a diagnosis: sentence, tables, JSON, page. From results made by hand.
#include <cmath>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heft/report/stiffness.hpp"

#include "diagnosis_result.hpp"

namespace heft::tools {
namespace {

using diagnose::Diagnosis;
using diagnose::Finding;
using ::testing::AllOf;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

validate::Score score_of(double first, double second) {
  validate::Score score;
  score.samples = 1000;
  score.band = 8.0;
  const Eigen::Vector2d rmse{first, second};
  score.rmse = rmse;
  score.rmse_in_band = 0.5 * rmse;
  score.percent_of_max = 10.0 * rmse;
  score.in_band_percent_of_max = 5.0 * rmse;
  score.torque_variance = rmse.cwiseAbs2() / 0.01;
  score.max_torque = 10.0 * rmse;
  score.r2 = Eigen::Vector2d{0.99, std::numeric_limits<double>::quiet_NaN()};
  return score;
}

/// A turning and a sliding joint.
Diagnosis empty_diagnosis() {
  Diagnosis diagnosis;
  diagnosis.after.name = "arm";
  diagnosis.after.joints.resize(2);
  diagnosis.after.joints[1].joint.type = JointType::kPrismatic;
  diagnosis.before = diagnosis.after;
  diagnosis.train_before = score_of(0.5, 0.6);
  diagnosis.train_after = score_of(0.3, 0.6);
  diagnosis.validate_before = score_of(0.43, 0.6);
  diagnosis.validate_after = score_of(0.29, 0.6);
  diagnosis.train_given = diagnosis.train_identified = diagnosis.train_before;
  diagnosis.validate_given = diagnosis.validate_identified = diagnosis.validate_before;
  diagnosis.validate_each_before = {diagnosis.validate_before};
  diagnosis.validate_each_given = diagnosis.validate_each_identified = diagnosis.validate_each_before;
  diagnosis.validate_each_after = {diagnosis.validate_after};
  diagnosis.cutoff = 20.0;
  diagnosis.candidates = 321;
  diagnosis.seconds = 40.0;
  return diagnosis;
}

Finding stribeck() {
  Finding finding(Stribeck{});
  finding.joint = finding.main_joint = 0;
  finding.parameters = {{"Fs", 1.2}, {"vs", 0.05}};
  finding.p_value = 3e-9;
  finding.delta_bic = -812.4;
  finding.cross_validated = 0.31;
  finding.validate_before = 0.43;
  finding.validate_after = 0.29;
  finding.rivals = {{ViscousNonlinear{}, 0, -640.0}};
  return finding;
}

const report::DiagnosisContext kContext{
    {"a.csv"}, {"b.csv"}, "motor", "heft diagnose --urdf arm --log a.csv --validate b.csv"};

TEST(DiagnosisVerdict, NamesJointEffectAndWhatItIsWorth) {
  Diagnosis diagnosis = empty_diagnosis();
  diagnosis.findings = {stribeck()};
  EXPECT_EQ(report::brief(diagnosis),
            "Joint 1 lacks Stribeck friction: adding it cuts its error on the validation log from 0.430 to "
            "0.290 N·m "
            "(−33 %).");
}

TEST(DiagnosisVerdict, SaysWhatTheMotionCannotTellApart) {
  Diagnosis diagnosis = empty_diagnosis();
  diagnosis.findings = {stribeck()};
  diagnosis.findings[0].effect = Offset{};
  diagnosis.findings[0].equivalent = {{Spring{}, 0, 0.0}};
  EXPECT_THAT(report::brief(diagnosis),
              EndsWith("This motion cannot distinguish it from a spring in joint 1."));
}

TEST(DiagnosisText, SaysWhatAnEffectMovesAndWhetherAGearCanBeLikeThat) {
  Diagnosis diagnosis = empty_diagnosis();
  diagnosis.after.joints[0].effort_limit = 30.0;
  diagnosis.findings = {stribeck(), stribeck()};
  diagnosis.findings[0].torque_rms = 0.31;
  diagnosis.findings[0].torque_peak = 1.1;
  diagnosis.findings[0].torque_joint = 0;
  diagnosis.findings[1].parameters = {{"Fs", 12.0}, {"vs", 0.05}};  // more than a third of what the motor can
  const std::string text = report::full(diagnosis, kContext);
  // 1 - (0.29 / 0.43)^2
  EXPECT_THAT(text,
              HasSubstr("0.310 N·m rms, 1.10 N·m at most in joint 1; 55 % of the squared error of joint 1"));
  EXPECT_THAT(text, HasSubstr("plausible   Fs 1.2 N·m, of strain-wave joints of this size 0 to 9.9"));
  EXPECT_THAT(text, HasSubstr("implausible Fs 12 N·m"));
  const auto json = nlohmann::json::parse(report::json(diagnosis, kContext));
  const auto& effects = json.at("effects");
  EXPECT_EQ(effects[0].at("torque_rms"), 0.31);
  EXPECT_EQ(effects[0].at("torque_peak"), 1.1);
  EXPECT_EQ(effects[0].at("torque_joint"), 1);
  EXPECT_NEAR(effects[0].at("share_of_error").get<double>(), 0.5452, 1e-4);
  EXPECT_EQ(effects[0].at("plausible"), true);
  EXPECT_EQ(effects[1].at("plausible"), false);
  EXPECT_TRUE(effects[1].at("torque_rms").is_null());
}

TEST(DiagnosisVerdict, ListsSeveralEffects) {
  Diagnosis diagnosis = empty_diagnosis();
  Finding delay(Delay{});
  delay.main_joint = 1;
  diagnosis.findings = {stribeck(), delay};
  diagnosis.validate_after = score_of(0.29, 0.3);
  EXPECT_EQ(
      report::brief(diagnosis),
      "2 effects are missing: Stribeck friction in joint 1 and a delay of the torque channel. With all "
      "of them the error on the validation log falls most in joint 2 (0.600 → 0.300 N, −50 %) and joint 1 "
      "(0.430 → 0.290 N·m, −33 %).");
}

TEST(DiagnosisVerdict, SaysWhatTheModelWrittenDoesWithout) {
  Diagnosis diagnosis = empty_diagnosis();
  Finding elastic(ElasticJoint{});
  elastic.joint = 0;
  elastic.main_joint = 1;
  elastic.left_out = "predicts joint 2 worse than the identified model on b.csv";
  diagnosis.findings = {stribeck(), elastic};
  EXPECT_THAT(report::brief(diagnosis),
              AllOf(HasSubstr("With those in the model written the error"),
                    HasSubstr(" Left out of the model written: "),
                    HasSubstr(", as it predicts joint 2 worse"), Not(HasSubstr("all of them"))));
  EXPECT_THAT(report::full(diagnosis, kContext), HasSubstr("on b.csv: not in the model written"));
  const auto effects = nlohmann::json::parse(report::json(diagnosis, kContext)).at("effects");
  EXPECT_EQ(effects[0].at("in_model"), true);
  EXPECT_FALSE(effects[0].contains("left_out"));
  EXPECT_EQ(effects[1].at("in_model"), false);
  EXPECT_EQ(effects[1].at("left_out"), elastic.left_out);
  const std::vector<std::string> notes = report::model_file(diagnosis).provenance.notes;
  EXPECT_THAT(notes.at(1), Not(HasSubstr("not in this model")));
  EXPECT_THAT(notes.at(2), EndsWith("; not in this model: " + elastic.left_out));
  // A stiffness that no model has is not reported; the reason is.
  EXPECT_THAT(report::why_none(diagnosis), HasSubstr("joint 1: predicts joint 2 worse"));
}

TEST(DiagnosisVerdict, StaysShortWithManyEffectsAndMuchUnexplained) {
  Diagnosis diagnosis = empty_diagnosis();
  const auto of = [](EffectKind effect, int joint) {
    Finding finding = stribeck();
    finding.effect = effect;
    finding.joint = joint;
    return finding;
  };
  diagnosis.findings = {of(Stribeck{}, 0), of(Offset{}, 1), of(Spring{}, 0),
                        of(Offset{}, 0),   of(Ripple{}, 0), of(Hysteresis{}, 0)};
  diagnosis.unexplained = {{0, "this", {}}, {1, "that", {}}, {1, "more", {}}};
  EXPECT_EQ(
      report::brief(diagnosis),
      "4 effects are missing, the strongest Stribeck friction in joint 1, a spring in joint 1 and torque "
      "ripple over position in joint 1; beside these the given model has no value for a torque offset in joints 1 and 2, "
      "which identify finds. With all of them the error on the validation log falls most in "
      "joint 1 (0.430 → 0.290 N·m, −33 %). Beyond that an unexplained residual remains: in joints 1 "
      "and 2.");
}

TEST(DiagnosisVerdict, DoesNotCallWhatIdentifyFindsMissing) {
  Diagnosis diagnosis = empty_diagnosis();
  diagnosis.findings = {stribeck(), stribeck()};
  diagnosis.findings[0].effect = Offset{};
  diagnosis.findings[1].effect = RotorInertia{};
  EXPECT_THAT(report::brief(diagnosis),
              StartsWith("No effect is missing beyond what the given model has no value for and identify "
                         "finds: a torque offset in joint 1 and rotor inertia in joint 1. With all of them"));
  diagnosis.findings[1] = stribeck();
  const std::string text = report::full(diagnosis, kContext);
  const auto missing = text.find("\nFound missing\n\n1. Stribeck friction in joint 1\n"),
             identified = text.find("\nIdentified, without a value in the model given\n\n2. A torque offset");
  EXPECT_NE(missing, std::string::npos) << text;
  EXPECT_NE(identified, std::string::npos) << text;
  EXPECT_LT(missing, identified);
}

TEST(DiagnosisVerdict, NamesPreslidingOfTwoDistancesOnce) {
  Diagnosis diagnosis = empty_diagnosis();
  Finding memory = stribeck();
  memory.effect = Hysteresis{};
  diagnosis.findings = {memory, memory, stribeck()};
  EXPECT_THAT(
      report::brief(diagnosis),
      StartsWith("3 effects are missing: presliding (friction hysteresis) in joint 1 and Stribeck friction "
                 "in joint 1. "));
  // Where each has its own place, the text says that it is one of two.
  EXPECT_THAT(report::finding_in_place(diagnosis, diagnosis.findings[1]),
              EndsWith("in joint 1, one of two distances"));
  EXPECT_THAT(report::finding_in_place(diagnosis, diagnosis.findings[2]), EndsWith("in joint 1"));
}

TEST(DiagnosisVerdict, NamesOtherJointsThatGainMuch) {
  Diagnosis diagnosis = empty_diagnosis();
  Finding coupling(WristCoupling{});
  coupling.joint = 4;
  coupling.driven_joint = 5;
  coupling.main_joint = 1;
  coupling.validate_before = 0.6;
  coupling.validate_after = 0.5;
  diagnosis.findings = {coupling};
  EXPECT_THAT(
      report::brief(diagnosis),
      EndsWith("cuts joint 2's error on the validation log from 0.600 to 0.500 N (−17 %), and that of "
               "joint 1 (0.430 → 0.290 N·m, −33 %)."));
}

TEST(DiagnosisVerdict, TellsNothingMissingFromSomethingUnknown) {
  Diagnosis diagnosis = empty_diagnosis();
  EXPECT_THAT(report::brief(diagnosis), StartsWith("Nothing is missing: "));
  diagnosis.unexplained = {{1, "a vibration at 11 Hz", {{"frequency", 11.0}}}};
  EXPECT_EQ(report::brief(diagnosis), "An unexplained residual remains: joint 2, a vibration at 11 Hz.");
  diagnosis.findings = {stribeck()};
  EXPECT_THAT(report::brief(diagnosis),
              AllOf(StartsWith("Joint 1 lacks Stribeck friction"),
                    EndsWith("Beyond that an unexplained residual remains: joint 2, a vibration at 11 Hz.")));
}

TEST(DiagnosisWords, TellWhatIsLeftByItsShares) {
  const diagnose::Unexplained left{1,
                                   "52 % of the squared residual is not noise; it drifts slowly",
                                   {{"rms", 1.59},
                                    {"noise_rms", 1.1},
                                    {"share_above_noise", 0.52},
                                    {"share: drifts slowly", 0.25},
                                    {"share: swings at 0.20 Hz", 0.0694},
                                    {"frequency_hz", 0.195}}};
  EXPECT_EQ(report::evidence_in_words(left),
            "rms 1.59, noise 1.1; shares: drifts slowly 25 %; swings at 0.20 Hz 6.9 %");
  EXPECT_EQ(report::evidence_in_words(diagnose::Unexplained{1, "a vibration", {{"frequency_hz", 11.0}}}),
            "frequency_hz 11");
}

TEST(DiagnosisWords, TellTheErrorAgainstTheTorque) {
  Diagnosis diagnosis = empty_diagnosis();
  diagnosis.validate_torque.rmse_in_band = Eigen::Vector2d(30.0, 40.0);
  diagnosis.validate_identified.rmse_in_band = Eigen::Vector2d(3.0, 4.0);
  diagnosis.validate_after.rmse_in_band = Eigen::Vector2d(1.5, 2.0);
  EXPECT_EQ(report::relative_error_in_words(diagnosis),
            "All joints together, in band: error identified 10.0, diagnosed 5.00 % of the torque.");
  diagnosis.validate_torque.rmse_in_band_moving = Eigen::Vector2d(60.0, 80.0);
  diagnosis.validate_identified.rmse_in_band_moving = Eigen::Vector2d(3.0, 4.0);
  diagnosis.validate_after.rmse_in_band_moving = Eigen::Vector2d(0.6, 0.8);
  EXPECT_EQ(report::relative_error_in_words(diagnosis),
            "All joints together, in band: error identified 10.0, diagnosed 5.00 % of the torque; without "
            "standstill at the ends 5.00, 1.00 %.");
}

TEST(DiagnosisVerdict, DoesNotCallARiseACut) {
  Diagnosis diagnosis = empty_diagnosis();
  diagnosis.findings = {stribeck()};
  diagnosis.findings[0].validate_after = 0.5;
  EXPECT_THAT(report::brief(diagnosis), HasSubstr("adding it raises its error"));
  diagnosis.findings[0].validate_after = 0.43;
  EXPECT_THAT(report::brief(diagnosis), HasSubstr("stays at 0.430 N·m"));
}

TEST(DiagnosisVerdict, TellsEventsAsTheyHappened) {
  Diagnosis diagnosis = empty_diagnosis();
  Finding load(PayloadChange{});
  load.parameters = {{"mass", 0.5}, {"com_x", 0.01}, {"com_y", 0.02}, {"com_z", -0.1}, {"time", 14.2}};
  load.words = {{"event", "picked_up"}};
  load.main_joint = 1;
  load.validate_before = 2.0;
  load.validate_after = 1.0;
  diagnosis.findings = {load};
  diagnosis.validate_identified = diagnosis.validate_after;
  EXPECT_EQ(
      report::brief(diagnosis),
      "A load of 0.5 kg was picked up 14.2 s into the training log: adding it cuts joint 2's error on the "
      "validation log from 2.00 to 1.00 N (−50 %).");
}

TEST(DiagnosisWords, SayOfALoadWhatTheMotionDoesNotShow) {
  Diagnosis diagnosis = empty_diagnosis();
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  Finding load(PayloadChange{});
  load.parameters = {{"mass", 0.5}, {"time", 14.2}, {"com_x", 0.01}, {"com_y", 0.02}, {"com_z", kUnknown}};
  load.half_widths = {0.1, kUnknown, 0.003, 0.004, kUnknown};
  load.words = {{"event", "picked_up"}};
  diagnosis.findings = {load};
  EXPECT_THAT(report::full(diagnosis, kContext), HasSubstr("com (0.01 ± 0.003, 0.02 ± 0.004, not determined) m"));
  EXPECT_TRUE(report::diagnosis_json(diagnosis, kContext).at("effects").at(0).at("parameters").at("com").at(2).is_null());
  diagnosis.findings[0].parameters[0].second = kUnknown;
  diagnosis.findings[0].words = {{"event", "changed"}};
  EXPECT_THAT(report::brief(diagnosis), StartsWith("The load of the arm changes 14.2 s into the training log"));
}

TEST(DiagnosisWords, TellEffectsKindByKindAndJointByJoint) {
  Diagnosis diagnosis = empty_diagnosis();
  const auto of = [](EffectKind effect, int joint) {
    Finding finding = stribeck();
    finding.effect = effect;
    finding.joint = joint;
    return finding;
  };
  diagnosis.findings = {of(Hysteresis{}, 1), of(Offset{}, 0), of(Hysteresis{}, 0)};
  EXPECT_THAT(
      report::brief(diagnosis),
      StartsWith(
          "2 effects are missing: presliding (friction hysteresis) in joints 1 and 2; beside these the "
          "given model has no value for a torque offset in joint 1, which identify finds."));
  std::vector<std::string> order;
  for (const Finding* f : report::by_kind(diagnosis))
    order.push_back(std::string(f->effect.id()) + std::to_string(f->joint));
  EXPECT_THAT(order, ::testing::ElementsAre("hysteresis0", "hysteresis1", "offset0"));
}

TEST(DiagnosisWords, TellAJointThatIsNotExplainedBeforeAnythingElse) {
  Diagnosis diagnosis = empty_diagnosis();
  diagnosis.findings = {stribeck()};
  diagnosis.not_explained = {{1, 170.0, 160.0, 0.98, 0.5, false}};
  EXPECT_THAT(
      report::brief(diagnosis),
      StartsWith("Joint 2 is not explained by the arm model at all (error 170 N, 98 % of its torque). In the "
                 "other joints: Joint 1 lacks Stribeck friction"));
  const auto json = report::diagnosis_json(diagnosis, kContext);
  EXPECT_EQ(json.at("verdict"), "bad");
  EXPECT_THAT(json.at("reasons").at(0).get<std::string>(),
              AllOf(StartsWith("joint 2 is not explained"), HasSubstr("check its sign, its unit")));
  EXPECT_EQ(json.at("not_explained").at(0).at("joint"), 2);
  EXPECT_THAT(report::full(diagnosis, kContext), HasSubstr("\nVerdict: bad\n  - joint 2 is not"));
}

TEST(DiagnosisJson, HasTheFieldsOfTheContract) {
  Diagnosis diagnosis = empty_diagnosis();
  Finding contact(Contact{});
  contact.events = {{3.0, 0.5}, {9.0, 0.7}};
  contact.forces = {{1.0, 2.0, 3.0}, {4.0, 5.0, 6.0}};
  Finding load(PayloadChange{});
  load.parameters = {{"mass", 0.5}, {"com_x", 0.01}, {"com_y", 0.02}, {"com_z", -0.1}, {"time", 14.2}};
  load.words = {{"event", "dropped"}};
  diagnosis.findings = {stribeck(), contact, load};
  diagnosis.findings[0].equivalent = {{Spring{}, 1, 0.0}};
  diagnosis.unexplained = {{-1, "something", {{"coherence", 0.7}}}};
  diagnosis.refusals = {{Ripple{}, 0, "weak", 0.01}, {Spring{}, 1, "worse on day 2", 0.2}};
  const auto json = report::diagnosis_json(diagnosis, kContext);
  EXPECT_EQ(json.at("band_hz"), 8.0);
  for (const char* log : {"train", "validate"}) {
    for (const char* field : {"rmse_before", "rmse_after", "rmse_in_band_before", "rmse_in_band_after",
                              "r2_before", "r2_after", "rmse_identified", "rmse_in_band_identified"}) {
      EXPECT_EQ(json.at(log).at(field).size(), 2U) << log << ' ' << field;
    }
  }
  EXPECT_EQ(json.at("validate").at("rmse_after").at(0), 0.29);
  EXPECT_TRUE(json.at("validate").at("r2_after").at(1).is_null());
  const auto& effects = json.at("effects");
  ASSERT_EQ(effects.size(), 3U);
  EXPECT_EQ(effects[0].at("kind"), "stribeck");
  EXPECT_EQ(effects[0].at("joint"), 1);
  EXPECT_EQ(effects[0].at("parameters").at("vs"), 0.05);
  EXPECT_EQ(effects[0].at("p_value"), 3e-9);
  EXPECT_EQ(effects[0].at("delta_bic"), -812.4);
  EXPECT_EQ(effects[0].at("validate_rmse_before"), 0.43);
  EXPECT_EQ(effects[0].at("validate_rmse_after"), 0.29);
  EXPECT_EQ(effects[0].at("rivals").at(0).at("kind"), "viscous_nonlinear");
  EXPECT_EQ(effects[0].at("rivals").at(0).at("joint"), 1);
  EXPECT_EQ(effects[0].at("rivals").at(0).at("delta_bic"), -640.0);
  EXPECT_EQ(effects[0].at("equivalent").at(0).at("joint"), 2);
  EXPECT_TRUE(effects[1].at("joint").is_null());
  const auto& event = effects[1].at("parameters").at("events").at(1);
  EXPECT_EQ(event.at("t0"), 9.0);
  EXPECT_EQ(event.at("duration"), 0.7);
  EXPECT_EQ(event.at("force").at(2), 6.0);
  EXPECT_EQ(effects[2].at("parameters").at("event"), "dropped");
  EXPECT_EQ(effects[2].at("parameters").at("com").at(2), -0.1);
  EXPECT_FALSE(effects[2].at("parameters").contains("com_x"));
  EXPECT_TRUE(json.at("unexplained").at(0).at("joint").is_null());
  EXPECT_EQ(json.at("unexplained").at(0).at("what"), "something");
  EXPECT_EQ(json.at("unexplained").at(0).at("evidence").at("coherence"), 0.7);
  EXPECT_EQ(json.at("refused").at(0).at("kind"), "spring") << "what would explain most stands first";
}

TEST(DiagnosisJson, NothingFoundIsAnEmptyList) {
  const auto json = report::diagnosis_json(empty_diagnosis(), kContext);
  EXPECT_TRUE(json.at("effects").is_array());
  EXPECT_TRUE(json.at("effects").empty());
  EXPECT_TRUE(json.at("unexplained").empty());
  EXPECT_TRUE(json.at("other_load").is_null());
}

TEST(DiagnosisJson, HasTheLoadOfTheValidationLogsAsANumber) {
  Diagnosis diagnosis = empty_diagnosis();
  diagnosis.other_load = {2.8, 0.28};
  const auto json = report::diagnosis_json(diagnosis, kContext);
  EXPECT_EQ(json.at("other_load").at("mass"), 2.8);
  EXPECT_EQ(json.at("other_load").at("half_width"), 0.28);
}

TEST(DiagnosisCeiling, SaysHowMuchOfWhatIsExplainableIsExplained) {
  Diagnosis diagnosis = empty_diagnosis();
  diagnosis.ceilings = {{0.5, 0.31, 0.5, 0.4}, {0.6, 0.0, 0.01, 0.95}};
  EXPECT_EQ(report::ceiling_in_words(diagnosis),
            "Joint 1: explained 0.62 of what is explainable; nothing is explainable in joint 2.");
  EXPECT_THAT(report::full(diagnosis, kContext), HasSubstr("explained 0.62 of what is explainable"));
  const auto json = report::diagnosis_json(diagnosis, kContext);
  ASSERT_EQ(json.at("joints").size(), 2U);
  EXPECT_EQ(json.at("joints").at(0).at("explained"), 0.31);
  EXPECT_EQ(json.at("joints").at(0).at("explainable"), 0.5);
  EXPECT_EQ(json.at("joints").at(0).at("noise"), 0.5);
  EXPECT_TRUE(json.at("joints").at(1).at("explained_of_explainable").is_null());
}

TEST(DiagnosisCause, NoiseOfTheMeasurementIsNotMissing) {
  Diagnosis diagnosis = empty_diagnosis();
  diagnosis.unexplained = {{0, "this", {}, diagnose::Cause::kNoise},
                           {1, "that", {}, diagnose::Cause::kQuantisation}};
  EXPECT_THAT(
      report::brief(diagnosis),
      AllOf(StartsWith("Nothing is missing"), HasSubstr("steps of the encoders show as noise in joint 2"),
            HasSubstr("correlated in time remains in joint 1"), Not(HasSubstr("unexplained residual"))));
  diagnosis.unexplained[0].cause = diagnose::Cause::kMotion;
  EXPECT_THAT(report::brief(diagnosis), StartsWith("An unexplained residual remains: joint 1, this."));
  EXPECT_EQ(report::diagnosis_json(diagnosis, kContext).at("unexplained").at(0).at("cause"), "motion");
}

TEST(DiagnosisText, GivesParametersWithUnitsRivalsAndRefusals) {
  Diagnosis diagnosis = empty_diagnosis();
  diagnosis.findings = {stribeck()};
  diagnosis.refusals = {{Ripple{}, 0, "leads the motion", 0.02}};
  const std::string text = report::full(diagnosis, kContext);
  EXPECT_THAT(text,
              AllOf(StartsWith("Joint 1 lacks Stribeck friction"), HasSubstr("Fs 1.2 N·m, vs 0.05 rad/s"),
                    HasSubstr("p 3e-09, ΔBIC −812, error on blocks not fitted −31 %"),
                    HasSubstr("viscous friction that is not linear in speed in joint 1 (ΔBIC −640)"),
                    HasSubstr("slow motion"), HasSubstr("leads the motion"), HasSubstr(kContext.command)));
}

TEST(DiagnosisText, CountsASlidingJointInNewtons) {
  Diagnosis diagnosis = empty_diagnosis();
  Finding finding = stribeck();
  finding.joint = finding.main_joint = 1;
  EXPECT_EQ(report::parameters_in_words(finding, diagnosis.after), "Fs 1.2 N, vs 0.05 m/s");
}

TEST(DiagnosisText, NamesTheLogThatGetsWorse) {
  Diagnosis diagnosis = empty_diagnosis();
  diagnosis.validate_each_identified = {score_of(0.4, 0.6), score_of(0.4, 0.6)};
  diagnosis.validate_each_after = {score_of(0.3, 0.603), score_of(0.3, 0.7)};
  diagnosis.validate_each_after[1].log = diagnosis.validate_each_identified[1].log = "monday.csv";
  diagnosis.validate_each_identified[1].rmse_in_band = Eigen::Vector2d(0.2, 0.2);
  diagnosis.validate_each_after[1].rmse_in_band = Eigen::Vector2d(0.1, 0.3);
  EXPECT_THAT(report::errors_that_rise(diagnosis),
              ::testing::ElementsAre("monday.csv: joint 2: identified 0.600, diagnosed 0.700 N (+17 %, in band +50 %)"));
  EXPECT_THAT(diagnosis.judgement().reasons, Contains(HasSubstr("joint 2 predicted worse on a validation log")));
  // Of a joint at rest the sign of friction follows noise, which is not in band.
  diagnosis.validate_each_after[1].rmse_in_band[1] = 0.1;
  EXPECT_THAT(diagnosis.judgement().reasons, ::testing::Not(Contains(HasSubstr("predicted worse"))));
  EXPECT_THAT(report::errors_that_rise(diagnosis), ::testing::ElementsAre(HasSubstr("(+17 %, in band −50 %)")));
}

TEST(DiagnosisText, StandsWithoutScoresAndTraces) {
  Diagnosis diagnosis = empty_diagnosis();
  diagnosis.findings = {stribeck()};
  for (validate::Score* score : {&diagnosis.train_before, &diagnosis.train_after, &diagnosis.validate_before,
                                 &diagnosis.validate_after, &diagnosis.validate_identified}) {
    *score = {};
  }
  diagnosis.validate_each_before = {{}};
  EXPECT_THAT(report::full(diagnosis, kContext), HasSubstr("Stribeck"));
  EXPECT_TRUE(report::diagnosis_json(diagnosis, kContext).at("band_hz").is_null());
  EXPECT_THAT(report::page(diagnosis, kContext).html(), HasSubstr("Stribeck"));
}

TEST(DiagnosisPage, ShowsFourPlotsOfTheJointWithAnEffect) {
  Diagnosis diagnosis = empty_diagnosis();
  diagnosis.findings = {stribeck()};
  diagnose::Traces traces;
  traces.time = Eigen::VectorXd::LinSpaced(2000, 0.0, 19.99);
  traces.q = traces.time.array().sin().matrix().replicate(1, 2);
  traces.qd = traces.time.array().cos().matrix().replicate(1, 2);
  traces.before = 0.4 * traces.qd.array().sign();
  traces.after = 0.1 * (9.0 * traces.q.array()).sin();
  diagnosis.validate = diagnosis.train = {traces};
  const std::string html = report::page(diagnosis, kContext).html();
  EXPECT_THAT(html, AllOf(HasSubstr("Joint 1: Stribeck friction (validation log)"), HasSubstr("Over time"),
                          HasSubstr("Against velocity"), HasSubstr("Against position"), HasSubstr("Spectrum"),
                          HasSubstr("cuts its error on the validation log"), Not(HasSubstr("http://"))));
}

/// The files that a page carries.
std::vector<nlohmann::json> files_in(const std::string& html) {
  const std::string open = "<script class=\"file\" type=\"application/json\">";
  std::vector<nlohmann::json> files;
  for (std::size_t at = html.find(open); at != std::string::npos; at = html.find(open, at + 1)) {
    const std::size_t begin = at + open.size();
    files.push_back(nlohmann::json::parse(html.substr(begin, html.find("</script>", begin) - begin)));
  }
  return files;
}

TEST(DiagnosisPage, HasNoResidualThatAGapReaches) {
  Diagnosis diagnosis = empty_diagnosis();
  diagnose::Traces traces;
  traces.log = "run.csv";
  traces.time = Eigen::VectorXd::LinSpaced(1001, 0.0, 10.0);
  traces.q = traces.qd = traces.before = traces.after = Eigen::MatrixXd::Zero(1001, 2);
  traces.after.middleRows(400, 100).setConstant(1e6);
  traces.in_gap = Eigen::VectorXd::Zero(1001);
  traces.in_gap.segment(400, 100).setOnes();
  diagnosis.validate = diagnosis.train = {traces};
  const std::vector<nlohmann::json> files = files_in(report::page(diagnosis, kContext).html());
  ASSERT_EQ(files.size(), 2U);
  for (const nlohmann::json& file : files) {
    ASSERT_EQ(file["columns"].size(), 3U);
    for (const nlohmann::json& column : file["columns"])
      EXPECT_EQ(column["data"].get<std::string>().size(), 901 * column["places"].get<std::size_t>());
    EXPECT_LT(file["columns"][1]["step"].get<double>(), 1.0);
  }
}

TEST(DiagnosisPage, CarriesTheResidualsOfEachLogAsMeans) {
  Diagnosis diagnosis = empty_diagnosis();
  diagnose::Traces traces;
  traces.log = "/data/run a.csv";
  traces.time = Eigen::VectorXd::LinSpaced(3001, 0.0, 6.0);
  traces.q = traces.qd = traces.before = Eigen::MatrixXd::Zero(3001, 2);
  traces.after = Eigen::MatrixXd::Zero(3001, 2);
  traces.after.col(1).setLinSpaced(0.0, 3000.0);
  diagnosis.validate = diagnosis.train = {traces};
  const std::vector<nlohmann::json> one = files_in(report::page(diagnosis, kContext).html());
  ASSERT_EQ(one.size(), 2U) << "training and validation";
  EXPECT_EQ(one[0]["name"], "residuals-run-a.csv");
  EXPECT_THAT(one[0]["notes"][1], HasSubstr("mean of 3 samples")) << "3001 rows in at most 1500";
  ASSERT_EQ(one[0]["columns"].size(), 3U) << "without an effect there is one model";
  const nlohmann::json& column = one[0]["columns"][2];
  EXPECT_EQ(column["name"], "residual2");
  EXPECT_DOUBLE_EQ(column["low"].get<double>(), 1.0) << "mean of 0, 1 and 2";
  EXPECT_EQ(column["data"].get<std::string>().size(), 3U * 1001);
  diagnosis.findings = {stribeck()};
  const std::vector<nlohmann::json> two = files_in(report::page(diagnosis, kContext).html());
  ASSERT_EQ(two.at(0)["columns"].size(), 5U);
  EXPECT_EQ(two[0]["columns"][3]["name"], "residual2_before");
}

}  // namespace
}  // namespace heft::tools
