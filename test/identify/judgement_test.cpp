// One rule of trust: what is green has earned it, and what contradicts itself is said so.

#include <filesystem>
#include <limits>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "data/log_part.hpp"
#include "heft/identify/judgement.hpp"
#include "heft/payload/judgement.hpp"
#include "heft/payload/recursive_fit.hpp"
#include "heft/stiffness/judgement.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "heft/validate/acceptance.hpp"
#include "support/arms.hpp"
#include "support/measured_data.hpp"
#include "support/synthetic_log.hpp"

namespace heft::identify {
namespace {

using Eigen::VectorXd;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using Rank = host::Verdict;
using namespace validate;
using payload::contradiction;
using payload::judge;
using stiffness::judge;

/// A score of joints whose torque varies by 1 about its mean and reaches `largest`, with these errors; in band
/// unless stated otherwise.
validate::Score score_of(const VectorXd& error, double largest, double band = 5.0) {
  validate::Score score;
  score.rmse = score.rmse_in_band = error;
  score.band = band;
  score.torque_variance = VectorXd::Ones(error.size());
  score.max_torque = VectorXd::Constant(error.size(), largest);
  score.percent_of_max = score.in_band_percent_of_max = 100.0 * error / largest;
  return score;
}

validate::Score score_of(double error, double largest) {
  return score_of(VectorXd::Constant(1, error), largest);
}

TEST(ExplainedShare, IsOneLessErrorAgainstVariation) {
  const VectorXd share = explained_share(score_of(Eigen::Vector3d(0.0, 0.5, 1.0), 3.0));
  EXPECT_TRUE(share.isApprox(Eigen::Vector3d(1.0, 0.75, 0.0)));
}

TEST(ExplainedShare, LeavesNoiseAboveTheBandOutOfErrorAndTorque) {
  // Torque of variance 1, 0.36 of it noise above the band that no model explains; of the rest half is explained.
  validate::Score score = score_of(0.0, 3.0);
  score.rmse_in_band[0] = std::sqrt(0.32);
  score.rmse[0] = std::sqrt(0.32 + 0.36);
  EXPECT_NEAR(explained_share(score)[0], 0.5, 1e-12);
  score.band = 0.0;
  EXPECT_NEAR(explained_share(score)[0], 1.0 - 0.68, 1e-12);
}

TEST(Prediction, IsGoodDoubtfulOrBadAtTheStatedLimits) {
  // Largest torque 3: an error of e is 33 e % of it.
  const double good = std::sqrt(1.0 - kGoodShare), bad = std::sqrt(1.0 - kBadShare);
  EXPECT_EQ(judge_prediction({score_of(0.99 * good, 3.0)}).verdict, Rank::kGood);
  EXPECT_EQ(judge_prediction({score_of(1.01 * good, 3.0)}).verdict, Rank::kDoubtful);
  EXPECT_EQ(judge_prediction({score_of(0.99 * bad, 3.0)}).verdict, Rank::kDoubtful);
  EXPECT_EQ(judge_prediction({score_of(1.01 * bad, 3.0)}).verdict, Rank::kBad);
}

TEST(Prediction, IsNotHeldAgainstAJointWhoseTorqueHardlyChanges) {
  // As large an error as the variation, of a torque that is 50 times as large: a vertical axis that holds a weight.
  EXPECT_EQ(judge_prediction({score_of(1.0, 50.0)}).verdict, Rank::kGood);
  EXPECT_EQ(judge_prediction({score_of(1.0, 20.0)}).verdict, Rank::kDoubtful);
  EXPECT_EQ(judge_prediction({score_of(1.0, 9.0)}).verdict, Rank::kBad);
}

TEST(Prediction, IsJudgedOnTheWorstLogOfEachJoint) {
  const validate::Score one = score_of(Eigen::Vector2d(0.9, 0.1), 3.0),
                        other = score_of(Eigen::Vector2d(0.1, 0.5), 3.0);
  const host::Judgement judgement = judge_prediction({one, other});
  EXPECT_EQ(judgement.verdict, Rank::kBad);
  EXPECT_THAT(judgement.reasons,
              ::testing::ElementsAre(HasSubstr("joint 1 (19 % explained, off by 30 % of its largest torque)"),
                                     HasSubstr("joint 2 (75 % explained")));
}

TEST(Prediction, OfATorqueThatNeverChangesIsNoProof) {
  validate::Score silent = score_of(Eigen::Vector2d(0.0, 0.0), 3.0);
  silent.torque_variance[1] = 0.0;
  EXPECT_EQ(judge_prediction({silent}).verdict, Rank::kDoubtful);
  silent.torque_variance.setZero();
  EXPECT_EQ(judge_prediction({silent}).verdict, Rank::kBad);
}

TEST(Model, NeedsHalfItsParametersDetermined) {
  EXPECT_EQ(judge_model({58, 29}).verdict, Rank::kGood);
  EXPECT_EQ(judge_model({58, 28}).verdict, Rank::kDoubtful);
  EXPECT_EQ(judge_model({58, 8}).verdict, Rank::kDoubtful);
  EXPECT_EQ(judge_model({58, 7}).verdict, Rank::kBad);
}

TEST(Model, WithAnImpossibleLinkIsNotGood) {
  ModelFacts facts{58, 58, true, 1.044, {}};
  facts.mass.poses = 10000;
  EXPECT_EQ(judge_model(facts).verdict, Rank::kGood);
  facts.mass.not_positive = 1;
  const host::Judgement judgement = judge_model(facts);
  EXPECT_EQ(judgement.verdict, Rank::kDoubtful);
  EXPECT_THAT(judgement.reasons,
              ::testing::ElementsAre(
                  AllOf(HasSubstr("1 of 10000 poses"), HasSubstr("--method physical"), HasSubstr("2.2 %"))));
  facts.mass.not_positive = 0;
  facts.physically_consistent = false;
  EXPECT_EQ(judge_model(facts).verdict, Rank::kDoubtful);
  // Unless links that can exist do as well.
  facts.physical_cost_ratio = 1.01;
  EXPECT_EQ(judge_model(facts).verdict, Rank::kGood);
}

/// Logs of one arm on different motions, judged by a fit to one of them.
host::Judgement judged_on_unseen(double noise, Method method, bool held_out = true) {
  model::Robot robot = test::six_joint_arm();
  // Without friction a log is perfect: what a sign does between two samples is lost in any log.
  if (noise == 0.0) {
    for (model::RobotJoint& joint : robot.joints) joint.actuation = {};
  }
  const auto log = [&](unsigned seed) {
    test::SyntheticSettings settings;
    settings.noise = noise;
    settings.motion_seed = settings.noise_seed = seed;
    return test::synthetic_log(robot, settings);
  };
  const data::MotionStream train(log(1)), unseen(log(2));
  FitOptions options;
  options.method = method;
  options.structure.rotor_inertia = false;
  const Fit found = fit(robot, {&train}, options);
  const model::MassMatrixCheck mass = model::check_mass_matrix(found.robot, 1000, 1);
  if (!held_out) return judge(found, mass, {}, {score(found.robot, train)});
  return judge(found, mass, {score(found.robot, unseen)});
}

TEST(SimulatedArm, IsGreenOnALogNotSeen) {
  // Perfect logs, and noise of a hundredth of the torque where the links are held to what is possible.
  for (const auto& [noise, method] :
       {std::pair{0.0, Method::kWls}, {0.0, Method::kPhysical}, {0.01, Method::kPhysical}}) {
    const host::Judgement judged = judged_on_unseen(noise, method);
    EXPECT_EQ(judged.verdict, Rank::kGood) << noise << ::testing::PrintToString(judged.reasons);
    EXPECT_THAT(judged.reasons, IsEmpty());
  }
}

TEST(SimulatedArm, IsDoubtfulWithoutALogNotSeen) {
  const host::Judgement judged = judged_on_unseen(0.01, Method::kPhysical, false);
  EXPECT_EQ(judged.verdict, Rank::kDoubtful);
  EXPECT_THAT(judged.reasons, ::testing::ElementsAre(HasSubstr("--validate")));
}

TEST(SimulatedArm, IsDoubtfulWhereNoiseMakesItsLinksImpossible) {
  const host::Judgement judged = judged_on_unseen(0.01, Method::kWls);
  EXPECT_EQ(judged.verdict, Rank::kDoubtful);
  EXPECT_THAT(judged.reasons, ::testing::ElementsAre(HasSubstr("--method physical")));
}

TEST(MeasuredTx40, IsNotUsable) {
  const std::string folder = HEFT_DATA_DIR "/staubli-tx40";
  HEFT_NEEDS_MEASURED_DATA(folder);
  const model::Robot robot = urdf::load_urdf(folder + "/robot.urdf");
  data::LogRequirements needs;
  needs.num_joints = 6;
  needs.torque = true;
  const data::Log whole = data::read_log(folder + "/run-first6s.csv", needs);
  const data::MotionStream train(data::part_of(whole, 0.0, 4.2)), unseen(data::part_of(whole, 4.2, 6.0));
  const Fit found = fit(robot, {&train});
  const host::Judgement judged =
      judge(found, model::check_mass_matrix(found.robot, 1000, 1), {score(found.robot, unseen)});
  // Its wrist is coupled, which this model does not know.
  EXPECT_FALSE(judged.usable());
  ASSERT_THAT(judged.reasons, SizeIs(3));
  EXPECT_THAT(judged.reasons[0], HasSubstr("joint 5"));
  EXPECT_THAT(judged.reasons[1], HasSubstr("of 58 base parameters"));
  EXPECT_THAT(judged.reasons[2], HasSubstr("not positive definite in 1000 of 1000 poses"));
}

// Loads --------------------------------------------------------------------------------------------------------

/// A run that found this body, every parameter known to a hundredth of the body's size.
payload::PayloadRun found_body(const InertialParameters<double>& body, double share = 0.01) {
  payload::PayloadRun run;
  run.parameters = Eigen::Map<const VectorXd>(body.data(), 10);
  const VectorXd size = (VectorXd(10) << 1, 0.1, 0.1, 0.1, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01).finished();
  run.covariance = (share * size).cwiseAbs2().asDiagonal();
  run.interval_factor = 2.0;
  const auto part = [&](int from, int count) {
    payload::Estimated estimated;
    estimated.value = run.parameters.segment(from, count);
    estimated.std = run.covariance.diagonal().segment(from, count).cwiseSqrt();
    estimated.half_width = run.interval_factor * estimated.std;
    estimated.identifiable.assign(static_cast<std::size_t>(count), true);
    return estimated;
  };
  run.mass = part(0, 1);
  run.first_moment = part(1, 3);
  run.inertia = part(4, 6);
  run.mass_visible = true;
  run.converged_at = 5.0;
  return run;
}

const InertialParameters<double> kBody =
    test::body(2.0, {0.05, 0.1, -0.05}, {0.02, 0.001, 0.015, 0, 0, 0.02});

TEST(Load, ThatABodyCanHaveIsGood) {
  EXPECT_THAT(contradiction(found_body(kBody)), IsEmpty());
  EXPECT_EQ(judge(found_body(kBody)).verdict, Rank::kGood);
}

TEST(Load, BelowZeroBeyondItsIntervalAsksWhetherTheLogsAreInterchanged) {
  InertialParameters<double> taken = kBody;
  for (double& p : taken) p = -p;
  const payload::PayloadRun run = found_body(taken);
  EXPECT_THAT(contradiction(run), AllOf(HasSubstr("-2 kg"), HasSubstr("interchanged")));
  EXPECT_FALSE(judge(run).usable());
}

TEST(Load, BelowZeroWithinItsIntervalIsNoContradiction) {
  payload::PayloadRun run = found_body({});
  run.mass.value[0] = -0.01;
  run.mass.half_width[0] = 0.02;
  EXPECT_THAT(contradiction(run), IsEmpty());
  run.mass.value[0] = -0.03;
  EXPECT_THAT(contradiction(run), HasSubstr("mass is negative"));
}

TEST(Load, WithAnInertiaThatNoBodyHasIsAContradictionBeyondItsIntervalsOnly) {
  // Ixx about the flange of a mass 0.11 m off its x axis is at least m (cy² + cz²) = 0.025; here it is 0.
  InertialParameters<double> impossible = kBody;
  impossible[4] = 0.0;
  EXPECT_THAT(contradiction(found_body(impossible)), HasSubstr("mass, centre of mass and inertia are "
                                                               "physically impossible"));
  EXPECT_THAT(contradiction(found_body(impossible, 0.5)), IsEmpty());
  // A point, whose pseudo-inertia is singular, is a body within any interval.
  EXPECT_THAT(contradiction(found_body(test::body(2.0, {0.05, 0.1, -0.05}, {0, 0, 0, 0, 0, 0}))), IsEmpty());
}

TEST(Load, ThatOneJointFeelsDifferentlyIsDoubtfulOrAContradiction) {
  payload::PayloadRun run = found_body(kBody);
  run.torque_scale.value = Eigen::Vector3d(1.0, 1.3, 1.02);
  run.torque_scale.std = run.torque_scale.half_width = Eigen::Vector3d(0.05, 0.05, 0.01);
  run.torque_scale.identifiable = {true, true, true};
  EXPECT_EQ(judge(run).verdict, Rank::kDoubtful);
  EXPECT_THAT(judge(run).reasons,
              ::testing::ElementsAre(AllOf(HasSubstr("joint 2 1.30"), Not(HasSubstr("joint 3")))));
  run.torque_scale.half_width[1] = 0.4;
  EXPECT_EQ(judge(run).verdict, Rank::kGood);
  run.torque_scale.value[1] = -1.0;
  EXPECT_THAT(contradiction(run), AllOf(HasSubstr("joint 2"), HasSubstr("sign")));
  run.torque_scale.identifiable[1] = false;
  EXPECT_THAT(contradiction(run), IsEmpty());
}

/// A load weighed on logs whose torque of one joint was multiplied by a factor, in both.
payload::PayloadRun weighed(int joint, double factor, bool loaded = true) {
  const model::Robot arm = test::six_joint_arm();
  const InertialParameters<double> load =
      test::body(1.5, {0.04, 0.11, -0.05}, {0.01, 0.001, 0.008, -0.002, 0.0005, 0.012});
  test::SyntheticSettings settings;
  settings.noise = 0.01;
  data::Log bare = test::synthetic_log(arm, settings);
  settings.noise_seed = 2;
  data::Log carrying = test::synthetic_log(loaded ? test::carrying(arm, load) : arm, settings);
  bare.tau.col(joint) *= factor;
  carrying.tau.col(joint) *= factor;
  const payload::RecursiveFit fit = payload::fit_recursively(arm, {bare});
  model::Robot fitted = arm;
  model::apply(fit.model, fitted);
  payload::PayloadRunOptions options;
  options.residual = fit.residual;
  options.model_covariance = fit.model.covariance;
  return payload::run_payload(fitted, carrying, options);
}

TEST(TorqueScale, IsOneWhereTheJointsAgree) {
  const payload::PayloadRun run = weighed(2, 1.0);
  int known = 0;
  for (Eigen::Index j = 0; j < 6; ++j) {
    if (!run.torque_scale.identifiable[static_cast<std::size_t>(j)]) continue;
    ++known;
    // 95 % intervals of six joints: twice the half-width holds for all of them.
    EXPECT_NEAR(run.torque_scale.value[j], 1.0, 2.0 * run.torque_scale.half_width[j]) << "joint " << j + 1;
  }
  EXPECT_GE(known, 3);
  EXPECT_EQ(judge(run).verdict, Rank::kGood) << ::testing::PrintToString(judge(run).reasons);
}

TEST(TorqueScale, NamesTheJointWithAnotherTorqueConstant) {
  const payload::PayloadRun run = weighed(2, 1.3);
  ASSERT_TRUE(run.torque_scale.identifiable[2]);
  // Against the others, which the load found is a compromise with.
  double others = 0.0;
  int count = 0;
  for (const int j : {1, 3}) {
    if (!run.torque_scale.identifiable[static_cast<std::size_t>(j)]) continue;
    others += run.torque_scale.value[j], ++count;
  }
  ASSERT_GT(count, 0);
  EXPECT_NEAR(run.torque_scale.value[2] / (others / count), 1.3, 0.15);
  EXPECT_EQ(judge(run).verdict, Rank::kDoubtful);
  EXPECT_THAT(judge(run).reasons, ::testing::Contains(HasSubstr("joint 3")));
}

TEST(TorqueScale, SaysNothingWhereThereIsNoLoad) {
  const payload::PayloadRun run = weighed(2, 1.0, false);
  EXPECT_THAT(contradiction(run), IsEmpty());
  EXPECT_THAT(run.torque_scale.identifiable, ::testing::Each(false));
}

// The rest -----------------------------------------------------------------------------------------------------

TEST(Truth, IsHeldAgainstTheInterval) {
  EXPECT_EQ(judge_against_truth("the mass", 2.8, 0.1, 2.85).verdict, Rank::kGood);
  EXPECT_EQ(judge_against_truth("the mass", 2.8, 0.1, 2.95).verdict, Rank::kDoubtful);
  EXPECT_EQ(judge_against_truth("the mass", 2.8, 0.1, 3.2).verdict, Rank::kBad);
  EXPECT_EQ(judge_against_truth("the mass", 2.8, std::numeric_limits<double>::quiet_NaN(), 2.8).verdict,
            Rank::kBad);
}

TEST(Improvement, IsNotARise) {
  EXPECT_EQ(judge_improvement("a", 1.04, "b", 1.0).verdict, Rank::kGood);
  EXPECT_EQ(judge_improvement("a", 1.5, "b", 1.0).verdict, Rank::kDoubtful);
  EXPECT_EQ(judge_improvement("a", 4.0, "b", 1.0).verdict, Rank::kBad);
  EXPECT_EQ(judge_improvement("a", std::numeric_limits<double>::quiet_NaN(), "b", 1.0).verdict, Rank::kBad);
}

TEST(Campaign, IsGoodWhenEveryCriterionIsMet) {
  std::vector<validate::Criterion> criteria = validate::acceptance_criteria();
  EXPECT_EQ(judge(criteria).verdict, Rank::kDoubtful);
  for (validate::Criterion& criterion : criteria) judge(criterion, criterion.at_least ? 99.0 : 0.1);
  EXPECT_EQ(judge(criteria).verdict, Rank::kGood);
  judge(criteria[1], 3.1);
  EXPECT_EQ(judge(criteria).verdict, Rank::kBad);
  EXPECT_THAT(judge(criteria).reasons, ::testing::ElementsAre(HasSubstr("torque prediction: 3.1 %")));
}

TEST(Stiffness, WithOneOpenEndIsNone) {
  stiffness::StiffnessFit fit;
  stiffness::StiffnessEstimate known;
  known.determined = true;
  known.group = 0;
  known.stiffness = 1e4, known.stiffness_low = 8e3, known.stiffness_high = 1.3e4;
  stiffness::StiffnessEstimate open = known;
  open.stiffness_high = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(known.has_stiffness());
  EXPECT_FALSE(open.has_stiffness());
  fit.joints = {known, known};
  fit.left_out_rms = 1e-5;
  stiffness::StiffnessDiagnosis diagnosis;
  diagnosis.mean_rms = 1e-4;
  EXPECT_EQ(judge(fit, diagnosis).verdict, Rank::kGood);
  fit.joints = {known, open};
  EXPECT_THAT(judge(fit, diagnosis).reasons, ::testing::ElementsAre(HasSubstr("joint 2 is not determined")));
  fit.joints = {open, open};
  EXPECT_FALSE(judge(fit, diagnosis).usable());
  fit.joints = {known, known};
  fit.left_out_rms = 2e-4;
  EXPECT_FALSE(judge(fit, diagnosis).usable());
}

TEST(EncoderStiffness, WithoutRotorInertiaIsDoubtful) {
  stiffness::JointEncoderFit fit;
  stiffness::JointStiffness joint;
  joint.identifiable = true;
  joint.stiffness = 1e6, joint.stiffness_lower = 8e5, joint.stiffness_upper = 1.3e6;
  fit.pooled = {joint};
  EXPECT_EQ(judge(fit, true).verdict, Rank::kGood);
  EXPECT_THAT(judge(fit, false).reasons, ::testing::ElementsAre(HasSubstr("--rotor-inertia")));
  fit.pooled[0].stiffness_upper = 4e6;
  EXPECT_EQ(judge(fit, true).verdict, Rank::kDoubtful);
  fit.pooled[0].identifiable = false;
  EXPECT_FALSE(judge(fit, true).usable());
}

}  // namespace
}  // namespace heft::identify
