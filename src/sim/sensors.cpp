#include "sensors.hpp"

#include <cmath>
#include <numbers>

namespace heft::sim {
namespace {

double quantise(double value, double step) { return step > 0.0 ? std::round(value / step) * step : value; }

/// Share of a new value in a first-order low-pass over one sample.
double share(double cutoff_hz, double dt) {
  return cutoff_hz > 0.0 ? 1.0 - std::exp(-2.0 * std::numbers::pi * cutoff_hz * dt) : 1.0;
}

}  // namespace

Sensors::Sensors(const SensorSettings& settings, int num_joints, std::uint64_t seed)
    : settings_(settings), n_(num_joints) {
  for (int channel = 0; channel < kNumChannels; ++channel) {
    std::seed_seq sequence{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32),
                           static_cast<std::uint32_t>(channel)};
    generator_[channel].seed(sequence);
  }
  acceleration_ = Eigen::VectorXd::Zero(n_);
}

double Sensors::jitter() {
  if (settings_.sampling_jitter <= 0.0) return 0.0;
  std::uniform_real_distribution<double> uniform(-settings_.sampling_jitter, settings_.sampling_jitter);
  return uniform(generator_[kJitter]);
}

void Sensors::read_motion(double dt, const Eigen::VectorXd& q, const Eigen::VectorXd& qd) {
  previous_position_ = position_;
  previous_velocity_ = velocity_;
  position_ = q;
  for (Eigen::Index i = 0; i < n_; ++i) {
    if (settings_.position_noise.size() > 0) position_[i] += settings_.position_noise[i] * normal(kPosition);
    if (settings_.encoder_quantum.size() > 0)
      position_[i] = quantise(position_[i], settings_.encoder_quantum[i]);
  }
  if (first_) {
    velocity_ = qd;
    previous_velocity_ = qd;
  } else if (settings_.velocity == VelocitySource::kDifferenced) {
    velocity_ +=
        share(settings_.velocity_cutoff_hz, dt) * ((position_ - previous_position_) / dt - velocity_);
  } else {
    velocity_ = qd;
  }
  if (settings_.velocity == VelocitySource::kExact && settings_.velocity_noise.size() > 0) {
    for (Eigen::Index i = 0; i < n_; ++i) velocity_[i] += settings_.velocity_noise[i] * normal(kVelocity);
  }
}

void Sensors::read_acceleration(double dt) {
  if (settings_.acceleration == AccelerationSource::kDifferenced) {
    if (!first_) {
      acceleration_ += share(settings_.acceleration_cutoff_hz, dt) *
                       ((velocity_ - previous_velocity_) / dt - acceleration_);
    }
  } else if (settings_.acceleration_noise.size() > 0) {
    for (Eigen::Index i = 0; i < n_; ++i) {
      acceleration_[i] = settings_.acceleration_noise[i] * normal(kAcceleration);
    }
  }
  first_ = false;
}

Eigen::VectorXd Sensors::acceleration(const Eigen::VectorXd& qdd) const {
  if (settings_.acceleration == AccelerationSource::kDifferenced) return acceleration_;
  return qdd + acceleration_;
}

Eigen::VectorXd Sensors::torque(const Eigen::VectorXd& tau) {
  Eigen::VectorXd reported = tau;
  for (Eigen::Index i = 0; i < n_; ++i) {
    if (settings_.torque_noise.size() > 0) reported[i] += settings_.torque_noise[i] * normal(kTorque);
    if (settings_.torque_quantum.size() > 0) reported[i] = quantise(reported[i], settings_.torque_quantum[i]);
  }
  return reported;
}

}  // namespace heft::sim
