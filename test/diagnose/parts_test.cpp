// The parts of the diagnosis against closed forms.
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "curves.hpp"
#include "deflection.hpp"
#include "evidence.hpp"
#include "heft/data/motion_stream.hpp"
#include "heft/host/decompositions.hpp"
#include "moments.hpp"
#include "motion_table.hpp"
#include "peak.hpp"
#include "problem.hpp"
#include "products.hpp"
#include "residual_structure.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MotionTable even_table(Index rows, int joints, double rate, int blocks) {
  MotionTable table;
  table.num_joints = joints;
  table.sample_rate = rate;
  table.runs = {"log"};
  table.run_seconds = {static_cast<double>(rows) / rate};
  table.run_begin = table.section_begin = {0, rows};
  table.time = VectorXd::LinSpaced(rows, 0.0, static_cast<double>(rows - 1) / rate);
  for (MatrixXd* m :
       {&table.q, &table.qd, &table.qdd, &table.tau, &table.direction, &table.standing, &table.resting})
    m->setZero(rows, joints);
  table.keep = MatrixXd::Ones(rows, joints);
  table.scored = VectorXd::Ones(rows);
  table.in_gap = VectorXd::Zero(rows);
  for (int b = 0; b < blocks; ++b) {
    table.blocks.push_back({rows * b / blocks, rows * (b + 1) / blocks - rows * b / blocks, 0, b % 8});
  }
  table.sign_width = VectorXd::Constant(joints, 1e-3);
  return table;
}

// A log whose stamps scatter has other rows as the search places its samples than as it is filed.
TEST(Curves, AreOfTheRowsThatTheTracesHave) {
  Diagnosis diagnosis;
  Traces& traces = diagnosis.validate.emplace_back();
  traces.before = traces.after = MatrixXd::Zero(1010, 2);
  EXPECT_THROW(curves_of(diagnosis, even_table(1000, 2, 100.0, 8)), std::invalid_argument);
  traces.before = traces.after = MatrixXd::Zero(990, 2);
  EXPECT_THROW(curves_of(diagnosis, even_table(1000, 2, 100.0, 8)), std::invalid_argument);
}

TEST(Deflections, FollowTheResonanceOfALinearOscillator) {
  // M ë + D ė + K e = sin(w t) has the steady amplitude 1 / |K - M w² + i D w|.
  const MotionTable table = even_table(20000, 1, 1000.0, 8);
  const double M = 2.0, K = 5000.0, D = 30.0, w = 2.0 * std::numbers::pi * 5.0;
  VectorXd load(table.rows());
  for (Index i = 0; i < table.rows(); ++i) load[i] = std::sin(w * table.time[i]);
  const Deflections e =
      deflections(table, load, VectorXd::Constant(table.rows(), M), VectorXd::Constant(1, K), VectorXd::Constant(1, D),
                  VectorXd::Zero(table.rows()));
  const double amplitude = 1.0 / std::hypot(K - M * w * w, D * w);
  EXPECT_NEAR(e.value.bottomRows(4000).maxCoeff(), amplitude, 2e-3 * amplitude);
  EXPECT_NEAR(e.acceleration.bottomRows(4000).maxCoeff(), w * w * amplitude, 4e-3 * w * w * amplitude);
}

/// M, by its lower part, in every row.
MatrixXd even_inertia(const MotionTable& table, const Eigen::Matrix2d& M) {
  MatrixXd inertia(table.rows(), 4);
  inertia.rowwise() = Eigen::RowVector4d(M(0, 0), std::nan(""), M(1, 0), M(1, 1));
  return inertia;
}

TEST(Deflections, OfTwoJointsThatShareInertiaAreThoseOfTheirModes) {
  // M ë + K e = f cos(w t) from static equilibrium: e = A cos(w t) + Σ φ (φᵀ M (K⁻¹ f - A)) cos(w_i t), (K - w² M) A = f,
  // K φ = w_i² M φ, φᵀ M φ = 1.
  const MotionTable table = even_table(4000, 2, 4000.0, 8);
  Eigen::Matrix2d M;
  M << 2.0, 0.9, 0.9, 0.5;
  const Eigen::Vector2d K(9000.0, 4000.0), f(20.0, -5.0);
  const double w = 2.0 * std::numbers::pi * 9.0;
  const Eigen::Matrix2d stiffness = K.asDiagonal();
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::Matrix2d> modes(stiffness, M);
  const Eigen::Vector2d A = (stiffness - w * w * M).inverse() * f;
  const Eigen::Vector2d part = modes.eigenvectors().transpose() * M * (f.cwiseQuotient(K) - A);
  const VectorXd drive = (w * table.time).array().cos();
  const Deflections e = deflections(table, drive * f.transpose(), even_inertia(table, M), K, VectorXd::Zero(2),
                                    MatrixXd::Zero(table.rows(), 4));
  double largest = 0.0, worst = 0.0;
  for (Index i = 0; i < table.rows(); ++i) {
    const double t = table.time[i];
    const Eigen::Vector2d ringing = part.array() * (t * modes.eigenvalues().array().sqrt()).cos();
    const Eigen::Vector2d exact = A * std::cos(w * t) + modes.eigenvectors() * ringing;
    largest = std::max(largest, exact.cwiseAbs().maxCoeff());
    worst = std::max(worst, (e.value.row(i).transpose() - exact).cwiseAbs().maxCoeff());
  }
  EXPECT_LT(worst, 0.002 * largest) << "second order in the step: 7e-4 at this one";
}

TEST(Deflections, WithoutSharedInertiaAreThoseOfEachJoint) {
  const MotionTable table = even_table(2000, 2, 500.0, 8);
  const Eigen::Vector2d M(2.0, 0.5), K(9000.0, 4000.0), D(30.0, 5.0);
  MatrixXd load(table.rows(), 2);
  for (Index i = 0; i < table.rows(); ++i) load.row(i) << std::sin(20.0 * table.time[i]), std::cos(50.0 * table.time[i]);
  const Deflections both = deflections(table, load, even_inertia(table, M.asDiagonal()), K, D, MatrixXd::Zero(table.rows(), 4));
  for (Index j = 0; j < 2; ++j) {
    const Deflections one = deflections(table, load.col(j), VectorXd::Constant(table.rows(), M[j]), K.segment(j, 1), D.segment(j, 1),
                                        VectorXd::Zero(table.rows()));
    EXPECT_TRUE(both.value.col(j).isApprox(one.value, 1e-12)) << "joint " << j + 1;
    EXPECT_TRUE(both.rate.col(j).isApprox(one.rate, 1e-12)) << "joint " << j + 1;
    EXPECT_TRUE(both.acceleration.col(j).isApprox(one.acceleration, 1e-12)) << "joint " << j + 1;
  }
}

TEST(Deflections, OfAnInertiaThatIsPhysicallyImpossibleThereAreNone) {
  const MotionTable table = even_table(100, 2, 500.0, 8);
  Eigen::Matrix2d M;
  M << 1.0, 1.1, 1.1, 1.0;
  const Deflections none = deflections(table, MatrixXd::Ones(table.rows(), 2), even_inertia(table, M),
                                       Eigen::Vector2d(9000.0, 4000.0), Eigen::Vector2d(1.0, 1.0), MatrixXd::Zero(table.rows(), 4));
  EXPECT_EQ(none.value.rows(), 0);
}

TEST(Table, KnowsWhereTheLowPassLeavesOpenWhenAJointTurnsBack) {
  // qd = t around a turn at constant acceleration: 10 ms of it to either side, but not where it rests.
  MotionTable table = even_table(1001, 1, 1000.0, 8);
  table.qd.col(0) = table.time.array() - 0.5;
  table.qdd.setOnes();
  table.turn_seconds.setConstant(1, 0.01);
  const VectorXd once = table.turns(0, 1.0), twice = table.turns(0, 2.0);
  EXPECT_NEAR(once.sum(), 20.0 - 5.0, 2.0)
      << "two widths of the sign of 1 mrad/s to either side count as rest";
  EXPECT_NEAR(twice.sum(), 40.0 - 5.0, 2.0);
  EXPECT_EQ(once[500], 0.0);
  EXPECT_EQ(once[506], 1.0);
  EXPECT_EQ(once[515], 0.0);
}

TEST(Table, TakesTheMotionOfOneJointFromAnother) {
  MotionTable table = even_table(10, 2, 100.0, 2), other = even_table(10, 2, 100.0, 2);
  table.standing = other.standing = MatrixXd::Zero(10, 2);
  table.turn_seconds.setConstant(2, 0.02);
  other.turn_seconds.setConstant(2, 0.01);
  for (MatrixXd* m : {&other.q, &other.qd, &other.qdd, &other.tau, &other.direction}) m->setOnes();
  table.take_motion(other, 1);
  for (const MatrixXd* m : {&table.q, &table.qd, &table.qdd, &table.direction}) {
    EXPECT_EQ(m->col(0).sum(), 0.0);
    EXPECT_EQ(m->col(1).sum(), 10.0);
  }
  EXPECT_EQ(table.tau.sum(), 0.0) << "the torque is no matter of the low-pass";
  EXPECT_EQ(table.turn_seconds[0], 0.02);
  EXPECT_EQ(table.turn_seconds[1], 0.01);
}

TEST(Problem, SaysWhereTheErrorFalls) {
  // A column that is missing in the first tenth of the rows, and another one in all of them, twice as large in square.
  MotionTable table = even_table(4000, 1, 100.0, 16);
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  Columns columns{{0}, {MatrixXd::Zero(4000, 1)}};
  VectorXd first = VectorXd::Zero(4000);
  first.head(400).setOnes();
  for (Index i = 0; i < 4000; ++i) {
    columns.values[0](i, 0) = i < 400 ? 3.0 * normal(random) : normal(random);
    table.tau(i, 0) = 1.0 + columns.values[0](i, 0) + 0.1 * normal(random);
  }
  const auto rows = std::make_shared<const BaseRows>(BaseRows{MatrixXd(MatrixXd::Ones(4000, 1))});
  const Problem problem(table, table.keep, rows, {{0}}, VectorXd::Zero(1), 1e-8, table.tau);
  const Trial trial = problem.judge(problem.moments(columns));
  ASSERT_TRUE(trial.valid);
  EXPECT_NEAR(problem.part_of_fall(columns, trial, 0, first, VectorXd::Zero(4000)), 0.5, 0.05)
      << "a tenth of the rows, nine times as large";
  EXPECT_NEAR(problem.part_of_fall(columns, trial, 0, VectorXd::Ones(4000), VectorXd::Zero(4000)), 1.0, 1e-12);
}

TEST(Problem, CountsRestsWhereTheErrorFallsThere) {
  // The column takes a third of its gain from the first tenth of the rows, and the joint rests in the second half.
  MotionTable table = even_table(4000, 1, 100.0, 16);
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  Columns columns{{0}, {MatrixXd::NullaryExpr(4000, 1, [&] { return normal(random); })}};
  columns.values[0].topRows(400) *= 2.0;
  for (Index i = 0; i < 4000; ++i) table.tau(i, 0) = 1.0 + columns.values[0](i, 0) + 0.1 * normal(random);
  table.keep.bottomRows(2000).setZero();
  table.resting.bottomRows(2000).setOnes();
  const auto rows = std::make_shared<const BaseRows>(BaseRows{MatrixXd(MatrixXd::Ones(4000, 1))});
  const Problem problem(table, table.keep, rows, {{0}}, VectorXd::Zero(1), 1e-8, table.tau);
  const Trial trial = problem.judge(problem.moments(columns));
  ASSERT_TRUE(trial.valid);
  VectorXd first = VectorXd::Zero(4000), left = VectorXd::Zero(4000);
  first.head(400).setOnes();
  EXPECT_NEAR(problem.part_of_fall(columns, trial, 0, first, left), 0.5, 0.05) << "at rest all is explained before";
  left.tail(2000) = (table.tau.bottomRows(2000).array() - problem.theta()[0]).matrix();
  EXPECT_NEAR(problem.part_of_fall(columns, trial, 0, first, left), 1600.0 / 5200.0, 0.03);
}

TEST(Table, TellsStandstillBesideTheMotionApart) {
  // One joint rests for 3 s at either end, the other one in the middle as well.
  data::Log log;
  log.path = "rests";
  const Index rows = 4000;
  log.time = VectorXd::LinSpaced(rows, 0.0, 19.995);
  log.q.resize(rows, 2);
  log.tau.setOnes(rows, 2);
  const auto bell = [](double t, double from, double to) {
    const double u = std::clamp((t - from) / (to - from), 0.0, 1.0), s = std::sin(std::numbers::pi * u);
    return s * s * s * s * std::sin(5.0 * std::numbers::pi * u);
  };
  for (Index k = 0; k < rows; ++k) {
    const double t = log.time[k];
    log.q(k, 0) = bell(t, 3.0, 17.0);
    log.q(k, 1) = bell(t, 3.0, 8.0) + bell(t, 12.0, 17.0);
  }
  data::StreamOptions options;
  options.motion.cutoff = 6.0;
  options.cut_standstill = false;
  const data::MotionStream stream(log, options);
  const MotionTable table = make_table({&stream}, {false, false}, {});
  int standing = 0, resting = 0;
  for (Index i = 0; i < table.rows(); ++i) {
    const double t = table.time[i];
    for (int j = 0; j < 2; ++j) {
      EXPECT_FALSE(table.keep(i, j) > 0.0 && table.standing(i, j) > 0.0) << t;
      if (t > 0.5 && t < 2.5) {
        EXPECT_EQ(table.standing(i, j), 1.0) << t;
      }
      if (t > 5.0 && t < 15.0) {
        EXPECT_EQ(table.standing(i, j), 0.0) << t;
      }
      standing += table.standing(i, j) > 0.0 ? 1 : 0;
    }
    if (t > 9.0 && t < 11.0) {
      EXPECT_EQ(table.keep(i, 1), 0.0) << "what holds the joint there no friction over speed can say";
      resting += table.resting(i, 1) > 0.0 ? 1 : 0;
    }
    if (t > 6.0 && t < 14.0) {
      EXPECT_EQ(table.resting(i, 0), 0.0) << t;
    }
  }
  EXPECT_GT(standing, 2 * 2 * 400);
  EXPECT_EQ(resting, 399);
}

TEST(Noise, OfThirdDifferencesDoesNotSeeASlowMotion) {
  MotionTable table = even_table(20000, 1, 500.0, 8);
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 0.3);
  MatrixXd residual(table.rows(), 1);
  for (Index i = 0; i < table.rows(); ++i)
    residual(i, 0) = 5.0 * std::sin(7.0 * table.time[i]) + noise(random);
  EXPECT_NEAR(white_noise(table, table.keep, residual)[0], 0.3, 0.01);
}

/// Base of a constant and a ramp on one joint, torque with noise.
struct Small {
  MotionTable table = even_table(4000, 1, 100.0, 40);
  MatrixXd rows{4000, 2};
  MatrixXd tau{4000, 1};
  VectorXd column{4000};

  Small(double size, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0.0, 1.0);
    for (Index i = 0; i < 4000; ++i) {
      rows(i, 0) = 1.0;
      rows(i, 1) = table.time[i];
      column[i] = std::sin(1.7 * table.time[i]);
      tau(i, 0) = 2.0 - 0.1 * table.time[i] + size * column[i] + noise(random);
    }
  }
  std::shared_ptr<const BaseRows> shared_rows() const {
    return std::make_shared<const BaseRows>(BaseRows{rows});
  }
  Problem problem() const {
    return {table, table.keep, shared_rows(), {{0, 1}}, VectorXd::Zero(2), 1e-9, tau};
  }
};

TEST(Problem, CandidateIsFittedTogetherWithTheBase) {
  const Small data(0.8, 1);
  const Problem problem = data.problem();
  const Trial trial = problem.judge(problem.moments({{0}, {data.column}}));
  // Ordinary least squares over all three columns.
  MatrixXd A(4000, 3);
  A << data.rows, data.column;
  const VectorXd x = least_squares(A, data.tau.col(0));
  EXPECT_NEAR(trial.coefficients[0], x[2], 1e-6);
  EXPECT_NEAR(trial.std[0], std::sqrt(2.0 / 4000.0), 0.008);
  EXPECT_GT(trial.cv_gain, 500.0);
  EXPECT_LT(trial.p_value, 1e-12);
}

TEST(Problem, LeftOutErrorIsThatOfFitsWithoutTheFold) {
  const Small data(0.8, 2);
  const Problem problem = data.problem();
  const Trial trial = problem.judge(problem.moments({{0}, {data.column}}));
  double before = 0.0, after = 0.0;
  for (int fold = 0; fold < 8; ++fold) {
    MatrixXd A(0, 3);
    VectorXd y(0);
    for (const Block& b : data.table.blocks) {
      if (b.fold == fold) continue;
      A.conservativeResize(A.rows() + b.count, 3);
      y.conservativeResize(y.size() + b.count);
      A.bottomRows(b.count) << data.rows.middleRows(b.begin, b.count), data.column.segment(b.begin, b.count);
      y.tail(b.count) = data.tau.col(0).segment(b.begin, b.count);
    }
    const VectorXd with = least_squares(A, y);
    const MatrixXd A0 = A.leftCols(2);
    const VectorXd without = least_squares(A0, y);
    for (const Block& b : data.table.blocks) {
      if (b.fold != fold) continue;
      MatrixXd X(b.count, 3);
      X << data.rows.middleRows(b.begin, b.count), data.column.segment(b.begin, b.count);
      const VectorXd t = data.tau.col(0).segment(b.begin, b.count);
      after += (t - X * with).squaredNorm();
      before += (t - X.leftCols(2) * without).squaredNorm();
    }
  }
  EXPECT_NEAR(trial.joint_before[0], before, 1e-3);
  EXPECT_NEAR(trial.joint_after[0], after, 1e-3);
}

TEST(Problem, GainsOfManyAreThoseOfEach) {
  const Small data(0.8, 3);
  const Problem problem = data.problem();
  const VectorXd other = data.column.array().square();
  const auto write = [&](Index from, Eigen::Ref<MatrixXd> values) {
    values << data.column.segment(from, values.rows()), other.segment(from, values.rows());
  };
  const WideMoments wide = problem.wide_moments(0, 2, 1, write);
  const std::vector<double> both = problem.gains({&wide, 1});
  EXPECT_NEAR(both[0], problem.gain(problem.moments({{0}, {data.column}})), 1e-9 * both[0]);
  EXPECT_NEAR(both[1], problem.gain(problem.moments({{0}, {other}})), 1e-6);
  EXPECT_GT(both[0], 100.0 * both[1]);
}

TEST(Problem, MomentsFromARowAreThoseOfColumnsThatBeginThere) {
  const Small data(0.8, 4);
  const Problem problem = data.problem();
  const Columns whole{{0}, {data.column}};
  const ColumnMoments all = problem.moments(whole);
  for (const Index row : {0, 1, 99, 100, 101, 1234, 3999}) {
    Columns late = whole;
    late.values[0].topRows(row).setZero();
    const Trial expected = problem.judge(problem.moments(late));
    const Trial found = problem.judge(problem.moments_from(row, whole, all));
    EXPECT_NEAR(found.gain, expected.gain, 1e-6) << row;
    EXPECT_NEAR(found.coefficients[0], expected.coefficients[0], 1e-9) << row;
  }
}

TEST(Problem, HeldColumnsStayWhereThePriorHasThem) {
  const Small data(0.8, 5);
  const VectorXd prior = (VectorXd(2) << 0.0, -0.25).finished(), hold = (VectorXd(2) << 0.0, 1e6).finished();
  const Problem problem(data.table, data.table.keep, data.shared_rows(), {{0, 1}}, prior, 1e-9, data.tau,
                        hold);
  EXPECT_NEAR(problem.theta()[1], -0.25, 1e-6);
  // The constant makes the best of it: the mean of what the ramp leaves.
  const double left = (data.tau.col(0) + 0.25 * data.rows.col(1)).mean();
  EXPECT_NEAR(problem.theta()[0], left, 1e-3);
}

/// Numbers that a problem holds, one after the other.
VectorXd numbers_of(const Problem& problem, const VectorXd& column) {
  const Trial trial = problem.judge(problem.moments({{0}, {column}}));
  VectorXd all(problem.theta().size() + 4);
  all << problem.theta(), problem.noise()[0], trial.gain, trial.cv_gain, trial.coefficients[0];
  return all;
}

TEST(Problem, AppendedAndReplacedColumnsAreAsIfTheyHadBeenTheBases) {
  const Small data(0.8, 6);
  MatrixXd keep = data.table.keep;
  keep.middleRows(700, 250).setZero();
  const VectorXd other = data.column.array().square(), tried = (0.9 * data.table.time.array()).sin();
  BaseRows whole{MatrixXd(4000, 3)};
  whole[0] << data.rows.col(0), other, data.column;
  Problem expected(data.table, keep, std::make_shared<const BaseRows>(whole), {{0, 1, 2}}, VectorXd::Zero(3),
                   1e-9, data.tau);
  Problem found(data.table, keep, data.shared_rows(), {{0, 1}}, VectorXd::Zero(2), 1e-9, data.tau);
  EXPECT_EQ(found.append({{0}, {data.column}}), 2);
  found.replace(0, 1, data.column);  // what is replaced twice holds the last values
  found.replace(0, 1, other);
  found.reweight();
  expected.reweight();
  const VectorXd a = numbers_of(expected, tried), b = numbers_of(found, tried);
  EXPECT_LT((a - b).cwiseAbs().maxCoeff(), 1e-7 * a.cwiseAbs().maxCoeff()) << a.transpose();
  EXPECT_LT((expected.residual() - found.residual()).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(Problem, WhatIsTakenFromAnotherProblemIsAsIfItHadBeenCollected) {
  const Small data(0.8, 7);
  MatrixXd keep = data.table.keep;
  keep.middleRows(700, 250).setZero();
  const auto rows = data.shared_rows();
  const VectorXd prior = (VectorXd(2) << 1.0, -0.25).finished(), hold = (VectorXd(2) << 0.0, 1.0).finished();
  const Problem like(data.table, data.table.keep, rows, {{0, 1}}, VectorXd::Zero(2), 1e-9, data.tau);
  const Problem expected(data.table, keep, rows, {{0, 1}}, prior, 1e-9, data.tau, hold);
  const Problem found(data.table, keep, rows, {{0, 1}}, prior, 1e-9, data.tau, hold, &like);
  EXPECT_EQ(numbers_of(expected, data.column), numbers_of(found, data.column));  // to the last bit
}

TEST(Products, AreThoseOfTheFactorsWhateverTheirShape) {
  std::mt19937 random(8);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  const MatrixXd all = MatrixXd::NullaryExpr(1200, 20, [&] { return any(random); });
  for (const Index rows : {0, 1, 3, 4, 7, 255, 256, 600}) {
    for (const Index p : {1, 3, 4, 5, 11}) {
      const auto A = all.block(5, 1, rows, p);
      for (const Index k : {1, 2, 5, 8}) {
        const auto B = all.block(600, 12, rows, k);
        EXPECT_LT((transposed_times(A, B) - A.transpose() * B).cwiseAbs().maxCoeff(), 1e-12)
            << rows << p << k;
      }
      EXPECT_EQ(gram_of(A), transposed_times(A, A)) << rows << p;  // to the last bit
    }
  }
}

TEST(Moments, FitBesideAFactoredBaseIsThatOfAllColumns) {
  std::mt19937 random(9);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  constexpr Index p = 7, k = 2;
  const double steady = 1e-3;
  const VectorXd ridge = VectorXd::Constant(p, 0.2);
  MatrixXd all = MatrixXd::NullaryExpr(200, p + k + 1, [&] { return any(random); });
  all.col(3) *= 1e4;                                  // other units
  all.col(p) = all.col(0) + 1e-3 * all.col(p);        // next to what the base explains
  const MatrixXd moments = all.transpose() * all;
  MatrixXd base(p + 1, p + 1);
  base << moments.topLeftCorner(p, p), moments.col(p + k).head(p), moments.row(p + k).head(p), moments(p + k, p + k);
  const Added candidate{moments.block(0, p, p, k), moments.block(p, p, k, k), moments.col(p + k).segment(p, k)};
  const VectorXd norm = moments.diagonal().head(p + k).cwiseSqrt();
  for (const int without : {-1, 4}) {
    MatrixXd A = moments.topLeftCorner(p + k, p + k).array() / (norm * norm.transpose()).array();
    A.diagonal().array() += steady;
    A.diagonal().head(p) += ridge;
    if (without >= 0) A(without, without) += 1e12;
    const MatrixXd inverse = A.fullPivLu().inverse().array() / (norm * norm.transpose()).array();
    const VectorXd right = moments.col(p + k).head(p + k), theta = inverse * right;
    const Factored factors = factored(base, without, steady, ridge);
    const Solved found = solve_beside(factors, candidate, steady);
    EXPECT_LT(((found.theta - theta).array() * norm.array()).abs().maxCoeff(), 1e-9 * norm.cwiseProduct(theta).norm());
    EXPECT_NEAR(found.error, moments(p + k, p + k) - right.dot(theta), 1e-9 * moments(p + k, p + k));
    EXPECT_DOUBLE_EQ(error_beside(factors, candidate, steady), found.error);
    EXPECT_LT((found.inverse - inverse.rightCols(k)).cwiseAbs().maxCoeff(), 1e-9 * inverse.rightCols(k).cwiseAbs().maxCoeff());
    const VectorXd alone = theta_of(factors), residual = all.col(p + k) - all.leftCols(p) * alone;
    EXPECT_LT((alone - solve(base, without, steady, ridge).theta).norm(), 1e-12 * alone.norm());
    // Normal equations of the base alone, with what steadies it.
    VectorXd held = ridge.array() + steady;
    if (without >= 0) held[without] += 1e12;
    const VectorXd left = all.leftCols(p).transpose() * residual - held.cwiseProduct(norm.head(p).cwiseAbs2()).cwiseProduct(alone);
    EXPECT_LT(left.cwiseQuotient(norm.head(p)).norm(), 1e-6 * all.col(p + k).norm());
  }
}

TEST(Evidence, HoldsWhileThePredictedTorqueChangesByLessThanAFiftiethOfTheResidual) {
  const Small data(0.8, 10);
  const Problem problem = data.problem();
  const VectorXd residual = problem.residual().col(0);
  EXPECT_NEAR(problem.squares_of(0), residual.squaredNorm(), 1e-9 * residual.squaredNorm());
  const Present before{data.tau - residual, problem.counted()};
  const auto changed = [&](double part, const VectorXd& counted) {
    return !hardly_changed(problem, before, {before.predicted + part * residual, counted}, 0);
  };
  EXPECT_FALSE(changed(0.0, problem.counted()));
  EXPECT_FALSE(changed(-0.019, problem.counted()));
  EXPECT_TRUE(changed(0.021, problem.counted()));
  EXPECT_TRUE(changed(0.0, problem.counted().array() - 1.0));  // other rows count
  EXPECT_FALSE(hardly_changed(problem, before, {before.predicted, before.counted, false, true}, 0));
}

TEST(Peak, OfAParabolaIsItsVertexWhereverItWasLookedAt) {
  const auto parabola = [](double x) { return 4.0 - 3.0 * (x - 0.7) * (x - 0.7); };
  for (const double right : {1.1, 1.5, 5.0}) {
    Peak peak;
    for (const double x : {right, -1.0, 0.4}) peak.add(x, parabola(x));
    EXPECT_NEAR(peak.vertex(), 0.7, 1e-12);
  }
}

TEST(Peak, OfASmoothCurveIsFoundByTwoLooksToAThousandthOfTheInterval) {
  // Skewed as a gain over the logarithm of a frequency is.
  const auto curve = [](double x) { return std::exp(x) / std::pow(1.0 + std::exp(2.0 * (x - 0.3)), 2.0); };
  const double truth = 0.3 - 0.5 * std::log(3.0);  // e^x (1 + u - 4 u) = 0, u = e^(2 (x - 0.3))
  Peak peak;
  const double width = 1.0, step = width / 6.0;
  for (int k = 0; k < 7; ++k) peak.add(-0.6 + k * step, curve(-0.6 + k * step));
  const double first = peak.vertex();
  for (const double x : {first - step / 4.0, first, first + step / 4.0}) peak.add(x, curve(x));
  EXPECT_NEAR(peak.vertex(), truth, 1e-3 * width);
}

TEST(Peak, IsTheBestPlaceItselfAtTheEndAndWhereAllAreAlike) {
  Peak rising;
  for (const double x : {1.0, 2.0, 3.0}) rising.add(x, x * x);
  EXPECT_EQ(rising.vertex(), 3.0);
  Peak flat;
  for (const double x : {2.0, 1.0, 3.0}) flat.add(x, 0.0);
  EXPECT_EQ(flat.vertex(), 2.0);
  Peak once;
  once.add(2.0, -1.0);
  EXPECT_EQ(once.vertex(), 2.0);
}

TEST(Problem, ChanceIsCalledChance) {
  // Nineteen of twenty candidates that are nothing have p above 0.05, as a p-value should.
  int below = 0;
  for (unsigned seed = 1; seed <= 200; ++seed) {
    const Small data(0.0, seed);
    const Problem problem = data.problem();
    below += problem.judge(problem.moments({{0}, {data.column}})).p_value < 0.05;
  }
  EXPECT_GE(below, 3);
  EXPECT_LE(below, 20);
}

TEST(Problem, ColumnThatTheBaseExplainsIsNotJudged) {
  const Small data(0.8, 3);
  const Problem problem = data.problem();
  EXPECT_FALSE(problem.judge(problem.moments({{0}, {2.0 * data.rows.col(1)}})).valid);
}

}  // namespace
}  // namespace heft::diagnose
