// What elastic joints do along a motion, and what changes of their numbers do to that.
#include "deflection.hpp"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "heft/model/dynamics.hpp"
#include "support/arms.hpp"

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

/// k joints that share inertia, which changes along the motion, and loads of several frequencies. What a deflection changes of the
/// load is a fifth of the softest spring, and not the same from joint a to b as back.
struct Arm {
  explicit Arm(Index k) : load(kSteps, k), inertia(kSteps, k * k), slope(kSteps, k * k), stiffness(k), damping(k) {
    for (Index a = 0; a < k; ++a) {
      stiffness[a] = 900.0 / (1.0 + static_cast<double>(a));
      damping[a] = 1.5 / (1.0 + static_cast<double>(a));
      for (Index i = 0; i < kSteps; ++i) {
        const double t = 1e-3 * static_cast<double>(i);
        load(i, a) = 20.0 * std::sin(9.0 * t + static_cast<double>(a)) + 5.0 * std::cos(31.0 * t);
        for (Index b = 0; b < k; ++b) {
          inertia(i, a * k + b) = (a == b ? 1.2 : 0.3) * (1.0 + 0.2 * std::sin(5.0 * t));
          slope(i, a * k + b) = 60.0 * std::cos(4.0 * t + static_cast<double>(a + 2 * b));
        }
      }
    }
  }
  Deflections deflected(const MotionTable& table) const { return deflections(table, load, inertia, stiffness, damping, slope); }
  /// K + G
  MatrixXd stiffness_in(Index i) const {
    const Index k = stiffness.size();
    return stiffness.asDiagonal().toDenseMatrix() + slope.row(i).reshaped(k, k).transpose();
  }
  MatrixXd load, inertia, slope;
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
                          arm.stiffness_in(i) * d.value.row(i).transpose() - arm.load.row(i).transpose();
    // Within a step the slope is that of a motion without the step's change of the acceleration.
    const double left_out = 0.25e-6 * arm.slope.row(i).norm() * d.acceleration.row(i).norm();
    EXPECT_LT(left.norm(), 1e-10 + left_out) << "row " << i;
  }
}

TEST_P(ElasticJoints, BeginEachRunInStaticEquilibrium) {
  const Arm arm(GetParam());
  const Deflections d = arm.deflected(two_runs());
  for (const Index i : {Index{0}, kSecondRun}) {
    EXPECT_LT((arm.stiffness_in(i) * d.value.row(i).transpose() - arm.load.row(i).transpose()).norm(), 1e-12);
    EXPECT_EQ(d.rate.row(i).norm(), 0.0);
  }
}

/// What a fit of stiffness and damping takes as slopes, against differences of deflections with other numbers.
TEST_P(ElasticJoints, HaveTheirSlopesByStiffnessAndDamping) {
  const Index k = GetParam();
  const Arm arm(k);
  const MotionTable table = two_runs();
  const Deflections d = arm.deflected(table);
  // M ẍ + D ẋ + (K + G) x = -K e, -D ė in the row of the joint.
  std::vector<MatrixXd> loads(static_cast<std::size_t>(k), MatrixXd::Zero(kSteps, 2 * k));
  for (Index b = 0; b < k; ++b) {
    loads[static_cast<std::size_t>(b)].col(2 * b) = -arm.stiffness[b] * d.value.col(b);
    loads[static_cast<std::size_t>(b)].col(2 * b + 1) = -arm.damping[b] * d.rate.col(b);
  }
  const auto slopes = deflections_by_loads(table, loads, arm.inertia, arm.stiffness, arm.damping, arm.slope);
  ASSERT_EQ(slopes.size(), static_cast<std::size_t>(k));
  constexpr double kStep = 1e-4;  // of the logarithm
  for (Index p = 0; p < 2 * k; ++p) {
    Arm more = arm, less = arm;
    (p % 2 == 0 ? more.stiffness : more.damping)[p / 2] *= std::exp(kStep);
    (p % 2 == 0 ? less.stiffness : less.damping)[p / 2] *= std::exp(-kStep);
    const Deflections there = more.deflected(table), back = less.deflected(table);
    const MatrixXd accelerations = (there.acceleration - back.acceleration) / (2.0 * kStep);
    const MatrixXd values = (there.value - back.value) / (2.0 * kStep);
    for (Index b = 0; b < k; ++b) {
      const ManyDeflections& slope = slopes[static_cast<std::size_t>(b)];
      EXPECT_LT((slope.acceleration.col(p) - accelerations.col(b)).norm(), 1e-6 * accelerations.norm())
          << "parameter " << p << ", joint " << b;
      EXPECT_LT((slope.value.col(p) - values.col(b)).norm(), 1e-6 * values.norm()) << "parameter " << p << ", joint " << b;
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
  const auto together = deflections_by_loads(table, loads, arm.inertia, arm.stiffness, arm.damping, arm.slope);
  for (Index c = 0; c < count; ++c) {
    Arm alone = arm;
    for (Index b = 0; b < k; ++b) alone.load.col(b) = loads[static_cast<std::size_t>(b)].col(c);
    const Deflections found = alone.deflected(table);
    for (Index b = 0; b < k; ++b) {
      const ManyDeflections& one = together[static_cast<std::size_t>(b)];
      EXPECT_LT((one.acceleration.col(c) - found.acceleration.col(b)).norm(), 1e-12 * (1.0 + found.acceleration.norm()));
      EXPECT_LT((one.value.col(c) - found.value.col(b)).norm(), 1e-12 * (1.0 + found.value.norm()));
    }
  }
}

TEST_P(ElasticJoints, DoNotDeflectWithAnInertiaThatIsPhysicallyImpossible) {
  const Index k = GetParam();
  Arm arm(k);
  arm.inertia(700, 0) = -0.1;
  EXPECT_EQ(arm.deflected(two_runs()).value.rows(), 0);
  const std::vector<MatrixXd> loads(static_cast<std::size_t>(k), MatrixXd::Ones(kSteps, 3));
  EXPECT_TRUE(deflections_by_loads(two_runs(), loads, arm.inertia, arm.stiffness, arm.damping, arm.slope).empty());
}

TEST_P(ElasticJoints, ThatWouldFallDoNotDeflect) {
  Arm arm(GetParam());
  arm.slope.col(0).array() = -1.001 * arm.stiffness[0];
  EXPECT_EQ(arm.deflected(two_runs()).value.rows(), 0);
}

INSTANTIATE_TEST_SUITE_P(Numbers, ElasticJoints, testing::Values(1, 2, 3));

/// Closed form: x = f/K (1 - e^{-ζωt} (cos ω't + ζω/ω' sin ω't)) after a step of the load.
TEST(ElasticJoint, SwingsAfterAStepAsTheClosedFormSays) {
  MotionTable table = two_runs();
  table.run_begin = table.section_begin = {0, kSteps};
  const double M = 2.0, K = 800.0, D = 4.0, f = 30.0, h = 1e-3;
  VectorXd load = VectorXd::Constant(kSteps, f);
  load[0] = 0.0;
  const Deflections d = deflections(table, load, VectorXd::Constant(kSteps, M), VectorXd::Constant(1, K), VectorXd::Constant(1, D),
                                    VectorXd::Zero(kSteps));
  const double omega = std::sqrt(K / M), zeta = D / (2.0 * std::sqrt(K * M)), damped = omega * std::sqrt(1.0 - zeta * zeta);
  for (Index i = 1; i < kSteps; ++i) {
    const double t = h * (static_cast<double>(i) - 0.5);  // the step lies between the first two rows
    const double x = f / K * (1.0 - std::exp(-zeta * omega * t) * (std::cos(damped * t) + zeta * omega / damped * std::sin(damped * t)));
    EXPECT_NEAR(d.value(i, 0), x, 1e-3 * f / K) << "row " << i;
  }
}

/// Closed form: a pendulum on a spring sags by e, K e = m g c sin(θ - e).
TEST(ElasticJoint, SagsUnderItsWeightAsTheClosedFormSays) {
  MotionTable table = two_runs();
  table.section_begin.clear();
  for (Index i = 0; i < kSteps; ++i) table.section_begin.push_back(i);  // each row is a static equilibrium
  const model::Robot robot = test::pendulum();
  const double weight = 9.81 * 0.5, K = 5.0 * weight;
  const MatrixXd q = VectorXd::LinSpaced(kSteps, -0.6, 0.9), still = MatrixXd::Zero(kSteps, 1);
  MatrixXd e = still;
  for (int pass = 0; pass < 3; ++pass) {
    const LinkTorque here = link_torque(robot, q - e, still, still, {0});
    const VectorXd load = here.torque + here.stiffness(0, 0).cwiseProduct(e.col(0));
    e = deflections(table, load, here.inertia(0, 0), VectorXd::Constant(1, K), VectorXd::Zero(1), here.stiffness(0, 0)).value;
  }
  EXPECT_GT(e.cwiseAbs().maxCoeff(), 0.05);
  for (Index i = 0; i < kSteps; ++i) EXPECT_NEAR(K * e(i, 0), weight * std::sin(q(i, 0) - e(i, 0)), 1e-6 * K) << "row " << i;
}

/// Where nothing moves, G is the second derivative of a potential.
TEST(LinkTorque, OfAnArmAtRestChangesAsThatOfAPotential) {
  const model::Robot robot = test::six_joint_arm();
  const std::vector<int> joints{0, 1, 2, 3, 4, 5};
  const MatrixXd q = MatrixXd::Random(20, 6), still = MatrixXd::Zero(20, 6);
  const LinkTorque links = link_torque(robot, q, still, still, joints);
  double largest = 0.0;
  for (int i = 0; i < 6; ++i) {
    for (int b = 0; b < 6; ++b) {
      largest = std::max(largest, links.stiffness(i, b).cwiseAbs().maxCoeff());
      EXPECT_LT((links.stiffness(i, b) - links.stiffness(b, i)).cwiseAbs().maxCoeff(), 2e-3) << i + 1 << ", " << b + 1;
      EXPECT_LT((links.inertia(i, b) - links.inertia(b, i)).cwiseAbs().maxCoeff(), 1e-12) << i + 1 << ", " << b + 1;
    }
  }
  EXPECT_GT(largest, 20.0);
}

TEST(LinkTorque, ChangesByItsColumnsWhenAJointMoves) {
  const model::Robot robot = test::six_joint_arm();
  const model::Dynamics dynamics(robot);
  const Index rows = 300;  // more than a job takes
  const MatrixXd q = MatrixXd::Random(rows, 6), qd = MatrixXd::Random(rows, 6), qdd = 3.0 * MatrixXd::Random(rows, 6);
  const std::vector<int> joints{4, 1};
  const LinkTorque links = link_torque(robot, q, qd, qdd, joints);
  const double step = 1e-4;
  for (const Index i : {Index{0}, Index{7}, rows - 1}) {
    const auto torque = [&](const VectorXd& at, const VectorXd& acceleration) {
      return VectorXd(dynamics.inverse_dynamics(at, qd.row(i).transpose(), acceleration));
    };
    const VectorXd here = q.row(i).transpose(), fast = qdd.row(i).transpose();
    for (std::size_t b = 0; b < 2; ++b) {
      const int moved = joints[b];
      EXPECT_NEAR(links.torque(i, static_cast<Index>(b)), torque(here, fast)[moved], 1e-10);
      const VectorXd along = step * VectorXd::Unit(6, moved);
      const VectorXd by_place = (torque(here + along, fast) - torque(here - along, fast)) / (2.0 * step);
      const VectorXd by_acceleration = (torque(here, fast + along) - torque(here, fast - along)) / (2.0 * step);
      for (int j = 0; j < 6; ++j) {
        EXPECT_NEAR(links.stiffness(j, moved)[i], by_place[j], 2e-4 * by_place.norm()) << "row " << i << ", joint " << j + 1;
        EXPECT_NEAR(links.inertia(j, moved)[i], by_acceleration[j], 1e-8 * by_acceleration.norm()) << "row " << i << ", joint " << j + 1;
      }
    }
  }
}

}  // namespace
}  // namespace heft::diagnose
