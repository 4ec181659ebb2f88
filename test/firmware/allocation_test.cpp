// Gate 4: the control cycle takes nothing from the heap, in ten thousand cycles of a Release build.
#include <array>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "firmware/log_table.hpp"
#include "firmware/online_replay.hpp"
#include "firmware/replay.hpp"
#include "heft/core/control/arm_controllers.hpp"
#include "heft/core/control/controller_switch.hpp"
#include "heft/core/control/terminal_link_controller.hpp"
#include "heft/core/converted.hpp"
#include "heft/core/dynamics/regressor.hpp"
#include "heft/core/effects/effect_feed_forward.hpp"
#include "heft/core/estimate/extended_kalman_filter.hpp"
#include "heft/core/estimate/instruments.hpp"
#include "heft/core/estimate/payload_estimator.hpp"
#include "heft/core/estimate/unscented_kalman_filter.hpp"
#include "heft/core/kinematics/geometric_jacobian.hpp"
#include "heft/core/kinematics/joint_deflection.hpp"
#include "heft/core/monitor/contact_monitor.hpp"
#include "support/allocation_counter.hpp"

namespace heft {
namespace {

using firmware::LogRow;

constexpr int kCycles = 10'000;

class Allocation : public testing::Test {
 protected:
  void SetUp() override {
    if (!test::allocations_are_counted()) GTEST_SKIP() << "malloc belongs to a sanitizer in this build";
  }
};

// The motion need not make sense as a robot's; a white one determines the estimate.
LogRow random_row(std::mt19937& generator) {
  std::uniform_real_distribution<float> uniform(-1.0F, 1.0F);
  LogRow row{};
  for (int i = 0; i < firmware::kNumJoints; ++i) {
    row.q[i] = uniform(generator);
    row.qd[i] = uniform(generator);
    row.qdd[i] = uniform(generator);
    row.q_ref[i] = row.q[i];
    row.qd_ref[i] = row.qd[i];
    row.qdd_ref[i] = row.qdd[i] + 0.1F * uniform(generator);
    row.tau[i] = uniform(generator);
  }
  return row;
}

// Allocations of kCycles calls of `cycle` with a row of a log.
template <typename Cycle>
test::AllocationCount allocations_of(Cycle&& cycle) {
  std::mt19937 generator(7);
  test::AllocationCount total;
  for (int i = 0; i < kCycles; ++i) {
    const LogRow row = random_row(generator);
    const test::AllocationCount before = test::allocation_count();
    cycle(row);
    const test::AllocationCount spent = test::allocation_count() - before;
    total.operator_new += spent.operator_new;
    total.malloc += spent.malloc;
  }
  return total;
}

template <typename Replay, typename Scalar>
void expect_cycle_without_allocation() {
  const auto replay = std::make_unique<Replay>();
  ASSERT_EQ(replay->configure(), Status::kOk);
  int refused = 0;
  const test::AllocationCount spent = allocations_of(
      [&](const LogRow& row) { refused += replay->step(row, Scalar(1e-3)) == Status::kOk ? 0 : 1; });
  EXPECT_EQ(spent.operator_new, 0U);
  EXPECT_EQ(spent.malloc, 0U);
  EXPECT_EQ(refused, 0);
}

template <typename Scalar>
void expect_controller_without_allocation() {
  using Controller = TerminalLinkController<firmware::EffectsArm, Scalar, 4>;
  using Vector = typename Controller::Vector;
  const auto controller = std::make_unique<Controller>();
  ASSERT_EQ(controller->configure({}), Status::kOk);
  int refused = 0;
  const test::AllocationCount spent = allocations_of([&](const LogRow& row) {
    const auto vector = [](const float* values) -> Vector {
      return Eigen::Map<const Eigen::Matrix<float, firmware::kNumJoints, 1>>(values).cast<Scalar>();
    };
    typename Controller::Record record;
    Vector tau = Vector::Zero();
    refused += controller->update({vector(row.q_ref), vector(row.qd_ref), vector(row.qdd_ref)}, vector(row.q),
                                  vector(row.tau), Scalar(1e-3), tau, record) == Status::kOk
                   ? 0
                   : 1;
  });
  EXPECT_EQ(spent.operator_new, 0U);
  EXPECT_EQ(spent.malloc, 0U);
  EXPECT_EQ(refused, 0);
}

// What the replay leaves out: the factored form with delayed accelerations as instruments, and the payload.
template <typename Scalar>
void expect_other_estimators_without_allocation() {
  using Arm = StaticArm<Scalar, firmware::PaperArm>;
  using Vector = typename Arm::Vector;
  const auto vector = [](const float* values) -> Vector {
    return Eigen::Map<const Eigen::Matrix<float, firmware::kNumJoints, 1>>(values).cast<Scalar>();
  };
  const auto terminal = std::make_unique<TerminalLinkEstimator<Arm, 4, EstimatorForm::kFactored>>();
  const auto payload = std::make_unique<PayloadEstimator<Scalar, firmware::kNumJoints>>();
  const auto regressor = std::make_unique<LinkRegressor<Scalar, firmware::kNumJoints>>();
  DelayedMean<Scalar, firmware::kNumJoints, 8> instrument;
  ASSERT_EQ(terminal->configure({}, {}, Vector::Zero(), Vector::Zero()), Status::kOk);
  ASSERT_EQ(payload->configure({}), Status::kOk);
  ASSERT_EQ(instrument.configure(3, 4), Status::kOk);
  int refused = 0;
  const test::AllocationCount spent = allocations_of([&](const LogRow& row) {
    const Vector q = vector(row.q);
    const Vector qd = vector(row.qd);
    const Vector qdd = vector(row.qdd);
    const Vector tau = vector(row.tau);
    typename TerminalLinkEstimator<Arm, 4, EstimatorForm::kFactored>::Record terminal_record;
    typename PayloadEstimator<Scalar, firmware::kNumJoints>::Record payload_record;
    refused +=
        terminal->update(q, qd, qdd, instrument.update(qdd), tau, terminal_record) == Status::kOk ? 0 : 1;
    link_regressor<Arm>(joint_trigonometry<Arm>(q), q, qd, qdd, *regressor);
    refused += payload->update(*regressor, qd, tau, payload_record) == Status::kOk ? 0 : 1;
  });
  EXPECT_EQ(spent.operator_new, 0U);
  EXPECT_EQ(spent.malloc, 0U);
  EXPECT_EQ(refused, 0);
}

// A white motion is all outliers: without a gate every value is taken.
template <typename Filter>
void expect_filter_without_allocation() {
  using Scalar = typename Filter::Scalar;
  const auto filter = std::make_unique<Filter>();
  typename Filter::Config config;
  config.gate = 0;
  ASSERT_EQ(filter->configure(config, converted<Scalar>(firmware::PaperArm::kModel)), Status::kOk);
  int filtered = 0;
  const test::AllocationCount spent = allocations_of([&](const LogRow& row) {
    const auto vector = [](const float* values) -> typename Filter::Vector {
      return Eigen::Map<const Eigen::Matrix<float, firmware::kNumJoints, 1>>(values).cast<Scalar>();
    };
    typename Filter::Record record;
    const Status status =
        filter->update(vector(row.q), vector(row.qd), vector(row.tau), Scalar(1e-3), record);
    filtered += status == Status::kOk && record.running ? 1 : 0;
  });
  EXPECT_EQ(spent.operator_new, 0U);
  EXPECT_EQ(spent.malloc, 0U);
  EXPECT_GT(filtered, kCycles / 2);
}

template <typename Scalar>
void expect_effects_without_allocation() {
  constexpr int kN = firmware::kNumJoints;
  using Vector = JointVector<Scalar, kN>;
  EffectFeedForward<Scalar, kN, kNumJointEffects> effects;
  std::array<JointEffect<double>, kNumJointEffects> found;
  for (int kind = 0; kind < kNumJointEffects; ++kind) {
    found[static_cast<std::size_t>(kind)] = {kind, kind % kN, {0.5, 0.25, 3.0, 1.0}};
  }
  ASSERT_EQ(effects.configure(found), Status::kOk);
  std::array<JointActuation<Scalar>, static_cast<std::size_t>(kN)> actuation{};
  int refused = 0;
  const test::AllocationCount spent = allocations_of([&](const LogRow& row) {
    const auto vector = [](const float* values) -> Vector {
      return Eigen::Map<const Eigen::Matrix<float, kN, 1>>(values).cast<Scalar>();
    };
    Vector tau = Vector::Zero();
    refused += effects.add_torque(Scalar(1), vector(row.q), vector(row.qd), vector(row.qdd), vector(row.tau),
                                  actuation, static_cast<Scalar>(0.01), tau) == Status::kOk
                   ? 0
                   : 1;
  });
  EXPECT_EQ(spent.operator_new, 0U);
  EXPECT_EQ(spent.malloc, 0U);
  EXPECT_EQ(refused, 0);
}

template <typename Scalar>
void expect_monitor_without_allocation() {
  constexpr int kN = firmware::kNumJoints;
  using Arm = StaticArm<Scalar, firmware::PaperArm>;
  using Vector = typename Arm::Vector;
  const auto vector = [](const float* values) -> Vector {
    return Eigen::Map<const Eigen::Matrix<float, kN, 1>>(values).cast<Scalar>();
  };
  const auto monitor = std::make_unique<ContactMonitor<Scalar, kN>>();
  typename ContactMonitor<Scalar, kN>::Config config;
  config.thresholds.joints.fill(JointThreshold<Scalar>::uniform(static_cast<Scalar>(0.01), Scalar(0)));
  ASSERT_EQ(monitor->configure(config), Status::kOk);
  int refused = 0, events = 0;
  const test::AllocationCount spent = allocations_of([&](const LogRow& row) {
    const Vector q = vector(row.q), qd = vector(row.qd);
    const auto trig = joint_trigonometry<Arm>(q);
    LagrangianTerms<Scalar, kN> terms;
    LoadColumns<Scalar, kN> columns;
    lagrangian_terms<Arm>(ConstantParameters<Scalar, firmware::PaperArm>{}, trig, q, qd, terms);
    load_columns<Arm>(trig, q, columns);
    typename ContactMonitor<Scalar, kN>::Record record;
    refused += monitor->update(terms, columns, qd, vector(row.tau), Vector::Zero(),
                               static_cast<Scalar>(0.001), record) == Status::kOk
                   ? 0
                   : 1;
    events += record.event == ContactEvent::kNone ? 0 : 1;
  });
  EXPECT_EQ(spent.operator_new, 0U);
  EXPECT_EQ(spent.malloc, 0U);
  EXPECT_EQ(refused, 0);
  EXPECT_GT(events, 0);  // contacts were looked into
}

/// Controllers of the one interface, another in charge every 400 cycles, on a motion smooth enough to be estimated from.
template <typename Scalar>
void expect_controllers_without_allocation() {
  constexpr int kN = firmware::kNumJoints;
  using Arm = RunTimeArm<kN, 8, 1>;
  using Vector = JointVector<Scalar, kN>;
  using All = ControllerSwitch<PdController<Arm, Scalar>, ComputedTorqueController<Arm, Scalar>,
                               LoadEstimatingController<Arm, Scalar>, ArmEstimatingController<Arm, Scalar>,
                               AdaptiveArmController<Arm, Scalar>>;
  const auto all = std::make_unique<All>();
  const auto model = converted<Scalar>(firmware::PaperArm::kModel);
  ASSERT_EQ(all->template get<0>().configure(model), Status::kOk);
  ASSERT_EQ(all->template get<1>().configure(model), Status::kOk);
  ASSERT_EQ(all->template get<2>().configure(model), Status::kOk);
  ASSERT_EQ(all->template get<3>().configure(model), Status::kOk);
  ASSERT_EQ(all->template get<4>().configure(model), Status::kOk);
  int cycle = 0, refused = 0, estimates = 0, adapted = 0;
  const test::AllocationCount spent = allocations_of([&](const LogRow& row) {
    typename All::Reference reference;
    for (int i = 0; i < kN; ++i) {
      const double w = 2 + 0.7 * i, t = 1e-3 * cycle;
      reference.q[i] = Scalar(0.5 * std::sin(w * t));
      reference.qd[i] = Scalar(0.5 * w * std::cos(w * t));
    }
    typename All::Measurement measured;
    measured.q = reference.q;
    measured.qd = reference.qd + Vector::Constant(Scalar(0.01));
    measured.tau = Eigen::Map<const Eigen::Matrix<float, kN, 1>>(row.tau).cast<Scalar>();
    measured.dt = Scalar(1e-3);
    refused += all->select(static_cast<std::size_t>(cycle / 400 % 5)) == Status::kOk ? 0 : 1;
    refused += all->step(reference, measured).status == Status::kOk ? 0 : 1;
    estimates += all->template get<3>().observed().new_estimate ? 1 : 0;
    adapted += all->template get<4>().adaptation().adapted ? 1 : 0;
    ++cycle;
  });
  EXPECT_EQ(spent.operator_new, 0U);
  EXPECT_EQ(spent.malloc, 0U);
  EXPECT_EQ(refused, 0);
  EXPECT_GT(estimates, 0);
  EXPECT_GT(adapted, 0);
}

template <typename Scalar>
void expect_statics_without_allocation() {
  constexpr int kN = firmware::kNumJoints;
  using Vector = JointVector<Scalar, kN>;
  ArmModel<Scalar, kN> arm;
  arm.joints[2].type = JointType::kPrismatic;
  const Vector stiffness = Vector::Constant(Scalar(1e4));
  int refused = 0;
  Scalar sum{0};
  const test::AllocationCount spent = allocations_of([&](const LogRow& row) {
    const Vector q = Eigen::Map<const Eigen::Matrix<float, kN, 1>>(row.q).cast<Scalar>();
    const ToolWrench<Scalar> wrench = ToolWrench<Scalar>::Constant(Scalar(row.tau[0]));
    const auto chain = chain_kinematics(arm, ToolFrame<Scalar>{}, q);
    const auto J = in_frame(chain.rotation, geometric_jacobian(chain));
    const Vector tau = joint_torque(J, wrench);
    Vector command = Vector::Zero();
    refused += compensated_command<Scalar, kN>(q, tau, stiffness, command) == Status::kOk ? 0 : 1;
    const Vector compliance = stiffness.cwiseInverse();
    sum += complementary_stiffness(chain, wrench, WrenchFrame::kTool)(0, 1) + command[0] +
           cartesian_compliance(J, compliance)(0, 0);
  });
  EXPECT_EQ(spent.operator_new, 0U);
  EXPECT_EQ(spent.malloc, 0U);
  EXPECT_EQ(refused, 0);
  volatile Scalar used = sum;  // what nobody uses, the compiler may leave out with the calls that made it
  static_cast<void>(used);
}

TEST_F(Allocation, MonitorInDoubleTakesNothingFromTheHeap) { expect_monitor_without_allocation<double>(); }

TEST_F(Allocation, MonitorInFloatTakesNothingFromTheHeap) { expect_monitor_without_allocation<float>(); }

TEST_F(Allocation, ControllersInDoubleTakeNothingFromTheHeap) {
  expect_controllers_without_allocation<double>();
}

TEST_F(Allocation, ControllersInFloatTakeNothingFromTheHeap) {
  expect_controllers_without_allocation<float>();
}

TEST_F(Allocation, StaticsInDoubleTakeNothingFromTheHeap) { expect_statics_without_allocation<double>(); }

TEST_F(Allocation, StaticsInFloatTakeNothingFromTheHeap) { expect_statics_without_allocation<float>(); }

TEST_F(Allocation, EffectsInDoubleTakeNothingFromTheHeap) { expect_effects_without_allocation<double>(); }

TEST_F(Allocation, EffectsInFloatTakeNothingFromTheHeap) { expect_effects_without_allocation<float>(); }

TEST_F(Allocation, CycleInDoubleTakesNothingFromTheHeap) {
  expect_cycle_without_allocation<firmware::Replay<double>, double>();
}

TEST_F(Allocation, CycleInFloatTakesNothingFromTheHeap) {
  expect_cycle_without_allocation<firmware::Replay<float>, float>();
}

TEST_F(Allocation, LoopWithItsLoadInDoubleTakesNothingFromTheHeap) {
  expect_cycle_without_allocation<firmware::OnlineReplay<double>, double>();
}

TEST_F(Allocation, LoopWithItsLoadInFloatTakesNothingFromTheHeap) {
  expect_cycle_without_allocation<firmware::OnlineReplay<float>, float>();
}

TEST_F(Allocation, TerminalLinkControllerInDoubleTakesNothingFromTheHeap) {
  expect_controller_without_allocation<double>();
}

TEST_F(Allocation, TerminalLinkControllerInFloatTakesNothingFromTheHeap) {
  expect_controller_without_allocation<float>();
}

TEST_F(Allocation, OtherEstimatorsInDoubleTakeNothingFromTheHeap) {
  expect_other_estimators_without_allocation<double>();
}

TEST_F(Allocation, OtherEstimatorsInFloatTakeNothingFromTheHeap) {
  expect_other_estimators_without_allocation<float>();
}

TEST_F(Allocation, ExtendedKalmanFilterTakesNothingFromTheHeap) {
  expect_filter_without_allocation<ExtendedKalmanFilter<double, firmware::kNumJoints>>();
}

TEST_F(Allocation, UnscentedKalmanFilterTakesNothingFromTheHeap) {
  expect_filter_without_allocation<UnscentedKalmanFilter<float, firmware::kNumJoints>>();
}

// The two bad specimens: what the gate must see.
TEST_F(Allocation, VectorInTheLoopIsCaught) {
  const test::AllocationCount spent = allocations_of([](const LogRow& row) {
    const std::vector<float> copy(row.q, row.q + firmware::kNumJoints);
    volatile float sink = copy[0];
    static_cast<void>(sink);
  });
  EXPECT_EQ(spent.operator_new, static_cast<std::uint64_t>(kCycles));
  EXPECT_GE(spent.malloc, static_cast<std::uint64_t>(kCycles));
}

TEST_F(Allocation, MallocInTheLoopIsCaught) {
  const test::AllocationCount spent = allocations_of([](const LogRow&) {
    void* volatile block = std::malloc(64);
    std::free(block);
  });
  EXPECT_EQ(spent.operator_new, 0U);
  EXPECT_EQ(spent.malloc, static_cast<std::uint64_t>(kCycles));
}

}  // namespace
}  // namespace heft
