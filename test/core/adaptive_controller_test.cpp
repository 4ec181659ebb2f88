/// Slotine and Li's adaptive control: its dynamics against others, the closed loop, and what must not harm it.
#include "heft/core/control/adaptive_controller.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "heft/core/denavit_hartenberg.hpp"
#include "heft/core/dynamics/joint_space.hpp"
#include "heft/core/dynamics/reference_dynamics.hpp"
#include "support/planar_rig.hpp"
#include "support/random_arm.hpp"

namespace heft {
namespace {

using test::carrying;
using test::mass_of;
using test::planar_arm;
using test::Plant;
using test::Random;
using test::reference_at;
using test::some_load;

/// C(q, q̇) as the torque of unit reference velocities without gravity and acceleration.
template <int N>
Eigen::Matrix<double, N, N> coriolis(const ArmModel<double, N>& model, const JointVector<double, N>& q,
                                     const JointVector<double, N>& qd) {
  ArmModel<double, N> weightless = model;
  weightless.gravity = {};
  const ReferenceDynamics<double, N> dynamics(weightless);
  const auto trig = joint_trigonometry<DynamicArm<double, N>>(q);
  const JointVector<double, N> none = JointVector<double, N>::Zero();
  Eigen::Matrix<double, N, N> C;
  for (int j = 0; j < N; ++j) {
    C.col(j) = dynamics.torque(trig, q, qd, JointVector<double, N>::Unit(j), none);
  }
  return C;
}

TEST(ReferenceDynamics, RateOfTheMassMatrixLessTwiceTheCoriolisMatrixIsSkewSymmetric) {
  Random random(1);
  for (int n = 0; n < 30; ++n) {
    const auto model = test::random_arm<5>(random, 0.3);
    const auto q = test::random_vector<5>(random, 2), qd = test::random_vector<5>(random, 2);
    const double h = 1e-5;  // central difference along the motion: error h², rounding 1e-16 / h
    const Eigen::Matrix<double, 5, 5> rate =
        (mass_of<5>(model, q + h * qd) - mass_of<5>(model, q - h * qd)) / (2 * h);
    const Eigen::Matrix<double, 5, 5> difference = rate - 2 * coriolis<5>(model, q, qd);
    EXPECT_GT(difference.norm(), 1e-3) << n;  // there is something to be skew
    EXPECT_LT((difference + difference.transpose()).norm(), 1e-6 * (1 + rate.norm())) << n;
  }
}

TEST(ReferenceDynamics, IsMassMatrixCoriolisMatrixAndGravity) {
  // Christoffel's symbols from differences of the mass matrix: M. W. Spong et al., Robot Modeling and Control, 2006, (6.57).
  Random random(2);
  for (int n = 0; n < 20; ++n) {
    const auto model = test::random_arm<4>(random, 0.3);
    const DynamicArm<double, 4> arm(model);
    const auto q = test::random_vector<4>(random, 2), qd = test::random_vector<4>(random, 2),
               qd_r = test::random_vector<4>(random, 2), qdd_r = test::random_vector<4>(random, 4);
    const auto trig = joint_trigonometry<DynamicArm<double, 4>>(q);
    std::array<MassMatrix<double, 4>, 4> slope;
    for (int k = 0; k < 4; ++k) {
      const JointVector<double, 4> step = 1e-5 * JointVector<double, 4>::Unit(k);
      slope[static_cast<std::size_t>(k)] = (mass_of<4>(model, q + step) - mass_of<4>(model, q - step)) / 2e-5;
    }
    JointVector<double, 4> expected;
    gravity_torque(arm, trig, q, expected);
    expected += mass_of<4>(model, q) * qdd_r;
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < 4; ++j) {
        for (int k = 0; k < 4; ++k) {
          const auto d = [&](int a, int b, int by) { return slope[static_cast<std::size_t>(by)](a, b); };
          expected[i] += 0.5 * (d(i, j, k) + d(i, k, j) - d(j, k, i)) * qd[k] * qd_r[j];
        }
      }
    }
    const JointVector<double, 4> found = ReferenceDynamics<double, 4>(model).torque(trig, q, qd, qd_r, qdd_r);
    EXPECT_LT((found - expected).norm(), 1e-6 * (1 + expected.norm())) << n;
  }
}

TEST(ReferenceDynamics, RegressorTimesLoadIsWhatTheLoadAddsToTheTorque) {
  Random random(3);
  for (int n = 0; n < 30; ++n) {
    const auto model = test::random_arm<6>(random, 0.2);
    const auto load = test::random_body(random);
    const ReferenceDynamics<double, 6> bare(model), loaded(carrying<6>(model, load));
    const auto q = test::random_vector<6>(random, 2), qd = test::random_vector<6>(random, 2),
               qd_r = test::random_vector<6>(random, 2), qdd_r = test::random_vector<6>(random, 4);
    const auto trig = joint_trigonometry<DynamicArm<double, 6>>(q);
    ReferenceDynamics<double, 6>::LoadRegressor Y;
    bare.load_regressor(trig, q, qd, qd_r, qdd_r, Y);
    const Eigen::Map<const Eigen::Matrix<double, 10, 1>> a(load.data());
    const JointVector<double, 6> expected =
        loaded.torque(trig, q, qd, qd_r, qdd_r) - bare.torque(trig, q, qd, qd_r, qdd_r);
    EXPECT_LT((Y * a - expected).norm(), 1e-10 * (1 + expected.norm())) << n;
  }
}

/// Largest position error of the last two of 15 seconds under PD with the gravity of the arm without load, 20 rad/s of bandwidth.
double late_error_of_pd() {
  JointFeedback<double, 2> feedback;
  JointFeedback<double, 2>::Config gains;
  const Eigen::Vector2d inertia = mass_of<2>(planar_arm<double>(), {0, 1}).diagonal().array() + 0.1;
  gains.stiffness = 400 * inertia;
  gains.damping = 40 * inertia;
  EXPECT_EQ(feedback.configure(gains), Status::kOk);
  const DynamicArm<double, 2> nominal(planar_arm<double>());
  Plant plant(some_load());
  Eigen::Vector2d tau;
  ControlRecord record;
  double late = 0;
  for (int k = 0; k < 15000; ++k) {
    const auto reference = reference_at<double>(k * 1e-3);
    EXPECT_EQ((pd_control<double, 2>(feedback, nominal, true, reference, plant.q, plant.qd, tau, record)),
              Status::kOk);
    if (k > 13000) late = std::max(late, (reference.q - plant.q).cwiseAbs().maxCoeff());
    plant.step(tau, 1e-3);
  }
  return late;
}

template <typename Scalar>
class Adaptive : public ::testing::Test {
 protected:
  using Controller = AdaptiveController<Scalar, 2>;
  using Joints = typename Controller::Vector;
  using Config = typename Controller::Config;

  /// What a run of the closed loop left.
  struct Outcome {
    double late_error{0};  ///< largest position error of the last two seconds [rad]
    Controller controller;
  };

  static Outcome run(const Config& config, double seconds, const Eigen::Vector2d& disturbance = {0, 0},
                     const InertialParameters<Scalar>& believed = {}) {
    Outcome out;
    EXPECT_EQ(out.controller.configure(config, planar_arm<Scalar>()), Status::kOk);
    EXPECT_EQ(out.controller.set_load(believed), Status::kOk);
    Plant plant(some_load());
    const double dt = 1e-3;
    typename Controller::Record record;
    Joints tau = Joints::Zero();
    for (int k = 0; k < static_cast<int>(seconds / dt); ++k) {
      const double t = k * dt;
      const Joints q = plant.q.cast<Scalar>(), qd = plant.qd.cast<Scalar>();
      EXPECT_EQ(
          out.controller.update(reference_at<Scalar>(t), q, qd, Joints::Zero(), Scalar(dt), tau, record),
          Status::kOk);
      EXPECT_EQ(check_physical(out.controller.load()), Status::kOk) << t;
      if (t > seconds - 2) {
        out.late_error =
            std::max(out.late_error, (reference_at<double>(t).q - plant.q).cwiseAbs().maxCoeff());
      }
      plant.step(tau.template cast<double>() + disturbance, dt);
    }
    return out;
  }

  static Config usual() {
    Config config;
    config.dead_zone.setConstant(Scalar(1e-3));
    return config;
  }
};

using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(Adaptive, Scalars);

TYPED_TEST(Adaptive, FollowsWithAnUnknownLoadWherePdAndTheSameLawWithoutAdaptationDoNot) {
  auto config = this->usual();
  const auto adapted = this->run(config, 15);
  config.mass_gain = 0;
  const auto fixed = this->run(config, 15);
  EXPECT_GT(fixed.late_error, 0.01);
  EXPECT_EQ(fixed.controller.load()[kMass], TypeParam(0));
  EXPECT_LT(adapted.late_error, 0.1 * fixed.late_error);
  EXPECT_LT(adapted.late_error, 0.1 * late_error_of_pd());
}

TYPED_TEST(Adaptive, FindsTheFirstMomentThatTheMotionShows) {
  // Of a load on a planar arm the torques show m, m c in the plane and one inertia; gravity shows the moments best.
  const auto outcome = this->run(this->usual(), 30);
  EXPECT_NEAR(outcome.controller.load()[kMass], 1.5, 0.25);
  EXPECT_NEAR(outcome.controller.load()[kMcx], 0.45, 0.05);
}

TYPED_TEST(Adaptive, ADisturbanceInsideTheDeadZoneMovesNothing) {
  auto config = this->usual();
  config.dead_zone.setConstant(TypeParam(5));  // s stays below it with load and disturbance
  InertialParameters<TypeParam> believed{};
  believed[kMass] = TypeParam(0.7);
  believed[kIxx] = believed[kIyy] = believed[kIzz] = TypeParam(0.002);
  const auto outcome = this->run(config, 5, {0.5, -0.5}, believed);
  EXPECT_EQ(outcome.controller.load(), believed);
}

TYPED_TEST(Adaptive, DoesNotWindUpWhileATorqueIsCut) {
  auto config = this->usual();
  config.torque_limit.setConstant(TypeParam(0.5));  // far below the arm's own weight
  typename TestFixture::Controller controller;
  ASSERT_EQ(controller.configure(config, planar_arm<TypeParam>()), Status::kOk);
  InertialParameters<TypeParam> before{};
  before[kMass] = TypeParam(1);
  ASSERT_EQ(controller.set_load(before), Status::kOk);
  typename TestFixture::Joints tau, q = TestFixture::Joints::Zero(), none = TestFixture::Joints::Zero();
  typename TestFixture::Controller::Record record;
  auto reference = reference_at<TypeParam>(0);
  reference.q.setConstant(TypeParam(1));
  for (int k = 0; k < 1000; ++k) {
    ASSERT_EQ(controller.update(reference, q, none, none, TypeParam(1e-3), tau, record), Status::kOk);
    ASSERT_NE(record.limited, 0U);
    ASSERT_FALSE(record.adapted);
  }
  EXPECT_EQ(controller.load(), before);
}

TYPED_TEST(Adaptive, AReferenceThatStandsTeachesNothing) {
  typename TestFixture::Controller controller;
  ASSERT_EQ(controller.configure(this->usual(), planar_arm<TypeParam>()), Status::kOk);
  typename TestFixture::Joints tau, none = TestFixture::Joints::Zero(), q = TestFixture::Joints::Zero();
  typename TestFixture::Controller::Record record;
  auto reference = reference_at<TypeParam>(0);
  reference.q.setConstant(TypeParam(0.01));
  reference.qd.setZero();
  int adapted = 0;
  for (int k = 0; k < 1000; ++k) {
    ASSERT_EQ(controller.update(reference, q, none, none, TypeParam(1e-3), tau, record), Status::kOk);
    if (std::abs(k - 500) > 2) {  // sums of sample times round
      EXPECT_EQ(record.at_rest, k > 500) << k;
    }
    EXPECT_EQ(record.adapted, !record.at_rest);
    adapted += record.adapted ? 1 : 0;
  }
  EXPECT_NEAR(adapted, 500, 2);
  reference.qd[1] = TypeParam(0.002);
  ASSERT_EQ(controller.update(reference, q, none, none, TypeParam(1e-3), tau, record), Status::kOk);
  EXPECT_TRUE(record.adapted);
}

TYPED_TEST(Adaptive, KeepsTheEstimateAmongTheBodiesThatCanExist) {
  // An arm that does not move, in want of ever more torque, then of ever less.
  auto config = this->usual();
  config.largest_mass = TypeParam(4);
  config.reach = TypeParam(0.2);
  config.longest_rest = TypeParam(100);  // goes on adapting
  typename TestFixture::Controller controller;
  ASSERT_EQ(controller.configure(config, planar_arm<TypeParam>()), Status::kOk);
  typename TestFixture::Joints tau, none = TestFixture::Joints::Zero(), q = TestFixture::Joints::Zero();
  typename TestFixture::Controller::Record record;
  auto reference = reference_at<TypeParam>(0);
  TypeParam heaviest{0};
  int projected = 0;
  for (const double direction : {1.0, -1.0}) {
    reference.q.setConstant(TypeParam(0.01 * direction));
    reference.qd.setZero();
    for (int k = 0; k < 20000; ++k) {
      ASSERT_EQ(controller.update(reference, q, none, none, TypeParam(1e-3), tau, record), Status::kOk);
      const auto& load = controller.load();
      ASSERT_EQ(check_physical(load), Status::kOk) << k;
      const TypeParam moment = std::hypot(load[kMcx], load[kMcy], load[kMcz]);
      ASSERT_LE(moment, TypeParam(0.2001) * load[kMass]) << k;
      heaviest = std::max(heaviest, load[kMass]);
      projected += record.projected ? 1 : 0;
    }
  }
  EXPECT_EQ(heaviest, TypeParam(4));
  EXPECT_EQ(controller.load()[kMass], TypeParam(0));
  EXPECT_GT(projected, 0);
}

TYPED_TEST(Adaptive, WithTheTrueLoadIsComputedTorqueAtTheSamePoles) {
  // At rest on the reference's path both give the acceleration q̈_r + 2 ω ė + ω² e; while moving they differ by C s alone.
  using Vector = typename TestFixture::Joints;
  auto config = this->usual();
  typename TestFixture::Controller controller;
  ASSERT_EQ(controller.configure(config, planar_arm<TypeParam>()), Status::kOk);
  InertialParameters<TypeParam> load{};
  auto model = planar_arm<TypeParam>();
  for (std::size_t i = 0; i < 10; ++i) {
    load[i] = static_cast<TypeParam>(some_load()[i]);
    model.links[1][i] += load[i];
  }
  ASSERT_EQ(controller.set_load(load), Status::kOk);
  JointFeedback<TypeParam, 2> feedback;
  typename JointFeedback<TypeParam, 2>::Config gains;
  gains.stiffness.setConstant(TypeParam(400));
  gains.damping.setConstant(TypeParam(40));
  ASSERT_EQ(feedback.configure(gains), Status::kOk);
  const Vector q(TypeParam(0.3), TypeParam(-0.7)), qd = Vector::Zero();
  JointReference<TypeParam, 2> reference;
  reference.q = q + Vector(TypeParam(0.01), TypeParam(-0.02));
  reference.qdd = Vector(TypeParam(1), TypeParam(2));
  Vector tau, expected;
  typename TestFixture::Controller::Record record;
  ControlRecord control;
  ASSERT_EQ(controller.update(reference, q, qd, Vector::Zero(), TypeParam(1e-3), tau, record), Status::kOk);
  ASSERT_EQ((computed_torque<TypeParam, 2>(feedback, DynamicArm<TypeParam, 2>(model), {}, reference, q, qd,
                                           expected, control)),
            Status::kOk);
  EXPECT_LT((tau - expected).norm(), TypeParam(1e-5) * expected.norm());
}

TYPED_TEST(Adaptive, ARefusedSampleLeavesNoTrace) {
  using Vector = typename TestFixture::Joints;
  typename TestFixture::Controller controller;
  Vector tau = Vector::Constant(TypeParam(7));
  typename TestFixture::Controller::Record record;
  const Vector none = Vector::Zero();
  const TypeParam dt(1e-3);
  EXPECT_EQ(controller.update({}, none, none, none, dt, tau, record), Status::kNotConfigured);
  controller = this->run(this->usual(), 1).controller;
  const auto load = controller.load();
  ASSERT_GT(load[kMass], TypeParam(0));
  record.s.setConstant(TypeParam(3));
  int refused = 0;
  for (const TypeParam bad :
       {std::numeric_limits<TypeParam>::quiet_NaN(), std::numeric_limits<TypeParam>::infinity(),
        std::numeric_limits<TypeParam>::max()}) {
    for (int place = 0; place < 7; ++place) {
      JointReference<TypeParam, 2> reference;
      Vector q = none, qd = none, feed_forward = none;
      TypeParam step = dt;
      if (place == 0) reference.q[1] = bad;
      if (place == 1) reference.qd[0] = bad;
      if (place == 2) reference.qdd[1] = bad;
      if (place == 3) q[0] = bad;
      if (place == 4) qd[1] = bad;
      if (place == 5) feed_forward[1] = bad;
      if (place == 6) step = bad;
      EXPECT_EQ(controller.update(reference, q, qd, feed_forward, step, tau, record),
                Status::kNonFiniteInput);
      ++refused;
    }
  }
  EXPECT_EQ(refused, 21);
  EXPECT_EQ(controller.update({}, none, none, none, TypeParam(0), tau, record), Status::kOutOfRange);
  EXPECT_EQ(controller.update({}, none, none, none, -dt, tau, record), Status::kOutOfRange);
  EXPECT_EQ(controller.load(), load);
  EXPECT_EQ(tau, Vector::Constant(TypeParam(7)));
  EXPECT_EQ(record.s, Vector::Constant(TypeParam(3)));
}

TYPED_TEST(Adaptive, RefusesSettingsLoadsAndArmsThatCannotBe) {
  typename TestFixture::Controller controller;
  auto arm = planar_arm<TypeParam>();
  ASSERT_EQ(controller.configure(this->usual(), arm), Status::kOk);
  InertialParameters<TypeParam> load{};
  load[kMass] = TypeParam(2);
  ASSERT_EQ(controller.set_load(load), Status::kOk);
  const auto kept = load;
  for (int which = 0; which < 9; ++which) {
    auto config = this->usual();
    if (which == 0) config.position_rate[1] = 0;
    if (which == 1) config.damping_rate = -1;
    if (which == 2) config.damping[0] = std::numeric_limits<TypeParam>::quiet_NaN();
    if (which == 3) config.torque_limit[1] = 0;
    if (which == 4) config.mass_gain = -1;
    if (which == 5) config.size = 0;
    if (which == 6) config.largest_mass = 0;
    if (which == 7) config.reach = std::numeric_limits<TypeParam>::infinity();
    if (which == 8) config.dead_zone[0] = 0;
    EXPECT_EQ(controller.configure(config, arm), Status::kOutOfRange) << which;
  }
  arm.links[1][kIzz] = std::numeric_limits<TypeParam>::quiet_NaN();
  EXPECT_EQ(controller.configure(this->usual(), arm), Status::kNonFiniteInput);
  load[kMass] = TypeParam(-1);
  EXPECT_EQ(controller.set_load(load), Status::kNotPositiveDefinite);
  load[kMass] = TypeParam(51);
  EXPECT_EQ(controller.set_load(load), Status::kOutOfRange);
  EXPECT_EQ(controller.load(), kept);
}

}  // namespace
}  // namespace heft
