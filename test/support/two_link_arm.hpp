/// @file
/// A planar arm of two links by its textbook equations, under torque, with friction that a test may change: truth for the Kalman
/// filters that shares nothing with core's dynamics.
#pragma once

#include <cmath>
#include <random>

#include <Eigen/Core>

#include "heft/core/arm_model.hpp"
#include "heft/core/denavit_hartenberg.hpp"

namespace heft::test {

class TwoLinkArm {
 public:
  using Vector = Eigen::Matrix<double, 2, 1>;

  Vector q{0.3, -0.6}, qd{0.0, 0.0};
  Vector coulomb{6.0, 2.5}, viscous{3.0, 1.0};
  double load{0};            ///< at the tip [kg]
  double sign_width{0.02};   ///< tanh(q̇ / width), as one physical law of friction among others [rad/s]
  Vector disturbance{0, 0};  ///< torque on top of the drives' [N·m]

  /// What the filters are told: the arm without load, with the friction of the start.
  static ArmModel<double, 2> model() {
    ArmModel<double, 2> arm;
    arm.joints[1].position = {kLength, 0, 0};
    arm.links[0] = make_inertial_parameters<double>(kMass[0], {kCom, 0, 0}, {0, 0, 0, 0, 0, kInertia[0]});
    arm.links[1] = make_inertial_parameters<double>(kMass[1], {kCom, 0, 0}, {0, 0, 0, 0, 0, kInertia[1]});
    arm.actuation[0] = {kRotor[0], 6.0, 3.0, 0.0};
    arm.actuation[1] = {kRotor[1], 2.5, 1.0, 0.0};
    arm.gravity = {0, -kGravity, 0};
    return arm;
  }

  /// Runge and Kutta's method in eight parts of the step.
  void step(const Vector& tau, double dt) {
    constexpr int kParts = 8;
    const double h = dt / kParts;
    for (int n = 0; n < kParts; ++n) {
      const Vector v1 = qd, a1 = acceleration(q, v1, tau);
      const Vector v2 = qd + 0.5 * h * a1, a2 = acceleration(q + 0.5 * h * v1, v2, tau);
      const Vector v3 = qd + 0.5 * h * a2, a3 = acceleration(q + 0.5 * h * v2, v3, tau);
      const Vector v4 = qd + h * a3, a4 = acceleration(q + h * v3, v4, tau);
      q += h / 6 * (v1 + 2 * v2 + 2 * v3 + v4);
      qd += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
    }
  }

  /// PD with the torque of the unloaded arm along a motion of two sines a joint that reverses often.
  Vector follow(double t) const {
    Vector at, speed, acc;
    for (int i = 0; i < 2; ++i) {
      const double w = 2.0 + 1.1 * i, a = 0.5, b = 0.2;
      at[i] = 0.3 - 0.9 * i + a * std::sin(w * t) + b * std::sin(2.6 * w * t + i) - b * std::sin(i);
      speed[i] = a * w * std::cos(w * t) + 2.6 * b * w * std::cos(2.6 * w * t + i);
      acc[i] = -a * w * w * std::sin(w * t) - 6.76 * b * w * w * std::sin(2.6 * w * t + i);
    }
    Eigen::Matrix2d M;
    Vector h;
    terms(at, speed, 0.0, M, h);
    const Vector ratio = Vector(300, 80);
    return M * acc + h + ratio.cwiseProduct(at - q) + 0.12 * ratio.cwiseProduct(speed - qd) +
           Vector(6, 2.5).cwiseProduct(speed.unaryExpr([](double v) { return std::tanh(v / 0.02); }));
  }

 private:
  static constexpr double kLength = 0.5, kCom = 0.25, kGravity = 9.81;
  static constexpr double kMass[2] = {5.0, 2.0}, kInertia[2] = {0.1, 0.04}, kRotor[2] = {0.5, 0.2};

  static void terms(const Vector& q, const Vector& v, double load, Eigen::Matrix2d& M, Vector& h) {
    const double c = std::cos(q[1]), s = std::sin(q[1]), m2 = kMass[1] + load;
    const double first = kMass[1] * kCom + load * kLength;  // of link 2 with the load, about its joint
    const double second = kInertia[1] + kMass[1] * kCom * kCom + load * kLength * kLength;
    M(0, 0) = kRotor[0] + kInertia[0] + kMass[0] * kCom * kCom + m2 * kLength * kLength + second +
              2 * kLength * first * c;
    M(0, 1) = M(1, 0) = second + kLength * first * c;
    M(1, 1) = kRotor[1] + second;
    const double g1 = kGravity * std::cos(q[0]), g12 = kGravity * std::cos(q[0] + q[1]);
    h[0] = -kLength * first * s * (2 * v[0] * v[1] + v[1] * v[1]) + (kMass[0] * kCom + m2 * kLength) * g1 +
           first * g12;
    h[1] = kLength * first * s * v[0] * v[0] + first * g12;
  }

  Vector acceleration(const Vector& at, const Vector& v, const Vector& tau) const {
    Eigen::Matrix2d M;
    Vector h;
    terms(at, v, load, M, h);
    Vector net = tau + disturbance - h;
    for (int i = 0; i < 2; ++i) net[i] -= coulomb[i] * std::tanh(v[i] / sign_width) + viscous[i] * v[i];
    const double det = M(0, 0) * M(1, 1) - M(0, 1) * M(0, 1);
    return {(M(1, 1) * net[0] - M(0, 1) * net[1]) / det, (M(0, 0) * net[1] - M(0, 1) * net[0]) / det};
  }
};

/// One sample of what the arm's sensors give.
struct TwoLinkSample {
  TwoLinkArm::Vector q, qd, tau;
  double dt{1e-3};
};

/// The arm in its loop, with white noise on positions, velocities and torques of the stated size.
class TwoLinkRig {
 public:
  explicit TwoLinkRig(unsigned seed) : random_(seed) {}

  static constexpr double kPositionNoise = 3e-5, kVelocityNoise = 2e-3, kTorqueNoise = 0.3;

  /// The sample at the present time; the arm then moves on by a millisecond, under a torque of which the sample knows all but noise.
  TwoLinkSample next() {
    TwoLinkSample s;
    s.tau = arm.follow(time_);
    for (int i = 0; i < 2; ++i) {
      s.q[i] = arm.q[i] + kPositionNoise * normal_(random_);
      s.qd[i] = arm.qd[i] + kVelocityNoise * normal_(random_);
    }
    const TwoLinkArm::Vector error(kTorqueNoise * normal_(random_), kTorqueNoise * normal_(random_));
    arm.step(s.tau + error, 1e-3);
    time_ += 1e-3;
    return s;
  }
  double time() const { return time_; }

  TwoLinkArm arm;

 private:
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  double time_{0};
};

}  // namespace heft::test
