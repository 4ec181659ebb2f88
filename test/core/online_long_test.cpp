/// Ten hours at rest, at 1 kHz: neither drift nor false certainty, and right again within two seconds of motion.
#include <cmath>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "heft/core/control/arm_controllers.hpp"
#include "heft/core/control/terminal_link_controller.hpp"
#include "heft/core/converted.hpp"
#include "heft/core/estimate/extended_kalman_filter.hpp"
#include "heft/core/estimate/load_observer.hpp"
#include "support/online_rig.hpp"
#include "support/planar_rig.hpp"
#include "support/two_link_arm.hpp"

namespace heft {
namespace {

using test::OnlineSample;

template <typename Scalar>
class OnlineForHours : public ::testing::Test {};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(OnlineForHours, Scalars);

TYPED_TEST(OnlineForHours, ALoadObserverRestsForTenHours) {
  using Scalar = TypeParam;
  test::MovingUr5 arm;
  LoadObserver<model::Ur5Arm, Scalar> observer;
  ASSERT_EQ(observer.configure(), Status::kOk);
  typename LoadObserver<model::Ur5Arm, Scalar>::Record record;
  const auto take = [&](const OnlineSample& s) {
    return observer.update(s.q.cast<Scalar>(), s.qd.cast<Scalar>(), s.tau.cast<Scalar>(),
                           static_cast<Scalar>(s.dt), record);
  };
  arm.carry(2.0);
  for (int k = 0; k < 4000; ++k) ASSERT_EQ(take(arm.next()), Status::kOk);
  arm.move(false);
  // A thousand noisy samples, over and over.
  std::vector<OnlineSample> rest;
  for (int k = 0; k < 1000; ++k) rest.push_back(arm.next());
  for (int second = 0; second < 10; ++second) {
    for (const OnlineSample& s : rest) ASSERT_EQ(take(s), Status::kOk);
  }
  const auto rested = observer.estimate();
  for (int second = 0; second < 36'000; ++second) {
    for (const OnlineSample& s : rest) ASSERT_EQ(take(s), Status::kOk);
  }
  EXPECT_NEAR(static_cast<double>(observer.time()), 36'014.0, 2e-5 * 36'014.0);  // as a quartz has it
  EXPECT_TRUE(record.at_rest);
  EXPECT_EQ(observer.estimate().value, rested.value);
  EXPECT_EQ(observer.estimate().std, rested.std);
  arm.move(true);
  for (int k = 0; k < 2000; ++k) {
    ASSERT_EQ(take(arm.next()), Status::kOk);
    EXPECT_FALSE(record.changed) << k;
  }
  EXPECT_NEAR(static_cast<double>(observer.load()[kMass]), 2.0, 0.1);
}

TYPED_TEST(OnlineForHours, ATerminalLinkControllerHoldsForAnHour) {
  using Scalar = TypeParam;
  using Controller = TerminalLinkController<model::KawasakiArm, Scalar, 4>;
  Controller controller;
  ASSERT_EQ(controller.configure({}), Status::kOk);
  const typename Controller::Vector q = Controller::Vector::Constant(Scalar(0.3));
  typename Controller::Reference reference;
  reference.q = q;
  typename Controller::Vector tau = Controller::Vector::Zero(), first = tau;
  typename Controller::Record record;
  for (int k = 0; k < 3'600'000; ++k) {
    ASSERT_EQ(controller.update(reference, q, tau, Scalar(0.001), tau, record), Status::kOk);
    if (k == 0) first = tau;
  }
  EXPECT_EQ(controller.source(), EstimateSource::kPrior);
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(static_cast<double>(tau[i] - first[i]), 0.0, 1e-3);
}

/// Held at rest by its controller against gravity, with noisy sensors; then it moves.
TEST(OnlineForHoursInFloat, AKalmanFilterRestsForTenHours) {
  using Filter = ExtendedKalmanFilter<float, 2>;
  test::TwoLinkRig rig(1);
  rig.arm.coulomb *= 0.8;
  Filter filter;
  Filter::Config config;
  config.position_noise.setConstant(static_cast<float>(test::TwoLinkRig::kPositionNoise));
  config.velocity_noise.setConstant(static_cast<float>(test::TwoLinkRig::kVelocityNoise));
  config.torque_noise.setConstant(static_cast<float>(test::TwoLinkRig::kTorqueNoise));
  config.coulomb.time = config.viscous.time = 2.0F;
  ASSERT_EQ(filter.configure(config, converted<float>(test::TwoLinkArm::model())), Status::kOk);
  Filter::Record record;
  const auto take = [&](const test::TwoLinkSample& s) {
    return filter.update(s.q.cast<float>(), s.qd.cast<float>(), s.tau.cast<float>(), 1e-3F, record);
  };
  for (int k = 0; k < 4000; ++k) ASSERT_EQ(take(rig.next()), Status::kOk);
  // A thousand samples of noise about one place, over and over.
  std::vector<test::TwoLinkSample> rest(1000, rig.next());
  std::mt19937_64 random(2);
  std::normal_distribution<double> normal;
  for (auto& s : rest) {
    for (int i = 0; i < 2; ++i) {
      s.q[i] += test::TwoLinkRig::kPositionNoise * normal(random);
      s.qd[i] = test::TwoLinkRig::kVelocityNoise * normal(random);
    }
  }
  for (int second = 0; second < 36'000; ++second) {
    for (const auto& s : rest) ASSERT_EQ(take(s), Status::kOk);
    for (int i = 0; i < Filter::kStates; ++i) {
      ASSERT_TRUE(std::isfinite(filter.state()[static_cast<std::size_t>(i)])) << second;
    }
    ASSERT_LT(filter.standard_deviation(Filter::kCoulomb), 3.01F) << second;
    ASSERT_GE(filter.coulomb(0), 0.0F) << second;
  }
  for (int k = 0; k < 2000; ++k) ASSERT_EQ(take(rig.next()), Status::kOk);
  for (int i = 0; i < 2; ++i) {
    EXPECT_NEAR(static_cast<double>(filter.coulomb(i)), rig.arm.coulomb[i], 0.25 * rig.arm.coulomb[i]);
  }
}

TYPED_TEST(OnlineForHours, AdaptationAndEstimatesHoldStillForTenMinutes) {
  using Scalar = TypeParam;
  using Arm = RunTimeArm<2, 2, 1>;
  const auto rest = [](auto controller) {
    typename decltype(controller)::Config config;
    if constexpr (requires { config.estimator; }) config.estimator.noise_std.setConstant(Scalar(0.1));
    ASSERT_EQ(controller.configure(test::planar_arm<Scalar>(), config), Status::kOk);
    test::expect_no_drift_at_rest(std::move(controller), 600);
  };
  rest(LoadEstimatingController<Arm, Scalar>{});
  rest(ArmEstimatingController<Arm, Scalar>{});
  rest(AdaptiveArmController<Arm, Scalar>{});
}

}  // namespace
}  // namespace heft
