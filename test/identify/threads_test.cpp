// The same fit on any number of threads, to the last bit, and in as little memory.
#include <string>

#include <gtest/gtest.h>

#include "heft/data/log_set.hpp"
#include "heft/host/parallel.hpp"
#include "heft/identify/identify.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/fourier_log.hpp"
#include "support/temporary_folder.hpp"

namespace heft::identify {
namespace {

model::Robot arm() {
  model::Robot robot = urdf::load_urdf(std::string(HEFT_URDF_DIR) + "/scara.urdf");
  for (model::RobotJoint& joint : robot.joints) joint.actuation = {0.5, 2.0, 1.0, 0.3};
  return robot;
}

/// Noise in position and torque that does not depend on the library's distributions.
double noise(Eigen::Index k) { return static_cast<double>((k * 7919 + 13) % 2003) / 1001.5 - 1.0; }

data::Log noisy_log(const model::Robot& robot, std::uint64_t seed, double duration) {
  data::Log log = test::fourier_log(robot, {.duration = duration, .rate = 250.0, .seed = seed});
  for (Eigen::Index j = 0; j < log.q.cols(); ++j) {
    for (Eigen::Index k = 0; k < log.q.rows(); ++k) {
      log.q(k, j) += 2e-5 * noise(3 * k + j);
      log.tau(k, j) += 0.2 * noise(5 * k + 7 * j + 1);
    }
  }
  log.qd.resize(0, 0);
  log.qdd.resize(0, 0);
  return log;
}

/// From files of several pieces.
Identification found_on(std::size_t threads, const model::Robot& robot, const std::string& train,
                        const std::string& judge, Method method) {
  host::set_threads(threads);
  data::LogFiles files;
  files.train = {train};
  files.judge = {judge};
  const data::LogSet logs = data::open_logs(robot.joint_specs(), files);
  Options options;
  options.fit.method = method;
  const Identification found = identify(robot, logs, options);
  host::set_threads(0);
  return found;
}

TEST(Threads, DoNotChangeASingleBitOfAFit) {
  const model::Robot robot = arm();
  const test::TemporaryFolder folder;
  const std::string train = folder.write("train.csv", data::to_csv(noisy_log(robot, 3, 150.0)));
  const std::string judge = folder.write("judge.csv", data::to_csv(noisy_log(robot, 4, 20.0)));
  for (const Method method : {Method::kWls, Method::kIv}) {
    const Identification one = found_on(1, robot, train, judge, method);
    ASSERT_GT(one.fit.beta.size(), 10);
    ASSERT_TRUE(one.fit.bias.has_value());
    for (const std::size_t threads : {2, 3, 8}) {
      SCOPED_TRACE(threads);
      const Identification other = found_on(threads, robot, train, judge, method);
      EXPECT_EQ(one.fit.beta, other.fit.beta);
      EXPECT_EQ(one.fit.half_width, other.fit.half_width);
      EXPECT_EQ(one.fit.covariance, other.fit.covariance);
      EXPECT_EQ(one.fit.noise_std, other.fit.noise_std);
      EXPECT_EQ(one.fit.bias->statistic, other.fit.bias->statistic);
      EXPECT_EQ(one.train_logs.front().top_speed, other.train_logs.front().top_speed);
      EXPECT_EQ(one.train_logs.front().bandwidth, other.train_logs.front().bandwidth);
      EXPECT_EQ(one.held_out.front().rmse, other.held_out.front().rmse);
      EXPECT_EQ(one.notes, other.notes);
    }
  }
}

}  // namespace
}  // namespace heft::identify
