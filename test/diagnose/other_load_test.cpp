// A load that the arm carries in the validation logs only: said, and no model is fitted to both.
#include <algorithm>
#include <string>

#include <gtest/gtest.h>

#include "heft/diagnose/diagnose.hpp"
#include "support/arms.hpp"
#include "support/synthetic_log.hpp"

namespace heft::diagnose {
namespace {

/// @param trained, judged  mass carried in the training log and in the validation log [kg]
/// @param scale            of the validation log's torque
Diagnosis with_loads(double trained, double judged, unsigned seed, double scale = 1.0) {
  model::Robot robot = test::three_joint_arm();
  for (model::RobotJoint& joint : robot.joints) joint.actuation = {0.3, 5.0, 4.0, 0.2};
  const auto carrying = [&](double mass) {
    return mass > 0.0 ? test::carrying(robot, test::body(mass, {0.0, 0.0, 0.05}, {1e-3, 0, 1e-3, 0, 0, 1e-3})) : robot;
  };
  data::Log validate = test::synthetic_log(carrying(judged), seed + 500, 0.02);
  validate.tau *= scale;
  return diagnose(robot, {test::synthetic_log(carrying(trained), seed, 0.02)}, {validate});
}

std::string said_of_load(const Diagnosis& d) {
  const auto note = std::find_if(d.notes.begin(), d.notes.end(),
                                 [](const std::string& text) { return text.find("the arm carries") != std::string::npos; });
  return note == d.notes.end() ? "" : *note;
}

TEST(OtherLoad, IsSaidAndNoModelIsFittedToBothLoads) {
  for (const unsigned seed : {1U, 2U}) {
    const Diagnosis picked_up = with_loads(0.0, 0.3, seed), put_down = with_loads(0.3, 0.0, seed);
    EXPECT_NE(said_of_load(picked_up).find("kg more at its last link"), std::string::npos) << said_of_load(picked_up);
    EXPECT_NE(said_of_load(put_down).find("kg less at its last link"), std::string::npos) << said_of_load(put_down);
    for (const Diagnosis* d : {&picked_up, &put_down}) {
      EXPECT_TRUE(d->logs_contradict);
      EXPECT_FALSE(d->refitted.has_value());
      const host::Judgement judgement = d->judgement();
      EXPECT_NE(judgement.verdict, host::Verdict::kGood);
      EXPECT_TRUE(std::any_of(judgement.reasons.begin(), judgement.reasons.end(), [](const std::string& reason) {
        return reason.find("contradict each other: in the validation logs the arm carries 0.") != std::string::npos;
      }));
    }
  }
}

// Other torque constants are no load, though one explains part of what they do.
TEST(OtherLoad, IsNotSaidWhereTheTorqueHasAnotherScale) {
  for (const unsigned seed : {1U, 2U}) {
    for (const double scale : {0.9, 1.1}) EXPECT_EQ(said_of_load(with_loads(0.0, 0.0, seed, scale)), "") << seed << ", " << scale;
  }
}

TEST(OtherLoad, IsNotSaidWhereTheLoadIsTheSame) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    for (const double mass : {0.0, 0.3}) {
      const Diagnosis d = with_loads(mass, mass, seed);
      EXPECT_EQ(said_of_load(d), "") << "seed " << seed;
      EXPECT_FALSE(d.logs_contradict);
    }
  }
}

}  // namespace
}  // namespace heft::diagnose
