// What any function of the motion could explain, against residuals made from known functions and known noise.
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

#include <gtest/gtest.h>

#include "boosted_trees.hpp"
#include "causes.hpp"
#include "ceiling.hpp"
#include "support/arms.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kTableRate = 100.0;  // [Hz]
constexpr Index kRows = 3000;

/// Both joints on sums of sines whose phases come from the seed.
MotionTable motion(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> phase(0.0, 2.0 * std::numbers::pi);
  MotionTable table;
  table.num_joints = 2;
  table.sample_rate = kTableRate;
  table.runs = {"log"};
  table.run_seconds = {kRows / kTableRate};
  table.run_begin = {0, kRows};
  table.time = VectorXd::LinSpaced(kRows, 0.0, (kRows - 1) / kTableRate);
  for (MatrixXd* m : {&table.q, &table.qd, &table.qdd, &table.tau, &table.direction, &table.standing})
    m->setZero(kRows, 2);
  table.keep = MatrixXd::Ones(kRows, 2);
  for (int j = 0; j < 2; ++j) {
    for (int k = 1; k <= 5; ++k) {
      const double w = 2.0 * std::numbers::pi * (k + 0.3 * j) / 9.0, a = 0.6 / k, p = phase(random);
      table.q.col(j).array() += a * (w * table.time.array() + p).sin();
      table.qd.col(j).array() += a * w * (w * table.time.array() + p).cos();
      table.qdd.col(j).array() -= a * w * w * (w * table.time.array() + p).sin();
    }
  }
  table.direction = table.qd.array().tanh();
  table.sign_width = VectorXd::Constant(2, 1e-3);
  return table;
}

/// Noise of standard deviation 1 whose neighbours are correlated by `memory`.
VectorXd noise(unsigned seed, double memory) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  VectorXd values(kRows);
  double last = normal(random);
  for (double& v : values) v = last = memory * last + std::sqrt(1.0 - memory * memory) * normal(random);
  return values;
}

struct Logs {
  MotionTable others{motion(1)}, judged{motion(2)};
  MatrixXd before_others{MatrixXd::Zero(kRows, 2)}, before{MatrixXd::Zero(kRows, 2)};

  CeilingEstimate estimate(const MatrixXd& after_others, const MatrixXd& after) const {
    return ceiling_of(test::planar_two_link(), {&others, before_others, after_others},
                      {&judged, before, after});
  }
};

/// On no list of effects, and not linear in any plain term.
VectorXd unknown_function(const MotionTable& t) {
  return 1.5 * (4.0 * t.q.col(0).array()).sin() + 1.5 * (t.qd.col(1).array() > 0.3).cast<double>();
}

TEST(CeilingOfAResidual, IsTheShareThatAnUnknownFunctionHas) {
  Logs logs;
  const VectorXd function = unknown_function(logs.judged);
  const MatrixXd known_others = logs.others.q.rowwise().reverse(), known = logs.judged.q.rowwise().reverse();
  const auto residual = [](const VectorXd& in_first, unsigned seed) {
    MatrixXd r(kRows, 2);
    r << in_first + 0.5 * noise(seed, 0.0), 0.5 * noise(seed + 1, 0.0);
    return r;
  };
  const MatrixXd after_others = residual(unknown_function(logs.others), 3), after = residual(function, 5);
  logs.before_others = after_others + known_others;
  logs.before = after + known;
  const CeilingEstimate estimate = logs.estimate(after_others, after);
  const double all = logs.before.col(0).squaredNorm();
  const double reachable = 1.0 - 0.25 * kRows / all;
  const Ceiling& first = estimate.joints[0];
  EXPECT_NEAR(first.explained, 1.0 - after.col(0).squaredNorm() / all, 1e-9);
  EXPECT_NEAR(first.explainable, reachable, 0.1 * reachable);
  EXPECT_LT(first.explainable, reachable + 0.02) << "noise is not explained";
  EXPECT_NEAR(first.noise(), 1.0 - first.explainable, 1e-12);
  EXPECT_LT(first.reached(), 0.9);
  EXPECT_GT(first.unknown(), 0.6) << "most of what is left is a function of the motion";
  // Where the model explains all but white noise, nothing is left.
  EXPECT_DOUBLE_EQ(estimate.joints[1].explainable, estimate.joints[1].explained);
  // The function was judged where it was not fitted: it follows the truth there.
  const VectorXd off = estimate.function.col(0) - function;
  EXPECT_LT(off.squaredNorm(), 0.25 * function.squaredNorm());
}

TEST(CeilingOfAResidual, IsNothingForNoiseHoweverCorrelated) {
  Logs logs;
  int looked_at = 0;
  for (const double memory : {0.0, 0.9, 0.99}) {  // 0, 0.1 and 1 s
    MatrixXd after_others(kRows, 2), after(kRows, 2);
    after_others << noise(10, memory), noise(60, memory);
    after << noise(11, memory), noise(61, memory);
    logs.before_others = after_others;
    logs.before = after;
    for (const Ceiling& c : logs.estimate(after_others, after).joints) {
      EXPECT_LT(c.explainable, 0.05) << memory;
      EXPECT_DOUBLE_EQ(c.explained, 0.0);
      EXPECT_TRUE(memory > 0.0 || std::abs(c.white_noise - 1.0) < 0.1) << c.white_noise;
      ++looked_at;
    }
  }
  EXPECT_EQ(looked_at, 6);
}

TEST(BoostedTrees, FollowAFunctionOfTwoQuantitiesOnRowsLeftOut) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  MatrixXd x(2000, 3);
  for (double& v : x.reshaped()) v = uniform(random);
  const VectorXd y = (x.col(0).array() > 0.2).select(x.col(1).array() * 2.0, -1.0);
  std::vector<Index> fitted(1500), left_out(500);
  std::iota(fitted.begin(), fitted.end(), Index{0});
  std::iota(left_out.begin(), left_out.end(), Index{1500});
  VectorXd target = y;
  target.tail(500).setConstant(1e6);  // not looked at
  const MatrixXd stages = boosted(BinnedFeatures(x), target, fitted, left_out);
  EXPECT_EQ(stages.col(0).norm(), 0.0);
  EXPECT_LT((stages.rightCols(1) - y.tail(500)).norm(), 0.15 * y.tail(500).norm());
}

// Three questions, of which the second and third are asked of a large and of a small part of the rows.
TEST(BoostedTrees, OneTreeIsAFunctionOfThreeQuestionsExactly) {
  std::mt19937 random(2);
  std::uniform_int_distribution<int> step(0, 9);
  MatrixXd x(900, 5);
  for (double& v : x.reshaped()) v = 0.1 * step(random);
  VectorXd y(900);
  for (Index i = 0; i < 900; ++i) y[i] = x(i, 3) > 0.65 ? (x(i, 1) > 0.25 ? 5.0 : 3.0) : (x(i, 4) > 0.45 ? -3.0 : -6.0);
  std::vector<Index> fitted(600), left_out(300);
  std::iota(fitted.begin(), fitted.end(), Index{0});
  std::iota(left_out.begin(), left_out.end(), Index{600});
  const MatrixXd stages = boosted(BinnedFeatures(x), y, fitted, left_out, {.trees = 1, .stages = 1, .rate = 1.0, .rows = 1.0});
  EXPECT_LT((stages.col(1) - y.tail(300)).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(EncoderSteps, AreTheSmallestStepsOfThePositions) {
  data::Log log;
  log.q.resize(200, 2);
  for (Index i = 0; i < 200; ++i) {
    log.q(i, 0) = 1e-3 * std::round(300.0 * std::sin(0.05 * static_cast<double>(i)));
    log.q(i, 1) = 0.3;
  }
  const VectorXd steps = encoder_steps(log);
  EXPECT_NEAR(steps[0], 1e-3, 1e-12);
  EXPECT_EQ(steps[1], 0.0) << "rests";
}

}  // namespace
}  // namespace heft::diagnose
