/// @file
/// What the observers and controllers of core are run against: a UR5 that carries a load along a motion, and Kawasaki and
/// Nishimura's arm under a controller's torque.
#pragma once

#include <array>
#include <cmath>
#include <numbers>
#include <random>

#include "heft/core/denavit_hartenberg.hpp"
#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/dynamics/joint_space.hpp"
#include "heft/core/friction/friction.hpp"
#include "heft/model/named_arms.hpp"

namespace heft::test {

using Vec6 = JointVector<double, 6>;

/// An arm with a body more on its last link.
inline ArmModel<double, 6> carrying(ArmModel<double, 6> arm, double mass, std::array<double, 3> com) {
  const double i = mass * 0.002;  // a cube of 11 cm
  const auto body = make_inertial_parameters<double>(mass, com, {i, 0, i, 0, 0, i});
  for (std::size_t p = 0; p < 10; ++p) arm.links[5][p] += body[p];
  return arm;
}

/// One sample of what an arm's sensors give.
struct OnlineSample {
  Vec6 q, qd, tau;
  double dt{1e-3};
};

/// A UR5 that follows a smooth motion exactly; encoders of 17 bits, torque with 1 % noise and sharp friction.
class MovingUr5 {
 public:
  explicit MovingUr5(int seed = 1, double period = 1e-3) : random_(seed), period_(period) {}

  double time() const { return time_; }
  void carry(double mass) { arm_.set_model(carrying(model::Ur5Arm::kModel, mass, kCom)); }
  /// false: stands still from now on, held by its motors and, in part, by friction.
  void move(bool moves) { moves_ = moves; }

  OnlineSample next() {
    time_ += period_;
    if (moves_) phase_ += period_;
    OnlineSample s;
    s.dt = period_;
    Vec6 q, qd, qdd;
    for (int i = 0; i < 6; ++i) {
      const double w = 2 * std::numbers::pi * (0.21 + 0.07 * i), a = i < 3 ? 0.45 : 0.7;
      q[i] = 0.3 * i - 0.7 + a * std::sin(w * phase_ + i) + 0.3 * a * std::sin(1.7 * w * phase_);
      qd[i] = moves_ ? a * w * std::cos(w * phase_ + i) + 0.51 * a * w * std::cos(1.7 * w * phase_) : 0.0;
      qdd[i] = moves_ ? -a * w * w * (std::sin(w * phase_ + i) + 0.867 * std::sin(1.7 * w * phase_)) : 0.0;
    }
    s.tau = inverse_dynamics(arm_, q, qd, qdd);
    constexpr double kStep = 2 * std::numbers::pi / 131072;
    for (int i = 0; i < 6; ++i) {
      const auto& joint = model::Ur5Arm::kModel.actuation[static_cast<std::size_t>(i)];
      // At rest friction takes up a part of the load.
      s.tau[i] += (moves_ ? friction_torque(joint, qd[i], 0.0) : 0.4 * joint.coulomb_friction) +
                  0.2 * normal_(random_);
      s.q[i] = kStep * std::round(q[i] / kStep);
      s.qd[i] = qd[i] + 1e-3 * normal_(random_);
    }
    return s;
  }

  static constexpr std::array<double, 3> kCom{0.02, -0.03, 0.06};

 private:
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_{0.0, 1.0};
  DynamicArm<double, 6> arm_{model::Ur5Arm::kModel};
  double time_{0}, phase_{0}, period_;
  bool moves_{true};
};

/// Kawasaki and Nishimura's arm under torque: rigid bodies, rotors, smooth friction; integrated in steps of 0.25 ms.
class DrivenArm {
 public:
  DrivenArm() { rotor << 0.02, 0.02, 0.02, 0.005, 0.003, 0.002; }

  void carry(double mass) { arm_.set_model(carrying(model::KawasakiArm::kModel, mass, {0.03, 0.03, 0.03})); }

  void step(const Vec6& tau, double dt) {
    constexpr int kSteps = 4;
    const double h = dt / kSteps;
    for (int n = 0; n < kSteps; ++n) {
      const auto trig = joint_trigonometry<DynamicArm<double, 6>>(q);
      MassMatrix<double, 6> mass;
      mass_matrix(arm_, trig, q, mass);
      Vec6 bias, qdd;
      bias_torque(arm_, trig, q, qd, bias);
      for (int i = 0; i < 6; ++i) {
        bias[i] += friction_torque(arm_.model().actuation[static_cast<std::size_t>(i)], qd[i], 0.02);
      }
      if (forward_dynamics<double, 6>(mass, bias, rotor, tau, qdd) != Status::kOk) return;
      qd += h * qdd;
      q += h * qd;
    }
  }

  /// As an encoder of 17 bits has it.
  Vec6 encoders() const {
    constexpr double kStep = 2 * std::numbers::pi / 131072;
    return (q / kStep).array().round() * kStep;
  }

  Vec6 q = Vec6::Zero(), qd = Vec6::Zero(), rotor;

 private:
  DynamicArm<double, 6> arm_{model::KawasakiArm::kModel};
};

}  // namespace heft::test
