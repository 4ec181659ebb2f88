#include <algorithm>
#include <vector>

#include <fmt/format.h>

#include "heft/data/differentiate.hpp"
#include "heft/host/error.hpp"
#include "low_pass_sections.hpp"

namespace heft::data {
namespace {

using Eigen::Index;

/// Forward and back over columns first .. first + count of `signal`, count at most 2 · Pairs.
/// @param work  of any size; kept by the caller from one group of columns to the next
template <int Pairs>
void filter_columns(const Eigen::MatrixXd& signal, Index first, Index count, double sample_rate, double cutoff,
                    std::vector<double>& work, Eigen::MatrixXd& result) {
  constexpr Index kLanes = 2 * Pairs;
  const Index n = signal.rows();
  const Index pad = low_pass_padding(n, sample_rate, cutoff);
  const Index size = n + 2 * pad;
  work.resize(static_cast<std::size_t>(size * kLanes));
  // One row a sample.
  Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, kLanes, Eigen::RowMajor>> padded(work.data(), size, kLanes);
  for (Index lane = 0; lane < kLanes; ++lane) {
    const auto x = signal.col(first + std::min(lane, count - 1));
    auto to = padded.col(lane);
    for (Index k = 0; k < pad; ++k) {
      to[k] = 2.0 * x[0] - x[pad - k];
      to[pad + n + k] = 2.0 * x[n - 1] - x[n - 2 - k];
    }
    to.segment(pad, n) = x;
  }
  const LowPass<Pairs> filter(sample_rate, cutoff);
  filter.run(work.data(), size, kLanes);
  filter.run(work.data() + (size - 1) * kLanes, size - pad, -kLanes);
  for (Index lane = 0; lane < count; ++lane) result.col(first + lane) = padded.col(lane).segment(pad, n);
}

}  // namespace

Eigen::MatrixXd low_pass_zero_phase(const Eigen::MatrixXd& signal, double sample_rate, double cutoff) {
  if (!(cutoff > 0.0 && cutoff < 0.5 * sample_rate)) {
    throw DataError(
        fmt::format("cut-off {:.6g} Hz at a sample rate of {:.6g} Hz; expected more than 0 and less than "
                    "half the rate, {:.6g} Hz; choose another cut-off",
                    cutoff, sample_rate, 0.5 * sample_rate));
  }
  if (signal.rows() < 2) return signal;
  Eigen::MatrixXd result(signal.rows(), signal.cols());
  std::vector<double> work;
  for (Index first = 0; first < signal.cols(); first += 6) {
    const Index count = std::min<Index>(signal.cols() - first, 6);
    if (count > 4) {
      filter_columns<3>(signal, first, count, sample_rate, cutoff, work, result);
    } else if (count > 2) {
      filter_columns<2>(signal, first, count, sample_rate, cutoff, work, result);
    } else {
      filter_columns<1>(signal, first, count, sample_rate, cutoff, work, result);
    }
  }
  return result;
}

}  // namespace heft::data
