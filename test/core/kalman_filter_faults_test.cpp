/// What must not harm the Kalman filters. Every case says which status it gives, never shows a number that is not finite, and friction
/// is right again within two seconds of good data.
#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <limits>

#include <gtest/gtest.h>

#include "heft/core/converted.hpp"
#include "heft/core/estimate/extended_kalman_filter.hpp"
#include "heft/core/estimate/unscented_kalman_filter.hpp"
#include "support/two_link_arm.hpp"

namespace heft {
namespace {

using test::TwoLinkRig;
using test::TwoLinkSample;

template <typename Filter>
class KalmanFilterFaults : public ::testing::Test {
 public:
  using Scalar = typename Filter::Scalar;

  void SetUp() override {
    ASSERT_EQ(filter.configure(config(), converted<Scalar>(test::TwoLinkArm::model())), Status::kOk);
    rig.arm.coulomb *= 0.8;  // known to the arm only
    run(3.0, Status::kOk);
    expect_right();
  }

  static typename Filter::Config config() {
    typename Filter::Config c;
    c.position_noise.setConstant(Scalar(TwoLinkRig::kPositionNoise));
    c.velocity_noise.setConstant(Scalar(TwoLinkRig::kVelocityNoise));
    c.torque_noise.setConstant(Scalar(TwoLinkRig::kTorqueNoise));
    c.torque_limit.setConstant(Scalar(200));
    // Within two seconds a friction that went wrong must be found again.
    c.coulomb.time = c.viscous.time = Scalar(2);
    return c;
  }

  /// So many seconds with a fault in each sample.
  void run(double seconds, Status expected, const std::function<void(TwoLinkSample&)>& fault = {}) {
    const double end = rig.time() + seconds - 1e-9;
    while (rig.time() < end) {
      TwoLinkSample s = rig.next();
      if (fault) fault(s);
      ASSERT_EQ(take(s), expected) << rig.time();
      look();
    }
  }
  Status take(const TwoLinkSample& s) {
    const typename Filter::Vector q = s.q.template cast<Scalar>(), qd = s.qd.template cast<Scalar>(),
                                  tau = s.tau.template cast<Scalar>();
    return with_velocity ? filter.update(q, qd, tau, static_cast<Scalar>(s.dt), record)
                         : filter.update(q, tau, static_cast<Scalar>(s.dt), record);
  }
  void look() {
    for (int i = 0; i < Filter::kStates; ++i) {
      ASSERT_TRUE(std::isfinite(filter.state()[static_cast<std::size_t>(i)])) << rig.time();
      const Scalar variance = filter.covariance(i, i);
      ASSERT_TRUE(std::isfinite(variance) && variance > Scalar(0)) << rig.time();
    }
    for (int i = 0; i < 2; ++i) {
      ASSERT_GE(filter.coulomb(i), Scalar(0)) << rig.time();
      // Priors: 3 and 1.25 N·m, 1.5 and 0.5 N·m·s/rad.
      ASSERT_LT(filter.standard_deviation(Filter::kCoulomb + i), Scalar(3.01)) << rig.time();
      ASSERT_LT(filter.standard_deviation(Filter::kViscous + i), Scalar(1.51)) << rig.time();
    }
  }
  void expect_right() {
    EXPECT_TRUE(filter.running());
    for (int i = 0; i < 2; ++i) {
      EXPECT_NEAR(static_cast<double>(filter.position()[i]), rig.arm.q[i], 0.01) << rig.time();
      EXPECT_NEAR(static_cast<double>(filter.velocity()[i]), rig.arm.qd[i], 0.05) << rig.time();
      EXPECT_NEAR(static_cast<double>(filter.coulomb(i)), rig.arm.coulomb[i], 0.25 * rig.arm.coulomb[i])
          << rig.time();
    }
  }
  void expect_right_after_two_seconds() {
    run(2.0, Status::kOk);
    expect_right();
    EXPECT_EQ(record.refused | record.frozen | record.clipped, 0U);
  }

  TwoLinkRig rig{11};
  Filter filter;
  typename Filter::Record record;
  bool with_velocity{true};
};
using Filters = ::testing::Types<ExtendedKalmanFilter<float, 2>, ExtendedKalmanFilter<double, 2>,
                                 UnscentedKalmanFilter<float, 2>, UnscentedKalmanFilter<double, 2>>;
TYPED_TEST_SUITE(KalmanFilterFaults, Filters);

TYPED_TEST(KalmanFilterFaults, NumbersThatAreNotFiniteAreRefusedAndLeaveNoTrace) {
  using S = typename TypeParam::Scalar;
  const auto before = this->filter.state();
  const S variance = this->filter.covariance(4, 4);
  const S nan = std::numeric_limits<S>::quiet_NaN(), inf = std::numeric_limits<S>::infinity();
  for (const S value : {nan, inf, -inf, std::numeric_limits<S>::max()}) {
    const double bad = static_cast<double>(value);
    for (int joint = 0; joint < 2; ++joint) {
      this->run(0.002, Status::kNonFiniteInput, [&](TwoLinkSample& s) { s.q[joint] = bad; });
      this->run(0.002, Status::kNonFiniteInput, [&](TwoLinkSample& s) { s.qd[joint] = bad; });
      this->run(0.002, Status::kNonFiniteInput, [&](TwoLinkSample& s) { s.tau[joint] = bad; });
    }
    this->run(0.002, Status::kNonFiniteInput, [&](TwoLinkSample& s) { s.dt = bad; });
  }
  EXPECT_EQ(this->filter.state(), before);
  EXPECT_EQ(this->filter.covariance(4, 4), variance);
  // 56 samples are missing, and the clock of the caller does not know.
  this->expect_right_after_two_seconds();
}

TYPED_TEST(KalmanFilterFaults, TimeThatStandsOrGoesBackwardsIsRefusedAndLeavesNoTrace) {
  const auto before = this->filter.state();
  for (const double dt : {0.0, -0.001, -100.0, 1e7}) {
    this->run(0.005, Status::kOutOfRange, [&](TwoLinkSample& s) { s.dt = dt; });
  }
  EXPECT_EQ(this->filter.state(), before);
  this->expect_right_after_two_seconds();
}

TYPED_TEST(KalmanFilterFaults, DropoutsOfFiftyMillisecondsStartTheMotionAgainAndKeepFriction) {
  const auto coulomb = this->filter.coulomb();
  for (const bool measured : {true, false}) {
    this->with_velocity = measured;
    int restarts = 0;
    for (int n = 0; n < 10; ++n) {
      for (int k = 0; k < 49; ++k) this->rig.next();  // lost
      TwoLinkSample s = this->rig.next();
      s.dt = 0.05;
      ASSERT_EQ(this->take(s), Status::kOk);
      EXPECT_EQ(this->filter.running(), measured);
      restarts += this->record.restarted ? 1 : 0;
      if (measured) {  // what friction had to do with the motion before is over
        EXPECT_EQ(this->filter.covariance(0, TypeParam::kCoulomb), 0);
        EXPECT_NEAR(static_cast<double>(this->filter.standard_deviation(0)), TwoLinkRig::kPositionNoise,
                    1e-8);
      }
      for (int k = 0; k < 100; ++k) {
        ASSERT_EQ(this->take(this->rig.next()), Status::kOk);
        restarts += this->record.restarted ? 1 : 0;
        this->look();
      }
      EXPECT_EQ(this->record.refused, 0U);
    }
    EXPECT_EQ(restarts, 10);
  }
  for (int i = 0; i < 2; ++i) EXPECT_NEAR(this->filter.coulomb()[i] / coulomb[i], 1, 0.3);
  this->expect_right_after_two_seconds();
}

TYPED_TEST(KalmanFilterFaults, OutliersAreLeftOut) {
  int refused = 0, number = 0;
  const auto coulomb = this->filter.coulomb();
  this->run(0.2, Status::kOk, [&](TwoLinkSample& s) {
    if (++number % 4 == 0) s.q[1] += number % 8 == 0 ? 1.0 : -1e5, s.qd[0] += 50.0;
  });
  for (int n = 0; n < 50; ++n) {
    TwoLinkSample s = this->rig.next();
    if (n % 5 == 0) s.q[0] += 0.5;
    ASSERT_EQ(this->take(s), Status::kOk);
    refused += this->record.refused == 1U ? 1 : 0;
    EXPECT_FALSE(this->record.restarted);
  }
  EXPECT_EQ(refused, 10);
  for (int i = 0; i < 2; ++i) EXPECT_NEAR(this->filter.coulomb()[i] / coulomb[i], 1, 0.2);
  this->expect_right_after_two_seconds();
}

/// An encoder that jumps by half a radian and stays there: another zero, not an outlier.
TYPED_TEST(KalmanFilterFaults, APositionThatJumpsForGoodStartsTheMotionAgain) {
  int restarts = 0;
  for (int n = 0; n < 200; ++n) {
    TwoLinkSample s = this->rig.next();
    s.q[0] += 0.5;
    ASSERT_EQ(this->take(s), Status::kOk);
    this->look();
    restarts += this->record.restarted ? 1 : 0;
  }
  EXPECT_EQ(restarts, 1);
  EXPECT_NEAR(static_cast<double>(this->filter.position()[0]), this->rig.arm.q[0] + 0.5, 0.01);
  this->expect_right_after_two_seconds();
}

TYPED_TEST(KalmanFilterFaults, TimeIsCheckedAfterALossToo) {
  for (int n = 0; n < 200 && this->filter.running(); ++n) {
    TwoLinkSample s = this->rig.next();
    s.q[0] += 0.5;
    ASSERT_EQ(this->take(s), Status::kOk);
  }
  ASSERT_FALSE(this->filter.running());
  const auto before = this->filter.state();
  for (const double dt : {0.0, -0.001, -100.0, 1e7}) {
    this->run(0.001, Status::kOutOfRange, [&](TwoLinkSample& s) { s.dt = dt; });
  }
  EXPECT_FALSE(this->filter.running());
  EXPECT_EQ(this->filter.state(), before);
  this->expect_right_after_two_seconds();
}

TYPED_TEST(KalmanFilterFaults, AFrozenEncoderIsNamedAndTeachesNothing) {
  for (const bool measured : {true, false}) {
    this->with_velocity = measured;
    double stuck = 0;
    int named = 0;
    this->run(0.001, Status::kOk, [&](TwoLinkSample& s) { stuck = s.q[1]; });
    for (int n = 0; n < 1000; ++n) {
      TwoLinkSample s = this->rig.next();
      s.q[1] = stuck;
      if (!measured) s.qd[1] = 0;
      ASSERT_EQ(this->take(s), Status::kOk);
      this->look();
      named += this->record.frozen == 2U ? 1 : 0;
      EXPECT_EQ(this->record.running && this->record.frozen != 0, false);
    }
    EXPECT_GT(named, 500);
    this->expect_right_after_two_seconds();
  }
}

/// The joint stands, and its velocity says so: the encoder is well.
TYPED_TEST(KalmanFilterFaults, AHardStopIsNoFrozenEncoder) {
  while (std::abs(this->rig.arm.qd[1]) < 1.5) this->run(0.001, Status::kOk);
  double stop = 0;
  this->run(0.001, Status::kOk, [&](TwoLinkSample& s) { stop = s.q[1]; });
  int running = 0;
  for (int n = 0; n < 500; ++n) {
    TwoLinkSample s = this->rig.next();
    s.q[1] = stop;
    s.qd[1] = 0;
    ASSERT_EQ(this->take(s), Status::kOk);
    this->look();
    ASSERT_EQ(this->record.frozen, 0U) << n;
    running += this->filter.running() ? 1 : 0;
  }
  EXPECT_GT(running, 400);
  this->expect_right_after_two_seconds();
}

TYPED_TEST(KalmanFilterFaults, ATorqueAtItsLimitIsNamedAndTakenAsUnknown) {
  auto config = this->config();
  using S = typename TypeParam::Scalar;
  config.torque_limit[0] = S(30);
  ASSERT_EQ(this->filter.configure(config, converted<S>(test::TwoLinkArm::model())), Status::kOk);
  int named = 0, restarts = 0, refused = 0;
  double worst = 0;
  for (int n = 0; n < 5000; ++n) {
    TwoLinkSample s = this->rig.next();
    s.tau[0] = std::min(30.0, std::max(-30.0, s.tau[0]));
    ASSERT_EQ(this->take(s), Status::kOk);
    this->look();
    named += (this->record.clipped & 1U) != 0 ? 1 : 0;
    restarts += this->record.restarted ? 1 : 0;
    refused += std::popcount(this->record.refused | this->record.refused_velocity);
    if (n > 2000) {
      const double error = static_cast<double>(this->filter.coulomb(0)) - this->rig.arm.coulomb[0];
      worst = std::max(worst, std::abs(error) / this->rig.arm.coulomb[0]);
    }
  }
  EXPECT_EQ(restarts, 1) << "that of the start";
  EXPECT_LT(refused, 10);
  EXPECT_GT(named, 500);
  EXPECT_LT(named, 4500);
  // Half of the time joint 1 shows nothing.
  EXPECT_LT(worst, 0.4);
  EXPECT_NEAR(static_cast<double>(this->filter.coulomb(1)), this->rig.arm.coulomb[1],
              0.25 * this->rig.arm.coulomb[1]);
}

/// A load that the filter knows nothing of, on and off.
TYPED_TEST(KalmanFilterFaults, AFlickeringLoadIsOvercome) {
  for (int n = 0; n < 20; ++n) {
    this->rig.arm.load = n % 2 == 0 ? 1.0 : 0.0;
    this->run(0.1, Status::kOk);
  }
  this->rig.arm.load = 0;
  this->expect_right_after_two_seconds();
}

/// Half an hour in samples of 0.2 s, which show nothing, then 20 s at rest in the loop.
TYPED_TEST(KalmanFilterFaults, WithoutExcitationNothingGrowsBeyondThePrior) {
  TwoLinkSample s = this->rig.next();
  s.qd.setZero();
  s.dt = 0.2;
  for (int n = 0; n < 9000; ++n) {
    s.q[0] += n % 2 == 0 ? 1e-5 : -1e-5;
    ASSERT_EQ(this->take(s), Status::kOk);
    this->look();
  }
  s.dt = 1e-3;
  for (int n = 0; n < 20'000; ++n) {
    s.q[0] += n % 2 == 0 ? 1e-5 : -1e-5;
    ASSERT_EQ(this->take(s), Status::kOk);
    this->look();
  }
  this->expect_right_after_two_seconds();
}

TYPED_TEST(KalmanFilterFaults, SettingsOutOfRangeAreRefusedAndTheOldOnesKept) {
  using S = typename TypeParam::Scalar;
  const auto model = converted<S>(test::TwoLinkArm::model());
  const auto before = this->filter.state();
  const auto with = [&](auto change) {
    auto config = this->config();
    auto arm = model;
    change(config, arm);
    return this->filter.configure(config, arm);
  };
  const S nan = std::numeric_limits<S>::quiet_NaN();
  EXPECT_EQ(with([](auto& c, auto&) { c.period = S(0); }), Status::kOutOfRange);
  EXPECT_EQ(with([](auto& c, auto&) { c.sign_width = S(0); }), Status::kOutOfRange);
  EXPECT_EQ(with([](auto& c, auto&) { c.torque_noise[1] = S(0); }), Status::kOutOfRange);
  EXPECT_EQ(with([&](auto& c, auto&) { c.coulomb.std[0] = nan; }), Status::kOutOfRange);
  EXPECT_EQ(with([](auto& c, auto&) { c.viscous.time = S(-1); }), Status::kOutOfRange);
  EXPECT_EQ(with([&](auto&, auto& arm) { arm.links[1][kMass] = nan; }), Status::kNonFiniteInput);
  EXPECT_EQ(this->filter.state(), before);
  this->run(0.1, Status::kOk);
  TypeParam empty;
  EXPECT_EQ(empty.update(this->filter.position(), this->filter.position(), S(1e-3), this->record),
            Status::kNotConfigured);
}

}  // namespace
}  // namespace heft
