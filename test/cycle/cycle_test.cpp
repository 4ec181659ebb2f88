/// The model in a controller's cycle: right torque, the load it finds, contacts, what it refuses, and no heap.
#include "heft/cycle/cycle.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cycle/arm_run.hpp"
#include "heft/core/denavit_hartenberg.hpp"
#include "heft/model/model_file.hpp"
#include "heft/monitor/monitor.hpp"
#include "support/allocation_counter.hpp"
#include "support/arms.hpp"
#include "support/temporary_folder.hpp"

namespace heft::cycle {
namespace {

using test::ArmRun;
using ::testing::HasSubstr;

std::vector<double> list(const Eigen::VectorXd& values) { return {values.begin(), values.end()}; }

class CycleTest : public testing::Test {
 protected:
  CycleTest() : robot_(test::six_joint_arm()) {}

  /// A model file of the arm, with thresholds if they are given.
  std::string file(const model::Robot& robot, bool with_thresholds) const {
    model::ModelFile file = model::make_model(robot);
    if (with_thresholds) {
      monitor::Thresholds thresholds;
      thresholds.joints.assign(6, {15, 15, 15, 15, 15, 15, 0.02, 3});
      file = thresholds.model_file(std::move(file));
    }
    const std::string path = folder_.path(with_thresholds ? "watched.json" : "arm.json");
    model::write_model(path, file);
    return path;
  }

  test::TemporaryFolder folder_;
  model::Robot robot_;
};

TEST_F(CycleTest, CommandsTheTorqueOfTheModel) {
  Cycle cycle;
  ASSERT_EQ(cycle.configure({.model = file(robot_, false)}), Status::kOk) << cycle.message();
  EXPECT_EQ(cycle.num_joints(), 6);
  EXPECT_EQ(cycle.joint_names().size(), 6U);
  const model::Dynamics truth(robot_);
  for (int k = 0; k < 200; ++k) {
    const ArmRun::Motion motion = ArmRun::motion(0.01 * k, 6);
    std::vector<double> tau(6);
    ASSERT_EQ(cycle.inverse_dynamics(list(motion.q), list(motion.qd), list(motion.qdd), 0.01, tau),
              Status::kOk);
    const Eigen::VectorXd expected = truth.joint_torque(motion.q, motion.qd, motion.qdd, 0.02);
    for (int i = 0; i < 6; ++i) EXPECT_NEAR(tau[static_cast<std::size_t>(i)], expected[i], 1e-9);
  }
}

TEST_F(CycleTest, FindsTheLoadAndCarriesIt) {
  Cycle cycle, empty;
  const std::string model = file(robot_, false);
  ASSERT_EQ(cycle.configure({.model = model}), Status::kOk) << cycle.message();
  ASSERT_EQ(empty.configure({.model = model, .follow_load = false}), Status::kOk) << empty.message();
  model::Robot loaded = robot_;
  const InertialParameters<double> body =
      make_inertial_parameters(2.0, {0.03, 0.0, 0.08}, {0.01, 0, 0.01, 0, 0, 0.01});
  for (std::size_t i = 0; i < body.size(); ++i) loaded.joints.back().link[i] += body[i];
  ArmRun run(loaded);
  Output out;
  for (int k = 0; k < 5000; ++k) {
    const ArmRun::Sample sample = run.next();
    ASSERT_EQ(cycle.update(sample.q, sample.qd, sample.tau, ArmRun::kPeriod, out), Status::kOk);
    ASSERT_EQ(empty.update(sample.q, sample.qd, sample.tau, ArmRun::kPeriod, out), Status::kOk);
  }
  EXPECT_EQ(out.load_state, LoadState::kKnown);
  EXPECT_NEAR(out.mass, 2.0, 0.05);
  EXPECT_NEAR(out.com[2], 0.08, 0.01);
  EXPECT_TRUE(out.explained);
  EXPECT_FALSE(out.contact_judged) << "the model has no thresholds";
  const ArmRun::Motion pose = ArmRun::motion(1.0, 6);
  const std::vector<double> rest(6, 0.0);
  std::vector<double> with(6), without(6);
  ASSERT_EQ(cycle.inverse_dynamics(list(pose.q), rest, rest, ArmRun::kPeriod, with), Status::kOk);
  ASSERT_EQ(empty.inverse_dynamics(list(pose.q), rest, rest, ArmRun::kPeriod, without), Status::kOk);
  const double weight =
      model::Dynamics(loaded).gravity_torque(pose.q)[1] - model::Dynamics(robot_).gravity_torque(pose.q)[1];
  ASSERT_GT(std::abs(weight), 4.0);
  EXPECT_NEAR(with[1] - without[1], weight, 0.05 * std::abs(weight));
  cycle.reset();
  ASSERT_EQ(cycle.inverse_dynamics(list(pose.q), rest, rest, ArmRun::kPeriod, with), Status::kOk);
  EXPECT_DOUBLE_EQ(with[1], without[1]) << "the load is forgotten";
}

TEST_F(CycleTest, NamesTheJointThatIsPushed) {
  Cycle cycle;
  ASSERT_EQ(cycle.configure({.model = file(robot_, true)}), Status::kOk) << cycle.message();
  EXPECT_TRUE(cycle.watches_contacts());
  ArmRun run(robot_);
  Output out;
  int before = 0, during = 0;
  for (int k = 0; k < 2500; ++k) {
    ArmRun::Sample sample = run.next();
    const bool pushed = k >= 2000 && k < 2250;
    if (pushed) sample.tau[1] += 50.0;  // the drive works against a push along negative q
    ASSERT_EQ(cycle.update(sample.q, sample.qd, sample.tau, ArmRun::kPeriod, out), Status::kOk);
    if (k < 2000) before += out.contact ? 1 : 0;
    if (pushed && out.contact) {
      ++during;
      EXPECT_EQ(out.contact_joint, 1);
      EXPECT_EQ(out.contact_direction, -1);
    }
  }
  EXPECT_EQ(before, 0);
  EXPECT_GT(during, 200) << "of 250 samples";
}

TEST_F(CycleTest, RefusesWhatItCannotUseAndKeepsItsState) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> zero(6, 0.0), bad{0, 0, nan, 0, 0, 0}, five(5, 0.0);
  Output out;
  out.mass = 7.0;
  std::vector<double> tau(6, 3.0);
  Cycle cycle;
  EXPECT_EQ(cycle.update(zero, zero, zero, 0.002, out), Status::kNotConfigured);
  EXPECT_EQ(cycle.inverse_dynamics(zero, zero, zero, 0.002, tau), Status::kNotConfigured);
  ASSERT_EQ(cycle.configure({.model = file(robot_, false)}), Status::kOk) << cycle.message();
  EXPECT_EQ(cycle.update(five, zero, zero, 0.002, out), Status::kOutOfRange);
  EXPECT_EQ(cycle.update(zero, zero, five, 0.002, out), Status::kOutOfRange);
  EXPECT_EQ(cycle.update(zero, bad, zero, 0.002, out), Status::kNonFiniteInput);
  EXPECT_EQ(cycle.update(zero, zero, zero, 0.0, out), Status::kOutOfRange);
  EXPECT_EQ(cycle.update(zero, zero, zero, nan, out), Status::kNonFiniteInput);
  EXPECT_EQ(cycle.inverse_dynamics(zero, zero, bad, 0.002, tau), Status::kNonFiniteInput);
  EXPECT_EQ(cycle.inverse_dynamics(zero, zero, zero, 0.002, std::span(tau).first(5)), Status::kOutOfRange);
  EXPECT_EQ(out.mass, 7.0);
  EXPECT_EQ(tau, std::vector<double>(6, 3.0));

  // What cannot be configured says why, and the arm before stays.
  EXPECT_EQ(cycle.configure({.model = folder_.path("none.json")}), Status::kOutOfRange);
  EXPECT_THAT(cycle.message(), HasSubstr("none.json"));
  EXPECT_EQ(cycle.configure({}), Status::kOutOfRange);
  EXPECT_THAT(cycle.message(), HasSubstr("neither 'urdf' nor 'model'"));
  EXPECT_EQ(cycle.configure({.urdf = "<robot name='x'>"}), Status::kOutOfRange);
  EXPECT_THAT(cycle.message(), HasSubstr("robot description"));
  EXPECT_EQ(cycle.num_joints(), 6);
  EXPECT_EQ(cycle.inverse_dynamics(zero, zero, zero, 0.002, tau), Status::kOk);
}

TEST_F(CycleTest, TakesNothingFromTheHeap) {
  if (!test::allocations_are_counted()) GTEST_SKIP() << "malloc belongs to a sanitizer in this build";
  Cycle cycle;
  ASSERT_EQ(cycle.configure({.model = file(robot_, true)}), Status::kOk) << cycle.message();
  ArmRun run(robot_);
  Output out;
  std::vector<double> tau(6);
  const std::vector<double> bad(6, std::numeric_limits<double>::infinity());
  test::AllocationCount spent;
  int refused = 0;
  for (int k = 0; k < 3000; ++k) {
    ArmRun::Sample sample = run.next();
    const test::AllocationCount before = test::allocation_count();
    refused += cycle.update(sample.q, k % 500 == 3 ? bad : sample.qd, sample.tau, ArmRun::kPeriod, out) ==
                       Status::kOk
                   ? 0
                   : 1;
    refused +=
        cycle.inverse_dynamics(sample.q, sample.qd, sample.qd, ArmRun::kPeriod, tau) == Status::kOk ? 0 : 1;
    if (k == 1500) cycle.reset();
    const test::AllocationCount now = test::allocation_count() - before;
    spent.operator_new += now.operator_new;
    spent.malloc += now.malloc;
  }
  EXPECT_EQ(refused, 6);
  EXPECT_EQ(spent.operator_new, 0U);
  EXPECT_EQ(spent.malloc, 0U);
}

TEST_F(CycleTest, ReadsARobotByNameAndFromText) {
  Cycle cycle;
  ASSERT_EQ(cycle.configure({.urdf = "ur5e"}), Status::kOk) << cycle.message();
  EXPECT_EQ(cycle.joint_names().front(), "shoulder_pan_joint");
  EXPECT_FALSE(cycle.watches_contacts());
}

}  // namespace
}  // namespace heft::cycle
