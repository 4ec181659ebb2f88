/// @file
/// From true motion to the readings of encoders, drives and accelerometers.
#pragma once

#include <cstdint>
#include <random>

#include <Eigen/Core>

#include "heft/sim/simulator.hpp"

namespace heft::sim {

class Sensors {
 public:
  Sensors(const SensorSettings& settings, int num_joints, std::uint64_t seed);

  /// Error of a sampling instant [s], uniform within the jitter.
  double jitter();

  /// Position and velocity channels at a sample.
  /// @param dt  since the sample before; 0 at the first
  void read_motion(double dt, const Eigen::VectorXd& q, const Eigen::VectorXd& qd);
  /// Noise of the acceleration channel of this sample, or the differenced channel itself.
  void read_acceleration(double dt);
  /// Acceleration channel for a true acceleration. The same noise for every call within a sample.
  Eigen::VectorXd acceleration(const Eigen::VectorXd& qdd) const;
  /// Torque as the drive reports it.
  Eigen::VectorXd torque(const Eigen::VectorXd& tau);

  const Eigen::VectorXd& position() const { return position_; }
  const Eigen::VectorXd& velocity() const { return velocity_; }

 private:
  /// Own generator per channel, so that switching one noise on leaves the others as they were.
  enum Channel { kPosition, kVelocity, kAcceleration, kTorque, kJitter, kNumChannels };
  double normal(Channel channel) { return normal_[channel](generator_[channel]); }

  SensorSettings settings_;
  Eigen::Index n_;
  std::mt19937_64 generator_[kNumChannels];
  std::normal_distribution<double> normal_[kNumChannels];
  Eigen::VectorXd position_, velocity_, previous_position_, previous_velocity_, acceleration_;
  bool first_{true};
};

}  // namespace heft::sim
