/// @file
/// Information form: Σ ẑ w and Σ ẑ y, accumulated row by row.
#pragma once

#include <array>
#include <cstddef>

#include "heft/core/estimate/layout.hpp"

namespace heft {

/// The system Φ x = φ of instrumental variables, Φ = P₀⁻¹ + Σ ẑ w, φ = P₀⁻¹ x₀ + Σ ẑ y, where w is a regressor
/// row, ẑ the instrument row as a column and y the measurement. With ẑ = wᵀ it is least squares.
///
/// Kawasaki and Nishimura (32) in the collapsed form of instrumental variables; equal to their covariance
/// recursion with the same P₀ and x₀.
///
/// Sign columns (Coulomb) hold +1, -1 or 0 most of the time and are added without multiplying.
template <typename Scalar, typename Layout>
class NormalEquations {
 public:
  static constexpr int kParameters = Layout::kParameters;
  using Row = std::array<Scalar, kParameters>;
  using Matrix = std::array<Row, kParameters>;

  /// Forgets all data and takes a prior.
  /// @param prior      x₀, p
  /// @param precision  diagonal of P₀⁻¹, p, each ≥ 0
  void reset(const Row& prior, const Row& precision) noexcept {
    for (std::size_t i = 0; i < kSize; ++i) {
      matrix_[i].fill(Scalar(0));
      matrix_[i][i] = precision[i];
      right_[i] = precision[i] * prior[i];
    }
  }

  /// Adds one row: Φ += z w, φ += z y.
  /// @param r  row number in the layout
  void add(int r, const Row& z, const Row& w, Scalar y) noexcept {
    const std::size_t first = static_cast<std::size_t>(Layout::inertial(r));
    if constexpr (Layout::kFriction > 0) {
      const std::size_t f = static_cast<std::size_t>(Layout::friction(r));
      const std::size_t v = f + 1;
      // Coulomb row of Φ: z is a sign.
      add_signed(z[f], [&](auto apply) {
        apply(right_[f], y);
        apply(matrix_[f][v], w[v]);
        for (std::size_t j = first; j < kSize; ++j) {
          apply(matrix_[f][j], w[j]);
        }
      });
      // Coulomb column: w is a sign.
      add_signed(w[f], [&](auto apply) {
        apply(matrix_[f][f], z[f]);
        apply(matrix_[v][f], z[v]);
        for (std::size_t i = first; i < kSize; ++i) {
          apply(matrix_[i][f], z[i]);
        }
      });
      right_[v] += z[v] * y;
      matrix_[v][v] += z[v] * w[v];
      for (std::size_t j = first; j < kSize; ++j) {
        matrix_[v][j] += z[v] * w[j];
      }
      for (std::size_t i = first; i < kSize; ++i) {
        matrix_[i][v] += z[i] * w[v];
      }
    }
    for (std::size_t i = first; i < kSize; ++i) {
      const Scalar zi = z[i];
      right_[i] += zi * y;
      for (std::size_t j = first; j < kSize; ++j) {
        matrix_[i][j] += zi * w[j];
      }
    }
  }

  /// Adds one row of least squares, Φ += wᵀ w; only the upper triangle is kept up, see matrix_symmetric().
  void add_symmetric(int r, const Row& w, Scalar y) noexcept {
    const std::size_t first = static_cast<std::size_t>(Layout::inertial(r));
    if constexpr (Layout::kFriction > 0) {
      const std::size_t f = static_cast<std::size_t>(Layout::friction(r));
      const std::size_t v = f + 1;
      add_signed(w[f], [&](auto apply) {
        apply(right_[f], y);
        apply(matrix_[f][f], w[f]);
        apply(matrix_[f][v], w[v]);
        for (std::size_t j = first; j < kSize; ++j) {
          apply(matrix_[f][j], w[j]);
        }
      });
      right_[v] += w[v] * y;
      matrix_[v][v] += w[v] * w[v];
      for (std::size_t j = first; j < kSize; ++j) {
        matrix_[v][j] += w[v] * w[j];
      }
    }
    for (std::size_t i = first; i < kSize; ++i) {
      const Scalar wi = w[i];
      right_[i] += wi * y;
      for (std::size_t j = i; j < kSize; ++j) {
        matrix_[i][j] += wi * w[j];
      }
    }
  }

  /// Multiplies everything, to keep deferred forgetting within range. Cost p² + p.
  void scale(Scalar factor) noexcept {
    for (std::size_t i = 0; i < kSize; ++i) {
      right_[i] = right_[i] * factor;
      for (Scalar& entry : matrix_[i]) {
        entry = entry * factor;
      }
    }
  }

  const Matrix& matrix() const noexcept { return matrix_; }
  const Row& right_side() const noexcept { return right_; }

 private:
  static constexpr std::size_t kSize = static_cast<std::size_t>(kParameters);

  /// Adds, subtracts or multiplies, by the value of a factor that is mostly ±1.
  template <typename F>
  static void add_signed(const Scalar& sign, F f) noexcept {
    if (sign == Scalar(1)) {
      f([](Scalar& sum, const Scalar& v) { sum += v; });
    } else if (sign == Scalar(-1)) {
      f([](Scalar& sum, const Scalar& v) { sum -= v; });
    } else if (!(sign == Scalar(0))) {
      f([&](Scalar& sum, const Scalar& v) { sum += sign * v; });
    }
  }

  Matrix matrix_{};
  Row right_{};
};

}  // namespace heft
