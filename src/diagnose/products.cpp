// Eigen's product copies both factors into an order of its own first, which pays for large square matrices; and it is
// compiled for the least of the processors. Here a tile of 4 × 2 dot products runs down the columns as they lie.
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

constexpr Index kTileA = 4, kTileB = 2;

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
#pragma GCC unroll 2
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

/// @param half  only tiles that reach the diagonal or lie below it
[[gnu::always_inline]] inline void add_product(const Tall& A, const Tall& B, Index rows, bool half,
                                               double* out) {
  for (Index from = 0; from < rows; from += kProductPiece) {
    const Index count = std::min(kProductPiece, rows - from);
    for (Index j = 0; j < B.columns; j += kTileB) {
      const double* b = B.data + j * B.stride + from;
      const bool pair = j + kTileB <= B.columns;
      Index i = half ? j / kTileA * kTileA : 0;
      for (; i + kTileA <= A.columns; i += kTileA) {
        const double* a = A.data + i * A.stride + from;
        double* to = out + i + j * A.columns;
        if (pair) {
          add_tile<kTileA, kTileB>(a, A.stride, b, B.stride, count, to, A.columns);
        } else {
          add_tile<kTileA, 1>(a, A.stride, b, B.stride, count, to, A.columns);
        }
      }
      for (; i < A.columns; ++i) {
        const double* a = A.data + i * A.stride + from;
        double* to = out + i + j * A.columns;
        if (pair) {
          add_tile<1, kTileB>(a, A.stride, b, B.stride, count, to, A.columns);
        } else {
          add_tile<1, 1>(a, A.stride, b, B.stride, count, to, A.columns);
        }
      }
    }
  }
}

void product_anywhere(const Tall& A, const Tall& B, Index rows, bool half, double* out) {
  add_product(A, B, rows, half, out);
}

#if defined(__x86_64__)
[[gnu::target("avx2")]] void product_avx2(const Tall& A, const Tall& B, Index rows, bool half, double* out) {
  add_product(A, B, rows, half, out);
}

void product(const Tall& A, const Tall& B, Index rows, bool half, double* out) {
  static const bool has_avx2 = __builtin_cpu_supports("avx2") != 0;
  (has_avx2 ? product_avx2 : product_anywhere)(A, B, rows, half, out);
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
