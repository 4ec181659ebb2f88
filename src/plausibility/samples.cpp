#include "samples.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "heft/data/differentiate.hpp"

namespace heft::plausibility {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// Gravity and inertia torque of arms that are moved for a measurement lie below it [Hz].
constexpr double kCutoff = 5.0;
/// Rows a second in cut-offs: behind a low-pass, rows that follow faster say nothing new.
constexpr double kRowsPerCutoff = 4.0;
/// Rows at the end; the collection holds up to twice as many.
constexpr Index kKeptRows = 400;

/// Rows in time order; drops half of them whenever there are too many. Row k is kept while the fractional part of k/φ, φ
/// the golden ratio, is below the share that is kept: these are spread evenly over the log, and unlike every m-th row
/// they do not fall on the same phases of a periodic motion again and again.
class Collection {
 public:
  explicit Collection(Index joints) : rows_(2 * kKeptRows, 4 * joints) {}

  /// @param number  of the row among all that could be taken
  void offer(long number, const Eigen::Ref<const Eigen::RowVectorXd>& row) {
    const double place = std::fmod(static_cast<double>(number) / std::numbers::phi, 1.0);
    if (place >= share_) return;
    while (count_ == rows_.rows()) halve();
    if (place >= share_) return;
    places_.push_back(place);
    rows_.row(count_++) = row;
  }
  MatrixXd rows() const { return rows_.topRows(count_); }

 private:
  void halve() {
    share_ *= 0.5;
    Index kept = 0;
    for (Index i = 0; i < count_; ++i) {
      if (places_[static_cast<std::size_t>(i)] >= share_) continue;
      places_[static_cast<std::size_t>(kept)] = places_[static_cast<std::size_t>(i)];
      rows_.row(kept++) = rows_.row(i).eval();
    }
    count_ = kept;
    places_.resize(static_cast<std::size_t>(kept));
  }

  MatrixXd rows_;
  std::vector<double> places_;
  Index count_{0};
  double share_{1.0};
};

double cutoff_at(double sample_rate) { return std::min(kCutoff, 0.3 * sample_rate); }

/// Every so many samples a row.
Index step_at(double sample_rate) {
  return std::max<Index>(1, std::lround(sample_rate / (kRowsPerCutoff * cutoff_at(sample_rate))));
}

}  // namespace

Samples samples_of(const data::MotionStream& log) {
  const Index n = log.summary().num_joints;
  Collection collection(n);
  long number = 0;
  /// Rows of a piece that could be taken.
  const auto rows_of = [n](const data::MotionChunk& chunk) {
    const double rate = chunk.sample_rate;
    const double cutoff = cutoff_at(rate);
    const Index step = step_at(rate);
    const MatrixXd q = data::low_pass_zero_phase(chunk.q, rate, cutoff);
    const MatrixXd tau = data::low_pass_zero_phase(chunk.tau, rate, cutoff);
    MatrixXd rows(chunk.count / step + 1, 4 * n);
    Index count = 0;
    for (Index i = chunk.begin; i < chunk.begin + chunk.count; ++i) {
      if (!chunk.usable[i] || (chunk.first + i - chunk.begin) % step != 0 || i == 0 || i + 1 == q.rows())
        continue;
      rows.row(count++) << q.row(i), 0.5 * rate * (q.row(i + 1) - q.row(i - 1)),
          rate * rate * (q.row(i + 1) - 2.0 * q.row(i) + q.row(i - 1)), tau.row(i);
    }
    return MatrixXd(rows.topRows(count));
  };
  log.for_each<MatrixXd>(rows_of, [&](const MatrixXd& rows) {
    for (Index i = 0; i < rows.rows(); ++i) collection.offer(number++, rows.row(i));
  });
  const MatrixXd rows = collection.rows();
  Samples samples;
  samples.q = rows.leftCols(n);
  samples.qd = rows.middleCols(n, n);
  samples.qdd = rows.middleCols(2 * n, n);
  samples.tau = rows.rightCols(n);
  const double rate = log.summary().sample_rate;
  samples.duration = static_cast<double>(step_at(rate)) / rate * static_cast<double>(number);
  return samples;
}

}  // namespace heft::plausibility
