#include "heft/model/model_file.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>

#include <fmt/format.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "heft/core/effects/arm_effects.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/host/numbers.hpp"
#include "host/json.hpp"

namespace heft::model {
namespace {

using host::Json;
using host::number_or_null;
using Node = host::JsonValue;

constexpr int kVersion = 1;
constexpr const char* kFormat = "heft-model";

const std::set<std::string>& known_fields() {
  static const std::set<std::string> fields{
      "format",     "version", "robot",          "num_joints", "units",      "parameter_order",
      "links",      "joints",  "gear_couplings", "effects",    "kinematics", "standard_deviations",
      "covariance", "fit",     "provenance"};
  return fields;
}

std::string name_at(const std::vector<std::string>& names, std::size_t index) {
  return index < names.size() ? names[index] : std::string{};
}

KinematicsRecord read_kinematics(const Node& node, std::size_t num_joints) {
  node.expect_object();
  KinematicsRecord kinematics;
  kinematics.base_link = node.text_or_empty("base_link");
  kinematics.tip_link = node.text_or_empty("tip_link");
  if (node.has("gravity")) kinematics.gravity = node.numbers<3>("gravity");
  if (node.has("tip")) {
    const Node tip = node.at("tip", "an object");
    kinematics.tip_rotation = tip.numbers<9>("rotation");
    kinematics.tip_position = tip.numbers<3>("position");
  }
  const Node joints = node.at("joints", "a list with one entry a joint");
  joints.expect_size(num_joints, fmt::format("{}, one a link", num_joints));
  for (std::size_t k = 0; k < num_joints; ++k) {
    const Node entry = joints.at(k);
    const Node type = entry.at("type", "\"revolute\" or \"prismatic\"");
    const std::string word = type.text();
    if (word != "revolute" && word != "prismatic") {
      type.fail(fmt::format("found \"{}\"", word), "\"revolute\" or \"prismatic\"");
    }
    KinematicsRecord::JointPlace place;
    place.joint.type = word == "revolute" ? JointType::kRevolute : JointType::kPrismatic;
    place.joint.rotation = entry.numbers<9>("rotation");
    place.joint.position = entry.numbers<3>("position");
    place.joint.axis = entry.numbers<3>("axis");
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(place.joint.rotation.data());
    if (!(R * R.transpose()).isIdentity(1e-9) || R.determinant() < 0) {
      entry.at("rotation", "").fail("found a matrix that turns nothing", "a rotation, row-major");
    }
    if (std::abs(Eigen::Map<const Eigen::Vector3d>(place.joint.axis.data()).norm() - 1.0) > 1e-9) {
      entry.at("axis", "").fail("found a vector that is not of length 1", "a unit vector");
    }
    place.lower = entry.number_or("lower", -kInfinity);
    place.upper = entry.number_or("upper", kInfinity);
    place.velocity_limit = entry.number_or("velocity_limit", kInfinity);
    place.effort_limit = entry.number_or("effort_limit", kInfinity);
    kinematics.joints.push_back(place);
  }
  return kinematics;
}

Json to_json(const KinematicsRecord& kinematics) {
  Json json{{"base_link", kinematics.base_link},
            {"tip_link", kinematics.tip_link},
            {"gravity", kinematics.gravity},
            {"tip", {{"rotation", kinematics.tip_rotation}, {"position", kinematics.tip_position}}}};
  json["joints"] = Json::array();
  for (const KinematicsRecord::JointPlace& place : kinematics.joints) {
    json["joints"].push_back({{"type", place.joint.type == JointType::kRevolute ? "revolute" : "prismatic"},
                              {"rotation", place.joint.rotation},
                              {"position", place.joint.position},
                              {"axis", place.joint.axis},
                              {"lower", number_or_null(place.lower)},
                              {"upper", number_or_null(place.upper)},
                              {"velocity_limit", number_or_null(place.velocity_limit)},
                              {"effort_limit", number_or_null(place.effort_limit)}});
  }
  return json;
}

/// Where a model holds what a diagnosis finds: an entry of its effects, or a place of its own.
struct ModelPlace {
  bool entry{false};           ///< of `effects`
  std::string_view elsewhere;  ///< where else, as the end of a message
};

// A new arm effect needs its line here, and `read` and `add_entries` below if it is an entry.
constexpr ModelPlace place_of(ElasticJoint) { return {true, ""}; }
constexpr ModelPlace place_of(Delay) { return {true, ""}; }
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
                                      entry.parameters.number_or_zero("motor_inertia")};
  if (!(elasticity.stiffness > 0)) {
    stiffness.fail(fmt::format("found {}", elasticity.stiffness), "a positive number");
  }
  if (elasticity.damping < 0) {
    entry.parameters.at("damping", "").fail(fmt::format("found {}", elasticity.damping), "0 or more");
  }
  for (const Elasticity<double>& other : model.elasticities) {
    if (other.joint == elasticity.joint) {
      entry.node.fail(fmt::format("found a second elasticity of joint {}", elasticity.joint + 1),
                      "one spring a joint");
    }
  }
  model.elasticities.push_back(elasticity);
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

template <typename Type>
void read_joint_effect(Type, const EffectEntry& entry, ModelFile& model) {
  JointEffect<double> effect;
  effect.kind = joint_effect_kind<Type>();
  effect.joint = entry.node.joint("joint", entry.num_joints);
  effect.displacement = read_displacement(entry.node);
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

/// One entry of `effects`, put where the model keeps it.
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

void add_entries(ElasticJoint, const ModelFile& model, Json& json) {
  for (const Elasticity<double>& elasticity : model.elasticities) {
    json.push_back({{"kind", ElasticJoint::kId},
                    {"joint", elasticity.joint + 1},
                    {"parameters",
                     {{"stiffness", elasticity.stiffness},
                      {"damping", elasticity.damping},
                      {"motor_inertia", elasticity.motor_inertia}}}});
  }
}

void add_entries(Delay, const ModelFile& model, Json& json) {
  if (!(model.torque_delay > 0)) return;
  json.push_back({{"kind", Delay::kId}, {"joint", nullptr}, {"parameters", {{"delay", model.torque_delay}}}});
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
    });
  }
  for_each_arm_effect([&](auto type) {
    if constexpr (place_of(decltype(type){}).entry) add_entries(type, model, json);
  });
  return json;
}

FitRecord read_fit(const Node& node, std::size_t num_joints) {
  node.expect_object();
  FitRecord fit;
  fit.method = node.text_or_empty("method");
  if (node.has("torque_at")) {
    const Node at = node.at("torque_at", "\"motor\" or \"joint\"");
    fit.torque_at = at.text();
    if (fit.torque_at != "motor" && fit.torque_at != "joint") {
      at.fail(fmt::format("found \"{}\"", fit.torque_at), "\"motor\" or \"joint\"");
    }
  }
  if (node.has("base_parameters")) {
    const Node list = node.at("base_parameters", "a list");
    for (std::size_t k = 0; k < list.array_size("a list"); ++k) {
      const Node entry = list.at(k);
      fit.base_parameters.push_back({entry.at("name", "a text").text(), entry.text_or_empty("unit"),
                                     entry.text_or_empty("expression"),
                                     entry.at("value", "a number").number(), entry.number_or("std", kNaN),
                                     entry.number_or("half_width", kNaN), entry.flag_or("determined", true)});
    }
  }
  fit.condition_number = node.number_or("condition_number", kNaN);
  fit.physically_consistent = node.flag_or("physically_consistent", false);
  fit.physical_cost_ratio = node.number_or("physical_cost_ratio", kNaN);
  fit.noise_std = node.numbers_or_none("noise_std", num_joints);
  fit.rmse = node.numbers_or_none("rmse", num_joints);
  fit.rmse_in_band = node.numbers_or_none("rmse_in_band", num_joints);
  fit.rmse_percent_of_max = node.numbers_or_none("rmse_percent_of_max", num_joints);
  fit.r2 = node.numbers_or_none("r2", num_joints);
  fit.band_hz = node.number_or("band_hz", 0.0);
  fit.cutoff_hz = node.number_or("cutoff_hz", 0.0);
  fit.sign_width = node.number_or("sign_width", 0.0);
  fit.samples = static_cast<long>(node.number_or("samples", 0.0));
  fit.missing = node.texts_or_empty("missing");
  return fit;
}

Json to_json(const FitRecord& fit) {
  Json json{{"method", fit.method}, {"torque_at", fit.torque_at}};
  json["base_parameters"] = Json::array();
  for (const BaseParameterRecord& parameter : fit.base_parameters) {
    json["base_parameters"].push_back({{"name", parameter.name},
                                       {"unit", parameter.unit},
                                       {"expression", parameter.expression},
                                       {"value", parameter.value},
                                       {"std", number_or_null(parameter.std)},
                                       {"half_width", number_or_null(parameter.half_width)},
                                       {"determined", parameter.determined}});
  }
  json["condition_number"] = number_or_null(fit.condition_number);
  json["physically_consistent"] = fit.physically_consistent;
  json["physical_cost_ratio"] = number_or_null(fit.physical_cost_ratio);
  const auto add = [&json](const char* key, const Eigen::VectorXd& values) {
    if (values.size() == 0) return;
    json[key] = Json::array();
    for (const double value : values) json[key].push_back(number_or_null(value));
  };
  add("noise_std", fit.noise_std);
  add("rmse", fit.rmse);
  add("rmse_in_band", fit.rmse_in_band);
  add("rmse_percent_of_max", fit.rmse_percent_of_max);
  add("r2", fit.r2);
  if (fit.band_hz > 0) json["band_hz"] = fit.band_hz;
  if (fit.cutoff_hz > 0) json["cutoff_hz"] = fit.cutoff_hz;
  if (fit.sign_width > 0) json["sign_width"] = fit.sign_width;
  json["samples"] = fit.samples;
  json["missing"] = fit.missing;
  return json;
}

/// Link frames further apart than what files round to.
bool frames_differ(const Joint<double>& a, const Joint<double>& b) {
  constexpr double kRounding = 1e-4;
  const auto far = [](const auto& u, const auto& v) {
    for (std::size_t i = 0; i < u.size(); ++i) {
      if (std::abs(u[i] - v[i]) > kRounding) return true;
    }
    return false;
  };
  return a.type != b.type || far(a.rotation, b.rotation) || far(a.position, b.position) ||
         far(a.axis, b.axis);
}

}  // namespace

ModelFile make_model(const Robot& robot) {
  ModelFile model;
  model.robot = robot.name;
  for (const RobotJoint& joint : robot.joints) {
    model.link_names.push_back(joint.link_name);
    model.joint_names.push_back(joint.name);
    model.links.push_back(joint.link);
    model.actuation.push_back(joint.actuation);
  }
  model.couplings = robot.couplings;
  model.effects = robot.effects;
  model.elasticities = robot.elasticities;
  model.torque_delay = robot.torque_delay;
  KinematicsRecord& kinematics = model.kinematics.emplace();
  kinematics.base_link = robot.base_link;
  kinematics.tip_link = robot.tip_link;
  for (const RobotJoint& joint : robot.joints) {
    kinematics.joints.push_back(
        {joint.joint, joint.lower, joint.upper, joint.velocity_limit, joint.effort_limit});
  }
  kinematics.gravity = robot.gravity;
  kinematics.tip_rotation = robot.tip_rotation;
  kinematics.tip_position = robot.tip_position;
  return model;
}

Robot make_robot(const ModelFile& model) {
  if (!model.kinematics) {
    throw ModelError(
        fmt::format("{}: /kinematics: missing; expected the joint frames of robot \"{}\"; give its URDF "
                    "with --urdf as well, or fit the model again",
                    model.path.empty() ? "model" : model.path, model.robot));
  }
  const KinematicsRecord& kinematics = *model.kinematics;
  Robot robot;
  robot.name = model.robot;
  robot.base_link = kinematics.base_link;
  robot.tip_link = kinematics.tip_link;
  robot.gravity = kinematics.gravity;
  robot.tip_rotation = kinematics.tip_rotation;
  robot.tip_position = kinematics.tip_position;
  for (std::size_t k = 0; k < kinematics.joints.size(); ++k) {
    const KinematicsRecord::JointPlace& place = kinematics.joints[k];
    robot.joints.push_back({name_at(model.joint_names, k),
                            name_at(model.link_names, k),
                            place.joint,
                            {},
                            {},
                            place.lower,
                            place.upper,
                            place.velocity_limit,
                            place.effort_limit});
  }
  apply(model, robot);
  return robot;
}

void apply(const ModelFile& model, Robot& robot, std::vector<std::string>* notes) {
  const std::string where = model.path.empty() ? "model" : model.path;
  if (model.num_joints() != robot.num_joints()) {
    throw ModelError(
        fmt::format("{}: the model has {} joints; expected {}, as robot \"{}\" has; "
                    "use the model with the URDF that it was made with",
                    where, model.num_joints(), robot.num_joints(), robot.name));
  }
  for (std::size_t k = 0; k < robot.joints.size(); ++k) {
    const std::string name = name_at(model.joint_names, k);
    if (!name.empty() && name != robot.joints[k].name) {
      throw ModelError(
          fmt::format("{}: /joints/{}/name: found \"{}\"; expected \"{}\", as in robot \"{}\"; "
                      "use the model with the URDF that it was made with",
                      where, k, name, robot.joints[k].name, robot.name));
    }
  }
  if (notes != nullptr && !model.robot.empty() && model.robot != robot.name) {
    notes->push_back(fmt::format("{}: the model was made for robot \"{}\" and is used with \"{}\"", where,
                                 model.robot, robot.name));
  }
  if (notes != nullptr && model.kinematics) {
    for (std::size_t k = 0; k < robot.joints.size(); ++k) {
      if (!frames_differ(model.kinematics->joints[k].joint, robot.joints[k].joint)) continue;
      notes->push_back(
          fmt::format("{}: joint {} of robot \"{}\" is elsewhere than when the model was made; the model's "
                      "parameters are about its own link frames",
                      where, k + 1, robot.name));
      break;
    }
  }
  for (std::size_t k = 0; k < robot.joints.size(); ++k) {
    robot.joints[k].link = model.links[k];
    robot.joints[k].actuation = model.actuation[k];
  }
  robot.couplings = model.couplings;
  robot.effects = model.effects;
  robot.elasticities = model.elasticities;
  robot.torque_delay = model.torque_delay;
  if (!model.kinematics) return;
  const std::array<double, 3>& gravity = model.kinematics->gravity;
  const std::array<double, 3> own = robot.gravity;
  const bool same_base = model.kinematics->base_link.empty() || robot.base_link.empty() ||
                         model.kinematics->base_link == robot.base_link;
  if (same_base) robot.gravity = gravity;
  const double apart = std::hypot(gravity[0] - own[0], gravity[1] - own[1], gravity[2] - own[2]);
  constexpr double kRounding = 1e-6;  // [m/s²]
  if (notes == nullptr || apart < kRounding) return;
  notes->push_back(fmt::format(
      "{}: the model was made with gravity ({:.6g}, {:.6g}, {:.6g}) m/s², robot \"{}\" "
      "has ({:.6g}, {:.6g}, {:.6g}); {}",
      where, gravity[0], gravity[1], gravity[2], robot.name, own[0], own[1], own[2],
      same_base ? "the model's is used" : "the robot's is used, since its chain begins at another link"));
}

ModelFile parse_model(const std::string& text, const std::string& path) {
  const Json json = host::parse_json(text, path);
  const Node root(json, path, "");
  const std::string format = root.at("format", fmt::format("\"{}\"", kFormat)).text();
  if (format != kFormat) {
    throw ModelError(fmt::format("{}: /format: found \"{}\"; expected \"{}\"; is this a heft model?", path,
                                 format, kFormat));
  }
  const double version = root.at("version", fmt::format("{}", kVersion)).number();
  if (version != kVersion) {
    throw ModelError(
        fmt::format("{}: /version: found {}; this heft reads version {}; use the heft that wrote the file",
                    path, version, kVersion));
  }

  ModelFile model;
  model.path = path;
  model.robot = root.text_or_empty("robot");
  const Node links = root.at("links", "a list with one entry a joint");
  const std::size_t num_joints = links.array_size("a list with one entry a joint");
  if (num_joints == 0) links.fail("found no entry", "at least one link");
  if (root.has("num_joints")) {
    const double stated = root.at("num_joints", "a count").number();
    if (stated != static_cast<double>(num_joints)) {
      links.fail(fmt::format("found {} entries", num_joints), fmt::format("{}, as /num_joints says", stated));
    }
  }
  static const std::string kTen = "ten numbers m, mcx, mcy, mcz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz";
  for (std::size_t k = 0; k < num_joints; ++k) {
    const Node link = links.at(k);
    const Node parameters = link.at("parameters", kTen);
    parameters.expect_size(kParametersPerLink, kTen);
    InertialParameters<double> values{};
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = parameters.at(i).number();
    model.links.push_back(values);
    model.link_names.push_back(link.text_or_empty("name"));
  }
  model.actuation.resize(num_joints);
  model.joint_names.resize(num_joints);
  if (root.has("joints")) {
    const Node joints = root.at("joints", "a list");
    joints.expect_size(num_joints, fmt::format("{}, one a link", num_joints));
    for (std::size_t k = 0; k < num_joints; ++k) {
      const Node joint = joints.at(k);
      joint.expect_object();
      model.joint_names[k] = joint.text_or_empty("name");
      model.actuation[k] = {joint.number_or_zero("rotor_inertia"), joint.number_or_zero("coulomb_friction"),
                            joint.number_or_zero("viscous_friction"),
                            joint.number_or_zero("friction_offset")};
    }
  }
  if (root.has("gear_couplings")) {
    const Node couplings = root.at("gear_couplings", "a list");
    for (std::size_t k = 0; k < couplings.array_size("a list"); ++k) {
      const Node entry = couplings.at(k);
      GearCoupling<double> coupling;
      coupling.driving = entry.joint("driving", num_joints);
      coupling.driven = entry.joint("driven", num_joints);
      if (coupling.driving == coupling.driven) {
        entry.fail(fmt::format("joint {} is coupled to itself", coupling.driven + 1), "two different joints");
      }
      if (entry.has("ratio")) coupling.ratio = entry.at("ratio", "a number").number();
      coupling.rotor_inertia = entry.number_or_zero("rotor_inertia");
      coupling.coulomb_friction = entry.number_or_zero("coulomb_friction");
      coupling.viscous_friction = entry.number_or_zero("viscous_friction");
      model.couplings.push_back(coupling);
    }
  }
  if (root.has("effects")) {
    const Node effects = root.at("effects", "a list");
    for (std::size_t k = 0; k < effects.array_size("a list"); ++k) {
      read_effect(effects.at(k), num_joints, model);
    }
  }
  const std::size_t num_parameters = 14 * num_joints;
  const std::string expected = fmt::format("{} numbers, 14 a joint", num_parameters);
  if (root.has("standard_deviations")) {
    const Node list = root.at("standard_deviations", expected);
    list.expect_size(num_parameters, expected);
    Eigen::VectorXd deviations(static_cast<Eigen::Index>(num_parameters));
    for (std::size_t i = 0; i < num_parameters; ++i)
      deviations[static_cast<Eigen::Index>(i)] = list.at(i).number(true);
    model.standard_deviations = deviations;
  }
  if (root.has("covariance")) {
    const Node matrix = root.at("covariance", "a matrix");
    matrix.expect_size(num_parameters, fmt::format("{} rows, 14 a joint", num_parameters));
    const auto size = static_cast<Eigen::Index>(num_parameters);
    Eigen::MatrixXd covariance(size, size);
    for (std::size_t r = 0; r < num_parameters; ++r) {
      const Node row = matrix.at(r);
      row.expect_size(num_parameters, expected);
      for (std::size_t c = 0; c < num_parameters; ++c) {
        covariance(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c)) = row.at(c).number(true);
      }
    }
    model.covariance = covariance;
  }
  if (root.has("kinematics"))
    model.kinematics = read_kinematics(root.at("kinematics", "an object"), num_joints);
  if (root.has("fit")) model.fit = read_fit(root.at("fit", "an object"), num_joints);
  if (root.has("provenance")) {
    const Node provenance = root.at("provenance", "an object");
    provenance.expect_object();
    model.provenance = {provenance.text_or_empty("method"), provenance.texts_or_empty("logs"),
                        provenance.texts_or_empty("notes")};
  }
  Json others = Json::object();
  for (const auto& [key, value] : json.items()) {
    if (!known_fields().contains(key)) others[key] = value;
  }
  if (!others.empty()) model.other_fields = others.dump(-1, ' ', false, Json::error_handler_t::replace);
  return model;
}

ModelFile read_model(const std::string& path) { return parse_model(host::read_file(path, "model"), path); }

std::string to_json(const ModelFile& model) {
  Json json;
  json["format"] = kFormat;
  json["version"] = kVersion;
  json["robot"] = model.robot;
  json["num_joints"] = model.num_joints();
  json["units"] = {{"mass", "kg"},
                   {"first_moment", "kg m"},
                   {"inertia", "kg m^2 about the link-frame origin, axes of the link frame, tensor entries"},
                   {"rotor_inertia", "kg m^2 on the link side (kg on a prismatic joint)"},
                   {"coulomb_friction", "N m (N)"},
                   {"viscous_friction", "N m s/rad (N s/m)"},
                   {"friction_offset", "N m (N)"}};
  json["parameter_order"] = {"m", "mcx", "mcy", "mcz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz"};
  json["links"] = Json::array();
  json["joints"] = Json::array();
  for (std::size_t k = 0; k < model.links.size(); ++k) {
    json["links"].push_back({{"name", name_at(model.link_names, k)}, {"parameters", model.links[k]}});
    const JointActuation<double> actuation =
        k < model.actuation.size() ? model.actuation[k] : JointActuation<double>{};
    json["joints"].push_back({{"name", name_at(model.joint_names, k)},
                              {"rotor_inertia", actuation.rotor_inertia},
                              {"coulomb_friction", actuation.coulomb_friction},
                              {"viscous_friction", actuation.viscous_friction},
                              {"friction_offset", actuation.friction_offset}});
  }
  for (const GearCoupling<double>& coupling : model.couplings) {
    json["gear_couplings"].push_back({{"driving", coupling.driving + 1},
                                      {"driven", coupling.driven + 1},
                                      {"ratio", coupling.ratio},
                                      {"rotor_inertia", coupling.rotor_inertia},
                                      {"coulomb_friction", coupling.coulomb_friction},
                                      {"viscous_friction", coupling.viscous_friction}});
  }
  if (Json effects = effects_json(model); !effects.empty()) json["effects"] = std::move(effects);
  if (model.kinematics) json["kinematics"] = to_json(*model.kinematics);
  if (model.fit) json["fit"] = to_json(*model.fit);
  if (model.standard_deviations) {
    json["standard_deviations"] = Json::array();
    for (const double value : *model.standard_deviations)
      json["standard_deviations"].push_back(number_or_null(value));
  }
  if (model.covariance) {
    json["covariance"] = Json::array();
    for (Eigen::Index r = 0; r < model.covariance->rows(); ++r) {
      Json row = Json::array();
      for (Eigen::Index c = 0; c < model.covariance->cols(); ++c)
        row.push_back(number_or_null((*model.covariance)(r, c)));
      json["covariance"].push_back(std::move(row));
    }
  }
  json["provenance"] = {{"method", model.provenance.method},
                        {"logs", model.provenance.logs},
                        {"notes", model.provenance.notes}};
  if (!model.other_fields.empty()) json.update(Json::parse(model.other_fields));
  // Names of logs are bytes; what is not UTF-8 in them must not cost the model.
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

void write_model(const std::string& path, const ModelFile& model) {
  host::write_file_atomically(path, to_json(model));
}

}  // namespace heft::model
