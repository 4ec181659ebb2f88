// A fitted model is good when unseen logs say so.
#include "identify/judgement.hpp"

#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/data/log.hpp"
#include "heft/data/log_part.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/arms.hpp"
#include "support/measured_data.hpp"
#include "support/synthetic_log.hpp"

namespace heft::identify {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using validate::score;
using Rank = host::Verdict;

/// Logs of one arm on different motions, judged by a fit to one of them.
host::Judgement judged_on_unseen(double noise, Method method, bool held_out = true) {
  model::Robot robot = test::six_joint_arm();
  // Without friction a log is perfect: what a sign does between two samples is lost in any log.
  if (noise == 0.0) {
    for (model::RobotJoint& joint : robot.joints) joint.actuation = {};
  }
  const data::MotionStream train(test::synthetic_log(robot, 1, noise)), unseen(test::synthetic_log(robot, 2, noise));
  FitOptions options;
  options.method = method;
  options.structure.rotor_inertia = false;
  const Fit found = fit(robot, {&train}, options);
  const model::MassMatrixCheck mass = model::check_mass_matrix(found.robot, 1000, 1);
  if (!held_out) return judge(found, mass, {}, {score(found.robot, train)});
  return judge(found, mass, {score(found.robot, unseen)});
}

TEST(SimulatedArm, IsGreenOnALogNotSeen) {
  // Perfect logs, and noise of a hundredth of the torque where the links are held to what is possible.
  for (const auto& [noise, method] :
       {std::pair{0.0, Method::kWls}, {0.0, Method::kPhysical}, {0.01, Method::kPhysical}}) {
    const host::Judgement judged = judged_on_unseen(noise, method);
    EXPECT_EQ(judged.verdict, Rank::kGood) << noise << ::testing::PrintToString(judged.reasons);
    EXPECT_THAT(judged.reasons, IsEmpty());
  }
}

TEST(SimulatedArm, IsDoubtfulWithoutALogNotSeen) {
  const host::Judgement judged = judged_on_unseen(0.01, Method::kPhysical, false);
  EXPECT_EQ(judged.verdict, Rank::kDoubtful);
  EXPECT_THAT(judged.reasons, ::testing::ElementsAre(HasSubstr("--validate")));
}

TEST(SimulatedArm, IsDoubtfulWhereNoiseMakesItsLinksImpossible) {
  const host::Judgement judged = judged_on_unseen(0.01, Method::kWls);
  EXPECT_EQ(judged.verdict, Rank::kDoubtful);
  EXPECT_THAT(judged.reasons, ::testing::ElementsAre(HasSubstr("--method physical")));
}

TEST(MeasuredTx40, IsNotUsable) {
  const std::string folder = HEFT_DATA_DIR "/staubli-tx40";
  HEFT_NEEDS_MEASURED_DATA(folder);
  const model::Robot robot = urdf::load_urdf(folder + "/robot.urdf");
  data::LogRequirements needs;
  needs.num_joints = 6;
  needs.torque = true;
  const data::Log whole = data::read_log(folder + "/run-first6s.csv", needs);
  const data::MotionStream train(data::part_of(whole, 0.0, 4.2)), unseen(data::part_of(whole, 4.2, 6.0));
  const Fit found = fit(robot, {&train});
  const host::Judgement judged =
      judge(found, model::check_mass_matrix(found.robot, 1000, 1), {score(found.robot, unseen)});
  // Its wrist is coupled, which this model does not know.
  EXPECT_FALSE(judged.usable());
  ASSERT_THAT(judged.reasons, SizeIs(3));
  EXPECT_THAT(judged.reasons[0], HasSubstr("joint 5"));
  EXPECT_THAT(judged.reasons[1], HasSubstr("of 58 base parameters"));
  EXPECT_THAT(judged.reasons[2], HasSubstr("not positive definite in 1000 of 1000 poses"));
}

}  // namespace
}  // namespace heft::identify
