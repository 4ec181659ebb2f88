/// @file
/// How parameters drift, and the settings of the Kalman filters that follow them.
#pragma once

#include <array>
#include <cstdint>

#include "heft/core/arm_geometry.hpp"

namespace heft {

enum class DriftKind : std::uint8_t {
  kWanders,  ///< random walk: wear, or a cause that is not known
  kRelaxes   ///< Ornstein-Uhlenbeck process about the nominal value: temperature
};

/// Drift of one kind of friction.
template <typename Scalar, int N>
struct Drift {
  /// Standard deviation of the prior, and the most that is ever claimed not to be known, n [unit of the parameter]. 0: half of the
  /// model's value.
  JointVector<Scalar, N> std = JointVector<Scalar, N>::Zero();
  /// In which a random walk covers one `std`; in which a relaxing parameter falls to 1/e of its distance from the model's value,
  /// about which it scatters by `std` [s]. > 0
  Scalar time{60};
  DriftKind kind{DriftKind::kWanders};
};

/// Settings of ExtendedKalmanFilter and UnscentedKalmanFilter.
template <typename Scalar, int N>
struct DriftFilterConfig {
  using Vector = JointVector<Scalar, N>;

  Scalar period{static_cast<Scalar>(1e-3)};  ///< usual time between samples, > 0 [s]
  /// Standard deviations of the measured values; of an encoder's step s, s / √12 [rad, rad/s; m, m/s].
  Vector position_noise = Vector::Constant(static_cast<Scalar>(1e-4));
  Vector velocity_noise = Vector::Constant(static_cast<Scalar>(1e-2));
  /// Standard deviation of a torque over one period, with what the model lacks [N·m, N]. An error that is correlated over m periods
  /// counts √m times.
  Vector torque_noise = Vector::Constant(Scalar(1));
  Vector torque_limit = Vector::Constant(static_cast<Scalar>(1e30));  ///< > 0 [N·m, N]
  /// true: a torque acts from its sample on until the next one (a command). false: it was measured at its sample.
  bool torque_is_held{true};

  Drift<Scalar, N> coulomb, viscous;
  /// Standard deviations of the load's parameters, as many as are estimated [kg, kg·m, kg·m²].
  std::array<Scalar, 10> load_std{Scalar(3),
                                  static_cast<Scalar>(0.3),
                                  static_cast<Scalar>(0.3),
                                  static_cast<Scalar>(0.3),
                                  static_cast<Scalar>(0.03),
                                  static_cast<Scalar>(0.03),
                                  static_cast<Scalar>(0.03),
                                  static_cast<Scalar>(0.03),
                                  static_cast<Scalar>(0.03),
                                  static_cast<Scalar>(0.03)};
  Scalar load_time{60};  ///< in which the load wanders by one standard deviation, > 0 [s]

  Scalar sign_width{static_cast<Scalar>(0.02)};     ///< of the Coulomb sign, > 0 [rad/s, m/s]
  Scalar gate{5};                                   ///< [standard deviations]; 0: every value is taken
  Scalar gate_widening{static_cast<Scalar>(0.01)};  ///< see InnovationGate, 0 to 0.25
  Scalar patience{static_cast<Scalar>(0.05)};       ///< with a position that is refused, > 0 [s]
};

}  // namespace heft
