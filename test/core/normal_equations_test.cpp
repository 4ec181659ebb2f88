#include "heft/core/estimate/normal_equations.hpp"

#include <random>

#include <gtest/gtest.h>
#include <Eigen/Core>

#include "heft/core/estimate/covariance_recursion.hpp"
#include "heft/core/estimate/factored_equations.hpp"
#include "heft/core/estimate/staged_solver.hpp"
#include "heft/host/decompositions.hpp"
#include "support/terminal_link_run.hpp"

namespace heft {
namespace {

using Layout = TerminalLayout<test::Arm6, 4>;
constexpr int kP = Layout::kParameters;
using Row = std::array<double, kP>;

/// Rows, instruments and measurements of a run, and the batch system by Eigen.
struct Problem {
  struct Sample {
    TerminalRows<double, Layout> w, z;
    std::array<double, 2> y;
  };
  std::vector<Sample> samples;
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(kP, kP), symmetric = Eigen::MatrixXd::Zero(kP, kP);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(kP), symmetric_right = Eigen::VectorXd::Zero(kP);

  explicit Problem(int count, double precision = 0.0, const Row& prior = {}) {
    for (const auto& s : test::terminal_link_run(count, 10.0, 3)) {
      std::array<TerminalRows<double, Layout>, 2> rows{};
      terminal_rows<test::Arm6, 4, 2>(terminal_trigonometry<test::Arm6, 4>(s.q), s.q, s.qd,
                                      {s.measured, s.qdd}, 0.0, rows);
      samples.push_back({rows[0], rows[1], {s.tau[4], s.tau[5]}});
      for (std::size_t r = 0; r < 2; ++r) {
        const Eigen::Map<const Eigen::VectorXd> w(rows[0][r].data(), kP), z(rows[1][r].data(), kP);
        matrix += z * w.transpose();
        right += z * samples.back().y[r];
        symmetric += w * w.transpose();
        symmetric_right += w * samples.back().y[r];
      }
    }
    const Eigen::Map<const Eigen::VectorXd> x0(prior.data(), kP);
    matrix.diagonal().array() += precision;
    symmetric.diagonal().array() += precision;
    right += precision * x0;
    symmetric_right += precision * x0;
  }

  template <typename Equations>
  void add_to(Equations& equations) const {
    for (const auto& s : samples) {
      for (int r = 0; r < 2; ++r) {
        const std::size_t i = static_cast<std::size_t>(r);
        equations.add(r, s.z[i], s.w[i], s.y[i]);
      }
    }
  }
};

double difference(const Row& a, const Eigen::VectorXd& b) {
  return (Eigen::Map<const Eigen::VectorXd>(a.data(), kP) - b).cwiseAbs().maxCoeff() /
         b.cwiseAbs().maxCoeff();
}

TEST(NormalEquations, AccumulateTheBatchMatrixWithoutItsStructuralZeros) {
  const Problem problem(400);
  NormalEquations<double, Layout> equations;
  equations.reset({}, {});
  problem.add_to(equations);
  for (int i = 0; i < kP; ++i) {
    for (int j = 0; j < kP; ++j) {
      EXPECT_NEAR(equations.matrix()[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)],
                  problem.matrix(i, j), 1e-10 * problem.matrix.cwiseAbs().maxCoeff())
          << i << ", " << j;
    }
  }
}

TEST(NormalEquations, TakeTheRowsOfASampleTogetherAsOneByOne) {
  const Problem problem(400);
  NormalEquations<double, Layout> one_by_one, together;
  one_by_one.reset({}, {});
  together.reset({}, {});
  problem.add_to(one_by_one);
  for (const auto& s : problem.samples) together.add(s.z, s.w, s.y);
  EXPECT_EQ(one_by_one.matrix(), together.matrix()) << "to the last bit: the sums have the same order";
  EXPECT_EQ(one_by_one.right_side(), together.right_side());
}

TEST(StagedSolver, SolvesTheInstrumentalSystemInSmallPieces) {
  const Problem problem(600);
  NormalEquations<double, Layout> equations;
  equations.reset({}, {});
  problem.add_to(equations);
  StagedSolver<double, Layout> solver;
  solver.start(equations.matrix(), equations.right_side(), false);
  int calls = 0;
  while (!solver.advance(50)) {
    ++calls;
    ASSERT_LT(calls, 60) << "the stated total work does not suffice";
  }
  EXPECT_GT(calls, 20) << "a solve in one piece is no staged solve";
  ASSERT_EQ(solver.status(), Status::kOk);
  EXPECT_LT(difference(solver.solution(), solve_square(problem.matrix, problem.right)), 1e-10);
}

TEST(StagedSolver, SolvesLeastSquaresFromTheUpperTriangle) {
  const Problem problem(600);
  NormalEquations<double, Layout> equations;
  equations.reset({}, {});
  for (const auto& s : problem.samples) {
    for (int r = 0; r < 2; ++r) {
      equations.add_symmetric(r, s.w[static_cast<std::size_t>(r)], s.y[static_cast<std::size_t>(r)]);
    }
  }
  StagedSolver<double, Layout> solver;
  solver.start(equations.matrix(), equations.right_side(), true);
  while (!solver.advance(1000)) {
  }
  ASSERT_EQ(solver.status(), Status::kOk);
  EXPECT_LT(difference(solver.solution(), solve_symmetric(problem.symmetric, problem.symmetric_right)), 1e-10);
}

TEST(StagedSolver, AmplificationIsTheVarianceInflationOfANearlyDependentPair) {
  // Two columns with correlation ρ: 1 − R² = 1 − ρ².
  using Pair = DenseLayout<2>;
  for (const double rho : {0.0, 0.9, 0.999}) {
    StagedSolver<double, Pair> solver;
    solver.start({{{4.0, rho * 2.0 * 3.0}, {rho * 2.0 * 3.0, 9.0}}}, {1.0, 2.0}, false);
    while (!solver.advance(10)) {
    }
    ASSERT_EQ(solver.status(), Status::kOk);
    EXPECT_NEAR(solver.amplification(), 1.0 / (1.0 - rho * rho), 1e-9 / (1.0 - rho));
  }
}

TEST(StagedSolver, SaysSingularWhenAParameterWasNeverSeen) {
  using Pair = DenseLayout<2>;
  StagedSolver<double, Pair> solver;
  solver.start({{{4.0, 0.0}, {0.0, 0.0}}}, {1.0, 0.0}, false);
  while (!solver.advance(10)) {
  }
  EXPECT_EQ(solver.status(), Status::kSingular);
}

TEST(FactoredEquations, EqualTheBatchAfterEveryFewRows) {
  const Row prior = test::true_layout_parameters<4>(false);
  const Problem all(900);
  FactoredEquations<double, Layout, false> factored;
  NormalEquations<double, Layout> head;
  head.reset(prior, {});
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(kP, kP);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(kP);
  int n = 0;
  for (const auto& s : all.samples) {
    for (int r = 0; r < 2; ++r) {
      const std::size_t i = static_cast<std::size_t>(r);
      const Eigen::Map<const Eigen::VectorXd> w(s.w[i].data(), kP), z(s.z[i].data(), kP);
      matrix += z * w.transpose();
      right += z * s.y[i];
      if (n < 500) {
        head.add(r, s.z[i], s.w[i], s.y[i]);
      } else {
        ASSERT_EQ(factored.add(r, s.z[i], s.w[i], s.y[i]), Status::kOk);
      }
    }
    ++n;
    if (n == 500) {
      ASSERT_EQ(factored.start(head.matrix(), head.right_side(), false), Status::kOk);
    }
    if (n > 500 && n % 50 == 0) {
      EXPECT_LT(difference(factored.solution(), solve_square(matrix, right)), 1e-8) << "sample " << n;
    }
  }
}

TEST(FactoredEquations, RefuseToStartFromAMatrixWithoutPositivePivots) {
  FactoredEquations<double, DenseLayout<2>, false> factored;
  EXPECT_EQ(factored.start({{{1.0, 2.0}, {2.0, 1.0}}}, {0.0, 0.0}, false), Status::kSingular);
}

TEST(CovarianceRecursion, EqualsTheRegularisedBatchForm) {
  // core/estimate/README.md, section 5: equal to (P0⁻¹ + Σ ẑ w)⁻¹ (P0⁻¹ x0 + Σ ẑ y).
  const Row prior = test::true_layout_parameters<4>(false);
  constexpr double kPrecision = 0.1;
  const Problem problem(600, kPrecision, prior);
  CovarianceRecursion<double, Layout> recursion;
  Row variance;
  variance.fill(1.0 / kPrecision);
  recursion.reset(prior, variance);
  for (const auto& s : problem.samples) {
    for (int r = 0; r < 2; ++r) {
      const std::size_t i = static_cast<std::size_t>(r);
      ASSERT_EQ(recursion.add(r, s.z[i], s.w[i], s.y[i]), Status::kOk);
    }
  }
  EXPECT_LT(difference(recursion.solution(), solve_square(problem.matrix, problem.right)), 1e-8);
}

}  // namespace
}  // namespace heft
