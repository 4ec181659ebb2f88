/// @file
/// Lumped regressor of Kawasaki and Nishimura (1984): eleven columns a link, W x = tau.
#pragma once

#include <array>
#include <cstddef>

#include <Eigen/Core>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/denavit_hartenberg.hpp"
#include "heft/core/dynamics/regressor.hpp"
#include "heft/core/friction/friction.hpp"

namespace heft {

/// Parameters a link in the lumped form.
inline constexpr int kLumpedPerLink = 11;

/// W of (20): n × 11n, block upper triangular. A link's columns are the three of the first moment α, the six of Ī in
/// the order 11, 22, 33, 12, 13, 23, Coulomb and viscous friction.
template <typename Scalar, int N>
using LumpedRegressor = Eigen::Matrix<Scalar, N, kLumpedPerLink * N>;

/// x of (12), (13).
template <typename Scalar, int N>
using LumpedParameters = Eigen::Matrix<Scalar, kLumpedPerLink * N, 1>;

namespace detail {
/// Column of InertialParameters behind each of the nine inertial lumps.
inline constexpr std::array<int, 9> kLumpColumn = {kMcx, kMcy, kMcz, kIxx, kIyy, kIzz, kIxy, kIxz, kIyz};
}  // namespace detail

/// Lumped regressor from the inertial columns: a link whose outboard mass is lumped into it is described by first moment
/// and inertia about its own joint's origin, which is where the link frames of make_standard_dh_arm lie, so W is the
/// regressor without its mass columns.
///
/// @param Y           inertial columns, n × 10n, of an arm from make_standard_dh_arm with revolute joints
/// @param sign_width  see velocity_sign
/// @param W           n × 11n; rows k..n and the columns of links k..n are the lower right block
template <typename Scalar, int N>
inline void lumped_regressor(const LinkRegressor<Scalar, N>& Y, const JointVector<Scalar, N>& qd,
                             Scalar sign_width, LumpedRegressor<Scalar, N>& W) noexcept {
  W.setZero();
  for (int j = 0; j < N; ++j) {
    for (int c = 0; c < 9; ++c) {
      for (int i = 0; i <= j; ++i) {
        W(i, kLumpedPerLink * j + c) =
            Y(i, kParametersPerLink * j + detail::kLumpColumn[static_cast<std::size_t>(c)]);
      }
    }
    W(j, kLumpedPerLink * j + 9) = velocity_sign(qd[j], sign_width);
    W(j, kLumpedPerLink * j + 10) = qd[j];
  }
}

/// The twelfth column of (39'): the torque of a unit of terminal mass at O_{n-1} in every joint.
template <typename Scalar, int N>
inline JointVector<Scalar, N> terminal_mass_column(const LinkRegressor<Scalar, N>& Y) noexcept {
  return Y.col(kParametersPerLink * (N - 1) + kMass);
}

/// Lumped parameters (9)-(13): each link with everything outboard of it as a point mass at its far end O_i.
/// @param arm  from make_standard_dh_arm. The last link needs r_n = 0 only where its own mass is to be left out.
template <typename Scalar, int N>
inline LumpedParameters<Scalar, N> lumped_parameters(const ArmModel<Scalar, N>& arm) noexcept {
  LumpedParameters<Scalar, N> x;
  Scalar outboard{0};
  for (int j = N - 1; j >= 0; --j) {
    const std::size_t i = static_cast<std::size_t>(j);
    InertialParameters<Scalar> link = arm.links[i];
    if (j + 1 < N) {
      const auto& r = arm.joints[i + 1].position;
      const InertialParameters<Scalar> point = make_inertial_parameters<Scalar>(outboard, r, {});
      for (std::size_t k = 0; k < 10; ++k) {
        link[k] += point[k];
      }
    }
    outboard += arm.links[i][kMass];
    for (int c = 0; c < 9; ++c) {
      x[kLumpedPerLink * j + c] =
          link[static_cast<std::size_t>(detail::kLumpColumn[static_cast<std::size_t>(c)])];
    }
    x[kLumpedPerLink * j + 9] = arm.actuation[i].coulomb_friction;
    x[kLumpedPerLink * j + 10] = arm.actuation[i].viscous_friction;
  }
  return x;
}

}  // namespace heft
