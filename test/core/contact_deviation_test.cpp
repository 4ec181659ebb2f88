// What ContactDeviation makes of a torque from outside, against closed forms of the filter and the rules of each phase.
#include "heft/core/monitor/contact_deviation.hpp"

#include <cmath>

#include <gtest/gtest.h>

namespace heft {
namespace {

constexpr double kPeriod = 0.002, kThreshold = 2.0, kFriction = 5.0, kBandwidth = 40.0, kRate = 10.0;

/// Two joints at given speeds; the torque from outside is that of the first.
template <typename Scalar>
class Joints {
 public:
  using Deviation = ContactDeviation<Scalar, 2>;
  using Vector = typename Deviation::Vector;

  Joints() {
    thresholds.bandwidth = static_cast<Scalar>(kBandwidth);
    thresholds.adaptation = static_cast<Scalar>(kRate);
    thresholds.load_rate = Scalar(100);
    thresholds.joints.fill(
        JointThreshold<Scalar>::uniform(static_cast<Scalar>(kThreshold), static_cast<Scalar>(kFriction)));
    thresholds.joints[0].turning_change = static_cast<Scalar>(3 * kThreshold);
    thresholds.joints[0].top_speed = Scalar(2);
    deviation.configure(thresholds);
  }
  void step(double outside, double hold = 0.0) {
    explained += rate * kPeriod;
    deviation.update({static_cast<Scalar>(outside), Scalar(0)}, {static_cast<Scalar>(load), static_cast<Scalar>(explained)},
                     {static_cast<Scalar>(speed[0]), static_cast<Scalar>(speed[1])},
                     static_cast<Scalar>(kPeriod), static_cast<Scalar>(hold), record);
  }
  void run(double seconds, double outside) {
    for (double t = 0; t < seconds; t += kPeriod) step(outside);
  }
  /// Change of the first joint against its threshold.
  double share() const {
    return std::abs(static_cast<double>(record.change[0] / record.change_threshold[0]));
  }

  typename Deviation::Thresholds thresholds;
  Deviation deviation;
  typename Deviation::Record record;
  double speed[2] = {1.0, 1.0};
  double load{0};                ///< torque that the model explains, of the first joint
  double explained{0}, rate{0};  ///< of the second
};

template <typename Scalar>
class ContactDeviationTest : public ::testing::Test {};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(ContactDeviationTest, Scalars);

TYPED_TEST(ContactDeviationTest, AMovingJointShowsARampAfterTheLagOfTheLowPass) {
  Joints<TypeParam> joints;
  joints.run(3.0, 0.0);
  ASSERT_EQ(joints.record.phase[0], MotionPhase::kMoving);
  const double rate = 30.0, seconds = 0.05;
  for (double t = kPeriod; t < seconds + 0.5 * kPeriod; t += kPeriod) joints.step(rate * t);
  // R (t − (1 − e^{−Kt}) / K); half a sample late, since a sample is a mean over its period.
  const double exact = rate * (seconds - (1 - std::exp(-40 * seconds)) / 40);
  EXPECT_NEAR(joints.record.residual[0], exact, rate * kPeriod);
}

TYPED_TEST(ContactDeviationTest, ItsChangeIsWhatTheMeanOfLateHasNotFollowed) {
  Joints<TypeParam> joints;
  joints.run(3.0, 3.0);
  EXPECT_NEAR(joints.record.change[0], 0.0, 1e-3);
  const double rate = 30.0, seconds = 0.05;
  for (double t = kPeriod; t < seconds + 0.5 * kPeriod; t += kPeriod) joints.step(3.0 + rate * t);
  // A ramp through K/(s + K) · s/(s + A), half a sample late.
  const double lags =
      (1 - std::exp(-kRate * seconds)) / kRate - (1 - std::exp(-kBandwidth * seconds)) / kBandwidth;
  EXPECT_NEAR(joints.record.change[0], rate * lags * kBandwidth / (kBandwidth - kRate), rate * kPeriod);
}

// Of the torque, which is in the mean of two samples; of the velocity, whose momentum makes a pair of opposite signs.
TYPED_TEST(ContactDeviationTest, NoGlitchExceedsAThreshold) {
  for (const double glitch : {10.0, 1e3, -1e7}) {
    for (const double next : {0.0, glitch, -glitch}) {
      Joints<TypeParam> joints;
      joints.run(3.0, 0.0);
      joints.step(glitch);
      EXPECT_LT(joints.share(), 0.25) << glitch;  // 2.5 thresholds times K h = 0.08
      joints.step(next);
      EXPECT_LT(joints.share(), 0.45) << glitch << " then " << next;
      joints.run(0.3, 0.0);
      EXPECT_LT(joints.share(), 0.01) << glitch;
    }
  }
}

TYPED_TEST(ContactDeviationTest, AStepOfAnySizeIsFoundInTheSameTime) {
  for (const double push : {10.0, 1e6}) {
    Joints<TypeParam> joints;
    joints.run(3.0, 0.0);
    int samples = 0;
    for (; joints.share() < 1.0 && samples < 100; ++samples) joints.step(push);
    // At most 2.5 thresholds times K a second; the mean follows meanwhile.
    EXPECT_NEAR(samples * kPeriod, 1 / (2.5 * kBandwidth), 0.004) << push;
  }
}

TYPED_TEST(ContactDeviationTest, EachPhaseHasItsThresholds) {
  Joints<TypeParam> joints;
  joints.thresholds.joints[0].rest = TypeParam(11);
  joints.deviation.configure(joints.thresholds);
  joints.run(1.0, 0.0);
  EXPECT_NEAR(joints.record.change_threshold[0], kThreshold, 1e-3);
  EXPECT_NEAR(joints.record.level_threshold[0], kThreshold + kFriction, 1e-3);
  joints.speed[0] = -1.0;
  joints.step(0.0);
  EXPECT_EQ(joints.record.phase[0], MotionPhase::kTurning);
  EXPECT_NEAR(joints.record.change_threshold[0], 3 * kThreshold, 1e-3);
  joints.speed[0] = 0.0;
  joints.run(0.19, 0.0);
  EXPECT_EQ(joints.record.phase[0], MotionPhase::kTurning);  // friction has not settled
  joints.run(0.02, 0.0);
  EXPECT_EQ(joints.record.phase[0], MotionPhase::kRest);
  EXPECT_NEAR(joints.record.level_threshold[0], 11.0, 1e-3);
}

TYPED_TEST(ContactDeviationTest, WhatFrictionWasWhileTheJointTurnedIsForgotten) {
  Joints<TypeParam> joints;
  joints.speed[0] = -1.0;
  joints.run(1.0, 0.0);
  joints.speed[0] = 1.0;
  joints.run(0.19, 6.0);
  EXPECT_EQ(joints.record.phase[0], MotionPhase::kTurning);
  joints.run(0.05, 1.0);
  EXPECT_EQ(joints.record.phase[0], MotionPhase::kMoving);
  EXPECT_LT(joints.share(), 1.0);  // 5 N·m less than while it turned
}

TYPED_TEST(ContactDeviationTest, AStandingArmShowsWhatChangesSlowly) {
  Joints<TypeParam> joints;
  joints.speed[0] = joints.speed[1] = 0.0;
  joints.run(3.0, 4.0);
  EXPECT_NEAR(joints.record.change[0], 0.0, 0.05);
  joints.run(0.2, 1.0);
  EXPECT_NEAR(joints.record.change[0], -3.0, 0.4);  // the mean follows at 0.5/s
  joints.speed[1] = 1.0;
  joints.run(0.5, 1.0);
  EXPECT_NEAR(joints.record.change[0], 0.0, 0.1);  // and at 10/s while the other joint moves
}

// 30 ms after a step the low-pass at 40/s has let 70 % of it through, of which the mean has followed a tenth.
TYPED_TEST(ContactDeviationTest, WhatFrictionAtRestMayTakeUpOfTheLoadIsNoChange) {
  Joints<TypeParam> joints;
  joints.speed[0] = 0.0;
  joints.load = 10.0;
  joints.run(3.0, 0.0);
  joints.load = 12.0;
  joints.run(0.03, 2.0);  // the motor gives what it gave
  EXPECT_NEAR(joints.record.change[0], 0.0, 1e-4);
  EXPECT_GT(joints.record.taken_up[0], 1.0);
  joints.run(3.0, 2.0);
  joints.load = 8.0;
  joints.run(0.03, 0.0);  // the load falls, the motor's torque by half as much
  EXPECT_EQ(joints.record.change[0], TypeParam(0));
  EXPECT_LT(joints.record.taken_up[0], -1.0);
}

TYPED_TEST(ContactDeviationTest, WhatItCannotTakeUpIs) {
  Joints<TypeParam> joints;
  joints.speed[0] = 0.0;
  joints.load = 10.0;
  joints.run(3.0, 0.0);
  joints.run(0.03, 2.0);  // the load remains
  EXPECT_GT(joints.record.change[0], 1.0);
  joints.run(3.0, 2.0);
  joints.load = 14.0;
  joints.run(0.03, 0.0);  // the motor gives more than the load asks for
  EXPECT_LT(joints.record.change[0], -1.0);
  joints.run(3.0, 0.0);
  joints.load = 15.0;
  joints.run(0.03, 4.0);  // four times what the load changes by
  EXPECT_NEAR(joints.record.change[0], 3 * joints.record.taken_up[0], 1e-3);
  joints.run(3.0, 4.0);
  joints.speed[0] = 1.0;
  joints.run(1.0, 4.0);
  joints.load = 18.0;
  joints.run(0.03, 7.0);  // a joint that moves: its friction is known
  EXPECT_GT(joints.record.change[0], 1.5);
  EXPECT_EQ(joints.record.taken_up[0], TypeParam(0));
}

TYPED_TEST(ContactDeviationTest, NoMeanFollowsAPushWhileItIsHeld) {
  Joints<TypeParam> joints;
  joints.run(3.0, 0.0);
  joints.run(0.04, 4.0);
  const double before = static_cast<double>(joints.record.residual[0] - joints.record.change[0]);
  for (int k = 0; k < 1000; ++k) joints.step(4.0, 0.7);
  EXPECT_NEAR(joints.record.change[0], 4.0 - before, 0.1);
  EXPECT_GT(joints.share(), 1.0);
  for (int k = 0; k < 200; ++k) joints.step(1.5, 0.7);  // quiet: it follows again
  EXPECT_NEAR(joints.record.change[0], 0.0, 0.1);
  joints.run(0.04, 5.5);
  joints.deviation.accept(0);
  joints.step(static_cast<double>(joints.record.residual[0]), 0.7);
  EXPECT_NEAR(joints.record.change[0], 0.0, 1e-3);
}

TYPED_TEST(ContactDeviationTest, HarsherMotionThanWasLearntWidensThresholdsInProportion) {
  Joints<TypeParam> joints;
  joints.run(3.0, 0.0);
  EXPECT_NEAR(joints.record.change_threshold[0], kThreshold, 1e-3);
  joints.rate = 300.0;  // three times what was learnt, of the other joint
  joints.run(2.0, 0.0);
  EXPECT_NEAR(joints.record.change_threshold[0], 3 * kThreshold, 0.05);
  joints.rate = 0.0;
  joints.speed[0] = 5.0;  // 2.5 times
  joints.run(2.0, 0.0);
  EXPECT_NEAR(joints.record.change_threshold[0], 2.5 * kThreshold, 0.01);
}

TYPED_TEST(ContactDeviationTest, AGapForgetsTheFilters) {
  Joints<TypeParam> joints;
  joints.run(3.0, 2.0);
  joints.deviation.restart();
  joints.step(6.5);
  EXPECT_NEAR(joints.record.residual[0], 6.5, 1e-3);
  EXPECT_EQ(joints.record.change[0], TypeParam(0));
}

}  // namespace
}  // namespace heft
