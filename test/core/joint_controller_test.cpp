#include "heft/core/control/joint_controller.hpp"

#include <limits>

#include <gtest/gtest.h>

#include "heft/model/named_arms.hpp"
#include "support/random_arm.hpp"

namespace heft {
namespace {

using Arm = StaticArm<double, model::Ur5Arm>;
using Vector = Arm::Vector;
using Parameters = ReducedParameters<double, model::Ur5Arm>;

JointFeedback<double, 6> make_feedback(double stiffness, double damping, double limit) {
  JointFeedback<double, 6> feedback;
  JointFeedback<double, 6>::Config config;
  config.stiffness.setConstant(stiffness);
  config.damping.setConstant(damping);
  config.torque_limit.setConstant(limit);
  EXPECT_EQ(feedback.configure(config), Status::kOk);
  return feedback;
}

struct State {
  JointReference<double, 6> reference;
  Vector q, qd;
};

State random_state(test::Random& random) {
  State s;
  s.reference.q = test::random_vector<6>(random, 2);
  s.reference.qd = test::random_vector<6>(random, 1);
  s.reference.qdd = test::random_vector<6>(random, 3);
  s.q = s.reference.q + test::random_vector<6>(random, 0.1);
  s.qd = s.reference.qd + test::random_vector<6>(random, 0.1);
  return s;
}

TEST(ComputedTorque, MakesTheClosedLoopLinear) {
  // With exact parameters the acceleration that the torque produces is q̈_r + Kd ė + Kp e.
  const auto feedback = make_feedback(100, 20, 1e6);
  const Parameters parameters{reduced_links(model::Ur5Arm::kModel)};
  const Vector rotor = Vector::Constant(0.1);
  FrictionFeedForward<double, 6> none;
  test::Random random(1);
  for (int n = 0; n < 50; ++n) {
    const State s = random_state(random);
    Vector tau;
    ControlRecord record;
    ASSERT_EQ(computed_torque<Arm>(feedback, parameters, none, rotor, s.reference, s.q, s.qd, tau, record),
              Status::kOk);
    MassMatrix<double, 6> mass;
    Vector bias, qdd = Vector::Zero();
    const auto trig = joint_trigonometry<Arm>(s.q);
    mass_matrix<Arm>(parameters, trig, s.q, mass);
    bias_torque<Arm>(parameters, trig, s.q, s.qd, bias);
    ASSERT_EQ((forward_dynamics<double, 6>(mass, bias, rotor, tau, qdd)), Status::kOk);
    const Vector expected = s.reference.qdd + 20 * (s.reference.qd - s.qd) + 100 * (s.reference.q - s.q);
    EXPECT_LT((qdd - expected).norm(), 1e-8 * expected.norm());
    EXPECT_EQ(record.limited, 0U);
  }
}

TEST(ComputedTorque, IsTheSameWithRunTimeGeometry) {
  const auto feedback = make_feedback(100, 20, 1e6);
  auto model = model::Ur5Arm::kModel;
  for (auto& actuation : model.actuation) {
    actuation.rotor_inertia = 0.1;
  }
  const DynamicArm<double, 6> arm(model);
  const Parameters parameters{reduced_links(model::Ur5Arm::kModel)};
  FrictionFeedForward<double, 6> friction;
  friction.coulomb.setConstant(2.0);
  friction.viscous.setConstant(0.5);
  test::Random random(2);
  const State s = random_state(random);
  Vector a, b;
  ControlRecord record;
  ASSERT_EQ(computed_torque<Arm>(feedback, parameters, friction, Vector::Constant(0.1), s.reference, s.q,
                                 s.qd, a, record),
            Status::kOk);
  ASSERT_EQ((computed_torque<double, 6>(feedback, arm, friction, s.reference, s.q, s.qd, b, record)),
            Status::kOk);
  EXPECT_LT((a - b).norm(), 1e-11 * b.norm());
}

TEST(ComputedTorque, PayloadReachesEveryRow) {
  test::Random random(3);
  const auto body = test::random_body(random);
  auto loaded = model::Ur5Arm::kModel;
  for (std::size_t i = 0; i < 10; ++i) {
    loaded.links[5][i] += body[i];
  }
  const DynamicArm<double, 6> truth(loaded);
  const Parameters corrected = corrected_for_payload(Parameters{reduced_links(model::Ur5Arm::kModel)}, body);
  for (int n = 0; n < 20; ++n) {
    const auto q = test::random_vector<6>(random, 3), qd = test::random_vector<6>(random, 2),
               qdd = test::random_vector<6>(random, 5);
    const auto expected = inverse_dynamics(truth, q, qd, qdd);
    EXPECT_LT((inverse_dynamics<Arm>(corrected, q, qd, qdd) - expected).norm(), 1e-12 * expected.norm());
  }
}

TEST(PdControl, WithGravityHoldsTheArmStill) {
  const auto feedback = make_feedback(50, 5, 1e6);
  const Parameters parameters{reduced_links(model::Ur5Arm::kModel)};
  test::Random random(4);
  State s = random_state(random);
  s.q = s.reference.q;
  s.qd.setZero();
  s.reference.qd.setZero();
  Vector tau, gravity;
  ControlRecord record;
  ASSERT_EQ(pd_control<Arm>(feedback, parameters, true, s.reference, s.q, s.qd, tau, record), Status::kOk);
  gravity_torque<Arm>(parameters, joint_trigonometry<Arm>(s.q), s.q, gravity);
  EXPECT_LT((tau - gravity).norm(), 1e-12);
  const DynamicArm<double, 6> arm(model::Ur5Arm::kModel);
  ASSERT_EQ((pd_control<double, 6>(feedback, arm, true, s.reference, s.q, s.qd, tau, record)), Status::kOk);
  EXPECT_LT((tau - gravity).norm(), 1e-11);
  ASSERT_EQ(pd_control<Arm>(feedback, parameters, false, s.reference, s.q, s.qd, tau, record), Status::kOk);
  EXPECT_EQ(tau.norm(), 0.0);
}

TEST(JointFeedback, CutsTorquesAtTheLimitAndSaysWhere) {
  const auto feedback = make_feedback(0, 0, 10);
  Vector wanted, tau;
  wanted << 3, -11, 10, 12, -10, 0;
  ControlRecord record;
  ASSERT_EQ(feedback.limit(wanted, tau, record), Status::kOk);
  EXPECT_EQ(tau, (Vector() << 3, -10, 10, 10, -10, 0).finished());
  EXPECT_EQ(record.limited, 0b001010U);
}

TEST(JointFeedback, WithoutALimitRefusesWhatIsNotFiniteAllTheSame) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const auto feedback = make_feedback(0, 0, kInfinity);
  ControlRecord record;
  record.limited = 5;
  Vector wanted, tau = Vector::Constant(7);
  for (const double bad : {kInfinity, -kInfinity, std::numeric_limits<double>::quiet_NaN()}) {
    wanted << 3, 1e300, -1e300, 0, 0, bad;
    EXPECT_EQ(feedback.limit(wanted, tau, record), Status::kNonFiniteInput) << bad;
    EXPECT_EQ(tau, Vector::Constant(7)) << bad;
    EXPECT_EQ(record.limited, 5U) << bad;
  }
  wanted[5] = -4;
  EXPECT_EQ(feedback.limit(wanted, tau, record), Status::kOk);
  EXPECT_EQ(tau, wanted);
  EXPECT_EQ(record.limited, 0U);
}

TEST(JointFeedback, NeverHandsOnATorqueThatIsNotFinite) {
  const auto feedback = make_feedback(100, 20, 10);
  const Parameters parameters{reduced_links(model::Ur5Arm::kModel)};
  test::Random random(5);
  const FrictionFeedForward<double, 6> none;
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e9}) {
    State s = random_state(random);
    s.q[2] = bad;
    Vector tau = Vector::Constant(7);
    ControlRecord record;
    const Status status =
        computed_torque<Arm>(feedback, parameters, none, Vector::Zero(), s.reference, s.q, s.qd, tau, record);
    EXPECT_EQ(status, Status::kNonFiniteInput) << bad;
    EXPECT_EQ(tau, Vector::Constant(7)) << "the last good torque is kept";
  }
}

TEST(JointFeedback, RefusesSettingsOutOfRangeAndKeepsTheLast) {
  JointFeedback<double, 6> feedback = make_feedback(100, 20, 10);
  JointFeedback<double, 6>::Config config;
  config.torque_limit[3] = 0;
  EXPECT_EQ(feedback.configure(config), Status::kOutOfRange);
  config.torque_limit[3] = 1;
  config.damping[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(feedback.configure(config), Status::kOutOfRange);
  JointReference<double, 6> reference;
  reference.q.setConstant(2);
  reference.qd.setConstant(3);
  EXPECT_EQ(feedback.feedback(reference, Vector::Ones(), Vector::Ones()), Vector::Constant(100 * 1 + 20 * 2));
  Vector tau;
  ControlRecord record;
  ASSERT_EQ(feedback.limit(Vector::Constant(50), tau, record), Status::kOk);
  EXPECT_EQ(tau, Vector::Constant(10));
}

}  // namespace
}  // namespace heft
