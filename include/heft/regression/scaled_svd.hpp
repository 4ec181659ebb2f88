/// @file
/// Singular values of a triangle whose columns are brought to norm 1 first: the units of the parameters do not count.
#pragma once

#include <Eigen/Core>

#include "heft/host/decompositions.hpp"

namespace heft::regression {

/// R diag(scale)⁻¹ = U diag(values) Vᵀ.
struct ScaledSvd {
  Eigen::VectorXd scale;  ///< norms of the columns; 1 for a column of zeros
  Svd svd;
};

inline ScaledSvd scaled_svd(const Eigen::MatrixXd& R) {
  ScaledSvd out;
  out.scale = R.colwise().norm();
  out.scale = (out.scale.array() > 0.0).select(out.scale, 1.0);
  out.svd = svd_of(R * out.scale.cwiseInverse().asDiagonal());
  return out;
}

}  // namespace heft::regression
