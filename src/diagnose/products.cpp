// Eigen's product copies both factors into an order of its own first, which pays for large square matrices; and it is
// compiled for the least of the processors. Here a tile of dot products runs down the columns as they lie, as large as the
// registers hold; each is summed in the same order whatever the tile.
#include "products.hpp"

#include <algorithm>
#include <array>
#include <cstring>

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr Index kLanes = 4;
using Lanes [[gnu::vector_size(kLanes * sizeof(double))]] = double;

constexpr Index kTileA = 4;

/// Columns of a matrix, one after the other at a distance.
struct Tall {
  const double* data;
  Index stride, columns;
};

/// Adds the dot products of kA columns with kB columns over some rows. Multiplications and additions stay apart (no fused
/// ones), and lanes are summed in pairs.
template <Index kA, Index kB>
[[gnu::always_inline]] inline void add_tile(const double* a, Index stride_a, const double* b, Index stride_b,
                                            Index rows, double* out, Index stride_out) {
  Lanes sums[kA][kB] = {};
  Index row = 0;
  for (; row + kLanes <= rows; row += kLanes) {
    Lanes left[kA];
#pragma GCC unroll 4
    for (Index i = 0; i < kA; ++i) std::memcpy(&left[i], a + i * stride_a + row, sizeof(Lanes));
#pragma GCC unroll 4
    for (Index j = 0; j < kB; ++j) {
      Lanes right;
      std::memcpy(&right, b + j * stride_b + row, sizeof(Lanes));
#pragma GCC unroll 4
      for (Index i = 0; i < kA; ++i) sums[i][j] += left[i] * right;
    }
  }
  for (Index j = 0; j < kB; ++j) {
    for (Index i = 0; i < kA; ++i) {
      double sum = (sums[i][j][0] + sums[i][j][1]) + (sums[i][j][2] + sums[i][j][3]);
      for (Index k = row; k < rows; ++k) sum += a[i * stride_a + k] * b[j * stride_b + k];
      out[i + j * stride_out] += sum;
    }
  }
}

/// Adds the products of all columns of A with kB columns of B.
/// @param i  first column of A
template <Index kB>
[[gnu::always_inline]] inline void add_strip(const Tall& A, const double* b, Index stride_b, Index from, Index rows,
                                             Index i, double* out) {
  for (; i + kTileA <= A.columns; i += kTileA)
    add_tile<kTileA, kB>(A.data + i * A.stride + from, A.stride, b, stride_b, rows, out + i, A.columns);
  for (; i < A.columns; ++i)
    add_tile<1, kB>(A.data + i * A.stride + from, A.stride, b, stride_b, rows, out + i, A.columns);
}

/// @tparam kTileB  columns of B in a tile, 2 to 4
/// @param half     only tiles that reach the diagonal or lie below it
template <Index kTileB>
[[gnu::always_inline]] inline void add_product(const Tall& A, const Tall& B, Index rows, bool half,
                                               double* out) {
  for (Index from = 0; from < rows; from += kProductPiece) {
    const Index count = std::min(kProductPiece, rows - from);
    for (Index j = 0; j < B.columns; j += kTileB) {
      const double* b = B.data + j * B.stride + from;
      const Index i = half ? j / kTileA * kTileA : 0;
      double* to = out + j * A.columns;
      switch (std::min(kTileB, B.columns - j)) {
        case 1: add_strip<1>(A, b, B.stride, from, count, i, to); break;
        case 2: add_strip<2>(A, b, B.stride, from, count, i, to); break;
        case 3:
          if constexpr (kTileB >= 3) add_strip<3>(A, b, B.stride, from, count, i, to);
          break;
        default:
          if constexpr (kTileB >= 4) add_strip<4>(A, b, B.stride, from, count, i, to);
      }
    }
  }
}

void product_anywhere(const Tall& A, const Tall& B, Index rows, bool half, double* out) {
  add_product<2>(A, B, rows, half, out);
}

#if defined(__x86_64__)
[[gnu::target("avx2")]] void product_avx2(const Tall& A, const Tall& B, Index rows, bool half, double* out) {
  add_product<3>(A, B, rows, half, out);
}

/// The same width, but twice the registers.
[[gnu::target("avx512f,avx512vl,prefer-vector-width=256")]] void product_avx512(const Tall& A, const Tall& B,
                                                                                Index rows, bool half, double* out) {
  add_product<4>(A, B, rows, half, out);
}

void product(const Tall& A, const Tall& B, Index rows, bool half, double* out) {
  static const auto widest = __builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512vl") != 0
                                 ? product_avx512
                             : __builtin_cpu_supports("avx2") != 0 ? product_avx2
                                                                   : product_anywhere;
  widest(A, B, rows, half, out);
}
#else
void product(const Tall& A, const Tall& B, Index rows, bool half, double* out) {
  product_anywhere(A, B, rows, half, out);
}
#endif

Tall tall(const Eigen::Ref<const MatrixXd>& M) { return {M.data(), M.outerStride(), M.cols()}; }

}  // namespace

MatrixXd transposed_times(const Eigen::Ref<const MatrixXd>& A, const Eigen::Ref<const MatrixXd>& B) {
  MatrixXd result = MatrixXd::Zero(A.cols(), B.cols());
  product(tall(A), tall(B), A.rows(), false, result.data());
  return result;
}

void add_transposed_times(const Eigen::Ref<const MatrixXd>& A, const Eigen::Ref<const MatrixXd>& B,
                          Eigen::Ref<MatrixXd> sum) {
  product(tall(A), tall(B), A.rows(), false, sum.data());
}

MatrixXd gram_of(const Eigen::Ref<const MatrixXd>& A) {
  MatrixXd result = MatrixXd::Zero(A.cols(), A.cols());
  product(tall(A), tall(A), A.rows(), true, result.data());
  result.triangularView<Eigen::StrictlyUpper>() = result.transpose();
  return result;
}

}  // namespace heft::diagnose
