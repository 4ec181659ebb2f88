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

void add_columns(const ColumnMoments& m, std::size_t block, const std::vector<std::vector<int>>& places,
                 const VectorXd& noise, int columns, MatrixXd& total) {
  const Index p = columns, k = m.count, last = p + k;
  for (std::size_t a = 0; a < m.joints.size(); ++a) {
    const auto j = static_cast<std::size_t>(m.joints[a]);
    const double w = 1.0 / (noise[m.joints[a]] * noise[m.joints[a]]);
    const MatrixXd& cross = m.cross[block][a];
    for (Index c = 0; c < k; ++c) {
      for (Index r = 0; r + 1 < cross.rows(); ++r) {
        const int place = places[j][static_cast<std::size_t>(r)];
        total(place, p + c) += w * cross(r, c);
        total(p + c, place) += w * cross(r, c);
      }
      total(last, p + c) += w * cross(cross.rows() - 1, c);
      total(p + c, last) += w * cross(cross.rows() - 1, c);
    }
    total.block(p, p, k, k) += w * m.square[block][a];
  }
}

MatrixXd widened(const MatrixXd& base, int k) {
  const Index p = base.rows() - 1;
  MatrixXd wide = MatrixXd::Zero(p + k + 1, p + k + 1);
  wide.topLeftCorner(p, p) = base.topLeftCorner(p, p);
  wide.col(p + k).head(p) = base.col(p).head(p);
  wide.row(p + k).head(p) = base.row(p).head(p);
  wide(p + k, p + k) = base(p, p);
  return wide;
}

Solved solve(const MatrixXd& moments, int without, double steady, const VectorXd& ridge, Index inverse) {
  const Index p = moments.rows() - 1;
  VectorXd scale = moments.diagonal().head(p).cwiseSqrt();
  for (Index c = 0; c < p; ++c) {
    if (!(scale[c] > 0.0)) scale[c] = 1.0;
  }
  MatrixXd A =
      scale.cwiseInverse().asDiagonal() * moments.topLeftCorner(p, p) * scale.cwiseInverse().asDiagonal();
  A.diagonal().array() += steady;
  A.diagonal().head(ridge.size()) += ridge;
  if (without >= 0) A(without, without) += 1e12;
  const VectorXd right = moments.col(p).head(p).cwiseQuotient(scale);
  MatrixXd L;
  cholesky(A, L);
  VectorXd x = right;
  solve_lower(L, x);
  solve_lower_transposed(L, x);
  Solved s;
  s.theta = x.cwiseQuotient(scale);
  s.error = moments(p, p) - right.dot(x);
  s.inverse.resize(p, inverse);
  for (Index c = 0; c < inverse; ++c) {  // (S A S)⁻¹ = S⁻¹ L⁻ᵀ L⁻¹ S⁻¹
    VectorXd column = VectorXd::Zero(p);
    column[p - inverse + c] = 1.0 / scale[p - inverse + c];
    solve_lower(L, column);
    solve_lower_transposed(L, column);
    s.inverse.col(c) = column.cwiseQuotient(scale);
  }
  return s;
}

double squared_error(const MatrixXd& base, const std::vector<int>& places, const VectorXd& theta,
                     const ColumnMoments* m, std::size_t block, int place_of_joint, int columns) {
  const Index p = static_cast<Index>(places.size());
  VectorXd own(p + 1);
  own.head(p) = theta(places);
  own[p] = -1.0;
  double error = own.dot(transposed_times(base, own).col(0));  // the moments are symmetric
  if (m != nullptr && place_of_joint >= 0) {
    const auto a = static_cast<std::size_t>(place_of_joint);
    const VectorXd c = theta.segment(columns, m->count);
    error += 2.0 * own.dot(m->cross[block][a] * c) + c.dot(m->square[block][a] * c);
  }
  return error;
}

}  // namespace heft::diagnose
