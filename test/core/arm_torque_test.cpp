/// The torque of a whole model in one call: payload, gravity, memory, refusals. That it is the host's torque of an exported
/// model is in test/tools/exported_arm_test.cpp.
#include <array>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "heft/core/dynamics/arm_torque.hpp"
#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/model/named_arms.hpp"
#include "support/random_arm.hpp"

namespace heft {
namespace {

/// The UR5 with what a header may hold besides.
struct Ur5WithEffects {
  static constexpr auto kModel = model::Ur5Arm::kModel;
  static constexpr std::array<double, 9> kTipRotation{0, -1, 0, 1, 0, 0, 0, 0, 1};
  static constexpr std::array<double, 3> kTipPosition{0.01, -0.02, 0.05};
  static constexpr std::array<GearCoupling<double>, 1> kCouplings{{{4, 5, -1.0, 0.01, 0.3, 0.1}}};
  static constexpr std::array<JointEffect<double>, 4> kEffects{
      {{joint_effect_kind("hysteresis"), 1, {0.01, 0.2}},
       {joint_effect_kind("offset"), 2, {0.4}},
       {joint_effect_kind("rotor_inertia"), 0, {0.5}},
       {joint_effect_kind("friction_drift"), 3, {0.5, 0.3, 30.0}}}};
};

template <typename Scalar>
class ArmTorqueOf : public ::testing::Test {
 public:
  using Torque = ArmTorque<Ur5WithEffects, Scalar>;
  using Joints = typename Torque::Vector;
  static constexpr double kRounding = std::is_same_v<Scalar, float> ? 2e-5 : 1e-12;

  static Joints random_vector(test::Random& random, double size) {
    Joints v;
    for (int i = 0; i < 6; ++i) v[i] = static_cast<Scalar>(test::uniform(random, -size, size));
    return v;
  }
};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(ArmTorqueOf, Scalars);

/// The description in one piece at run time.
template <typename Scalar>
void configure(ArmTorque<RunTimeArm<6, 4, 1>, Scalar>& torque) {
  ASSERT_EQ(torque.configure(converted<Scalar>(Ur5WithEffects::kModel)), Status::kOk);
  ASSERT_EQ(torque.add(converted<Scalar>(Ur5WithEffects::kCouplings[0])), Status::kOk);
  for (const auto& effect : Ur5WithEffects::kEffects) {
    ASSERT_EQ(torque.add(converted<Scalar>(effect)), Status::kOk);
  }
}

/// Two geometries that share no code below the link step, with a payload and a tilted base.
TYPED_TEST(ArmTorqueOf, CompileTimeAndRunTimeDescriptionAgree) {
  using Scalar = TypeParam;
  using Vector = typename TestFixture::Joints;
  typename TestFixture::Torque fixed;
  ArmTorque<RunTimeArm<6, 4, 1>, Scalar> free;
  ASSERT_EQ(fixed.configure(), Status::kOk);
  configure(free);
  test::Random random(11);
  Vector q = Vector::Zero();
  for (int n = 0; n < 200; ++n) {
    if (n == 100) {
      const auto payload = make_inertial_parameters<Scalar>(
          Scalar(3), {Scalar(0.05), Scalar(-0.02), Scalar(0.1)},
          {Scalar(0.02), Scalar(0.001), Scalar(0.03), Scalar(0), Scalar(-0.002), Scalar(0.025)});
      const std::array<Scalar, 3> gravity{Scalar(3), Scalar(-4), Scalar(-8)};
      ASSERT_EQ(fixed.set_payload(payload), Status::kOk);
      ASSERT_EQ(free.set_payload(payload), Status::kOk);
      ASSERT_EQ(fixed.set_gravity(gravity), Status::kOk);
      ASSERT_EQ(free.set_gravity(gravity), Status::kOk);
    }
    q += TestFixture::random_vector(random, 0.02);
    const Vector qd = TestFixture::random_vector(random, 2), qdd = TestFixture::random_vector(random, 5);
    Vector a, b;
    ASSERT_EQ(fixed.update(Scalar(0.01), q, qd, qdd, a), Status::kOk);
    ASSERT_EQ(free.update(Scalar(0.01), q, qd, qdd, b), Status::kOk);
    const double size = 1.0 + static_cast<double>(b.cwiseAbs().maxCoeff());
    EXPECT_LT(static_cast<double>((a - b).cwiseAbs().maxCoeff()), TestFixture::kRounding * size) << n;
  }
}

/// What a payload adds is what the same body adds as part of the last link.
TYPED_TEST(ArmTorqueOf, APayloadAtTheFlangeIsABodyOnTheLastLink) {
  using Scalar = TypeParam;
  using Vector = typename TestFixture::Joints;
  const double m = 2.0;
  const std::array<double, 3> com{0.03, 0.01, 0.06};
  ArmTorque<Ur5WithEffects, Scalar> with, without;
  ASSERT_EQ(with.configure(), Status::kOk);
  ASSERT_EQ(without.configure(), Status::kOk);
  ASSERT_EQ(with.set_payload(static_cast<Scalar>(m), converted<Scalar>(com), {}), Status::kOk);
  // A point at R com + p, by hand: the flange is turned a quarter about z.
  const std::array<double, 3> at{0.01 - 0.01, -0.02 + 0.03, 0.05 + 0.06};
  ArmModel<double, 6> bare, loaded = model::Ur5Arm::kModel;
  bare = loaded;
  const auto point = make_inertial_parameters<double>(m, at, {});
  for (std::size_t i = 0; i < 10; ++i) loaded.links[5][i] += point[i];
  test::Random random(12);
  for (int n = 0; n < 50; ++n) {
    const Vector q = TestFixture::random_vector(random, 3), qd = TestFixture::random_vector(random, 2),
                 qdd = TestFixture::random_vector(random, 5);
    Vector a, b;
    ASSERT_EQ(with.update(Scalar(0.01), q, qd, qdd, a), Status::kOk);
    ASSERT_EQ(without.update(Scalar(0.01), q, qd, qdd, b), Status::kOk);
    const JointVector<double, 6> qq = q.template cast<double>(), v = qd.template cast<double>(),
                                 acc = qdd.template cast<double>();
    const JointVector<double, 6> expected = inverse_dynamics(DynamicArm<double, 6>(loaded), qq, v, acc) -
                                            inverse_dynamics(DynamicArm<double, 6>(bare), qq, v, acc);
    EXPECT_LT(((a - b).template cast<double>() - expected).cwiseAbs().maxCoeff(),
              100 * TestFixture::kRounding)
        << n;
  }
}

TYPED_TEST(ArmTorqueOf, FollowsTheTemperatureOfAJoint) {
  using Scalar = TypeParam;
  using Vector = typename TestFixture::Joints;
  ArmTorque<RunTimeArm<6, 4, 1>, Scalar> warm, plain;
  configure(warm);
  configure(plain);
  JointEffect<Scalar> effect;
  effect.kind = joint_effect_kind<FrictionTemperature>();
  effect.joint = 4;
  effect.parameters = {Scalar(-0.01), Scalar(-0.02), Scalar(25)};
  ASSERT_EQ(warm.add(effect), Status::kOk);
  warm.set_temperature(Vector::Constant(Scalar(45)));
  const Vector q = Vector::Zero(), qd = Vector::Constant(Scalar(0.7));
  Vector a, b;
  ASSERT_EQ(warm.update(Scalar(0.01), q, qd, q, a), Status::kOk);
  ASSERT_EQ(plain.update(Scalar(0.01), q, qd, q, b), Status::kOk);
  for (int i = 0; i < 6; ++i) {
    const double expected = i == 4 ? (-0.01 - 0.02 * 0.7) * 20.0 : 0.0;
    EXPECT_NEAR(static_cast<double>(a[i] - b[i]), expected, 10 * TestFixture::kRounding) << i;
  }
}

TYPED_TEST(ArmTorqueOf, ARefusalLeavesTorqueMemoryAgeAndPayload) {
  using Scalar = TypeParam;
  using Vector = typename TestFixture::Joints;
  typename TestFixture::Torque struck, untouched;
  Vector out = Vector::Constant(Scalar(42));
  EXPECT_EQ(struck.update(Scalar(0.01), Vector::Zero(), Vector::Zero(), Vector::Zero(), out),
            Status::kNotConfigured);
  EXPECT_EQ(struck.set_payload({}), Status::kNotConfigured);
  ASSERT_EQ(struck.configure(), Status::kOk);
  ASSERT_EQ(untouched.configure(), Status::kOk);
  const Scalar nan = std::numeric_limits<Scalar>::quiet_NaN(), inf = std::numeric_limits<Scalar>::infinity();
  const Vector one = Vector::Ones();
  for (int k = 0; k < 100; ++k) {
    const Vector q = one * static_cast<Scalar>(std::sin(0.1 * k)),
                 qd = one * static_cast<Scalar>(std::cos(0.1 * k));
    Vector a, b;
    ASSERT_EQ(struck.update(Scalar(0.01), q, qd, q, a), Status::kOk);
    ASSERT_EQ(untouched.update(Scalar(0.01), q, qd, q, b), Status::kOk);
    ASSERT_EQ(a, b) << k;
    for (const Scalar bad : {nan, inf, -inf, std::numeric_limits<Scalar>::max()}) {
      Vector wild = q;
      wild[k % 6] = bad;
      EXPECT_EQ(struck.update(Scalar(0.01), wild, qd, q, out), Status::kNonFiniteInput);
      EXPECT_EQ(struck.update(Scalar(0.01), q, wild, q, out), Status::kNonFiniteInput);
      EXPECT_EQ(struck.update(Scalar(0.01), q, qd, wild, out), Status::kNonFiniteInput);
    }
    for (const Scalar bad : {nan, inf}) {
      EXPECT_EQ(struck.update(bad, q, qd, q, out), Status::kNonFiniteInput);
      EXPECT_EQ(struck.set_gravity({Scalar(0), bad, Scalar(0)}), Status::kNonFiniteInput);
    }
    for (const double bad : {0.0, -0.01, 2e6}) {
      EXPECT_EQ(struck.update(static_cast<Scalar>(bad), q * Scalar(2), qd, q, out), Status::kOutOfRange);
    }
    EXPECT_EQ(struck.set_payload(Scalar(-1), {}, {}), Status::kNotPositiveDefinite);
    EXPECT_EQ(
        struck.set_payload(Scalar(1), {}, {Scalar(1), Scalar(0), Scalar(1), Scalar(0), Scalar(0), Scalar(3)}),
        Status::kNotPositiveDefinite);
  }
  EXPECT_EQ(out, Vector::Constant(Scalar(42)));
  EXPECT_EQ(struck.time(), untouched.time());
}

TYPED_TEST(ArmTorqueOf, RefusesSettingsAndPartsOutsideTheirRanges) {
  using Scalar = TypeParam;
  typename TestFixture::Torque torque;
  for (const Scalar bad : {Scalar(-1), std::numeric_limits<Scalar>::quiet_NaN()}) {
    EXPECT_EQ(torque.configure({.sign_width = bad}), Status::kOutOfRange);
    EXPECT_EQ(torque.configure({.start_time = bad}), Status::kOutOfRange);
  }
  ArmTorque<RunTimeArm<6, 1, 1>, Scalar> small;
  EXPECT_EQ(small.add(JointEffect<Scalar>{}), Status::kNotConfigured);
  ASSERT_EQ(small.configure(converted<Scalar>(model::Ur5Arm::kModel)), Status::kOk);
  EXPECT_EQ(small.add(GearCoupling<Scalar>{2, 2}), Status::kOutOfRange);
  EXPECT_EQ(small.add(GearCoupling<Scalar>{2, 6}), Status::kOutOfRange);
  EXPECT_EQ(small.add(GearCoupling<Scalar>{2, 3}), Status::kOk);
  EXPECT_EQ(small.add(GearCoupling<Scalar>{3, 4}), Status::kOutOfRange);  // no room
  EXPECT_EQ(small.add(JointCable<Scalar>{2, 2}), Status::kOutOfRange);
  EXPECT_EQ(small.add(JointCable<Scalar>{2, 3, Scalar(1), Scalar(-1)}), Status::kOutOfRange);
  EXPECT_EQ(small.add(JointCable<Scalar>{2, 3, Scalar(1), Scalar(1), Scalar(0), {Scalar(1), Scalar(-1)}}),
            Status::kOutOfRange);
  EXPECT_EQ(small.add(JointCable<Scalar>{2, 3, std::numeric_limits<Scalar>::infinity(), Scalar(1)}),
            Status::kNonFiniteInput);
  EXPECT_EQ(small.add(JointCable<Scalar>{2, 3, Scalar(1), Scalar(1)}), Status::kOk);
  EXPECT_EQ(small.add(JointCable<Scalar>{2, 3, Scalar(1), Scalar(1)}), Status::kOutOfRange);  // no room
  EXPECT_EQ(small.add(JointEffect<Scalar>{joint_effect_kind<Offset>(), 6, {}}), Status::kOutOfRange);
  EXPECT_EQ(small.add(JointEffect<Scalar>{joint_effect_kind<Spring>(), 0, {Scalar(1), Scalar(1)}}),
            Status::kOk);
  EXPECT_EQ(small.add(JointEffect<Scalar>{joint_effect_kind<Spring>(), 0, {Scalar(1), Scalar(1)}}),
            Status::kOutOfRange);
}

/// A float of seconds stops after 4.6 hours at 1 kHz; ten hours in, a joint still warms up.
TYPED_TEST(ArmTorqueOf, AgeIsRightAfterTenHours) {
  using Scalar = TypeParam;
  RunClock<Scalar> clock;
  clock.advance(Scalar(36000));
  for (int k = 0; k < 100'000; ++k) clock.advance(Scalar(0.001));
  EXPECT_NEAR(static_cast<double>(clock.seconds()), 36100.0, 0.01);
}

}  // namespace
}  // namespace heft
