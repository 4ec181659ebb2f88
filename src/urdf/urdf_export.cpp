#include "heft/urdf/urdf_export.hpp"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <random>

#include <fmt/format.h>

#include "element_writer.hpp"
#include "export_checks.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "urdf_text.hpp"
#include "urdf_tree.hpp"

namespace heft::urdf {
namespace {

/// States on which the written file's torques are compared, and how near they must be.
constexpr int kComparedStates = 50;
constexpr double kTorqueTolerance = 1e-9;

UrdfOptions options_for(const model::Robot& robot, bool accept_impossible) {
  UrdfOptions options;
  options.base_link = robot.base_link;
  options.tip_link = robot.tip_link;
  options.accept_impossible_values = accept_impossible;
  return options;
}

/// The robot without what URDF has no tag for.
model::Robot without_untagged(model::Robot robot) {
  robot.couplings.clear();
  for (model::RobotJoint& joint : robot.joints) {
    joint.actuation.rotor_inertia = 0.0;
    joint.actuation.friction_offset = 0.0;
  }
  return robot;
}

bool has_untagged(const model::Robot& robot) {
  return !robot.couplings.empty() ||
         std::any_of(robot.joints.begin(), robot.joints.end(), [](const model::RobotJoint& joint) {
           return joint.actuation.rotor_inertia != 0.0 || joint.actuation.friction_offset != 0.0;
         });
}

/// Largest difference of the joint torques on random states, over the largest torque.
double torque_difference(const model::Robot& found, const model::Robot& expected) {
  const model::Dynamics a(found), b(expected);
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto vector = [&](double scale) -> Eigen::VectorXd {
    return Eigen::VectorXd::NullaryExpr(expected.num_joints(), [&] { return scale * uniform(random); });
  };
  double largest = 0.0, difference = 0.0;
  for (int k = 0; k < kComparedStates; ++k) {
    const Eigen::VectorXd q = vector(3.2), qd = vector(4.0), qdd = vector(20.0);
    const Eigen::VectorXd torque = b.joint_torque(q, qd, qdd);
    const Eigen::VectorXd error = a.joint_torque(q, qd, qdd) - torque;
    if (!error.allFinite()) return std::numeric_limits<double>::infinity();
    largest = std::max(largest, torque.cwiseAbs().maxCoeff());
    difference = std::max(difference, error.cwiseAbs().maxCoeff());
  }
  return difference == 0.0 ? 0.0 : difference / largest;
}

/// @throws Error when the robot read again moves differently.
double proven_torques(const model::Robot& found, const model::Robot& expected, const std::string& name) {
  const double difference = torque_difference(found, expected);
  if (!(difference <= kTorqueTolerance)) {
    throw Error(fmt::format(
        "{}: read again, its torques differ from the robot's by {:.3g} of the largest; expected "
        "within {:.0e}; nothing was written; this is a defect, or parameters so far from any body "
        "that mass and centre of mass cannot hold them",
        name, difference, kTorqueTolerance));
  }
  return difference;
}

}  // namespace

std::string urdf_with_parameters(const std::string& original_text, const std::string& name,
                                 const model::Robot& robot, const UrdfExportOptions& options,
                                 UrdfExportReport* report) {
  UrdfExportReport done;
  const model::Robot file = load_urdf_string(original_text, name, options_for(robot, true));
  check_same_chain(file, robot, name);
  const UrdfTree tree(original_text);
  check_values(robot, file, tree, name, options.allow_impossible, done.notes);

  ElementWriter writer(original_text, tree, done);
  for (std::size_t k = 0; k < robot.joints.size(); ++k) {
    const model::RobotJoint& there = file.joints[k];
    const model::RobotJoint& here = robot.joints[k];
    if (there.link != here.link) writer.write_link(here);
    if (there.actuation.coulomb_friction != here.actuation.coulomb_friction ||
        there.actuation.viscous_friction != here.actuation.viscous_friction) {
      writer.write_friction(here);
    }
  }
  std::string text = writer.result();

  model::Robot again = load_urdf_string(text, name, options_for(robot, options.allow_impossible));
  again.gravity = robot.gravity;
  done.torque_difference = proven_torques(again, without_untagged(robot), name);
  if (report != nullptr) *report = std::move(done);
  return text;
}

std::string side_file_of(const std::string& path_out) {
  if (host::named_descriptor(path_out)) return {};
  return std::filesystem::path(path_out).replace_extension(".heft.json").string();
}

void write_urdf(const std::string& original_path, const model::Robot& robot, const std::string& path_out,
                const UrdfExportOptions& options, UrdfExportReport* report) {
  UrdfExportReport done;
  const std::string text =
      urdf_with_parameters(read_urdf(original_path), original_path, robot, options, &done);

  const bool is_needed = has_untagged(robot) || options.model.has_value();
  const std::string side_file =
      options.side_file.value_or(is_needed ? side_file_of(path_out) : std::string());
  if (!side_file.empty()) {
    model::ModelFile model = model::make_model(robot);
    if (options.model) {
      model.standard_deviations = options.model->standard_deviations;
      model.covariance = options.model->covariance;
      model.fit = options.model->fit;
      model.provenance = options.model->provenance;
      model.other_fields = options.model->other_fields;
    }
    const std::string json = model::to_json(model);
    // The two files together must be the whole robot.
    model::Robot whole = load_urdf_string(text, path_out, options_for(robot, options.allow_impossible));
    whole.gravity = robot.gravity;
    model::apply(model::parse_model(json, side_file), whole);
    proven_torques(whole, robot, side_file);
    host::write_file_atomically(side_file, json);
    done.side_file = side_file;
    if (has_untagged(robot)) {
      done.notes.push_back(fmt::format(
          "rotor inertia, friction offset and gear couplings have no tag in a URDF; they are in {}",
          side_file));
    }
  } else if (has_untagged(robot)) {
    done.notes.push_back(
        "rotor inertia, friction offset and gear couplings have no tag in a URDF; they were not written");
  }
  try {
    host::write_file_atomically(path_out, text);
  } catch (...) {
    std::error_code ignored;
    if (!done.side_file.empty() && !host::named_descriptor(done.side_file))
      std::filesystem::remove(done.side_file, ignored);
    throw;
  }
  if (report != nullptr) *report = std::move(done);
}

}  // namespace heft::urdf
