#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "heft/drive/torque_constants.hpp"
#include "heft/host/error.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/synthetic_log.hpp"
#include "support/temporary_folder.hpp"

namespace heft::drive {
namespace {

constexpr double kAssumed = 10.0;
const std::vector<double> kTrue{10.3, 9.7, 9.8, 10.5, 9.6, 10.2};

/// What a drive shows as torque when its constants are taken for kAssumed.
data::Log as_assumed(data::Log log) {
  for (Eigen::Index j = 0; j < log.tau.cols(); ++j)
    log.tau.col(j) *= kAssumed / kTrue[static_cast<std::size_t>(j)];
  return log;
}

/// A UR5 whose model is right in the units of the assumed constants is not a body; the torque of every joint is scaled
/// instead: what the load adds is scaled, the rest of the arm is as the model says.
data::Log carrying_log(const model::Robot& robot, const InertialParameters<double>& load, double noise) {
  const test::SyntheticSettings settings{.duration = 40.0, .amplitude = 0.7};
  const data::Log without = test::synthetic_log(robot, settings);
  data::Log with = test::synthetic_log(test::carrying(robot, load), settings);
  data::Log scaled = with;
  scaled.tau = with.tau - without.tau;
  scaled = as_assumed(scaled);
  with.tau = without.tau + scaled.tau;
  test::SyntheticSettings noisy = settings;
  noisy.noise = noise;
  with.tau += test::synthetic_log(robot, noisy).tau - without.tau;
  return with;
}

/// 2 kg at (0.03, -0.02, 0.08) m of the last link, a small inertia of its own.
const InertialParameters<double> kLoad{2.0,    0.06,   -0.04,   0.16,   0.0165,
                                       0.0012, 0.0165, -0.0048, 0.0032, 0.0046};

class KnownLoad : public ::testing::Test {
 protected:
  KnownLoad() : robot_(urdf::load_urdf(urdf::resolve_robot("ur5"))) {
    // The tip's frame is the last link's, so that the centre is given in one place.
    robot_.tip_rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    robot_.tip_position = {0, 0, 0};
  }
  data::LogSet logs(double noise) const {
    return data::log_set(robot_.joint_specs(), {carrying_log(robot_, kLoad, noise)}, {});
  }
  model::Robot robot_;
};

TEST_F(KnownLoad, GivesTheConstantsOfTheJointsThatCarryIt) {
  const TorqueConstants found =
      from_known_load(robot_, logs(0.002), {2.0, std::array<double, 3>{0.03, -0.02, 0.08}}, {kAssumed});
  int known = 0;
  for (std::size_t j = 0; j < 6; ++j) {
    const JointConstant& joint = found.joints[j];
    if (!joint.known()) continue;
    ++known;
    EXPECT_EQ(joint.from, From::kLoad);
    EXPECT_NEAR(joint.constant.value, kTrue[j], 0.02 * kTrue[j]) << "joint " << j + 1;
    // Half a percent more: the estimate does not know the load's inertia about its own centre, a sixteenth of the whole.
    EXPECT_LT(joint.constant.lower, 1.005 * kTrue[j]);
    EXPECT_GT(joint.constant.upper, 0.995 * kTrue[j]);
  }
  EXPECT_GE(known, 3);
}

TEST_F(KnownLoad, NeedsItsMassOnly) {
  const TorqueConstants found = from_known_load(robot_, logs(0.002), {2.0, {}}, {kAssumed});
  for (std::size_t j = 1; j < 3; ++j) {
    ASSERT_TRUE(found.joints[j].known()) << found.joints[j].missing;
    EXPECT_NEAR(found.joints[j].constant.value, kTrue[j], 0.02 * kTrue[j]) << "joint " << j + 1;
  }
}

TEST_F(KnownLoad, IsNotLookedForInALogThatTheModelWasFittedTo) {
  const test::TemporaryFolder folder;
  const std::string path = folder.path("carrying.csv");
  data::write_log(path, carrying_log(robot_, kLoad, 0.0));
  data::LogFiles files;
  files.judge = {path};
  const data::LogSet judged = data::open_logs(robot_.joint_specs(), files);
  EXPECT_THROW(from_known_load(robot_, judged, {2.0, {}}, {kAssumed}, {path}), DataError);
  const TorqueConstants found =
      from_known_load(robot_, judged, {2.0, {}}, {kAssumed}, {folder.path("gone.csv")});
  ASSERT_FALSE(found.notes.empty());
  EXPECT_NE(found.notes.front().find("cannot be read"), std::string::npos) << found.notes.front();
}

TEST_F(KnownLoad, WithoutMassIsRefused) {
  EXPECT_THROW(from_known_load(robot_, logs(0.0), {0.0, {}}, {kAssumed}), InputError);
  EXPECT_THROW(from_known_load(robot_, logs(0.0), {2.0, {}}, {1.0, 2.0}), InputError);
}

}  // namespace
}  // namespace heft::drive
