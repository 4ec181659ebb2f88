/// ArmEstimator alone: what it must not learn, refuse too late, or keep.
#include "heft/core/estimate/arm_estimator.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>

#include <gtest/gtest.h>
#include <Eigen/Core>

#include "heft/core/converted.hpp"
#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/effects/effects.hpp"
#include "heft/host/decompositions.hpp"
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

/// Two sines about a pose.
JointReference<double, 2> motion(double t, double elbow) {
  const auto r = reference_at<double>(t);
  return {0.4 * r.q + JointVector<double, 2>(0, elbow), 0.4 * r.qd, 0.4 * r.qdd};
}

/// An ArmEstimator that follows what an arm without friction would measure on the motion, with
/// `extra` on top of the torque of joint 0. Calls look(record, q) after each sample.
/// @param from  time at which the motion goes on [ms]
template <typename Scalar, typename Look>
void follow(PlanarEstimator<Scalar>& estimator, const ArmModel<double, 2>& truth, double extra,
            double seconds, double elbow, Look&& look, int from = 0) {
  const DynamicArm<double, 2> arm(truth);
  using Joints = JointVector<double, 2>;
  for (int k = from; k < from + static_cast<int>(seconds * 1000); ++k) {
    const JointReference<double, 2> now = motion(k * 1e-3, elbow), middle = motion(k * 1e-3 - 5e-4, elbow);
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

/// An estimator whose model is wrong by a factor, on an arm that carries now this, now that.
template <typename Scalar>
class Gripping {
 public:
  explicit Gripping(double wrong = 1.2) {
    auto model = planar_arm<Scalar>();
    for (auto& link : model.links)
      for (auto& p : link) p *= Scalar(wrong);
    typename PlanarEstimator<Scalar>::Config config;
    config.noise_std.setConstant(Scalar(0.1));
    config.mass_prior = 2;
    EXPECT_EQ(estimator.configure(model, config), Status::kOk);
  }
  template <typename Look>
  void carry(const ArmModel<double, 2>& truth, double seconds, Look&& look, double extra = 0) {
    follow(
        estimator, truth, extra, seconds, 0.5, [&](const auto& record, const auto&) { look(record); }, time_);
    time_ += static_cast<int>(seconds * 1000);
  }
  void carry(const ArmModel<double, 2>& truth, double seconds) {
    carry(truth, seconds, [](const auto&) {});
  }
  /// Of the torque of model() on the motion now [N·m].
  double error(const ArmModel<double, 2>& truth) const {
    const auto at = motion(time_ * 1e-3, 0.5);
    const DynamicArm<double, 2> is(truth), found(converted<double>(estimator.model()));
    return (inverse_dynamics(found, at.q, at.qd, at.qdd) - inverse_dynamics(is, at.q, at.qd, at.qdd)).norm();
  }
  /// First moment of a link about its joint [kg·m].
  double moment(std::size_t link) const { return double(estimator.model().links[link][kMcx]); }

  const ArmModel<double, 2> bare = planar_arm<double>(), loaded = test::carrying<2>(bare, test::near_load());
  PlanarEstimator<Scalar> estimator;

 private:
  int time_{0};
};

/// Within a tenth of a second, which the filters need; the first link keeps what is known of it.
TYPED_TEST(ArmEstimators, FollowALoadThatNobodyDeclares) {
  Gripping<TypeParam> arm;
  arm.carry(arm.bare, 3);
  for (const auto* truth : {&arm.loaded, &arm.bare, &arm.loaded}) {
    const double upper_arm = arm.moment(0), before = arm.error(*truth);
    ASSERT_GT(before, 2);
    int surprises = 0;
    arm.carry(*truth, 0.1, [&](const auto& record) {
      surprises += record.surprised ? 1 : 0;
      EXPECT_NEAR(arm.moment(0), upper_arm, 0.03);
    });
    EXPECT_GT(surprises, 0);
    EXPECT_LT(arm.error(*truth), 0.05 * before);
    arm.carry(*truth, 0.1);
    arm.carry(*truth, 2, [](const auto& record) { EXPECT_FALSE(record.surprised); });
    EXPECT_LT(arm.error(*truth), 0.01 * before);
    EXPECT_NEAR(arm.moment(1), truth->links[1][kMcx], 0.015);
  }
}

/// The last link is what it was found to be, with the cycle of the declaration.
TYPED_TEST(ArmEstimators, PutDownWhatTheyAreToldIsPutDown) {
  using Scalar = TypeParam;
  Gripping<Scalar> arm;
  EXPECT_EQ(PlanarEstimator<Scalar>().detach(), Status::kNotConfigured);
  EXPECT_EQ(PlanarEstimator<Scalar>().attach(), Status::kNotConfigured);
  arm.carry(arm.bare, 3);
  const double bare = arm.moment(1);
  EXPECT_NEAR(bare, 0.3, 0.005);
  const auto load = converted<Scalar>(test::near_load());
  auto impossible = load;
  impossible[kMass] = Scalar(-1);
  EXPECT_EQ(arm.estimator.attach(impossible), Status::kNotPositiveDefinite);
  EXPECT_EQ(arm.moment(1), bare);
  EXPECT_EQ(arm.estimator.attach(load), Status::kOk);
  EXPECT_NEAR(arm.moment(1), bare + 0.225, 1e-4);
  bool first = true;
  arm.carry(arm.loaded, 2, [&](const auto& record) {
    EXPECT_TRUE(!first || record.new_estimate);  // for the controller
    first = false;
    EXPECT_NEAR(arm.moment(1), 0.525, 0.01);
  });
  EXPECT_EQ(arm.estimator.detach(), Status::kOk);
  EXPECT_NEAR(arm.moment(1), bare, 1e-4);
  arm.carry(arm.bare, 1, [&](const auto&) { EXPECT_NEAR(arm.moment(1), 0.3, 0.01); });
  // A load of which nothing is known is found as if nobody had declared it, and so is what was wrong with one declared.
  EXPECT_EQ(arm.estimator.attach(), Status::kOk);
  arm.carry(arm.loaded, 0.2);
  EXPECT_NEAR(arm.moment(1), 0.525, 0.02);
  EXPECT_EQ(arm.estimator.attach({}), Status::kOk);
  EXPECT_NEAR(arm.moment(1), bare, 1e-2);
  arm.carry(arm.loaded, 0.3);
  EXPECT_NEAR(arm.moment(1), 0.525, 0.02);
}

/// The model of the start is right. With a load the estimate counts; while 20 N·m shake the first joint at 12 Hz, which the estimate
/// runs after, the model of the start counts more.
TYPED_TEST(ArmEstimators, GiveWayToTheModelOfTheStartWhereThatExplainsTheTorquesBetter) {
  using Scalar = TypeParam;
  Gripping<Scalar> arm(1.0);
  arm.carry(arm.bare, 1);
  arm.carry(arm.loaded, 0.3);
  arm.carry(arm.loaded, 1, [&](const auto&) { EXPECT_GT(arm.estimator.weight(), Scalar(0.98)); });
  arm.carry(arm.bare, 1);
  double of_estimate = 0, of_model = 0;
  for (int k = 0; k < 24; ++k) {
    const auto look = [&](const auto&) {
      const double estimate = double(arm.estimator.recursion().solution()[kMass]) - 2,
                   believed = double(arm.estimator.model().links[1][kMass]) - 2;
      of_estimate += estimate * estimate, of_model += believed * believed;
    };
    arm.carry(arm.bare, 0.04, look, k % 2 == 0 ? 20.0 : -20.0);
  }
  this->RecordProperty("share", std::to_string(std::sqrt(of_model / of_estimate)));
  EXPECT_GT(std::sqrt(of_estimate / 960), 1);  // kilograms that are not there
  EXPECT_LT(std::sqrt(of_model / of_estimate), 0.85);
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
      ASSERT_GT(eigenvalues_of(mass)[0], 0) << refused;
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
