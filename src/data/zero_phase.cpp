#include <algorithm>

#include <fmt/format.h>

#include "heft/data/differentiate.hpp"
#include "heft/host/error.hpp"
#include "low_pass_sections.hpp"
#include "signal_lanes.hpp"

namespace heft::data {
namespace {

using Eigen::Index;

/// Forward and back over columns first .. first + count of `signal`: as many as the lanes take at once.
/// @param work  of any size; kept by the caller from one group of columns to the next
void filter_columns(const Eigen::Ref<const Eigen::MatrixXd>& signal, Index first, Index count, const LowPass& filter, Index pad,
                    Eigen::VectorXd& work, Eigen::MatrixXd& result) {
  const SignalLanes& lanes = signal_lanes();
  const Index width = lanes.padded(count);
  const Index n = signal.rows(), size = n + 2 * pad;
  work.resize(size * width);
  Eigen::Map<Eigen::MatrixXd> padded(work.data(), size, width);
  for (Index lane = 0; lane < width; ++lane) {
    const auto x = signal.col(first + std::min(lane, count - 1));
    auto to = padded.col(lane);
    for (Index k = 0; k < pad; ++k) {
      to[k] = 2.0 * x[0] - x[pad - k];
      to[pad + n + k] = 2.0 * x[n - 1] - x[n - 2 - k];
    }
    to.segment(pad, n) = x;
  }
  lanes.filter(filter, work.data(), size, size, width, false, nullptr, 0);
  lanes.filter(filter, work.data() + pad, size - pad, size, width, true, nullptr, 0);
  for (Index lane = 0; lane < count; ++lane) result.col(first + lane) = padded.col(lane).segment(pad, n);
}

}  // namespace

Eigen::MatrixXd low_pass_zero_phase(const Eigen::Ref<const Eigen::MatrixXd>& signal, double sample_rate, double cutoff) {
  if (!(cutoff > 0.0 && cutoff < 0.5 * sample_rate)) {
    throw DataError(
        fmt::format("cut-off {:.6g} Hz at a sample rate of {:.6g} Hz; expected more than 0 and less than "
                    "half the rate, {:.6g} Hz; choose another cut-off",
                    cutoff, sample_rate, 0.5 * sample_rate));
  }
  if (signal.rows() < 2) return signal;
  Eigen::MatrixXd result(signal.rows(), signal.cols());
  Eigen::VectorXd work;
  const LowPass filter(sample_rate, cutoff);
  const Index pad = low_pass_padding(signal.rows(), sample_rate, cutoff), most = signal_lanes().most;
  for (Index first = 0; first < signal.cols(); first += most)
    filter_columns(signal, first, std::min(signal.cols() - first, most), filter, pad, work, result);
  return result;
}

}  // namespace heft::data
