/// @file
/// A planar arm with a load on a motion, for tests of closed loops.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/control/joint_controller.hpp"
#include "heft/core/denavit_hartenberg.hpp"
#include "heft/core/dynamics/joint_space.hpp"

namespace heft::test {

template <int N>
MassMatrix<double, N> mass_of(const ArmModel<double, N>& model, const JointVector<double, N>& q) {
  const DynamicArm<double, N> arm(model);
  MassMatrix<double, N> mass;
  mass_matrix(arm, joint_trigonometry<DynamicArm<double, N>>(q), q, mass);
  return mass;
}

template <int N>
ArmModel<double, N> carrying(ArmModel<double, N> arm, const InertialParameters<double>& load) {
  for (std::size_t i = 0; i < 10; ++i) {
    arm.links[N - 1][i] += load[i];
  }
  return arm;
}

/// A planar arm of two links in the vertical plane, 3 kg and 2 kg, rotors of 0.1 kg·m².
template <typename Scalar>
constexpr ArmModel<Scalar, 2> planar_arm() {
  ArmModel<Scalar, 2> arm;
  arm.joints[1].position = {Scalar(0.4), Scalar(0), Scalar(0)};
  const Scalar none(0);
  arm.links[0] = make_inertial_parameters<Scalar>(Scalar(3), {Scalar(0.2), none, none},
                                                  {none, none, Scalar(0.04), none, none, Scalar(0.04)});
  arm.links[1] = make_inertial_parameters<Scalar>(Scalar(2), {Scalar(0.15), none, none},
                                                  {none, none, Scalar(0.02), none, none, Scalar(0.02)});
  for (auto& actuation : arm.actuation) {
    actuation.rotor_inertia = Scalar(0.1);
  }
  arm.gravity = {none, Scalar(-9.81), none};
  return arm;
}

/// 1.5 kg at 0.3 m from the second joint.
inline InertialParameters<double> some_load() {
  return make_inertial_parameters<double>(1.5, {0.3, 0.0, 0.0}, {0.003, 0, 0.003, 0, 0, 0.003});
}

/// The same mass nearer to the joint, where LoadObserver looks for loads of so short an arm.
inline InertialParameters<double> near_load() {
  return make_inertial_parameters<double>(1.5, {0.15, 0.0, 0.0}, {0.003, 0, 0.003, 0, 0, 0.003});
}

template <typename Scalar>
JointReference<Scalar, 2> reference_at(double t) {
  JointReference<Scalar, 2> r;
  for (int i = 0; i < 2; ++i) {
    const double w = i == 0 ? 1.7 : 2.9, a = i == 0 ? 0.6 : 0.8;
    r.q[i] = Scalar(a * std::sin(w * t));
    r.qd[i] = Scalar(a * w * std::cos(w * t));
    r.qdd[i] = Scalar(-a * w * w * std::sin(w * t));
  }
  return r;
}

/// The arm with a load, which integrates the equations of motion by steps of a cycle.
class Plant {
 public:
  explicit Plant(const InertialParameters<double>& load) : arm_(carrying<2>(planar_arm<double>(), load)) {
    q = reference_at<double>(0).q;
    qd = reference_at<double>(0).qd;
  }

  /// Another load from now on, picked up at the speed of the arm.
  void carry(const InertialParameters<double>& load) {
    arm_.set_model(carrying<2>(planar_arm<double>(), load));
  }

  void step(const Eigen::Vector2d& tau, double dt) {
    MassMatrix<double, 2> mass;
    Eigen::Vector2d bias;
    const auto trig = joint_trigonometry<DynamicArm<double, 2>>(q);
    mass_matrix(arm_, trig, q, mass);
    bias_torque(arm_, trig, q, qd, bias);
    mass.diagonal().array() += 0.1;
    qd += dt * mass.llt().solve(tau - bias);
    q += dt * qd;
  }

  Eigen::Vector2d q, qd;

 private:
  DynamicArm<double, 2> arm_;
};

/// Sensors of the plant: encoders of 17 bits, a velocity and a torque with noise.
template <typename Measurement>
class Sensors {
 public:
  using Scalar = typename Measurement::Scalar;

  Measurement read(const Eigen::Vector2d& q, const Eigen::Vector2d& qd, const Eigen::Vector2d& tau) {
    constexpr double kStep = 4.8e-5;
    Measurement m;
    for (int i = 0; i < 2; ++i) {
      m.q[i] = static_cast<Scalar>(std::round((q[i] + 2e-5 * noise_(random_)) / kStep) * kStep);
      m.qd[i] = static_cast<Scalar>(qd[i] + 2e-3 * noise_(random_));
      m.tau[i] = static_cast<Scalar>(tau[i] + 0.1 * noise_(random_));
    }
    m.dt = static_cast<Scalar>(1e-3);
    return m;
  }

 private:
  std::mt19937_64 random_{5};
  std::normal_distribution<double> noise_;
};

/// What a controller holds for the inertial parameters of its arm or load.
template <typename C>
std::vector<double> belief_of(const C& controller) {
  std::vector<double> belief;
  if constexpr (requires { controller.estimator(); }) {
    for (const auto& link : controller.estimator().model().links)
      belief.insert(belief.end(), link.begin(), link.end());
  } else {
    belief.assign(controller.load().begin(), controller.load().end());
  }
  return belief;
}

/// reference_at() that slows down to a stop between 4 and 5 s.
template <typename Scalar>
JointReference<Scalar, 2> stopping_reference(double t) {
  const double u = std::clamp(t - 4.0, 0.0, 1.0);
  const double speed = 1 - u * u * (3 - 2 * u), slowing = -6 * u * (1 - u);
  JointReference<Scalar, 2> r = reference_at<Scalar>(std::min(t, 4.0) + u - u * u * u + 0.5 * u * u * u * u);
  r.qdd = r.qdd * Scalar(speed * speed) + r.qd * Scalar(slowing);
  r.qd *= Scalar(speed);
  return r;
}

/// Moves with a load for five seconds, then stands for a time with noise, held by friction 0.4 and 0.3 mrad off the reference: the
/// belief must not move.
template <typename C>
void expect_no_drift_at_rest(C controller, double seconds) {
  using Scalar = typename C::Scalar;
  Plant plant(near_load());
  Sensors<typename C::Measurement> sensors;
  Eigen::Vector2d tau(0, 0);
  for (int k = 0; k < 5000; ++k) {
    const auto m = sensors.read(plant.q, plant.qd, tau);
    tau = controller.step(stopping_reference<Scalar>(k * 1e-3), m).torque.template cast<double>();
    plant.step(tau, 1e-3);
  }
  const std::vector<double> moving = belief_of(controller);
  ASSERT_GT(*std::max_element(moving.begin(), moving.end()), 0.1);  // something is believed
  const DynamicArm<double, 2> arm(carrying<2>(planar_arm<double>(), near_load()));
  Eigen::Vector2d weight;
  gravity_torque(arm, joint_trigonometry<DynamicArm<double, 2>>(plant.q), plant.q, weight);
  JointReference<Scalar, 2> reference;
  reference.q = (plant.q + JointVector<double, 2>(4e-4, -3e-4)).template cast<Scalar>();
  std::vector<double> rested;
  for (int k = 0; k < static_cast<int>(seconds * 1000); ++k) {
    const auto step = controller.step(reference, sensors.read(plant.q, {0, 0}, weight));
    ASSERT_EQ(step.status, Status::kOk);
    ASSERT_TRUE(step.torque.allFinite());
    if (k == 6000) rested = belief_of(controller);
  }
  ASSERT_FALSE(rested.empty());
  EXPECT_EQ(belief_of(controller), rested);
  // Until the rest is noticed, five seconds at most, noise and what friction holds move it by less than this share.
  for (std::size_t i = 0; i < moving.size(); ++i) {
    EXPECT_NEAR(rested[i], moving[i], 0.05 * std::max(1.0, std::abs(moving[i]))) << i;
  }
}

}  // namespace heft::test
