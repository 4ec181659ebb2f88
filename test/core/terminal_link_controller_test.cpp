/// The controller that feels its load, in closed loop with an arm, and what must not harm it: every fault says which status
/// it gives, no torque is ever not finite, and the arm follows again within two seconds of good data.
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include "heft/core/control/terminal_link_controller.hpp"
#include "support/online_rig.hpp"

namespace heft {
namespace {

using test::DrivenArm;
using test::Vec6;

/// What may happen to a cycle on its way to the controller.
struct Cycle {
  JointReference<double, 6> reference;
  Vec6 q, tau;
  double dt{1e-3};
};
using Fault = std::function<void(Cycle&)>;

template <typename Scalar>
class TerminalLinkControllerOf : public ::testing::Test {
 public:
  using Controller = TerminalLinkController<model::KawasakiArm, Scalar, 4>;
  using Joints = typename Controller::Vector;

  static JointReference<double, 6> reference_at(double t) {
    JointReference<double, 6> r;
    const double ramp = t < 1 ? t * t * (3 - 2 * t) : 1, rate = t < 1 ? 6 * t * (1 - t) : 0,
                 bend = t < 1 ? 6 - 12 * t : 0;
    constexpr std::array<double, 6> kAcceleration = {3, 4, 5, 12, 9, 14};  // rms [rad/s²]
    for (int i = 0; i < 6; ++i) {
      double s = 0, v = 0, a = 0;
      for (int k = 0; k < 6; ++k) {
        const double w = 2 * std::numbers::pi * (0.27 + 0.23 * k + 0.031 * i);
        const double size = kAcceleration[static_cast<std::size_t>(i)] / std::sqrt(3.0) / (w * w);
        const double angle = w * t + 1.7 * k + 0.9 * i * k + i;
        s += size * std::sin(angle);
        v += size * w * std::cos(angle);
        a -= size * w * w * std::sin(angle);
      }
      r.q[i] = ramp * s;
      r.qd[i] = ramp * v + rate * s;
      r.qdd[i] = ramp * a + 2 * rate * v + bend * s;
    }
    return r;
  }

  static typename Controller::Config config() {
    typename Controller::Config c;
    c.stiffness.setConstant(Scalar(630));  // 4 Hz
    c.damping.setConstant(Scalar(50));
    c.torque_limit.setConstant(Scalar(20));
    return c;
  }

  /// What the controller is told: link 5 and 6 and their friction are not as they were.
  static typename Controller::Nominal nominal(const DrivenArm& arm) {
    auto n = Controller::described();
    n.rotor = arm.rotor.cast<Scalar>();
    return n;
  }

  void SetUp() override { start(config()); }
  void start(const typename Controller::Config& c) {
    arm.carry(0.25);
    ASSERT_EQ(controller.configure(c, nominal(arm)), Status::kOk);
    arm.q = reference_at(0).q;
    arm.qd = reference_at(0).qd;
  }

  /// Runs for so many seconds at 1 kHz.
  void run(double seconds, Status expected = Status::kOk, const Fault& fault = {}) {
    worst = square = 0.0;
    int count = 0;
    for (const double end = time + seconds - 1e-9; time < end; ++count) {
      Cycle c{reference_at(moves ? time : held), arm.encoders(), tau, 1e-3};
      if (!moves) c.reference.qd = c.reference.qdd = Vec6::Zero();
      const Vec6 wanted = c.reference.q;
      if (fault) fault(c);
      const JointReference<Scalar, 6> r{c.reference.q.cast<Scalar>(), c.reference.qd.cast<Scalar>(),
                                        c.reference.qdd.cast<Scalar>()};
      Joints out = tau.cast<Scalar>();
      const Joints before = out;
      ASSERT_EQ(controller.update(r, c.q.cast<Scalar>(), c.tau.cast<Scalar>(), static_cast<Scalar>(c.dt), out,
                                  record),
                expected)
          << time;
      if (expected != Status::kOk) {
        ASSERT_EQ(out, before);
      }
      for (int i = 0; i < 6; ++i) ASSERT_TRUE(std::isfinite(out[i])) << time;
      tau = out.template cast<double>();
      arm.step(tau, 1e-3);
      const double error = (wanted - arm.q).template tail<2>().norm();
      worst = std::max(worst, error);
      square += error * error;
      time += 1e-3;
    }
    rms = std::sqrt(square / std::max(1, count));
  }
  void expect_to_follow_after_two_seconds() {
    run(2.0);
    run(1.0);
    EXPECT_LT(worst, 0.03);  // half of what the nominal arm leaves on this motion [rad]
  }

  DrivenArm arm;
  Controller controller;
  typename Controller::Record record;
  Vec6 tau = Vec6::Zero();
  double time{0}, worst{0}, square{0}, rms{0}, held{0};
  bool moves{true};
};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(TerminalLinkControllerOf, Scalars);

TYPED_TEST(TerminalLinkControllerOf, FollowsBetterOnceItFeelsTheLoad) {
  this->run(12.0);
  EXPECT_EQ(this->controller.source(), EstimateSource::kInstrumental);
  EXPECT_EQ(this->controller.status(), Status::kOk);
  this->run(4.0);
  const double felt = this->rms;
  auto blind = this->config();
  blind.estimator.min_samples = 1'000'000'000;
  this->time = 0;
  this->start(blind);
  this->run(12.0);
  EXPECT_EQ(this->controller.source(), EstimateSource::kPrior);
  this->run(4.0);
  EXPECT_LT(felt, 0.4 * this->rms) << "rad against " << this->rms;
}

TYPED_TEST(TerminalLinkControllerOf, ItsVelocityIsTheArms) {
  this->run(2.0);
  double sum = 0, size = 0;
  for (int k = 0; k < 2000; ++k) {
    this->run(0.001);
    sum += (this->controller.velocity().template cast<double>() - this->arm.qd).squaredNorm();
    size += this->arm.qd.squaredNorm();
  }
  EXPECT_LT(std::sqrt(sum / size), 0.03);
}

TYPED_TEST(TerminalLinkControllerOf, NumbersThatAreNotFiniteStopTheTorqueOrTheEstimateAlone) {
  using Scalar = TypeParam;
  this->run(8.0);
  const EstimateSource source = this->controller.source();
  const auto estimate = this->controller.estimator().estimate();
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
                           static_cast<double>(std::numeric_limits<Scalar>::max())}) {
    for (int joint = 0; joint < 6; ++joint) {
      this->run(0.001, Status::kNonFiniteInput, [&](Cycle& c) { c.q[joint] = bad; });
      this->run(0.001, Status::kNonFiniteInput, [&](Cycle& c) { c.reference.qd[joint] = bad; });
      this->run(0.001, Status::kOk, [&](Cycle& c) { c.tau[joint] = bad; });
      EXPECT_EQ(this->record.measurement, Status::kNonFiniteInput);
    }
    this->run(0.001, Status::kNonFiniteInput,
              [&](Cycle& c) { c.dt = std::numeric_limits<double>::quiet_NaN(); });
  }
  EXPECT_EQ(this->controller.source(), source);
  EXPECT_EQ(this->controller.estimator().estimate(), estimate);
  this->expect_to_follow_after_two_seconds();
}

TYPED_TEST(TerminalLinkControllerOf, TorquesThatAreNeverFiniteLeaveTheNominalArm) {
  this->run(3.0, Status::kOk, [](Cycle& c) { c.tau[5] = std::numeric_limits<double>::quiet_NaN(); });
  EXPECT_EQ(this->controller.source(), EstimateSource::kPrior);
  EXPECT_EQ(this->record.measurement, Status::kNonFiniteInput);
  EXPECT_LT(this->worst, 0.5);
}

TYPED_TEST(TerminalLinkControllerOf, TimeThatStandsOrGoesBackwardsIsRefused) {
  this->run(8.0);
  for (const double dt : {0.0, -0.001, -10.0, 1e7}) {
    this->run(0.003, Status::kOutOfRange, [&](Cycle& c) { c.dt = dt; });
  }
  this->expect_to_follow_after_two_seconds();
}

TYPED_TEST(TerminalLinkControllerOf, AFrozenEncoderIsNamedAndTeachesNothing) {
  this->run(8.0);
  const double stuck = this->arm.encoders()[5];
  this->run(0.2, Status::kOk, [&](Cycle& c) { c.q[5] = stuck; });
  EXPECT_EQ(this->record.frozen, 32U);
  EXPECT_EQ(this->record.measurement, Status::kNotExcited);
  this->expect_to_follow_after_two_seconds();
  EXPECT_EQ(this->record.frozen, 0U);
}

TYPED_TEST(TerminalLinkControllerOf, TorqueLimitsAreNamedAndDoNotWindUp) {
  auto weak = this->config();
  weak.torque_limit.setConstant(TypeParam(0.5));
  this->start(weak);
  this->run(2.0);
  EXPECT_NE(this->record.limited, 0U);
  this->start(this->config());
  this->time = 0;
  this->run(8.0);
  this->expect_to_follow_after_two_seconds();
}

TYPED_TEST(TerminalLinkControllerOf, DropoutsOfFiftyMillisecondsPauseTheEstimate) {
  this->run(8.0);
  ASSERT_EQ(this->controller.source(), EstimateSource::kInstrumental);
  for (int n = 0; n < 5; ++n) {
    for (int k = 0; k < 49; ++k) {  // lost: the last torque acts on
      this->arm.step(this->tau, 1e-3);
      this->time += 1e-3;
    }
    this->run(0.001, Status::kOk, [](Cycle& c) { c.dt = 0.05; });
    EXPECT_TRUE(this->record.settling);
    EXPECT_EQ(this->record.measurement, Status::kNotExcited);
    this->run(0.5);
  }
  this->expect_to_follow_after_two_seconds();
}

/// Where the arm is held for long the estimate neither drifts nor bursts when it moves on.
TYPED_TEST(TerminalLinkControllerOf, ALongRestTeachesNothing) {
  this->run(8.0);
  this->moves = false;
  this->held = this->time;
  this->run(1.0);
  const auto rested = this->controller.estimator().estimate();
  this->run(30.0);
  EXPECT_EQ(this->controller.estimator().estimate(), rested);
  this->moves = true;
  this->arm.q = this->reference_at(this->time).q;  // carried there by hand
  this->arm.qd = this->reference_at(this->time).qd;
  this->expect_to_follow_after_two_seconds();
}

TYPED_TEST(TerminalLinkControllerOf, AFlickeringLoadIsOvercome) {
  this->run(4.0);
  for (int n = 0; n < 24; ++n) {
    this->arm.carry(n % 2 == 0 ? 0.0 : 0.25);
    this->run(0.125);
  }
  this->arm.carry(0.25);
  this->expect_to_follow_after_two_seconds();
}

TYPED_TEST(TerminalLinkControllerOf, AnEstimateWithAnImpossibleMassMatrixIsNotUsed) {
  // Reported torques of joint 6 have the wrong sign: what fits them is a negative inertia about its axis.
  int refused = 0;
  for (int k = 0; k < 100; ++k) {
    this->run(0.1, Status::kOk, [&](Cycle& c) {
      c.tau[5] = -c.tau[5];
      refused += this->record.estimate_refused ? 1 : 0;
    });
    EXPECT_LT(this->worst, 0.2);
  }
  EXPECT_GT(refused, 0);
  EXPECT_EQ(this->controller.source(), EstimateSource::kPrior);
}

TYPED_TEST(TerminalLinkControllerOf, RefusesSettingsOutsideTheirRanges) {
  using Scalar = TypeParam;
  const auto status_with = [](auto change) {
    typename TestFixture::Controller fresh;
    auto c = TestFixture::config();
    change(c);
    return fresh.configure(c);
  };
  EXPECT_EQ(status_with([](auto&) {}), Status::kOk);
  for (const Scalar bad : {std::numeric_limits<Scalar>::quiet_NaN(), Scalar(-1)}) {
    EXPECT_EQ(status_with([&](auto& c) { c.stiffness[0] = bad; }), Status::kOutOfRange);
    EXPECT_EQ(status_with([&](auto& c) { c.damping[1] = bad; }), Status::kOutOfRange);
    EXPECT_EQ(status_with([&](auto& c) { c.torque_limit[2] = bad; }), Status::kOutOfRange);
    EXPECT_EQ(status_with([&](auto& c) { c.velocity_hz = bad; }), Status::kOutOfRange);
    EXPECT_EQ(status_with([&](auto& c) { c.filter_hz = bad; }), Status::kOutOfRange);
    EXPECT_EQ(status_with([&](auto& c) { c.update_rate = bad; }), Status::kOutOfRange);
    EXPECT_EQ(status_with([&](auto& c) { c.sign_width = bad; }), Status::kOutOfRange);
    EXPECT_EQ(status_with([&](auto& c) { c.least_inertia = bad; }), Status::kOutOfRange);
    EXPECT_EQ(status_with([&](auto& c) { c.estimator.gate = bad; }), Status::kOutOfRange);
  }
  typename TestFixture::Controller fresh;
  typename TestFixture::Joints out = TestFixture::Joints::Zero();
  EXPECT_EQ(fresh.update({}, out, out, Scalar(0.001), out, this->record), Status::kNotConfigured);
  EXPECT_EQ(fresh.status(), Status::kNotConfigured);
}

}  // namespace
}  // namespace heft
