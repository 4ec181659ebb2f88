/// Effects as a controller feeds them forward, against their formulas, and every effect's own consistency.
#include <array>
#include <cmath>
#include <limits>
#include <string>

#include <gtest/gtest.h>

#include "heft/core/effects/effect_feed_forward.hpp"
#include "support/random_arm.hpp"

namespace heft {
namespace {

template <typename Scalar>
using Actuation = std::array<JointActuation<Scalar>, 2>;

/// A point that any search may meet.
EffectPoint<double> random_point(test::Random& random) {
  EffectPoint<double> point;
  point.time = test::uniform(random, 0, 20);
  point.q = test::uniform(random, -3, 3);
  point.qd = test::uniform(random, -2, 2);
  point.qdd = test::uniform(random, -5, 5);
  point.direction = point.qd > 0 ? 1 : -1;
  point.load = test::uniform(random, -30, 30);
  point.memory = test::uniform(random, -1, 1);
  point.temperature = test::uniform(random, -10, 60);
  return point;
}

TEST(JointEffects, ColumnsTimesCoefficientsAreTheTorque) {
  test::Random random(1);
  const JointActuation<double> joint{0.1, 3.0, 1.5, 0.2};
  for (int kind = 0; kind < kNumJointEffects; ++kind) {
    visit_joint_effect(kind, [&](auto type) {
      using Effect = decltype(type);
      const std::string id(Effect::kId);
      for (int n = 0; n < 50; ++n) {
        const EffectPoint<double> x = random_point(random);
        const double shape = test::uniform(random, 0.1, 3.0);
        const auto columns = Effect::columns(shape, x);
        auto c = columns;
        for (double& value : c) value = test::uniform(random, -2, 2);
        // An effect that takes the place of the Coulomb term is at most all of it.
        if constexpr (requires { Effect::kReplacesCoulomb; }) {
          c[0] = test::uniform(random, 0, joint.coulomb_friction);
        }
        double expected = 0;
        for (std::size_t i = 0; i < c.size(); ++i) expected += c[i] * columns[i];
        const double torque = Effect::torque(Effect::parameters(c, shape, joint), x, joint);
        EXPECT_NEAR(torque, expected, 1e-12 * (1 + std::abs(expected))) << id;
      }
    });
  }
}

/// A motion that was seen: slow, lightly loaded, over a part of the travel.
SeenWithin<double> seen_slowly() { return {{-0.5, 0.4}, {-3.0, 8.0}, {-1.0, 1.5}}; }

TEST(JointEffects, KeepWithinWhatWasSeenTheTorqueOfTheFormula) {
  test::Random random(2);
  const JointActuation<double> joint{0.1, 3.0, 1.5, 0.2};
  int compared = 0;
  for (int kind = 0; kind < kNumJointEffects; ++kind) {
    JointEffect<double> effect{kind, 0, {0.7, 1.3, 0.4, 0.9}};
    for (int n = 0; n < 2000; ++n) {
      const EffectPoint<double> x = random_point(random);
      const double anywhere = joint_effect_torque(effect, x, joint);
      JointEffect<double> limited = effect;
      limited.seen = seen_slowly();
      const bool within = std::abs(x.qd) <= 0.5 && std::abs(x.load) <= 8.0 && x.q >= -1.0 && x.q <= 1.5;
      if (!within) continue;
      EXPECT_EQ(joint_effect_torque(limited, x, joint), anywhere) << kind;
      ++compared;
    }
  }
  EXPECT_GT(compared, 100);
}

TEST(JointEffects, HoldBeyondWhatWasSeenTheTorqueOfTheBorder) {
  const JointActuation<double> joint{0.1, 3.0, 1.5, 0.2};
  const auto torque = [&](JointEffect<double> effect, double q, double qd, double load) {
    effect.seen = seen_slowly();
    EffectPoint<double> x;
    x.q = q, x.qd = qd, x.load = load, x.direction = qd > 0 ? 1 : -1;
    return joint_effect_torque(effect, x, joint);
  };
  const JointEffect<double> spring{joint_effect_kind<Spring>(), 0, {20.0, 0.5}};
  EXPECT_DOUBLE_EQ(torque(spring, 3.0, 0.1, 1.0), 20.0 * (1.5 - 0.5));
  EXPECT_DOUBLE_EQ(torque(spring, -3.0, 0.1, 1.0), 20.0 * (-1.0 - 0.5));
  // Friction and load by their size: what was seen one way holds the other way.
  const JointEffect<double> load{joint_effect_kind<LoadFriction>(), 0, {0.1}};
  EXPECT_DOUBLE_EQ(torque(load, 0.0, 0.1, 50.0), 0.8);
  EXPECT_DOUBLE_EQ(torque(load, 0.0, -0.1, -50.0), -0.8);
  const JointEffect<double> scale{joint_effect_kind<TorqueScale>(), 0, {0.05}};
  EXPECT_DOUBLE_EQ(torque(scale, 0.0, 0.1, -50.0), -0.4);
  const JointEffect<double> viscous{joint_effect_kind<ViscousNonlinear>(), 0, {2.0, 0.5}};
  EXPECT_DOUBLE_EQ(torque(viscous, 0.0, 2.0, 1.0), 2.0 * std::sqrt(0.5));
  EXPECT_DOUBLE_EQ(torque(viscous, 0.0, -2.0, 1.0), -2.0 * std::sqrt(0.5));
  // The memory of friction is bounded by the friction itself.
  JointEffect<double> dahl{joint_effect_kind<Hysteresis>(), 0, {0.02}};
  EXPECT_DOUBLE_EQ(torque(dahl, 9.0, 2.0, 50.0), -3.0);
}

TEST(JointEffects, RippleFadesBeyondWhatWasSeenWithinAsLongAWay) {
  const JointActuation<double> joint{};
  JointEffect<double> ripple{joint_effect_kind<Ripple>(), 0, {2.0, 20.0, 0.0}};
  ripple.seen = seen_slowly();
  const double way = 2.5;
  const auto amplitude = [&](double q) {
    EffectPoint<double> x;
    x.q = q;
    return joint_effect_torque(ripple, x, joint) / std::sin(20.0 * q);
  };
  EXPECT_DOUBLE_EQ(amplitude(1.49), 2.0);
  EXPECT_NEAR(amplitude(1.5 + 0.25 * way), 1.5, 1e-12);
  EXPECT_NEAR(amplitude(-1.0 - 0.75 * way), 0.5, 1e-12);
  EXPECT_EQ(amplitude(1.5 + 1.01 * way), 0.0);
  EXPECT_EQ(amplitude(40.0), 0.0);
  ripple.seen.position = {0.5, 0.5};  // never moved
  EXPECT_EQ(amplitude(0.6), 0.0);
}

TEST(JointEffects, MemoryRateIsTheSlopeOfMemory) {
  const JointEffect<double> dahl{joint_effect_kind<Hysteresis>(), 0, {0.02}};
  for (const double direction : {1.0, -1.0}) {
    const double z = 0.3, speed = 0.4 * direction, h = 1e-7;
    const double slope = (joint_effect_memory(dahl, z, speed * h) - z) / h;
    EXPECT_NEAR(slope, Hysteresis::memory_rate(dahl.parameters, z, direction, speed), 1e-4);
  }
  // An effect without memory keeps what it is given.
  EXPECT_EQ(joint_effect_memory(JointEffect<double>{joint_effect_kind<Offset>(), 0, {}}, 0.7, 0.1), 0.7);
}

TEST(JointEffects, MemoryAtRestHoldsTheJoint) {
  const JointActuation<double> joint{0.1, 3.0, 1.5, 0.2};
  const JointEffect<double> dahl{joint_effect_kind<Hysteresis>(), 0, {0.02, 0.4}};
  EffectPoint<double> rest;
  for (const double held : {-1.7, -0.3, 0.0, 1.2}) {
    rest.memory = joint_effect_memory_at_rest(dahl, held, joint);
    EXPECT_NEAR(joint_effect_torque(dahl, rest, joint), held, 1e-14);
  }
  // Friction holds with no more than the part of F_c that turns over gradually, 3 (1 - 0.4); and not with nonsense.
  EXPECT_EQ(joint_effect_memory_at_rest(dahl, 5.0, joint), 1.0);
  EXPECT_EQ(joint_effect_memory_at_rest(dahl, -5.0, joint), -1.0);
  EXPECT_EQ(joint_effect_memory_at_rest(dahl, std::nan(""), joint), 0.0);
  EXPECT_EQ(joint_effect_memory_at_rest({joint_effect_kind<Offset>(), 0, {1.0}}, 1.0, joint), 0.0);
}

template <typename Scalar>
void expect_formulas(Scalar tolerance) {
  EffectFeedForward<Scalar, 2, 4> effects;
  const std::array<JointEffect<double>, 3> found{{{joint_effect_kind<Stribeck>(), 0, {1.1, 0.4}},
                                                  {joint_effect_kind<Hysteresis>(), 1, {0.03, 0.25}},
                                                  {joint_effect_kind<FrictionDrift>(), 1, {0.5, 0.4, 3.0}}}};
  ASSERT_EQ(effects.configure(found), Status::kOk);
  ASSERT_EQ(effects.count(), 3);
  const Actuation<Scalar> actuation{
      {{Scalar(0), Scalar(2), Scalar(1), Scalar(0)}, {Scalar(0), Scalar(0.8), Scalar(0.3), Scalar(0)}}};
  using Vector = JointVector<Scalar, 2>;
  double z = 0, last = 0;
  for (int k = 0; k < 200; ++k) {
    const double t = 0.01 * k;
    const double q = 0.1 * std::sin(5 * t), v = 0.5 * std::cos(5 * t);
    Vector position(Scalar(0), static_cast<Scalar>(q)), velocity = Vector::Constant(static_cast<Scalar>(v));
    Vector tau(Scalar(10), Scalar(20));
    ASSERT_EQ(effects.add_torque(static_cast<Scalar>(t), position, velocity, Vector::Zero(), Vector::Zero(),
                                 actuation, Scalar(0), tau),
              Status::kOk);
    const double sign = v > 0 ? 1 : -1;
    if (k > 0) {
      const double way = q - last, s = way > 0 ? 1 : -1;
      z = s + (z - s) * std::exp(-std::abs(way) / 0.03);
    }
    last = q;
    EXPECT_NEAR(tau[0], 10 + 1.1 * std::exp(-v * v / 0.16) * sign, tolerance);
    EXPECT_NEAR(tau[1], 20 + 0.8 * 0.75 * (z - sign) + std::exp(-t / 3) * (0.4 * sign + 0.12 * v), tolerance);
  }
}

TEST(EffectFeedForward, FollowsTheFormulasInDouble) { expect_formulas<double>(1e-12); }
TEST(EffectFeedForward, FollowsTheFormulasInFloat) { expect_formulas<float>(2e-5F); }

TEST(EffectFeedForward, FollowsTheTemperatureAndIsThatAtT0WhereItIsNotKnown) {
  EffectFeedForward<double, 2, 2> effects;
  JointEffect<double> effect{joint_effect_kind<FrictionTemperature>(), 1, {-0.04, -0.02, 30.0}};
  effect.seen.temperature = {20.0, 50.0};
  ASSERT_EQ(effects.add(effect), Status::kOk);
  using Vector = JointVector<double, 2>;
  const auto torque = [&](double qd) {
    Vector tau(10.0, 20.0);
    EXPECT_EQ(effects.add_torque(0.0, Vector::Zero(), Vector(qd, qd), Vector::Zero(), Vector::Zero(),
                                 Actuation<double>{}, 0.0, tau),
              Status::kOk);
    EXPECT_EQ(tau[0], 10.0);
    return tau[1] - 20.0;
  };
  EXPECT_EQ(torque(0.5), 0.0);
  effects.set_temperature(Vector(99.0, 45.0));
  EXPECT_NEAR(torque(0.5), (-0.04 - 0.02 * 0.5) * 15.0, 1e-12);
  EXPECT_NEAR(torque(-0.5), (0.04 + 0.02 * 0.5) * 15.0, 1e-12);
  effects.set_temperature(Vector(99.0, 90.0));  // warmer than any log: as at 50 °C
  EXPECT_NEAR(torque(0.5), (-0.04 - 0.02 * 0.5) * 20.0, 1e-12);
  effects.set_temperature(Vector(99.0, std::nan("")));  // the sensor failed
  EXPECT_EQ(torque(0.5), 0.0);
}

TEST(EffectFeedForward, RestartsAfterAReset) {
  EffectFeedForward<double, 1, 1> effects;
  ASSERT_EQ(effects.add({joint_effect_kind<Hysteresis>(), 0, {0.03}}), Status::kOk);
  const std::array<JointActuation<double>, 1> actuation{{{0, 2, 0, 0}}};
  using Vector = JointVector<double, 1>;
  const auto torque = [&](double q) {
    Vector tau = Vector::Zero();
    EXPECT_EQ(effects.add_torque(0.0, Vector(Eigen::Matrix<double, 1, 1>::Constant(q)), Vector::Zero(),
                                 Vector::Zero(), Vector::Zero(), actuation, 0.0, tau),
              Status::kOk);
    return tau[0];
  };
  EXPECT_EQ(torque(5.0), 0.0);  // the first position is no way
  EXPECT_NEAR(torque(5.03), 2 * (1 - std::exp(-1.0)), 1e-12);
  effects.reset();
  EXPECT_EQ(torque(7.0), 0.0);
}

TEST(EffectFeedForward, RefusesEffectsThatDoNotFit) {
  EffectFeedForward<double, 2, 1> effects;
  EXPECT_EQ(effects.add({joint_effect_kind<Offset>(), 2, {1.0}}), Status::kOutOfRange);
  EXPECT_EQ(effects.add({joint_effect_kind<Offset>(), -1, {1.0}}), Status::kOutOfRange);
  EXPECT_EQ(effects.add({kNumJointEffects, 0, {1.0}}), Status::kOutOfRange);
  EXPECT_EQ(effects.add({joint_effect_kind<Offset>(), 0, {std::nan("")}}), Status::kNonFiniteInput);
  EXPECT_EQ(effects.count(), 0);
  EXPECT_EQ(effects.add({joint_effect_kind<Offset>(), 0, {1.0}}), Status::kOk);
  EXPECT_EQ(effects.add({joint_effect_kind<Offset>(), 1, {1.0}}), Status::kOutOfRange);
  EXPECT_EQ(effects.count(), 1);
}

TEST(EffectFeedForward, RefusesLengthsTimesAndExponentsThatAreNotPositive) {
  EffectFeedForward<double, 1, 8> effects;
  const auto refused = [&](int kind, EffectParameters<double> parameters) {
    return effects.add({kind, 0, parameters}) == Status::kOutOfRange && effects.count() == 0;
  };
  for (const double wrong : {0.0, -0.01}) {
    EXPECT_TRUE(refused(joint_effect_kind<Hysteresis>(), {wrong}));
    EXPECT_TRUE(refused(joint_effect_kind<FrictionDrift>(), {0.5, 0.5, wrong}));
    EXPECT_TRUE(refused(joint_effect_kind<Stribeck>(), {1.0, wrong}));
    EXPECT_TRUE(refused(joint_effect_kind<ViscousNonlinear>(), {1.0, wrong}));
    EXPECT_TRUE(refused(joint_effect_kind<Ripple>(), {1.0, wrong, 0.0}));
  }
  EXPECT_TRUE(refused(joint_effect_kind<Hysteresis>(), {0.01, 1.5}));
  EXPECT_TRUE(refused(joint_effect_kind<Hysteresis>(), {0.01, -0.5}));
  // A time that single precision rounds to zero.
  EffectFeedForward<float, 1, 1> single;
  const std::array<JointEffect<double>, 1> short_time{
      {{joint_effect_kind<FrictionDrift>(), 0, {1, 1, 1e-60}}}};
  EXPECT_EQ(single.configure(short_time), Status::kOutOfRange);
  // Levels may have any sign.
  EXPECT_EQ(effects.add({joint_effect_kind<Spring>(), 0, {-2.0, 0.1}}), Status::kOk);
  EXPECT_EQ(effects.add({joint_effect_kind<Hysteresis>(), 0, {1e-12, 0.0}}), Status::kOk);
}

TEST(EffectFeedForward, CarriesTheMotionThatAnEffectWasSeenInToAnotherPrecision) {
  std::array<JointEffect<double>, 1> spring{{{joint_effect_kind<Spring>(), 0, {2.0, 0.0}}}};
  const std::array<JointActuation<float>, 1> actuation{};
  using Vector = JointVector<float, 1>;
  const auto torque_at = [&](float q) {
    EffectFeedForward<float, 1, 1> effects;
    EXPECT_EQ(effects.configure(spring), Status::kOk);
    Vector tau = Vector::Zero();
    const Vector zero = Vector::Zero();
    EXPECT_EQ(effects.add_torque(0, Vector::Constant(q), zero, zero, zero, actuation, 0, tau), Status::kOk);
    return tau[0];
  };
  EXPECT_FLOAT_EQ(torque_at(1e6F), 2e6F);  // without limits, also where double has others than float
  spring[0].seen.position = {-0.5, 0.25};
  EXPECT_FLOAT_EQ(torque_at(1.0F), 0.5F);
  EXPECT_FLOAT_EQ(torque_at(-1.0F), -1.0F);
}

TEST(EffectFeedForward, RefusesAnIntervalThatEndsBeforeItBegins) {
  EffectFeedForward<double, 1, 1> effects;
  JointEffect<double> spring{joint_effect_kind<Spring>(), 0, {2.0, 0.0}};
  for (const double wrong : {-1.0, std::nan("")}) {
    spring.seen.load = {0.0, wrong};
    EXPECT_EQ(effects.add(spring), Status::kOutOfRange);
    EXPECT_EQ(effects.count(), 0);
  }
  spring.seen.load = {0.0, 0.0};
  EXPECT_EQ(effects.add(spring), Status::kOk);
}

TEST(EffectFeedForward, LeavesTorqueAndMemoryAloneWhenTheInputIsNotFinite) {
  EffectFeedForward<double, 1, 2> effects;
  ASSERT_EQ(effects.add({joint_effect_kind<Hysteresis>(), 0, {0.03}}), Status::kOk);
  ASSERT_EQ(effects.add({joint_effect_kind<Spring>(), 0, {2.0, 0.0}}), Status::kOk);
  const std::array<JointActuation<double>, 1> actuation{{{0, 2, 0, 0}}};
  using Vector = JointVector<double, 1>;
  const auto at = [](double q) { return Vector(Eigen::Matrix<double, 1, 1>::Constant(q)); };
  const Vector zero = Vector::Zero();
  Vector tau = zero;
  ASSERT_EQ(effects.add_torque(0, at(0), zero, zero, zero, actuation, 0, tau), Status::kOk);
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()}) {
    tau = at(7);
    EXPECT_EQ(effects.add_torque(0, at(bad), zero, zero, zero, actuation, 0, tau), Status::kNonFiniteInput);
    EXPECT_EQ(tau[0], 7.0);
  }
  tau = zero;
  ASSERT_EQ(effects.add_torque(0, at(0.03), zero, zero, zero, actuation, 0, tau), Status::kOk);
  EXPECT_NEAR(tau[0], 2 * (1 - std::exp(-1.0)) + 2 * 0.03, 1e-12);
}

}  // namespace
}  // namespace heft
