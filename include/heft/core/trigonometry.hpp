/// @file
/// Sine and cosine of all joint angles at once, without branches and without libm.
///
/// At the sample rate of a controller the trigonometric calls cost more than the whole inverse dynamics, so
/// this loop is written for the vectoriser: Cody-Waite reduction to [-π/4, π/4] with π/2 split in three
/// parts, then the minimax polynomials of the Freely Distributable LIBM (Sun Microsystems, 1993, files
/// k_sin.c and k_cos.c; the coefficients are its figures). Error below 1 ulp + 2e-17·|x| in double for
/// |x| ≤ kMaxAngle.
#pragma once

#include <bit>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "heft/core/pack.hpp"

namespace heft {

/// Largest magnitude of an angle that the reduction handles [rad]; beyond it the answer is NaN. A joint
/// angle of that size is garbage and must not produce a torque.
inline constexpr double kMaxAngle = 1.0e6;
/// The same for float, whose angles have lost every digit long before.
inline constexpr float kMaxAngleFloat = 1.0e4F;

/// Sine and cosine of one angle.
template <typename Scalar>
struct SinCos {
  Scalar sin;
  Scalar cos;
};

namespace detail {

/// One angle, or as many as a vector type holds: written for double and for the compiler's vectors of double alike.
/// @tparam Real  double, or a vector of it
/// @tparam Bits  std::uint64_t, or a vector of as many
template <typename Real, typename Bits>
inline SinCos<Real> sin_cos_in_double(const Real& x) noexcept {
  // Figures of the Freely Distributable LIBM: sin(r) = r + r³(S1 + r²(S2 + ...)), cos(r) = 1 - r²/2 + r⁴(C1 + ...).
  constexpr double kS1 = -1.66666666666666324348e-01, kS2 = 8.33333333332248946124e-03,
                   kS3 = -1.98412698298579493134e-04, kS4 = 2.75573137070700676789e-06,
                   kS5 = -2.50507602534068634195e-08, kS6 = 1.58969099521155010221e-10;
  constexpr double kC1 = 4.16666666666666019037e-02, kC2 = -1.38888888888741095749e-03,
                   kC3 = 2.48015872894767294178e-05, kC4 = -2.75573143513906633035e-07,
                   kC5 = 2.08757232129817482790e-09, kC6 = -1.13596475577881948265e-11;
  // π/2 = kP1 + kP2 + kP3, the first two with 33 bits, so that their product with n < 2²⁰ is exact.
  constexpr double kTwoOverPi = 6.36619772367581382433e-01, kP1 = 1.57079632673412561417e+00,
                   kP2 = 6.07710050630396597660e-11, kP3 = 2.02226624879595063154e-21;
  // Adding 1.5·2⁵² rounds to the nearest whole number and leaves it in the low bits.
  constexpr double kRound = 6755399441055744.0;
  const Real shifted = x * kTwoOverPi + kRound;
  const Bits n = std::bit_cast<Bits>(shifted);
  const Real k = shifted - kRound;
  const Real r = ((x - k * kP1) - k * kP2) - k * kP3;
  const Real r2 = r * r;
  const Real sine = r + (r * r2) * (kS1 + r2 * (kS2 + r2 * (kS3 + r2 * (kS4 + r2 * (kS5 + r2 * kS6)))));
  const Real cosine =
      (1.0 - 0.5 * r2) + (r2 * r2) * (kC1 + r2 * (kC2 + r2 * (kC3 + r2 * (kC4 + r2 * (kC5 + r2 * kC6)))));
  // Quarter turns: odd n swaps the two, bits 1 of n and n + 1 are their signs.
  const Bits sine_bits = std::bit_cast<Bits>(sine);
  const Bits cosine_bits = std::bit_cast<Bits>(cosine);
  const Bits swap = (sine_bits ^ cosine_bits) & (std::uint64_t{0} - (n & 1U));
  // |x| > kMaxAngle, infinite or NaN: its bits, read as a whole number, exceed those of the limit, the
  // difference is negative, and the mask made of its sign sets every bit, which is a NaN. (A comparison
  // would keep the loop from being vectorised.)
  const Bits magnitude = std::bit_cast<Bits>(x) & std::uint64_t{0x7fffffffffffffff};
  const Bits bad = std::uint64_t{0} - ((std::bit_cast<std::uint64_t>(kMaxAngle) - magnitude) >> 63);
  return {std::bit_cast<Real>(Bits((sine_bits ^ swap ^ ((n & 2U) << 62)) | bad)),
          std::bit_cast<Real>(Bits((cosine_bits ^ swap ^ (((n + 1U) & 2U) << 62)) | bad))};
}

/// The same for float: single-precision polynomials of the Cephes library (S. Moshier, 1988: sinf, cosf).
/// @tparam Bits  std::uint32_t, or a vector of as many
template <typename Real, typename Bits>
inline SinCos<Real> sin_cos_in_float(const Real& x) noexcept {
  constexpr float kS1 = -1.6666654611e-1F, kS2 = 8.3321608736e-3F, kS3 = -1.9515295891e-4F;
  constexpr float kC1 = 4.166664568298827e-2F, kC2 = -1.388731625493765e-3F, kC3 = 2.443315711809948e-5F;
  constexpr float kTwoOverPi = 0.63661977236758F;
  // π/2 in three parts of 8, 11 and 24 bits: products with n < 2¹³ are exact in the first two.
  constexpr float kP1 = 1.5703125F, kP2 = 4.837512969970703125e-4F, kP3 = 7.54978995489188216e-8F;
  constexpr float kRound = 12582912.0F;  // 1.5·2²³
  const Real shifted = x * kTwoOverPi + kRound;
  const Bits n = std::bit_cast<Bits>(shifted);
  const Real k = shifted - kRound;
  const Real r = ((x - k * kP1) - k * kP2) - k * kP3;
  const Real r2 = r * r;
  const Real sine = r + (r * r2) * (kS1 + r2 * (kS2 + r2 * kS3));
  const Real cosine = (1.0F - 0.5F * r2) + (r2 * r2) * (kC1 + r2 * (kC2 + r2 * kC3));
  const Bits sine_bits = std::bit_cast<Bits>(sine);
  const Bits cosine_bits = std::bit_cast<Bits>(cosine);
  const Bits swap = (sine_bits ^ cosine_bits) & (std::uint32_t{0} - (n & 1U));
  const Bits magnitude = std::bit_cast<Bits>(x) & std::uint32_t{0x7fffffff};
  const Bits bad = std::uint32_t{0} - ((std::bit_cast<std::uint32_t>(kMaxAngleFloat) - magnitude) >> 31);
  return {std::bit_cast<Real>(Bits((sine_bits ^ swap ^ ((n & 2U) << 30)) | bad)),
          std::bit_cast<Real>(Bits((cosine_bits ^ swap ^ (((n + 1U) & 2U) << 30)) | bad))};
}

}  // namespace detail

/// Sines and cosines of `count` angles [rad].
/// @param angles   count values
/// @param results  count values; NaN where the angle is not finite or too large
/// Cost: 20 multiplications and 18 additions an angle, no branch.
inline void sin_cos(const double* __restrict angles, SinCos<double>* __restrict results, int count) noexcept {
  for (int i = 0; i < count; ++i) results[i] = detail::sin_cos_in_double<double, std::uint64_t>(angles[i]);
}
inline void sin_cos(const float* __restrict angles, SinCos<float>* __restrict results, int count) noexcept {
  for (int i = 0; i < count; ++i) results[i] = detail::sin_cos_in_float<float, std::uint32_t>(angles[i]);
}

/// The same for packs, each lane to the last bit as if alone.
template <typename T, int W>
inline void sin_cos(const Pack<T, W>* __restrict angles, SinCos<Pack<T, W>>* __restrict results,
                    int count) noexcept {
  using Lanes = typename Pack<T, W>::Lanes;
  for (int i = 0; i < count; ++i) {
    if constexpr (std::is_same_v<T, double>) {
      using Bits = typename detail::VectorOf<std::uint64_t, W>::Type;
      const auto both = detail::sin_cos_in_double<Lanes, Bits>(angles[i].lanes());
      results[i] = {Pack<T, W>(both.sin), Pack<T, W>(both.cos)};
    } else {
      using Bits = typename detail::VectorOf<std::uint32_t, W>::Type;
      const auto both = detail::sin_cos_in_float<Lanes, Bits>(angles[i].lanes());
      results[i] = {Pack<T, W>(both.sin), Pack<T, W>(both.cos)};
    }
  }
}

}  // namespace heft
