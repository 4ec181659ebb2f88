#include "cutoff.hpp"

#include <algorithm>
#include <complex>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "heft/host/parallel.hpp"

namespace heft::data {
namespace {

using Eigen::Index;

/// Joints whose rms deviation from their mean is less than this rest for certain [rad, m].
constexpr double kRestingDeviation = 5e-3;

/// Number of the spectral line below and at which lies all but 1e-4 of the power.
Index last_line(const Eigen::Ref<const Eigen::VectorXd>& power) {
  const double total = power.sum();
  double sum = 0.0;
  for (Index k = 0; k < power.size(); ++k) {
    sum += power[k];
    if (sum >= 0.9999 * total) return k;
  }
  return 0;
}

}  // namespace

double motion_bandwidth(const Eigen::MatrixXd& q_uniform, double sample_rate) {
  const Index n = q_uniform.rows();
  if (n < 8 || q_uniform.cols() == 0) return 0.0;
  const Eigen::RowVectorXd mean = q_uniform.colwise().mean();
  const Eigen::RowVectorXd deviation =
      ((q_uniform.rowwise() - mean).colwise().squaredNorm() / static_cast<double>(n)).cwiseSqrt();
  const double least = std::max(kRestingDeviation, 0.01 * deviation.maxCoeff());

  Index length = 16;
  while (length < n) length *= 2;  // a power of two keeps the transform fast for any log length
  statistics::Periodogram periodogram(length);
  Eigen::VectorXd power;
  Index line = 0;
  for (Index joint = 0; joint < q_uniform.cols(); ++joint) {
    if (deviation[joint] < least) continue;
    const std::vector<std::complex<double>>& spectrum = periodogram.of(q_uniform.col(joint), mean[joint]);
    power.resize(static_cast<Index>(spectrum.size()));
    for (std::size_t k = 0; k < spectrum.size(); ++k) power[static_cast<Index>(k)] = std::norm(spectrum[k]);
    line = std::max(line, last_line(power));
  }
  return static_cast<double>(line) * sample_rate / static_cast<double>(length);
}

BandwidthEstimate::BandwidthEstimate(Index rows, Eigen::RowVectorXd mean, double sample_rate)
    : mean_(std::move(mean)), sample_rate_(sample_rate) {
  const Index joints = mean_.size();
  stretch_.resize(std::min(rows, kWhole), joints);
  square_sum_ = Eigen::RowVectorXd::Zero(joints);
  if (rows > kWhole) power_ = Eigen::MatrixXd::Zero(kWhole / 2 + 1, joints);
}

void BandwidthEstimate::add(const Eigen::Ref<const Eigen::MatrixXd>& q) {
  for (Index used = 0; used < q.rows();) {
    if (filled_ == stretch_.rows()) {
      add_stretch();
      // The next stretch begins in the middle of this one.
      const Index kept = filled_ / 2;
      stretch_.topRows(kept) = stretch_.middleRows(filled_ - kept, kept).eval();
      filled_ = kept;
    }
    const Index count = std::min(q.rows() - used, stretch_.rows() - filled_);
    stretch_.middleRows(filled_, count) = q.middleRows(used, count);
    square_sum_ += (q.middleRows(used, count).rowwise() - mean_).colwise().squaredNorm();
    filled_ += count;
    fresh_ += count;
    total_rows_ += count;
    used += count;
  }
}

void BandwidthEstimate::add_stretch() {
  fresh_ = 0;
  if (power_.size() == 0) return;
  const std::size_t joints = static_cast<std::size_t>(mean_.size());
  if (periodograms_.empty()) {
    for (std::size_t t = 0; t < std::min(host::threads(), joints); ++t) periodograms_.emplace_back(kWhole);
  }
  // Joints side by side; each transform needs a periodogram of its own.
  const std::size_t workers = periodograms_.size();
  host::for_each_parallel(workers, [&](std::size_t worker) {
    for (std::size_t j = worker; j < joints; j += workers) {
      const auto joint = static_cast<Index>(j);
      const std::vector<std::complex<double>>& spectrum =
          periodograms_[worker].of(stretch_.col(joint).head(filled_), mean_[joint]);
      for (Index k = 0; k < power_.rows(); ++k) {
        power_(k, joint) += std::norm(spectrum[static_cast<std::size_t>(k)]);
      }
    }
  });
}

double BandwidthEstimate::value() {
  if (power_.size() == 0) return motion_bandwidth(stretch_.topRows(filled_), sample_rate_);
  if (fresh_ > 0) add_stretch();
  const Eigen::RowVectorXd deviation = (square_sum_ / static_cast<double>(total_rows_)).cwiseSqrt();
  const double least = std::max(kRestingDeviation, 0.01 * deviation.maxCoeff());
  Index line = 0;
  for (Index joint = 0; joint < mean_.size(); ++joint) {
    if (deviation[joint] >= least) line = std::max(line, last_line(power_.col(joint)));
  }
  return static_cast<double>(line) * sample_rate_ / static_cast<double>(kWhole);
}

double choose_cutoff(const std::string& path, const MotionOptions& options, double bandwidth,
                     double sample_rate) {
  if (options.cutoff == 0.0) {
    const double most = 0.4 * sample_rate;
    if (bandwidth == 0.0) return std::min(10.0, most);
    const double cutoff = std::max(3.0, 10.0 * bandwidth);
    return cutoff > most ? 0.0 : cutoff;
  }
  if (!(options.cutoff > 0.0 && options.cutoff < 0.5 * sample_rate)) {
    throw DataError(fmt::format(
        "{}: cut-off {:.6g} Hz; the log has {:.6g} samples a second; expected more than 0 and less "
        "than {:.6g} Hz; choose a lower cut-off",
        path, options.cutoff, sample_rate, 0.5 * sample_rate));
  }
  return options.cutoff;
}

}  // namespace heft::data
