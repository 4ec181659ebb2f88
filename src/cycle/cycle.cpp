#include "heft/cycle/cycle.hpp"

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "heft/model/at_sensor.hpp"
#include "heft/model/model_file.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "sized_cycle.hpp"

namespace heft::cycle {
namespace {

struct Loaded {
  model::Robot robot;
  std::optional<model::ModelFile> file;
};

model::Robot robot_in_urdf(const Parameters& parameters) {
  const urdf::UrdfOptions options{.base_link = parameters.base_link, .tip_link = parameters.tip_link};
  const std::size_t first = parameters.urdf.find_first_not_of(" \t\r\n");
  if (first != std::string::npos && parameters.urdf[first] == '<')
    return urdf::load_urdf_string(parameters.urdf, "robot description", options);
  return urdf::load_urdf(urdf::resolve_robot(parameters.urdf), options);
}

Loaded load(const Parameters& parameters) {
  if (parameters.urdf.empty() && parameters.model.empty())
    throw InputError("parameters: found neither 'urdf' nor 'model'; expected one of them or both");
  Loaded loaded;
  if (!parameters.model.empty()) loaded.file = model::read_model(parameters.model);
  if (parameters.urdf.empty()) {
    loaded.robot = model::make_robot(*loaded.file);
  } else {
    loaded.robot = robot_in_urdf(parameters);
    if (loaded.file) model::apply(*loaded.file, loaded.robot);
  }
  return loaded;
}

std::optional<monitor::Thresholds> thresholds_in(const Loaded& loaded) {
  std::optional<monitor::Thresholds> thresholds =
      loaded.file ? monitor::thresholds_of(*loaded.file) : std::nullopt;
  if (thresholds && thresholds->joints.size() != loaded.robot.joints.size()) {
    throw ModelError(fmt::format(
        "{}: thresholds of contacts: found {} joints; expected {}, as robot \"{}\" has", loaded.file->path,
        thresholds->joints.size(), loaded.robot.joints.size(), loaded.robot.name));
  }
  return thresholds;
}

}  // namespace

model::Robot robot_of(const Parameters& parameters) { return load(parameters).robot; }

Cycle::Cycle() = default;
Cycle::~Cycle() = default;
Cycle::Cycle(Cycle&&) noexcept = default;
Cycle& Cycle::operator=(Cycle&&) noexcept = default;

Status Cycle::configure(const Parameters& parameters) {
  try {
    const Loaded loaded = load(parameters);
    const model::FitRecord* fit = loaded.file && loaded.file->fit ? &*loaded.file->fit : nullptr;
    const model::Robot measured = model::as_measured(loaded.robot, parameters.torque_behind_gears, fit);
    sized_ = make_sized(loaded.robot, measured, thresholds_in(loaded), parameters.follow_load);
    joint_names_.clear();
    for (const model::RobotJoint& joint : loaded.robot.joints) joint_names_.push_back(joint.name);
    message_.clear();
    return Status::kOk;
  } catch (const Error& error) {
    message_ = error.what();
    return Status::kOutOfRange;
  }
}

int Cycle::num_joints() const noexcept { return sized_ ? sized_->num_joints() : 0; }

bool Cycle::watches_contacts() const noexcept { return sized_ && sized_->watches_contacts(); }

void Cycle::reset() noexcept {
  if (sized_) sized_->reset();
}

Status Cycle::inverse_dynamics(std::span<const double> q, std::span<const double> qd,
                               std::span<const double> qdd, double period, std::span<double> tau) noexcept {
  if (!sized_) return Status::kNotConfigured;
  const auto n = static_cast<std::size_t>(sized_->num_joints());
  if (q.size() != n || qd.size() != n || qdd.size() != n || tau.size() != n) return Status::kOutOfRange;
  return sized_->inverse_dynamics(q.data(), qd.data(), qdd.data(), period, tau.data());
}

Status Cycle::update(std::span<const double> q, std::span<const double> qd, std::span<const double> tau,
                     double period, Output& out) noexcept {
  if (!sized_) return Status::kNotConfigured;
  const auto n = static_cast<std::size_t>(sized_->num_joints());
  if (q.size() != n || qd.size() != n || tau.size() != n) return Status::kOutOfRange;
  return sized_->update(q.data(), qd.data(), tau.data(), period, out);
}

}  // namespace heft::cycle
