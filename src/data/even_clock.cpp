#include "even_clock.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/QR>

namespace heft::data {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Way to both sides through which the even clock is a line: at least so many rows, to be long against the scatter, and so long
/// [s] that its bends are slow against the motion; short against the drift of clocks. No more than so many, whatever unit time is in.
constexpr Index kLineRows = 100, kMostLineRows = 20000;
constexpr double kLineSeconds = 1.0;
/// Rows, at most, that wait together for whoever stamps them; and so many near a loss say before which it is.
constexpr Index kLongestWait = 50, kNear = 7;
/// Lines through lines: each of them reaches as far.
constexpr Index kLines = 4;

Index reach_of(double period) {
  const double rows = std::min(kLineSeconds / period, static_cast<double>(kMostLineRows));
  return std::max(kLineRows, static_cast<Index>(rows));
}

/// Rows of a log as a clock with an even beat counts them.
struct Beats {
  double period;               ///< [s]
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

/// @param longest  a longer step is a gap [s]
Beats count_beats(const VectorXd& time, double period, double longest) {
  Beats beats{period, {0.0}, {0}};
  // Stamps pull the clock slowly, so that no single one counts a row twice.
  constexpr double kPull = 0.1;
  double clock = time[0];
  for (Index k = 1; k < time.size(); ++k) {
    const double passed = 1.0 + lost_before(time, k, clock + beats.period, beats.period);
    beats.number.push_back(beats.number.back() + passed);
    if (time[k] - time[k - 1] > longest) {
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
  const Index reach = reach_of(beats.period);
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
VectorXd beat_times(const VectorXd& time, const Beats& beats) {
  VectorXd ahead(time.size());
  for (Index k = 0; k < time.size(); ++k)
    ahead[k] = time[k] - time[0] - beats.period * beats.number[static_cast<std::size_t>(k)];
  VectorXd line = line_through(beats, ahead);
  // Once more, so that a stamp that came late by many periods does not pull.
  const VectorXd off = (ahead - line).cwiseMax(-0.5 * beats.period).cwiseMin(0.5 * beats.period);
  line = line_through(beats, line + off);
  // A window with edges lets each stamp that enters or leaves it change the clock's rate at once, which looks like acceleration.
  // Three windows one after the other have none.
  for (Index pass = 2; pass < kLines; ++pass) line = line_through(beats, line);
  return time - ahead + line;
}

}  // namespace

Index even_clock_margin(double period) {
  // The count of rows forgets its first stamp, whatever it is, in a hundred of them.
  constexpr Index kCounting = 150;
  return kLines * reach_of(period) + kLongestWait + kCounting;
}

EvenClock even_clock(const VectorXd& time, const Eigen::MatrixXd& q, double period, double longest) {
  Beats beats = count_beats(time, period, longest);
  settle_losses(q, beats.number);
  EvenClock clock;
  clock.time = beat_times(time, beats);
  clock.number = std::move(beats.number);
  return clock;
}

}  // namespace heft::data
