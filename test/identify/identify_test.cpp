// The facade: what a caller gets is what the command gives, refusals included.
#include "heft/identify/identify.hpp"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/error.hpp"
#include "heft/validate/validate.hpp"
#include "support/arms.hpp"
#include "support/synthetic_log.hpp"
#include "support/temporary_folder.hpp"

namespace heft::identify {
namespace {

using test::message_of;
using testing::AllOf;
using testing::HasSubstr;
using testing::SizeIs;

data::Log log_of(const model::Robot& robot, unsigned seed) {
  test::SyntheticSettings settings;
  settings.duration = 12.0;
  settings.noise = 0.01;
  settings.motion_seed = settings.noise_seed = seed;
  return test::synthetic_log(robot, settings);
}

/// Limits as wide as the synthetic motion needs.
std::vector<JointSpec> joints_of(const model::Robot& robot) {
  std::vector<JointSpec> joints = robot.joint_specs();
  for (JointSpec& joint : joints) joint = {joint.type};
  return joints;
}

Identification identified(const model::Robot& robot) {
  return identify(robot, data::log_set(joints_of(robot), {log_of(robot, 1)}, {log_of(robot, 2)}));
}

TEST(Identify, JudgesOnTheLogsThatItDidNotSee) {
  const model::Robot robot = test::planar_two_link();
  const Identification found = identified(robot);
  ASSERT_THAT(found.held_out, SizeIs(1));
  EXPECT_EQ(found.how, "judged on logs that the fit has not seen");
  EXPECT_LT(found.held_out[0].percent_of_max.maxCoeff(), 3.0);
  EXPECT_EQ(found.train_logs[0].samples, found.train[0].samples + 100);  // half a second at either end
  EXPECT_TRUE(found.usable());
}

TEST(Identify, GivesAModelFileWithSpreadsRecordAndLogs) {
  const model::Robot robot = test::planar_two_link();
  const Identification found = identified(robot);
  const model::ModelFile file = found.model_file();
  ASSERT_TRUE(file.standard_deviations.has_value());
  ASSERT_EQ(file.standard_deviations->size(), 14 * robot.num_joints());
  // A base parameter with a column of its own has its own spread; what is felt together with others has none.
  int alone = 0, grouped = 0;
  for (int i = 0; i < found.fit.base.count(); ++i) {
    const regression::Column& column = (*found.fit.columns)[found.fit.base.kept[static_cast<std::size_t>(i)]];
    if (column.kind != regression::ColumnKind::kLink) continue;
    const double deviation = (*file.standard_deviations)[10 * column.joint + column.entry];
    if ((found.fit.base.regrouping.row(i).array() != 0.0).count() == 1 &&
        found.fit.determined[static_cast<std::size_t>(i)]) {
      EXPECT_EQ(deviation, found.fit.std[i]) << column.name;
      ++alone;
    } else {
      EXPECT_TRUE(std::isnan(deviation)) << column.name;
      ++grouped;
    }
  }
  EXPECT_GT(alone, 0);
  EXPECT_GT(grouped, 0);
  EXPECT_TRUE(std::isnan((*file.standard_deviations)[kMass]));  // nothing feels the mass of link 1
  ASSERT_TRUE(file.fit.has_value());
  EXPECT_EQ(file.fit->rmse, found.trained.rmse);
  EXPECT_EQ(file.fit->torque_at, "motor");
  EXPECT_EQ(file.provenance.logs, found.log_paths);
}

TEST(Identify, LooksForNoRotorBehindTheGear) {
  const model::Robot robot = test::planar_two_link();
  const Identification found = identify(
      robot, data::log_set(joints_of(robot), {log_of(robot, 1)}, {log_of(robot, 2)}, data::TorqueAt::kJoint));
  EXPECT_FALSE(found.fit.columns->structure().rotor_inertia);
  EXPECT_EQ(found.record().torque_at, "joint");
}

// What a model was fitted to proves nothing about it, in C++ as on the command line.
TEST(Identify, ItsModelIsNotJudgedOnItsOwnLogs) {
  const test::TemporaryFolder folder;
  const model::Robot robot = test::planar_two_link();
  data::write_log(folder.path("train.csv"), log_of(robot, 1));
  data::LogFiles files;
  files.train = {folder.path("train.csv")};
  files.split = 0.0;
  const model::ModelFile file = identify(robot, data::open_logs(joints_of(robot), files)).model_file();
  const auto judge = [&](const data::Log& log) {
    return validate::validate(file, robot, data::log_set(joints_of(robot), {}, {log}));
  };
  EXPECT_TRUE(judge(log_of(robot, 2)).usable());
  EXPECT_THAT(message_of<DataError>([&] { (void)judge(log_of(robot, 1)); }),
              AllOf(HasSubstr("the same samples as"), HasSubstr("train.csv")));
}

// One meaning of "physically consistent": links and drives.
TEST(Identify, NegativeFrictionIsNotConsistent) {
  model::Robot robot = test::planar_two_link();
  EXPECT_TRUE(model::is_physically_consistent(robot));
  robot.joints[1].actuation.coulomb_friction = -0.1;
  EXPECT_TRUE(model::has_physical_links(robot));
  EXPECT_FALSE(model::is_physically_consistent(robot));
  const validate::Validation judged =
      validate::validate(robot, nullptr, {}, data::log_set(joints_of(robot), {}, {log_of(robot, 3)}));
  EXPECT_FALSE(judged.physically_consistent);
}

}  // namespace
}  // namespace heft::identify
