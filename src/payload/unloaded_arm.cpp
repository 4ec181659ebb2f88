#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "heft/drive/torque_constants.hpp"
#include "heft/host/error.hpp"
#include "heft/payload/payload.hpp"
#include "host/json.hpp"
#include "payload_run.hpp"
#include "recursive_fit.hpp"
#include "runs.hpp"

namespace heft::payload {
namespace {

/// Field of the model file that holds ResidualStatistics.
constexpr const char* kResidualField = "residual";
/// Field of the model file that holds the torque scale of the joints.
constexpr const char* kScaleField = "drive_scale";
/// Standard deviation of the torque scale of a joint that the logs do not show [1]: data sheets are good to a tenth, 95 %.
constexpr double kUnknownScale = 0.05;
/// A scale that is further from 1 than this is no error of a torque constant: the target torque is something else [1].
constexpr double kScaleLimit = 0.25;

std::string shown(const nlohmann::ordered_json& json) {
  return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

Eigen::VectorXd numbers(const nlohmann::ordered_json& json, const char* key, int size,
                        const std::string& path) {
  const auto list = json.value(key, nlohmann::ordered_json());
  if (!list.is_array() || list.size() != static_cast<std::size_t>(size)) {
    throw ModelError(
        fmt::format("{}: /{}/{}: expected {} numbers, one a joint", path, kResidualField, key, size));
  }
  Eigen::VectorXd values(size);
  for (int i = 0; i < size; ++i) {
    const auto& entry = list[static_cast<std::size_t>(i)];
    if (!entry.is_number() || !(entry.get<double>() > 0)) {
      throw ModelError(fmt::format("{}: /{}/{}/{}: found {}; expected a number above 0", path, kResidualField,
                                   key, i, shown(entry)));
    }
    values[i] = entry.get<double>();
  }
  return values;
}

/// The residual that a fit of heft wrote; nothing for models from elsewhere.
std::optional<statistics::ResidualStatistics> residual_of(const model::ModelFile& file) {
  if (file.other_fields.empty()) return std::nullopt;
  const auto others = nlohmann::ordered_json::parse(file.other_fields);
  if (!others.contains(kResidualField)) return std::nullopt;
  const auto& json = others[kResidualField];
  if (!json.is_object()) {
    throw ModelError(fmt::format("{}: /{}: found {}; expected an object, as heft payload writes it",
                                 file.path, kResidualField, shown(json)));
  }
  statistics::ResidualStatistics residual;
  residual.std = numbers(json, "std", file.num_joints(), file.path);
  residual.correlation_time = numbers(json, "correlation_time", file.num_joints(), file.path);
  const auto cutoff = json.value("cutoff_hz", nlohmann::ordered_json());
  if (!cutoff.is_number() || !(cutoff.get<double>() > 0)) {
    throw ModelError(fmt::format("{}: /{}/cutoff_hz: expected a number above 0", file.path, kResidualField));
  }
  residual.cutoff = cutoff.get<double>();
  return residual;
}

/// The error of the torque constants, where logs without load hold the controller's target torque.
std::vector<statistics::Interval> scales_of(std::vector<data::LogSource> logs,
                                            const std::vector<data::LogSource>& zeros, const Options& options,
                                            std::vector<std::string>& notes) {
  if (options.torque_at == data::TorqueAt::kJoint) return {};
  logs.insert(logs.end(), zeros.begin(), zeros.end());
  const std::vector<statistics::Interval> found = drive::torque_scales(logs);
  std::vector<statistics::Interval> scales;
  bool any = false;
  for (std::size_t j = 0; j < found.size(); ++j) {
    const bool known = std::isfinite(found[j].value);
    if (known && std::abs(found[j].value - 1.0) > kScaleLimit) {
      notes.push_back(fmt::format(
          "joint {}: the measured torque is {:.2f} times the target torque (tauref{}), more than an error of a torque constant; "
          "target torques are not used",
          j + 1, found[j].value, j + 1));
      return {};
    }
    any = any || known;
    scales.push_back(known ? found[j] : statistics::Interval::around(1.0, kUnknownScale));
  }
  return any ? scales : std::vector<statistics::Interval>{};
}

/// The scales that an earlier fit wrote; empty: it wrote none.
std::vector<statistics::Interval> scales_of(const model::ModelFile& file) {
  if (file.other_fields.empty()) return {};
  const auto others = nlohmann::ordered_json::parse(file.other_fields);
  if (!others.contains(kScaleField)) return {};
  const host::JsonValue field(others[kScaleField], file.path, fmt::format("/{}", kScaleField));
  const auto n = static_cast<std::size_t>(file.num_joints());
  const Eigen::VectorXd value = field.numbers_or_none("value", n), std = field.numbers_or_none("std", n);
  std::vector<statistics::Interval> scales;
  for (Eigen::Index j = 0; j < value.size(); ++j) {
    if (!(value[j] > 0.0) || std.size() != value.size() || !(std[j] >= 0.0)) {
      throw ModelError(fmt::format("{}: /{}: expected \"value\" above 0 and \"std\" not below 0, one a joint",
                                   file.path, kScaleField));
    }
    scales.push_back(statistics::Interval::around(value[j], std[j]));
  }
  return scales;
}

RecursiveFit fit(const model::Robot& robot, const std::vector<data::Log>& logs, const Options& options,
                 const std::string& what) {
  RecursiveFitOptions how;
  how.cutoff = options.cutoff;
  how.torque_at_joint = options.torque_at == data::TorqueAt::kJoint;
  if (options.progress) how.progress = [&](double done) { options.progress(what, done); };
  RecursiveFit result = fit_recursively(robot, logs, how);
  if (!result.missing.empty()) {
    std::string names;
    for (const data::Log& log : logs) names += fmt::format("{}{}", names.empty() ? "" : ", ", log.path);
    throw NotIdentifiableError(fmt::format("{}: no model can be fitted: {}", names, result.missing.front()));
  }
  return result;
}

void take(UnloadedArm& arm, const RecursiveFit& fitted) {
  arm.residual = fitted.residual;
  arm.covariance = fitted.model.covariance;
  arm.record = fitted.model.fit;
  model::apply(fitted.model, arm.robot);
}

void check_zero(UnloadedArm& result, const UnloadedArm& arm, const data::Log& log, const Options& options) {
  const PayloadRun run = run_payload(as_measured(arm, options), log, run_options(arm, log, options, 0.0));
  if (!run.mass.identifiable) {
    result.notes.push_back(fmt::format("{}: cannot serve as a zero check: {}", log.path, run.missing));
    return;
  }
  result.zero_checks.push_back({log.path, run.mass});
}

/// Sets the logs without load, and looks for a load on those that the fit has not seen.
void check_zeros(UnloadedArm& arm, const data::LogSet& logs, std::size_t zeros, const Options& options) {
  arm.logs = logs.train();
  const auto end = logs.judge().begin() + static_cast<std::ptrdiff_t>(std::min(zeros, logs.judge().size()));
  arm.zeros.assign(logs.judge().begin(), end);
  if (arm.drive_scale.empty()) arm.drive_scale = scales_of(arm.logs, arm.zeros, options, arm.notes);
  for (const data::LogSource& zero : arm.zeros) {
    check_zero(arm, arm, data::read(zero, &arm.notes), options);
  }
}

}  // namespace

double UnloadedArm::zero_mass_std() const {
  double sum = 0.0;
  for (const auto& [log, mass] : zero_checks) sum += mass.value * mass.value - mass.std * mass.std;
  return zero_checks.empty() ? 0.0 : std::sqrt(std::max(0.0, sum / static_cast<double>(zero_checks.size())));
}

model::ModelFile UnloadedArm::model_file() const {
  if (!fit) throw Error("payload: the unloaded arm came from a file; expected one that was fitted");
  model::ModelFile file = fit->model;
  nlohmann::ordered_json others = file.other_fields.empty()
                                      ? nlohmann::ordered_json::object()
                                      : nlohmann::ordered_json::parse(file.other_fields);
  others[kResidualField] = {{"std", host::json_array(fit->residual.std)},
                            {"correlation_time", host::json_array(fit->residual.correlation_time)},
                            {"cutoff_hz", fit->residual.cutoff}};
  if (!drive_scale.empty()) {
    Eigen::VectorXd value(static_cast<Eigen::Index>(drive_scale.size())), std = value;
    for (std::size_t j = 0; j < drive_scale.size(); ++j) {
      value[static_cast<Eigen::Index>(j)] = drive_scale[j].value;
      std[static_cast<Eigen::Index>(j)] = drive_scale[j].std;
    }
    others[kScaleField] = {{"value", host::json_array(value)}, {"std", host::json_array(std)}};
  }
  file.other_fields = shown(others);
  return file;
}

UnloadedArm fit_unloaded(const model::Robot& robot, const data::LogSet& logs, std::size_t zeros,
                         const Options& options) {
  UnloadedArm arm;
  arm.robot = robot;
  std::vector<data::Log> baselines;
  for (const data::LogSource& source : logs.train()) {
    baselines.push_back(data::read(source, &arm.notes));
  }
  arm.fit = fit(robot, baselines, options, "fitting the arm without load");
  take(arm, *arm.fit);
  check_zeros(arm, logs, zeros, options);
  if (!arm.zeros.empty() || baselines.size() < 2) return arm;
  // Each log by the model of the others.
  for (std::size_t left_out = 0; left_out < baselines.size(); ++left_out) {
    std::vector<data::Log> others;
    for (std::size_t l = 0; l < baselines.size(); ++l) {
      if (l != left_out) others.push_back(baselines[l]);
    }
    UnloadedArm of_others;
    of_others.robot = robot;
    of_others.drive_scale = arm.drive_scale;
    take(of_others, fit(robot, others, options, "zero check"));
    check_zero(arm, of_others, baselines[left_out], options);
  }
  return arm;
}

UnloadedArm arm_from_file(const model::Robot& robot, const model::ModelFile& file, const data::LogSet& logs,
                          std::size_t zeros, const Options& options) {
  UnloadedArm arm;
  data::refuse_seen(logs, file.provenance.logs, &arm.notes);
  arm.robot = robot;
  arm.record = file.fit;
  arm.model_file_path = file.path;
  arm.residual = residual_of(file);
  arm.drive_scale = scales_of(file);
  if (file.covariance && file.covariance->allFinite()) arm.covariance = file.covariance;
  check_zeros(arm, logs, zeros, options);
  return arm;
}

}  // namespace heft::payload
