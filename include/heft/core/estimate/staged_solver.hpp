/// @file
/// A linear solve cut into pieces, so that no sample pays much more than the mean.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "heft/core/estimate/layout.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// Solves Φ x = φ for a snapshot of Φ and φ, a few operations a call, and says how well Φ is conditioned.
///
/// Friction is eliminated first (its blocks are small, symmetric and positive, so no pivoting is needed and the
/// zeros of the layout are kept), then the dense rest by Gaussian elimination with row pivoting. Rows are judged as
/// if Φ were scaled to a unit diagonal, C = S Φ S with S = diag(Φ_ii)^-½, so that units do not matter.
///
/// The measure of conditioning is 1 over the smallest pivot of C. For least squares a pivot is 1 − R² of its
/// parameter's column against the columns before it, so the measure is the variance inflation of the worst one: 1
/// for uncorrelated parameters, without bound as two of them merge. It costs nothing beyond the solve.
template <typename Scalar, typename Layout>
class StagedSolver {
 public:
  static constexpr int kParameters = Layout::kParameters;
  using Row = std::array<Scalar, kParameters>;
  using Matrix = std::array<Row, kParameters>;

  /// Takes a snapshot and begins. Copies p² + p numbers, no arithmetic.
  /// @param symmetric  only the upper triangle of the matrix is valid
  void start(const Matrix& matrix, const Row& right_side, bool symmetric) noexcept {
    lu_ = matrix;
    right_ = right_side;
    stage_ = symmetric ? Stage::kMirror : Stage::kScale;
    at_ = 0;
    row_ = 0;
  }

  /// Does about `work` multiplications, at least one step. @return true when the solve is over.
  bool advance(int work) noexcept {
    while (work > 0 && stage_ != Stage::kDone) {
      work -= step();
    }
    return stage_ == Stage::kDone;
  }

  /// Drops the solve that is under way.
  void reset() noexcept {
    stage_ = Stage::kDone;
    status_ = Status::kNotExcited;
  }

  bool busy() const noexcept { return stage_ != Stage::kDone; }

  /// kOk, or kSingular when the diagonal is not positive, a pivot vanished or the solution is out of range.
  Status status() const noexcept { return status_; }
  /// The solution. @pre status() == kOk and not busy()
  const Row& solution() const noexcept { return x_; }
  /// 1 / (smallest pivot of the scaled matrix). @pre as above
  Scalar amplification() const noexcept { return Scalar(1) / smallest_pivot_; }

  /// Multiplications of a whole solve, for spreading it: an upper bound of what advance() reports.
  static constexpr int total_work() noexcept {
    int work = kParameters;
    for (int k = 0; k < kParameters; ++k) {
      work += copying(k);
      int reach = kParameters - 1 - k;
      if (k < Layout::kFriction) {
        reach = kParameters - Layout::inertial(row_of_friction<Layout>(k)) + 1;
      }
      work += (reach + 1) * (reach + 3);
    }
    return work + kParameters * (kParameters + 3);  // back substitution
  }

 private:
  static constexpr std::size_t kSize = static_cast<std::size_t>(kParameters);
  enum class Stage : std::uint8_t { kMirror, kScale, kEliminate, kBack, kDone };

  // One step costs a row's worth of multiplications; returns how many.
  int step() noexcept {
    switch (stage_) {
      case Stage::kMirror: return mirror_row();
      case Stage::kScale: return scale();
      case Stage::kEliminate: return eliminate_row();
      case Stage::kBack: return back_row();
      case Stage::kDone: break;
    }
    return kParameters;
  }

  int fail() noexcept {
    status_ = Status::kSingular;
    stage_ = Stage::kDone;
    return 1;
  }

  // One row of the lower triangle. The sample that takes the snapshot has done enough with that.
  int mirror_row() noexcept {
    const std::size_t i = at_;
    for (std::size_t j = 0; j < i; ++j) {
      lu_[i][j] = lu_[j][i];
    }
    if (++at_ == kSize) {
      stage_ = Stage::kScale;
    }
    return copying(static_cast<int>(i));
  }

  // Numbers copied, as multiplications that take as long.
  static constexpr int copying(int numbers) noexcept { return 1 + numbers / 2; }

  int scale() noexcept {
    using std::sqrt;
    for (std::size_t i = 0; i < kSize; ++i) {
      const Scalar d = lu_[i][i];
      if (!(d > Scalar(0))) {
        return fail();
      }
      scale_[i] = Scalar(1) / sqrt(d);
      order_[i] = i;
    }
    at_ = 0;
    row_ = 0;
    smallest_pivot_ = Scalar(1);
    stage_ = Stage::kEliminate;
    return kParameters;
  }

  static constexpr bool structural_zero(std::size_t i, std::size_t j) noexcept {
    return kNeverMeet<Layout>[i][j];
  }

  // Elimination of column at_: row_ 0 chooses the pivot, then one target row a step.
  int eliminate_row() noexcept {
    const std::size_t k = at_;
    int work = 1;
    if (row_ == 0) {
      if (!choose_pivot(k)) {
        return fail();
      }
      row_ = next_row(k, k + 1);
      work = row_ < kSize ? static_cast<int>(kSize - k) : 1;
    } else {
      work = 1 + subtract_pivot_row(k, row_);
      row_ = next_row(k, row_ + 1);
    }
    if (row_ >= kSize) {
      row_ = 0;
      if (++at_ == kSize) {
        stage_ = Stage::kBack;
      }
    }
    return work;
  }

  static constexpr bool is_dense(std::size_t column) noexcept {
    return Layout::kFriction == 0 || column >= static_cast<std::size_t>(Layout::kFriction);
  }

  // First row from i on with an entry in column k.
  static std::size_t next_row(std::size_t k, std::size_t i) noexcept {
    while (!is_dense(k) && i < kSize && structural_zero(i, k)) {
      ++i;
    }
    return i;
  }

  // @return false when there is none
  bool choose_pivot(std::size_t k) noexcept {
    using std::abs;
    if (is_dense(k)) {
      std::size_t best = k;
      Scalar largest = abs(lu_[k][k]) * scale_[order_[k]];
      for (std::size_t i = k + 1; i < kSize; ++i) {
        const Scalar candidate = abs(lu_[i][k]) * scale_[order_[i]];
        if (candidate > largest) {
          best = i;
          largest = candidate;
        }
      }
      if (best != k) {
        std::swap(lu_[best], lu_[k]);
        std::swap(right_[best], right_[k]);
        std::swap(order_[best], order_[k]);
      }
    }
    const Scalar pivot = lu_[k][k];
    const Scalar scaled = abs(pivot) * (scale_[order_[k]] * scale_[k]);
    if (!(scaled > kTiny)) {
      return false;
    }
    if (scaled < smallest_pivot_) {
      smallest_pivot_ = scaled;
    }
    inverse_pivot_[k] = Scalar(1) / pivot;
    return true;
  }

  // Row i less its share of row k. @return multiplications
  int subtract_pivot_row(std::size_t k, std::size_t i) noexcept {
    Row& target = lu_[i];
    const Row& pivot_row = lu_[k];
    const Scalar factor = target[k] * inverse_pivot_[k];
    target[k] = factor;
    right_[i] -= factor * right_[k];
    int work = 1;
    std::size_t from = k + 1;
    if constexpr (Layout::kFriction > 0) {
      if (!is_dense(k)) {
        const int r = row_of_friction<Layout>(static_cast<int>(k));
        from = static_cast<std::size_t>(Layout::inertial(r));
        const std::size_t partner = static_cast<std::size_t>(Layout::friction(r) + 1);
        if (partner > k) {
          target[partner] -= factor * pivot_row[partner];
          ++work;
        }
      }
    }
    for (std::size_t j = from; j < kSize; ++j) {
      target[j] -= factor * pivot_row[j];
    }
    return work + static_cast<int>(kSize - from);
  }

  // Back substitution of the scaled solution, one unknown a step, last first; at_ counts down.
  int back_row() noexcept {
    const std::size_t i = --at_;
    Scalar s = right_[i];
    const int work = subtract_upper(i, x_, s);
    x_[i] = s * inverse_pivot_[i];
    if (at_ == 0) {
      finish();
    }
    return work + 1;
  }

  int subtract_upper(std::size_t i, const Row& x, Scalar& s) const noexcept {
    if (is_dense(i)) {
      for (std::size_t j = i + 1; j < kSize; ++j) {
        s -= lu_[i][j] * x[j];
      }
      return static_cast<int>(kSize - i) - 1;
    }
    int work = 0;
    for (std::size_t j = i + 1; j < kSize; ++j) {
      if (!structural_zero(i, j)) {
        s -= lu_[i][j] * x[j];
        ++work;
      }
    }
    return work;
  }

  void finish() noexcept {
    status_ = all_usable(x_) ? Status::kOk : Status::kSingular;
    stage_ = Stage::kDone;
  }

  /// A pivot of the scaled matrix below this is no pivot.
  static constexpr Scalar kTiny{static_cast<Scalar>(1e-12)};

  Matrix lu_{};
  Row right_{}, scale_{}, inverse_pivot_{}, x_{};
  std::array<std::size_t, kSize> order_{};
  Scalar smallest_pivot_{1};
  std::size_t at_{0}, row_{0};
  Stage stage_{Stage::kDone};
  Status status_{Status::kNotExcited};
};

}  // namespace heft
