/// ArmEstimator alone: what it must not learn, refuse too late, or keep.
#include "heft/core/estimate/arm_estimator.hpp"

#include <cmath>
#include <cstddef>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "heft/core/converted.hpp"
#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/effects/effects.hpp"
#include "support/planar_rig.hpp"

namespace heft {
namespace {

using test::planar_arm;
using test::reference_at;

template <typename Scalar>
using PlanarEstimator = ArmEstimator<RunTimeArm<2, 2, 1>, Scalar>;

template <typename Scalar>
class ArmEstimators : public ::testing::Test {};
using ArmEstimatorScalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(ArmEstimators, ArmEstimatorScalars);

/// An ArmEstimator that follows what an arm without friction would measure on a motion of two sines about a pose, with
/// `extra` on top of the torque of joint 0. Calls look(record, q) after each sample.
template <typename Scalar, typename Look>
void follow(PlanarEstimator<Scalar>& estimator, const ArmModel<double, 2>& truth, double extra,
            double seconds, double elbow, Look&& look) {
  const DynamicArm<double, 2> arm(truth);
  using Joints = JointVector<double, 2>;
  for (int k = 0; k < static_cast<int>(seconds * 1000); ++k) {
    const auto at = [&](double t) {
      const auto r = reference_at<double>(t);
      return JointReference<double, 2>{0.4 * r.q + Joints(0, elbow), 0.4 * r.qd, 0.4 * r.qdd};
    };
    const JointReference<double, 2> now = at(k * 1e-3), middle = at(k * 1e-3 - 5e-4);
    Joints tau = inverse_dynamics(arm, middle.q, middle.qd, middle.qdd) + Joints(extra, 0);
    for (int i = 0; i < 2; ++i)
      tau[i] += truth.actuation[static_cast<std::size_t>(i)].rotor_inertia * middle.qdd[i];
    typename PlanarEstimator<Scalar>::Record record;
    ASSERT_EQ(estimator.update(now.q.cast<Scalar>(), now.qd.cast<Scalar>(), tau.cast<Scalar>(), Scalar(1e-3),
                               record),
              Status::kOk);
    look(record, now.q);
  }
}

/// An Offset is an effect like the others: known, and not to be put down to links that have none of it.
TYPED_TEST(ArmEstimators, TakeAnOffsetForWhatItIs) {
  using Scalar = TypeParam;
  PlanarEstimator<Scalar> estimator;
  typename PlanarEstimator<Scalar>::Config config;
  config.noise_std.setConstant(Scalar(0.1));
  auto model = planar_arm<Scalar>();
  model.actuation[0].friction_offset = Scalar(0.5);
  ASSERT_EQ(estimator.configure(model, config), Status::kOk);
  JointEffect<Scalar> offset;
  offset.kind = joint_effect_kind<Offset>();
  offset.parameters[0] = Scalar(3);
  ASSERT_EQ(estimator.add(offset), Status::kOk);
  EXPECT_EQ(estimator.model().actuation[0].friction_offset, Scalar(3.5));
  int estimates = 0;
  follow(estimator, planar_arm<double>(), 3.5, 3, 0.5, [&](const auto& record, const auto&) {
    if (!record.new_estimate) return;
    ++estimates;
    const auto& found = estimator.model();
    ASSERT_NEAR(double(found.actuation[0].friction_offset), 3.5, 0.02) << estimates;
    for (std::size_t j = 0; j < 2; ++j) {
      ASSERT_NEAR(double(found.links[j][kMcx]), double(model.links[j][kMcx]), 0.02) << estimates;
    }
  });
  EXPECT_GT(estimates, 200);
}

/// Its square would be no weight, and every row refused.
TYPED_TEST(ArmEstimators, RefuseANoiseThatNothingCanBeLearntFrom) {
  using Scalar = TypeParam;
  PlanarEstimator<Scalar> estimator;
  typename PlanarEstimator<Scalar>::Config config;
  for (const double large : {2 * std::sqrt(kLargestWeight<Scalar>), 0.9 * kLargestInput<Scalar>}) {
    config.noise_std[1] = static_cast<Scalar>(large);
    EXPECT_EQ(estimator.configure(planar_arm<Scalar>(), config), Status::kOutOfRange);
  }
  EXPECT_EQ(estimator.status(), Status::kNotConfigured);
  config.noise_std[1] = static_cast<Scalar>(0.5 * std::sqrt(kLargestWeight<Scalar>));
  EXPECT_EQ(estimator.configure(planar_arm<Scalar>(), config), Status::kOk);
}

/// A sample too early for the filter, with a jump of the position: what presliding friction remembers is that of its twin, which
/// never saw it.
TYPED_TEST(ArmEstimators, DoNotRememberAMotionThatTheFilterRefused) {
  using Scalar = TypeParam;
  auto model = planar_arm<Scalar>();
  model.actuation[0].coulomb_friction = Scalar(20);
  JointEffect<Scalar> presliding;
  presliding.kind = joint_effect_kind<Hysteresis>();
  presliding.parameters[0] = Scalar(1);
  PlanarEstimator<Scalar> estimator;
  ASSERT_EQ(estimator.configure(model), Status::kOk);
  ASSERT_EQ(estimator.add(presliding), Status::kOk);
  const auto ignore = [](const auto&, const auto&) {};
  follow(estimator, planar_arm<double>(), 0, 1, 0.5, ignore);
  auto twin = estimator;
  typename PlanarEstimator<Scalar>::Record record;
  using Joints = JointVector<Scalar, 2>;
  EXPECT_EQ(estimator.update(Joints::Constant(3), Joints::Zero(), Joints::Zero(), Scalar(1e-12), record),
            Status::kOutOfRange);
  follow(estimator, planar_arm<double>(), 0, 0.2, 0.5, ignore);
  follow(twin, planar_arm<double>(), 0, 0.2, 0.5, ignore);
  for (std::size_t k = 0; k < 26; ++k) {
    EXPECT_NEAR(double(estimator.recursion().solution()[k]), double(twin.recursion().solution()[k]), 1e-5)
        << k;
  }
}

/// Torques of no arm that can exist: with the elbow at a right angle its mass matrix is one, with the forearm folded back not.
TYPED_TEST(ArmEstimators, GoBackToTheModelOfTheStartWhereTheEstimateIsNoArmAtAll) {
  using Scalar = TypeParam;
  auto truth = planar_arm<double>();
  truth.links[1][kMcx] = 1.5;
  typename PlanarEstimator<Scalar>::Config config;
  config.noise_std.setConstant(Scalar(0.1));
  config.mass_prior = 20;
  PlanarEstimator<Scalar> estimator;
  ASSERT_EQ(estimator.configure(planar_arm<Scalar>(), config), Status::kOk);
  int accepted = 0, refused = 0, returns = 0;
  const auto look = [&](const auto& record, const Eigen::Vector2d& q) {
    if (record.estimate_refused) {
      ++refused;
      returns += record.new_estimate ? 1 : 0;
      auto mass = test::mass_of<2>(converted<double>(estimator.model()), q);
      mass.diagonal().array() += 0.1;
      ASSERT_GT(Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(mass).eigenvalues()[0], 0) << refused;
    } else if (record.new_estimate) {
      ++accepted;
    }
  };
  follow(estimator, truth, 0, 3, 1.57, look);
  EXPECT_GT(accepted, 200);
  EXPECT_EQ(refused, 0);
  EXPECT_NEAR(double(estimator.model().links[1][kMcx]), 1.5, 0.15);
  follow(estimator, truth, 0, 3, 3.14, look);
  EXPECT_GT(refused, 100);
  EXPECT_EQ(returns, 1);
  EXPECT_EQ(estimator.model().links, planar_arm<Scalar>().links);
}

}  // namespace
}  // namespace heft
