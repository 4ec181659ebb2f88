/// @file
/// Logs of an arm on smooth random motions, made by model::Dynamics, with noise that is correlated in time.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <numbers>
#include <random>

#include <Eigen/Core>

#include "heft/data/log.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/model/robot.hpp"

namespace heft::test {

struct SyntheticSettings {
  double duration{30.0};
  double sample_rate{100.0};
  double jitter{0.0};       ///< of the time stamps, share of a period
  double amplitude{0.5};    ///< of each of five harmonics, falling with their number [rad, m]
  double fundamental{0.1};  ///< [Hz]
  double noise{0.0};        ///< standard deviation, share of the largest torque of each joint
  double correlation{0.1};  ///< time constant of the noise [s]
  std::uint32_t motion_seed{1};
  std::uint32_t noise_seed{1};
  bool with_velocity{true};
  /// Robot that makes the torque at a time; empty: the one given.
  std::function<const model::Robot&(double)> robot_at{};
};

inline data::Log synthetic_log(const model::Robot& robot, const SyntheticSettings& settings) {
  constexpr int kHarmonics = 5;
  const int n = robot.num_joints();
  const int m = static_cast<int>(settings.duration * settings.sample_rate) + 1;
  std::mt19937 motion(settings.motion_seed);
  std::mt19937 noise(settings.noise_seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  std::normal_distribution<double> normal;
  Eigen::MatrixXd amplitude(n, kHarmonics), phase(n, kHarmonics);
  for (int i = 0; i < n; ++i) {
    for (int h = 0; h < kHarmonics; ++h) {
      amplitude(i, h) = settings.amplitude * (0.6 + 0.4 * uniform(motion)) / std::sqrt(1.0 + h);
      phase(i, h) = std::numbers::pi * uniform(motion);
    }
  }
  data::Log log;
  log.path = "synthetic.csv";
  log.time.resize(m);
  log.q.resize(m, n);
  log.qd.resize(m, n);
  log.tau.resize(m, n);
  const model::Dynamics own(robot);
  std::unique_ptr<model::Dynamics> other;
  const model::Robot* made_for = nullptr;
  Eigen::VectorXd q(n), qd(n), qdd(n);
  for (int k = 0; k < m; ++k) {
    const double t = (k + settings.jitter * uniform(motion)) / settings.sample_rate;
    for (int i = 0; i < n; ++i) {
      q[i] = qd[i] = qdd[i] = 0.0;
      for (int h = 0; h < kHarmonics; ++h) {
        const double w = 2.0 * std::numbers::pi * settings.fundamental * (h + 1);
        q[i] += amplitude(i, h) * std::sin(w * t + phase(i, h));
        qd[i] += amplitude(i, h) * w * std::cos(w * t + phase(i, h));
        qdd[i] -= amplitude(i, h) * w * w * std::sin(w * t + phase(i, h));
      }
    }
    const model::Dynamics* dynamics = &own;
    if (settings.robot_at) {
      const model::Robot& now = settings.robot_at(t);
      if (&now != made_for) other = std::make_unique<model::Dynamics>(now);
      made_for = &now;
      dynamics = other.get();
    }
    log.time[k] = t;
    log.q.row(k) = q;
    log.qd.row(k) = qd;
    log.tau.row(k) = dynamics->joint_torque(q, qd, qdd);
  }
  if (settings.noise > 0) {
    const Eigen::RowVectorXd scale = settings.noise * log.tau.cwiseAbs().colwise().maxCoeff();
    const double keep = std::exp(-1.0 / (settings.sample_rate * settings.correlation));
    Eigen::RowVectorXd e(n);
    for (int i = 0; i < n; ++i) e[i] = normal(noise);
    for (int k = 0; k < m; ++k) {
      log.tau.row(k) += scale.cwiseProduct(e);
      for (int i = 0; i < n; ++i) e[i] = keep * e[i] + std::sqrt(1.0 - keep * keep) * normal(noise);
    }
  }
  if (!settings.with_velocity) log.qd.resize(0, 0);
  return log;
}

/// One with motion and noise of a seed.
/// @param noise     share of the largest torque of each joint
/// @param duration  [s]
inline data::Log synthetic_log(const model::Robot& robot, unsigned seed, double noise, double duration = 30.0) {
  SyntheticSettings settings;
  settings.duration = duration;
  settings.noise = noise;
  settings.motion_seed = settings.noise_seed = seed;
  return synthetic_log(robot, settings);
}

/// The robot with a body at its last link.
inline model::Robot carrying(model::Robot robot, const InertialParameters<double>& load) {
  for (std::size_t i = 0; i < 10; ++i) robot.joints.back().link[i] += load[i];
  return robot;
}

}  // namespace heft::test
