#include "heft/model/model_file.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "heft/host/error.hpp"
#include "heft/host/file.hpp"

namespace heft::model {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kVersion = 1;
constexpr const char* kFormat = "heft-model";

/// A JSON value that knows where it stands, so that every complaint names file and path.
class Node {
 public:
  Node(const Json& json, std::string file, std::string path)
      : json_(&json), file_(std::move(file)), path_(std::move(path)) {}

  [[noreturn]] void fail(const std::string& found, const std::string& expected) const {
    throw ModelError(
        fmt::format("{}: {}: {}; expected {}", file_, path_.empty() ? "/" : path_, found, expected));
  }
  bool has(const char* key) const { return json_->is_object() && json_->contains(key); }
  Node at(const char* key, const std::string& expected) const {
    expect_object();
    if (!json_->contains(key)) {
      throw ModelError(fmt::format("{}: {}/{}: missing; expected {}", file_, path_, key, expected));
    }
    return {(*json_)[key], file_, path_ + "/" + key};
  }
  Node at(std::size_t index) const { return {(*json_)[index], file_, fmt::format("{}/{}", path_, index)}; }
  std::size_t array_size(const std::string& expected) const {
    if (!json_->is_array()) fail(fmt::format("found {}", json_->type_name()), expected);
    return json_->size();
  }
  void expect_size(std::size_t size, const std::string& expected) const {
    if (const std::size_t found = array_size(expected); found != size) {
      fail(fmt::format("found {} entries", found), expected);
    }
  }
  void expect_object() const {
    if (!json_->is_object()) fail(fmt::format("found {}", json_->type_name()), "an object");
  }
  double number(bool null_is_nan = false) const {
    if (null_is_nan && json_->is_null()) return std::numeric_limits<double>::quiet_NaN();
    if (!json_->is_number()) fail(fmt::format("found {}", json_->dump()), "a number");
    const double value = json_->get<double>();
    if (!std::isfinite(value)) fail("found a number too large for double precision", "a finite number");
    return value;
  }
  double number_or_zero(const char* key) const { return has(key) ? at(key, "a number").number() : 0.0; }
  std::string text() const {
    if (!json_->is_string()) fail(fmt::format("found {}", json_->dump()), "a text");
    return json_->get<std::string>();
  }
  std::string text_or_empty(const char* key) const {
    return has(key) ? at(key, "a text").text() : std::string{};
  }
  std::vector<std::string> texts_or_empty(const char* key) const {
    std::vector<std::string> texts;
    if (!has(key)) return texts;
    const Node list = at(key, "a list of texts");
    for (std::size_t k = 0; k < list.array_size("a list of texts"); ++k) texts.push_back(list.at(k).text());
    return texts;
  }

 private:
  const Json* json_;
  std::string file_;
  std::string path_;
};

const std::set<std::string>& known_fields() {
  static const std::set<std::string> fields{"format",     "version",   "robot",
                                            "num_joints", "units",     "parameter_order",
                                            "links",      "joints",    "standard_deviations",
                                            "covariance", "provenance"};
  return fields;
}

std::string name_at(const std::vector<std::string>& names, std::size_t index) {
  return index < names.size() ? names[index] : std::string{};
}

Json number_or_null(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

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
  return model;
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
  for (std::size_t k = 0; k < robot.joints.size(); ++k) {
    robot.joints[k].link = model.links[k];
    robot.joints[k].actuation = model.actuation[k];
  }
}

ModelFile parse_model(const std::string& text, const std::string& path) {
  Json json;
  try {
    json = Json::parse(text);
  } catch (const Json::parse_error& error) {
    // The library's message starts with "[json.exception...] "; what follows names line and column.
    const std::string reason = error.what();
    const std::size_t end = reason.find("] ");
    throw ModelError(fmt::format("{}: not valid JSON: {}", path,
                                 end == std::string::npos ? reason : reason.substr(end + 2)));
  } catch (const Json::out_of_range& error) {
    throw ModelError(fmt::format("{}: a number is too large for double precision", path));
  }
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
  if (!others.empty()) model.other_fields = others.dump();
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
  return json.dump(1) + "\n";
}

void write_model(const std::string& path, const ModelFile& model) {
  host::write_file_atomically(path, to_json(model));
}

}  // namespace heft::model
