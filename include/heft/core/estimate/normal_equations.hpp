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
    with_row<Layout>(r, [&](auto row) { add(row, z, w, y); });
  }
  /// The same where the row is known to the compiler.
  template <int R>
  void add(RowNumber<R>, const Row& z, const Row& w, Scalar y) noexcept {
    constexpr std::size_t kFirst = static_cast<std::size_t>(Layout::inertial(R));
    constexpr std::size_t kWidth = kSize - kFirst;
    // A copy that no store to Φ can touch, so that it stays in registers.
    const std::array<Scalar, kWidth> inertial = from<kFirst>(w);
    if constexpr (Layout::kFriction > 0) {
      constexpr std::size_t f = static_cast<std::size_t>(Layout::friction(R));
      constexpr std::size_t v = f + 1;
      const Scalar zv = z[v], wv = w[v];
      // Coulomb row of Φ: z is a sign.
      add_signed(z[f], [&](auto apply) {
        apply(right_[f], y);
        apply(matrix_[f][v], wv);
        apply_to_row<kFirst>(f, inertial, apply);
      });
      // Coulomb column: w is a sign.
      add_signed(w[f], [&](auto apply) {
        apply(matrix_[f][f], z[f]);
        apply(matrix_[v][f], zv);
#pragma GCC unroll 16
        for (std::size_t i = kFirst; i < kSize; ++i) {
          apply(matrix_[i][f], z[i]);
        }
      });
      matrix_[v][v] += zv * wv;
      add_multiple<kFirst>(v, zv, inertial, y);
      for (std::size_t i = kFirst; i < kSize; ++i) {
        const Scalar zi = z[i];
        matrix_[i][v] += zi * wv;
        add_multiple<kFirst>(i, zi, inertial, y);
      }
    } else {
      for (std::size_t i = kFirst; i < kSize; ++i) {
        add_multiple<kFirst>(i, z[i], inertial, y);
      }
    }
  }

  /// Adds one row of least squares, Φ += wᵀ w; only the upper triangle is kept up, see matrix_symmetric().
  void add_symmetric(int r, const Row& w, Scalar y) noexcept {
    with_row<Layout>(r, [&](auto row) { add_symmetric(row, w, y); });
  }
  template <int R>
  void add_symmetric(RowNumber<R>, const Row& w, Scalar y) noexcept {
    constexpr std::size_t kFirst = static_cast<std::size_t>(Layout::inertial(R));
    const std::array<Scalar, kSize - kFirst> inertial = from<kFirst>(w);
    if constexpr (Layout::kFriction > 0) {
      constexpr std::size_t f = static_cast<std::size_t>(Layout::friction(R));
      constexpr std::size_t v = f + 1;
      const Scalar wv = w[v];
      add_signed(w[f], [&](auto apply) {
        apply(right_[f], y);
        apply(matrix_[f][f], w[f]);
        apply(matrix_[f][v], wv);
        apply_to_row<kFirst>(f, inertial, apply);
      });
      matrix_[v][v] += wv * wv;
      add_multiple<kFirst>(v, wv, inertial, y);
    }
#pragma GCC unroll 16
    for (std::size_t i = 0; i < kSize - kFirst; ++i) {
      const Scalar wi = inertial[i];
      right_[kFirst + i] += wi * y;
#pragma GCC unroll 16
      for (std::size_t j = i; j < kSize - kFirst; ++j) {
        matrix_[kFirst + i][kFirst + j] += wi * inertial[j];
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

  /// Entries from First on.
  template <std::size_t First>
  static std::array<Scalar, kSize - First> from(const Row& row) noexcept {
    std::array<Scalar, kSize - First> tail;
#pragma GCC unroll 16
    for (std::size_t j = 0; j < kSize - First; ++j) {
      tail[j] = row[First + j];
    }
    return tail;
  }

  template <std::size_t First, typename F>
  void apply_to_row(std::size_t i, const std::array<Scalar, kSize - First>& w, F apply) noexcept {
    Row& sums = matrix_[i];
#pragma GCC unroll 16
    for (std::size_t j = 0; j < kSize - First; ++j) {
      apply(sums[First + j], w[j]);
    }
  }

  /// Row i of the system from column First on.
  template <std::size_t First>
  void add_multiple(std::size_t i, const Scalar& zi, const std::array<Scalar, kSize - First>& w,
                    const Scalar& y) noexcept {
    Row& sums = matrix_[i];
    right_[i] += zi * y;
#pragma GCC unroll 16
    for (std::size_t j = 0; j < kSize - First; ++j) {
      sums[First + j] += zi * w[j];
    }
  }

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
