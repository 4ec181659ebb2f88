/// @file
/// Whether a body can have given inertial parameters, and the nearest one that can.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include <Eigen/Core>

#include "heft/core/arm_model.hpp"
#include "heft/core/inertia.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/status.hpp"
#include "heft/core/symmetric_eigen.hpp"

namespace heft {
namespace detail {

/// Second moments of a body about its centre of mass, Σ_c = Σ − m c cᵀ. @pre mass above zero
template <typename Scalar>
Matrix3<Scalar> central_second_moments(const PseudoInertia<Scalar>& s,
                                       const Eigen::Matrix<Scalar, 3, 1>& c) noexcept {
  Matrix3<Scalar> about;
  about << s[kS11], s[kS12], s[kS13], s[kS12], s[kS22], s[kS23], s[kS13], s[kS23], s[kS33];
  return about - s[kPm] * (c * c.transpose());
}

/// Whether A + shift E has no negative eigenvalue, by its pivots; NaN has not.
template <typename Scalar>
bool is_positive(Matrix3<Scalar> a, const Scalar& shift) noexcept {
  for (int j = 0; j < 3; ++j) {
    const Scalar pivot = a(j, j) + shift;
    if (!(pivot > Scalar(0))) {
      return false;
    }
    for (int i = j + 1; i < 3; ++i) {
      const Scalar factor = a(i, j) / pivot;
      for (int k = j + 1; k <= i; ++k) {
        a(i, k) -= factor * a(k, j);
      }
    }
  }
  return true;
}

/// What rounding leaves of the second moments about a centre of mass, a point's for instance.
template <typename Scalar>
Scalar rounding_of(const PseudoInertia<Scalar>& s, const Eigen::Matrix<Scalar, 3, 1>& c) noexcept {
  const Scalar terms = s[kS11] + s[kS22] + s[kS33] + s[kPm] * c.squaredNorm();
  return Scalar(16) * Eigen::NumTraits<Scalar>::epsilon() * terms;
}

}  // namespace detail

/// Whether a body can have these parameters: all zero (no body), or mass above zero and no second moment about the centre
/// of mass below zero (which is more than the triangle inequalities of the moments of inertia; P. M. Wensing, S. Kim,
/// J.-J. E. Slotine, IEEE RA-L 3, 2018).
///
/// @param p  about a frame's origin, axes of that frame
/// @return kOk; kNonFiniteInput; kNotPositiveDefinite: no body can
/// Cost: about 60 multiplications.
template <typename Scalar>
Status check_physical(const InertialParameters<Scalar>& p) noexcept {
  if (!all_usable(p)) {
    return Status::kNonFiniteInput;
  }
  bool zero = true;
  for (const Scalar& value : p) {
    zero = zero && value == Scalar(0);
  }
  if (zero) {
    return Status::kOk;
  }
  if (!(p[kMass] > Scalar(0))) {
    return Status::kNotPositiveDefinite;
  }
  const PseudoInertia<Scalar> s = to_pseudo_inertia(p);
  const Eigen::Matrix<Scalar, 3, 1> c(s[kPhx] / s[kPm], s[kPhy] / s[kPm], s[kPhz] / s[kPm]);
  if (!is_finite(c.squaredNorm() * s[kPm])) {
    return Status::kNonFiniteInput;
  }
  // A thin rod has two zeros, and a point mass three: what rounding leaves is allowed.
  const Matrix3<Scalar> central = detail::central_second_moments(s, c);
  return detail::is_positive(central, detail::rounding_of(s, c)) || central.cwiseAbs().maxCoeff() <= Scalar(0)
             ? Status::kOk
             : Status::kNotPositiveDefinite;
}

/// A body near these parameters: mass as given, centre of mass within `reach` of the origin, second moments about it from zero
/// to m (reach / 2)². Early estimates of a load need not be possible, and feedback through an impossible inertia is
/// unstable.
///
/// @param p      about a frame's origin, axes of that frame; mass zero or below: no body is left, all zero
/// @param reach  > 0 [m]
/// @return kNonFiniteInput: p is unchanged
/// Cost: about 100 multiplications, and where the parameters have to change one symmetric_eigen.
template <typename Scalar>
Status make_physical(InertialParameters<Scalar>& p, Scalar reach) noexcept {
  using Vector = Eigen::Matrix<Scalar, 3, 1>;
  if (!all_usable(p)) {
    return Status::kNonFiniteInput;
  }
  const Scalar m = p[kMass];
  if (!(m > Scalar(0))) {
    p = {};
    return Status::kOk;
  }
  Vector c(p[kMcx] / m, p[kMcy] / m, p[kMcz] / m);
  const Scalar distance = c.norm();
  if (!is_finite(distance)) {
    return Status::kNonFiniteInput;
  }
  if (distance > reach) {
    c *= reach / distance;
  }
  const PseudoInertia<Scalar> s = to_pseudo_inertia(p);
  const Matrix3<Scalar> central = detail::central_second_moments(s, c);
  const Scalar largest = m * reach * reach / Scalar(4);
  // No eigenvalue of a positive matrix is above its trace.
  if (distance <= reach && central.trace() <= largest && detail::is_positive(central, Scalar(0))) {
    return Status::kOk;
  }
  SymmetricEigen<Scalar> principal;
  if (const Status status = symmetric_eigen(central, principal); status != Status::kOk) {
    return status;
  }
  const Vector moments = principal.values.cwiseMax(Scalar(0)).cwiseMin(largest);
  const Matrix3<Scalar>& axes = principal.vectors;
  const Matrix3<Scalar> turned = axes * moments.asDiagonal();
  const Matrix3<Scalar> second = turned.lazyProduct(axes.transpose()) + m * (c * c.transpose());
  p = to_inertial_parameters<Scalar>({m, m * c[0], m * c[1], m * c[2], second(0, 0), second(0, 1),
                                      second(1, 1), second(0, 2), second(1, 2), second(2, 2)});
  return Status::kOk;
}

}  // namespace heft
