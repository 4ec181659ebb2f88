/// The load while the arm moves: what it weighs, when it changes, what is said of it.
#include <cmath>
#include <limits>
#include <memory>

#include <gtest/gtest.h>

#include "heft/core/dynamics/arm_torque.hpp"
#include "heft/core/estimate/load_observer.hpp"
#include "heft/core/monitor/contact_monitor.hpp"
#include "support/online_rig.hpp"

namespace heft {
namespace {

using test::MovingUr5;
using test::OnlineSample;

template <typename Scalar>
class LoadObserverOf : public ::testing::Test {
 public:
  using Observer = LoadObserver<model::Ur5Arm, Scalar>;
  using Record = typename Observer::Record;

  static Status take(Observer& observer, const OnlineSample& s, Record& record) {
    return observer.update(s.q.cast<Scalar>(), s.qd.cast<Scalar>(), s.tau.cast<Scalar>(),
                           static_cast<Scalar>(s.dt), record);
  }
  /// Runs for so many seconds; every sample has to be taken.
  void run(double seconds) {
    for (const double end = arm.time() + seconds; arm.time() < end;) {
      ASSERT_EQ(take(observer, arm.next(), record), Status::kOk);
      changes += record.changed ? 1 : 0;
      if (record.changed) changed_at = arm.time();
    }
  }
  double mass() const { return static_cast<double>(observer.load()[kMass]); }

  MovingUr5 arm;
  Observer observer;
  Record record;
  int changes{0};
  double changed_at{0};
};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(LoadObserverOf, Scalars);

TYPED_TEST(LoadObserverOf, WeighsTheLoadWithIntervalsThatHoldIt) {
  ASSERT_EQ(this->observer.configure(), Status::kOk);
  EXPECT_EQ(this->observer.status(), Status::kNotExcited);
  this->arm.carry(2.0);
  this->run(5.0);
  EXPECT_NEAR(this->mass(), 2.0, 0.04);
  EXPECT_EQ(this->observer.state(), LoadState::kKnown);
  EXPECT_EQ(this->observer.status(), Status::kOk);
  EXPECT_EQ(this->changes, 0);
  const auto found = this->observer.estimate();
  EXPECT_LT(std::abs(static_cast<double>(found.value[kMass]) - 2.0),
            3 * static_cast<double>(found.std[kMass]) + 0.005);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(static_cast<double>(found.value[1 + axis]) / 2.0, MovingUr5::kCom[axis], 0.005) << axis;
    EXPECT_TRUE(found.excited[1 + axis]);
  }
}

TYPED_TEST(LoadObserverOf, SaysThatThereIsNone) {
  ASSERT_EQ(this->observer.configure(), Status::kOk);
  this->run(5.0);
  EXPECT_EQ(this->observer.state(), LoadState::kNone);
  EXPECT_LT(std::abs(this->mass()), 0.05);
  EXPECT_EQ(this->changes, 0);
}

TYPED_TEST(LoadObserverOf, SeesAGraspAndAReleaseWithinHalfASecondAndRemembersWhatWasBefore) {
  ASSERT_EQ(this->observer.configure(), Status::kOk);
  this->arm.carry(1.0);
  this->run(5.0);
  this->arm.carry(3.0);
  const double grasp = this->arm.time();
  this->run(3.0);
  EXPECT_EQ(this->changes, 1);
  EXPECT_LT(this->changed_at - grasp, 0.5);
  EXPECT_NEAR(this->mass(), 3.0, 0.15);
  const auto& change = this->observer.last_change();
  EXPECT_TRUE(change.any);
  EXPECT_FALSE(change.declared);
  EXPECT_NEAR(static_cast<double>(change.time), this->changed_at, 0.01);
  EXPECT_NEAR(static_cast<double>(change.before.value[kMass]), 1.0, 0.3);
  this->arm.carry(0.0);
  const double release = this->arm.time();
  this->run(3.0);
  EXPECT_EQ(this->changes, 2);
  EXPECT_LT(this->changed_at - release, 0.5);
  EXPECT_EQ(this->observer.state(), LoadState::kNone);
  EXPECT_LT(std::abs(this->mass()), 0.1);
}

TYPED_TEST(LoadObserverOf, ADeclaredReleaseEmptiesTheHandAtOnceOverTheTransition) {
  typename TestFixture::Observer::Config config;
  config.transition_time = static_cast<TypeParam>(0.25);
  ASSERT_EQ(this->observer.configure(config), Status::kOk);
  this->arm.carry(2.0);
  this->run(4.0);
  ASSERT_NEAR(this->mass(), 2.0, 0.1);
  this->arm.carry(0.0);
  ASSERT_EQ(this->observer.detach(), Status::kOk);
  EXPECT_EQ(this->observer.state(), LoadState::kChanging);
  double last = this->mass();
  const double before = last;
  for (int k = 0; k < 250; ++k) {
    this->run(0.001);
    EXPECT_LE(this->mass(), last + 1e-6);           // never back
    EXPECT_LT(last - this->mass(), 0.01 * before);  // 1/250 a sample
    last = this->mass();
  }
  EXPECT_LT(std::abs(last), 0.03);
  this->run(2.0);
  EXPECT_EQ(this->changes, 0);
  EXPECT_LT(std::abs(this->mass()), 0.1);
  EXPECT_TRUE(this->observer.last_change().declared);
  EXPECT_NEAR(static_cast<double>(this->observer.last_change().before.value[kMass]), 2.0, 0.1);
}

TYPED_TEST(LoadObserverOf, ADeclaredToolIsCarriedAtOnceAndItsRealWeightSoon) {
  using Scalar = TypeParam;
  ASSERT_EQ(this->observer.configure(), Status::kOk);
  this->run(3.0);
  this->arm.carry(2.0);
  const auto expected =
      make_inertial_parameters<Scalar>(Scalar(1.5), {Scalar(0.02), Scalar(-0.03), Scalar(0.06)},
                                       {Scalar(0.003), 0, Scalar(0.003), 0, 0, Scalar(0.003)});
  InertialParameters<Scalar> impossible = expected;
  impossible[kIxx] = Scalar(-1);
  EXPECT_EQ(this->observer.attach(impossible), Status::kNotPositiveDefinite);
  EXPECT_FALSE(this->observer.last_change().any);
  ASSERT_EQ(this->observer.attach(expected), Status::kOk);
  this->run(0.21);
  EXPECT_NEAR(this->mass(), 1.5, 0.4);
  this->run(2.0);
  EXPECT_NEAR(this->mass(), 2.0, 0.1);
  EXPECT_EQ(this->changes, 0);
}

TYPED_TEST(LoadObserverOf, WhatItHandsOutIsAlwaysABodyForTheModel) {
  ASSERT_EQ(this->observer.configure(), Status::kOk);
  ArmTorque<model::Ur5Arm, TypeParam> model;
  ASSERT_EQ(model.configure(), Status::kOk);
  this->arm.carry(0.3);
  for (int k = 0; k < 3000; ++k) {
    this->run(0.001);
    ASSERT_EQ(model.set_payload(this->observer.load()), Status::kOk) << k;
  }
}

/// One row a sample, as a small processor takes them, instead of six at once: the same load.
TYPED_TEST(LoadObserverOf, RowsOneByOneGiveTheSameLoad) {
  typename TestFixture::Observer::Config config;
  config.rows_per_sample = 1;
  typename TestFixture::Observer spread;
  ASSERT_EQ(this->observer.configure(), Status::kOk);
  ASSERT_EQ(spread.configure(config), Status::kOk);
  this->arm.carry(2.0);
  int updates = 0;
  for (int k = 0; k < 4000; ++k) {
    const OnlineSample s = this->arm.next();
    ASSERT_EQ(this->take(this->observer, s, this->record), Status::kOk);
    typename TestFixture::Record other;
    ASSERT_EQ(this->take(spread, s, other), Status::kOk);
    EXPECT_FALSE(other.due && other.estimated);
    updates += other.estimated ? 1 : 0;
  }
  EXPECT_GT(updates, 300);
  EXPECT_NEAR(this->mass(), static_cast<double>(spread.load()[kMass]), 1e-3);
}

TYPED_TEST(LoadObserverOf, WhatItExplainsShowsAContactAndNotTheLoad) {
  constexpr double kRate = 1000;
  typename TestFixture::Observer::Config config;
  config.explains = true;
  typename TestFixture::Observer explaining;
  ASSERT_EQ(this->observer.configure(), Status::kOk);
  ASSERT_EQ(explaining.configure(config), Status::kOk);
  ContactMonitor<TypeParam, 6> monitor;
  typename ContactMonitor<TypeParam, 6>::Config watched;
  watched.thresholds.joints.fill(JointThreshold<TypeParam>::uniform(TypeParam(8), TypeParam(0)));
  ASSERT_EQ(monitor.configure(watched), Status::kOk);
  typename ContactMonitor<TypeParam, 6>::Record contact;
  this->arm.carry(2.0);
  int began = 0;
  double at = 0.0;
  for (int k = 0; k < 6200; ++k) {
    OnlineSample s = this->arm.next();
    if (k >= 6000) s.tau[1] += 30.0;  // held against a push along negative q
    ASSERT_EQ(this->take(this->observer, s, this->record), Status::kOk);
    EXPECT_FALSE(this->observer.explained().valid);
    typename TestFixture::Record seen;
    ASSERT_EQ(this->take(explaining, s, seen), Status::kOk);
    EXPECT_EQ(explaining.explained().valid, k > 0);
    if (k < 4000) continue;  // the load is not known before
    ASSERT_EQ(monitor.update(explaining.explained(), s.tau.template cast<TypeParam>(), contact), Status::kOk);
    if (contact.event == ContactEvent::kContact) {
      ++began;
      at = (k - 6000) / kRate;
      EXPECT_EQ(contact.joint, 1);
      EXPECT_EQ(contact.direction, -1);
    }
  }
  EXPECT_EQ(began, 1);  // 2 kg would show with 15 N·m and more
  EXPECT_GE(at, 0.0);
  EXPECT_LE(
      at,
      0.036);  // 30 N·m behind the low-pass reach 8 in 12 ms; a step counts as 2.5 thresholds at most: 1 / (2.5 · 25/s)
  for (std::size_t i = 0; i < 10; ++i) {  // nothing else is estimated
    EXPECT_EQ(explaining.estimate().value[i], this->observer.estimate().value[i]) << i;
  }
  OnlineSample bad = this->arm.next();
  bad.tau[2] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(this->take(explaining, bad, this->record), Status::kNonFiniteInput);
  EXPECT_FALSE(explaining.explained().valid);
}

TYPED_TEST(LoadObserverOf, FollowsAGravityThatTurns) {
  using Scalar = TypeParam;
  ASSERT_EQ(this->observer.configure(), Status::kOk);
  // The arm hangs from a wall; the description has it on the floor.
  ArmModel<double, 6> wall = test::carrying(model::Ur5Arm::kModel, 2.0, MovingUr5::kCom);
  wall.gravity = {9.81, 0, 0};
  const DynamicArm<double, 6> plant(wall);
  DynamicArm<double, 6> floor(test::carrying(model::Ur5Arm::kModel, 2.0, MovingUr5::kCom));
  this->arm.carry(2.0);
  ASSERT_EQ(this->observer.set_gravity({Scalar(9.81), Scalar(0), Scalar(0)}), Status::kOk);
  for (int k = 0; k < 4000; ++k) {
    OnlineSample s = this->arm.next();
    s.tau += inverse_dynamics(plant, s.q, s.qd, test::Vec6(test::Vec6::Zero())) -
             inverse_dynamics(floor, s.q, s.qd, test::Vec6(test::Vec6::Zero()));
    ASSERT_EQ(this->take(this->observer, s, this->record), Status::kOk);
  }
  EXPECT_NEAR(this->mass(), 2.0, 0.05);
}

TYPED_TEST(LoadObserverOf, RefusesSettingsOutsideTheirRanges) {
  using Scalar = TypeParam;
  const auto status_with = [&](auto change) {
    typename TestFixture::Observer::Config config;
    change(config);
    return this->observer.configure(config);
  };
  const Scalar nan = std::numeric_limits<Scalar>::quiet_NaN();
  EXPECT_EQ(status_with([](auto& c) { c.first_row = 6; }), Status::kOutOfRange);
  EXPECT_EQ(status_with([](auto& c) { c.first_row = -1; }), Status::kOutOfRange);
  EXPECT_EQ(status_with([](auto& c) { c.rows_per_sample = -1; }), Status::kOutOfRange);
  for (const Scalar bad : {nan, Scalar(-1)}) {
    EXPECT_EQ(status_with([&](auto& c) { c.filter_hz = bad; }), Status::kOutOfRange);
    EXPECT_EQ(status_with([&](auto& c) { c.update_rate = bad; }), Status::kOutOfRange);
    EXPECT_EQ(status_with([&](auto& c) { c.mass_prior = bad; }), Status::kOutOfRange);
    EXPECT_EQ(status_with([&](auto& c) { c.noise_std[3] = bad; }), Status::kOutOfRange);
    EXPECT_EQ(status_with([&](auto& c) { c.sign_width = bad; }), Status::kOutOfRange);
    EXPECT_EQ(status_with([&](auto& c) { c.uncertain_speed = bad; }), Status::kOutOfRange);
    EXPECT_EQ(status_with([&](auto& c) { c.torque_limit[0] = bad; }), Status::kOutOfRange);
    EXPECT_EQ(status_with([&](auto& c) { c.transition_time = bad; }), Status::kOutOfRange);
    EXPECT_EQ(status_with([&](auto& c) { c.longest_rest = bad; }), Status::kOutOfRange);
    EXPECT_EQ(status_with([&](auto& c) { c.start_time = bad; }), Status::kOutOfRange);
  }
  EXPECT_EQ(this->observer.status(), Status::kNotConfigured);
  EXPECT_EQ(this->observer.attach(), Status::kNotConfigured);
}

}  // namespace
}  // namespace heft
