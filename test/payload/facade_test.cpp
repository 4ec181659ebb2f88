/// The load found from logs in three calls, and which logs that refuses.
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/error.hpp"
#include "heft/model/at_sensor.hpp"
#include "heft/model/model_file.hpp"
#include "heft/payload/payload.hpp"
#include "heft/validate/validate.hpp"
#include "support/arms.hpp"
#include "support/synthetic_log.hpp"
#include "support/temporary_folder.hpp"

namespace heft::payload {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

data::Log log_of(const model::Robot& robot, const std::string& name, std::uint32_t seed) {
  test::SyntheticSettings settings;
  settings.noise = 0.01;
  settings.motion_seed = settings.noise_seed = seed;
  data::Log log = test::synthetic_log(robot, settings);
  log.path = name;
  return log;
}

data::Log rows_of(const data::Log& log, Eigen::Index first, Eigen::Index count) {
  data::Log part;
  part.path = "part of " + log.path;
  part.time = log.time.segment(first, count);
  part.q = log.q.middleRows(first, count);
  part.qd = log.qd.middleRows(first, count);
  part.tau = log.tau.middleRows(first, count);
  return part;
}

class PayloadFacade : public ::testing::Test {
 protected:
  data::LogSet set(std::vector<data::Log> train, std::vector<data::Log> judge) const {
    return data::log_set(arm_.joint_specs(), std::move(train), std::move(judge));
  }

  const model::Robot arm_ = test::planar_two_link();
  const model::Robot loaded_ = test::carrying(arm_, test::body(0.8, {0.3, 0, 0}, {0, 0, 0.001, 0, 0, 0.001}));
  const data::Log empty_ = log_of(arm_, "empty", 1), zero_ = log_of(arm_, "zero", 2),
                  carrying_ = log_of(loaded_, "carrying", 3);
};

TEST_F(PayloadFacade, WeighsALoadFromLogsInMemory) {
  const data::LogSet logs = set({empty_}, {zero_, carrying_});
  const UnloadedArm arm = fit_unloaded(arm_, logs, 1);
  EXPECT_TRUE(arm.usable());
  ASSERT_EQ(arm.zero_checks.size(), 1U);
  EXPECT_NEAR(arm.zero_checks[0].mass.value, 0.0, 2.0 * arm.zero_checks[0].mass.half_width());
  const Payload load = estimate(arm, logs.judge().back());
  ASSERT_TRUE(load.answered());
  EXPECT_NEAR(load.run.mass.value, 0.8, 2.0 * load.run.mass.half_width());
  ASSERT_TRUE(load.after.has_value());
  EXPECT_LT(load.after->rmse.norm(), 0.5 * load.before.rmse.norm());
}

/// The log as drives show it whose torque constants are wrong by these factors, with the controller's own target torque.
data::Log with_targets(data::Log log, const Eigen::Vector2d& scale) {
  for (Eigen::Index j = 0; j < 2; ++j) {
    log.extra.emplace_back("tauref" + std::to_string(j + 1), log.tau.col(j));
    log.tau.col(j) *= scale[j];
  }
  return log;
}

TEST_F(PayloadFacade, TakesTheErrorOfTorqueConstantsOffTheLoadWhereTargetTorquesShowIt) {
  const Eigen::Vector2d scale(1.08, 1.06);
  const data::LogSet with = set({with_targets(empty_, scale)}, {with_targets(carrying_, scale)});
  const UnloadedArm arm = fit_unloaded(arm_, with);
  ASSERT_EQ(arm.drive_scale.size(), 2U);
  for (std::size_t j = 0; j < 2; ++j)
    EXPECT_NEAR(arm.drive_scale[j].value, scale[static_cast<Eigen::Index>(j)], 0.01);
  const Payload load = estimate(arm, with.judge().front());
  EXPECT_NEAR(load.run.mass.value, 0.8, 0.02);
  EXPECT_TRUE(load.run.mass.contains(0.8));
  // What a percent of one joint does, all joints together do in full.
  ASSERT_EQ(load.run.gain_share.size(), 2);
  EXPECT_NEAR(load.run.gain_share.sum(), 1.0, 0.01);

  // The same without target torque: heavier by what the constants are off.
  data::Log empty = empty_, carrying = carrying_;
  empty.tau = empty.tau * scale.asDiagonal(), carrying.tau = carrying.tau * scale.asDiagonal();
  const data::LogSet without = set({empty}, {carrying});
  const Payload heavier = estimate(fit_unloaded(arm_, without), without.judge().front());
  EXPECT_GT(heavier.run.mass.value, 0.8 * 1.05);

  // The scale goes with the model.
  model::Robot fitted = arm_;
  const model::ModelFile file = model::parse_model(model::to_json(arm.model_file()), "arm.json");
  model::apply(file, fitted);
  const data::LogSet alone = set({}, {with_targets(carrying_, scale)});
  const UnloadedArm again = arm_from_file(fitted, file, alone);
  ASSERT_EQ(again.drive_scale.size(), 2U);
  EXPECT_NEAR(estimate(again, alone.judge().front()).run.mass.value, load.run.mass.value, 1e-6);
}

TEST_F(PayloadFacade, WeighsEachLogAndSpreadsDoubtsAboutTheTorqueOfTheUnloadedArm) {
  const data::LogSet logs = set({empty_}, {zero_, carrying_, log_of(loaded_, "again", 4)});
  Options options;
  options.torque.resize(4);
  options.torque[1].add(host::Verdict::kDoubtful, "zero: of zero");
  options.torque[2].add(host::Verdict::kDoubtful, "carrying: of its own");
  const Weighing found = weigh(arm_, logs, 1, options);
  ASSERT_EQ(found.loads.size(), 2U);
  EXPECT_EQ(found.loads[0].log, "carrying");
  EXPECT_EQ(found.loads[1].log, "again");
  EXPECT_EQ(found.loads[0].run.parameters, estimate(found.arm, logs.judge()[1]).run.parameters);
  EXPECT_THAT(found.loads[0].judgement.reasons,
              AllOf(Contains("zero: of zero"), Contains("carrying: of its own")));
  EXPECT_THAT(found.loads[1].judgement.reasons,
              AllOf(Contains("zero: of zero"), Not(Contains("carrying: of its own"))));
  EXPECT_TRUE(found.unanswered().empty());
  EXPECT_FALSE(found.contradicted());
}

TEST_F(PayloadFacade, RefusesRowsThatTheArmDoesNotHaveBeforeItFits) {
  const data::LogSet logs = set({empty_}, {carrying_});
  Options options;
  options.first_joint = arm_.num_joints() + 1;
  options.progress = [](const std::string& what, double) { FAIL() << "began with " << what; };
  try {
    weigh(arm_, logs, 0, options);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("expected 1 to "));
  }
}

TEST_F(PayloadFacade, TheModelFileHoldsTheResidualThatTheEstimateNeeds) {
  const data::LogSet logs = set({empty_}, {carrying_});
  const UnloadedArm fitted = fit_unloaded(arm_, logs);
  const model::ModelFile file = fitted.model_file();
  model::Robot robot = arm_;
  model::apply(file, robot);
  const UnloadedArm read = arm_from_file(robot, file, set({}, {carrying_}));
  ASSERT_TRUE(read.residual.has_value());
  EXPECT_EQ(read.residual->std, fitted.residual->std);
  EXPECT_DOUBLE_EQ(estimate(read, logs.judge()[0]).run.mass.value,
                   estimate(fitted, logs.judge()[0]).run.mass.value);
}

TEST_F(PayloadFacade, ErrsBeforeTheLoadAsMuchAsValidateSaysOfTheSameModel) {
  // Without logged velocities, so that both derive the motion in the same way.
  data::Log empty = empty_, carrying = carrying_;
  empty.qd.resize(0, 0), carrying.qd.resize(0, 0);
  const data::LogSet logs = set({empty}, {carrying});
  const UnloadedArm arm = fit_unloaded(arm_, logs);
  const Eigen::VectorXd before = estimate(arm, logs.judge()[0]).before.rmse;
  const Eigen::VectorXd judged = validate::validate(arm.model_file(), arm_, set({}, {carrying})).all.rmse;
  for (Eigen::Index j = 0; j < 2; ++j) EXPECT_NEAR(before[j], judged[j], 1e-6 * judged[j]);
}

/// Behind the gears: no friction, and every sensor's zero is off by more torque than the load's joint 2 gives.
class SensorOffset : public PayloadFacade {
 protected:
  static data::Log at_sensors(const model::Robot& robot, const std::string& name, std::uint32_t seed) {
    model::Robot seen = model::at_sensor(robot);
    for (model::RobotJoint& joint : seen.joints) joint.actuation.friction_offset = kOffset;
    return log_of(seen, name, seed);
  }

  static constexpr double kOffset = 3.0;
  const data::LogSet logs_ = data::log_set(arm_.joint_specs(), {at_sensors(arm_, "empty", 1)},
                                           {at_sensors(loaded_, "carrying", 3)}, data::TorqueAt::kJoint);
  const Options options_{.torque_at = data::TorqueAt::kJoint};
  const UnloadedArm fitted_ = fit_unloaded(arm_, logs_, 0, options_);
};

TEST_F(SensorOffset, BelongsToTheModelFittedThereAndNotToTheLoad) {
  const Payload load = estimate(fitted_, logs_.judge()[0], options_);
  ASSERT_TRUE(load.answered());
  EXPECT_NEAR(load.run.mass.value, 0.8, 2.0 * load.run.mass.half_width());
  EXPECT_LT(load.run.mass.half_width(), 0.05);
  ASSERT_TRUE(load.after.has_value());
  EXPECT_LT(load.after->rmse.maxCoeff(), 0.2 * kOffset);
}

TEST_F(SensorOffset, SurvivesTheModelFile) {
  const model::ModelFile file = model::parse_model(model::to_json(fitted_.model_file()), "sensor.json");
  model::Robot robot = arm_;
  model::apply(file, robot);
  const data::LogSet carrying =
      data::log_set(arm_.joint_specs(), {}, {at_sensors(loaded_, "carrying", 3)}, data::TorqueAt::kJoint);
  const UnloadedArm read = arm_from_file(robot, file, carrying, 0, options_);
  EXPECT_DOUBLE_EQ(estimate(read, carrying.judge()[0], options_).run.mass.value,
                   estimate(fitted_, logs_.judge()[0], options_).run.mass.value);
}

TEST_F(SensorOffset, IsInWhatValidatePredictsOfThatModel) {
  const data::LogSet empty =
      data::log_set(arm_.joint_specs(), {}, {at_sensors(arm_, "another", 2)}, data::TorqueAt::kJoint);
  const validate::Validation judged = validate::validate(fitted_.model_file(), arm_, empty);
  EXPECT_LT(judged.all.bias.cwiseAbs().maxCoeff(), 0.1 * kOffset);
}

TEST_F(PayloadFacade, RefusesToWeighALogWithoutLoad) {
  EXPECT_THROW(set({empty_}, {empty_}), DataError);
  const data::LogSet logs = set({empty_}, {zero_, rows_of(zero_, 500, 800)});
  const UnloadedArm arm = fit_unloaded(arm_, logs, 1);
  EXPECT_THAT(test::message_of<DataError>([&] { estimate(arm, logs.judge()[1]); }),
              AllOf(HasSubstr("part of zero"), HasSubstr("log without load")));
}

TEST_F(PayloadFacade, RefusesALogInDegrees) {
  data::Log degrees = carrying_;
  degrees.path = "degrees";
  degrees.q *= 57.29577951308232;
  degrees.qd *= 57.29577951308232;
  model::Robot arm = arm_;
  for (model::RobotJoint& joint : arm.joints)
    joint.lower = -3.0, joint.upper = 3.0, joint.velocity_limit = 5.0;
  EXPECT_THAT(test::message_of<DataError>([&] { data::log_set(arm.joint_specs(), {empty_}, {degrees}); }),
              HasSubstr("degree"));
}

}  // namespace
}  // namespace heft::payload
