/// @file
/// Reproduction of Kawasaki and Nishimura (1984), open loop (core/estimate/README.md, section 10).
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace heft::studies {

/// A joint trajectory as a sum of sines, six joints: q_i(t) = q0_i + Σ_k A_ik sin(2π f_ik t + φ_ik).
struct FourierTrajectory {
  std::vector<double> q0;
  std::vector<std::vector<double>> frequency_hz, amplitude_rad, phase_rad;
};

/// The two trajectories of the reproduction, embedded.
FourierTrajectory exciting_trajectory();
FourierTrajectory validation_trajectory();

/// An estimator that is compared.
enum class ProtocolMethod {
  kLeastSquares,          ///< LSM
  kInstrumentModel,       ///< IVM with the joint model (35)
  kLiteralQuasiDiagonal,  ///< (32) with the block-diagonal matrix of (33) as printed
  kInstrumentDelayed,     ///< IVM with the mean of earlier measured accelerations
  kInstrumentDesired,     ///< IVM with the trajectory's own acceleration
  kInstrumentForward      ///< IVM with forward dynamics of the running estimate
};
const char* to_string(ProtocolMethod method);

/// Settings of a run.
struct ProtocolSettings {
  /// Scenario B: the torque computation contains the rotor inertia's share of the noise.
  bool rotor_inertia{false};
  double period{0.005};             ///< sampling [s]
  double acceleration_noise{10.0};  ///< σ [rad/s²]
  int seed{1};
  bool all_methods{true};  ///< false: least squares and the joint model (35) only
  std::vector<int> sample_counts{200, 500, 1000, 2000, 5000, 10000, 20000};  ///< ascending
  FourierTrajectory exciting;
};

/// One estimate of one run.
struct ProtocolPoint {
  ProtocolMethod method{};
  int samples{0};
  double amplification{0};
  double error{0};           ///< e of section 10
  double torque_error_5{0};  ///< rms on the validation trajectory, joint 5 [mN m]
  double torque_error_6{0};
  double inertia_33{0};                 ///< estimate of Ī⁶₃₃ [g m²]
  std::vector<double> base_parameters;  ///< 18, in the paper's order, SI units
};

/// Runs one scenario, one seed.
std::vector<ProtocolPoint> run_protocol(const ProtocolSettings& settings);

/// True base parameters with payload, 18, SI units, the paper's order.
std::vector<double> true_base_parameters();
/// Nominal ones of a seed (±10 % off the parameters before the payload).
std::vector<double> nominal_base_parameters(int seed);
/// Names of the 18, as in core/estimate/README.md, section 7.
const std::vector<std::string>& base_parameter_names();
/// Torque of the variation itself on the validation trajectory, joints 5 and 6 [mN m].
std::pair<double, double> variation_torque();

/// A random exciting trajectory of the same kind: six sines a joint, 0.25 to 1.6 Hz, scaled to the same rms
/// accelerations. Of several drawn the one with the best-conditioned base regressor is taken: not every sum of
/// sines is exciting.
FourierTrajectory random_exciting_trajectory(int seed);
/// Condition number of the column-scaled base regressor over 20 s.
double condition_number(const FourierTrajectory& trajectory);

}  // namespace heft::studies
