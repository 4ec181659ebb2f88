// What ContactDeviation makes of a torque from outside, against closed forms of the filter and the rules of each phase.
#include "heft/core/monitor/contact_deviation.hpp"

#include <cmath>

#include <gtest/gtest.h>

namespace heft {
namespace {

constexpr double kPeriod = 0.002, kThreshold = 2.0, kLimit = 5.0;

/// Two joints at given speeds; the torque from outside is that of the first.
template <typename Scalar>
class Joints {
 public:
  using Deviation = ContactDeviation<Scalar, 2>;
  using Vector = typename Deviation::Vector;

  Joints() {
    thresholds.bandwidth = Scalar(40);
    thresholds.load_rate = Scalar(100);
    thresholds.joints.fill(
        JointThreshold<Scalar>::uniform(static_cast<Scalar>(kThreshold), static_cast<Scalar>(kLimit)));
    thresholds.joints[0].turning = static_cast<Scalar>(3 * kThreshold);
    thresholds.joints[0].top_speed = Scalar(2);
    deviation.configure(thresholds);
  }
  void step(double outside, bool hold = false) {
    explained += rate * kPeriod;
    deviation.update({static_cast<Scalar>(outside), Scalar(0)}, {Scalar(0), static_cast<Scalar>(explained)},
                     {static_cast<Scalar>(speed[0]), static_cast<Scalar>(speed[1])},
                     static_cast<Scalar>(kPeriod), hold, record);
  }
  void run(double seconds, double outside) {
    for (double t = 0; t < seconds; t += kPeriod) step(outside);
  }
  /// Largest deviation of the first joint against its threshold while the torque from outside grows.
  double share() const { return std::abs(static_cast<double>(record.deviation[0] / record.threshold[0])); }

  typename Deviation::Thresholds thresholds;
  Deviation deviation;
  typename Deviation::Record record;
  double speed[2] = {1.0, 1.0};
  double explained{0}, rate{0};
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

TYPED_TEST(ContactDeviationTest, NoGlitchOfOneSampleExceedsAThreshold) {
  for (const double glitch : {10.0, 1e3, -1e7}) {
    Joints<TypeParam> joints;
    joints.run(3.0, 0.0);
    joints.step(glitch);
    EXPECT_LT(joints.share(), 0.1) << glitch;  // 1.2 thresholds times K h = 0.08
    joints.run(0.2, 0.0);
    EXPECT_LT(joints.share(), 0.01) << glitch;
  }
}

TYPED_TEST(ContactDeviationTest, AStepOfAnySizeIsFoundInTheSameTime) {
  for (const double push : {10.0, 1e6}) {
    Joints<TypeParam> joints;
    joints.run(3.0, 0.0);
    int samples = 0;
    for (; joints.share() < 1.0 && samples < 100; ++samples) joints.step(push);
    // At most 1.2 thresholds times K a second; the offset follows meanwhile at 5/s.
    EXPECT_NEAR(samples * kPeriod, 1 / (1.2 * 40), 0.004) << push;
  }
}

TYPED_TEST(ContactDeviationTest, AJointAtRestMayHoldAnyTorqueOfFrictionWhileAnotherMoves) {
  Joints<TypeParam> joints;
  joints.speed[0] = 0.0;
  joints.run(1.0, 0.0);
  for (double torque = 0; torque < kLimit; torque += 0.05) {
    joints.step(torque);
    ASSERT_EQ(joints.record.deviation[0], TypeParam(0)) << torque;
  }
  EXPECT_EQ(joints.record.phase[0], MotionPhase::kRest);
  joints.run(1.0, kLimit + 1.5);
  EXPECT_NEAR(joints.record.deviation[0], 1.5, 1e-3);
}

TYPED_TEST(ContactDeviationTest, AStandingArmShowsWhatChanges) {
  Joints<TypeParam> joints;
  joints.speed[0] = joints.speed[1] = 0.0;
  joints.run(3.0, 4.0);
  EXPECT_NEAR(joints.record.deviation[0], 0.0, 1e-3);
  joints.run(0.1, 1.0);
  EXPECT_NEAR(joints.record.deviation[0], -3.0, 0.3);  // the offset follows at 0.5/s
}

TYPED_TEST(ContactDeviationTest, FrictionsOffsetOfEachDirectionIsFollowedWithinItsLimit) {
  Joints<TypeParam> joints;
  joints.run(3.0, 2.0);
  EXPECT_NEAR(joints.record.deviation[0], 0.0, 1e-3);
  joints.speed[0] = -1.0;
  joints.step(-3.0);
  EXPECT_EQ(joints.record.phase[0], MotionPhase::kTurning);
  EXPECT_NEAR(joints.record.threshold[0], 3 * kThreshold + kLimit, 1e-3);  // an offset that is not known yet
  joints.run(3.0, -3.0);
  EXPECT_NEAR(joints.record.deviation[0], 0.0, 1e-3);
  EXPECT_NEAR(joints.record.threshold[0], kThreshold, 1e-3);
  joints.speed[0] = 1.0;
  joints.run(0.2, 2.0);
  EXPECT_NEAR(joints.record.offset[0], 2.0, 0.3);  // that of before
  joints.run(5.0, kLimit + 1.0);
  EXPECT_NEAR(joints.record.deviation[0], 1.0, 1e-3);
}

TYPED_TEST(ContactDeviationTest, NoOffsetFollowsWhileItIsHeld) {
  Joints<TypeParam> joints;
  joints.run(3.0, 0.0);
  for (int k = 0; k < 1000; ++k) joints.step(3.0, true);
  EXPECT_NEAR(joints.record.deviation[0], 3.0, 1e-3);
  joints.deviation.accept(0);
  joints.step(3.0);
  EXPECT_NEAR(joints.record.deviation[0], 0.0, 1e-3);
  EXPECT_NEAR(joints.record.threshold[0], kThreshold + kLimit, 1e-3);  // what was held is not known
}

TYPED_TEST(ContactDeviationTest, HarsherMotionThanWasLearntWidensThresholdsInProportion) {
  Joints<TypeParam> joints;
  joints.run(3.0, 0.0);
  EXPECT_NEAR(joints.record.threshold[0], kThreshold, 1e-3);
  joints.rate = 300.0;  // three times what was learnt, of the other joint
  joints.run(2.0, 0.0);
  EXPECT_NEAR(joints.record.threshold[0], 3 * kThreshold, 0.05);
  joints.rate = 0.0;
  joints.speed[0] = 5.0;  // 2.5 times
  joints.run(2.0, 0.0);
  EXPECT_NEAR(joints.record.threshold[0], 2.5 * kThreshold, 0.01);
}

TYPED_TEST(ContactDeviationTest, AGapForgetsTheFiltersAndKeepsTheOffsets) {
  Joints<TypeParam> joints;
  joints.run(3.0, 2.0);
  joints.deviation.restart();
  joints.step(2.5);
  EXPECT_NEAR(joints.record.residual[0], 2.5, 1e-3);
  EXPECT_NEAR(joints.record.offset[0], 2.0, 1e-3);
}

}  // namespace
}  // namespace heft
