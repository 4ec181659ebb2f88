#include "horizon_window.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "heft/host/decompositions.hpp"
#include "heft/statistics/correlation.hpp"
#include "heft/statistics/median.hpp"

namespace heft::identify {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Standard deviation of normal noise over the median of its size.
constexpr double kStdOfMedianSize = 1.4826;
/// Rows of a joint below which its scatter is not judged.
constexpr std::size_t kLeastRows = 10;
/// Scatter that counts before any residual is known, and the least ever, in parts of the joint's torque: below the
/// latter lies the error of any model.
constexpr double kFirstShare = 0.1, kLeastShare = 1e-4;

double root_mean_square(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value * value;
  return values.empty() ? 0.0 : std::sqrt(sum / static_cast<double>(values.size()));
}

/// Rows that hold as much as one, by the autocorrelation of the residuals without their outliers.
double correlated_rows(std::vector<double> residuals, double std) {
  for (double& r : residuals) r = std::clamp(r, -3.0 * std, 3.0 * std);
  const double variance = std::max(std::pow(root_mean_square(residuals), 2), 1e-300);
  const std::size_t m = residuals.size();
  return statistics::correlated_samples(
      [&](Index lag) {
        const auto k = static_cast<std::size_t>(lag);
        double sum = 0.0;
        for (std::size_t i = k; i < m; ++i) sum += residuals[i] * residuals[i - k];
        return sum / static_cast<double>(m) / variance;
      },
      static_cast<Index>(m / 4));
}

}  // namespace

regression::TriangularFactor widened(const regression::TriangularFactor& factor, const VectorXd& walk) {
  const Index u = factor.columns();
  std::vector<int> moving;
  for (Index i = 0; i < u; ++i) {
    if (walk[i] > 0.0) moving.push_back(static_cast<int>(i));
  }
  const auto k = static_cast<Index>(moving.size());
  if (k == 0 || factor.rows() == 0) return factor;
  // Unknown are the step w and the new s: w / D = 0, R (s − w) = z. The triangle's lower part has w eliminated.
  MatrixXd rows = MatrixXd::Zero(k + u, k + u + 1);
  const MatrixXd R = factor.R();
  for (Index i = 0; i < k; ++i) {
    const int place = moving[static_cast<std::size_t>(i)];
    rows(i, i) = 1.0 / walk[place];
    rows.col(i).tail(u) = -R.col(place);
  }
  rows.bottomRightCorner(u, u + 1) << R, factor.z();
  const MatrixXd triangle = triangle_of(rows);
  regression::TriangularFactor wider(static_cast<int>(u));
  wider.add(triangle.block(k, k, u, u), triangle.block(k, k + u, u, 1));
  return wider;
}

void HorizonWindow::transform(const MatrixXd& T, const VectorXd& x0) {
  for (Weighted& weighted : ticks_) {
    HorizonTick& tick = weighted.tick;
    tick.y -= tick.W * x0;
    tick.W = MatrixXd(tick.W * T);
  }
}

int HorizonWindow::rows() const {
  Index rows = 0;
  for (const Weighted& weighted : ticks_) rows += weighted.tick.y.size();
  return static_cast<int>(rows);
}

void HorizonWindow::guess_noise() { learn_noise({}, 1.0); }

void HorizonWindow::learn_noise(const VectorXd& s, double share) {
  std::vector<std::vector<double>> residuals(noise_.size()), torques(noise_.size());
  for (const Weighted& weighted : ticks_) {
    const HorizonTick& tick = weighted.tick;
    const VectorXd r = s.size() == 0 ? tick.y : VectorXd(tick.y - tick.W * s);
    for (Index i = 0; i < r.size(); ++i) {
      const auto joint = static_cast<std::size_t>(tick.joints[static_cast<std::size_t>(i)]);
      residuals[joint].push_back(r[i]);
      torques[joint].push_back(tick.y[i]);
    }
  }
  for (std::size_t j = 0; j < noise_.size(); ++j) {
    RowNoise& noise = noise_[j];
    const double torque = root_mean_square(torques[j]);
    if (torques[j].empty()) continue;
    if (s.size() == 0 || noise.std == 0.0) noise.std = std::max(kFirstShare * torque, 1e-9);
    if (s.size() == 0 || residuals[j].size() < kLeastRows) continue;
    const double part = noise.learnt ? share : 1.0;
    noise.learnt = true;
    std::vector<double> sizes = residuals[j];
    for (double& size : sizes) size = std::abs(size);
    const double std =
        std::max({kStdOfMedianSize * statistics::median(std::move(sizes)), kLeastShare * torque, 1e-9});
    noise.std += part * (std - noise.std);
    noise.correlated += part * (correlated_rows(std::move(residuals[j]), std) - noise.correlated);
  }
}

double HorizonWindow::weigh(const VectorXd& s, double degrees_of_freedom) {
  Index low = 0, all = 0;
  for (Weighted& weighted : ticks_) {
    const HorizonTick& tick = weighted.tick;
    const VectorXd r = tick.y - tick.W * s;
    for (Index i = 0; i < r.size(); ++i) {
      const double of_std = r[i] / noise(tick.joints[static_cast<std::size_t>(i)]).std;
      weighted.weights[i] = 1.0 / (1.0 + of_std * of_std / degrees_of_freedom);
      low += weighted.weights[i] < 0.5 ? 1 : 0;
    }
    all += r.size();
  }
  return all > 0 ? static_cast<double>(low) / static_cast<double>(all) : 0.0;
}

double HorizonWindow::scale(const Weighted& weighted, Index i) const {
  const RowNoise& row = noise(weighted.tick.joints[static_cast<std::size_t>(i)]);
  return std::sqrt(weighted.weights[i] / row.correlated) / row.std;
}

regression::TriangularFactor HorizonWindow::factor(int unknowns) const {
  MatrixXd W(rows(), unknowns);
  VectorXd y(W.rows());
  Index next = 0;
  for (const Weighted& weighted : ticks_) {
    for (Index i = 0; i < weighted.tick.y.size(); ++i, ++next) {
      const double by = scale(weighted, i);
      W.row(next) = by * weighted.tick.W.row(i);
      y[next] = by * weighted.tick.y[i];
    }
  }
  regression::TriangularFactor sum(unknowns);
  sum.add(W, y);
  return sum;
}

void HorizonWindow::move_older(double time, regression::TriangularFactor& to) {
  while (!ticks_.empty() && ticks_.front().tick.time < time) {
    const Weighted& weighted = ticks_.front();
    VectorXd by(weighted.tick.y.size());
    for (Index i = 0; i < by.size(); ++i) by[i] = scale(weighted, i);
    to.add(by.asDiagonal() * weighted.tick.W, by.cwiseProduct(weighted.tick.y));
    ticks_.pop_front();
  }
}

}  // namespace heft::identify
