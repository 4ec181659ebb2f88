#include "scenario_effects.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include <fmt/format.h>

namespace heft::sim {
namespace {

/// A force on the tool that sets in and ends smoothly.
struct Contact {
  double start, duration;
  Eigen::Vector3d force;

  double share(double t) const {
    constexpr double kFlank = 0.06;
    const double flank = std::min(kFlank, 0.5 * duration);
    const auto step = [](double u) {
      u = std::clamp(u, 0.0, 1.0);
      return u * u * u * (10.0 + u * (-15.0 + 6.0 * u));
    };
    return step((t - start) / flank) * step((start + duration - t) / flank);
  }
};

std::vector<std::string> known_kinds() {
  std::vector<std::string> kinds;
  for (int kind = 0; kind < kNumJointEffects; ++kind) {
    visit_joint_effect(kind, [&](auto effect) { kinds.emplace_back(decltype(effect)::kId); });
  }
  for (const char* kind :
       {"elasticity", "delay", "wrist_coupling", "base_tilt", "contact", "payload_change"}) {
    kinds.emplace_back(kind);
  }
  std::sort(kinds.begin(), kinds.end());
  return kinds;
}

int read_joint(const SettingsReader& reader, int n) {
  return static_cast<int>(reader.whole_number("joint", 1, n)) - 1;
}

/// Which numbers a parameter of a joint effect takes.
Range range_of(const EffectParameter& given) {
  if (given.range == EffectRange::kPart) return Range::kPart;
  if (given.range == EffectRange::kPositive) return Range::kPositive;
  // Levels.
  for (std::string_view name : {"Fs", "mu", "Ia", "c", "k", "A"}) {
    if (given.name == name) return Range::kNotNegative;
  }
  return Range::kAny;
}

void read_joint_effect(const SettingsReader& reader, int kind, const model::Robot& acting,
                       SimulationSettings& settings) {
  heft::JointEffect<double> effect;
  effect.kind = kind;
  effect.joint = read_joint(reader, acting.num_joints());
  visit_joint_effect(kind, [&](auto type) {
    const auto& parameters = decltype(type)::kParameters;
    for (std::size_t k = 0; k < parameters.size(); ++k) {
      const std::string name(parameters[k].name);
      // An angle, a neutral position or a share left out is zero.
      const bool optional = parameters[k].range == EffectRange::kPart || name == "phase" || name == "q0" ||
                            name == "alpha_c" || name == "alpha_v";
      const Range range = range_of(parameters[k]);
      effect.parameters[k] = optional ? reader.number_or(name, 0.0, range) : reader.number(name, range);
    }
  });
  if (kind == joint_effect_kind<LoadFriction>() && effect.parameters[0] >= 1.0) {
    reader.refuse("mu", "", "a number of at least 0 and below 1", "lower it");
  }
  const auto i = static_cast<std::size_t>(effect.joint);
  JointEffects& effects = settings.loads[i].effects;
  if (kind == joint_effect_kind<Offset>() &&
      reader.word_or("variant", "bias", {"bias", "asymmetric"}) == "asymmetric") {
    effects.push_back(std::make_shared<AsymmetricFriction>(effect.parameters[0]));
    return;
  }
  settings.robot.effects.push_back(effect);
  if (kind == joint_effect_kind<RotorInertia>()) return;
  effects.push_back(make_joint_effect(effect, acting.joints[i].actuation));
}

void read_elasticity(const SettingsReader& reader, SimulationSettings& settings) {
  Elasticity<double> e;
  e.joint = read_joint(reader, settings.robot.num_joints());
  for (const Elasticity<double>& other : settings.robot.elasticities) {
    if (other.joint == e.joint)
      reader.refuse("joint", "", "each elastic joint once", "leave one of the two out");
  }
  e.stiffness = reader.number("stiffness", Range::kPositive);
  e.damping = reader.number_or("damping", 0.0, Range::kNotNegative);
  e.motor_inertia = reader.number("motor_inertia", Range::kPositive);
  settings.robot.elasticities.push_back(e);
}

void read_wrist_coupling(const SettingsReader& reader, SimulationSettings& settings) {
  const int n = settings.robot.num_joints();
  if (n < 6) {
    reader.refuse("kind", fmt::format("\"wrist_coupling\" on an arm of {} joints", n),
                  "an arm with joints 5 and 6", "leave it out");
  }
  GearCoupling<double> coupling;
  coupling.driving = 4;
  coupling.driven = 5;
  coupling.ratio = reader.number_or("ratio", 1.0);
  coupling.coulomb_friction = reader.number_or("Fc", 0.0, Range::kNotNegative);
  coupling.viscous_friction = reader.number_or("Fv", 0.0, Range::kNotNegative);
  settings.robot.couplings.push_back(coupling);
}

void read_base_tilt(const SettingsReader& reader, SimulationSettings& settings) {
  const double degree = std::numbers::pi / 180.0;
  const Eigen::Vector3d level =
      settings.gravity ? *settings.gravity
                       : Eigen::Vector3d(Eigen::Map<const Eigen::Vector3d>(settings.robot.gravity.data()));
  settings.gravity = tilted_gravity(level, reader.number("tilt_deg") * degree,
                                    reader.number_or("azimuth_deg", 0.0) * degree);
}

void read_contact(const SettingsReader& reader, std::vector<Contact>& contacts) {
  for (const SettingsReader& event : reader.objects("events")) {
    contacts.push_back({event.number("t0", Range::kNotNegative), event.number("duration", Range::kPositive),
                        event.numbers("force", 3)});
    event.finish();
  }
}

void read_payload_change(const SettingsReader& reader, SimulationSettings& settings) {
  const bool picked_up = reader.word("event", {"picked_up", "dropped"}) == "picked_up";
  const double time = reader.number("time", Range::kNotNegative);
  const Body body = read_body(reader);
  if (picked_up) {
    settings.payload_events = {{true, body, time, {}, 0.0}};
  } else {
    settings.payload_events = {{true, body, 0.0, {}, 0.0}, {false, {}, time, {}, 0.0}};
  }
}

}  // namespace

void read_effects(const SettingsReader& top, const model::Robot& acting, SimulationSettings& settings) {
  const std::vector<std::string> kinds = known_kinds();
  std::vector<Contact> contacts;
  std::vector<std::string> seen;
  for (const SettingsReader& reader : top.objects("effects")) {
    const std::string kind = reader.word("kind", kinds);
    // An effect of the whole arm occurs once.
    for (const char* single : {"delay", "base_tilt", "payload_change", "wrist_coupling"}) {
      if (kind == single && std::find(seen.begin(), seen.end(), kind) != seen.end()) {
        reader.refuse("kind", fmt::format("\"{}\" a second time", kind), "it once",
                      "leave one of the two out");
      }
    }
    seen.push_back(kind);
    for (const auto& [effect, key] :
         {std::pair{"base_tilt", "base_tilt"}, std::pair{"payload_change", "payload"}}) {
      if (kind == effect && top.has(key)) {
        reader.refuse("kind",
                      fmt::format("both the effect \"{}\" and the key \"{}\" of the scenario", kind, key),
                      "one of the two", "leave one out");
      }
    }
    if (const int joint_effect = joint_effect_kind(std::string_view(kind)); joint_effect >= 0) {
      read_joint_effect(reader, joint_effect, acting, settings);
    } else if (kind == "elasticity") {
      read_elasticity(reader, settings);
    } else if (kind == "delay") {
      settings.robot.torque_delay = reader.number("delay", Range::kNotNegative);
    } else if (kind == "wrist_coupling") {
      read_wrist_coupling(reader, settings);
    } else if (kind == "base_tilt") {
      read_base_tilt(reader, settings);
    } else if (kind == "contact") {
      read_contact(reader, contacts);
    } else {
      read_payload_change(reader, settings);
    }
    reader.finish();
  }
  if (contacts.empty()) return;
  settings.tool_wrench = [contacts](double t) {
    Wrench wrench;
    for (const Contact& contact : contacts) wrench.force += contact.share(t) * contact.force;
    return wrench;
  };
}

}  // namespace heft::sim
