#include "heft/identify/sums.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "heft/host/hash.hpp"
#include "heft/regression/recorded_rows.hpp"
#include "heft/regression/weighted_fit.hpp"
#include "sums_checks.hpp"

namespace heft::identify {
namespace {

using regression::ModelStructure;

bool same_settings(const Sums& a, const Sums& b) {
  const regression::ObservationOptions &x = a.observation, &y = b.observation;
  return a.torque_at == b.torque_at && x.cutoff == y.cutoff && x.rows_per_cutoff == y.rows_per_cutoff &&
         x.standstill_speed == y.standstill_speed;
}

/// One pass for the triangles, one for the correlation of the residual that the log's own fit leaves.
Sums sums_of_log(const regression::RegressionColumns& columns, const regression::BaseParameters& base,
                 const data::MotionStream& log, const Sums& settings, const Options& options) {
  const std::vector<const data::MotionStream*> only{&log};
  LogShare share{log.summary(), key_of(log.summary()), {}, options.torque};
  share.summary.gaps.clear();
  regression::RecordedRows record;
  regression::WeightedFit own(regression::compressed(columns, base, only, settings.observation, {share.key}, &record));
  regression::weigh_joints(base.regrouping * columns.values(columns.robot()),
                           options.fit.ridge_from_condition, true, own);
  share.correlation_time =
      regression::residual_correlation(columns, base, only, settings.observation, own.solution.beta, record);
  Sums sums = settings;
  sums.logs = {std::move(share)};
  sums.factors = std::move(own.factors);
  return sums;
}

}  // namespace

std::uint64_t geometry_of(const model::Robot& robot, const ModelStructure& structure) {
  std::uint64_t hash = host::combine_all(static_cast<std::uint64_t>(robot.num_joints()), robot.gravity);
  for (const model::RobotJoint& joint : robot.joints) {
    hash = host::combine(hash, static_cast<std::uint64_t>(joint.joint.type));
    hash = host::combine_all(hash, joint.joint.rotation);
    hash = host::combine_all(hash, joint.joint.position);
    hash = host::combine_all(hash, joint.joint.axis);
  }
  for (const bool column : {structure.rotor_inertia, structure.coulomb, structure.viscous, structure.offset})
    hash = host::combine(hash, column ? 1U : 0U);
  for (const GearCoupling<double>& coupling : structure.couplings) {
    hash = host::combine_all(hash, std::vector<double>{static_cast<double>(coupling.driving),
                                                       static_cast<double>(coupling.driven), coupling.ratio});
  }
  return hash;
}

void refuse_other_robot(const model::Robot& robot, const Sums& sums) {
  if (sums.logs.empty()) throw DataError("sums: no log in them; expected at least one");
  if (geometry_of(robot, sums.structure) == sums.geometry) return;
  throw DataError(fmt::format(
      "sums: made for robot \"{}\" of {} joints with other joint frames or gravity than robot \"{}\" of {} joints; "
      "expected the same geometry to the last digit; make the sums with the robot description that is fitted",
      sums.robot, sums.factors.num_joints(), robot.name, robot.num_joints()));
}

long key_of(const data::StreamSummary& log) {
  std::uint64_t hash = static_cast<std::uint64_t>(log.samples);
  for (const Eigen::VectorXd* part : {&log.travel, &log.top_speed, &log.max_torque})
    hash = host::combine_all(hash, *part);
  return static_cast<long>(hash >> 2U);
}

void refuse_fitted_logs(const Sums& sums, const std::vector<data::StreamSummary>& judged) {
  for (const data::StreamSummary& log : judged) {
    for (const LogShare& fitted : sums.logs) {
      if (fitted.key != key_of(log)) continue;
      throw DataError(fmt::format(
          "{}: is in the sums that the model is fitted to (there as {}); expected a log that the fit has not seen",
          log.path, fitted.summary.path));
    }
  }
}

Sums sums_of(const model::Robot& robot, const data::LogSet& logs, const Options& options) {
  Sums all;
  all.robot = robot.name;
  all.torque_at = logs.torque_at();
  all.structure = options.fit.structure;
  if (all.torque_at == data::TorqueAt::kJoint) all.structure.rotor_inertia = false;
  all.observation = options.fit.observation;
  all.observation.cutoff = logs.cutoff();
  all.geometry = geometry_of(robot, all.structure);
  const regression::RegressionColumns columns(robot, all.structure);
  const regression::BaseParameters base = regression::find_base_parameters(columns);
  const Sums settings = all;
  double done = 0.0;
  for (const data::LogSource& log : logs.train()) {
    const Sums one = sums_of_log(columns, base, data::stream(log), settings, options);
    all = all.logs.empty() ? one : merged(std::move(all), one);
    done += 1.0 / static_cast<double>(logs.train().size());
    if (options.progress) options.progress("reading " + log.path, std::min(done, 1.0));
  }
  return all;
}

Sums merged(Sums a, const Sums& b) {
  if (a.geometry != b.geometry) {
    throw DataError(fmt::format(
        "sums: made for robot \"{}\" and for robot \"{}\", whose joint frames, gravity or parameters differ; expected "
        "one robot; merge the sums of each robot by themselves",
        a.robot, b.robot));
  }
  if (!same_settings(a, b)) {
    throw DataError(fmt::format(
        "sums: made with torque at the {} behind {:g} Hz and with torque at the {} behind {:g} Hz (0: chosen for "
        "each log); expected the same settings; make them anew",
        data::to_string(a.torque_at), a.observation.cutoff, data::to_string(b.torque_at),
        b.observation.cutoff));
  }
  const auto by_key = [](const LogShare& x, const LogShare& y) { return x.key < y.key; };
  for (const LogShare& log : b.logs) {
    const auto place = std::lower_bound(a.logs.begin(), a.logs.end(), log, by_key);
    if (place != a.logs.end() && place->key == log.key) {
      throw DataError(fmt::format(
          "{}: is in both of the sums to merge{}; expected each log once, since one that counts twice narrows the "
          "intervals; leave it out of one of them",
          log.summary.path,
          place->summary.path == log.summary.path ? "" : " (there as " + place->summary.path + ")"));
    }
    a.logs.insert(place, log);
  }
  a.factors.add(b.factors);
  return a;
}

}  // namespace heft::identify
