/// @file
/// Is a torque that lasts the weight of a body on the flange?
#pragma once

#include <array>
#include <cstddef>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/dynamics/lagrangian.hpp"
#include "heft/core/numeric_range.hpp"

namespace heft {

/// Fits mass and first moment of a body on the last link to a torque that lasts while the arm moves on. A weight follows
/// the poses, a hand does not: only where the poses differ can the two be told apart, so the answer is no while the
/// columns of the body have hardly changed.
///
/// Least squares with a weak prior on four sums; the sums hold 14 numbers.
template <typename Scalar, int N>
class LoadChangeTest {
 public:
  using Vector = JointVector<Scalar, N>;
  using Body = std::array<Scalar, 4>;  ///< mass [kg], first moment [kg·m]

  void reset() noexcept { *this = LoadChangeTest{}; }

  /// Takes one sample.
  /// @param columns   of the body at this pose
  /// @param torque    what would hold it, n [N·m, N]
  /// @param scale     size of an unimportant torque of each joint, n, above 0 [N·m, N]
  /// @param period    [s]
  void add(const LoadColumns<Scalar, N>& columns, const Vector& torque, const Vector& scale,
           Scalar period) noexcept {
    for (int i = 0; i < N; ++i) {
      const Scalar weight = period / (scale[i] * scale[i]);
      for (int a = 0; a < 4; ++a) {
        for (int b = 0; b <= a; ++b) information(a, b) += weight * columns(i, a) * columns(i, b);
        right_[static_cast<std::size_t>(a)] += weight * columns(i, a) * torque[i];
      }
      squares_ += weight * torque[i] * torque[i];
    }
    if (!started_) first_ = columns;
    started_ = true;
    Scalar change(0), size(0);
    for (int i = 0; i < N; ++i) {
      for (int a = 0; a < 4; ++a) {
        const Scalar length = a == 0 ? Scalar(1) : kLength;
        const Scalar step = (columns(i, a) - first_(i, a)) / (length * scale[i]);
        const Scalar whole = first_(i, a) / (length * scale[i]);
        change += step * step;
        size += whole * whole;
      }
    }
    if (change > kChange * kChange * size) poses_differ_ = true;
    duration_ += period;
  }

  Scalar duration() const noexcept { return duration_; }
  /// Whether the arm has moved enough for an answer.
  bool poses_differ() const noexcept { return poses_differ_; }

  /// Share of the squared torque that the best body explains, 0 to 1, and that body.
  Scalar explained(Body& body) const noexcept {
    body = {};
    // Normal equations with a prior of 10 kg at 0.3 m, one second long; Cholesky's L D Lᵀ.
    std::array<std::array<Scalar, 4>, 4> l{};
    std::array<Scalar, 4> d{}, y{};
    for (std::size_t a = 0; a < 4; ++a) {
      const Scalar prior = a == 0 ? kMass : kMass * kLength;
      for (std::size_t b = 0; b <= a; ++b) {
        Scalar sum = information_[index(a, b)] + (a == b ? Scalar(1) / (prior * prior) : Scalar(0));
        for (std::size_t k = 0; k < b; ++k) sum -= l[a][k] * d[k] * l[b][k];
        if (a == b) {
          d[a] = sum;
          l[a][a] = Scalar(1);
        } else {
          l[a][b] = sum / d[b];
        }
      }
      if (!(d[a] > Scalar(0)) || !is_usable(d[a])) return Scalar(0);
      y[a] = right_[a];
      for (std::size_t k = 0; k < a; ++k) y[a] -= l[a][k] * y[k];
    }
    Scalar gain(0);
    for (std::size_t a = 4; a-- > 0;) {
      gain += y[a] * y[a] / d[a];
      body[a] = y[a] / d[a];
      for (std::size_t k = a + 1; k < 4; ++k) body[a] -= l[k][a] * body[k];
    }
    return squares_ > Scalar(0) ? gain / squares_ : Scalar(0);
  }

 private:
  static constexpr Scalar kMass{10};
  static constexpr Scalar kLength{static_cast<Scalar>(0.3)};
  /// The columns have changed by a fifth of their size: some 10 to 20 degrees of the larger joints.
  static constexpr Scalar kChange{static_cast<Scalar>(0.2)};

  static constexpr std::size_t index(std::size_t a, std::size_t b) noexcept { return a * (a + 1) / 2 + b; }
  Scalar& information(int a, int b) noexcept {
    return information_[index(static_cast<std::size_t>(a), static_cast<std::size_t>(b))];
  }

  std::array<Scalar, 10> information_{};  ///< lower triangle
  std::array<Scalar, 4> right_{};
  LoadColumns<Scalar, N> first_ = LoadColumns<Scalar, N>::Zero();
  Scalar squares_{0}, duration_{0};
  bool started_{false}, poses_differ_{false};
};

}  // namespace heft
