#include "threshold_fit.hpp"
#include "heft/statistics/median.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include <Eigen/Cholesky>

namespace heft::monitor {
namespace {

using Normal = Eigen::Matrix<double, kCircumstances, kCircumstances>;

/// Weight of a deviation above the form; one below weighs the rest of 1.
constexpr double kExpectile = 0.9;
constexpr int kIterations = 15;
/// The constant is at least that part of the median deviation: no threshold may vanish with the circumstances.
constexpr double kLeastConstant = 0.3;
/// Share of the blocks that make up the tail: a fifth is still far above the middle and keeps the excesses many.
constexpr std::size_t kTailShare = 5;
constexpr std::size_t kLeastTail = 3;

/// Least squares without negative coefficients: the best of all sets of coefficients that may differ from zero.
Shape not_negative(const Normal& A, const Shape& b) {
  Shape best = Shape::Zero();
  double lowest = std::numeric_limits<double>::infinity();
  for (unsigned set = 1; set < (1U << kCircumstances); ++set) {
    std::vector<int> in;
    for (int c = 0; c < kCircumstances; ++c) {
      if ((set >> static_cast<unsigned>(c) & 1U) != 0 && A(c, c) > 0) in.push_back(c);
    }
    if (in.empty()) continue;
    const auto size = static_cast<Eigen::Index>(in.size());
    Eigen::MatrixXd sub = A(in, in);
    sub.diagonal() *= 1.0 + 1e-9;
    const Eigen::VectorXd x = sub.ldlt().solve(b(in));
    if (!x.allFinite() || x.minCoeff() < 0) continue;
    const double cost = x.dot(A(in, in) * x) - 2.0 * x.dot(b(in));
    if (!(cost < lowest)) continue;
    lowest = cost;
    best.setZero();
    for (Eigen::Index k = 0; k < size; ++k) best[in[static_cast<std::size_t>(k)]] = x[k];
  }
  return best;
}

/// Rows that a regression takes at most; of more, every so many.
constexpr long kMostRows = 30000;

double median_size(const std::vector<Part>& parts) {
  std::vector<double> all;
  for (const Part& part : parts) all.insert(all.end(), part.size.begin(), part.size.end());
  return statistics::median(std::move(all));
}

}  // namespace

Shape fit_shape(const std::vector<Part>& parts) {
  Shape scale = Shape::Zero();
  for (const Part& part : parts) {
    if (part.size.size() > 0)
      scale = scale.cwiseMax(part.circumstance.cwiseAbs().colwise().maxCoeff().transpose());
  }
  for (double& value : scale) value = value > 0 ? value : 1.0;
  long rows = 0;
  for (const Part& part : parts) rows += part.size.size();
  const Eigen::Index stride = 1 + rows / kMostRows;
  Shape x = Shape::Zero();
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Normal A = Normal::Zero();
    Shape b = Shape::Zero();
    for (const Part& part : parts) {
      for (Eigen::Index k = 0; k < part.size.size(); k += stride) {
        const Shape row = part.circumstance.row(k).transpose().cwiseQuotient(scale);
        const double weight = iteration == 0              ? 1.0
                              : part.size[k] > row.dot(x) ? kExpectile
                                                          : 1.0 - kExpectile;
        A.noalias() += weight * row * row.transpose();
        b += weight * part.size[k] * row;
      }
    }
    x = not_negative(A, b);
  }
  x = x.cwiseQuotient(scale);
  x[0] = std::max({x[0], kLeastConstant * median_size(parts), 1e-9});
  return x;
}

std::vector<double> block_maxima(const std::vector<Part>& parts, const Shape& shape) {
  std::vector<double> maxima;
  for (const Part& part : parts) {
    long block = -1;
    for (Eigen::Index k = 0; k < part.size.size(); ++k) {
      const double z = part.size[k] / part.circumstance.row(k).dot(shape);
      const long now = part.block[static_cast<std::size_t>(k)];
      if (now != block) maxima.push_back(z);
      block = now;
      maxima.back() = std::max(maxima.back(), z);
    }
  }
  return maxima;
}

Tail tail_of(std::vector<double> maxima) {
  std::sort(maxima.begin(), maxima.end(), std::greater<>());
  Tail tail;
  tail.blocks = static_cast<long>(maxima.size());
  const std::size_t beyond = std::min(std::max(kLeastTail, maxima.size() / kTailShare), maxima.size() - 1);
  tail.beyond = static_cast<long>(beyond);
  tail.from = maxima[beyond];
  for (std::size_t k = 0; k < beyond; ++k)
    tail.mean_excess += (maxima[k] - tail.from) / static_cast<double>(beyond);
  return tail;
}

double Tail::level(double rate) const {
  const double decades = std::log(static_cast<double>(beyond) / static_cast<double>(blocks) / rate);
  return from + mean_excess * std::max(decades, 0.0);
}

double Tail::log_rate(double level) const {
  return std::log(static_cast<double>(beyond) / static_cast<double>(blocks)) -
         (mean_excess > 0 ? (level - from) / mean_excess : std::numeric_limits<double>::infinity());
}

double Tail::log_rate_std(double level) const {
  const double decades = mean_excess > 0 ? (level - from) / mean_excess : 0.0;
  return std::sqrt((1.0 + decades * decades) / static_cast<double>(beyond));
}

}  // namespace heft::monitor
