// What elastic joints do along a motion, and what changes of their numbers do to that.
#include "deflection.hpp"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kSteps = 900, kSecondRun = 500;

/// Two runs at 1 kHz.
MotionTable two_runs() {
  MotionTable table;
  table.sample_rate = 1000.0;
  table.time = VectorXd::LinSpaced(kSteps, 0.0, (kSteps - 1) / table.sample_rate);
  table.time.tail(kSteps - kSecondRun).array() -= table.time[kSecondRun];
  table.run_begin = {0, kSecondRun, kSteps};
  table.section_begin = table.run_begin;
  return table;
}

/// k joints that share inertia, which changes along the motion, and loads of several frequencies.
struct Arm {
  explicit Arm(Index k) : load(kSteps, k), inertia(kSteps, k * k), stiffness(k), damping(k) {
    for (Index a = 0; a < k; ++a) {
      stiffness[a] = 900.0 / (1.0 + static_cast<double>(a));
      damping[a] = 1.5 / (1.0 + static_cast<double>(a));
      for (Index i = 0; i < kSteps; ++i) {
        const double t = 1e-3 * static_cast<double>(i);
        load(i, a) = 20.0 * std::sin(9.0 * t + static_cast<double>(a)) + 5.0 * std::cos(31.0 * t);
        for (Index b = 0; b < k; ++b) inertia(i, a * k + b) = (a == b ? 1.2 : 0.3) * (1.0 + 0.2 * std::sin(5.0 * t));
      }
    }
  }
  Deflections deflected(const MotionTable& table) const { return deflections(table, load, inertia, stiffness, damping); }
  MatrixXd load, inertia;
  VectorXd stiffness, damping;
};

class ElasticJoints : public testing::TestWithParam<int> {};

TEST_P(ElasticJoints, ObeyTheirEquationOfMotionInEveryRow) {
  const Index k = GetParam();
  const Arm arm(k);
  const Deflections d = arm.deflected(two_runs());
  for (Index i = 0; i < kSteps; ++i) {
    const MatrixXd M = arm.inertia.row(i).reshaped(k, k);
    const VectorXd left = M * d.acceleration.row(i).transpose() + arm.damping.cwiseProduct(d.rate.row(i).transpose()) +
                          arm.stiffness.cwiseProduct(d.value.row(i).transpose()) - arm.load.row(i).transpose();
    EXPECT_LT(left.norm(), 1e-10) << "row " << i;
  }
}

TEST_P(ElasticJoints, BeginEachRunInStaticEquilibrium) {
  const Arm arm(GetParam());
  const Deflections d = arm.deflected(two_runs());
  for (const Index i : {Index{0}, kSecondRun}) {
    EXPECT_LT((d.value.row(i).transpose() - arm.load.row(i).transpose().cwiseQuotient(arm.stiffness)).norm(), 1e-12);
    EXPECT_EQ(d.rate.row(i).norm(), 0.0);
  }
}

/// What a fit of stiffness and damping takes as slopes, against differences of deflections with other numbers.
TEST_P(ElasticJoints, HaveTheSlopesOfTheirAccelerationsByStiffnessAndDamping) {
  const Index k = GetParam();
  const Arm arm(k);
  const MotionTable table = two_runs();
  const Deflections d = arm.deflected(table);
  // M ẍ + D ẋ + K x = -K e, -D ė in the row of the joint.
  std::vector<MatrixXd> loads(static_cast<std::size_t>(k), MatrixXd::Zero(kSteps, 2 * k));
  for (Index b = 0; b < k; ++b) {
    loads[static_cast<std::size_t>(b)].col(2 * b) = -arm.stiffness[b] * d.value.col(b);
    loads[static_cast<std::size_t>(b)].col(2 * b + 1) = -arm.damping[b] * d.rate.col(b);
  }
  const auto slopes = deflection_accelerations(table, loads, arm.inertia, arm.stiffness, arm.damping);
  ASSERT_EQ(slopes.size(), static_cast<std::size_t>(k));
  constexpr double kStep = 1e-4;  // of the logarithm
  for (Index p = 0; p < 2 * k; ++p) {
    Arm more = arm, less = arm;
    (p % 2 == 0 ? more.stiffness : more.damping)[p / 2] *= std::exp(kStep);
    (p % 2 == 0 ? less.stiffness : less.damping)[p / 2] *= std::exp(-kStep);
    const MatrixXd difference =
        (more.deflected(table).acceleration - less.deflected(table).acceleration) / (2.0 * kStep);
    for (Index b = 0; b < k; ++b) {
      EXPECT_LT((slopes[static_cast<std::size_t>(b)].col(p) - difference.col(b)).norm(), 1e-6 * difference.norm())
          << "parameter " << p << ", joint " << b;
    }
  }
}

TEST_P(ElasticJoints, DeflectByManyLoadsAsByEachAlone) {
  const Index k = GetParam(), count = 11;  // more than go side by side, and no multiple of it
  const Arm arm(k);
  const MotionTable table = two_runs();
  std::vector<MatrixXd> loads(static_cast<std::size_t>(k), MatrixXd(kSteps, count));
  for (Index b = 0; b < k; ++b) {
    for (Index c = 0; c < count; ++c)
      loads[static_cast<std::size_t>(b)].col(c) = (1.0 + static_cast<double>(c)) * arm.load.col((b + c) % k);
  }
  const auto together = deflection_accelerations(table, loads, arm.inertia, arm.stiffness, arm.damping);
  for (Index c = 0; c < count; ++c) {
    Arm alone = arm;
    for (Index b = 0; b < k; ++b) alone.load.col(b) = loads[static_cast<std::size_t>(b)].col(c);
    const MatrixXd found = alone.deflected(table).acceleration;
    for (Index b = 0; b < k; ++b)
      EXPECT_LT((together[static_cast<std::size_t>(b)].col(c) - found.col(b)).norm(), 1e-12 * (1.0 + found.norm()));
  }
}

TEST_P(ElasticJoints, DoNotDeflectWithAnInertiaThatIsPhysicallyImpossible) {
  const Index k = GetParam();
  Arm arm(k);
  arm.inertia(700, 0) = -0.1;
  EXPECT_EQ(arm.deflected(two_runs()).value.rows(), 0);
  const std::vector<MatrixXd> loads(static_cast<std::size_t>(k), MatrixXd::Ones(kSteps, 3));
  EXPECT_TRUE(deflection_accelerations(two_runs(), loads, arm.inertia, arm.stiffness, arm.damping).empty());
}

INSTANTIATE_TEST_SUITE_P(Numbers, ElasticJoints, testing::Values(1, 2, 3));

/// Closed form: x = f/K (1 - e^{-ζωt} (cos ω't + ζω/ω' sin ω't)) after a step of the load.
TEST(ElasticJoint, SwingsAfterAStepAsTheClosedFormSays) {
  MotionTable table = two_runs();
  table.run_begin = table.section_begin = {0, kSteps};
  const double M = 2.0, K = 800.0, D = 4.0, f = 30.0, h = 1e-3;
  VectorXd load = VectorXd::Constant(kSteps, f);
  load[0] = 0.0;
  const Deflections d = deflections(table, load, VectorXd::Constant(kSteps, M), VectorXd::Constant(1, K), VectorXd::Constant(1, D));
  const double omega = std::sqrt(K / M), zeta = D / (2.0 * std::sqrt(K * M)), damped = omega * std::sqrt(1.0 - zeta * zeta);
  for (Index i = 1; i < kSteps; ++i) {
    const double t = h * (static_cast<double>(i) - 0.5);  // the step lies between the first two rows
    const double x = f / K * (1.0 - std::exp(-zeta * omega * t) * (std::cos(damped * t) + zeta * omega / damped * std::sin(damped * t)));
    EXPECT_NEAR(d.value(i, 0), x, 1e-3 * f / K) << "row " << i;
  }
}

}  // namespace
}  // namespace heft::diagnose
