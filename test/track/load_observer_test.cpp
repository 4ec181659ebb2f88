/// The online estimate of a load, sample by sample.
#include <array>
#include <cmath>

#include <gtest/gtest.h>

#include "heft/core/estimate/load_observer.hpp"
#include "heft/host/numbers.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/model/run_time_arm.hpp"
#include "heft/sim/controller.hpp"
#include "support/arms.hpp"

namespace heft::track {
namespace {

/// Core's observer of a robot, as the tracking controllers make it.
class Observer {
 public:
  using Core = heft::LoadObserver<model::ModelOf<2>, double>;

  explicit Observer(const model::Robot& arm, const Core::Config& config = {}) {
    EXPECT_EQ(core_.configure(model::to_arm_model<2>(arm), config), Status::kOk);
    model::add_parts(arm, core_);
  }
  Status sample(const sim::Measurement& m) {
    Core::Record record;
    return core_.update(m.q, m.qd, m.tau, m.sample_time, record);
  }
  const InertialParameters<double>& load() const { return core_.load(); }
  const Core::Estimator& estimator() const { return core_.estimator(); }

 private:
  Core core_;
};

/// The planar arm on a slow motion, with a load of 0.5 kg at its tip.
class Motion {
 public:
  Motion() : loaded_(with_load()) {}

  sim::Measurement at(int k) const {
    constexpr double kPeriod = 1e-3;
    sim::Measurement m;
    m.time = k * kPeriod;
    m.sample_time = kPeriod;
    m.q.resize(2), m.qd.resize(2), m.qdd.resize(2);
    for (Eigen::Index i = 0; i < 2; ++i) {
      const double w = 3.0 + 1.3 * static_cast<double>(i), p = w * m.time;
      m.q[i] = std::sin(p), m.qd[i] = w * std::cos(p), m.qdd[i] = -w * w * std::sin(p);
    }
    m.tau = loaded_.joint_torque(m.q, m.qd, m.qdd);
    return m;
  }

 private:
  static model::Robot with_load() {
    model::Robot robot = test::planar_two_link();
    const auto load = test::body(0.5, {0.4, 0, 0}, {0, 0, 0, 0, 0, 0.001});
    for (std::size_t i = 0; i < 10; ++i) robot.joints.back().link[i] += load[i];
    return robot;
  }

  model::Dynamics loaded_;
};

struct Estimate {
  std::array<double, 10> value, variance;
};

Estimate estimate_of(const Observer& observer) {
  Estimate estimate{};
  for (int i = 0; i < 10; ++i) {
    estimate.value[static_cast<std::size_t>(i)] = observer.estimator().payload()[static_cast<std::size_t>(i)];
    estimate.variance[static_cast<std::size_t>(i)] = observer.estimator().estimator().variance(i);
  }
  return estimate;
}

TEST(LoadObserver, WeighsTheLoad) {
  Observer observer(test::planar_two_link());
  const Motion motion;
  for (int k = 0; k < 4000; ++k) ASSERT_EQ(observer.sample(motion.at(k)), Status::kOk);
  EXPECT_NEAR(observer.load()[kMass], 0.5, 0.02);
}

// Noise and friction of the last joint are within range (1e60 for a variance), their sum while it is slow is not.
TEST(LoadObserver, NoiseAndFrictionThatLeaveTheRangeTogetherAreRefusedBeforeTheFirstSample) {
  model::Robot arm = test::planar_two_link();
  arm.joints[1].actuation.coulomb_friction = 1.8e30;
  Observer::Core core;
  Observer::Core::Config settings;
  EXPECT_EQ(core.configure(model::to_arm_model<2>(test::planar_two_link()), settings), Status::kOk);
  settings.noise_std = Eigen::Vector2d(1.0, 0.9e30);
  EXPECT_EQ(core.configure(model::to_arm_model<2>(arm), settings), Status::kOutOfRange);
}

TEST(LoadObserver, ARefusedSampleLeavesNoTrace) {
  Observer disturbed(test::planar_two_link());
  const Motion motion;
  for (int k = 0; k < 3000; ++k) {
    sim::Measurement m = motion.at(k);
    if (k == 1000) m.q[0] = kNaN;
    if (k == 1500) m.qd[1] = kNaN;
    if (k == 2000) m.tau[1] = kNaN;
    const Estimate before = estimate_of(disturbed);
    if (k == 1000 || k == 1500 || k == 2000) {
      EXPECT_EQ(disturbed.sample(m), Status::kNonFiniteInput);
      EXPECT_EQ(estimate_of(disturbed).value, before.value);
    } else {
      ASSERT_EQ(disturbed.sample(m), Status::kOk);
    }
  }
  EXPECT_NEAR(disturbed.load()[kMass], 0.5, 0.02);
}

}  // namespace
}  // namespace heft::track
