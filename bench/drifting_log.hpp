/// @file
/// A simulated arm that warms up: friction falls by 30 % while it moves, the torque has a burst of outliers and a gap. What
/// estimators that run while the arm moves are compared on.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <random>

#include "heft/core/arm_model.hpp"
#include "heft/core/denavit_hartenberg.hpp"
#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/friction/friction.hpp"
#include "heft/host/numbers.hpp"
#include "heft/model/named_arms.hpp"

namespace heft::bench {

/// One sample as a controller gets it, and the truth.
struct DriftingSample {
  double time{0.0};            ///< [s]
  JointVector<double, 6> q;    ///< encoders of 17 bits [rad]
  JointVector<double, 6> qd;   ///< of the drive, with noise [rad/s]
  JointVector<double, 6> tau;  ///< since the sample before [N·m]; NaN in the gap
  double friction{1.0};        ///< Coulomb and viscous friction of every joint, in parts of the cold arm's
};

/// A UR5 on a smooth motion with a tool on its last link.
class DriftingLog {
 public:
  struct Config {
    double rate{500.0};  ///< [Hz]
    double noise{0.01};  ///< of the torque, in parts of the joint's largest; half of it correlated over 20 ms
    double drift{0.3};   ///< share of friction that is lost on warming up
    double warming{20.0};  ///< time constant of that [s]
    double burst{30.0};    ///< begin of 0.3 s in which three of ten torques are off by up to 150 N·m [s]
    double gap{40.0};      ///< begin of 0.5 s in which the torques are NaN [s]
    double rest_begin{kInfinity};  ///< of a stretch in which the three joints of the wrist stand still [s]
    double rest_end{kInfinity};    ///< [s]
    double tool{0.5};              ///< mass at the flange [kg]
    int seed{1};
  };

  explicit DriftingLog(const Config& config)
      : config_(config), random_(config.seed), arm_(with_tool(config.tool)) {}

  /// What the estimators are given: the arm without tool, friction cold, rotors as known.
  static ArmModel<double, 6> model() {
    ArmModel<double, 6> arm = model::Ur5Arm::kModel;
    for (std::size_t j = 0; j < 6; ++j) arm.actuation[j].rotor_inertia = j < 3 ? 0.7 : 0.12;
    return arm;
  }
  static ArmModel<double, 6> with_tool(double mass) {
    ArmModel<double, 6> arm = model();
    const double i = mass * 0.002;  // a cube of 11 cm
    const auto body = make_inertial_parameters<double>(mass, {0.02, -0.01, 0.06}, {i, 0, i, 0, 0, i});
    for (std::size_t p = 0; p < 10; ++p) arm.links[5][p] += body[p];
    return arm;
  }

  /// Standard deviation of the noise of a joint's torque [N·m].
  double noise(int joint) const { return config_.noise * kLargest[static_cast<std::size_t>(joint)]; }

  DriftingSample next() {
    const double period = 1.0 / config_.rate;
    DriftingSample s;
    s.time = time_ + period;
    s.friction = 1.0 - config_.drift * (1.0 - std::exp(-s.time / config_.warming));
    // The torque reported with a sample acted since the one before.
    const State middle = motion(time_ + 0.5 * period, 0.5 * period), now = motion(s.time, period);
    time_ = s.time;
    phase_ = now.phase;
    s.tau = inverse_dynamics(arm_, middle.q, middle.qd, middle.qdd);
    const double keep = std::exp(-period / 0.02);
    const bool burst = time_ >= config_.burst && time_ < config_.burst + 0.3;
    const bool gap = time_ >= config_.gap && time_ < config_.gap + 0.5;
    constexpr double kStep = 2 * std::numbers::pi / 131072;
    for (int i = 0; i < 6; ++i) {
      coloured_[i] = keep * coloured_[i] + std::sqrt(1.0 - keep * keep) * normal_(random_);
      s.tau[i] += drive(i, middle, s.friction) +
                  noise(i) * std::numbers::sqrt2 / 2.0 * (coloured_[i] + normal_(random_));
      if (burst && uniform_(random_) < 0.3) s.tau[i] += 150.0 * (2.0 * uniform_(random_) - 1.0);
      if (gap) s.tau[i] = kNaN;
      s.q[i] = kStep * std::round(now.q[i] / kStep);
      s.qd[i] = now.qd[i] + 1e-3 * normal_(random_);
    }
    return s;
  }

 private:
  struct State {
    JointVector<double, 6> q, qd, qdd;
    double phase{0.0};  ///< of the wrist's motion [s]
  };
  /// Largest torques of the motion, roughly [N·m].
  static constexpr std::array<double, 6> kLargest{20, 80, 40, 8, 5, 4};
  static constexpr double kStopping = 0.5;  ///< time in which the wrist stops, and starts again [s]

  /// Rotor and friction; at rest this takes up a part of the load.
  double drive(int i, const State& s, double share) const {
    JointActuation<double> joint = arm_.model().actuation[static_cast<std::size_t>(i)];
    joint.coulomb_friction *= share;
    joint.viscous_friction *= share;
    return joint.rotor_inertia * s.qdd[i] +
           (s.qd[i] == 0.0 ? 0.4 * joint.coulomb_friction : friction_torque(joint, s.qd[i], 0.0));
  }

  /// How fast the wrist's motion goes on, 0 to 1, and how that changes [1/s].
  std::array<double, 2> pace(double t) const {
    const auto falling = [](double since) -> std::array<double, 2> {
      const double x = std::clamp(since / kStopping, 0.0, 1.0), w = std::numbers::pi;
      return {0.5 + 0.5 * std::cos(w * x), x > 0.0 && x < 1.0 ? -0.5 * w / kStopping * std::sin(w * x) : 0.0};
    };
    const auto down = falling(t - config_.rest_begin), up = falling(t - config_.rest_end);
    return t < config_.rest_end ? down : std::array<double, 2>{1.0 - up[0], -up[1]};
  }

  /// @param ahead  of the last sample [s]
  State motion(double t, double ahead) const {
    const auto [rate, change] = pace(t);
    State s;
    s.phase = phase_ + 0.5 * ahead * (pace(t - ahead)[0] + rate);
    for (int i = 0; i < 6; ++i) {
      const double w = 2 * std::numbers::pi * (0.21 + 0.07 * i), a = i < 3 ? 0.45 : 0.7;
      const double x = w * (i < 3 ? t : s.phase), v = i < 3 ? 1.0 : rate, dv = i < 3 ? 0.0 : change;
      const double slope = a * w * (std::cos(x + i) + 0.51 * std::cos(1.7 * x));
      s.q[i] = 0.3 * i - 0.7 + a * std::sin(x + i) + 0.3 * a * std::sin(1.7 * x);
      s.qd[i] = slope * v;
      s.qdd[i] = -a * w * w * (std::sin(x + i) + 0.867 * std::sin(1.7 * x)) * v * v + slope * dv;
    }
    return s;
  }

  Config config_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_{0.0, 1.0};
  std::uniform_real_distribution<double> uniform_{0.0, 1.0};
  DynamicArm<double, 6> arm_;
  JointVector<double, 6> coloured_ = JointVector<double, 6>::Zero();
  double time_{0.0}, phase_{0.0};
};

}  // namespace heft::bench
