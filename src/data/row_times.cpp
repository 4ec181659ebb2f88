#include "row_times.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "even_clock.hpp"
#include "resample.hpp"

namespace heft::data {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Rows that are dated at once, at least.
constexpr Index kBlock = 65536;
/// Less scatter, in periods, is that of an even clock; see is_uniform().
constexpr double kEven = 0.01;
/// Positions that follow less of the scatter lie nearer to the even clock than to the stamps.
constexpr double kFollow = 0.5;
/// Fewer seconds have no spread to speak of.
constexpr double kLeastSeconds = 3.0;
/// Fourth difference: it leaves nothing of a cubic.
constexpr std::array<double, 5> kFourth{1.0, -4.0, 6.0, -4.0, 1.0};
constexpr Index kHalf = 2;

/// Mean of the steps without a lost row: stamps of few digits have a median far from it.
double mean_period(double median, const RowTimes::Open& open) {
  double sum = 0.0, last = std::numeric_limits<double>::quiet_NaN();
  long count = 0;
  for_each_time(*open(false), [&](double time) {
    const double step = time - last;
    if (step > 0.5 * median && step < 1.5 * median) sum += step, ++count;
    last = time;
  });
  return count > 0 ? sum / static_cast<double>(count) : median;
}

/// Root mean square of means over rows in succession.
class Wander {
 public:
  void add(double off) {
    sum_ += off;
    if (++count_ < kRows) return;
    const double mean = sum_ / kRows;
    squares_ += mean * mean;
    ++means_;
    sum_ = 0.0;
    count_ = 0;
  }
  double value() const { return means_ > 0 ? std::sqrt(squares_ / static_cast<double>(means_)) : 0.0; }

 private:
  static constexpr int kRows = 100;
  double sum_{0.0}, squares_{0.0};
  int count_{0};
  long means_{0};
};

/// Fourth differences of positions over what they are if the samples lie where the stamps say, summed up by joint and second.
class Following {
 public:
  explicit Following(Index joints) : joints_(static_cast<std::size_t>(joints)) {}

  /// Rows `from` to `to` of these.
  /// @param off  stamps minus the even clock
  void add(const Eigen::Ref<const Eigen::MatrixXd>& q, const EvenClock& clock, const VectorXd& off, Index from, Index to) {
    if (rows_ == 0) begin_ = clock.time[from];
    rows_ += to - from;
    for (Index k = from; k < to; ++k) {
      squares_ += off[k] * off[k];
      wander_.add(off[k]);
    }
    for (Index k = std::max(from, 2 * kHalf); k < std::min(to, q.rows() - 2 * kHalf); ++k) {
      const auto at = static_cast<std::size_t>(k);
      if (clock.number[at + kHalf] - clock.number[at - kHalf] != 2.0 * kHalf) continue;  // a row is lost there
      const double second = std::max(0.0, std::floor(clock.time[k] - begin_));
      const bool begins = second != second_;
      second_ = second;
      for (Index j = 0; j < q.cols(); ++j) add(q.col(j), clock.time, off, k, begins, joints_[static_cast<std::size_t>(j)]);
    }
  }

  /// Slope of all joints' differences over what is expected, each joint weighted by what it leaves.
  StampScatter fit(double period) const {
    StampScatter result;
    if (rows_ > 0) result.scatter = std::sqrt(squares_ / static_cast<double>(rows_)) / period;
    result.wander = wander_.value() / period;
    if (result.scatter < kEven || !result.keeps_beat()) return result;
    std::vector<double> weights;
    double down = 0.0, up = 0.0;
    for (const Joint& joint : joints_) {
      const double left = joint.xx > 0.0 ? joint.yy - joint.xy * joint.xy / joint.xx : joint.yy;
      weights.push_back(left > 0.0 ? static_cast<double>(joint.rows) / left : 0.0);
      down += weights.back() * joint.xx;
      up += weights.back() * joint.xy;
    }
    if (!(down > 0.0)) return result;
    result.followed = up / down;
    // Scores of seconds: their sum is zero, and a few that say it all leave nothing of their squares.
    double squares = 0.0, shares = 0.0;
    for (std::size_t s = 0; s < joints_.front().seconds.size(); ++s) {
      double score = 0.0, share = 0.0;
      for (std::size_t j = 0; j < joints_.size(); ++j) {
        const Second& second = joints_[j].seconds[s];
        score += weights[j] * (second.xy - result.followed * second.xx);
        share += weights[j] * second.xx / down;
      }
      squares += score * score;
      shares += share * share;
    }
    const double count = 1.0 / shares;
    if (count >= kLeastSeconds) result.std = std::sqrt(squares * count / (count - 1.0)) / down;
    return result;
  }

 private:
  /// x: expected, y: seen.
  struct Second {
    double xx{0.0}, xy{0.0};
  };
  struct Joint {
    double xx{0.0}, xy{0.0}, yy{0.0};
    long rows{0};
    std::vector<Second> seconds;
  };

  static void add(const Eigen::Ref<const VectorXd>& q, const VectorXd& even, const VectorXd& off, Index k, bool begins,
                  Joint& joint) {
    double seen = 0.0, expected = 0.0;
    for (Index m = k - kHalf; m <= k + kHalf; ++m) {
      const double weight = kFourth[static_cast<std::size_t>(m - k + kHalf)];
      seen += weight * (q[m] - q[k]);
      expected += weight * off[m] * (q[m + kHalf] - q[m - kHalf]) / (even[m + kHalf] - even[m - kHalf]);
    }
    if (begins) joint.seconds.emplace_back();
    joint.xx += expected * expected;
    joint.xy += expected * seen;
    joint.yy += seen * seen;
    joint.seconds.back().xx += expected * expected;
    joint.seconds.back().xy += expected * seen;
    ++joint.rows;
  }

  std::vector<Joint> joints_;
  double begin_{0.0}, second_{-1.0};
  double squares_{0.0};  ///< of stamps minus the even clock
  Wander wander_;
  Index rows_{0};
};

}  // namespace

RowTimes::RowTimes(const SampleClock& stamps, const Open& open, Index joints) {
  if (stamps.samples() <= 4 * kHalf || stamps.is_even()) return;
  const double median = median_of_steps(stamps.median, [&](const auto& use) { for_each_time(*open(false), use); });
  const double period = mean_period(median, open);
  const Index margin = even_clock_margin(period), block = std::max(kBlock, 2 * margin);

  const std::unique_ptr<RowSource> pass = open(true);
  RowBuffer rows(joints);
  Following following(joints);
  bool at_end = false;
  for (Index first = 0; !(at_end && first == rows.first + rows.size());) {
    while (!at_end && rows.first + rows.size() < first + block + margin) at_end = pass->read(kBlockRows, rows) == 0;
    rows.drop_front(std::max(Index{0}, first - margin - rows.first));
    const Index from = first - rows.first, to = at_end ? rows.size() : from + block;
    const VectorXd time = rows.time.segment(rows.begin, rows.size());
    const Eigen::MatrixXd q = rows.values.middleRows(rows.begin, rows.size());
    const EvenClock clock = even_clock(time, q, period, kGapFactor * median);
    following.add(q, clock, time - clock.time, from, to);
    has_room_ = even_.append({clock.time.data() + from, static_cast<std::size_t>(to - from)});
    if (!has_room_) return;
    first += to - from;
  }

  scatter_ = following.fit(period);
  scatter_.placed = scatter_.known() && scatter_.followed <= kFollow;
  if (!scatter_.placed) return;
  bool increasing = true;
  PlacedSource placed(open(false), *this);
  for_each_time(placed, [&](double time) {
    increasing = increasing && (clock_.samples() == 0 || time > clock_.end());
    clock_.add(time);
  });
  scatter_.placed = increasing;
}

void RowTimes::place(Index first, Eigen::Ref<VectorXd> time) const {
  if (!scatter_.placed) return;
  const auto at = static_cast<std::size_t>(first);
  const Index rows = std::min(time.size(), static_cast<Index>(even_.size() - std::min(even_.size(), at)));
  VectorXd even(rows);
  if (!even_.read(at, {even.data(), static_cast<std::size_t>(rows)})) return;
  const double part = std::max(0.0, scatter_.followed);
  time.head(rows) = even + part * (time.head(rows) - even);
}

Index PlacedSource::read(Index most, RowBuffer& rows) {
  const Index count = stamped_->read(most, rows);
  times_.place(at_, rows.time.segment(rows.end - count, count));
  at_ += count;
  return count;
}

}  // namespace heft::data
