#include "heft/identify/fit_record.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "heft/host/numbers.hpp"

namespace heft::identify {

using Eigen::Index;

namespace {

/// Place of a regression column among the 14 n parameters of a model file; -1: not one of them.
int place_of(const regression::Column& column, int num_joints) {
  const auto in_block = [&](int block) { return (kParametersPerLink + block) * num_joints + column.joint; };
  switch (column.kind) {
    case regression::ColumnKind::kLink: return kParametersPerLink * column.joint + column.entry;
    case regression::ColumnKind::kRotorInertia: return in_block(0);
    case regression::ColumnKind::kCoulomb: return in_block(1);
    case regression::ColumnKind::kViscous: return in_block(2);
    case regression::ColumnKind::kOffset: return in_block(3);
    case regression::ColumnKind::kCouplingInertia:
    case regression::ColumnKind::kCouplingCoulomb:
    case regression::ColumnKind::kCouplingViscous: return -1;
  }
  return -1;
}

/// Of the parameters that are base parameters by themselves; NaN for all others: what is felt only together with other
/// parameters, or was not determined, has no spread of its own that the logs could show.
Eigen::VectorXd standard_deviations_of(const Fit& fit) {
  const int n = fit.columns->num_joints();
  Eigen::VectorXd deviations = Eigen::VectorXd::Constant(14 * Eigen::Index{n}, kNaN);
  for (int i = 0; i < fit.base.count(); ++i) {
    const bool alone = (fit.base.regrouping.row(i).array() != 0.0).count() == 1;
    const int place = place_of((*fit.columns)[fit.base.kept[static_cast<std::size_t>(i)]], n);
    if (alone && place >= 0 && fit.determined[static_cast<std::size_t>(i)]) deviations[place] = fit.std[i];
  }
  return deviations;
}

}  // namespace

model::ModelFile Fit::model_file() const {
  model::ModelFile file = model::make_model(robot);
  file.provenance.method = to_string(method);
  file.standard_deviations = standard_deviations_of(*this);
  return file;
}

model::FitRecord fit_record(const Fit& fit, const std::string& torque_at, const validate::Score* training) {
  model::FitRecord record;
  record.method = to_string(fit.method);
  record.torque_at = torque_at;
  for (int i = 0; i < fit.base.count(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    record.base_parameters.push_back({fit.base.name(*fit.columns, i), (*fit.columns)[fit.base.kept[at]].unit,
                                      fit.base.expressions[at], fit.beta[i], fit.std[i], fit.half_width[i],
                                      fit.determined[at]});
  }
  record.parameter_covariance = 0.5 * (fit.covariance + fit.covariance.transpose());
  record.condition_number = fit.condition;
  record.physically_consistent = fit.physically_consistent;
  record.physical_cost_ratio = fit.physical_cost_ratio;
  record.noise_std = fit.noise_std;
  record.samples = fit.samples;
  record.missing = fit.missing;
  if (training != nullptr) validate::put_training(*training, record);
  return record;
}

Eigen::VectorXd torque_shares(const Fit& fit, const Eigen::VectorXd& beta, const data::MotionStream& log) {
  const data::StreamSummary& summary = log.summary();
  const Index n = fit.columns->num_joints();
  const Index b = static_cast<Index>(fit.base.kept.size());
  Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(n, b);
  Eigen::VectorXd whole = Eigen::VectorXd::Zero(n);
  // Shares need no more than some thousand instants.
  const Index step = std::max<Index>(1, static_cast<Index>(summary.samples / 4000));
  log.for_each([&](const data::MotionChunk& piece) {
    for (Index k = (step - piece.first % step) % step; k < piece.count; k += step) {
      const Index row = piece.begin + k;
      const Eigen::MatrixXd Y =
          fit.columns->regressor(piece.q.row(row), piece.qd.row(row), piece.qdd.row(row));
      Eigen::VectorXd torque = Eigen::VectorXd::Zero(n);
      for (Index i = 0; i < b; ++i) {
        const Eigen::VectorXd part = Y.col(fit.base.kept[static_cast<std::size_t>(i)]) * beta[i];
        squares.col(i) += part.cwiseAbs2();
        torque += part;
      }
      whole += torque.cwiseAbs2();
    }
  });
  Eigen::VectorXd shares(b);
  for (Index i = 0; i < b; ++i) {
    double largest = 0.0;
    for (Index j = 0; j < n; ++j) {
      if (whole[j] > 0) largest = std::max(largest, std::sqrt(squares(j, i) / whole[j]));
    }
    shares[i] = largest;
  }
  return shares;
}

int CountedParameters::count() const {
  return static_cast<int>(std::count(counted.begin(), counted.end(), true));
}

CountedParameters counted_parameters(const Fit& fit, const Eigen::VectorXd& shares, double share) {
  CountedParameters result;
  for (Index i = 0; i < shares.size(); ++i) {
    std::string reason;
    if (!fit.determined[static_cast<std::size_t>(i)]) {
      reason = "the log does not determine it";
    } else if (!(shares[i] >= share)) {
      reason = fmt::format("moves at most {:.2g} % of a joint's torque", 100.0 * shares[i]);
    }
    result.counted.push_back(reason.empty());
    result.reasons.push_back(reason);
  }
  return result;
}

}  // namespace heft::identify
