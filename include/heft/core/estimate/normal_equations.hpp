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
  using Rows = std::array<Row, Layout::kRows>;
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
  void add(RowNumber<R> row, const Row& z, const Row& w, Scalar y) noexcept {
    constexpr std::size_t kFirst = first(R);
    add_friction(row, z, w, y);
    const std::array<Scalar, kSize - kFirst> inertial = from<kFirst>(w);
    for (std::size_t i = kFirst; i < kSize; ++i) {
      const Scalar zi = z[i];
      if constexpr (Layout::kFriction > 0) {
        matrix_[i][viscous(R)] += zi * w[viscous(R)];
      }
      add_multiple<kFirst>(i, zi, inertial, y);
    }
  }

  /// Adds all rows of a sample. Where registers hold these, an entry of Φ that several of them touch is loaded and stored once.
  void add(const Rows& z, const Rows& w, const std::array<Scalar, Layout::kRows>& y) noexcept {
    if constexpr (kFitsRegisters) {
      for_rows<Layout>([&](auto row) { add_friction(row, z[row()], w[row()], y[row()]); });
      add_inertial(z, w, y);
    } else {
      for_rows<Layout>([&](auto row) { add(row, z[row()], w[row()], y[row()]); });
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

  /// Entries from First on: a copy that no store to Φ can touch, so that it stays in registers.
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

  static constexpr std::size_t first(int r) noexcept { return static_cast<std::size_t>(Layout::inertial(r)); }
  /// The entries of all rows of a sample, friction aside, leave some of 32 registers for the sums.
  static constexpr bool kFitsRegisters = [] {
    int entries = 0;
    for (int r = 0; r < Layout::kRows; ++r) {
      entries += kParameters - Layout::inertial(r);
    }
    return entries <= 22;
  }();
  /// Behind the last parameter of link r.
  static constexpr std::size_t end(int r) noexcept { return r + 1 < Layout::kRows ? first(r + 1) : kSize; }
  static constexpr std::size_t coulomb(int r) noexcept {
    return static_cast<std::size_t>(Layout::friction(r));
  }
  static constexpr std::size_t viscous(int r) noexcept { return coulomb(r) + 1; }

  /// What one row adds to the rows of its friction, and to the column of the Coulomb coefficient.
  template <int R>
  void add_friction(RowNumber<R>, const Row& z, const Row& w, const Scalar& y) noexcept {
    if constexpr (Layout::kFriction > 0) {
      constexpr std::size_t f = coulomb(R), v = viscous(R), kFirst = first(R);
      const std::array<Scalar, kSize - kFirst> inertial = from<kFirst>(w);
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
    }
  }

  /// The rows of Φ by the link they belong to: the rows of the sample up to that link's reach them.
  void add_inertial(const Rows& z, const Rows& w, const std::array<Scalar, Layout::kRows>& y) noexcept
      requires(kFitsRegisters) {
    // Copies as above, made one by one, or the compiler leaves them in memory.
    Rows own;
    for_rows<Layout>(
        [&](auto row) { for_support<Layout>(row, [&](std::size_t j) { own[row()][j] = w[row()][j]; }); });
    const std::array<Scalar, Layout::kRows> right = y;
    for_rows<Layout>([&](auto link) {
      constexpr std::size_t kEnd = end(link());
      for (std::size_t i = first(link()); i < kEnd; ++i) {
        add_to_row(link, i, z, own, right);
      }
    });
  }

  /// Row i of the system, which belongs to link Link, without Coulomb's column.
  template <int Link>
  void add_to_row(RowNumber<Link>, std::size_t i, const Rows& z, const Rows& w,
                  const std::array<Scalar, Layout::kRows>& y) noexcept {
    Row& sums = matrix_[i];
    std::array<Scalar, Link + 1> zi;
    Scalar right = right_[i];
    for_rows<Layout>([&](auto row) {
      constexpr int kRow = row();
      if constexpr (kRow <= Link) {
        zi[kRow] = z[kRow][i];
        right += zi[kRow] * y[kRow];
        if constexpr (Layout::kFriction > 0) {
          sums[viscous(kRow)] += zi[kRow] * w[kRow][viscous(kRow)];
        }
      }
    });
    right_[i] = right;
    for_rows<Layout>([&](auto column_link) {
      constexpr int kReach = column_link() < Link ? column_link() : Link;
      constexpr std::size_t kBegin = first(column_link()), kEnd = end(column_link());
#pragma GCC unroll 16
      for (std::size_t j = kBegin; j < kEnd; ++j) {
        sums[j] = plus_products(sums[j], zi, w, j, std::make_index_sequence<kReach + 1>{});
      }
    });
  }

  template <std::size_t Count, std::size_t... R>
  static Scalar plus_products(Scalar sum, const std::array<Scalar, Count>& zi, const Rows& w, std::size_t j,
                              std::index_sequence<R...>) noexcept {
    ((sum += zi[R] * w[R][j]), ...);
    return sum;
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
