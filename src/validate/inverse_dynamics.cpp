#include "heft/validate/inverse_dynamics.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "heft/model/batch_dynamics.hpp"
#include "heft/validate/predict.hpp"

namespace heft::validate {
namespace {

using Eigen::Index;

std::vector<std::string> regressor_columns(int num_joints, bool with_actuation) {
  static constexpr std::array<const char*, 10> kLink{"m",   "mcx", "mcy", "mcz", "Ixx",
                                                     "Ixy", "Iyy", "Ixz", "Iyz", "Izz"};
  static constexpr std::array<const char*, 4> kActuation{"rotor", "coulomb", "viscous", "offset"};
  std::vector<std::string> columns;
  for (int row = 1; row <= num_joints; ++row) {
    for (int link = 1; link <= num_joints; ++link) {
      for (const char* name : kLink) columns.push_back(fmt::format("Y{}_{}{}", row, name, link));
    }
    if (!with_actuation) continue;
    for (const char* name : kActuation) {
      for (int joint = 1; joint <= num_joints; ++joint)
        columns.push_back(fmt::format("Y{}_{}{}", row, name, joint));
    }
  }
  return columns;
}

std::vector<std::string> columns_of(DynamicsQuantity what, int num_joints, bool with_actuation) {
  if (what == DynamicsQuantity::kRegressor) return regressor_columns(num_joints, with_actuation);
  std::vector<std::string> columns;
  for (int j = 1; j <= num_joints; ++j)
    columns.push_back(fmt::format("{}{}", what == DynamicsQuantity::kGravity ? "g" : "tau", j));
  return columns;
}

void refuse_not_finite(const data::Log& log, const Eigen::MatrixXd& values) {
  for (Index k = 0; k < values.rows(); ++k) {
    if (values.row(k).allFinite()) continue;
    throw DataError(fmt::format(
        "{}: row {} (time {} s): the result is not finite; expected finite torques from this motion; "
        "check position, velocity and acceleration there, and lengths, times and speeds among the "
        "model's effects",
        log.path, k + 1, log.time[k]));
  }
}

/// The gravity torque or the regressor of every row; a row of a regressor is its rows one after the other.
Eigen::MatrixXd rows_of(const model::BatchDynamics& dynamics, const data::Log& log, bool gravity,
                        Index columns, const std::function<void(double)>& progress) {
  /// Rows at a time: their regressors stay in the processor's cache until they are where they belong.
  constexpr Index kBlock = 128;
  const Index n = dynamics.num_joints(), width = columns / n, count = log.num_samples();
  std::vector<int> wanted(static_cast<std::size_t>(width));
  std::iota(wanted.begin(), wanted.end(), 0);
  const std::vector<std::vector<int>> wanted_of_joints(static_cast<std::size_t>(n), wanted);
  Eigen::MatrixXd values(count, columns);
  model::RegressorRows block;
  for (Index first = 0; first < count; first += kBlock) {
    progress(static_cast<double>(first) / static_cast<double>(count));
    const Index size = std::min(kBlock, count - first);
    const auto q = log.q.middleRows(first, size);
    if (gravity) {
      values.middleRows(first, size) = dynamics.gravity_torque(q);
      continue;
    }
    dynamics.regressor_rows(q, log.qd.middleRows(first, size), log.qdd.middleRows(first, size),
                            wanted_of_joints, block);
    for (Index j = 0; j < n; ++j)
      values.block(first, j * width, size, width) = block[static_cast<std::size_t>(j)];
  }
  return values;
}

LogDynamics along_one(const model::Robot& robot, const model::BatchDynamics& dynamics,
                      const data::LogSource& source, Index columns, const DynamicsOptions& options,
                      const std::function<void(double)>& progress, std::vector<std::string>& notes) {
  const bool gravity = options.what == DynamicsQuantity::kGravity;
  data::MotionLog motion = data::read_motion(source, !gravity, &notes);
  LogDynamics result{std::move(motion.log), {}};
  if (options.what == DynamicsQuantity::kTorque) {
    // The torque of this very motion, sharp at reversals: what rests has no friction.
    result.values = predict(robot, result.log, motion.motion, {.sign_width = 0.0});
  } else {
    result.values = rows_of(dynamics, result.log, gravity, columns, progress);
  }
  refuse_not_finite(result.log, result.values);
  if (options.what == DynamicsQuantity::kTorque && result.log.tau.cols() == columns)
    result.score = score(result.log, result.values, options.band);
  return result;
}

}  // namespace

const char* to_string(DynamicsQuantity what) {
  switch (what) {
    case DynamicsQuantity::kTorque: return "torque";
    case DynamicsQuantity::kGravity: return "gravity";
    case DynamicsQuantity::kRegressor: return "regressor";
  }
  return "?";
}

Eigen::VectorXd LogDynamics::largest() const { return values.cwiseAbs().colwise().maxCoeff(); }

InverseDynamics inverse_dynamics_along(const model::Robot& robot, const data::LogSet& logs,
                                       const DynamicsOptions& options) {
  const model::BatchDynamics dynamics(robot);
  InverseDynamics result{robot.name, options.what, logs.torque_at(), {}, {}, {}};
  result.columns =
      columns_of(options.what, dynamics.num_joints(), logs.torque_at() == data::TorqueAt::kMotor);
  const auto columns = static_cast<Index>(result.columns.size());
  for (const data::LogSource& source : logs.judge()) {
    const auto before = static_cast<double>(result.logs.size());
    const auto progress = [&](double done) {
      if (options.progress)
        options.progress(source.path, (before + done) / static_cast<double>(logs.judge().size()));
    };
    progress(0.0);
    result.logs.push_back(along_one(robot, dynamics, source, columns, options, progress, result.notes));
  }
  return result;
}

}  // namespace heft::validate
