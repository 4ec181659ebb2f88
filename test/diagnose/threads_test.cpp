// A diagnosis is the same on any number of threads.
#include <cmath>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "heft/diagnose/diagnose.hpp"
#include "heft/host/parallel.hpp"
#include "heft/model/motion_torque.hpp"
#include "support/arms.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kWholeTurn = 6.283185307179586;

model::Robot declared_arm() {
  model::Robot robot = test::planar_two_link();
  robot.joints[0].actuation = {0.0, 6.0, 2.0, 0.0};
  robot.joints[1].actuation = {0.0, 3.0, 1.0, 0.0};
  return robot;
}

/// Friction with a memory in the first joint, ripple in the second, and an offset.
model::Robot lacking_arm() {
  model::Robot robot = declared_arm();
  robot.joints[1].actuation.friction_offset = 0.8;
  robot.effects = {{joint_effect_kind<Hysteresis>(), 0, {0.02, 0.2}},
                   {joint_effect_kind<Ripple>(), 1, {1.0, 12.0, 0.4}}};
  return robot;
}

data::Log recorded(const model::Robot& robot, unsigned seed) {
  constexpr double kSamplesASecond = 100.0;
  constexpr Index kSampleCount = 1200;
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> phase(0.0, kWholeTurn);
  std::normal_distribution<double> noise(0.0, 0.05);
  data::Log log;
  log.path = "log-" + std::to_string(seed);
  log.time = VectorXd::LinSpaced(kSampleCount, 0.0, static_cast<double>(kSampleCount - 1) / kSamplesASecond);
  log.q.setZero(kSampleCount, 2);
  MatrixXd qd = log.q, qdd = log.q;
  for (int j = 0; j < 2; ++j) {
    for (const double hz : {0.15, 0.4, 0.7}) {
      const double w = kWholeTurn * hz, a = 0.25 / hz, p = phase(random);
      log.q.col(j).array() += a * (w * log.time.array() + p).sin();
      qd.col(j).array() += a * w * (w * log.time.array() + p).cos();
      qdd.col(j).array() -= a * w * w * (w * log.time.array() + p).sin();
    }
  }
  log.tau = model::MotionTorque(robot).torque(log.time, log.q, qd, qdd, 1e-3);
  for (double& value : log.tau.reshaped()) value += noise(random);
  return log;
}

/// Numbers that a diagnosis holds, from every part of it.
std::vector<double> numbers_of(const Diagnosis& d) {
  std::vector<double> all{static_cast<double>(d.candidates), d.cutoff};
  const auto add = [&](const auto& values) { all.insert(all.end(), values.begin(), values.end()); };
  for (const Finding& f : d.findings) {
    add(std::vector{f.p_value, f.delta_bic, f.cross_validated, f.validate_before, f.validate_after});
    for (const auto& [name, value] : f.parameters) all.push_back(value);
    for (const Rival& rival : f.rivals) all.push_back(rival.delta_bic);
  }
  for (const Refusal& refusal : d.refusals) all.push_back(refusal.gain);
  for (const Ceiling& ceiling : d.ceilings) add(std::vector{ceiling.explained, ceiling.explainable});
  for (const auto& base : d.parameters.base_parameters) add(std::vector{base.value, base.std});
  add(d.validate_identified.rmse);
  for (const auto* traces : {&d.train, &d.validate}) {
    for (const Traces& t : *traces) {
      add(t.before.reshaped());
      add(t.after.reshaped());
    }
  }
  return all;
}

class Threads : public testing::Test {
 protected:
  ~Threads() override { host::set_threads(0); }
};

TEST_F(Threads, OfAnyNumberGiveTheSameDiagnosisToTheLastBit) {
  const model::Robot robot = lacking_arm();
  const std::vector<data::Log> train{recorded(robot, 1), recorded(robot, 2)}, judged{recorded(robot, 3)};
  std::vector<double> first;
  for (const std::size_t threads : {1U, 2U, 3U, 8U}) {
    host::set_threads(threads);
    const Diagnosis d = diagnose(declared_arm(), train, judged);
    EXPECT_GE(d.findings.size(), 2U);
    const std::vector<double> numbers = numbers_of(d);
    if (first.empty()) first = numbers;
    ASSERT_EQ(numbers.size(), first.size()) << threads;
    EXPECT_GT(numbers.size(), 4000U);
    // By their bits: what was not judged is no number.
    EXPECT_EQ(std::memcmp(numbers.data(), first.data(), sizeof(double) * first.size()), 0) << threads;
  }
}

}  // namespace
}  // namespace heft::diagnose
