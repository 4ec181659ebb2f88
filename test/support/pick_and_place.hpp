/// @file
/// A UR5 at ordinary work: it picks, carries and places, point to point, with pauses. What its sensors say of that, in closed
/// form: rigid bodies with the load, friction that creeps before it slides, noise, and velocities that come from encoders.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <random>

#include "support/online_rig.hpp"

namespace heft::test {

struct PickAndPlaceSettings {
  std::uint64_t seed{1};
  double period{2e-3};  ///< [s]
  double noise{0.01};   ///< standard deviation of a torque reading, as a share of what the joint can do [1]
  double correlated{0.0};    ///< share of the noise's power that is correlated in time [1]
  double memory{0.05};       ///< time constant of that share [s]
  double tilt{0.6};          ///< how far the tool turns away from pointing down where it places [rad]
  double pause{0.4};         ///< at each end [s]
  double friction_error{0};  ///< true Coulomb friction above that of the model, as a share of it [1]
};

class PickAndPlaceUr5 {
 public:
  explicit PickAndPlaceUr5(const PickAndPlaceSettings& settings = {}) : s_(settings), random_(settings.seed) {
    from_ = to_ = pose(false);
    friction_.setZero();
    plan();
  }

  double time() const { return time_; }
  /// Whether the arm moves, and since when it has [s].
  bool moves() const { return moves_; }
  double moves_since() const { return moves_since_; }
  /// In the middle of a pause: the gripper opens or closes.
  bool grips() const {
    return !moves_ && pause_left_ < 0.5 * s_.pause && pause_left_ + s_.period >= 0.5 * s_.pause;
  }
  void carry(double mass, const std::array<double, 3>& com) {
    arm_.set_model(carrying(model::Ur5Arm::kModel, mass, com));
  }

  OnlineSample next() {
    Vec6 q, qd, qdd;
    move(q, qd, qdd);
    OnlineSample out;
    out.dt = s_.period;
    out.tau = inverse_dynamics(arm_, q, qd, qdd);
    constexpr double kStep = 2 * std::numbers::pi / 131072;
    const double forget = std::exp(-s_.period / s_.memory),
                 smooth = 1.0 - std::exp(-s_.period * kVelocityPole);
    for (int i = 0; i < 6; ++i) {
      const std::size_t at = static_cast<std::size_t>(i);
      const auto& joint = model::Ur5Arm::kModel.actuation[at];
      // Dahl's friction: it turns over along a way, and stays what it was when the joint stops.
      const double way = started_ ? q[i] - last_q_[i] : 0.0, side = way > 0 ? 1.0 : -1.0;
      friction_[i] = side + (friction_[i] - side) * std::exp(-std::abs(way) / kCreep);
      slow_[i] = forget * slow_[i] + std::sqrt(1 - forget * forget) * normal_(random_);
      out.tau[i] +=
          (1 + s_.friction_error) * joint.coulomb_friction * friction_[i] + joint.viscous_friction * qd[i] +
          s_.noise * kRated[at] *
              (std::sqrt(1 - s_.correlated) * normal_(random_) + std::sqrt(s_.correlated) * slow_[i]);
      out.q[i] = kStep * std::round(q[i] / kStep);
      if (started_) velocity_[i] += smooth * ((out.q[i] - last_encoder_[i]) / s_.period - velocity_[i]);
    }
    out.qd = velocity_;
    last_q_ = q;
    last_encoder_ = out.q;
    started_ = true;
    return out;
  }

  /// Largest torques of a UR5's joints [N·m].
  static constexpr std::array<double, 6> kRated{150, 150, 150, 28, 28, 28};

 private:
  static constexpr double kCreep = 3e-3;                              ///< [rad]
  static constexpr double kVelocityPole = 2 * std::numbers::pi * 20;  ///< of the velocities' low-pass [1/s]
  static constexpr double kFastest = 1.6;                             ///< [rad/s]

  double between(double low, double high) { return low + (high - low) * uniform_(random_); }

  /// Where the tool points down (`above`: a hand's breadth higher), turned away by up to `tilt`.
  Vec6 pose(bool above, double tilt = 0.0) {
    Vec6 q;
    q[0] = between(-1.2, 1.2);
    q[1] = between(-1.5, -0.9);
    q[2] = between(1.1, 1.9);
    q[3] = -std::numbers::pi / 2 - q[1] - q[2] + between(-tilt, tilt);
    q[4] = -std::numbers::pi / 2 + between(-tilt, tilt);
    q[5] = between(-1.5, 1.5);
    return above ? raised(q) : q;
  }
  static Vec6 raised(Vec6 q) {
    q[1] -= 0.15;
    q[2] -= 0.05;
    q[3] += 0.2;
    return q;
  }

  /// The next stretch: down, pause, up, across.
  void plan() {
    from_ = to_;
    switch (stage_++ % 4) {
      case 0:  // across, to above the next end
        end_ = pose(false, places_ ? s_.tilt : 0.0);
        places_ = !places_;
        to_ = raised(end_);
        break;
      case 1: to_ = end_; break;
      case 2: pause_left_ = s_.pause; break;
      default: to_ = raised(end_); break;
    }
    // A polynomial of degree five is at its fastest at 1.875 of its mean speed.
    duration_ = std::max(0.35, 1.875 * (to_ - from_).cwiseAbs().maxCoeff() / kFastest);
    elapsed_ = 0.0;
  }

  void move(Vec6& q, Vec6& qd, Vec6& qdd) {
    time_ += s_.period;
    if (pause_left_ > 0.0) {
      pause_left_ -= s_.period;
      moves_ = false;
      if (!(pause_left_ > 0.0)) plan();
      q = last_q_;
      qd.setZero();
      qdd.setZero();
      return;
    }
    if (!moves_) moves_since_ = time_;
    moves_ = true;
    elapsed_ += s_.period;
    const double x = std::min(1.0, elapsed_ / duration_), T = duration_;
    q = from_ + (to_ - from_) * (x * x * x * (10 + x * (-15 + 6 * x)));
    qd = (to_ - from_) * (30 * x * x * (1 - x) * (1 - x) / T);
    qdd = (to_ - from_) * (60 * x * (1 - x) * (1 - 2 * x) / (T * T));
    if (x >= 1.0) plan();
  }

  PickAndPlaceSettings s_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_{0.0, 1.0};
  std::uniform_real_distribution<double> uniform_{0.0, 1.0};
  DynamicArm<double, 6> arm_{model::Ur5Arm::kModel};
  Vec6 from_, to_, end_, last_q_ = Vec6::Zero(), last_encoder_ = Vec6::Zero(), velocity_ = Vec6::Zero(),
                         friction_, slow_ = Vec6::Zero();
  double time_{0}, elapsed_{0}, duration_{1}, pause_left_{0}, moves_since_{0};
  unsigned stage_{0};
  bool moves_{false}, places_{false}, started_{false};
};

}  // namespace heft::test
