/// @file
/// Arms at compile time for the firmware tests.
#pragma once

#include <array>

#include "heft/core/arm_model.hpp"
#include "heft/core/denavit_hartenberg.hpp"
#include "heft/core/effects/effects.hpp"
#include "heft/core/friction/gear_coupling.hpp"
#include "heft/model/named_arms.hpp"

namespace heft::firmware {

/// The six-joint arm of Kawasaki and Nishimura.
using PaperArm = model::KawasakiArm;

/// The same arm as a diagnosis would leave it: friction that depends on the load and the way, a coupled wrist, a placed tool. The
/// values are small, because the log has none of it: here it is its cost that counts.
struct EffectsArm {
  static constexpr ArmModel<double, 6> kModel = PaperArm::kModel;
  static constexpr std::array<double, 9> kTipRotation{0, -1, 0, 1, 0, 0, 0, 0, 1};
  static constexpr std::array<double, 3> kTipPosition{0.0, 0.0, 0.05};
  static constexpr std::array<GearCoupling<double>, 1> kCouplings{{{4, 5, -1.0, 0.00001, 0.002, 0.0005}}};
  static constexpr std::array<JointEffect<double>, 4> kEffects{
      {{joint_effect_kind("stribeck"), 1, {0.02, 0.1}},
       {joint_effect_kind("hysteresis"), 2, {0.002, 0.95}},
       {joint_effect_kind("load_friction"), 3, {0.005}},
       {joint_effect_kind("rotor_inertia"), 0, {0.0005}}}};
};

/// The arm whose log is replayed: a load of 60 g gripped askew, and more friction in the last two joints. No
/// parameter that the estimator finds is zero, so that each can be compared relative to itself.
constexpr ArmModel<double, 6> loaded_arm() {
  ArmModel<double, 6> arm = PaperArm::kModel;
  const InertialParameters<double> on_wrist = make_inertial_parameters<double>(
      0.02, {0.02, 0.01, 0.04}, {0.0003, 0.0001, 0.0002, -0.0001, 0.0001, 0.0004});
  const InertialParameters<double> in_hand = make_inertial_parameters<double>(
      0.06, {0.06, 0.05, 0.03}, {0.0003, -0.00005, 0.0002, 0.0001, -0.0001, 0.0003});
  for (std::size_t i = 0; i < on_wrist.size(); ++i) {
    arm.links[4][i] += on_wrist[i];
    arm.links[5][i] += in_hand[i];
  }
  arm.actuation[4].viscous_friction = 0.02;
  arm.actuation[5].viscous_friction = 0.01;
  arm.actuation[5].coulomb_friction += 0.15;
  return arm;
}

/// A seven-joint arm with alternating quarter turns; the numbers are invented.
struct SevenJointArm {
  static constexpr ArmModel<double, 7> kModel = [] {
    std::array<DenavitHartenberg<double>, 7> table{};
    std::array<InertialParameters<double>, 7> links{};
    for (std::size_t i = 0; i < table.size(); ++i) {
      const bool even = i % 2 == 0;
      const double elbow = i == 3 ? 0.08 : 0.0;
      table[i] = {.a = elbow, .d = even ? 0.3 : 0.0, .sin_alpha = even ? -1.0 : 1.0, .cos_alpha = 0.0};
      const double mass = 4.0 - 0.5 * static_cast<double>(i);
      links[i] = make_inertial_parameters<double>(mass, {0.01, 0.05, -0.02},
                                                  {0.02, 0.001, 0.03, -0.001, 0.002, 0.01});
    }
    return make_modified_dh_arm<double, 7>(table, links);
  }();
};

}  // namespace heft::firmware
