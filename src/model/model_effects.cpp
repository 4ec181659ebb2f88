#include "model_effects.hpp"

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "heft/core/effects/arm_effects.hpp"

namespace heft::model {

using host::Json;
using Node = host::JsonValue;

namespace {

/// Where a model holds what a diagnosis finds: an entry of its effects, or a place of its own.
struct ModelPlace {
  bool entry{false};           ///< of `effects`
  std::string_view elsewhere;  ///< where else, as the end of a message
};

// A new arm effect needs its line here, and `read` and `add_entries` below if it is an entry.
constexpr ModelPlace place_of(ElasticJoint) { return {true, ""}; }
constexpr ModelPlace place_of(Delay) { return {true, ""}; }
constexpr ModelPlace place_of(Cable) { return {true, ""}; }
constexpr ModelPlace place_of(WristCoupling) {
  return {false, "; a motor that turns with two joints belongs in /gear_couplings"};
}
constexpr ModelPlace place_of(BaseTilt) {
  return {false, "; a base that is not level belongs in /kinematics/gravity"};
}
constexpr ModelPlace place_of(PayloadChange) {
  return {false, "; a body on the tool belongs in the last of /links"};
}
constexpr ModelPlace place_of(Contact) { return {false, "; a contact is no part of the arm"}; }

std::string effect_kinds() {
  std::string kinds;
  for (const EffectKind& kind : kEffectKinds) {
    const bool entry = kind.visit([](auto effect) {
      if constexpr (ArmEffect<decltype(effect)>) return place_of(decltype(effect){}).entry;
      return true;
    });
    if (entry) kinds += fmt::format("{}{}", kinds.empty() ? "one of " : ", ", kind.id());
  }
  return kinds;
}

/// The values that a parameter of an effect may have.
std::string range_of(const EffectParameter& parameter) {
  switch (parameter.range) {
    case EffectRange::kPositive: return fmt::format("a number above zero [{}]", parameter.unit);
    case EffectRange::kPart: return "a part, 0 to 1";
    case EffectRange::kAny: break;
  }
  return fmt::format("a number [{}]", parameter.unit);
}

/// One entry of `effects`.
struct EffectEntry {
  const Node& node;
  Node parameters;
  std::size_t num_joints;
};

void read(Delay, const EffectEntry& entry, ModelFile& model) {
  if (entry.node.has("joint") && !entry.node.at("joint", "null").is_null()) {
    entry.node.at("joint", "null").fail("found a joint", "null: the delay is that of all joints");
  }
  const Node delay = entry.parameters.at("delay", "seconds");
  if (model.torque_delay > 0) entry.node.fail("found a second delay", "one for all joints");
  model.torque_delay = delay.number();
  if (model.torque_delay < 0) delay.fail(fmt::format("found {}", model.torque_delay), "0 or more");
}

void read(ElasticJoint, const EffectEntry& entry, ModelFile& model) {
  const Node stiffness = entry.parameters.at("stiffness", "N·m/rad (N/m)");
  const Elasticity<double> elasticity{entry.node.joint("joint", entry.num_joints), stiffness.number(),
                                      entry.parameters.number_or_zero("damping"),
                                      entry.parameters.number_or_zero("motor_inertia"),
                                      entry.parameters.number_or_zero("gap")};
  if (!(elasticity.stiffness > 0)) {
    stiffness.fail(fmt::format("found {}", elasticity.stiffness), "a positive number");
  }
  if (elasticity.damping < 0) {
    entry.parameters.at("damping", "").fail(fmt::format("found {}", elasticity.damping), "0 or more");
  }
  if (elasticity.gap < 0 || elasticity.gap > kLargestGap) {
    entry.parameters.at("gap", "").fail(fmt::format("found {}", elasticity.gap),
                                        fmt::format("0 to {} rad or m", kLargestGap));
  }
  for (const Elasticity<double>& other : model.elasticities) {
    if (other.joint == elasticity.joint) {
      entry.node.fail(fmt::format("found a second elasticity of joint {}", elasticity.joint + 1),
                      "one spring a joint");
    }
  }
  model.elasticities.push_back(elasticity);
}

/// The smallest and the largest value of a quantity.
SeenInterval<double> read_interval(const Node& range, const char* name) {
  const auto [low, high] = range.numbers<2>(name);
  if (!(low <= high)) {
    range.at(name, "").fail(fmt::format("found {} and {}", low, high), "the smallest value and the largest one");
  }
  return {low, high};
}

void read(Cable, const EffectEntry& entry, ModelFile& model) {
  JointCable<double> cable;
  cable.driving = entry.node.joint("joint", entry.num_joints);
  cable.driven = entry.node.joint("driven_joint", entry.num_joints);
  if (cable.driven == cable.driving)
    entry.node.at("driven_joint", "").fail("found the same joint twice", "another joint than \"joint\"");
  const Node stiffness = entry.parameters.at("k", "N·m/rad (N/m)");
  cable.stiffness = stiffness.number();
  if (!(cable.stiffness >= 0.0)) stiffness.fail(fmt::format("found {}", cable.stiffness), "0 or more");
  cable.neutral = entry.parameters.at("x0", "rad (m)").number();
  cable.ratio = entry.parameters.at("ratio", "a number").number();
  if (entry.node.has("range")) {
    const Node range = entry.node.at("range", "an object");
    range.expect_object();
    if (range.has("stretch")) cable.seen = read_interval(range, "stretch");
  }
  model.cables.push_back(cable);
}

Displacement read_displacement(const Node& node) {
  if (!node.has("displacement")) return Displacement::kPosition;
  const Node given = node.at("displacement", "text");
  const auto name = std::find(kDisplacementNames.begin(), kDisplacementNames.end(), given.text());
  if (name == kDisplacementNames.end()) {
    given.fail(fmt::format("found \"{}\"", given.text()),
               fmt::format("one of {}", fmt::join(kDisplacementNames, ", ")));
  }
  return static_cast<Displacement>(name - kDisplacementNames.begin());
}

/// Names of the quantities that an effect was seen over, in model files.
constexpr std::array<std::pair<const char*, SeenInterval<double> SeenWithin<double>::*>, 4> kSeenOver{
    {{"velocity", &SeenWithin<double>::velocity},
     {"load", &SeenWithin<double>::load},
     {"position", &SeenWithin<double>::position},
     {"temperature", &SeenWithin<double>::temperature}}};

SeenWithin<double> read_range(const Node& node) {
  SeenWithin<double> seen;
  if (!node.has("range")) return seen;
  const Node range = node.at("range", "an object");
  range.expect_object();
  for (const auto& [name, interval] : kSeenOver) {
    if (!range.has(name)) continue;
    seen.*interval = read_interval(range, name);
  }
  return seen;
}

/// The intervals that have limits; an empty object where none has.
Json range_json(const SeenWithin<double>& seen) {
  Json json = Json::object();
  for (const auto& [name, interval] : kSeenOver) {
    if (is_limited(seen.*interval)) json[name] = {(seen.*interval).low, (seen.*interval).high};
  }
  return json;
}

template <typename Type>
void read_joint_effect(Type, const EffectEntry& entry, ModelFile& model) {
  JointEffect<double> effect;
  effect.kind = joint_effect_kind<Type>();
  effect.joint = entry.node.joint("joint", entry.num_joints);
  effect.displacement = read_displacement(entry.node);
  effect.seen = read_range(entry.node);
  std::size_t i = 0;
  for (const EffectParameter& parameter : Type::kParameters) {
    const std::string name(parameter.name);
    effect.parameters[i++] = parameter.range == EffectRange::kPart
                                 ? entry.parameters.number_or_zero(name.c_str())
                                 : entry.parameters.at(name.c_str(), range_of(parameter)).number();
  }
  if (const int wrong = parameter_out_of_range(effect); wrong >= 0) {
    const EffectParameter& parameter = Type::kParameters[static_cast<std::size_t>(wrong)];
    entry.parameters.at(std::string(parameter.name).c_str(), "")
        .fail(fmt::format("found {}", effect.parameters[static_cast<std::size_t>(wrong)]),
              range_of(parameter));
  }
  model.effects.push_back(effect);
}

void add_entries(ElasticJoint, const ModelFile& model, Json& json) {
  for (const Elasticity<double>& elasticity : model.elasticities) {
    Json parameters = {{"stiffness", elasticity.stiffness},
                       {"damping", elasticity.damping},
                       {"motor_inertia", elasticity.motor_inertia}};
    if (elasticity.gap > 0.0) parameters["gap"] = elasticity.gap;
    json.push_back(
        {{"kind", ElasticJoint::kId}, {"joint", elasticity.joint + 1}, {"parameters", std::move(parameters)}});
  }
}

void add_entries(Cable, const ModelFile& model, Json& json) {
  for (const JointCable<double>& cable : model.cables) {
    json.push_back({{"kind", Cable::kId},
                    {"joint", cable.driving + 1},
                    {"driven_joint", cable.driven + 1},
                    {"parameters", {{"k", cable.stiffness}, {"x0", cable.neutral}, {"ratio", cable.ratio}}}});
    if (is_limited(cable.seen))
      json.back()["range"] = {{"stretch", {cable.seen.low, cable.seen.high}}};
  }
}

void add_entries(Delay, const ModelFile& model, Json& json) {
  if (!(model.torque_delay > 0)) return;
  json.push_back({{"kind", Delay::kId}, {"joint", nullptr}, {"parameters", {{"delay", model.torque_delay}}}});
}

}  // namespace

void read_effect(const Node& node, std::size_t num_joints, ModelFile& model) {
  const Node kind_node = node.at("kind", effect_kinds());
  const std::string id = kind_node.text();
  const Node parameters = node.at("parameters", "an object");
  parameters.expect_object();
  const auto refuse = [&](std::string_view elsewhere) {
    kind_node.fail(fmt::format("found \"{}\"", id), fmt::format("{}{}", effect_kinds(), elsewhere));
  };
  const EffectKind* kind = effect_with_id(id);
  if (kind == nullptr) {
    refuse("");
    return;
  }
  const EffectEntry entry{node, parameters, num_joints};
  kind->visit([&](auto type) {
    if constexpr (!ArmEffect<decltype(type)>) {
      read_joint_effect(type, entry, model);
    } else if constexpr (place_of(decltype(type){}).entry) {
      read(type, entry, model);
    } else {
      refuse(place_of(type).elsewhere);
    }
  });
}

Json effects_json(const ModelFile& model) {
  Json json = Json::array();
  for (const JointEffect<double>& effect : model.effects) {
    visit_joint_effect(effect.kind, [&](auto type) {
      Json parameters = Json::object();
      std::size_t i = 0;
      for (const EffectParameter& parameter : decltype(type)::kParameters) {
        parameters[std::string(parameter.name)] = effect.parameters[i++];
      }
      json.push_back(
          {{"kind", decltype(type)::kId}, {"joint", effect.joint + 1}, {"parameters", parameters}});
      if (effect.displacement != Displacement::kPosition) {
        json.back()["displacement"] = displacement_name(effect.displacement);
      }
      if (Json range = range_json(effect.seen); !range.empty()) json.back()["range"] = std::move(range);
    });
  }
  for_each_arm_effect([&](auto type) {
    if constexpr (place_of(decltype(type){}).entry) add_entries(type, model, json);
  });
  return json;
}

}  // namespace heft::model
