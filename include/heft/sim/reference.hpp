/// @file
/// Reference motions for simulated arms.
#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

namespace heft::sim {

/// A motion q(t) with its exact derivatives, for t >= 0.
class Reference {
 public:
  virtual ~Reference() = default;
  virtual int num_joints() const = 0;
  /// @param q,qd,qdd  out, n each [rad, rad/s, rad/s²; m, … on a prismatic joint]
  virtual void evaluate(double t, Eigen::Ref<Eigen::VectorXd> q, Eigen::Ref<Eigen::VectorXd> qd,
                        Eigen::Ref<Eigen::VectorXd> qdd) const = 0;
};

/// Stays at a position.
std::shared_ptr<const Reference> make_hold(const Eigen::VectorXd& position);

/// Sums of sines: q_i = q0_i + Σ_k A_ik sin(2π f_ik t + φ_ik).
struct FourierMotion {
  Eigen::VectorXd q0;            ///< n
  Eigen::MatrixXd amplitude;     ///< n × terms [rad, m]
  Eigen::MatrixXd frequency_hz;  ///< n × terms
  Eigen::MatrixXd phase;         ///< n × terms [rad]
};
std::shared_ptr<const Reference> make_fourier(const FourierMotion& motion);

/// From `from` to `to` within `duration`, at rest with zero acceleration at both ends (fifth-order
/// polynomial), then stays there.
std::shared_ptr<const Reference> make_quintic(const Eigen::VectorXd& from, const Eigen::VectorXd& to,
                                              double duration);

/// Degree of the pieces between waypoints.
enum class WaypointOrder {
  /// Cubic spline, at rest at both ends; velocity and acceleration are continuous.
  kCubic,
  /// Quintic pieces through the cubic spline's velocities and accelerations, with zero acceleration at both
  /// ends.
  kQuintic
};
/// Through waypoints, then stays at the last one.
/// @param times   strictly increasing, the first is the start [s]; before it the motion stays at the first point
/// @param points  n × number of times
std::shared_ptr<const Reference> make_waypoints(const std::vector<double>& times,
                                                const Eigen::MatrixXd& points, WaypointOrder order);

/// Through samples with their derivatives, fifth-order polynomials between them; at rest at the ends before the first and
/// after the last.
/// @param times     strictly increasing, at least two [s]
/// @param q,qd,qdd  number of times × n
std::shared_ptr<const Reference> make_sampled(const Eigen::VectorXd& times, const Eigen::MatrixXd& q,
                                              const Eigen::MatrixXd& qd, const Eigen::MatrixXd& qdd);

/// Blends from rest at `start` into a motion: q = start + σ(t/ramp) (motion − start) with the fifth-order
/// smooth step σ, so that position, velocity and acceleration begin at start, 0, 0.
std::shared_ptr<const Reference> ramp_in(std::shared_ptr<const Reference> motion,
                                         const Eigen::VectorXd& start, double ramp);

}  // namespace heft::sim
