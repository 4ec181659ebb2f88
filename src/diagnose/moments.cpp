#include "moments.hpp"

#include "heft/host/decompositions.hpp"
#include "products.hpp"

namespace heft::diagnose {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

void add_moments(const MatrixXd& part, const std::vector<int>& places, double weight, MatrixXd& total) {
  const Index p = static_cast<Index>(places.size());
  const Index last = total.rows() - 1;
  for (Index c = 0; c < p; ++c) {
    const Index to = places[static_cast<std::size_t>(c)];
    for (Index r = 0; r < p; ++r) total(places[static_cast<std::size_t>(r)], to) += weight * part(r, c);
    total(last, to) += weight * part(p, c);
    total(to, last) += weight * part(c, p);
  }
  total(last, last) += weight * part(p, p);
}

Added nothing_added(int columns, int k) {
  return {MatrixXd::Zero(columns, k), MatrixXd::Zero(k, k), VectorXd::Zero(k)};
}

void add_columns(const ColumnMoments& m, std::size_t block, const std::vector<std::vector<int>>& places,
                 const VectorXd& noise, Added& sum) {
  for (std::size_t a = 0; a < m.joints.size(); ++a) {
    const auto j = static_cast<std::size_t>(m.joints[a]);
    const double w = 1.0 / (noise[m.joints[a]] * noise[m.joints[a]]);
    const MatrixXd& cross = m.cross[block][a];
    const Index p = cross.rows() - 1;
    for (Index c = 0; c < m.count; ++c) {
      for (Index r = 0; r < p; ++r) sum.cross(places[j][static_cast<std::size_t>(r)], c) += w * cross(r, c);
      sum.torque[c] += w * cross(p, c);
    }
    sum.square += w * m.square[block][a];
  }
}

namespace {

/// Norms of columns; of those that are 0, 1.
VectorXd norms(const Eigen::Ref<const VectorXd>& squares) {
  return (squares.array() > 0.0).select(squares.array().sqrt(), 1.0);
}

/// A candidate's columns next to a factored base.
///   | L   0  | | Lᵀ  Y  |
///   | Yᵀ  L₁ | | 0   L₁ᵀ |
struct Border {
  VectorXd scale, z;  ///< k: as those of the base
  MatrixXd Y, L;      ///< p × k, k × k
};

Border border_of(const Factored& base, const Added& candidate, double steady) {
  Border border;
  border.scale = norms(candidate.square.diagonal());
  const auto per_norm = border.scale.cwiseInverse().asDiagonal();
  border.Y = base.scale.cwiseInverse().asDiagonal() * candidate.cross * per_norm;
  solve_lower(base.factor, border.Y);
  MatrixXd S = per_norm * candidate.square * per_norm;
  S.diagonal().array() += steady;
  S -= transposed_times(border.Y, border.Y);
  cholesky(S, border.L);
  border.z = candidate.torque.cwiseQuotient(border.scale) - transposed_times(border.Y, base.z);
  solve_lower(border.L, border.z);
  return border;
}

}  // namespace

Factored factored(const MatrixXd& moments, int without, double steady, const VectorXd& ridge) {
  const Index p = moments.rows() - 1;
  Factored f;
  f.scale = norms(moments.diagonal().head(p));
  const auto per_norm = f.scale.cwiseInverse().asDiagonal();
  MatrixXd A = per_norm * moments.topLeftCorner(p, p) * per_norm;
  A.diagonal().array() += steady;
  A.diagonal().head(ridge.size()) += ridge;
  if (without >= 0) A(without, without) += 1e12;
  cholesky(A, f.factor);
  f.z = moments.col(p).head(p).cwiseQuotient(f.scale);
  solve_lower(f.factor, f.z);
  f.error = moments(p, p) - f.z.squaredNorm();
  return f;
}

VectorXd theta_of(const Factored& base) {
  VectorXd x = base.z;
  solve_lower_transposed(base.factor, x);
  return x.cwiseQuotient(base.scale);
}

Solved solve_beside(const Factored& base, const Added& candidate, double steady) {
  const Border border = border_of(base, candidate, steady);
  const Index p = base.z.size(), k = border.z.size();
  const auto backwards = [&](VectorXd own, const VectorXd& of_base) {
    solve_lower_transposed(border.L, own);
    VectorXd rest = of_base - border.Y * own;
    solve_lower_transposed(base.factor, rest);
    VectorXd all(p + k);
    all << rest.cwiseQuotient(base.scale), own.cwiseQuotient(border.scale);
    return all;
  };
  Solved s;
  s.theta = backwards(border.z, base.z);
  s.error = base.error - border.z.squaredNorm();
  s.inverse.resize(p + k, k);
  for (Index c = 0; c < k; ++c) {  // (D A D)⁻¹ = D⁻¹ A⁻¹ D⁻¹
    VectorXd own = VectorXd::Zero(k);
    own[c] = 1.0 / border.scale[c];
    solve_lower(border.L, own);
    s.inverse.col(c) = backwards(own, VectorXd::Zero(p));
  }
  return s;
}

double error_beside(const Factored& base, const Added& candidate, double steady) {
  return base.error - border_of(base, candidate, steady).z.squaredNorm();
}

Solved solve(const MatrixXd& moments, int without, double steady, const VectorXd& ridge, Index inverse) {
  const Factored f = factored(moments, without, steady, ridge);
  const Index p = f.z.size();
  Solved s;
  s.theta = theta_of(f);
  s.error = f.error;
  s.inverse.resize(p, inverse);
  for (Index c = 0; c < inverse; ++c) {
    VectorXd column = VectorXd::Zero(p);
    column[p - inverse + c] = 1.0 / f.scale[p - inverse + c];
    solve_lower(f.factor, column);
    solve_lower_transposed(f.factor, column);
    s.inverse.col(c) = column.cwiseQuotient(f.scale);
  }
  return s;
}

double squared_error(const MatrixXd& base, const std::vector<int>& places, const VectorXd& theta) {
  const Index p = static_cast<Index>(places.size());
  VectorXd own(p + 1);
  own.head(p) = theta(places);
  own[p] = -1.0;
  return own.dot(transposed_times(base, own).col(0));  // the moments are symmetric
}

}  // namespace heft::diagnose
