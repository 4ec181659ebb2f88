/// Stiffness of the first three joints of a heavy industrial arm from its two encoders a joint, on two runs.
#include <cmath>
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/data/log.hpp"
#include "heft/stiffness/joint_encoders.hpp"
#include "support/measured_data.hpp"

namespace heft::stiffness {
namespace {

using ::testing::ElementsAre;

class MeasuredKr300 : public ::testing::Test {
 protected:
  void SetUp() override { HEFT_NEEDS_MEASURED_DATA(folder()); }
  static std::string folder() { return HEFT_DATA_DIR "/kr300-weigand"; }
  static data::Log log(const std::string& name) {
    data::LogRequirements needs;
    needs.num_joints = 6;
    needs.torque = true;
    return data::read_log(folder() + "/" + name + ".csv", needs);
  }
  /// Rotor inertias and gear ratios that the data's source gives.
  static JointEncoderOptions options() {
    const auto reflected = [](double inertia, double ratio) { return inertia * ratio * ratio; };
    JointEncoderOptions o;
    o.rotor_inertia = {reflected(0.0092, 1798.0 / 7),
                       reflected(0.0118, 1872.0 / 7),
                       reflected(0.0118, 757.0 / 3),
                       0.0,
                       0.0,
                       0.0};
    return o;
  }
  static JointEncoderFit both() { return fit_joint_encoders({log("run-a"), log("run-b")}, options()); }
};

TEST_F(MeasuredKr300, StiffnessOfTwoRunsAgrees) {
  const JointEncoderFit fit = both();
  EXPECT_THAT(fit.joints, ElementsAre(0, 1, 2));
  for (std::size_t j = 0; j < 3; ++j) {
    EXPECT_TRUE(fit.agreement[j].agrees) << "A" << j + 1 << ": " << fit.agreement[j].text;
    const JointStiffness& pooled = fit.pooled[j];
    ASSERT_TRUE(pooled.identifiable) << pooled.reason;
    for (const auto& run : fit.separate) {
      // Ten seconds bound the stiffness from both sides, and the two bounds have the pooled value between them.
      ASSERT_TRUE(run[j].identifiable) << run[j].reason;
      EXPECT_LT(run[j].stiffness.lower, pooled.stiffness.value);
      EXPECT_GT(run[j].stiffness.upper, pooled.stiffness.value);
    }
    // Within the order of magnitude of gears of that size.
    EXPECT_GT(pooled.stiffness.value, 3e6);
    EXPECT_LT(pooled.stiffness.value, 2e7);
    EXPECT_LT(pooled.stiffness.upper, 2.5 * pooled.stiffness.lower);
    RecordProperty("stiffness_A" + std::to_string(j + 1), std::to_string(pooled.stiffness.value));
  }
}

TEST_F(MeasuredKr300, TheLinksChannelsComeLateByTheSameTime) {
  const JointEncoderFit fit = both();
  for (const CommonTimeShift& shift : fit.time_shift) {
    ASSERT_TRUE(shift.known);
    EXPECT_TRUE(shift.agrees) << shift.p_value;
    // Neither none nor a whole sample (4 ms).
    EXPECT_GT(shift.value.lower, 2.5e-3);
    EXPECT_LT(shift.value.upper, 3.1e-3);
  }
  // That delay is most of what the encoders differ by: a fit without it would take it for something else.
  const data::Log run = log("run-a");
  double speed = 0.0;
  for (const double qd : run.qd.col(0)) speed = std::max(speed, std::abs(qd));
  EXPECT_GT(fit.pooled[0].time_shift.value * speed, 5.0 * fit.pooled[0].rms_deflection);
}

TEST_F(MeasuredKr300, HysteresisIsFrictionOnTheMotorsSideWhereItShows) {
  const JointEncoderFit fit = both();
  for (std::size_t j = 0; j < 3; ++j) {
    const JointStiffness& s = fit.pooled[j];
    // No loop follows the torque.
    EXPECT_FALSE(s.gear_hysteresis.has_value()) << "A" << j + 1;
    EXPECT_EQ(s.direction.lost_motion_at_least, 0.0) << "A" << j + 1;
    EXPECT_FALSE(s.direction.text.empty());
  }
  // On the two joints that carry weight the loop runs against the motion.
  EXPECT_LT(fit.pooled[1].direction.loop.upper, 0.0);
  EXPECT_LT(fit.pooled[2].direction.loop.upper, 0.0);
  EXPECT_GT(fit.pooled[1].direction.friction_if_no_lost_motion, 100.0);
  EXPECT_LT(fit.pooled[1].direction.friction_if_no_lost_motion, 1000.0);
}

TEST_F(MeasuredKr300, TheFirstJointsEncodersDifferByAFunctionOfTheAngle) {
  // Run a turns the first joint to one side of the start, run b to the other. Without that function the two runs
  // tell stiffnesses of opposite sign.
  JointEncoderOptions plain = options();
  plain.terms = std::vector<DeflectionTerm>{};
  plain.memory = 0.0;
  const JointEncoderFit blind = fit_joint_encoders({log("run-a"), log("run-b")}, plain);
  EXPECT_FALSE(blind.agreement[0].agrees) << blind.agreement[0].text;
  EXPECT_LT(blind.separate[0][0].compliance.value, 0.0);
  const JointEncoderFit fit = both();
  for (const TermEvidence& e : fit.pooled[0].evidence) {
    if (e.term == DeflectionTerm::kEccentricity) {
      EXPECT_TRUE(e.used);
      EXPECT_LT(e.p_value, 0.05);
    }
  }
}

}  // namespace
}  // namespace heft::stiffness
