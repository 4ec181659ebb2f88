/// @file
/// Singular values of a triangle whose columns are brought to norm 1 first: the units of the parameters do not count.
#pragma once

#include <Eigen/Core>

#include "heft/host/decompositions.hpp"

namespace heft::regression {

/// R diag(scale)⁻¹ = U diag(values) Vᵀ.
struct ScaledSvd {
  Eigen::VectorXd scale;  ///< column_norms() of R
  Svd svd;
};

/// Norms of the columns; 1 for a column of zeros.
inline Eigen::VectorXd column_norms(const Eigen::MatrixXd& R) {
  const Eigen::VectorXd norms = R.colwise().norm();
  return (norms.array() > 0.0).select(norms, 1.0);
}

inline ScaledSvd scaled_svd(const Eigen::MatrixXd& R) {
  ScaledSvd out;
  out.scale = column_norms(R);
  out.svd = svd_of(R * out.scale.cwiseInverse().asDiagonal());
  return out;
}

}  // namespace heft::regression
