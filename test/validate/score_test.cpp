/// Scores against closed forms, residuals separated from noise, criteria judged at their limits.
#include "heft/validate/score.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/data/differentiate.hpp"
#include "heft/host/error.hpp"
#include "heft/model/motion_torque.hpp"
#include "heft/validate/acceptance.hpp"
#include "heft/validate/predict.hpp"
#include "heft/validate/torque_trace.hpp"
#include "support/arms.hpp"
#include "support/synthetic_log.hpp"
#include "support/temporary_folder.hpp"

namespace heft::validate {
namespace {

using Eigen::Index;
using ::testing::AllOf;
using ::testing::HasSubstr;

Eigen::VectorXd even_time(Index rows, double rate) {
  return Eigen::VectorXd::LinSpaced(rows, 0.0, static_cast<double>(rows - 1) / rate);
}

TorqueScorer::Setup setup_of(const Eigen::VectorXd& time, const Eigen::MatrixXd& measured, double rate,
                             double band) {
  TorqueScorer::Setup setup;
  setup.log = "a.csv";
  setup.begin = time[0];
  setup.end = time[time.size() - 1];
  setup.samples = time.size();
  setup.max_torque = measured.cwiseAbs().colwise().maxCoeff();
  setup.sample_rate = rate;
  setup.band = band;
  return setup;
}

/// Score of measured minus zero, given in pieces of uneven size.
Score score_of(const Eigen::VectorXd& time, const Eigen::MatrixXd& residual, double rate, double band,
               Index piece = 1777) {
  TorqueScorer scorer(setup_of(time, residual, rate, band));
  for (Index first = 0; first < time.size(); first += piece) {
    const Index count = std::min(piece, time.size() - first);
    scorer.add_rows(time.segment(first, count), residual.middleRows(first, count),
                    Eigen::MatrixXd::Zero(count, residual.cols()));
    scorer.add_grid(time.segment(first, count), residual.middleRows(first, count));
  }
  return scorer.finish();
}

Eigen::VectorXd white(Index rows, double deviation, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0.0, deviation);
  return Eigen::VectorXd::NullaryExpr(rows, [&](Index) { return normal(random); });
}

TEST(Score, CountsAllSamplesButTheFirstAndLastHalfSecond) {
  // 10 Hz: rows 0..4 and 96..100 lie in the ends.
  const Eigen::VectorXd time = even_time(101, 10.0);
  Eigen::MatrixXd measured = Eigen::MatrixXd::Constant(101, 1, 4.0);
  measured.col(0).head(5).setConstant(100.0);
  measured.col(0).tail(5).setConstant(-100.0);
  for (Index k = 5; k < 96; ++k) measured(k, 0) = k % 2 == 0 ? 5.0 : 3.0;
  Eigen::MatrixXd predicted = Eigen::MatrixXd::Constant(101, 1, 4.0);
  predicted.array() += 0.25;
  TorqueScorer scorer(setup_of(time, measured, 10.0, 0.0));
  scorer.add_rows(time, measured, predicted);
  const Score score = scorer.finish();
  // 91 rows, residual 0.75 in 45 even ones and −1.25 in 46 odd ones.
  EXPECT_EQ(score.samples, 91);
  EXPECT_TRUE(score.ends_left_out);
  EXPECT_NEAR(score.rmse[0], std::sqrt((45 * 0.5625 + 46 * 1.5625) / 91), 1e-12);
  EXPECT_NEAR(score.bias[0], (45 * 0.75 - 46 * 1.25) / 91, 1e-12);
  EXPECT_NEAR(score.percent_of_max[0], score.rmse[0], 1e-12);  // largest torque 100
  const double mean = 4.0 - 1.0 / 91, variance = 1.0 - 1.0 / (91.0 * 91.0);
  EXPECT_NEAR(score.torque_mean[0], mean, 1e-12);
  EXPECT_NEAR(score.r2[0], 1.0 - score.rmse[0] * score.rmse[0] / variance, 1e-9);
}

TEST(Score, OfALogTooShortForItsEndsCountsEverything) {
  const Eigen::VectorXd time = even_time(10, 10.0);
  const Score score = score_of(time, Eigen::MatrixXd::Constant(10, 1, 2.0), 10.0, 0.0);
  EXPECT_FALSE(score.ends_left_out);
  EXPECT_EQ(score.samples, 10);
  EXPECT_DOUBLE_EQ(score.rmse[0], 2.0);
}

TEST(Score, QuantileIsExceededByOneInAThousand) {
  constexpr Index kRows = 20000;
  const Eigen::VectorXd time = even_time(kRows, 1e6);  // 20 ms: no ends
  Eigen::VectorXd values = Eigen::VectorXd::LinSpaced(kRows, 1.0, static_cast<double>(kRows));
  std::mt19937 random(3);
  std::shuffle(values.data(), values.data() + kRows, random);
  for (Index k = 0; k < kRows; k += 2) values[k] = -values[k];
  const Score score = score_of(time, values, 1e6, 0.0);
  // 20 of 20 000 are above 19 980.
  EXPECT_DOUBLE_EQ(score.quantile_999[0], 19980.0);
}

TEST(Score, InBandIsWhatFilteringTheWholeLogAtOnceGives) {
  constexpr Index kRows = 30000;
  constexpr double kRate = 200.0, kBand = 3.0;
  const Eigen::VectorXd time = even_time(kRows, kRate);
  Eigen::MatrixXd residual(kRows, 2);
  residual.col(0) = white(kRows, 1.0, 5);
  residual.col(1) = white(kRows, 1.0, 6).array() + (2.0 * std::numbers::pi * 1.0 * time.array()).sin() + 0.5;
  const Eigen::MatrixXd low = data::low_pass_zero_phase(residual, kRate, kBand);
  const Index end = 100;
  for (const Index piece : {Index{317}, Index{5000}, kRows}) {
    const Score score = score_of(time, residual, kRate, kBand, piece);
    EXPECT_EQ(score.band, kBand);
    for (Index j = 0; j < 2; ++j) {
      const double whole = std::sqrt(low.col(j).segment(end, kRows - 2 * end).squaredNorm() /
                                     static_cast<double>(kRows - 2 * end));
      EXPECT_NEAR(score.rmse_in_band[j], whole, 1e-6 * whole) << piece;
    }
  }
}

TEST(Score, HasNoBandBeyondHalfTheSampleRate) {
  const Eigen::VectorXd time = even_time(200, 20.0);
  const Score score = score_of(time, white(200, 1.0, 1), 20.0, 10.0);
  EXPECT_EQ(score.band, 0.0);
  EXPECT_TRUE(std::isnan(score.rmse_in_band[0]));
}

TEST(Whiteness, WhiteNoiseWithABiasIsWhite) {
  constexpr Index kRows = 20000;
  Eigen::MatrixXd residual(kRows, 3);
  for (Index j = 0; j < 3; ++j)
    residual.col(j) = white(kRows, 0.3, 20 + static_cast<unsigned>(j)).array() + 5.0;
  const Score score = score_of(even_time(kRows, 500.0), residual, 500.0, 0.0);
  for (int j = 0; j < 3; ++j) {
    EXPECT_LT(score.correlated_share[j], kWhiteShare);
    EXPECT_NEAR(score.correlation_time[j], 1.0 / 500.0, 0.15 / 500.0);
    EXPECT_THAT(describe_residual(score, j), HasSubstr("white"));
    EXPECT_NEAR(score.bias[j], 5.0, 0.02);
  }
}

TEST(Whiteness, TellsTheShareOfASineInNoiseAndWhereItSits) {
  constexpr Index kRows = 40000;
  constexpr double kRate = 500.0;
  const Eigen::VectorXd time = even_time(kRows, kRate);
  for (const double amplitude : {0.3, 1.0, 3.0}) {
    Eigen::VectorXd residual = white(kRows, 0.5, 30);
    residual.array() += amplitude * (2.0 * std::numbers::pi * 4.0 * time.array()).sin();
    const Score score = score_of(time, residual, kRate, 0.0);
    const double power = 0.5 * amplitude * amplitude;
    EXPECT_NEAR(score.correlated_share[0], power / (power + 0.25), 0.03) << amplitude;
    EXPECT_NEAR(score.correlated_below[0], 4.0, 0.5) << amplitude;
    EXPECT_THAT(describe_residual(score, 0), AllOf(HasSubstr("not noise"), HasSubstr("Hz")));
  }
}

TEST(Whiteness, CorrelationTimeIsThatOfAFirstOrderProcess) {
  // x(k) = a x(k−1) + e: period (1 + a)/(1 − a), of which the sum up to ρ = 0.05 gives about nine tenths.
  constexpr Index kRows = 60000;
  constexpr double kRate = 100.0, kA = 0.9;
  Eigen::VectorXd residual = white(kRows, 1.0, 40);
  for (Index k = 1; k < kRows; ++k) residual[k] += kA * residual[k - 1];
  const Score score = score_of(even_time(kRows, kRate), residual, kRate, 0.0);
  const double expected = (1.0 + 2.0 * kA * (1.0 - 0.05) / (1.0 - kA)) / kRate;
  EXPECT_NEAR(score.correlation_time[0], expected, 0.1 * expected);
  // Density 1/(1 + a² − 2a cos ω): its median over the upper half, at ω = 3π/4, against the variance 1/(1 − a²).
  const double level = 1.0 / (1.0 + kA * kA + std::sqrt(2.0) * kA);
  EXPECT_NEAR(score.correlated_share[0], 1.0 - level * (1.0 - kA * kA), 0.01);
}

TEST(Score, RowsInsideAGapCountNowhereOnTheGrid) {
  const Eigen::VectorXd time = even_time(2000, 100.0);
  Eigen::MatrixXd residual = Eigen::MatrixXd::Zero(2000, 1);
  residual.col(0).segment(805, 390).setConstant(1000.0);
  TorqueScorer::Setup setup = setup_of(time, residual, 100.0, 5.0);
  setup.gaps = {{8.0, 12.0}};
  TorqueScorer scorer(setup);
  scorer.add_grid(time, residual);
  const Score score = scorer.finish();
  EXPECT_TRUE(std::isnan(score.rmse[0]));  // no row of the log came in
  EXPECT_EQ(score.rmse_in_band[0], 0.0);   // nothing leaks out of the gap at its edges
}

TEST(Score, RowsBesideAGapCountAsLittleAsThoseAtTheEnds) {
  Eigen::VectorXd time = even_time(2000, 100.0);
  time.tail(1000).array() += 3.0;
  // The derived motion is wrong for 0.4 s at either side.
  Eigen::MatrixXd residual = Eigen::MatrixXd::Ones(2000, 1);
  residual.col(0).segment(960, 80).setConstant(1000.0);
  TorqueScorer::Setup setup = setup_of(time, residual, 100.0, 0.0);
  setup.gaps = {{time[999], time[1000]}};
  TorqueScorer scorer(setup);
  scorer.add_rows(time, residual, Eigen::MatrixXd::Zero(2000, 1));
  const Score score = scorer.finish();
  EXPECT_EQ(score.rmse[0], 1.0);
  EXPECT_EQ(score.samples, 2000 - 4 * 50);
}

TEST(ScoredTime, LeavesOutEndsAndWhatIsBesideGaps) {
  const ScoredTime scored(10.0, 30.0, {{15.0, 16.0}});
  for (const double t : {10.5, 14.5, 16.5, 29.5}) EXPECT_TRUE(scored.counts(t)) << t;
  for (const double t : {10.4, 14.6, 15.5, 16.4, 29.6}) EXPECT_FALSE(scored.counts(t)) << t;
  EXPECT_TRUE(scored.is_inside(15.5));
}

TEST(ScoredTime, CountsUpToGapsWhereLittleWouldRemain) {
  std::vector<data::TimeGap> gaps;
  for (int k = 1; k < 20; ++k) gaps.push_back({0.95 * k, 0.95 * k + 0.1});
  const ScoredTime scored(0.0, 19.0, gaps);
  EXPECT_TRUE(scored.counts(9.2));
  EXPECT_FALSE(scored.counts(9.55));  // in one
  const ScoredTime brief(0.0, 0.9, {});
  EXPECT_TRUE(brief.counts(0.0));
  EXPECT_FALSE(brief.ends_left_out());
}

model::Robot arm() {
  model::Robot robot = test::planar_two_link();
  robot.joints[0].actuation = {0.2, 0.8, 0.5, 0.1};
  robot.joints[1].actuation = {0.05, 0.3, 0.2, -0.05};
  return robot;
}

data::Log log_of(const model::Robot& robot) {
  test::SyntheticSettings settings;
  settings.duration = 40.0;
  settings.with_velocity = false;
  return test::synthetic_log(robot, settings);
}

TEST(Score, OfTheTrueModelIsTheNoise) {
  data::Log log = log_of(arm());
  const Score clean = score(arm(), data::MotionStream(log));
  // What is left is the sign of friction around reversals and the filter of the motion.
  EXPECT_LT(clean.percent_of_max.maxCoeff(), 1.0);
  EXPECT_GT(clean.r2.minCoeff(), 0.999);
  const double deviation = 0.2;
  for (Index j = 0; j < 2; ++j)
    log.tau.col(j) += white(log.time.size(), deviation, 50 + static_cast<unsigned>(j));
  const Score noisy = score(arm(), data::MotionStream(log));
  for (int j = 0; j < 2; ++j) {
    EXPECT_NEAR(noisy.rmse[j], std::hypot(deviation, clean.rmse[j]), 0.05 * deviation);
    EXPECT_LT(noisy.rmse_in_band[j], 0.6 * noisy.rmse[j]);
  }
}

TEST(Score, OverTheMotionAloneLeavesStandstillAtTheEndsOut) {
  // 40 s of motion between 10 s and 20 s of standstill, in which the torque is met exactly.
  const data::Log moving = log_of(arm());
  const Index lead = 1000, tail = 2000, rows = moving.time.size();
  const double step = moving.time[1] - moving.time[0];
  data::Log log;
  log.time =
      Eigen::VectorXd::LinSpaced(lead + rows + tail, 0.0, step * static_cast<double>(lead + rows + tail - 1));
  log.q.resize(lead + rows + tail, 2);
  log.q << moving.q.row(0).replicate(lead, 1), moving.q, moving.q.row(rows - 1).replicate(tail, 1);
  TorqueScorer::Setup setup;
  setup.begin = log.time[0], setup.end = log.time[log.time.size() - 1];
  setup.samples = log.time.size();
  setup.max_torque = Eigen::Vector2d(10.0, 10.0);
  setup.sample_rate = 1.0 / step;
  setup.band = 5.0;
  setup.moving_from = log.time[lead], setup.moving_to = log.time[lead + rows - 1];
  Eigen::MatrixXd error = Eigen::MatrixXd::Zero(log.time.size(), 2);
  error.middleRows(lead, rows).col(0).setConstant(2.0);
  error.middleRows(lead, rows).col(1).setConstant(-3.0);
  const Eigen::MatrixXd none = Eigen::MatrixXd::Zero(log.time.size(), 2);
  TorqueScorer scorer(setup);
  scorer.add_rows(log.time, error, none);
  scorer.add_grid(log.time, error);
  const Score score = scorer.finish();
  EXPECT_EQ(score.samples_moving, rows);
  EXPECT_NEAR(score.rmse_moving[0], 2.0, 1e-12);
  EXPECT_NEAR(score.rmse_moving[1], 3.0, 1e-12);
  EXPECT_NEAR(score.rmse_in_band_moving[1], 3.0, 0.05);
  const double share = static_cast<double>(rows) / static_cast<double>(score.samples);
  EXPECT_NEAR(score.rmse[0], 2.0 * std::sqrt(share), 1e-9);
  // Together with a log without standstill: all its samples count.
  Score other = score;
  other.samples = other.samples_moving = 1000;
  other.rmse = other.rmse_moving = other.rmse_in_band = other.rmse_in_band_moving = Eigen::Vector2d(1.0, 1.0);
  const Score both = pool({score, other});
  EXPECT_EQ(both.samples_moving, rows + 1000);
  EXPECT_NEAR(both.rmse_moving[0], std::sqrt((4.0 * rows + 1000.0) / (rows + 1000.0)), 1e-9);
}

TEST(Score, KnowsFromTheLogWhereItMoves) {
  const data::Log moving = log_of(arm());
  const Index lead = 1500, rows = moving.time.size();
  const double step = moving.time[1] - moving.time[0];
  // The torque at rest is off by more than anything in motion; the arm creeps into it, so there is no step.
  data::Log log;
  log.path = "rest.csv";
  log.time = Eigen::VectorXd::LinSpaced(lead + rows, 0.0, step * static_cast<double>(lead + rows - 1));
  log.q.resize(lead + rows, 2);
  log.q << moving.q.row(0).replicate(lead, 1), moving.q;
  log.tau.resize(lead + rows, 2);
  log.tau << (moving.tau.row(0).array() + 20.0).matrix().replicate(lead, 1), moving.tau;
  const Score s = score(arm(), data::MotionStream(log));
  for (Index j = 0; j < 2; ++j) {
    EXPECT_GT(s.rmse[j], 5.0) << j;
    EXPECT_LT(s.rmse_moving[j], 0.3 * s.rmse[j]) << j;
    EXPECT_LT(s.rmse_in_band_moving[j], 0.5 * s.rmse_in_band[j]) << j;
  }
  EXPECT_NEAR(static_cast<double>(s.samples_moving), static_cast<double>(rows), 100.0);
}

TEST(Score, DoesNotDependOnThePiecesOfTheLog) {
  const data::Log log = log_of(arm());
  model::Robot wrong = arm();
  wrong.joints[1].link[kMass] *= 1.2;
  data::StreamOptions fine;
  fine.chunk_samples = 300;
  const Score once = score(wrong, data::MotionStream(log));
  const Score pieces = score(wrong, data::MotionStream(log, fine));
  EXPECT_TRUE(once.rmse.isApprox(pieces.rmse, 1e-6));
  EXPECT_TRUE(once.rmse_in_band.isApprox(pieces.rmse_in_band, 1e-5));
  EXPECT_EQ(once.samples, pieces.samples);
}

TEST(Predictor, WhatSlidesHasItsFrictionAtTheCreepOfAPause) {
  model::Robot robot;
  robot.joints.resize(2);
  for (auto& joint : robot.joints) joint.actuation.coulomb_friction = 1.0;
  robot.joints[1].joint.type = JointType::kPrismatic;
  MotionRows creep;
  creep.time = even_time(2, 100.0);
  creep.q = creep.qdd = Eigen::MatrixXd::Zero(2, 2);
  creep.qd = Eigen::MatrixXd::Constant(2, 2, 5e-4);
  const auto row = [&](double width) -> Eigen::RowVectorXd {
    return Predictor(robot, 0.0, {.sign_width = width}).rows(creep).row(1);
  };
  const Eigen::RowVectorXd usual = row(kSignWidth);
  EXPECT_LT(usual[0], 0.1);  // a tenth of the width
  EXPECT_GT(usual[1], 0.75);
  for (const double narrow : {1e-4, 0.0}) EXPECT_EQ(row(narrow), Eigen::RowVector2d(1.0, 1.0)) << narrow;
}

TEST(Score, TakesGearCouplingsIntoThePrediction) {
  model::Robot coupled = arm();
  GearCoupling<double> coupling;
  coupling.driving = 0;
  coupling.driven = 1;
  coupling.rotor_inertia = 0.3;
  coupling.viscous_friction = 0.5;
  coupled.couplings.push_back(coupling);
  const data::Log log = log_of(coupled);
  const Score with = score(coupled, data::MotionStream(log));
  const Score without = score(arm(), data::MotionStream(log));
  EXPECT_LT(with.percent_of_max.maxCoeff(), 1.0);
  EXPECT_GT(without.percent_of_max.minCoeff(), 3.0);
}

/// The torque of all that a robot of two joints has, along two sines.
data::Log log_along(const model::Robot& robot) {
  data::Log log;
  log.path = "along.csv";
  log.time = even_time(2000, 100.0);
  log.q.resize(2000, 2), log.qd.resize(2000, 2), log.qdd.resize(2000, 2);
  for (Index j = 0; j < 2; ++j) {
    const double w = 2.0 + static_cast<double>(j);
    log.q.col(j) = (w * log.time.array()).sin();
    log.qd.col(j) = w * (w * log.time.array()).cos();
    log.qdd.col(j) = -w * w * log.q.col(j);
  }
  log.tau = model::MotionTorque(robot).torque(log.time, log.q, log.qd, log.qdd, ScoreOptions{}.sign_width);
  return log;
}

TEST(Score, CarriesEffectsFromPieceToPiece) {
  model::Robot robot = arm();
  robot.effects = {{joint_effect_kind<Hysteresis>(), 0, {0.08}},
                   {joint_effect_kind<FrictionDrift>(), 1, {0.8, 0.5, 6.0}}};
  robot.elasticities = {{1, 400.0, 0.5, 0.1}};
  robot.torque_delay = 0.0123;
  data::Log log = log_along(robot);
  log.time.array() += 40.0;  // a log need not begin at 0
  data::StreamOptions fine;
  fine.chunk_samples = 300;
  const Score pieces = score(robot, data::MotionStream(log, fine));
  EXPECT_LT(pieces.rmse.maxCoeff(), 1e-8);
  EXPECT_LT(pieces.rmse_in_band.maxCoeff(), 1e-8);
  for (int left_out = 0; left_out < 4; ++left_out) {
    model::Robot without = robot;
    if (left_out < 2) without.effects.erase(without.effects.begin() + left_out);
    if (left_out == 2) without.elasticities.clear();
    if (left_out == 3) without.torque_delay = 0.0;
    EXPECT_GT(score(without, data::MotionStream(log, fine)).rmse.maxCoeff(), 1e-3) << left_out;
  }
}

// Each by itself: pieces of a model without any are predicted by themselves.
TEST(Score, KnowsWhatGoesOnFromPieceToPiece) {
  for (int only = 0; only < 4; ++only) {
    SCOPED_TRACE(only);
    model::Robot robot = arm();
    if (only == 0) robot.effects = {{joint_effect_kind<Hysteresis>(), 0, {0.08}}};
    if (only == 1) robot.elasticities = {{1, 400.0, 0.5, 0.1}};
    if (only == 2) robot.torque_delay = 0.0123;
    if (only == 3) robot.effects = {{joint_effect_kind<FrictionDrift>(), 1, {0.8, 0.5, 6.0}}};
    EXPECT_EQ(model::depends_on_past(robot), only < 3);
    data::StreamOptions fine;
    fine.chunk_samples = 300;
    EXPECT_LT(score(robot, data::MotionStream(log_along(robot), fine)).rmse.maxCoeff(), 1e-8);
  }
}

TEST(Score, RefusesALogOfAnotherArmOrWithoutTorque) {
  const model::Robot robot = arm();
  data::Log log = log_of(robot);
  model::Robot three = robot;
  three.joints.push_back(three.joints.back());
  EXPECT_THAT(test::message_of<DataError>([&] { (void)score(three, data::MotionStream(log)); }),
              AllOf(HasSubstr("2 joints"), HasSubstr("expected 3")));
  log.tau.resize(0, 0);
  EXPECT_THAT(test::message_of<DataError>([&] { (void)score(robot, data::MotionStream(log)); }),
              AllOf(HasSubstr("no torque"), HasSubstr("tau1..tau2")));
}

TEST(Score, PooledIsThatOfAllSamplesTogether) {
  const Eigen::VectorXd time = even_time(4000, 100.0);
  const Eigen::VectorXd first = white(4000, 1.0, 60), second = white(2000, 3.0, 61).array() + 2.0;
  const Score a = score_of(time, first, 100.0, 5.0), b = score_of(time.head(2000), second, 100.0, 5.0);
  const Score all = pool({a, b});
  const double squares = first.segment(50, 3900).squaredNorm() + second.segment(50, 1900).squaredNorm();
  EXPECT_EQ(all.samples, 5800);
  EXPECT_NEAR(all.rmse[0], std::sqrt(squares / 5800.0), 1e-12);
  EXPECT_NEAR(all.bias[0], (first.segment(50, 3900).sum() + second.segment(50, 1900).sum()) / 5800.0, 1e-12);
  EXPECT_DOUBLE_EQ(all.max_torque[0], std::max(first.cwiseAbs().maxCoeff(), second.cwiseAbs().maxCoeff()));
  const double mean = all.bias[0];
  EXPECT_NEAR(all.torque_variance[0], squares / 5800.0 - mean * mean, 1e-9);
  EXPECT_DOUBLE_EQ(pool({b}).rmse[0], b.rmse[0]);
}

TEST(Criteria, AreFiveWithTheirLimits) {
  const std::vector<Criterion> criteria = acceptance_criteria();
  ASSERT_EQ(criteria.size(), 5U);
  const double limits[] = {15.0, 3.0, 40.0, 5.0, 10.0};
  for (std::size_t k = 0; k < 5; ++k) {
    EXPECT_EQ(criteria[k].limit, limits[k]);
    EXPECT_EQ(criteria[k].at_least, k == 2);
    EXPECT_EQ(criteria[k].verdict, Verdict::kNotJudged);
    EXPECT_TRUE(std::isnan(criteria[k].value));
  }
}

TEST(Criteria, AreMetOnTheRightSideOfTheLimitOnly) {
  Criterion below = acceptance_criteria()[1], above = acceptance_criteria()[2];
  judge(below, 2.999);
  EXPECT_EQ(below.verdict, Verdict::kMet);
  judge(below, 3.0);
  EXPECT_EQ(below.verdict, Verdict::kMissed);
  judge(above, 40.0);
  EXPECT_EQ(above.verdict, Verdict::kMissed);
  judge(above, 41.0);
  EXPECT_EQ(above.verdict, Verdict::kMet);
  judge(above, std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(above.verdict, Verdict::kNotJudged);
}

TEST(RelativeScatter, IsStandardDeviationOverMean) {
  const std::vector<Eigen::VectorXd> estimates{Eigen::Vector2d(1.0, -10.0), Eigen::Vector2d(2.0, -12.0),
                                               Eigen::Vector2d(3.0, -14.0)};
  const Eigen::VectorXd scatter = relative_scatter(estimates);
  EXPECT_DOUBLE_EQ(scatter[0], 0.5);
  EXPECT_NEAR(scatter[1], 2.0 / 12.0, 1e-15);
  EXPECT_TRUE(std::isnan(relative_scatter({estimates[0]})[0]));
  EXPECT_NEAR(relative_errors(Eigen::Vector2d(1.1, -9.0), Eigen::Vector2d(1.0, -10.0))[0], 0.1, 1e-12);
}

TEST(TorqueTrace, KeepsExtremesAndMeanOfEachStep) {
  TorqueTrace trace(3001, 1);
  ASSERT_EQ(trace.rows_a_step(), 3);
  const Eigen::VectorXd time = even_time(3001, 500.0);
  Eigen::MatrixXd measured(3001, 1);
  measured.col(0).setLinSpaced(0.0, 3000.0);
  const Eigen::MatrixXd predicted = Eigen::MatrixXd::Constant(3001, 1, 0.5);
  // In two pieces, of which the first ends inside a step.
  trace.add(time.head(100), measured.topRows(100), predicted.topRows(100));
  trace.add(time.tail(2901), measured.bottomRows(2901), predicted.bottomRows(2901));
  ASSERT_EQ(trace.steps().size(), 1001U);
  const TorqueTrace::Step& step = trace.steps()[33][0];  // rows 99 to 101
  EXPECT_DOUBLE_EQ(step.residual_mean, 99.5);
  EXPECT_DOUBLE_EQ(step.residual.low, 98.5);
  EXPECT_DOUBLE_EQ(step.residual.high, 100.5);
  EXPECT_DOUBLE_EQ(trace.steps().back()[0].residual_mean, 2999.5) << "one row";
}

}  // namespace
}  // namespace heft::validate
