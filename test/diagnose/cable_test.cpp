/// A cable that runs over two joints.
#include <algorithm>
#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "heft/core/effects/arm_effects.hpp"
#include "heft/diagnose/diagnose.hpp"
#include "heft/model/dynamics.hpp"
#include "refit.hpp"
#include "support/two_link_log.hpp"

namespace heft::diagnose {
namespace {

constexpr double kStiffness = 6.0, kNeutral = 0.3, kRatio = -1.4;

/// Without gravity in its plane, which over a short way is a spring too.
model::Robot level_arm() {
  model::Robot robot = test::two_link_with_friction();
  robot.gravity = {0.0, 0.0, -9.81};
  return robot;
}

/// A log of an arm whose joints a cable pulls by `part` of its torque, by its own formula.
data::Log log_with_cable(unsigned seed, double part) {
  test::TwoLinkLog made = test::two_link_motion("cable", seed);
  made.add_torque(level_arm());
  const Eigen::VectorXd pull =
      part * kStiffness * (made.log.q.col(1) + kRatio * made.log.q.col(0)).array() - part * kStiffness * kNeutral;
  made.log.tau.col(1) += pull;
  made.log.tau.col(0) += kRatio * pull;
  made.add_noise(seed + 100);
  return made.log;
}

Diagnosis diagnosed(double part) {
  return diagnose(level_arm(), {log_with_cable(1, part)}, {log_with_cable(2, part)});
}

std::string said(const Diagnosis& d) {
  std::string all;
  for (const Finding& f : d.findings) {
    all += std::string(f.effect.id()) + " " + std::to_string(f.joint + 1);
    for (const auto& [name, value] : f.parameters) all += " " + name + "=" + std::to_string(value);
    all += "\n";
  }
  return all;
}

TEST(Cable, OverTwoJointsIsFoundWithItsStiffness) {
  const Diagnosis d = diagnosed(1.0);
  ASSERT_EQ(d.findings.size(), 1U) << said(d);
  const Finding& found = d.findings[0];
  EXPECT_TRUE(found.effect.is<Cable>()) << found.effect.id();
  EXPECT_EQ(found.joint, 0);
  EXPECT_EQ(found.driven_joint, 1);
  ASSERT_EQ(found.parameters.size(), 3U);
  EXPECT_NEAR(found.parameters[0].second, kStiffness, 0.06 * kStiffness);
  EXPECT_NEAR(found.parameters[1].second, kNeutral, 0.05);
  EXPECT_NEAR(found.parameters[2].second, kRatio, 0.06 * std::abs(kRatio));
}

TEST(Cable, OfTheWrittenModelPullsNoFurtherThanItWasSeen) {
  const Diagnosis d = diagnosed(1.0);
  ASSERT_EQ(d.after.cables.size(), 1U);
  const JointCable<double>& cable = d.after.cables[0];
  const model::ModelFile file = d.model_file();
  ASSERT_EQ(file.cables.size(), 1U);
  EXPECT_EQ(file.cables[0].seen.high, cable.seen.high);
  const auto torque = [&](double stretch) {
    Eigen::VectorXd q(2), still = Eigen::VectorXd::Zero(2);
    q << 0.0, stretch;
    model::Robot bare = d.after;
    bare.cables.clear();
    return (model::Dynamics(d.after).joint_torque(q, still, still) -
            model::Dynamics(bare).joint_torque(q, still, still))
        .eval();
  };
  const Eigen::VectorXd at_border = torque(cable.seen.high), beyond = torque(cable.seen.high + 1.0);
  EXPECT_NEAR(at_border[1], cable.stiffness * (cable.seen.high - cable.neutral), 1e-9);
  EXPECT_NEAR(at_border[0], cable.ratio * at_border[1], 1e-9);
  EXPECT_NEAR(beyond[1], at_border[1], 1e-9);
  EXPECT_NEAR(beyond[0], at_border[0], 1e-9);
}

// A fit to all logs finds the offset of a joint next to the effects that contain one.
TEST(Refit, PutsAnOffsetIntoTheSpringOrCableThatContainsIt) {
  for (const bool spring : {true, false}) {
    model::Robot robot = level_arm();
    robot.joints[0].actuation.friction_offset = 0.4;
    robot.joints[1].actuation.friction_offset = -0.7;
    if (spring) {
      robot.effects.push_back({joint_effect_kind<Spring>(), 1, {kStiffness, kNeutral}});
    } else {
      robot.cables.push_back({.driving = 0, .driven = 1, .ratio = kRatio, .stiffness = kStiffness, .neutral = kNeutral});
    }
    model::Robot again = robot;
    put_offset_into_pull(again);
    EXPECT_EQ(again.joints[1].actuation.friction_offset, 0.0);
    for (const double q : {-0.8, 0.1, 0.9}) {
      const Eigen::Vector2d at(q, 0.5 - q), still = Eigen::Vector2d::Zero();
      const auto torque = [&](const model::Robot& of) { return model::Dynamics(of).joint_torque(at, still, still); };
      EXPECT_LT((torque(again) - torque(robot)).cwiseAbs().maxCoeff(), 1e-12);
    }
  }
}

TEST(Cable, IsNotNamedWhereThereIsNone) { EXPECT_TRUE(diagnosed(0.0).findings.empty()); }

TEST(Cable, IsNotNamedWhereASpringInOneJointDoes) {
  const auto log_with_spring = [](unsigned seed) {
    test::TwoLinkLog made = test::two_link_motion("spring", seed);
    made.add_torque(level_arm());
    made.log.tau.col(1).array() += kStiffness * (made.log.q.col(1).array() - kNeutral);
    made.add_noise(seed + 100);
    return made.log;
  };
  const Diagnosis d = diagnose(level_arm(), {log_with_spring(1)}, {log_with_spring(2)});
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_TRUE(d.findings[0].effect.is<Spring>()) << d.findings[0].effect.id();
  EXPECT_EQ(d.findings[0].joint, 1);
}

}  // namespace
}  // namespace heft::diagnose
