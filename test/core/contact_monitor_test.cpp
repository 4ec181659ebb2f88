#include "heft/core/monitor/contact_monitor.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/dynamics/loaded_torque.hpp"
#include "heft/model/named_arms.hpp"
#include "support/random_arm.hpp"

namespace heft {
namespace {

constexpr int kN = 6;
constexpr double kPeriod = 0.001;
constexpr double kRotor = 0.3, kCoulomb = 4.0;

/// A UR5 on a smooth path whose controller holds it there whatever pushes: the torques are those of inverse dynamics,
/// which the monitor does not use.
template <typename Scalar>
class Bench {
 public:
  using Arm = DynamicArm<Scalar, kN>;
  using Vector = JointVector<Scalar, kN>;
  using Monitor = ContactMonitor<Scalar, kN>;
  using Record = typename Monitor::Record;

  /// @param offset  largest of free motion; below 0: the threshold
  explicit Bench(double threshold = 0.1, double noise = 0.0, double offset = -1.0) : noise_(noise) {
    typename Monitor::Config config;
    config.thresholds.bandwidth = Scalar(100);
    config.motor_inertia.diagonal().setConstant(static_cast<Scalar>(kRotor));
    config.thresholds.joints.fill(JointThreshold<Scalar>::uniform(
        static_cast<Scalar>(threshold), static_cast<Scalar>(offset < 0 ? threshold : offset)));
    config.callback = [](const Record& event, void* self) noexcept {
      static_cast<Bench*>(self)->events.push_back(event);
    };
    config.context = this;
    EXPECT_EQ(monitor.configure(config), Status::kOk);
  }

  /// Motion and torque now.
  struct Sample {
    Vector q, qd, tau, friction;
  };
  Sample sample() {
    JointVector<double, kN> q, qd, qdd;
    for (int i = 0; i < kN; ++i) {
      const double w = 1.1 + 0.17 * i, a = 0.4;
      q[i] = -0.5 + a * std::sin(w * time + i);
      qd[i] = a * w * std::cos(w * time + i);
      qdd[i] = -a * w * w * std::sin(w * time + i);
    }
    JointVector<double, kN> tau = inverse_dynamics(truth_, q, qd, qdd);
    Sample s;
    for (int i = 0; i < kN; ++i) {
      const double friction = kCoulomb * std::tanh(qd[i] / 0.02);
      tau[i] += kRotor * qdd[i] + friction - push[i] + test::uniform(random_, -noise_, noise_);
      s.friction[i] = static_cast<Scalar>(friction);
    }
    s.q = q.template cast<Scalar>(), s.qd = qd.template cast<Scalar>(), s.tau = tau.template cast<Scalar>();
    return s;
  }
  Status take(const Sample& s, double period = kPeriod) {
    LagrangianTerms<Scalar, kN> terms;
    LoadColumns<Scalar, kN> columns;
    const auto trig = joint_trigonometry<Arm>(s.q);
    lagrangian_terms(arm, trig, s.q, s.qd, terms);
    load_columns(arm, trig, s.q, columns);
    const Status status =
        monitor.update(terms, columns, s.qd, s.tau, s.friction, static_cast<Scalar>(period), record);
    return status;
  }
  void run(double seconds) {
    for (const double end = time + seconds; time < end - 0.5 * kPeriod; time += kPeriod) {
      ASSERT_EQ(take(sample()), Status::kOk) << time;
      for (int i = 0; i < kN; ++i) ASSERT_TRUE(is_finite(record.deviation[i])) << time;
    }
  }
  void carry(const InertialParameters<double>& body) {
    ArmModel<double, kN> model = model::Ur5Arm::kModel;
    for (std::size_t k = 0; k < body.size(); ++k) model.links[kN - 1][k] += body[k];
    truth_ = DynamicArm<double, kN>(model);
  }

  Monitor monitor;
  Record record;
  std::vector<Record> events;
  double time{0};
  JointVector<double, kN> push = JointVector<double, kN>::Zero();  ///< torque from outside [N·m]
  Arm arm{[] {
    ArmModel<Scalar, kN> to;
    const auto& from = model::Ur5Arm::kModel;
    for (std::size_t j = 0; j < kN; ++j) {
      to.joints[j].type = from.joints[j].type;
      for (std::size_t i = 0; i < 9; ++i)
        to.joints[j].rotation[i] = static_cast<Scalar>(from.joints[j].rotation[i]);
      for (std::size_t i = 0; i < 3; ++i) {
        to.joints[j].position[i] = static_cast<Scalar>(from.joints[j].position[i]);
        to.joints[j].axis[i] = static_cast<Scalar>(from.joints[j].axis[i]);
        to.gravity[i] = static_cast<Scalar>(from.gravity[i]);
      }
      for (std::size_t i = 0; i < 10; ++i) to.links[j][i] = static_cast<Scalar>(from.links[j][i]);
    }
    return to;
  }()};

 private:
  DynamicArm<double, kN> truth_{model::Ur5Arm::kModel};
  test::Random random_{7};
  double noise_;
};

template <typename Scalar>
class ContactMonitorTest : public ::testing::Test {};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(ContactMonitorTest, Scalars);

TYPED_TEST(ContactMonitorTest, ResidualIsTheTorqueFromOutsideBehindALowPass) {
  Bench<TypeParam> bench(1e3);
  bench.run(2.0);
  const double calm = 0.05;  // trapezoidal rule over a period of 1 ms, float
  for (int i = 0; i < kN; ++i) EXPECT_NEAR(bench.record.residual[i], 0.0, calm) << i;
  bench.push << 3, -5, 4, 2, -1, 0.5;
  bench.run(0.01);
  const double share = 1 - std::exp(-100 * 0.01);
  for (int i = 0; i < kN; ++i)
    EXPECT_NEAR(bench.record.residual[i], share * bench.push[i], calm + 0.05 * std::abs(bench.push[i])) << i;
  bench.run(0.5);
  for (int i = 0; i < kN; ++i) EXPECT_NEAR(bench.record.residual[i], bench.push[i], calm) << i;
}

TYPED_TEST(ContactMonitorTest, TheExplainedTorqueGivesTheSameResidual) {
  using Arm = typename Bench<TypeParam>::Arm;
  using Monitor = typename Bench<TypeParam>::Monitor;
  using Vector = typename Bench<TypeParam>::Vector;
  Bench<TypeParam> bench(1e3);
  Monitor monitor;
  ASSERT_EQ(monitor.configure(bench.monitor.config()), Status::kOk);
  typename Monitor::Record record;
  struct {
    Vector qd, torque;
    TypeParam period;
  } explained;
  auto last = bench.sample();
  ASSERT_EQ(bench.take(last), Status::kOk);
  double apart = 0.0;
  for (int k = 0; k < 1500; ++k) {
    bench.push[2] = k < 1000 ? 0.0 : 8.0;
    bench.time += 0.5 * kPeriod;
    const auto middle = bench.sample();
    bench.time += 0.5 * kPeriod;
    const auto now = bench.sample();
    ASSERT_EQ(bench.take(now), Status::kOk);
    const Vector q = TypeParam(0.5) * (last.q + now.q);
    const Vector acceleration = (now.qd - last.qd) / static_cast<TypeParam>(kPeriod);
    Vector bias;
    loaded_torque(bench.arm, joint_trigonometry<Arm>(q), q, middle.qd, acceleration, {}, bias,
                  explained.torque);
    explained.torque += static_cast<TypeParam>(kRotor) * acceleration + middle.friction;
    explained.qd = middle.qd;
    explained.period = static_cast<TypeParam>(kPeriod);
    ASSERT_EQ(monitor.update(explained, middle.tau, record), Status::kOk);
    for (int i = 0; i < kN; ++i) {
      const double other = static_cast<double>(bench.record.residual[i]);
      apart = std::max(apart, std::abs(static_cast<double>(record.residual[i]) - other));
    }
    last = now;
  }
  EXPECT_NEAR(record.residual[2], 8.0, 0.02);
  // With the step of 8 N·m the half sample by which a mean of two torques is late: half of K h, 0.4 N·m.
  EXPECT_LT(apart, 0.5);
  EXPECT_NEAR(record.residual[1], bench.record.residual[1], 0.02);

  // What is refused leaves no trace; a gap restarts the observer and is not taken.
  const Vector before = record.residual;
  for (const TypeParam bad :
       {std::numeric_limits<TypeParam>::quiet_NaN(), std::numeric_limits<TypeParam>::max()}) {
    auto wrong = explained;
    wrong.torque[3] = bad;
    EXPECT_EQ(monitor.update(wrong, last.tau, record), Status::kNonFiniteInput);
    wrong = explained, wrong.qd[0] = bad;
    EXPECT_EQ(monitor.update(wrong, last.tau, record), Status::kNonFiniteInput);
    EXPECT_FALSE(record.judged);
  }
  auto wrong = explained;
  wrong.period = TypeParam(0);
  EXPECT_EQ(monitor.update(wrong, last.tau, record), Status::kOutOfRange);
  const Vector as_explained = explained.torque - before;
  ASSERT_EQ(monitor.update(explained, as_explained, record), Status::kOk);
  for (int i = 0; i < kN; ++i)
    EXPECT_NEAR(record.residual[i], before[i], 1e-4 * (1 + std::abs(before[i]))) << i;
  auto gap = explained;
  gap.period = TypeParam(1);
  gap.torque.setConstant(TypeParam(1e4));
  ASSERT_EQ(monitor.update(gap, last.tau, record), Status::kOk);
  EXPECT_FALSE(record.judged);
  ASSERT_EQ(monitor.update(explained, explained.torque, record), Status::kOk);
  for (int i = 0; i < kN; ++i) EXPECT_EQ(record.residual[i], TypeParam(0)) << i;
}

TYPED_TEST(ContactMonitorTest, FindsARampAtTheElbowWithinTwentyMilliseconds) {
  // 30 N·m/s; noise of ±0.1 N·m on the torque, whose residual stays below 0.1 N·m.
  Bench<TypeParam> bench(0.2, 0.1);
  bench.run(5.0);
  ASSERT_TRUE(bench.events.empty());
  const double begin = bench.time;
  while (bench.events.empty() && bench.time < begin + 0.1) {
    bench.push[2] = 30 * (bench.time - begin);
    bench.run(kPeriod);
  }
  ASSERT_EQ(bench.events.size(), 1u);
  EXPECT_LE(bench.time - begin, 0.0201);
  EXPECT_EQ(bench.events[0].event, ContactEvent::kContact);
  EXPECT_EQ(bench.events[0].joint, 2);
  EXPECT_EQ(bench.events[0].direction, 1);
  EXPECT_TRUE(bench.monitor.contact());
  bench.push.setZero();
  bench.run(0.5);
  ASSERT_EQ(bench.events.size(), 2u);
  EXPECT_EQ(bench.events[1].event, ContactEvent::kReleased);
  EXPECT_FALSE(bench.monitor.contact());
}

TYPED_TEST(ContactMonitorTest, ASlowPushBeyondTheOffsetsOfFreeMotionIsFound) {
  Bench<TypeParam> bench(0.3);
  bench.run(3.0);
  const double begin = bench.time;
  while (bench.events.empty() && bench.time < begin + 10) {
    bench.push[1] = -0.2 * (bench.time - begin);
    bench.run(kPeriod);
  }
  ASSERT_EQ(bench.events.size(), 1u);
  EXPECT_LE(-bench.push[1], 0.7);  // offset limit and threshold, 0.3 each
  EXPECT_EQ(bench.events[0].direction, -1);
}

TYPED_TEST(ContactMonitorTest, AContactThatStandsStillWithinFrictionEndsAndALargerOneDoesNot) {
  for (const double held : {1.0, 3.0}) {  // the offsets of free motion reach to 2
    Bench<TypeParam> bench(0.3, 0.0, 2.0);
    bench.run(3.0);
    bench.push[1] = held;
    bench.run(2.9);
    ASSERT_EQ(bench.events.size(), 1u) << held;
    EXPECT_TRUE(bench.monitor.contact()) << held;
    bench.run(1.1);
    if (held < 2.0) {
      ASSERT_GE(bench.events.size(), 2u);
      EXPECT_EQ(bench.events[1].event, ContactEvent::kReleased);
    } else {
      EXPECT_EQ(bench.events.size(), 1u);
      EXPECT_TRUE(bench.monitor.contact());
    }
  }
}

TYPED_TEST(ContactMonitorTest, ABodyOnTheFlangeIsALoadChangeAndAPushIsNot) {
  const InertialParameters<double> body =
      make_inertial_parameters<double>(1.5, {0.02, 0.05, 0.03}, {0.001, 0, 0.001, 0, 0, 0.001});
  {
    Bench<TypeParam> bench(2.0);  // more than the body's inertia makes, which is not followed
    bench.run(3.0);
    bench.carry(body);
    bench.run(8.0);
    ASSERT_EQ(bench.events.size(), 2u);
    EXPECT_EQ(bench.events[0].event, ContactEvent::kContact);
    EXPECT_EQ(bench.events[1].event, ContactEvent::kLoadChange);
    EXPECT_NEAR(bench.events[1].load[0], 1.5, 0.3);
    EXPECT_FALSE(bench.monitor.contact());
  }
  {
    Bench<TypeParam> bench(0.5);
    bench.run(3.0);
    bench.push << 0, -8, 5, 0, 0, 0;
    bench.run(8.0);
    ASSERT_EQ(bench.events.size(), 1u);
    EXPECT_EQ(bench.events[0].event, ContactEvent::kContact);
    EXPECT_TRUE(bench.monitor.contact());
  }
}

TYPED_TEST(ContactMonitorTest, ARefusedSampleLeavesNoTraceAndSaysWhy) {
  Bench<TypeParam> tortured(0.3), spared(0.3);
  tortured.run(1.0), spared.run(1.0);
  using Limits = std::numeric_limits<TypeParam>;
  int refused = 0;
  for (const TypeParam bad : {Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity(), Limits::max()}) {
    for (int channel = 0; channel < 4; ++channel) {
      auto s = tortured.sample();
      (channel == 0 ? s.q : channel == 1 ? s.qd : channel == 2 ? s.tau : s.friction)[2] = bad;
      EXPECT_EQ(tortured.take(s), Status::kNonFiniteInput) << bad << " in channel " << channel;
      ++refused;
    }
  }
  EXPECT_EQ(refused, 16);
  EXPECT_EQ(tortured.take(tortured.sample(), -0.001), Status::kOutOfRange);
  EXPECT_EQ(tortured.take(tortured.sample(), 0.0), Status::kOutOfRange);
  EXPECT_EQ(tortured.take(tortured.sample(), std::nan("")), Status::kNonFiniteInput);
  tortured.run(0.2), spared.run(0.2);
  EXPECT_EQ(tortured.record.residual, spared.record.residual);
  EXPECT_EQ(tortured.record.deviation, spared.record.deviation);
}

TYPED_TEST(ContactMonitorTest, ADropoutRaisesNoAlarmAndIsJudgedAgainWithinASecond) {
  Bench<TypeParam> bench(0.3);
  bench.run(2.0);
  for (const double gap : {0.05, 0.5, 30.0}) {
    bench.time += gap;
    ASSERT_EQ(bench.take(bench.sample(), gap + kPeriod), Status::kOk);
    bench.time += kPeriod;
    bench.run(1.0);
    EXPECT_TRUE(bench.record.judged) << gap;
  }
  EXPECT_TRUE(bench.events.empty());
}

TYPED_TEST(ContactMonitorTest, RefusesSettingsThatMeanNothing) {
  using Monitor = ContactMonitor<TypeParam, kN>;
  typename Monitor::Config good;
  good.thresholds.joints.fill(JointThreshold<TypeParam>::uniform(1, 0));
  Monitor monitor;
  typename Monitor::Record record;
  EXPECT_EQ(monitor.update({}, Monitor::Observer::Matrix::Zero().template leftCols<4>().eval(),
                           Bench<TypeParam>::Vector::Zero(), Bench<TypeParam>::Vector::Zero(),
                           Bench<TypeParam>::Vector::Zero(), TypeParam(0.001), record),
            Status::kNotConfigured);
  ASSERT_EQ(monitor.configure(good), Status::kOk);
  const auto refused = [&](auto change) {
    auto config = good;
    change(config);
    return monitor.configure(config) == Status::kOutOfRange &&
           monitor.config().thresholds.bandwidth == good.thresholds.bandwidth;
  };
  EXPECT_TRUE(refused([](auto& c) { c.thresholds.joints[3].moving = 0; }));
  EXPECT_TRUE(refused([](auto& c) { c.thresholds.joints[3].rest = -1; }));
  EXPECT_TRUE(refused([](auto& c) { c.thresholds.joints[0].rest_speed = 0; }));
  EXPECT_TRUE(refused([](auto& c) { c.thresholds.joints[0].top_speed = 0; }));
  EXPECT_TRUE(refused([](auto& c) { c.thresholds.load_rate = 0; }));
  EXPECT_TRUE(refused([](auto& c) { c.thresholds.largest_step = 0; }));
  EXPECT_TRUE(refused([](auto& c) { c.thresholds.bandwidth = 0; }));
  EXPECT_TRUE(
      refused([](auto& c) { c.thresholds.adaptation = std::numeric_limits<TypeParam>::quiet_NaN(); }));
  EXPECT_TRUE(refused([](auto& c) { c.longest_period = 0; }));
  EXPECT_TRUE(refused([](auto& c) { c.load_share = TypeParam(0.2); }));
}

}  // namespace
}  // namespace heft
