#include "robust.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "heft/regression/scaled_svd.hpp"

namespace heft::identify {
namespace {

/// Median of many sizes without keeping them: counts by the logarithm.
class SizeHistogram {
 public:
  /// @param about  a size of the expected order
  explicit SizeHistogram(double about) : about_(about > 0.0 ? about : 1.0), counts_(kBins, 0) {}

  void add(double size) {
    const double place = size > 0.0 ? std::log2(size / about_) * kPerOctave + kZero : 0.0;
    ++counts_[static_cast<std::size_t>(std::clamp(place, 0.0, kBins - 1.0))];
    ++total_;
  }
  /// 0 without sizes, or when half of them lie below the range (40 octaves under the expected order).
  double median() const {
    if (total_ == 0) return 0.0;
    const double half = 0.5 * static_cast<double>(total_);
    double below = 0.0;
    for (std::size_t i = 0; i < counts_.size(); ++i) {
      const auto here = static_cast<double>(counts_[i]);
      if (below + here < half) {
        below += here;
        continue;
      }
      if (i == 0) return 0.0;
      return about_ * std::exp2((static_cast<double>(i) + (half - below) / here - kZero) / kPerOctave);
    }
    return 0.0;
  }

 private:
  static constexpr double kPerOctave = 256.0;
  static constexpr double kZero = 40.0 * kPerOctave;
  static constexpr int kBins = 64 * 256;
  double about_;
  std::vector<long> counts_;
  long total_{0};
};

enum class Loss { kHuber, kTukey };

/// ω(u) = ψ(u)/u and ψ'(u).
struct Weight {
  double weight, slope;
};

Weight weight_of(Loss loss, double u, const RobustOptions& options) {
  const double size = std::abs(u);
  if (loss == Loss::kHuber) {
    if (size <= options.huber) return {1.0, 1.0};
    return {options.huber / size, 0.0};
  }
  if (size >= options.tukey) return {0.0, 0.0};
  // ψ = u (1 − v)², v = (u/c)²; ψ' = (1 − v)(1 − 5 v).
  const double v = u * u / (options.tukey * options.tukey);
  return {(1.0 - v) * (1.0 - v), (1.0 - v) * (1.0 - 5.0 * v)};
}

/// Keeps the rows of the first pass while they are small enough.
class RowStore {
 public:
  RowStore(const ObservationPass& pass, std::size_t limit) : pass_(pass), limit_(limit) {}

  void for_each(const std::function<void(const regression::ObservationRows&)>& rows) {
    if (complete_) {
      for (const regression::ObservationRows& piece : kept_) rows(piece);
      return;
    }
    std::size_t bytes = 0;
    kept_.clear();
    pass_([&](const regression::ObservationRows& piece) {
      bytes += sizeof(double) * static_cast<std::size_t>(piece.W.size() + 2 * piece.tau.size());
      if (bytes <= limit_) {
        kept_.push_back(piece);
      } else {
        kept_.clear();
      }
      rows(piece);
    });
    complete_ = bytes <= limit_;
    limit_ = complete_ ? limit_ : 0;
  }

 private:
  const ObservationPass& pass_;
  std::size_t limit_;
  bool complete_{false};
  std::vector<regression::ObservationRows> kept_;
};

/// Least squares in columns of norm 1; directions below rounding stay at `start`.
Eigen::VectorXd solve_from(const regression::TriangularFactor& data, const Eigen::VectorXd& start) {
  const Eigen::MatrixXd R = data.R();
  const auto [scale, svd] = regression::scaled_svd(R);
  const Eigen::Index rank = (svd.values.array() > 1e-10 * svd.values[0]).count();
  const Eigen::VectorXd along = svd.U.leftCols(rank).transpose() * (data.z() - R * start);
  return start + (svd.V.leftCols(rank) * along.cwiseQuotient(svd.values.head(rank))).cwiseQuotient(scale);
}

/// Rows, their estimate and its scales while the weights change.
class Reweighting {
 public:
  Reweighting(const ObservationPass& pass, const Eigen::VectorXd& start_beta,
              const Eigen::VectorXd& start_noise, const RobustOptions& options)
      : options_(options),
        start_noise_(start_noise),
        store_(pass, options.row_memory),
        beta_(start_beta),
        has_rows_(Eigen::VectorXd::Zero(start_noise.size())),
        torque_(has_rows_) {
    find_first_scale();
  }

  /// Solves with new weights, `limit` times at most. @return whether they converge
  bool iterate(Loss loss, int limit);
  /// The estimate with rows whose jackknife is that of the M-estimate.
  RobustFit result(Loss loss);

 private:
  /// What one look at all rows gives.
  struct Look {
    regression::BlockFactors factors;
    Eigen::VectorXd scale;         ///< n, of the residuals of the β looked at
    Eigen::VectorXd downweighted;  ///< n
    Eigen::VectorXd slope_ratio;   ///< n: k = mean ψ' / mean ω
  };

  Eigen::Index num_joints() const { return start_noise_.size(); }
  void check(const regression::ObservationRows& rows) const;
  void find_first_scale();
  Look look(Loss loss, const Eigen::VectorXd& slope_ratio);
  std::vector<SizeHistogram> histograms_about(const Eigen::VectorXd& sizes) const;
  Eigen::VectorXd scales_of(const std::vector<SizeHistogram>& histograms) const;

  const RobustOptions& options_;
  const Eigen::VectorXd& start_noise_;
  RowStore store_;
  Eigen::VectorXd beta_;
  Eigen::VectorXd scale_;     ///< n
  Eigen::VectorXd has_rows_;  ///< n: how many
  Eigen::VectorXd torque_;    ///< n: largest of the rows
  int iterations_{0};
};

void Reweighting::check(const regression::ObservationRows& rows) const {
  if (rows.W.cols() == beta_.size() && rows.joint >= 0 && rows.joint < num_joints()) return;
  throw DataError(
      fmt::format("robust fit: rows of joint {} with {} columns; expected at most {} joints and {} "
                  "columns, as the start has",
                  rows.joint + 1, rows.W.cols(), num_joints(), beta_.size()));
}

std::vector<SizeHistogram> Reweighting::histograms_about(const Eigen::VectorXd& sizes) const {
  std::vector<SizeHistogram> histograms;
  for (const double size : sizes) histograms.emplace_back(size);
  return histograms;
}

/// A residual of nothing but rounding must not make a scale of 0.
Eigen::VectorXd Reweighting::scales_of(const std::vector<SizeHistogram>& histograms) const {
  Eigen::VectorXd scale(num_joints());
  for (Eigen::Index j = 0; j < num_joints(); ++j) {
    const double median = histograms[static_cast<std::size_t>(j)].median();
    scale[j] = has_rows_[j] > 0.0 ? std::max({1.4826 * median, 1e-12 * torque_[j], 1e-300}) : start_noise_[j];
  }
  return scale;
}

void Reweighting::find_first_scale() {
  std::vector<SizeHistogram> histograms = histograms_about(start_noise_);
  store_.for_each([&](const regression::ObservationRows& rows) {
    check(rows);
    has_rows_[rows.joint] += static_cast<double>(rows.tau.size());
    if (rows.tau.size() > 0)
      torque_[rows.joint] = std::max(torque_[rows.joint], rows.tau.cwiseAbs().maxCoeff());
    const Eigen::VectorXd r = rows.tau - rows.W * beta_;
    for (const double e : r) histograms[static_cast<std::size_t>(rows.joint)].add(std::abs(e));
  });
  scale_ = scales_of(histograms);
}

/// Reweighted rows around β. With the ratios k of a look before, rows are stored so that the jackknife of their
/// factors is that of the M-estimate (robust.md); with ones, as weighted least squares has them.
Reweighting::Look Reweighting::look(Loss loss, const Eigen::VectorXd& slope_ratio) {
  const Eigen::Index n = num_joints();
  Look out{regression::BlockFactors(static_cast<int>(n), static_cast<int>(beta_.size()), options_.block,
                                    options_.max_blocks),
           {},
           Eigen::VectorXd::Zero(n),
           Eigen::VectorXd::Ones(n)};
  std::vector<SizeHistogram> histograms = histograms_about(scale_);
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(n), slopes = Eigen::VectorXd::Zero(n);
  store_.for_each([&](const regression::ObservationRows& rows) {
    const int j = rows.joint;
    const double k = slope_ratio[j];
    const Eigen::VectorXd model = rows.W * beta_;
    Eigen::VectorXd root(rows.tau.size()), target(rows.tau.size());
    for (Eigen::Index i = 0; i < rows.tau.size(); ++i) {
      const double r = rows.tau[i] - model[i];
      const Weight w = weight_of(loss, r / scale_[j], options_);
      histograms[static_cast<std::size_t>(j)].add(std::abs(r));
      out.downweighted[j] += w.weight < 0.5 ? 1.0 : 0.0;
      weights[j] += w.weight;
      slopes[j] += w.slope;
      root[i] = std::sqrt(w.weight * k);
      target[i] = root[i] * (model[i] + r / k);
    }
    out.factors.add(rows.log, j, rows.time, root.asDiagonal() * rows.W, target);
  });
  out.scale = scales_of(histograms);
  for (Eigen::Index j = 0; j < n; ++j) {
    if (has_rows_[j] > 0.0) out.downweighted[j] /= has_rows_[j];
    // Below a tenth the weights have thrown out nearly all rows, and the first order says nothing.
    if (weights[j] > 0.0) out.slope_ratio[j] = std::clamp(slopes[j] / weights[j], 0.1, 1.0);
  }
  return out;
}

/// Huber moves the scales along; Tukey keeps those that Huber left, as MM-estimates do: a median that moves
/// with the weights can make the weights go round in circles.
bool Reweighting::iterate(Loss loss, int limit) {
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(num_joints());
  for (int i = 0; i < limit; ++i) {
    const Look now = look(loss, ones);
    const regression::TriangularFactor data = now.factors.weighted(scale_.cwiseAbs2().cwiseInverse());
    const Eigen::VectorXd next = options_.solve ? options_.solve(data) : solve_from(data, beta_);
    const double moved =
        (data.R() * (next - beta_)).norm() / std::sqrt(std::max(1.0, static_cast<double>(data.rows())));
    const double scale_moved = (now.scale - scale_).cwiseQuotient(scale_).cwiseAbs().maxCoeff();
    beta_ = next;
    ++iterations_;
    if (loss == Loss::kHuber) scale_ = now.scale;
    if (moved < options_.tolerance && (loss == Loss::kTukey || scale_moved < 10.0 * options_.tolerance))
      return true;
  }
  return limit == 0;
}

RobustFit Reweighting::result(Loss loss) {
  // The ratio first, then the rows with it, both around the last β.
  const Look ratio = look(loss, Eigen::VectorXd::Ones(num_joints()));
  Look last = look(loss, ratio.slope_ratio);
  return {beta_, last.scale, std::move(last.factors), last.downweighted, iterations_, false};
}

}  // namespace

RobustFit fit_robust(const ObservationPass& pass, const Eigen::VectorXd& start_beta,
                     const Eigen::VectorXd& start_noise, const RobustOptions& options) {
  Reweighting reweighting(pass, start_beta, start_noise, options);
  bool converged = reweighting.iterate(Loss::kHuber, options.max_huber);
  Loss loss = Loss::kHuber;
  if (options.max_tukey > 0) {
    loss = Loss::kTukey;
    converged = reweighting.iterate(loss, options.max_tukey);
  }
  RobustFit fit = reweighting.result(loss);
  fit.converged = converged;
  return fit;
}

RobustFit fit_robust(const regression::RegressionColumns& columns, const regression::BaseParameters& base,
                     const std::vector<const data::MotionStream*>& logs,
                     const regression::ObservationOptions& observation, const Eigen::VectorXd& start_beta,
                     const Eigen::VectorXd& start_noise, const RobustOptions& options,
                     const std::function<void(double)>& progress) {
  double passes = 0.0;
  const ObservationPass pass = [&](const std::function<void(const regression::ObservationRows&)>& rows) {
    regression::for_each_observation(columns, base.kept, logs, observation, rows);
    passes += 1.0;
    // How many passes there will be is not known; each covers a quarter of what is left.
    if (progress) progress(1.0 - std::pow(0.75, passes));
  };
  RobustFit fit = fit_robust(pass, start_beta, start_noise, options);
  if (progress) progress(1.0);
  return fit;
}

}  // namespace heft::identify
