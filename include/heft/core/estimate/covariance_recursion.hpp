/// @file
/// Covariance recursion of the instrumental variables, as Kawasaki and Nishimura (1984) print it.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "heft/core/estimate/layout.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/status.hpp"

namespace heft {

/// Recursive instrumental variables in covariance form, one scalar row at a time:
/// x ← x + P ẑ (y − w x) / (1 + w P ẑ),  P ← P − P ẑ w P / (1 + w P ẑ), P not symmetric.
///
/// Kawasaki and Nishimura's recursion with the stacked instruments (terminal-link form of (53), (54)); the
/// yardstick the cheaper forms are measured against. 1 + w P ẑ is not positive in general: with a wide prior the
/// estimate jumps during the first seconds. Take the information form for anything that drives a motor.
template <typename Scalar, typename Layout>
class CovarianceRecursion {
 public:
  static constexpr int kParameters = Layout::kParameters;
  using Row = std::array<Scalar, kParameters>;
  using Matrix = std::array<Row, kParameters>;

  /// @param prior     x₀, p
  /// @param variance  diagonal of P₀, p, each > 0
  void reset(const Row& prior, const Row& variance) noexcept {
    x_ = prior;
    for (std::size_t i = 0; i < kSize; ++i) {
      p_[i].fill(Scalar(0));
      p_[i][i] = variance[i];
    }
  }

  /// Takes one row.
  /// @return kSingular when the denominator vanishes, kNonFiniteInput (also for a number beyond kLargestInput): the row
  ///         is then left out
  Status add(int r, const Row& z, const Row& w, Scalar y) noexcept {
    if (!is_usable(y) || !all_usable(z) || !all_usable(w)) {
      return Status::kNonFiniteInput;
    }
    Row pz{};
    Row wp{};
    Scalar innovation = y;
    Scalar denominator = Scalar(1);
    for_support<Layout>(r, [&](int column) {
      const std::size_t j = static_cast<std::size_t>(column);
      for (std::size_t i = 0; i < kSize; ++i) {
        pz[i] += p_[i][j] * z[j];
        wp[i] += w[j] * p_[j][i];
      }
      innovation -= w[j] * x_[j];
    });
    for_support<Layout>(r, [&](int column) {
      const std::size_t j = static_cast<std::size_t>(column);
      denominator += w[j] * pz[j];
    });
    using std::abs;
    if (!(abs(denominator) > static_cast<Scalar>(1e-12))) {
      return Status::kSingular;
    }
    const Scalar inverse = Scalar(1) / denominator;
    for (std::size_t i = 0; i < kSize; ++i) {
      const Scalar gain = pz[i] * inverse;
      x_[i] += gain * innovation;
      for (std::size_t j = 0; j < kSize; ++j) {
        p_[i][j] -= gain * wp[j];
      }
    }
    return Status::kOk;
  }

  const Row& solution() const noexcept { return x_; }

 private:
  static constexpr std::size_t kSize = static_cast<std::size_t>(kParameters);
  Matrix p_{};
  Row x_{};
};

}  // namespace heft
