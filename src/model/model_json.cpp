#include <cmath>
#include <set>
#include <string>

#include <fmt/format.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "heft/model/model_file.hpp"
#include "host/json.hpp"
#include "model_effects.hpp"
#include "name_at.hpp"

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
      entry.at("rotation", "")
          .fail("found a matrix that is not a rotation", "an orthogonal matrix of determinant 1, row-major");
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

/// A symmetric matrix from the rows of its lower triangle.
Eigen::MatrixXd read_lower_triangle(const Node& rows, std::size_t size) {
  rows.expect_size(size, fmt::format("{} rows, one a base parameter and effect coefficient", size));
  Eigen::MatrixXd matrix(static_cast<Eigen::Index>(size), static_cast<Eigen::Index>(size));
  for (std::size_t r = 0; r < size; ++r) {
    rows.at(r).expect_size(r + 1, fmt::format("{} numbers", r + 1));
    for (std::size_t c = 0; c <= r; ++c) {
      const auto i = static_cast<Eigen::Index>(r), j = static_cast<Eigen::Index>(c);
      matrix(i, j) = matrix(j, i) = rows.at(r).at(c).number(true);
    }
  }
  return matrix;
}

std::vector<EffectCoefficientRecord> read_effect_coefficients(const Node& list) {
  std::vector<EffectCoefficientRecord> coefficients;
  for (std::size_t k = 0; k < list.array_size("a list"); ++k) {
    const Node entry = list.at(k);
    coefficients.push_back({static_cast<int>(entry.at("effect", "a count").number()) - 1,
                            static_cast<int>(entry.at("coefficient", "a count").number()) - 1,
                            entry.at("value", "a number").number(), entry.number_or("std", kNaN),
                            entry.number_or("half_width", kNaN)});
  }
  return coefficients;
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
  if (node.has("effect_coefficients"))
    fit.effect_coefficients = read_effect_coefficients(node.at("effect_coefficients", "a list"));
  if (node.has("parameter_covariance")) {
    fit.parameter_covariance =
        read_lower_triangle(node.at("parameter_covariance", "a list of rows"),
                            fit.base_parameters.size() + fit.effect_coefficients.size());
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
  for (const EffectCoefficientRecord& c : fit.effect_coefficients) {
    json["effect_coefficients"].push_back({{"effect", c.effect + 1},
                                           {"coefficient", c.coefficient + 1},
                                           {"value", c.value},
                                           {"std", number_or_null(c.std)},
                                           {"half_width", number_or_null(c.half_width)}});
  }
  for (Eigen::Index r = 0; r < fit.parameter_covariance.rows(); ++r)
    json["parameter_covariance"].push_back(
        host::json_array(fit.parameter_covariance.row(r).head(r + 1).transpose()));
  json["condition_number"] = number_or_null(fit.condition_number);
  json["physically_consistent"] = fit.physically_consistent;
  json["physical_cost_ratio"] = number_or_null(fit.physical_cost_ratio);
  const auto add = [&json](const char* key, const Eigen::VectorXd& values) {
    if (values.size() > 0) json[key] = host::json_array(values);
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

/// @throws ModelError when the text is no model file of this version
void check_format(const Node& root, const std::string& path) {
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
}

void read_links(const Node& root, ModelFile& model) {
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
}

/// Without joints in the file, no names and no actuation.
void read_joints(const Node& root, std::size_t num_joints, ModelFile& model) {
  model.actuation.resize(num_joints);
  model.joint_names.resize(num_joints);
  if (!root.has("joints")) return;
  const Node joints = root.at("joints", "a list");
  joints.expect_size(num_joints, fmt::format("{}, one a link", num_joints));
  for (std::size_t k = 0; k < num_joints; ++k) {
    const Node joint = joints.at(k);
    joint.expect_object();
    model.joint_names[k] = joint.text_or_empty("name");
    model.actuation[k] = {joint.number_or_zero("rotor_inertia"), joint.number_or_zero("coulomb_friction"),
                          joint.number_or_zero("viscous_friction"), joint.number_or_zero("friction_offset")};
  }
}

void read_couplings(const Node& couplings, std::size_t num_joints, ModelFile& model) {
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

constexpr std::size_t kParametersPerJoint = 14;

/// 14 numbers a joint, null where the data say nothing.
Eigen::VectorXd read_parameters(const Node& list, std::size_t num_joints) {
  const std::size_t size = kParametersPerJoint * num_joints;
  list.expect_size(size, fmt::format("{} numbers, 14 a joint", size));
  Eigen::VectorXd values(static_cast<Eigen::Index>(size));
  for (std::size_t i = 0; i < size; ++i) values[static_cast<Eigen::Index>(i)] = list.at(i).number(true);
  return values;
}

Eigen::MatrixXd read_covariance(const Node& matrix, std::size_t num_joints) {
  const std::size_t size = kParametersPerJoint * num_joints;
  matrix.expect_size(size, fmt::format("{} rows, 14 a joint", size));
  const auto rows = static_cast<Eigen::Index>(size);
  Eigen::MatrixXd covariance(rows, rows);
  for (std::size_t r = 0; r < size; ++r)
    covariance.row(static_cast<Eigen::Index>(r)) = read_parameters(matrix.at(r), num_joints).transpose();
  return covariance;
}

Provenance read_provenance(const Node& provenance) {
  provenance.expect_object();
  return {provenance.text_or_empty("method"), provenance.texts_or_empty("logs"),
          provenance.texts_or_empty("notes")};
}

/// Fields that heft does not know, as JSON text; empty when there are none.
std::string other_fields(const Json& json) {
  Json others = Json::object();
  for (const auto& [key, value] : json.items()) {
    if (!known_fields().contains(key)) others[key] = value;
  }
  return others.empty() ? std::string{} : others.dump(-1, ' ', false, Json::error_handler_t::replace);
}

void add_links_and_joints(const ModelFile& model, Json& json) {
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
}

}  // namespace

ModelFile parse_model(const std::string& text, const std::string& path) {
  const Json json = host::parse_json(text, path);
  const Node root(json, path, "");
  check_format(root, path);
  ModelFile model;
  model.path = path;
  model.robot = root.text_or_empty("robot");
  read_links(root, model);
  const std::size_t n = model.links.size();
  read_joints(root, n, model);
  if (root.has("gear_couplings")) read_couplings(root.at("gear_couplings", "a list"), n, model);
  if (root.has("effects")) {
    const Node effects = root.at("effects", "a list");
    for (std::size_t k = 0; k < effects.array_size("a list"); ++k) read_effect(effects.at(k), n, model);
  }
  if (root.has("standard_deviations"))
    model.standard_deviations = read_parameters(root.at("standard_deviations", "a list"), n);
  if (root.has("covariance")) model.covariance = read_covariance(root.at("covariance", "a matrix"), n);
  if (root.has("kinematics")) model.kinematics = read_kinematics(root.at("kinematics", "an object"), n);
  if (root.has("fit")) model.fit = read_fit(root.at("fit", "an object"), n);
  if (root.has("provenance")) model.provenance = read_provenance(root.at("provenance", "an object"));
  model.other_fields = other_fields(json);
  return model;
}

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
  add_links_and_joints(model, json);
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
  if (model.standard_deviations) json["standard_deviations"] = host::json_array(*model.standard_deviations);
  if (model.covariance) {
    json["covariance"] = Json::array();
    for (Eigen::Index r = 0; r < model.covariance->rows(); ++r)
      json["covariance"].push_back(host::json_array(model.covariance->row(r).transpose()));
  }
  json["provenance"] = {{"method", model.provenance.method},
                        {"logs", model.provenance.logs},
                        {"notes", model.provenance.notes}};
  if (!model.other_fields.empty()) json.update(Json::parse(model.other_fields));
  // Names of logs are bytes; what is not UTF-8 in them must not cost the model.
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace heft::model
