/// @file
/// Logs of two joints with target torque and current, made in closed form: gravity, inertia, friction of every kind that
/// the estimate allows for, noise that is correlated in time.
#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "heft/data/log.hpp"
#include "heft/data/log_set.hpp"

namespace heft::test {

struct DriveSettings {
  double constant{10.0};       ///< of both joints [N·m/A]
  double duration{40.0};       ///< [s]
  double load_friction{0.16};  ///< share of the target torque
  double unknown_load{0.0};    ///< torque that the target lacks, as a share of it
  double noise{0.02};          ///< of the current [A]
  std::uint32_t seed{1};
  bool target_current{false};  ///< iref instead of i
  double rest{0.0};            ///< time at rest in the end [s]
};

/// Two joints; gravity loads both, both accelerate.
inline data::Log drive_log(const DriveSettings& settings) {
  constexpr double kRate = 100.0, kNoiseMemory = 0.9;  // of one sample to the next
  const auto rows = static_cast<Eigen::Index>((settings.duration + settings.rest) * kRate);
  std::mt19937 random(settings.seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> phase(0.0, 6.28);
  const double p1 = phase(random), p2 = phase(random);
  data::Log log;
  log.path = "drive-" + std::to_string(settings.seed) + ".csv";
  log.time = Eigen::VectorXd::LinSpaced(rows, 0.0, static_cast<double>(rows - 1) / kRate);
  log.q.resize(rows, 2);
  log.qd.resize(rows, 2);
  log.qdd.resize(rows, 2);
  Eigen::MatrixXd target(rows, 2), current(rows, 2);
  Eigen::Vector2d noise = Eigen::Vector2d::Zero();
  for (Eigen::Index k = 0; k < rows; ++k) {
    const bool rests = log.time[k] > settings.duration;
    const double t = std::min(log.time[k], settings.duration);
    for (Eigen::Index j = 0; j < 2; ++j) {
      const double w = j == 0 ? 0.7 : 0.9;
      const double q = 0.8 * std::sin(w * t + p1) + 0.3 * std::sin(2.3 * w * t + p2);
      double v = 0.8 * w * std::cos(w * t + p1) + 0.69 * w * std::cos(2.3 * w * t + p2);
      double a = -0.8 * w * w * std::sin(w * t + p1) - 1.587 * w * w * std::sin(2.3 * w * t + p2);
      if (rests) v = a = 0.0;
      log.q(k, j) = q, log.qd(k, j) = v, log.qdd(k, j) = a;
      target(k, j) = 40.0 * std::cos(q) + 5.0 * a;
      const double sign = rests ? 0.0 : std::tanh(v / 0.005);
      const double torque = target(k, j) * (1.0 + settings.unknown_load) +
                            settings.load_friction * std::abs(target(k, j)) * sign + 6.0 * sign + 8.0 * v;
      noise[j] = kNoiseMemory * noise[j] +
                 std::sqrt(1.0 - kNoiseMemory * kNoiseMemory) * settings.noise * normal(random);
      current(k, j) = torque / settings.constant + (settings.target_current ? 0.0 : noise[j]);
    }
  }
  for (Eigen::Index j = 0; j < 2; ++j) {
    log.extra.emplace_back("tauref" + std::to_string(j + 1), target.col(j));
    if (settings.target_current) log.extra.emplace_back("iref" + std::to_string(j + 1), current.col(j));
  }
  if (!settings.target_current) log.current = current;
  return log;
}

inline data::LogSet drive_logs(std::vector<data::Log> logs) {
  return data::log_set(std::vector<JointSpec>(2), std::move(logs), {});
}

}  // namespace heft::test
