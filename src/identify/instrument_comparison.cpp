#include "instrument_comparison.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "heft/host/decompositions.hpp"
#include "heft/host/parallel.hpp"
#include "heft/regression/block_groups.hpp"
#include "heft/regression/scaled_svd.hpp"

namespace heft::identify {
namespace {

Frame frame_of(const regression::TriangularFactor& data, const Eigen::VectorXd& start,
               double condition_limit) {
  const Eigen::MatrixXd R = data.R();
  const auto [scale, svd] = regression::scaled_svd(R);
  const Eigen::VectorXd& s = svd.values;
  const double limit = condition_limit > 0.0 ? std::min(condition_limit, 1e10) : 1e10;
  const Eigen::Index k = s[0] > 0.0 ? (s.array() * limit >= s[0]).count() : 0;
  Frame frame;
  frame.left_out = static_cast<int>(s.size() - k);
  // W D⁻¹ = U S Vᵀ, T = D⁻¹ V S⁻¹: W T = U.
  frame.T = scale.cwiseInverse().asDiagonal() * svd.V.leftCols(k) * s.head(k).cwiseInverse().asDiagonal();
  frame.from = svd.U.leftCols(k).transpose() * R;
  frame.u_plain = svd.U.leftCols(k).transpose() * (data.z() - R * start);
  frame.residual = data.squared_error(start + frame.T * frame.u_plain);
  return frame;
}

/// What one group of blocks adds to the sums.
struct GroupSums {
  InstrumentSums::Moments instrumental;
  Eigen::MatrixXd information;  ///< of the plain rows, WᵀW
  Eigen::VectorXd gradient;     ///< of the plain rows at least squares
};

GroupSums sums_of_group(const InstrumentSums& sums, const std::vector<int>& members,
                        const Eigen::VectorXd& weights, const Eigen::VectorXd& plain_beta) {
  const Eigen::Index b = sums.num_columns();
  GroupSums group{{Eigen::MatrixXd::Zero(b, b), Eigen::VectorXd::Zero(b)},
                  Eigen::MatrixXd::Zero(b, b),
                  Eigen::VectorXd::Zero(b)};
  for (const int block : members) {
    const InstrumentSums::Moments moments = sums.weighted(block, weights);
    group.instrumental.A += moments.A;
    group.instrumental.r += moments.r;
    for (int j = 0; j < sums.num_joints(); ++j) {
      const regression::TriangularFactor& factor = sums.plain().factor(block, j);
      if (factor.rows() == 0) continue;
      group.information += weights[j] * factor.information();
      group.gradient += weights[j] * factor.gradient(plain_beta);
    }
  }
  return group;
}

Eigen::MatrixXd side_by_side(Eigen::Index rows, const std::vector<Eigen::VectorXd>& columns) {
  Eigen::MatrixXd matrix(rows, static_cast<Eigen::Index>(columns.size()));
  for (std::size_t g = 0; g < columns.size(); ++g) matrix.col(static_cast<Eigen::Index>(g)) = columns[g];
  return matrix;
}

}  // namespace

Comparison compare(const InstrumentSums& sums, const Eigen::VectorXd& weights, const Eigen::VectorXd& start,
                   double condition_limit, double length, bool with_plain) {
  Comparison c;
  c.frame = frame_of(sums.plain().weighted(weights), start, condition_limit);
  const Eigen::MatrixXd& T = c.frame.T;
  const Eigen::Index k = T.cols();
  const InstrumentSums::Moments all = sums.weighted(weights);
  c.K = T.transpose() * all.A * T;
  c.u = least_squares(c.K, T.transpose() * (all.r - all.A * start));
  const Eigen::VectorXd beta = start + T * c.u;
  const Eigen::VectorXd plain_beta = start + T * c.frame.u_plain;

  // Smallest singular value s = lᵀ K v, by way of KᵀK: good to 1e-8.
  Eigen::VectorXd v = Eigen::VectorXd::Zero(k), l = v;
  if (k > 0) {
    v = eigensystem_of(c.K.transpose() * c.K).vectors.col(0);
    l = (c.K * v).normalized();
    c.relevance = (c.K * v).norm();
  }
  const std::vector<std::vector<int>> groups = regression::groups_of(sums.plain(), length);
  std::vector<Eigen::VectorXd> moved(groups.size()), plain_moved(with_plain ? groups.size() : 0);
  std::vector<double> beyond(groups.size());
  host::for_each_parallel(groups.size(), [&](std::size_t g) {
    // Without group g: (K − K_g) δ = −Tᵀ (r_g − A_g β), since Tᵀ (r − A β) = 0.
    const GroupSums group = sums_of_group(sums, groups[g], weights, plain_beta);
    const auto& [A, r] = group.instrumental;
    // A ratio's scatter: what the group has beyond its share of the motion. That some stretches show more of
    // a direction than others is no weakness.
    const Eigen::VectorXd direction = T * v;
    beyond[g] = (T * l).dot(A * direction) - c.relevance * direction.dot(group.information * direction);
    moved[g] = least_squares(c.K - T.transpose() * A * T, T.transpose() * (A * beta - r));
    if (with_plain) {
      plain_moved[g] = least_squares(Eigen::MatrixXd::Identity(k, k) - T.transpose() * group.information * T,
                                     -(T.transpose() * group.gradient));
    }
  });
  double relevance_squares = 0.0;
  for (const double part : beyond) relevance_squares += part * part;
  c.relevance_ratio = relevance_squares > 0.0 ? c.relevance / std::sqrt(relevance_squares) : 0.0;
  c.without = side_by_side(k, moved);
  c.plain_without = side_by_side(k, plain_moved);
  return c;
}

}  // namespace heft::identify
