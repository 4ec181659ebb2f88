#include "heft/identify/fit_record.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace heft::identify {

using Eigen::Index;

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
