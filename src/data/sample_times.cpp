#include "heft/data/sample_times.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/QR>
#include <fmt/format.h>

#include "heft/data/differentiate.hpp"
#include "resample.hpp"

namespace heft::data {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Way to both sides through which the even clock is a line: at least so many rows, to be long against the scatter, and so long
/// [s] that its bends are slow against the motion; short against the drift of clocks.
constexpr Index kLeastReach = 100;
constexpr double kReach = 1.0;
/// Rows, at most, that wait together for whoever stamps them; and so many near a loss say before which it is.
constexpr Index kLongestWait = 50, kNear = 7;
/// Less scatter, in periods, is that of an even clock; see is_uniform().
constexpr double kEven = 0.01;
/// Standard deviation of the part that positions follow, from which on they do not decide.
constexpr double kUndecided = 0.1;
/// Positions that follow less of the scatter lie nearer to the even clock than to the stamps.
constexpr double kFollow = 0.5;
/// Scatter worth a note when the positions do not decide, in periods.
constexpr double kWorthNoting = 0.05;
/// Fourth difference: it leaves nothing of a cubic.
constexpr std::array<double, 5> kFourth{1.0, -4.0, 6.0, -4.0, 1.0};
constexpr Index kHalf = 2;

/// Rows of a log as a clock with an even beat counts them.
struct Beats {
  double period{0.0};          ///< [s]
  std::vector<double> number;  ///< of each row; lost rows count
  std::vector<Index> begin;    ///< first row of each stretch without a long gap, and one past the last
};

/// Rows lost before one: by as many periods that row and all after it come late. Rows that waited for whoever stamps them
/// are late as well, but others follow that are not.
/// @param due  when the row is, if none is lost [s]
double lost_before(const VectorXd& time, Index row, double due, double period) {
  const auto late = [&](Index k) { return (time[k] - due) / period - static_cast<double>(k - row); };
  if (late(row) < 0.5) return 0.0;
  double least = late(row), second = std::numeric_limits<double>::infinity();
  for (Index k = row + 1; k < std::min(row + kLongestWait, time.size()); ++k) {
    second = std::clamp(late(k), least, second);
    least = std::min(least, late(k));
  }
  const double lost = std::round(std::min(second, late(row)));
  if (lost < 1.0) return 0.0;
  // This row may only be late, and what is lost is lost a few rows further on: where that leaves less of all, |late| ≤ 1.
  double on_time = 0.0, after = 0.0;
  for (Index k = row; k < std::min(row + kNear, time.size()); ++k) {
    on_time += std::min(1.0, std::abs(late(k)));
    after += std::min(1.0, std::abs(late(k) - lost));
    if (on_time < after) return 0.0;
  }
  return lost;
}

Beats count_beats(const VectorXd& time) {
  Beats beats;
  const double median = 1.0 / median_sample_rate(time);
  double sum = 0.0;
  int count = 0;
  for (Index k = 1; k < time.size(); ++k) {
    const double step = time[k] - time[k - 1];
    if (step > 0.5 * median && step < 1.5 * median) sum += step, ++count;
  }
  // Stamps of few digits have a median far from the mean.
  beats.period = count > 0 ? sum / count : median;
  // Stamps pull the clock slowly, so that no single one counts a row twice.
  constexpr double kPull = 0.1;
  double clock = time[0];
  beats.number = {0.0};
  beats.begin = {0};
  for (Index k = 1; k < time.size(); ++k) {
    const double passed = 1.0 + lost_before(time, k, clock + beats.period, beats.period);
    beats.number.push_back(beats.number.back() + passed);
    if (time[k] - time[k - 1] > kGapFactor * median) {
      beats.begin.push_back(k);
      clock = time[k];
      continue;
    }
    clock += passed * beats.period;
    clock += kPull * std::clamp(time[k] - clock, -0.5 * beats.period, 0.5 * beats.period);
  }
  beats.begin.push_back(time.size());
  return beats;
}

/// How far positions near a row lie from a smooth motion over the numbers of their rows: minus twice a log-likelihood.
double roughness(const Eigen::MatrixXd& q, const VectorXd& number) {
  constexpr Index kTerms = 4;  // of a cubic
  Eigen::MatrixXd powers(number.size(), kTerms);
  powers.col(0).setOnes();
  for (Index k = 1; k < kTerms; ++k) powers.col(k) = powers.col(k - 1).cwiseProduct(number);
  const Eigen::MatrixXd left = q - powers * powers.householderQr().solve(q);
  // Positions of a joint at rest are all the same, and say nothing.
  return static_cast<double>(number.size()) * (left.colwise().squaredNorm().array() + 1e-12).log().sum();
}

/// Counts a loss before row k + moved instead of before row k.
void move_loss(std::vector<double>& number, Index k, Index moved) {
  const double lost = number[static_cast<std::size_t>(k)] - number[static_cast<std::size_t>(k) - 1] - 1.0;
  for (Index i = moved; i < 0; ++i) number[static_cast<std::size_t>(k + i)] += lost;
  for (Index i = 0; i < moved; ++i) number[static_cast<std::size_t>(k + i)] -= lost;
}

/// Moves losses by a row or two where the positions show that they are there: a stamp that comes late just before looks like one
/// that comes after a loss.
void settle_losses(const Eigen::MatrixXd& q, std::vector<double>& number) {
  constexpr Index kAround = 6, kMostMoved = 2;
  constexpr double kMostLost = 4.0;
  constexpr double kSure = 10.0;  // fall of minus twice the log-likelihood
  const auto rows = static_cast<Index>(number.size());
  for (Index k = kAround; k + kAround <= rows; ++k) {
    const auto at = static_cast<std::size_t>(k);
    if (number[at] - number[at - 1] == 1.0) continue;
    const std::vector<double> given(number.begin() + (k - kAround), number.begin() + (k + kAround));
    if (given.back() - given.front() > 2 * kAround + kMostLost) continue;
    const Eigen::MatrixXd near = q.middleRows(k - kAround, 2 * kAround);
    const auto rough = [&](Index moved) {
      std::vector<double> tried = given;
      move_loss(tried, kAround, moved);
      const Eigen::Map<const VectorXd> x(tried.data(), 2 * kAround);
      return roughness(near, (x.array() - given[kAround]) / kAround);
    };
    double least = rough(0) - kSure;
    Index best = 0;
    for (Index moved = -kMostMoved; moved <= kMostMoved; ++moved) {
      if (moved == 0) continue;
      const double left = rough(moved);
      if (left < least) least = left, best = moved;
    }
    move_loss(number, k, best);
    k += std::max(best, Index{0});
  }
}

/// Lines through what stamps are ahead of evenly spaced beats, each read in its middle.
VectorXd line_through(const Beats& beats, const VectorXd& ahead) {
  const Index reach = std::max(kLeastReach, static_cast<Index>(kReach / beats.period));
  VectorXd line(ahead.size());
  for (std::size_t s = 0; s + 1 < beats.begin.size(); ++s) {
    const Index begin = beats.begin[s], end = beats.begin[s + 1];
    double n = 0.0, x = 0.0, xx = 0.0, y = 0.0, xy = 0.0;
    const double origin = beats.number[static_cast<std::size_t>(begin)];
    const auto count = [&](Index k, double sign) {
      const double at = beats.number[static_cast<std::size_t>(k)] - origin;
      n += sign, x += sign * at, xx += sign * at * at, y += sign * ahead[k], xy += sign * at * ahead[k];
    };
    Index from = begin, to = begin;
    for (Index k = begin; k < end; ++k) {
      while (to < std::min(end, k + reach + 1)) count(to++, 1.0);
      while (from < k - reach) count(from++, -1.0);
      const double scatter = xx - x * x / n;
      const double slope = scatter > 0.0 ? (xy - x * y / n) / scatter : 0.0;
      line[k] = y / n + slope * (beats.number[static_cast<std::size_t>(k)] - origin - x / n);
    }
  }
  return line;
}

/// When an even clock beat at each row.
VectorXd even_clock(const VectorXd& time, const Beats& beats) {
  VectorXd ahead(time.size());
  for (Index k = 0; k < time.size(); ++k)
    ahead[k] = time[k] - time[0] - beats.period * beats.number[static_cast<std::size_t>(k)];
  VectorXd line = line_through(beats, ahead);
  // Once more, so that a stamp that came late by many periods does not pull.
  const VectorXd off = (ahead - line).cwiseMax(-0.5 * beats.period).cwiseMin(0.5 * beats.period);
  line = line_through(beats, line + off);
  // A window with edges lets each stamp that enters or leaves it change the clock's rate at once, which looks like acceleration.
  // Three windows one after the other have none.
  for (int pass = 0; pass < 2; ++pass) line = line_through(beats, line);
  return time - ahead + line;
}

/// Fourth differences of a joint's positions, and what they are if the samples lie where the stamps say.
struct Differences {
  std::vector<double> seen, expected;
  std::vector<Index> row;
};

Differences differences_of(const Eigen::Ref<const VectorXd>& q, const VectorXd& even, const VectorXd& off,
                           const Beats& beats) {
  Differences d;
  const auto shift = [&](Index k) {
    return off[k] * (q[k + kHalf] - q[k - kHalf]) / (even[k + kHalf] - even[k - kHalf]);
  };
  for (Index k = 2 * kHalf; k + 2 * kHalf < q.size(); ++k) {
    const auto at = static_cast<std::size_t>(k);
    if (beats.number[at + kHalf] - beats.number[at - kHalf] != 2.0 * kHalf) continue;  // a row is lost there
    double seen = 0.0, expected = 0.0;
    for (Index m = -kHalf; m <= kHalf; ++m) {
      const double weight = kFourth[static_cast<std::size_t>(m + kHalf)];
      seen += weight * (q[k + m] - q[k]);
      expected += weight * shift(k + m);
    }
    d.seen.push_back(seen);
    d.expected.push_back(expected);
    d.row.push_back(k);
  }
  return d;
}

/// Slope of all joints' differences over what is expected, each joint weighted by what it leaves.
void fit_followed(const std::vector<Differences>& joints, const VectorXd& even, SampleTimes& result) {
  std::vector<double> weights;
  for (const Differences& d : joints) {
    double xx = 0.0, xy = 0.0, yy = 0.0;
    for (std::size_t k = 0; k < d.seen.size(); ++k) {
      xx += d.expected[k] * d.expected[k];
      xy += d.expected[k] * d.seen[k];
      yy += d.seen[k] * d.seen[k];
    }
    const double left = xx > 0.0 ? yy - xy * xy / xx : yy;
    weights.push_back(left > 0.0 ? static_cast<double>(d.seen.size()) / left : 0.0);
  }
  double down = 0.0, up = 0.0;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    for (std::size_t k = 0; k < joints[j].seen.size(); ++k) {
      down += weights[j] * joints[j].expected[k] * joints[j].expected[k];
      up += weights[j] * joints[j].expected[k] * joints[j].seen[k];
    }
  }
  if (!(down > 0.0)) return;
  result.followed = up / down;
  std::vector<double> scores(static_cast<std::size_t>(even[even.size() - 1] - even[0]) + 2, 0.0);
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const Differences& d = joints[j];
    for (std::size_t k = 0; k < d.seen.size(); ++k) {
      const double left = d.seen[k] - result.followed * d.expected[k];
      const double second = std::max(0.0, even[d.row[k]] - even[0]);
      scores[std::min(scores.size() - 1, static_cast<std::size_t>(second))] +=
          weights[j] * d.expected[k] * left;
    }
  }
  double squares = 0.0;
  for (const double score : scores) squares += score * score;
  result.std = std::sqrt(squares) / down;
}

}  // namespace

bool SampleTimes::known() const { return std::isfinite(followed) && std < kUndecided; }

SampleTimes sample_times(const Log& log) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  SampleTimes result{log.time, 0.0, kNone, kNone};
  if (log.time.size() <= 4 * kHalf || is_uniform(log.time)) return result;
  Beats beats = count_beats(log.time);
  settle_losses(log.q, beats.number);
  const VectorXd even = even_clock(log.time, beats);
  const VectorXd off = log.time - even;
  result.scatter = std::sqrt(off.squaredNorm() / static_cast<double>(off.size())) / beats.period;
  if (result.scatter < kEven) return result;
  std::vector<Differences> joints;
  for (Index j = 0; j < log.q.cols(); ++j) joints.push_back(differences_of(log.q.col(j), even, off, beats));
  fit_followed(joints, even, result);
  if (!result.known() || result.followed > kFollow) return result;
  const VectorXd time = even + std::max(0.0, result.followed) * off;
  const Index rows = time.size() - 1;
  if ((time.tail(rows) - time.head(rows)).minCoeff() > 0.0) result.time = time;
  return result;
}

Log with_sample_times(Log log, std::vector<std::string>& notes) {
  const SampleTimes times = sample_times(log);
  const double percent = 100.0 * times.scatter;
  if (times.known() && times.followed <= kFollow) {
    notes.push_back(fmt::format(
        "{}: time stamps scatter by {:.2g} % of a period about an even clock, and the positions follow {:.0f} % of it: "
        "samples are placed accordingly",
        log.path, percent, 100.0 * std::clamp(times.followed, 0.0, 1.0)));
    log.time = times.time;
  } else if (!times.known() && times.scatter > kWorthNoting) {
    notes.push_back(fmt::format(
        "{}: time stamps scatter by {:.2g} % of a period about an even clock, and the motion does not show whether the "
        "samples do: the stamps are used as they are",
        log.path, percent));
  }
  return log;
}

}  // namespace heft::data
