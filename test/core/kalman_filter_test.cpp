/// Extended and unscented filter: against a closed-form Kalman filter, their derivatives, their consistency, what they can
/// observe, and friction that drifts.
#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>
#include <random>
#include <string>

#include <gtest/gtest.h>
#include <Eigen/LU>

#include "heft/core/converted.hpp"
#include "heft/core/estimate/extended_kalman_filter.hpp"
#include "heft/core/estimate/unscented_kalman_filter.hpp"
#include "heft/host/decompositions.hpp"
#include "support/random_arm.hpp"
#include "support/two_link_arm.hpp"

namespace heft {
namespace {

using test::TwoLinkRig;

template <typename Filter>
class OneJointFilter : public ::testing::Test {
 public:
  /// A slide of 2 kg on a straight rail, whose friction is Coulomb's while it slides: linear.
  static ArmModel<double, 1> slide() {
    ArmModel<double, 1> arm;
    arm.joints[0].type = JointType::kPrismatic;
    arm.links[0] = make_inertial_parameters<double>(2.0, {0, 0, 0}, {});
    arm.actuation[0] = {0.5, 3.0, 0.0, 0.0};
    arm.gravity = {};
    return arm;
  }
};
using OneJoint = ::testing::Types<ExtendedKalmanFilter<double, 1>, UnscentedKalmanFilter<double, 1>>;
TYPED_TEST_SUITE(OneJointFilter, OneJoint);

/// 5 N on a slide that 10 N of Coulomb friction hold: it stays within the width of the sign, whichever way it is pushed.
TEST(DriftingArm, SticksInBothDirections) {
  ArmModel<double, 1> slide = OneJointFilter<ExtendedKalmanFilter<double, 1>>::slide();
  slide.links[0] = make_inertial_parameters<double>(1e-3, {0, 0, 0}, {});
  slide.actuation[0].rotor_inertia = 0;
  using Arm = DriftingArm<double, 1, 0>;
  constexpr double kWidth = 0.02;
  Arm arm;
  arm.set_model(slide, kWidth);
  Arm::State at_rest{};
  at_rest[Arm::Layout::kCoulomb] = 10;
  Arm::Mechanics forward, backward;
  ASSERT_EQ(arm.step(at_rest, Arm::Vector(5), 1e-3, forward), Status::kOk);
  ASSERT_EQ(arm.step(at_rest, Arm::Vector(-5), 1e-3, backward), Status::kOk);
  EXPECT_LT(std::abs(forward[1]), kWidth);
  EXPECT_EQ(backward, Arm::Mechanics(-forward));
}

/// Slower than the width of the sign and pushed on with less than its friction: it goes on creeping, however light it is.
TEST(DriftingArm, CreepsAsLongAsFrictionHoldsWhatPushesIt) {
  using Arm = DriftingArm<double, 1, 0>;
  ArmModel<double, 1> slide = OneJointFilter<ExtendedKalmanFilter<double, 1>>::slide();
  slide.actuation[0].rotor_inertia = 0;
  constexpr double kWidth = 0.02, kFriction = 10;
  for (const double mass : {1e-4, 1e-3, 1e-2}) {
    slide.links[0] = make_inertial_parameters<double>(mass, {0, 0, 0}, {});
    Arm arm;
    arm.set_model(slide, kWidth);
    for (const double share : {0.1, 0.5, 0.9, 0.99}) {
      for (const double speed : {1e-6, 0.1, 0.5, 0.99, 2.9}) {
        Arm::State x{0, speed * kWidth, kFriction, 0};
        Arm::Mechanics forward, backward;
        ASSERT_EQ(arm.step(x, Arm::Vector(share * kFriction), 1e-3, forward), Status::kOk);
        EXPECT_LE(std::abs(x[1] + forward[1]), 3 * kWidth * (1 + 1e-9))
            << mass << " " << share << " " << speed;
        x[1] = -x[1];
        ASSERT_EQ(arm.step(x, Arm::Vector(-share * kFriction), 1e-3, backward), Status::kOk);
        EXPECT_EQ(backward, Arm::Mechanics(-forward));
      }
    }
    // What friction does not hold breaks loose in the same step: (15 - 10) N on the mass.
    const Arm::State creeping{0, 0.5 * kWidth, kFriction, 0};
    Arm::Mechanics loose;
    ASSERT_EQ(arm.step(creeping, Arm::Vector(1.5 * kFriction), 1e-3, loose), Status::kOk);
    EXPECT_GT(loose[1], 0.5 * 5e-3 / mass) << mass;
  }
}

/// Mass 2.5 kg with its rotor: q⁺ = q + dt v + dt²/2 a, v⁺ = v + dt a, a = (τ − F) / 2.5.
TYPED_TEST(OneJointFilter, EqualsTheClosedFormOfALinearCase) {
  constexpr double kDt = 1e-3, kMass = 2.5;
  typename TypeParam::Config config;
  config.position_noise.setConstant(1e-4);
  config.velocity_noise.setConstant(5e-3);
  config.torque_noise.setConstant(0.5);
  config.coulomb.std.setConstant(1.0);
  config.coulomb.time = 5;
  config.viscous.std.setConstant(1e-9);
  config.gate = 0;
  TypeParam filter;
  ASSERT_EQ(filter.configure(config, this->slide()), Status::kOk);

  Eigen::Matrix3d A = Eigen::Matrix3d::Identity();
  A(0, 1) = kDt, A(0, 2) = -kDt * kDt / (2 * kMass), A(1, 2) = -kDt / kMass;
  const Eigen::Vector3d G(kDt * kDt / (2 * kMass), kDt / kMass, 0);
  Eigen::Vector3d x(0, 0, 3.0);
  Eigen::Matrix3d P = Eigen::Vector3d(1e-8, 2.5e-5, 1.0).asDiagonal();

  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  double q = 0, v = 0.5, last_tau = 0;
  const double friction = 3.7;
  typename TypeParam::Record record;
  for (int n = 0; n < 2000; ++n) {
    const double tau = 3.7 + std::sin(0.02 * n);
    const Eigen::Vector2d y(q + 1e-4 * normal(random), v + 5e-3 * normal(random));
    using One = typename TypeParam::Vector;
    ASSERT_EQ(filter.update(One(y[0]), One(y[1]), One(tau), kDt, record), Status::kOk);
    if (n == 0) {
      x[0] = y[0], x[1] = y[1];
    } else {
      x = A * x + G * last_tau;
      P = A * P * A.transpose() + 0.25 * G * G.transpose();
      // Twenty periods of drift at a time, the first after the sample of the start; never above the prior.
      if ((n + 1) % 20 == 0) P(2, 2) += std::min(20 * kDt / 5.0, 1.0 - P(2, 2));
      Eigen::Matrix<double, 2, 3> H = Eigen::Matrix<double, 2, 3>::Zero();
      H(0, 0) = H(1, 1) = 1;
      const Eigen::Matrix2d R = Eigen::Vector2d(1e-8, 2.5e-5).asDiagonal();
      const Eigen::Matrix<double, 3, 2> K = P * H.transpose() * (H * P * H.transpose() + R).inverse();
      x += K * (y - H * x);
      P = (Eigen::Matrix3d::Identity() - K * H) * P;
    }
    for (int i = 0; i < 3; ++i) {
      ASSERT_NEAR(filter.state()[static_cast<std::size_t>(i)], x[i], 1e-7) << n;
      for (int j = 0; j < 3; ++j) {
        ASSERT_NEAR(filter.covariance(i, j), P(i, j), 1e-6 * std::sqrt(P(i, i) * P(j, j))) << n;
      }
    }
    last_tau = tau;
    const double a = (tau - friction) / kMass;
    q += kDt * v + 0.5 * kDt * kDt * a, v += kDt * a;
  }
  EXPECT_NEAR(filter.coulomb(0), friction, 3 * filter.standard_deviation(TypeParam::kCoulomb));
  EXPECT_LT(filter.standard_deviation(TypeParam::kCoulomb), 0.2);
}

/// At one speed v only F + d v shows: with F and d v equally uncertain, each keeps 1/√2 of its prior standard deviation.
TYPED_TEST(OneJointFilter, CoulombAndViscousFrictionAreNotSeparatedAtOneSpeed) {
  typename TypeParam::Config config;
  config.coulomb.std.setConstant(1.0);
  config.viscous.std.setConstant(2.0);
  config.coulomb.time = config.viscous.time = 1e6;
  config.torque_noise.setConstant(0.1);
  TypeParam filter;
  ASSERT_EQ(filter.configure(config, this->slide()), Status::kOk);
  using One = typename TypeParam::Vector;
  typename TypeParam::Record record;
  double q = 0;
  const auto run = [&](double from, double to, auto speed) {
    for (double t = from; t < to; t += 1e-3) {
      const double v = speed(t), a = (speed(t + 1e-3) - v) / 1e-3;
      ASSERT_EQ(filter.update(One(q), One(v), One(3.4 + 0.6 * v + 2.5 * a), 1e-3, record), Status::kOk);
      q += 0.5e-3 * (v + speed(t + 1e-3));
    }
  };
  run(0, 3, [](double) { return 0.5; });
  const int F = TypeParam::kCoulomb, d = TypeParam::kViscous;
  EXPECT_NEAR(filter.standard_deviation(F), std::sqrt(0.5), 0.03);
  EXPECT_NEAR(filter.standard_deviation(d), 2 * std::sqrt(0.5), 0.06);
  const double sum = filter.covariance(F, F) + filter.covariance(F, d) + 0.25 * filter.covariance(d, d);
  EXPECT_LT(std::sqrt(sum), 0.05);
  EXPECT_NEAR(filter.coulomb(0) + 0.5 * filter.viscous(0), 3.7, 0.1);
  run(3, 6, [](double t) { return 0.5 - 0.3 * std::sin(3 * (t - 3)); });
  EXPECT_LT(filter.standard_deviation(F), 0.1);
  EXPECT_NEAR(filter.coulomb(0), 3.4, 0.15);
  EXPECT_NEAR(filter.viscous(0), 0.6, 0.3);
}

/// A relaxing parameter that nothing shows: e^(−t/T) towards the model's value, variance σ² (1 − e^(−2t/T)) on top.
TYPED_TEST(OneJointFilter, FrictionThatIsNotShownRelaxesToTheModel) {
  typename TypeParam::Config config;
  config.coulomb.std.setConstant(1.0);
  config.coulomb.kind = DriftKind::kRelaxes;
  config.coulomb.time = 30;
  TypeParam filter;
  ASSERT_EQ(filter.configure(config, this->slide()), Status::kOk);
  using One = typename TypeParam::Vector;
  typename TypeParam::Record record;
  double q = 0;
  for (int n = 0; n < 2000; ++n, q += 5e-4) {
    ASSERT_EQ(filter.update(One(q), One(0.5), One(4.0), 1e-3, record), Status::kOk);
  }
  const double off = filter.coulomb(0) - 3.0, variance = filter.covariance(2, 2);
  ASSERT_GT(off, 0.7);
  ASSERT_EQ(filter.update(One(q), One(0.5), One(4.0), 30.0, record), Status::kOk);
  EXPECT_TRUE(record.restarted);
  EXPECT_NEAR(filter.coulomb(0) - 3.0, off * std::exp(-1.0), 1e-3);
  EXPECT_NEAR(filter.covariance(2, 2), variance * std::exp(-2.0) + 1 - std::exp(-2.0), 1e-3);
}

/// A minute at rest under 0.4 of the Coulomb friction, which a filter might take for all of it; then it goes on.
TYPED_TEST(OneJointFilter, AJointAtRestTeachesNothingAboutItsFriction) {
  typename TypeParam::Config config;
  config.coulomb.std.setConstant(1.5);
  config.viscous.std.setConstant(0.3);
  config.coulomb.time = config.viscous.time = 400;
  config.velocity_noise.setConstant(1e-3);
  config.torque_noise.setConstant(0.3);
  auto arm = this->slide();
  arm.actuation[0].viscous_friction = 0.6;
  TypeParam filter;
  ASSERT_EQ(filter.configure(config, arm), Status::kOk);
  constexpr double kDt = 2e-3, kCoulomb = 2.4, kViscous = 0.5, kStop = 3 * std::numbers::pi / 2;
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal;
  // Stops between strokes of 0.5 sin(2 t).
  const auto speed = [&](double t) {
    return t < kStop ? 0.5 * std::sin(2 * t) : t < kStop + 60 ? 0.0 : 0.5 * std::sin(2 * (t - 60));
  };
  double q = 0, worst = 0;
  double known = 0, after = 0;
  typename TypeParam::Record record;
  for (double t = 0; t < kStop + 63; t += kDt) {
    const double v = speed(t), next = speed(t + kDt), middle = 0.5 * (v + next);
    const double friction =
        middle == 0 ? 0.4 * kCoulomb : std::copysign(kCoulomb, middle) + kViscous * middle;
    using One = typename TypeParam::Vector;
    ASSERT_EQ(filter.update(One(q + 1e-4 * normal(random)), One(v + 1e-3 * normal(random)),
                            One(2.5 * (next - v) / kDt + friction + 0.3 * normal(random)), kDt, record),
              Status::kOk);
    q += kDt * middle;
    if (t < kStop) known = filter.standard_deviation(TypeParam::kCoulomb);
    if (t < kStop + 60) after = filter.standard_deviation(TypeParam::kCoulomb);
    if (t > 3) worst = std::max(worst, std::abs(filter.coulomb(0) / kCoulomb - 1));
  }
  this->RecordProperty("worst", std::to_string(worst));
  EXPECT_LT(worst, 0.05);
  EXPECT_LT(after, 1.1 * known);
  EXPECT_NEAR(filter.viscous(0), kViscous, 0.1);
}

TEST(DriftingArm, TransitionEqualsDifferencesOfTheStep) {
  test::Random random(3);
  using Arm = DriftingArm<double, 2, 10>;
  for (int n = 0; n < 50; ++n) {
    Arm arm;
    const auto model = test::random_arm<2>(random, 0.3);
    arm.set_model(model, 0.02);
    Arm::State x{};
    // Faster than the transition of the sign: there the chord changes with the state, which the derivative leaves out.
    for (std::size_t k = 0; k < 2; ++k) {
      x[k] = test::uniform(random, -3, 3);
      x[2 + k] = test::uniform(random, 0.5, 2) * (k % 2 == 0 ? 1 : -1);
      x[4 + k] = test::uniform(random, 0, 3), x[6 + k] = test::uniform(random, 0, 3);
    }
    const auto body = test::random_body(random);
    for (std::size_t k = 0; k < 10; ++k) x[8 + k] = body[k];
    const Arm::Vector tau = test::random_vector<2>(random, 20);
    constexpr double kDt = 2e-3, kStep = 1e-5;
    Arm::Mechanics up, down, change;
    Arm::Transition A;
    Arm::Gain G;
    ASSERT_EQ(arm.step(x, tau, kDt, change), Status::kOk);
    arm.transition(kDt, A);
    arm.gain(kDt, G);
    for (int c = 0; c < Arm::Layout::kStates; ++c) {
      Arm::State moved = x;
      moved[static_cast<std::size_t>(c)] += kStep;
      ASSERT_EQ(arm.step(moved, tau, kDt, up), Status::kOk);
      moved[static_cast<std::size_t>(c)] -= 2 * kStep;
      ASSERT_EQ(arm.step(moved, tau, kDt, down), Status::kOk);
      Arm::Mechanics expected = (up - down) / (2 * kStep);
      if (c < 4) expected[c] += 1;
      // Rounding of some 100 rad/s² times dt over the step, and third derivatives.
      EXPECT_LT((A.col(c) - expected).norm(), 1e-6 * (1 + expected.norm())) << "column " << c;
    }
    for (int c = 0; c < 2; ++c) {
      ASSERT_EQ(arm.step(x, tau + kStep * Arm::Vector::Unit(c), kDt, up), Status::kOk);
      EXPECT_LT((G.col(c) - (up - change) / kStep).norm(), 1e-6 * (1 + G.col(c).norm())) << "torque " << c;
    }
  }
}

/// A joint whose friction is two hundred times as stiff as an explicit step could bear.
TEST(DriftingArm, AStiffJointComesToRestWithoutSwinging) {
  ArmModel<double, 1> model;
  model.links[0] = make_inertial_parameters<double>(0.1, {0, 0, 0}, {0, 0, 0, 0, 0, 1e-4});
  DriftingArm<double, 1, 0> arm;
  arm.set_model(model, 0.02);
  DriftingArm<double, 1, 0>::State x{0.0, 0.5, 1.2, 0.4};
  DriftingArm<double, 1, 0>::Mechanics change;
  for (int n = 0; n < 100; ++n) {
    ASSERT_EQ(arm.step(x, DriftingArm<double, 1, 0>::Vector(0.0), 1e-3, change), Status::kOk);
    EXPECT_LE(std::abs(x[1] + change[1]), std::max(std::abs(x[1]), 0.011)) << n;
    x[0] += change[0], x[1] += change[1];
  }
  EXPECT_LT(std::abs(x[1]), 1e-3);
}

template <typename Filter>
class TwoJointFilter : public ::testing::Test {
 public:
  using Scalar = typename Filter::Scalar;
  static typename Filter::Config config() {
    typename Filter::Config c;
    c.position_noise.setConstant(Scalar(TwoLinkRig::kPositionNoise));
    c.velocity_noise.setConstant(Scalar(TwoLinkRig::kVelocityNoise));
    c.torque_noise.setConstant(Scalar(TwoLinkRig::kTorqueNoise));
    c.coulomb.std = {Scalar(1.5), Scalar(0.8)};
    c.viscous.std = {Scalar(1.0), Scalar(0.4)};
    return c;
  }
  static Status take(Filter& filter, const test::TwoLinkSample& s, bool with_velocity,
                     typename Filter::Record& record) {
    const typename Filter::Vector q = s.q.cast<Scalar>(), qd = s.qd.cast<Scalar>(),
                                  tau = s.tau.cast<Scalar>();
    const Scalar dt = static_cast<Scalar>(s.dt);
    return with_velocity ? filter.update(q, qd, tau, dt, record) : filter.update(q, tau, dt, record);
  }
};
/// Each of both filters and both precisions once; the tests of faults run all four.
using TwoJoints = ::testing::Types<ExtendedKalmanFilter<double, 2>, UnscentedKalmanFilter<float, 2>>;
TYPED_TEST_SUITE(TwoJointFilter, TwoJoints);

/// Squared errors over their covariance, of all eight states, mean over runs: χ² of 8 R degrees of freedom over R. Friction is drawn
/// from the prior and wanders as configured.
TYPED_TEST(TwoJointFilter, ErrorsAreAsLargeAsTheCovarianceSays) {
  using S = typename TestFixture::Scalar;
  constexpr int kRuns = 60;
  double sum = 0, innovations = 0;
  long samples = 0;
  for (unsigned run = 0; run < kRuns; ++run) {
    TwoLinkRig rig(run + 1);
    std::mt19937_64 random(run + 1000);
    std::normal_distribution<double> normal;
    auto config = this->config();
    config.coulomb.time = config.viscous.time = S(20);
    TypeParam filter;
    ASSERT_EQ(filter.configure(config, converted<S>(test::TwoLinkArm::model())), Status::kOk);
    for (int i = 0; i < 2; ++i) {
      rig.arm.coulomb[i] += static_cast<double>(config.coulomb.std[i]) * normal(random);
      rig.arm.viscous[i] += static_cast<double>(config.viscous.std[i]) * normal(random);
    }
    rig.arm.coulomb = rig.arm.coulomb.cwiseMax(0.5);
    rig.arm.viscous = rig.arm.viscous.cwiseMax(0.05);
    typename TypeParam::Record record;
    for (int n = 0; n < 700; ++n) {
      const auto before = rig.arm;
      ASSERT_EQ(this->take(filter, rig.next(), n % 2 == 0 || run % 2 == 0, record), Status::kOk);
      if (n > 0) innovations += static_cast<double>(record.surprise), ++samples;
      if (n == 699) {
        Eigen::Matrix<double, 8, 1> error;
        error << before.q, before.qd, before.coulomb, before.viscous;
        Eigen::Matrix<double, 8, 8> P;
        for (int i = 0; i < 8; ++i) {
          error[i] -= static_cast<double>(filter.state()[static_cast<std::size_t>(i)]);
          for (int j = 0; j < 8; ++j) P(i, j) = static_cast<double>(filter.covariance(i, j));
        }
        sum += error.dot(solve_symmetric(P, error).col(0));
      }
      // The wear of a millisecond.
      for (int i = 0; i < 2; ++i) {
        const double share = std::sqrt(1e-3 / 20);
        rig.arm.coulomb[i] += static_cast<double>(config.coulomb.std[i]) * share * normal(random);
        rig.arm.viscous[i] += static_cast<double>(config.viscous.std[i]) * share * normal(random);
      }
    }
  }
  // 99 % of χ² of 480 lie within 480 ± 2.6 √960.
  const double half_width = 2.6 * std::sqrt(2.0 * 8 * kRuns) / kRuns;
  this->RecordProperty("nees_of_8", std::to_string(sum / kRuns));
  EXPECT_NEAR(sum / kRuns, 8, half_width);
  EXPECT_NEAR(innovations / static_cast<double>(samples), 1, 0.1);
}

/// Friction falls by 30 % in 10 s while the arm warms up; outliers of all sizes for a tenth of a second.
TYPED_TEST(TwoJointFilter, FollowsFrictionThatWarmsUpThroughABurstOfOutliers) {
  using S = typename TestFixture::Scalar;
  TwoLinkRig rig(7);
  rig.arm.sign_width = 0.005;
  const auto cold = rig.arm;
  auto config = this->config();
  config.coulomb.time = config.viscous.time = S(10);
  TypeParam filter;
  ASSERT_EQ(filter.configure(config, converted<S>(test::TwoLinkArm::model())), Status::kOk);
  std::mt19937_64 random(8);
  std::uniform_real_distribution<double> uniform(-1, 1);
  typename TypeParam::Record record;
  double worst = 0, squares = 0, late = 0;
  int refused = 0, compared = 0;
  for (int n = 0; n < 12'000; ++n) {
    const double share = 1 - 0.3 * std::min(1.0, n / 10'000.0);
    rig.arm.coulomb = share * cold.coulomb, rig.arm.viscous = share * cold.viscous;
    auto s = rig.next();
    const bool burst = n >= 6000 && n < 6100;
    if (burst && n % 3 != 0) {
      for (int i = 0; i < 2; ++i)
        s.q[i] += std::pow(10, 3 * uniform(random)), s.qd[i] += 100 * uniform(random);
    }
    ASSERT_EQ(this->take(filter, s, true, record), Status::kOk);
    refused += burst ? std::popcount(record.refused) : 0;
    if (n >= 3000) {
      for (int i = 0; i < 2; ++i) {
        const double error = (static_cast<double>(filter.coulomb(i)) - rig.arm.coulomb[i]) / cold.coulomb[i];
        worst = std::max(worst, std::abs(error)), squares += error * error, ++compared;
        late += n < 10'000 ? error / (2 * 7000) : 0;
      }
    }
  }
  this->RecordProperty("rms", std::to_string(std::sqrt(squares / compared)));
  this->RecordProperty("lag", std::to_string(late / 0.03));
  EXPECT_LT(std::sqrt(squares / compared), 0.04);
  EXPECT_LT(worst, 0.12);
  // A ramp of 0.03 a second leaves an error of 0.03 times the lag.
  EXPECT_LT(std::abs(late) / 0.03, 0.5) << "lag [s]";
  EXPECT_GT(refused, 100);
  EXPECT_EQ(compared, 2 * 9000);
}

/// A load of 1 kg at the tip, all of whose parameters are in the state. A planar arm shows mass, first moment in its plane and
/// inertia about its axes; nothing else.
template <typename Filter>
class LoadInTheState : public ::testing::Test {};
using WithLoad = ::testing::Types<ExtendedKalmanFilter<double, 2, 10>, UnscentedKalmanFilter<double, 2, 10>>;
TYPED_TEST_SUITE(LoadInTheState, WithLoad);

/// The prior allows loads of −3 kg, and sigma points go to −13: no mass matrix survives that.
TYPED_TEST(LoadInTheState, IsFoundBesideFriction) {
  TwoLinkRig rig(9);
  rig.arm.load = 1.0;
  using Filter = TypeParam;
  Filter filter;
  typename Filter::Config config;
  config.position_noise.setConstant(TwoLinkRig::kPositionNoise);
  config.velocity_noise.setConstant(TwoLinkRig::kVelocityNoise);
  config.torque_noise.setConstant(TwoLinkRig::kTorqueNoise);
  config.load_std[kIzz] = 0.3;
  config.load_time = config.coulomb.time = config.viscous.time = 1e4;
  ASSERT_EQ(filter.configure(config, test::TwoLinkArm::model()), Status::kOk);
  typename Filter::Record record;
  for (int n = 0; n < 8000; ++n) {
    const auto s = rig.next();
    ASSERT_EQ(filter.update(s.q, s.qd, s.tau, s.dt, record), Status::kOk);
  }
  const auto load = filter.load();
  EXPECT_NEAR(load[kMass], 1.0, 0.05);
  EXPECT_NEAR(load[kMcx], 0.5, 0.02);
  EXPECT_NEAR(load[kMcy], 0.0, 0.02);
  EXPECT_NEAR(load[kIzz], 0.25, 0.02);
  for (const int shown : {kMass, kMcx, kMcy, kIzz}) {
    EXPECT_LT(filter.standard_deviation(Filter::kLoad + shown), 0.03) << shown;
  }
  for (const int hidden : {kMcz, kIxx, kIxy, kIyy, kIxz, kIyz}) {
    EXPECT_NEAR(filter.standard_deviation(Filter::kLoad + hidden),
                config.load_std[static_cast<std::size_t>(hidden)], 1e-4)
        << hidden;
    EXPECT_NEAR(load[static_cast<std::size_t>(hidden)], 0.0, 1e-6) << hidden;
  }
  EXPECT_NEAR(filter.coulomb(0), 6.0, 0.2);
  EXPECT_NEAR(filter.coulomb(1), 2.5, 0.2);
}

}  // namespace
}  // namespace heft
