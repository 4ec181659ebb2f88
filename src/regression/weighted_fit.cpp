#include "heft/regression/weighted_fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "heft/host/decompositions.hpp"
#include "heft/host/parallel.hpp"
#include "heft/regression/block_groups.hpp"
#include "heft/regression/recorded_rows.hpp"
#include "heft/regression/scaled_svd.hpp"
#include "heft/statistics/jackknife.hpp"
#include "heft/statistics/residual_moments.hpp"

namespace heft::regression {

Solution solve(const TriangularFactor& data, const Eigen::VectorXd& prior, double ridge_from) {
  const auto [scale, svd] = scaled_svd(data.R());
  const double largest = svd.values[0];
  const double smallest = svd.values[svd.values.size() - 1];
  Solution s;
  s.scale = scale;
  s.condition = smallest > 0.0 ? largest / smallest : std::numeric_limits<double>::infinity();
  if (ridge_from > 0.0 && s.condition > ridge_from) s.ridge = std::pow(largest / ridge_from, 2);
  // In y = S β: z − R β₀ = U Σ Vᵀ (y − y₀).
  const Eigen::VectorXd right_side = svd.U.transpose() * (data.z() - data.R() * prior);
  Eigen::VectorXd step = Eigen::VectorXd::Zero(svd.values.size());
  Eigen::VectorXd share = step;
  for (Eigen::Index i = 0; i < step.size(); ++i) {
    const double sigma = svd.values[i];
    if (sigma <= 1e-13 * largest) continue;
    step[i] = sigma * right_side[i] / (sigma * sigma + s.ridge);
    share[i] = sigma * sigma / (sigma * sigma + s.ridge);
  }
  s.resolution = svd.V.cwiseAbs2() * share;
  s.beta = prior + (svd.V * step).cwiseQuotient(s.scale);
  return s;
}

Eigen::VectorXd estimate(const TriangularFactor& data, const Eigen::VectorXd& prior, double ridge_from) {
  const Eigen::MatrixXd R = data.R();
  const Eigen::VectorXd scale = column_norms(R);
  const Eigen::MatrixXd scaled = (R * scale.cwiseInverse().asDiagonal()).transpose();
  Eigen::MatrixXd inverse = Eigen::MatrixXd::Identity(R.cols(), R.cols());
  solve_lower(scaled, inverse);
  // κ ≤ ‖R̃‖ ‖R̃⁻¹‖ in Frobenius norms; not a number where the rows leave a parameter open.
  if (scaled.norm() * inverse.norm() < ridge_from) return (inverse.transpose() * data.z()).cwiseQuotient(scale);
  return solve(data, prior, ridge_from).beta;
}

Eigen::VectorXd noise_of(const std::vector<TriangularFactor>& joints, const Eigen::VectorXd& beta) {
  Eigen::VectorXd noise(static_cast<Eigen::Index>(joints.size()));
  double all_rows = 0.0;
  for (const TriangularFactor& joint : joints) all_rows += static_cast<double>(joint.rows());
  for (Eigen::Index j = 0; j < noise.size(); ++j) {
    const TriangularFactor& joint = joints[static_cast<std::size_t>(j)];
    const auto rows = static_cast<double>(joint.rows());
    const double freedom =
        std::max(1.0, rows * (1.0 - static_cast<double>(beta.size()) / std::max(all_rows, 1.0)));
    noise[j] = rows > 0.0 ? std::sqrt(joint.squared_error(beta) / freedom) : 0.0;
  }
  return noise;
}

Eigen::VectorXd weights_of(const Eigen::VectorXd& noise) {
  const double floor = std::max(1e-9 * noise.maxCoeff(), 1e-12);
  return noise.cwiseMax(floor).cwiseAbs2().cwiseInverse();
}

BlockFactors compressed(const RegressionColumns& columns, const BaseParameters& base,
                        const std::vector<const data::MotionStream*>& logs,
                        const ObservationOptions& observation, const std::vector<long>& keys,
                        RecordedRows* record) {
  constexpr double kBlock = 0.5;  // [s]; the covariance merges blocks to several correlation times
  BlockFactors factors(columns.num_joints(), base.count(), kBlock);
  for_each_observation(columns, base.kept, logs, observation, [&](const ObservationRows& rows) {
    const long key = keys.empty() ? rows.log : keys[static_cast<std::size_t>(rows.log)];
    factors.add(key, rows.joint, rows.time, rows.W, rows.tau);
    if (record != nullptr) record->add(rows);
  });
  return factors;
}

Eigen::VectorXd residual_correlation(const RegressionColumns& columns, const BaseParameters& base,
                                     const std::vector<const data::MotionStream*>& logs,
                                     const ObservationOptions& observation, const Eigen::VectorXd& beta,
                                     const RecordedRows& record) {
  statistics::ResidualMoments moments(columns.num_joints());
  const auto add = [&](const ObservationRows& rows) {
    moments.add(rows.log, rows.joint, rows.time, rows.tau - rows.W * beta);
  };
  if (record.is_usable()) {
    // Joints side by side: the sums of each are its own.
    host::for_each_parallel(static_cast<std::size_t>(columns.num_joints()), [&](std::size_t joint) {
      ObservationRows rows;
      for (RecordedRows::Pass pass(record, static_cast<int>(joint)); pass.next(rows);) add(rows);
    });
  } else {
    for_each_observation(columns, base.kept, logs, observation, add);
  }
  return moments.correlation_time();
}

void weigh_joints(const Eigen::VectorXd& prior, double ridge_from, bool weighed, WeightedFit& fit) {
  constexpr int kRounds = 6;
  if (weighed) {
    TriangularFactor rows = fit.rows();
    Eigen::VectorXd beta = estimate(rows, prior, ridge_from);
    for (int round = 0; round < kRounds; ++round) {
      const Eigen::VectorXd before = beta;
      fit.weights = weights_of(noise_of(fit.joints, beta));
      rows = fit.rows();
      beta = estimate(rows, prior, ridge_from);
      const Eigen::VectorXd scale = column_norms(rows.R());
      if (scale.cwiseProduct(beta - before).norm() < 1e-6 * scale.cwiseProduct(beta).norm()) break;
    }
  }
  fit.solve_for(prior, ridge_from);
}

Spread spread_of(const BlockFactors& factors, const Eigen::VectorXd& weights, const Solution& solution,
                 double length, double edge_factor) {
  struct Group {
    Eigen::MatrixXd A;
    Eigen::VectorXd g;
  };
  // All in columns of norm 1: A = Σ w RᵀR, g = Σ w Rᵀ(z − R β).
  const auto b = solution.beta.size();
  const Eigen::VectorXd inverse = solution.scale.cwiseInverse();
  Eigen::MatrixXd A = solution.ridge * Eigen::MatrixXd::Identity(b, b);
  std::vector<Group> groups;
  for (const std::vector<int>& members : groups_of(factors, length)) {
    Group& group = groups.emplace_back(Group{Eigen::MatrixXd::Zero(b, b), Eigen::VectorXd::Zero(b)});
    for (const int k : members) {
      for (int j = 0; j < factors.num_joints(); ++j) {
        const TriangularFactor& factor = factors.factor(k, j);
        if (factor.rows() == 0) continue;
        const Eigen::MatrixXd R = factor.R() * inverse.asDiagonal();
        group.A.noalias() += weights[j] * (R.transpose() * R);
        group.g.noalias() += weights[j] * (R.transpose() * (factor.z() - factor.R() * solution.beta));
      }
    }
  }
  for (const Group& group : groups) A += group.A;
  Eigen::MatrixXd changes(b, static_cast<Eigen::Index>(groups.size()));
  Spread out;
  for (const Group& group : groups) {
    if (group.A.trace() <= 0.0) continue;
    // Without this block: (A − A_b) d = −g_b, since the whole gradient vanishes at the estimate.
    const Eigen::VectorXd d = solve_symmetric(A - group.A, -group.g);
    if (d.allFinite()) changes.col(out.blocks++) = d;
  }
  out.covariance = inverse.asDiagonal() *
                   statistics::jackknife_covariance(changes.leftCols(out.blocks), edge_factor) *
                   inverse.asDiagonal();
  return out;
}

}  // namespace heft::regression
