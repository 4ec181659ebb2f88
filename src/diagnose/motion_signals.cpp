#include "motion_signals.hpp"

#include <array>
#include <cmath>

#include "heft/core/effects/hysteresis.hpp"
#include "heft/model/batch_dynamics.hpp"
#include "heft/regression/base_parameters.hpp"
#include "heft/regression/regression_columns.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Distances over which presliding was seen to turn over, a factor of about six apart [rad]; a prismatic joint's are
/// shorter, as its travel is.
constexpr std::array<double, 4> kMemories{0.001, 0.006, 0.03, 0.15};
constexpr double kPrismaticScale = 0.2;  ///< [m/rad]
constexpr double kSlow = 0.1;            ///< velocity over which a Stribeck peak falls, about [rad/s, m/s]

bool is_prismatic(const model::Robot& robot, Index joint) {
  return robot.joints[static_cast<std::size_t>(joint)].joint.type == JointType::kPrismatic;
}

/// Calls job(first, last) for the rows of each log.
template <typename Job>
void for_each_run(const MotionTable& table, const Job& job) {
  for (std::size_t r = 0; r + 1 < table.run_begin.size(); ++r)
    job(table.run_begin[r], table.run_begin[r + 1]);
}

MatrixXd memory_of(const model::Robot& robot, const MotionTable& table, double distance) {
  MatrixXd memory = MatrixXd::Zero(table.rows(), table.num_joints);
  for (Index j = 0; j < table.num_joints; ++j) {
    const double over = distance * (is_prismatic(robot, j) ? kPrismaticScale : 1.0);
    for_each_run(table, [&](Index first, Index last) {
      double z = 0.0;
      for (Index i = first; i < last; ++i) {
        const double moved = i > first ? table.q(i, j) - table.q(i - 1, j) : 0.0;
        z = Hysteresis::memory<double>({over, 0.0}, z, moved);
        memory(i, j) = z;
      }
    });
  }
  return memory;
}

/// Time since the velocity last changed its sign.
MatrixXd time_since_reversal(const MotionTable& table) {
  MatrixXd since = MatrixXd::Constant(table.rows(), table.num_joints, MotionSignals::kLongest);
  for (Index j = 0; j < table.num_joints; ++j) {
    for_each_run(table, [&](Index first, Index last) {
      for (Index i = first + 1; i < last; ++i) {
        const bool turned = table.qd(i, j) * table.qd(i - 1, j) < 0.0;
        since(i, j) =
            turned ? 0.0
                   : std::min(MotionSignals::kLongest, since(i - 1, j) + table.time[i] - table.time[i - 1]);
      }
    });
  }
  return since;
}

/// Terms of one joint beside the columns of the base parameters.
VectorXd plain_terms(const MotionTable& table, const MotionSignals& signals, Index row, Index joint) {
  const double q = table.q(row, joint), qd = table.qd(row, joint), sign = table.direction(row, joint);
  const double load = signals.load(row, joint);
  std::vector<double> own{1.0,
                          sign,
                          qd,
                          qd * std::abs(qd),
                          sign * std::sqrt(std::abs(qd)),
                          sign * std::exp(-std::abs(qd) / kSlow),
                          sign * std::abs(load),
                          sign * load,
                          std::abs(load) * qd,
                          load,
                          signals.load_rate(row, joint),
                          table.qdd(row, joint),
                          q,
                          q * q,
                          q * q * q,
                          sign * q,
                          qd * q};
  for (const MatrixXd& memory : signals.memory) {
    own.push_back(memory(row, joint));
    own.push_back(memory(row, joint) * std::abs(load));
  }
  for (Index k = 0; k < table.num_joints; ++k) {
    if (k == joint) continue;
    for (const double of_other : {table.direction(row, k), table.qd(row, k), table.qdd(row, k),
                                  table.q(row, k), signals.load(row, k)})
      own.push_back(of_other);
  }
  return Eigen::Map<const VectorXd>(own.data(), static_cast<Index>(own.size()));
}

/// Quantities that an unknown function of one joint's torque may ask for.
VectorXd features_of(const MotionTable& table, const MotionSignals& signals, Index row, Index joint) {
  std::vector<double> own{
      table.q(row, joint),           table.qd(row, joint),           table.qdd(row, joint),
      signals.load_rate(row, joint), signals.earlier_qd(row, joint), signals.since_reversal(row, joint)};
  for (const MatrixXd& memory : signals.memory) own.push_back(memory(row, joint));
  for (Index k = 0; k < table.num_joints; ++k) {
    own.push_back(signals.load(row, k));
    if (k == joint) continue;
    for (const double of_other : {table.q(row, k), table.qd(row, k), table.qdd(row, k)})
      own.push_back(of_other);
  }
  return Eigen::Map<const VectorXd>(own.data(), static_cast<Index>(own.size()));
}

}  // namespace

MatrixXd load_of(const model::Robot& robot, const MotionTable& table) {
  return model::BatchDynamics(robot).inverse_dynamics(table.q, table.qd, table.qdd);
}

MotionSignals signals_of(const model::Robot& robot, const MotionTable& table) {
  MotionSignals signals;
  signals.load = load_of(robot, table);
  signals.load_rate.setZero(table.rows(), table.num_joints);
  for_each_run(table, [&](Index first, Index last) {
    for (Index i = first + 1; i + 1 < last; ++i) {
      signals.load_rate.row(i) =
          (signals.load.row(i + 1) - signals.load.row(i - 1)) / (table.time[i + 1] - table.time[i - 1]);
    }
  });
  for (const double distance : kMemories) signals.memory.push_back(memory_of(robot, table, distance));
  signals.earlier_qd = earlier(table, table.qd, MotionSignals::kLag);
  signals.since_reversal = time_since_reversal(table);
  return signals;
}

std::vector<JointSignals> joint_signals(const model::Robot& robot, const MotionTable& table,
                                        const MotionSignals& signals, const std::vector<Index>& rows) {
  const regression::RegressionColumns columns(
      robot, {.rotor_inertia = false, .coulomb = false, .viscous = false, .offset = false, .couplings = {}});
  const regression::BaseParameters base = regression::find_base_parameters(columns);
  const auto m = static_cast<Index>(rows.size());
  std::vector<JointSignals> joints(static_cast<std::size_t>(table.num_joints));
  for (Index i = 0; i < m; ++i) {
    const Index row = rows[static_cast<std::size_t>(i)];
    const MatrixXd Y = columns.regressor(table.q.row(row).transpose(), table.qd.row(row).transpose(),
                                         table.qdd.row(row).transpose())(Eigen::all, base.kept);
    for (Index j = 0; j < table.num_joints; ++j) {
      JointSignals& joint = joints[static_cast<std::size_t>(j)];
      const VectorXd plain = plain_terms(table, signals, row, j),
                     features = features_of(table, signals, row, j);
      if (i == 0) {
        joint.terms.resize(m, Y.cols() + plain.size());
        joint.features.resize(m, features.size());
      }
      joint.terms.row(i) << Y.row(j), plain.transpose();
      joint.features.row(i) = features.transpose();
    }
  }
  return joints;
}

}  // namespace heft::diagnose
