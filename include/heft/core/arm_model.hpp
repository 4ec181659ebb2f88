/// @file
/// The arm: joints, link inertial parameters, actuation and gravity, as plain constant data.
///
/// One type describes an arm for every part of heft. Filled at run time (from a URDF) it feeds the
/// run-time dynamics; as a `constexpr` object (from `heft export`) it feeds the compile-time dynamics,
/// which drop every product by a zero or a quarter turn.
///
/// Frames. Link frame i is fixed to link i, and its origin lies **on the axis of joint i**, as in URDF.
/// Joint i moves link i against link i-1 (link 0 is the base). A standard (distal) Denavit-Hartenberg
/// frame, whose origin is at the far end of its link, is re-based by `make_standard_dh_arm`: axes of DH
/// frame i, origin at O_{i-1}.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace heft {

/// Kind of motion of a joint.
enum class JointType : std::uint8_t { kRevolute, kPrismatic };

/// Ten inertial parameters of a link in the order [m, mcx, mcy, mcz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz]:
/// mass [kg], first moment [kg·m], inertia tensor entries [kg·m²] about the **link-frame origin**,
/// axes of the link frame. Ixy is the tensor entry, that is minus the product of inertia ∫xy dm.
template <typename Scalar>
using InertialParameters = std::array<Scalar, 10>;

/// Number of inertial parameters of a link.
inline constexpr int kParametersPerLink = 10;

/// Positions in InertialParameters.
enum InertialIndex : int {
  kMass = 0,
  kMcx = 1,
  kMcy = 2,
  kMcz = 3,
  kIxx = 4,
  kIxy = 5,
  kIyy = 6,
  kIxz = 7,
  kIyz = 8,
  kIzz = 9
};

/// A joint and where it sits.
template <typename Scalar>
struct Joint {
  JointType type{JointType::kRevolute};
  /// Axes of the link frame at q = 0, expressed in the parent link frame, row-major 3 × 3 (R_PL: turns
  /// components in the link frame into components in the parent frame).
  std::array<Scalar, 9> rotation{Scalar(1), Scalar(0), Scalar(0), Scalar(0), Scalar(1),
                                 Scalar(0), Scalar(0), Scalar(0), Scalar(1)};
  /// Origin of the link frame at q = 0, in the parent link frame [m].
  std::array<Scalar, 3> position{Scalar(0), Scalar(0), Scalar(0)};
  /// Unit vector of the joint axis in the link frame; positive q turns (or moves) about (along) it.
  std::array<Scalar, 3> axis{Scalar(0), Scalar(0), Scalar(1)};
};

/// Contributions of the drive at a joint, everything on the link side of the gear.
template <typename Scalar>
struct JointActuation {
  /// Reflected inertia ρ²Iᵣ [kg·m²] (kg on a prismatic joint), felt by this joint alone.
  Scalar rotor_inertia{0};
  Scalar coulomb_friction{0};  ///< [N·m] (N)
  Scalar viscous_friction{0};  ///< [N·m·s/rad] (N·s/m)
  Scalar friction_offset{0};   ///< [N·m] (N)
};

/// A serial arm with N joints.
template <typename Scalar, int N>
struct ArmModel {
  static_assert(N >= 1, "an arm has at least one joint");
  static constexpr int kNumJoints = N;

  std::array<Joint<Scalar>, N> joints{};
  std::array<InertialParameters<Scalar>, N> links{};
  std::array<JointActuation<Scalar>, N> actuation{};
  /// Acceleration of gravity in the base frame [m/s²]. A tilted base is a turned gravity vector.
  std::array<Scalar, 3> gravity{Scalar(0), Scalar(0), Scalar(-9.81)};
};

/// Number of columns of the full regressor: ten a link, then for all joints rotor inertia, Coulomb,
/// viscous, offset (column blocks in that order, each block in joint order).
template <int N>
inline constexpr int kNumFullParameters = 14 * N;

}  // namespace heft
