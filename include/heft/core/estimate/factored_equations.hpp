/// @file
/// Factored form: the instrumental-variable estimate exact after every row, by rank-one updates of L D U.
#pragma once

#include <array>
#include <cstddef>

#include "heft/core/estimate/layout.hpp"
#include "heft/core/estimate/normal_equations.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// Keeps Φ = L D U (L, U unit triangular, D diagonal) and η with L D η = φ up to date while rows Φ += ẑ w,
/// φ += ẑ y arrive; the estimate is the back substitution U x = η.
///
/// The update is Bennett's (J. M. Bennett, Triangular factors of modified matrices, Numerische Mathematik 7, 1965),
/// with η carried as one more column of U. Friction comes first in the layout and a row touches its own pair and
/// the links from its own on, so the row of the last joint changes a corner of the factors only.
///
/// A non-symmetric Φ has no safe pivots while little data is in: start from accumulated equations whose
/// condition has been checked.
///
/// @tparam Symmetric  least squares (ẑ = w): U is the transpose of L and half the work falls away
template <typename Scalar, typename Layout, bool Symmetric>
class FactoredEquations {
 public:
  static constexpr int kParameters = Layout::kParameters;
  using Row = std::array<Scalar, kParameters>;
  using Matrix = std::array<Row, kParameters>;

  /// Factors accumulated equations in place. Cost p³/3 (half of it when Symmetric) without the layout's zeros; once, at
  /// the hand-over.
  /// @param upper_only  only the upper triangle of the matrix is valid
  /// @return kSingular when a pivot is not positive: Φ is not fit to go on from, start() again later
  Status start(const Matrix& matrix, const Row& right_side, bool upper_only) noexcept {
    factors_ = matrix;
    eta_ = right_side;
    if (upper_only) {
      for (std::size_t i = 1; i < kSize; ++i) {
        for (std::size_t j = 0; j < i; ++j) {
          factors_[i][j] = factors_[j][i];
        }
      }
    }
    for (std::size_t k = 0; k < kSize; ++k) {
      const Scalar pivot = factors_[k][k];
      if (!(pivot > Scalar(0))) {
        return Status::kSingular;
      }
      const Scalar inverse = Scalar(1) / pivot;
      for (std::size_t i = k + 1; i < kSize; ++i) {
        if (!meet(i, k)) {
          continue;
        }
        const Scalar factor = (Symmetric ? factors_[k][i] : factors_[i][k]) * inverse;
        eta_[i] -= factor * eta_[k];
        for (std::size_t j = Symmetric ? i : k + 1; j < kSize; ++j) {
          if (meet(k, j)) {
            factors_[i][j] -= factor * factors_[k][j];
          }
        }
        if constexpr (!Symmetric) {
          factors_[i][k] = factor;
        }
      }
      for (std::size_t j = k + 1; j < kSize; ++j) {
        if (meet(k, j)) {
          factors_[k][j] = factors_[k][j] * inverse;
        }
      }
      eta_[k] = eta_[k] * inverse;
    }
    return Status::kOk;
  }

  /// Adds one row.
  /// @param r  row number in the layout
  /// @param z  instrument row; ignored when Symmetric
  /// @return kSingular when a pivot lost its sign or vanished: the factors are then not valid any more, start() again
  Status add(int r, const Row& z, const Row& w, Scalar y) noexcept {
    Row x = z;
    Row u = w;
    Scalar c = Scalar(1);
    Status status = Status::kOk;
    const std::size_t first = static_cast<std::size_t>(Layout::inertial(r));
    const auto one = [&](std::size_t i, std::size_t from, bool partner) {
      const Scalar q = u[i];
      const Scalar p = Symmetric ? q : x[i];
      const Scalar d = factors_[i][i];
      const Scalar cq = c * q;
      const Scalar updated = d + p * cq;
      // What has been forgotten down to here has no inverse that could be worked with.
      if (!(updated > static_cast<Scalar>(kSmallestPivot))) {
        status = Status::kSingular;
        return;
      }
      const Scalar inverse = Scalar(1) / updated;
      factors_[i][i] = updated;
      const Scalar share = c * inverse;
      const Scalar to_l = q * share;
      const Scalar to_u = Symmetric ? to_l : p * share;
      c = d * share;
      y -= q * eta_[i];
      eta_[i] += to_u * y;
      if (partner) {
        change(i, i + 1, p, q, to_l, to_u, x, u);
      }
      for (std::size_t j = from; j < kSize; ++j) {
        change(i, j, p, q, to_l, to_u, x, u);
      }
    };
    if constexpr (Layout::kFriction > 0) {
      const std::size_t f = static_cast<std::size_t>(Layout::friction(r));
      one(f, first, true);
      one(f + 1, first, false);
    }
    for (std::size_t i = first; i < kSize && status == Status::kOk; ++i) {
      one(i, i + 1, false);
    }
    return status;
  }

  /// Multiplies Φ and φ, to keep deferred forgetting within range: s Φ = L (s D) U, so that U, L and η stay. Cost p.
  /// @param factor  > 0
  void scale(const Scalar& factor) noexcept {
    for (std::size_t i = 0; i < kSize; ++i) {
      factors_[i][i] = factors_[i][i] * factor;
    }
  }

  /// The estimate. Cost p²/2 without the layout's zeros.
  Row solution() const noexcept {
    Row x = eta_;
    for (std::size_t i = kSize; i-- > 0;) {
      Scalar s = x[i];
      if constexpr (Layout::kFriction > 0) {
        if (i < static_cast<std::size_t>(Layout::kFriction)) {
          const int r = row_of_friction<Layout>(static_cast<int>(i));
          const std::size_t partner = static_cast<std::size_t>(Layout::friction(r) + 1);
          if (partner > i) {
            s -= factors_[i][partner] * x[partner];
          }
          for (std::size_t j = static_cast<std::size_t>(Layout::inertial(r)); j < kSize; ++j) {
            s -= factors_[i][j] * x[j];
          }
          x[i] = s;
          continue;
        }
      }
      for (std::size_t j = i + 1; j < kSize; ++j) {
        s -= factors_[i][j] * x[j];
      }
      x[i] = s;
    }
    return x;
  }

  /// Pivot i of the factorisation, > 0.
  Scalar pivot(int i) const noexcept {
    return factors_[static_cast<std::size_t>(i)][static_cast<std::size_t>(i)];
  }

 private:
  static constexpr std::size_t kSize = static_cast<std::size_t>(kParameters);

  static constexpr double kSmallestPivot = 1e-30;

  static constexpr bool meet(std::size_t i, std::size_t j) noexcept { return !kNeverMeet<Layout>[i][j]; }

  // Entry j of row i of U and of column i of L.
  void change(std::size_t i, std::size_t j, const Scalar& p, const Scalar& q, const Scalar& to_l,
              const Scalar& to_u, Row& x, Row& u) noexcept {
    u[j] -= q * factors_[i][j];
    factors_[i][j] += to_u * u[j];
    if constexpr (!Symmetric) {
      x[j] -= p * factors_[j][i];
      factors_[j][i] += to_l * x[j];
    } else {
      static_cast<void>(p);
      static_cast<void>(to_l);
      static_cast<void>(x);
    }
  }

  Matrix factors_{};  ///< D on the diagonal, U above it, L below it
  Row eta_{};
};

}  // namespace heft
