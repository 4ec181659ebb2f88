/// @file
/// Whether a mass matrix is one that feedback may be made of.
#pragma once

#include <Eigen/Core>

#include "heft/core/dynamics/joint_space.hpp"

namespace heft::detail {

/// Cholesky without the roots; NaN is not positive.
template <typename Scalar, int N>
bool is_positive_definite(MassMatrix<Scalar, N> m) noexcept {
  for (int j = 0; j < N; ++j) {
    if (!(m(j, j) > Scalar(0))) {
      return false;
    }
    for (int i = j + 1; i < N; ++i) {
      const Scalar factor = m(i, j) / m(j, j);
      for (int k = j + 1; k <= i; ++k) {
        m(i, k) -= factor * m(k, j);
      }
    }
  }
  return true;
}

/// least M₀ < M < most M₀, as quadratic forms.
/// Cost: n³/3 multiplications.
template <typename Scalar, int N>
bool between(const MassMatrix<Scalar, N>& found, const MassMatrix<Scalar, N>& nominal, const Scalar& least,
             const Scalar& most) noexcept {
  return is_positive_definite<Scalar, N>(found - least * nominal) &&
         is_positive_definite<Scalar, N>(most * nominal - found);
}

}  // namespace heft::detail
