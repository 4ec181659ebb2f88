/// @file
/// Arms from Denavit-Hartenberg tables, standard (distal) and modified (proximal).
#pragma once

#include <array>
#include <cstddef>

#include "heft/core/arm_model.hpp"
#include "heft/core/inertia.hpp"

namespace heft {

/// One row of a Denavit-Hartenberg table of a revolute joint without angle offset. The twist comes as sine
/// and cosine so that tables can be constexpr and quarter turns exact.
template <typename Scalar>
struct DenavitHartenberg {
  Scalar a{0};          ///< [m]
  Scalar d{0};          ///< [m]
  Scalar sin_alpha{0};  ///< sine of the twist
  Scalar cos_alpha{1};  ///< cosine of the twist
};

/// Arm from a standard (distal) table: T_i = Rz(q_i) Tz(d_i) Tx(a_i) Rx(α_i), joint i turns about z_{i-1}.
///
/// Link frame i gets the axes of DH frame i and its origin at O_{i-1}, on the axis of joint i; the vector from
/// there to O_i is r_i = (a_i, d_i sin α_i, d_i cos α_i), the joint axis in link axes (0, sin α_i, cos α_i)
/// (Kawasaki and Nishimura, text before (2)).
///
/// @param table  one row a joint
/// @param links  inertial parameters about the **DH origins O_i**, axes of DH frame i
template <typename Scalar, int N>
constexpr ArmModel<Scalar, N> make_standard_dh_arm(
    const std::array<DenavitHartenberg<Scalar>, std::size_t{N}>& table,
    const std::array<InertialParameters<Scalar>, std::size_t{N}>& links) noexcept {
  ArmModel<Scalar, N> arm;
  std::array<Scalar, 3> origin{};  // of the next joint, in the link frame before it
  for (std::size_t i = 0; i < static_cast<std::size_t>(N); ++i) {
    const auto& row = table[i];
    Joint<Scalar>& joint = arm.joints[i];
    // At q = 0 the axes of frame i are Rx(α_i) seen from frame i-1.
    joint.rotation = {Scalar(1),      Scalar(0), Scalar(0),     Scalar(0),    row.cos_alpha,
                      -row.sin_alpha, Scalar(0), row.sin_alpha, row.cos_alpha};
    joint.position = origin;
    joint.axis = {Scalar(0), row.sin_alpha, row.cos_alpha};
    origin = {row.a, row.d * row.sin_alpha, row.d * row.cos_alpha};
    constexpr std::array<Scalar, 9> kIdentity = {Scalar(1), Scalar(0), Scalar(0), Scalar(0), Scalar(1),
                                                 Scalar(0), Scalar(0), Scalar(0), Scalar(1)};
    arm.links[i] = to_inertial_parameters(moved(to_pseudo_inertia(links[i]), kIdentity, origin));
  }
  return arm;
}

/// Arm from a modified (proximal) table: T_i = Rx(α_{i-1}) Tx(a_{i-1}) Rz(q_i) Tz(d_i), joint i turns about z_i.
/// @param table  row i holds α_{i-1}, a_{i-1}, d_i
/// @param links  inertial parameters about the DH origins, which here are the link-frame origins
template <typename Scalar, int N>
constexpr ArmModel<Scalar, N> make_modified_dh_arm(
    const std::array<DenavitHartenberg<Scalar>, std::size_t{N}>& table,
    const std::array<InertialParameters<Scalar>, std::size_t{N}>& links) noexcept {
  ArmModel<Scalar, N> arm;
  for (std::size_t i = 0; i < static_cast<std::size_t>(N); ++i) {
    const auto& row = table[i];
    Joint<Scalar>& joint = arm.joints[i];
    joint.rotation = {Scalar(1),      Scalar(0), Scalar(0),     Scalar(0),    row.cos_alpha,
                      -row.sin_alpha, Scalar(0), row.sin_alpha, row.cos_alpha};
    joint.position = {row.a, -row.d * row.sin_alpha, row.d * row.cos_alpha};
    arm.links[i] = links[i];
  }
  return arm;
}

/// Inertial parameters of a body from mass, centre of mass and inertia about the centre of mass.
/// @param mass     [kg]
/// @param com      centre of mass in the link frame [m]
/// @param inertia  about the centre of mass, link axes, [Ixx, Ixy, Iyy, Ixz, Iyz, Izz] [kg·m²]
template <typename Scalar>
constexpr InertialParameters<Scalar> make_inertial_parameters(Scalar mass, const std::array<Scalar, 3>& com,
                                                              const std::array<Scalar, 6>& inertia) noexcept {
  const auto& c = com;
  // Steiner: I_O = I_C + m (|c|² E − c cᵀ).
  return {mass,
          mass * c[0],
          mass * c[1],
          mass * c[2],
          inertia[0] + mass * (c[1] * c[1] + c[2] * c[2]),
          inertia[1] - mass * c[0] * c[1],
          inertia[2] + mass * (c[0] * c[0] + c[2] * c[2]),
          inertia[3] - mass * c[0] * c[2],
          inertia[4] - mass * c[1] * c[2],
          inertia[5] + mass * (c[0] * c[0] + c[1] * c[1])};
}

}  // namespace heft
