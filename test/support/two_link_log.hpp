/// @file
/// A log of a planar arm with two joints on a motion in closed form.
#pragma once

#include <cmath>
#include <numbers>
#include <random>
#include <string>

#include <Eigen/Core>

#include "heft/data/log.hpp"
#include "heft/model/motion_torque.hpp"
#include "support/arms.hpp"

namespace heft::test {

/// planar_two_link() with friction.
inline model::Robot two_link_with_friction() {
  model::Robot robot = planar_two_link();
  robot.joints[0].actuation = {0.0, 2.0, 1.0, 0.0};
  robot.joints[1].actuation = {0.0, 1.0, 0.5, 0.0};
  return robot;
}

/// A log without noise and its exact rates.
struct TwoLinkLog {
  data::Log log;
  Eigen::MatrixXd qd, qdd;

  /// Torque of a model, to which a test adds what the model does not know.
  void add_torque(const model::Robot& robot) {
    log.tau = model::MotionTorque(robot).torque(log.time, log.q, qd, qdd, 1e-3, {});
  }
  void add_noise(unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0.0, 0.05);
    for (double& tau : log.tau.reshaped()) tau += noise(random);
  }
};

/// 24 s at 200 Hz: two sines a joint, other ones for another seed.
inline TwoLinkLog two_link_motion(const std::string& name, unsigned seed) {
  constexpr double kRate = 200.0, kSeconds = 24.0;
  const auto rows = static_cast<Eigen::Index>(kSeconds * kRate);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> phase(0.0, 6.28), part(0.7, 1.3);
  TwoLinkLog made;
  made.log.path = name + "-" + std::to_string(seed);
  made.log.time = Eigen::VectorXd::LinSpaced(rows, 0.0, static_cast<double>(rows - 1) / kRate);
  made.log.q.resize(rows, 2);
  made.qd.resize(rows, 2);
  made.qdd.resize(rows, 2);
  for (int j = 0; j < 2; ++j) {
    const double a = 0.5 * part(random), b = 0.2 * part(random), p = phase(random), r = phase(random);
    const double v = 2.0 * std::numbers::pi * 0.17 * part(random), w = 2.0 * std::numbers::pi * 0.53 * part(random);
    for (Eigen::Index k = 0; k < rows; ++k) {
      const double t = made.log.time[k];
      made.log.q(k, j) = a * std::sin(v * t + p) + b * std::sin(w * t + r);
      made.qd(k, j) = a * v * std::cos(v * t + p) + b * w * std::cos(w * t + r);
      made.qdd(k, j) = -a * v * v * std::sin(v * t + p) - b * w * w * std::sin(w * t + r);
    }
  }
  return made;
}

}  // namespace heft::test
