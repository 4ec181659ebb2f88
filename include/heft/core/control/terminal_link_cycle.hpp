/// @file
/// Computed torque and the estimator's rows in one forward pass.
#pragma once

#include <array>
#include <cstddef>
#include <tuple>
#include <utility>

#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/dynamics/terminal_rows.hpp"

namespace heft {

namespace structural {

/// Carries the difference between measured and commanded acceleration outward along with the inverse dynamics (it is
/// linear in the joint accelerations, without velocities and gravity) and writes rows First..n-1 for both: the
/// recursion computes the commanded motion anyway.
template <int First, typename Arm, typename WD, typename A, typename... Probes>
struct SharedRows {
  using Scalar = typename Arm::Scalar;
  using Layout = TerminalLayout<Arm, First>;

  const typename Arm::Vector& difference;  ///< measured less commanded acceleration
  std::array<TerminalRows<Scalar, Layout>, 2>& rows;
  WD wd;  ///< of the link before
  A a;
  std::tuple<Probes...> probes;

  template <int J, typename Frame, typename U, typename LinkWD, typename LinkA>
  constexpr auto step(const Frame& frame, const U& u, const LinkWD& link_wd, const LinkA& link_a) const {
    const auto wd_here = link_angular_acceleration(frame, wd, Zero3{}, component<J>(difference));
    const auto a_here =
        link_acceleration(frame, a + cross(wd, frame.position), Zero3{}, component<J>(difference));
    if constexpr (J < First) {
      return make(wd_here, a_here, std::tuple<>{});
    } else {
      const auto next_probes = std::apply(
          [&](const auto&... inboard) {
            return std::make_tuple(carried(frame, inboard)..., own_probe(frame));
          },
          probes);
      const auto measured_wd = link_wd + wd_here;
      const auto measured_a = link_a + a_here;
      const auto measured_u = u_matrix(u.v, measured_wd);
      std::apply(
          [&](const auto&... all) {
            int row = 0;
            (write<J>(all, u, link_a, measured_u, measured_a, row++), ...);
          },
          next_probes);
      return make(wd_here, a_here, next_probes);
    }
  }

 private:
  template <typename NextWD, typename NextA, typename... Next>
  constexpr SharedRows<First, Arm, NextWD, NextA, Next...> make(const NextWD& next_wd, const NextA& next_a,
                                                                const std::tuple<Next...>& next) const {
    return {difference, rows, next_wd, next_a, next};
  }

  template <int J, typename P, typename U, typename LinkA, typename MeasuredU, typename MeasuredA>
  constexpr void write(const P& probe, const U& u, const LinkA& a_commanded, const MeasuredU& measured_u,
                       const MeasuredA& a_measured, int r) const {
    write_entries<J>(probe, u, a_commanded, measured_u, a_measured, r, std::make_index_sequence<10>{});
  }

  template <int J, typename P, typename U, typename LinkA, typename MeasuredU, typename MeasuredA,
            std::size_t... I>
  constexpr void write_entries(const P& probe, const U& u, const LinkA& a_commanded,
                               const MeasuredU& measured_u, const MeasuredA& a_measured, int r,
                               std::index_sequence<I...>) const {
    constexpr const auto& kPattern = kReducedPattern<typename Arm::Description, J>;
    std::size_t column = static_cast<std::size_t>(Layout::inertial(J - First));
    (
        [&] {
          if constexpr (kPattern[I]) {
            constexpr int kEntry = static_cast<int>(I);
            const auto shared = velocity_entry<kEntry>(probe, u.v);
            rows[0][static_cast<std::size_t>(r)][column] =
                value<Scalar>(shared + acceleration_entry<kEntry>(probe, measured_u, a_measured));
            rows[1][static_cast<std::size_t>(r)][column] =
                value<Scalar>(shared + acceleration_entry<kEntry>(probe, u, a_commanded));
            ++column;
          }
        }(),
        ...);
  }
};

}  // namespace structural

/// Inverse dynamics at a commanded acceleration and, from the same forward pass, rows First..n-1 for the measured
/// acceleration and for the commanded one, which serves as the instrument: it depends on this sample's position and
/// velocity, not on the noise of its acceleration.
///
/// @param qdd_commanded  the acceleration computed torque asks for, n [rad/s²]
/// @param qdd_measured   n [rad/s²]
/// @param tau            torque for the commanded acceleration, n [N·m]
/// @param rows           measured first, instrument second; entries a row does not reach are not written
/// Cost beyond the inverse dynamics, Kawasaki and Nishimura's arm, k = 5: bench/operation_count ("shared_forward_pass").
template <typename Arm, int First, typename Parameters>
requires(Arm::kIsStatic) inline void inverse_dynamics_with_rows(
    const Parameters& parameters, const JointTrigonometry<Arm>& trig, const typename Arm::Vector& q,
    const typename Arm::Vector& qd, const typename Arm::Vector& qdd_commanded,
    const typename Arm::Vector& qdd_measured, typename Arm::Scalar sign_width, typename Arm::Vector& tau,
    std::array<TerminalRows<typename Arm::Scalar, TerminalLayout<Arm, First>>, 2>& rows) noexcept {
  using Layout = TerminalLayout<Arm, First>;
  const typename Arm::Vector difference = qdd_measured - qdd_commanded;
  const structural::SharedRows<First, Arm, structural::Zero3, structural::Zero3> visitor{
      difference, rows, {}, {}, {}};
  inverse_dynamics<Arm>(parameters, trig, q, qd, qdd_commanded, tau, visitor);
  friction_rows<Arm, Layout>(qd, sign_width, rows[0]);
  friction_rows<Arm, Layout>(qd, sign_width, rows[1]);
}

}  // namespace heft
