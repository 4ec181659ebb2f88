// The facade: what a caller gets is what the command gives, refusals included.
#include "heft/identify/identify.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/error.hpp"
#include "heft/host/hash.hpp"
#include "heft/identify/sums.hpp"
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

data::Log log_of(const model::Robot& robot, unsigned seed) { return test::synthetic_log(robot, seed, 0.01, 12.0); }

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

// A program stamps what it receives, and waits now and then: velocities derived from these stamps jump, the arm's do not.
TEST(Identify, TakesSamplesForTakenWhenThePositionsShow) {
  const model::Robot robot = test::planar_two_link();
  const auto stamped_late = [](data::Log log, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(0.0, 1.0);
    const double period = log.time[1] - log.time[0];
    double last = -period;
    for (double& t : log.time) {
      const double late = uniform(random) < 0.01 ? 1.0 + 3.0 * uniform(random) : 0.3 * uniform(random);
      t = last = std::max(t + late * period, last + 0.02 * period);
    }
    log.qd.resize(0, 0);
    return log;
  };
  const auto error = [&](bool late) {
    const auto log = [&](unsigned seed) { return late ? stamped_late(log_of(robot, seed), seed) : log_of(robot, seed); };
    return identify(robot, data::log_set(joints_of(robot), {log(1)}, {log(2)})).held_out[0].rmse_in_band;
  };
  const Eigen::VectorXd even = error(false), late = error(true);
  EXPECT_LT((late.array() / even.array()).maxCoeff(), 1.1) << late.transpose() << " against " << even.transpose();
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

/// Sums of one log each, of short ones: as a fleet sends them.
std::vector<Sums> sums_of_logs(const model::Robot& robot, unsigned count) {
  std::vector<Sums> sums;
  for (unsigned seed = 1; seed <= count; ++seed) {
    test::SyntheticSettings settings;
    settings.duration = 3.0 + 0.1 * (seed % 7);
    settings.noise = 0.01;
    settings.motion_seed = settings.noise_seed = seed;
    sums.push_back(
        sums_of(robot, data::log_set(joints_of(robot), {test::synthetic_log(robot, settings)}, {})));
  }
  return sums;
}

Sums merged_at_random(std::vector<Sums> parts, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  while (parts.size() > 1) {
    std::shuffle(parts.begin(), parts.end(), random);
    const Sums last = std::move(parts.back());
    parts.pop_back();
    parts.back() = merged(std::move(parts.back()), last);
  }
  return std::move(parts.front());
}

TEST(Sums, GiveTheFitOfTheirLogs) {
  const model::Robot robot = test::planar_two_link();
  const data::LogSet logs = data::log_set(
      joints_of(robot), {log_of(robot, 1), log_of(robot, 2), log_of(robot, 3)}, {log_of(robot, 4)});
  const Identification whole = identify(robot, logs), summed = identify(robot, sums_of(robot, logs), logs);
  EXPECT_LT((summed.fit.beta - whole.fit.beta).cwiseAbs().maxCoeff(), 1e-10);
  EXPECT_EQ(summed.fit.blocks, whole.fit.blocks);
  EXPECT_LT((summed.fit.std - whole.fit.std).cwiseQuotient(whole.fit.std).cwiseAbs().maxCoeff(), 0.05);
  EXPECT_EQ(summed.fit.determined, whole.fit.determined);
  EXPECT_EQ(summed.fit.samples, whole.fit.samples);
  EXPECT_LT((summed.held_out[0].rmse - whole.held_out[0].rmse).norm(), 1e-9);
  EXPECT_EQ(summed.how, whole.how);
  EXPECT_TRUE(summed.train.empty());
  EXPECT_FALSE(summed.fit.bias.has_value());
  EXPECT_EQ(summed.model_file().provenance.logs.size(), 3U);
}

TEST(Sums, GiveTheSameParametersAndIntervalsWhateverTheSplit) {
  const model::Robot robot = test::planar_two_link();
  const std::vector<Sums> parts = sums_of_logs(robot, 120);  // more than there may be blocks
  const Fit first = fit(robot, merged_at_random(parts, 1));
  EXPECT_LE(first.blocks, 96);
  EXPECT_GE(first.blocks, 40);
  EXPECT_LT(first.block_length, 20.0);
  for (const std::uint64_t seed : {2U, 3U, 4U}) {
    const Fit again = fit(robot, merged_at_random(parts, seed));
    EXPECT_LT((again.beta - first.beta).cwiseQuotient(first.beta).cwiseAbs().maxCoeff(), 1e-10);
    EXPECT_LT((again.std - first.std).cwiseQuotient(first.std).cwiseAbs().maxCoeff(), 1e-8);
    EXPECT_EQ(again.blocks, first.blocks);
  }
}

TEST(Sums, ComeBackFromBytesAsTheyWere) {
  const model::Robot robot = test::planar_two_link();
  const Sums sums = merged_at_random(sums_of_logs(robot, 5), 1);
  const std::string bytes = to_bytes(sums);
  const Sums back = sums_from_bytes(bytes);
  EXPECT_EQ(to_bytes(back), bytes);
  EXPECT_EQ(fit(robot, back).beta, fit(robot, sums).beta);
  EXPECT_EQ(fit(robot, back).std, fit(robot, sums).std);
}

TEST(Sums, AreRefusedWhenTheyWereCutOrChangedOnTheWay) {
  const model::Robot robot = test::planar_two_link();
  const std::string bytes = to_bytes(merged_at_random(sums_of_logs(robot, 2), 1));
  std::mt19937_64 random(1);
  for (int round = 0; round < 200; ++round) {
    std::string damaged = bytes;
    if (round % 2 == 0) {
      damaged.resize(random() % bytes.size());
    } else {
      damaged[random() % bytes.size()] ^= static_cast<char>(1U << (random() % 8));
    }
    EXPECT_THAT(message_of<DataError>([&] { (void)sums_from_bytes(damaged, "arm.sums"); }),
                HasSubstr("arm.sums: found"));
  }
  // Lengths that promise more than there is, with a hash that fits: no memory is asked for.
  for (std::size_t at = 12; at + 8 < std::min<std::size_t>(bytes.size() - 8, 400); at += 4) {
    std::string damaged = bytes.substr(0, bytes.size() - 8);
    damaged.replace(at, 8, "\xff\xff\xff\xff\xff\xff\xff\x7f", 8);
    const std::uint64_t hash = host::hash_of(damaged);
    damaged.append(reinterpret_cast<const char*>(&hash), sizeof hash);
    try {
      (void)sums_from_bytes(damaged, "arm.sums");  // a name, a count of samples: nothing can tell
    } catch (const DataError& error) {
      EXPECT_THAT(error.what(), HasSubstr("arm.sums: found"));
    }
  }
}

TEST(Sums, OfAnotherRobotOrALogThatCountsTwiceAreRefused) {
  const model::Robot robot = test::planar_two_link();
  model::Robot longer = robot;
  longer.joints[1].joint.position[0] += 1e-6;
  const std::vector<Sums> parts = sums_of_logs(robot, 2);
  EXPECT_THAT(message_of<DataError>([&] { (void)fit(longer, parts[0]); }), HasSubstr("other joint frames"));
  EXPECT_THAT(message_of<DataError>([&] { (void)merged(parts[0], sums_of_logs(longer, 1)[0]); }),
              HasSubstr("expected one robot"));
  EXPECT_THAT(message_of<DataError>([&] { (void)merged(merged(parts[0], parts[1]), parts[1]); }),
              HasSubstr("is in both"));
  const data::LogSet same = data::log_set(joints_of(robot), {log_of(robot, 1)}, {}),
                     seen = data::log_set(joints_of(robot), {}, {log_of(robot, 1)});
  const Sums sums = sums_of(robot, same);
  EXPECT_THAT(message_of<DataError>([&] { (void)identify(robot, sums, seen); }), HasSubstr("has not seen"));
  FitOptions robust;
  robust.method = Method::kIrls;
  EXPECT_THAT(message_of<InputError>([&] { (void)fit(robot, sums, robust); }), HasSubstr("sums hold none"));
  // What the links weigh is what the fit finds out: sums of a robot with other masses are of the same robot.
  model::Robot heavier = robot;
  heavier.joints[0].link[kMass] *= 2.0;
  EXPECT_LT((fit(heavier, sums).beta - fit(robot, sums).beta).norm(), 1e-9);
}

}  // namespace
}  // namespace heft::identify
