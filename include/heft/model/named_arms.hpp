/// @file
/// Arms as compile-time descriptions that tests, benchmarks and examples share.
#pragma once

#include <array>

#include "heft/core/arm_model.hpp"
#include "heft/core/denavit_hartenberg.hpp"
#include "heft/model/detail/kawasaki6r.hpp"

namespace heft::model {

namespace detail {

/// The UR5 of the reference vectors: makers' geometry and masses, rotational inertias nominal with invented
/// off-diagonal entries so that every column is exercised.
constexpr ArmModel<double, 6> make_ur5() {
  const std::array<DenavitHartenberg<double>, 6> table = {{{0, 0.08916, 1, 0},
                                                           {-0.425, 0, 0, 1},
                                                           {-0.39225, 0, 0, 1},
                                                           {0, 0.10915, 1, 0},
                                                           {0, 0.09465, -1, 0},
                                                           {0, 0.0823, 0, 1}}};
  const std::array<InertialParameters<double>, 6> links = {
      make_inertial_parameters<double>(3.7, {0, -0.02561, 0.00193},
                                       {0.01, 0.0002, 0.0098, -0.0001, 0.0003, 0.0067}),
      make_inertial_parameters<double>(8.393, {0.2125, 0, 0.11336},
                                       {0.015, 0.0008, 0.226, -0.0011, 0.0004, 0.226}),
      make_inertial_parameters<double>(2.33, {0.15, 0, 0.0265},
                                       {0.0041, -0.0003, 0.0312, 0.0005, 0.0002, 0.0312}),
      make_inertial_parameters<double>(1.219, {0, -0.0018, 0.01634},
                                       {0.0026, 0.0001, 0.0025, -5e-05, 8e-05, 0.0022}),
      make_inertial_parameters<double>(1.219, {0, 0.0018, 0.01634},
                                       {0.0026, -0.0001, 0.0025, 6e-05, 5e-05, 0.0022}),
      make_inertial_parameters<double>(0.1879, {0, 0, -0.001159},
                                       {0.0001, 1e-05, 0.00011, -5e-06, 4e-06, 0.00014})};
  ArmModel<double, 6> arm = make_standard_dh_arm<double, 6>(table, links);
  constexpr std::array<double, 6> kCoulomb = {5.0, 5.0, 4.0, 1.5, 1.5, 1.2};
  constexpr std::array<double, 6> kViscous = {2.0, 2.0, 1.5, 0.5, 0.5, 0.4};
  for (std::size_t i = 0; i < 6; ++i) {
    arm.actuation[i].coulomb_friction = kCoulomb[i];
    arm.actuation[i].viscous_friction = kViscous[i];
  }
  return arm;
}

}  // namespace detail

/// The arm of Kawasaki and Nishimura (1984), six revolute joints, without payload: what `heft export` writes for
/// `urdf/kawasaki6r.urdf`. `urdf/README.md` says how doubtful prints were settled.
using KawasakiArm = heft_robots::Kawasaki6r;

/// The same arm with the authors' variation of its terminal link, stated for mass, centre and inertia about the centre:
/// 110 g at (0.04, 0.04, 0), diag(0.4, 0.3, 0.4) g m²; and of its friction.
struct KawasakiArmWithPayload {
  static constexpr ArmModel<double, 6> kModel = [] {
    ArmModel<double, 6> arm = KawasakiArm::kModel;
    arm.links[5] = make_inertial_parameters<double>(0.11, {0.04, 0.04, 0}, {0.0004, 0, 0.0003, 0, 0, 0.0004});
    arm.actuation[5].coulomb_friction = 0.25;
    return arm;
  }();
};

/// UR5 as in the reference vectors.
struct Ur5Arm {
  static constexpr ArmModel<double, 6> kModel = detail::make_ur5();
};

}  // namespace heft::model
