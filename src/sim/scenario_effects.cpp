#include "scenario_effects.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "heft/core/effects/arm_effects.hpp"

namespace heft::sim {
namespace {

using host::Range;
using host::SettingsReader;

/// A force on the tool that sets in and ends smoothly.
struct Push {
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
  for (const EffectKind& kind : kEffectKinds) kinds.emplace_back(kind.id());
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
                            name == "alpha_c" || name == "alpha_v" || name == "kc" || name == "kv";
      const Range range = range_of(parameters[k]);
      effect.parameters[k] = optional ? reader.number_or(name, 0.0, range) : reader.number(name, range);
    }
  });
  if (kind == joint_effect_kind<FrictionTemperature>() &&
      !settings.loads[static_cast<std::size_t>(effect.joint)].temperature) {
    reader.refuse("kind", "\"friction_temperature\" without a temperature", "a key \"temperature\" in the scenario",
                  "add \"temperature\": {\"start\": 20, \"end\": 40, \"time_constant\": 600}");
  }
  if (kind == joint_effect_kind<LoadFriction>() && effect.parameters[0] >= 1.0) {
    reader.refuse("mu", "", "a number of at least 0 and below 1", "lower it");
  }
  if (kind == joint_effect_kind<TorqueScale>() && effect.parameters[0] <= -1.0) {
    reader.refuse("s", "", "a number above -1", "raise it");
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

/// The scenario's effects while they are read.
struct Reading {
  SimulationSettings& settings;
  std::vector<Push> contacts{};
  std::vector<std::pair<int, int>> coupled{};  ///< driving and driven joints
};

// A new arm effect needs its overload here.
void read(ElasticJoint, const SettingsReader& reader, Reading& reading) {
  model::Robot& robot = reading.settings.robot;
  Elasticity<double> e;
  e.joint = read_joint(reader, robot.num_joints());
  for (const Elasticity<double>& other : robot.elasticities) {
    if (other.joint == e.joint)
      reader.refuse("joint", "", "each elastic joint once", "leave one of the two out");
  }
  e.stiffness = reader.number("stiffness", Range::kPositive);
  e.damping = reader.number_or("damping", 0.0, Range::kNotNegative);
  e.motor_inertia = reader.number("motor_inertia", Range::kPositive);
  e.gap = reader.number_or("gap", 0.0, Range::kNotNegative);
  if (e.gap > model::kLargestGap)
    reader.refuse("gap", "", fmt::format("at most {} rad or m", model::kLargestGap), "give it in rad or m");
  robot.elasticities.push_back(e);
}

void read(Delay, const SettingsReader& reader, Reading& reading) {
  reading.settings.robot.torque_delay = reader.number("delay", Range::kNotNegative);
}

/// Joints 5 and 6 where the scenario does not name a pair.
void read(WristCoupling, const SettingsReader& reader, Reading& reading) {
  model::Robot& robot = reading.settings.robot;
  const int n = robot.num_joints();
  GearCoupling<double> coupling;
  coupling.driving = 4;
  coupling.driven = 5;
  const bool named = reader.has("driving") || reader.has("driven");
  if (named) {
    coupling.driving = static_cast<int>(reader.whole_number("driving", 1, n)) - 1;
    coupling.driven = static_cast<int>(reader.whole_number("driven", 1, n)) - 1;
    if (coupling.driving == coupling.driven)
      reader.refuse("driven", "", "another joint than \"driving\"", "name two joints");
  } else if (n < 6) {
    reader.refuse("kind", fmt::format("\"{}\" on an arm of {} joints", WristCoupling::kId, n),
                  "an arm with joints 5 and 6, or the joints named with \"driving\" and \"driven\"",
                  "name them or leave it out");
  }
  const std::pair<int, int> pair{coupling.driving, coupling.driven};
  if (std::find(reading.coupled.begin(), reading.coupled.end(), pair) != reading.coupled.end()) {
    reader.refuse("kind", fmt::format("\"{}\" of the same joints a second time", WristCoupling::kId),
                  "each pair of joints once", "leave one of the two out");
  }
  reading.coupled.push_back(pair);
  coupling.ratio = reader.number_or("ratio", 1.0);
  coupling.coulomb_friction = reader.number_or("Fc", 0.0, Range::kNotNegative);
  coupling.viscous_friction = reader.number_or("Fv", 0.0, Range::kNotNegative);
  robot.couplings.push_back(coupling);
}

void read(Cable, const SettingsReader& reader, Reading& reading) {
  model::Robot& robot = reading.settings.robot;
  const int n = robot.num_joints();
  JointCable<double> cable;
  cable.driving = static_cast<int>(reader.whole_number("driving", 1, n)) - 1;
  cable.driven = static_cast<int>(reader.whole_number("driven", 1, n)) - 1;
  if (cable.driving == cable.driven)
    reader.refuse("driven", "", "another joint than \"driving\"", "name two joints");
  cable.ratio = reader.number_or("ratio", 1.0);
  cable.stiffness = reader.number("k", Range::kNotNegative);
  cable.neutral = reader.number_or("x0", 0.0);
  robot.cables.push_back(cable);
}

void read(BaseTilt, const SettingsReader& reader, Reading& reading) {
  SimulationSettings& settings = reading.settings;
  const double degree = std::numbers::pi / 180.0;
  const Eigen::Vector3d level =
      settings.gravity ? *settings.gravity
                       : Eigen::Vector3d(Eigen::Map<const Eigen::Vector3d>(settings.robot.gravity.data()));
  settings.gravity = tilted_gravity(level, reader.number("tilt_deg") * degree,
                                    reader.number_or("azimuth_deg", 0.0) * degree);
}

void read(Contact, const SettingsReader& reader, Reading& reading) {
  for (const SettingsReader& event : reader.objects("events")) {
    reading.contacts.push_back({event.number("t0", Range::kNotNegative),
                                event.number("duration", Range::kPositive), event.numbers("force", 3)});
    event.finish();
  }
}

void read(PayloadChange, const SettingsReader& reader, Reading& reading) {
  const bool picked_up = reader.word("event", {"picked_up", "dropped"}) == "picked_up";
  const double time = reader.number("time", Range::kNotNegative);
  const Body body = read_body(reader);
  auto& events = reading.settings.payload_events;
  if (picked_up) {
    events = {{true, body, time, {}, 0.0}};
  } else {
    events = {{true, body, 0.0, {}, 0.0}, {false, {}, time, {}, 0.0}};
  }
}

/// What an arm has once.
template <typename Effect>
constexpr bool kOnce = std::is_same_v<Effect, Delay> || std::is_same_v<Effect, BaseTilt> ||
                       std::is_same_v<Effect, PayloadChange>;

/// Key of the scenario that says the same; empty: none.
template <typename Effect>
constexpr std::string_view kKey = "";
template <>
constexpr std::string_view kKey<BaseTilt> = "base_tilt";
template <>
constexpr std::string_view kKey<PayloadChange> = "payload";

}  // namespace

void read_effects(const SettingsReader& top, const model::Robot& acting, SimulationSettings& settings) {
  const std::vector<std::string> kinds = known_kinds();
  Reading reading{settings};
  std::vector<EffectKind> seen;
  for (const SettingsReader& reader : top.objects("effects")) {
    const std::string id = reader.word("kind", kinds);
    const EffectKind kind = *effect_with_id(id);
    const bool again = std::find(seen.begin(), seen.end(), kind) != seen.end();
    seen.push_back(kind);
    kind.visit([&](auto type) {
      using Effect = decltype(type);
      if (kOnce<Effect> && again) {
        reader.refuse("kind", fmt::format("\"{}\" a second time", id), "it once", "leave one of the two out");
      }
      if (!kKey<Effect>.empty() && top.has(std::string(kKey<Effect>))) {
        reader.refuse(
            "kind",
            fmt::format("both the effect \"{}\" and the key \"{}\" of the scenario", id, kKey<Effect>),
            "one of the two", "leave one out");
      }
      if constexpr (ArmEffect<Effect>) {
        read(type, reader, reading);
      } else {
        read_joint_effect(reader, joint_effect_kind<Effect>(), acting, settings);
      }
    });
    reader.finish();
  }
  if (reading.contacts.empty()) return;
  settings.tool_wrench = [contacts = std::move(reading.contacts)](double t) {
    Wrench wrench;
    for (const Push& contact : contacts) wrench.force += contact.share(t) * contact.force;
    return wrench;
  };
}

}  // namespace heft::sim
