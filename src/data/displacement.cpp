#include "displacement.hpp"

#include <algorithm>
#include <cmath>

#include "heft/core/effects/displacement.hpp"

namespace heft::data {
namespace {

using Eigen::Index;

/// Slower rows show the noise of a position [rad/s, m/s].
constexpr double kRestingSpeed = 5e-3;
/// How far the position as logged may lie from where the joint is, in standard deviations.
constexpr double kPositionReach = 4.0;

}  // namespace

void PositionNoise::add(const Eigen::Ref<const Eigen::MatrixXd>& q,
                        const Eigen::Ref<const Eigen::MatrixXd>& qd) {
  for (Index joint = 0; joint < q.cols(); ++joint) {
    const auto velocity = qd.col(joint);
    for (Index k = 1; k < q.rows(); ++k) {
      if (!(std::max(std::abs(velocity[k]), std::abs(velocity[k - 1])) < kRestingSpeed)) continue;
      const double step = q(k, joint) - q(k - 1, joint);
      squares_[joint] += step * step;
      rows_[joint] += 1.0;
    }
  }
}

Eigen::RowVectorXd PositionNoise::value() const {
  // A difference of two positions has twice the variance.
  return (0.5 * squares_.array() / rows_.array().max(1.0)).sqrt().matrix();
}

Eigen::MatrixXd travelled(const Eigen::VectorXd& time, const Eigen::Ref<const Eigen::MatrixXd>& q,
                          const Eigen::Ref<const Eigen::MatrixXd>& qd, const Eigen::RowVectorXd& noise) {
  const Index n = q.cols(), count = time.size();
  Eigen::MatrixXd result(count, kMeasuredDisplacements * n);
  for (Index joint = 0; joint < n; ++joint) {
    const auto position = q.col(joint), velocity = qd.col(joint);
    const double reach = kPositionReach * noise[joint];
    auto free = result.col(joint), held = result.col(n + joint);
    free[0] = held[0] = position[0];
    for (Index k = 1; k < count; ++k) {
      double step = 0.5 * (velocity[k] + velocity[k - 1]) * (time[k] - time[k - 1]);
      if (!std::isfinite(step)) step = position[k] - position[k - 1];  // a velocity dropped out
      free[k] = free[k - 1] + step;
      held[k] = std::clamp(held[k - 1] + step, position[k] - reach, position[k] + reach);
    }
  }
  return result;
}

Eigen::MatrixXd on_even_rows(const Eigen::VectorXd& grid, double sample_rate, const Eigen::VectorXd& time,
                             const Eigen::MatrixXd& path) {
  const Index count = time.size();
  Eigen::MatrixXd even(grid.size(), path.cols());
  const double half = 0.5 / sample_rate;
  Index at = 0;
  for (Index k = 0; k < grid.size(); ++k) {
    const double t = grid[k];
    while (at + 2 < count && time[at + 1] < t) ++at;
    const Index next = std::min(at + 1, count - 1);
    const double span = time[next] - time[at];
    const double share = span > 0.0 ? std::clamp((t - time[at]) / span, 0.0, 1.0) : 0.0;
    const Eigen::RowVectorXd between = (1.0 - share) * path.row(at) + share * path.row(next);
    even.row(k) = between;
    Index first = at;
    while (first > 0 && time[first - 1] > t - half) --first;
    for (Index i = first; i < count && time[i] <= t + half; ++i) {
      if (time[i] <= t - half || i == 0 || i + 1 == count) continue;
      for (Index c = 0; c < path.cols(); ++c) {
        const double x = path(i, c);
        const bool turns = (x - path(i - 1, c)) * (path(i + 1, c) - x) < 0.0;
        if (turns && std::abs(x - between[c]) > std::abs(even(k, c) - between[c])) even(k, c) = x;
      }
    }
  }
  return even;
}

Eigen::MatrixXd steps(const Eigen::MatrixXd& x, Index first, Index rows) {
  Eigen::MatrixXd d = Eigen::MatrixXd::Zero(rows, x.cols());
  const Index from = first > 0 ? 0 : 1;  // nothing precedes the first row
  d.bottomRows(rows - from) =
      x.middleRows(first + from, rows - from) - x.middleRows(first + from - 1, rows - from);
  return d;
}

}  // namespace heft::data
