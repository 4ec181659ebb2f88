/// @file
/// The digital controller's side of a simulation: its inputs and its output.
#pragma once

#include <memory>

#include <Eigen/Core>

#include "heft/sim/forward_dynamics.hpp"

namespace heft::sim {

/// Inputs of a controller at a sample. Vectors of n.
struct Measurement {
  double time{0.0};         ///< nominal time of the sample [s]
  double sample_time{0.0};  ///< since the sample before [s]; the nominal one at the first sample
  Eigen::VectorXd q;        ///< position from the encoder [rad, m]
  Eigen::VectorXd qd;       ///< velocity estimate
  Eigen::VectorXd qdd;      ///< acceleration as measured, the one before the new torque acts
  Eigen::VectorXd tau;      ///< torque that acted since the sample before, as the drive reports it [N·m, N]
  Eigen::VectorXd q_ref, qd_ref,
      qdd_ref;  ///< reference; zero acceleration and the present position without one
};

/// A digital controller. Called once a sample in rising time; the torque is held until the next sample.
class Controller {
 public:
  virtual ~Controller() = default;
  /// Called once before the first sample.
  virtual void start(int num_joints, double sample_time) { (void)num_joints, (void)sample_time; }
  /// @param torque  out, n [N·m, N]; limits are applied afterwards by the drive
  virtual void control(double t, const Measurement& measurement, Eigen::Ref<Eigen::VectorXd> torque) = 0;
};

/// Kp (q_ref − q) + Kd (q̇_ref − q̇), with the gravity torque of `gravity_model` at the measured position
/// added when one is given.
class PdController : public Controller {
 public:
  /// @param kp,kd  gains per joint, n [N·m/rad, N·m·s/rad]
  PdController(Eigen::VectorXd kp, Eigen::VectorXd kd,
               std::shared_ptr<const ForwardDynamics> gravity_model = nullptr);
  void control(double t, const Measurement& measurement, Eigen::Ref<Eigen::VectorXd> torque) override;

 private:
  Eigen::VectorXd kp_, kd_;
  std::shared_ptr<const ForwardDynamics> gravity_model_;
};

}  // namespace heft::sim
