/// @file
/// Logs made in closed form: sums of sines in every joint with exact derivatives, torque of the run-time dynamics.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

#include "heft/data/log.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/model/robot.hpp"

namespace heft::test {

struct FourierLogSettings {
  double duration{40.0};  ///< [s]
  double rate{100.0};     ///< [Hz]
  std::uint64_t seed{1};
  double amplitude{0.8};  ///< of the first harmonic, at most [rad, m]
  int harmonics{5};
  double base_frequency{0.1};  ///< [Hz]
};

/// Torque of a log's motion by the robot's own parameters.
inline void put_torque(data::Log& log, const model::Robot& robot) {
  const model::Dynamics dynamics(robot);
  log.tau.resize(log.q.rows(), log.q.cols());
  for (Eigen::Index i = 0; i < log.time.size(); ++i) {
    log.tau.row(i) =
        dynamics.joint_torque(log.q.row(i).transpose(), log.qd.row(i).transpose(), log.qdd.row(i).transpose())
            .transpose();
  }
}

inline data::Log fourier_log(const model::Robot& robot, const FourierLogSettings& settings) {
  std::mt19937_64 random(settings.seed);
  std::uniform_real_distribution<double> phase(0.0, 2.0 * std::numbers::pi), size(0.4, 1.0);
  const Eigen::Index n = robot.num_joints();
  const auto samples = static_cast<Eigen::Index>(settings.duration * settings.rate);
  data::Log log;
  log.path = "synthetic.csv";
  log.time = Eigen::VectorXd::LinSpaced(samples, 0.0, static_cast<double>(samples - 1) / settings.rate);
  log.q = log.qd = log.qdd = Eigen::MatrixXd::Zero(samples, n);
  for (Eigen::Index j = 0; j < n; ++j) {
    for (int k = 1; k <= settings.harmonics; ++k) {
      const double a = settings.amplitude * size(random) / static_cast<double>(k), p = phase(random);
      const double w = 2.0 * std::numbers::pi * settings.base_frequency *
                       (static_cast<double>(k) + 0.1 * static_cast<double>(j));
      log.q.col(j).array() += a * (w * log.time.array() + p).sin();
      log.qd.col(j).array() += a * w * (w * log.time.array() + p).cos();
      log.qdd.col(j).array() -= a * w * w * (w * log.time.array() + p).sin();
    }
  }
  put_torque(log, robot);
  return log;
}

}  // namespace heft::test
