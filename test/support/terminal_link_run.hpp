/// @file
/// Kawasaki and Nishimura's experiment in small: exciting motion of its arm with payload, noisy accelerations.
#pragma once

#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/estimate/terminal_link_estimator.hpp"
#include "heft/core/friction/friction.hpp"
#include "heft/model/named_arms.hpp"

namespace heft::test {

using Arm6 = StaticArm<double, model::KawasakiArm>;
using Vector6 = JointVector<double, 6>;

/// One sample: what sensors give, and the true acceleration.
struct TerminalLinkSample {
  Vector6 q, qd, qdd, measured, tau;
};

/// @param count   samples at 5 ms
/// @param noise   standard deviation of the acceleration noise [rad/s²]
/// @param loaded  true: the arm carries their payload
inline std::vector<TerminalLinkSample> terminal_link_run(int count, double noise, int seed,
                                                         bool loaded = true, double start = 0.0) {
  std::mt19937_64 random(static_cast<std::uint64_t>(seed));
  std::normal_distribution<double> normal(0.0, 1.0);
  const auto& model = loaded ? model::KawasakiArmWithPayload::kModel : model::KawasakiArm::kModel;
  const DynamicArm<double, 6> arm(model);
  constexpr std::array<double, 6> kAcceleration = {3, 4, 5, 12, 9, 14};
  std::vector<TerminalLinkSample> run;
  for (int j = 0; j < count; ++j) {
    TerminalLinkSample s;
    const double t = start + 0.005 * j;
    for (int i = 0; i < 6; ++i) {
      s.q[i] = s.qd[i] = s.qdd[i] = 0;
      for (int k = 0; k < 6; ++k) {
        const double w = 2 * std::numbers::pi * (0.27 + 0.23 * k + 0.031 * i);
        const double a = kAcceleration[static_cast<std::size_t>(i)] / std::sqrt(3.0) / (w * w);
        const double angle = w * t + 1.7 * k + 0.9 * i * k + i;
        s.q[i] += a * std::sin(angle);
        s.qd[i] += a * w * std::cos(angle);
        s.qdd[i] -= a * w * w * std::sin(angle);
      }
      s.measured[i] = s.qdd[i] + noise * normal(random);
    }
    s.tau = inverse_dynamics(arm, s.q, s.qd, s.qdd);
    for (int i = 0; i < 6; ++i) {
      s.tau[i] += friction_torque(model.actuation[static_cast<std::size_t>(i)], s.qd[i], 0.0);
    }
    run.push_back(s);
  }
  return run;
}

/// Coulomb friction of the arm without payload.
inline Vector6 nominal_coulomb() {
  Vector6 f;
  for (int i = 0; i < 6; ++i) {
    f[i] = model::KawasakiArm::kModel.actuation[static_cast<std::size_t>(i)].coulomb_friction;
  }
  return f;
}

/// True layout parameters of the loaded arm for rows First..6.
template <int First>
auto true_layout_parameters(bool loaded = true) {
  using Layout = TerminalLayout<Arm6, First>;
  std::array<double, static_cast<std::size_t>(Layout::kParameters)> x{};
  const auto& model = loaded ? model::KawasakiArmWithPayload::kModel : model::KawasakiArm::kModel;
  const auto links = reduced_links(model);
  [&]<int... R>(std::integer_sequence<int, R...>) {
    (
        [&] {
          std::size_t column = static_cast<std::size_t>(Layout::inertial(R));
          for (std::size_t e = 0; e < 10; ++e) {
            if (structural::kReducedPattern<model::KawasakiArm, First + R>[e]) {
              x[column++] = links[First + R][e];
            }
          }
          x[static_cast<std::size_t>(Layout::friction(R))] = model.actuation[First + R].coulomb_friction;
          x[static_cast<std::size_t>(Layout::friction(R)) + 1] = model.actuation[First + R].viscous_friction;
        }(),
        ...);
  }
  (std::make_integer_sequence<int, Layout::kRows>{});
  return x;
}

}  // namespace heft::test
