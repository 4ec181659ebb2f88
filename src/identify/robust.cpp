#include "heft/identify/robust.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"

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
  Eigen::VectorXd scale = R.colwise().norm();
  scale = (scale.array() > 0.0).select(scale, 1.0);
  const Svd svd = svd_of(R * scale.cwiseInverse().asDiagonal());
  const Eigen::Index rank = (svd.values.array() > 1e-10 * svd.values[0]).count();
  const Eigen::VectorXd along = svd.U.leftCols(rank).transpose() * (data.z() - R * start);
  return start + (svd.V.leftCols(rank) * along.cwiseQuotient(svd.values.head(rank))).cwiseQuotient(scale);
}

/// What one look at all rows gives.
struct Look {
  regression::BlockFactors factors;
  Eigen::VectorXd scale;         ///< n, of the residuals of the β looked at
  Eigen::VectorXd downweighted;  ///< n
  Eigen::VectorXd slope_ratio;   ///< n: k = mean ψ' / mean ω
};

}  // namespace

RobustFit fit_robust(const ObservationPass& pass, const Eigen::VectorXd& start_beta,
                     const Eigen::VectorXd& start_noise, const RobustOptions& options) {
  const auto n = start_noise.size();
  const auto b = start_beta.size();
  RowStore store(pass, options.row_memory);
  const auto check = [&](const regression::ObservationRows& rows) {
    if (rows.W.cols() != b || rows.joint < 0 || rows.joint >= n) {
      throw DataError(
          fmt::format("robust fit: rows of joint {} with {} columns; expected at most {} joints and {} "
                      "columns, as the start has",
                      rows.joint + 1, rows.W.cols(), n, b));
    }
  };

  // Scales from β; a residual of nothing but rounding must not make a scale of 0.
  Eigen::VectorXd torque = Eigen::VectorXd::Zero(n);
  const auto scales_of = [&](const std::vector<SizeHistogram>& histograms, const Eigen::VectorXd& has_rows) {
    Eigen::VectorXd scale(n);
    for (Eigen::Index j = 0; j < n; ++j) {
      const double median = histograms[static_cast<std::size_t>(j)].median();
      scale[j] = has_rows[j] > 0.0 ? std::max({1.4826 * median, 1e-12 * torque[j], 1e-300}) : start_noise[j];
    }
    return scale;
  };
  const auto histograms_for = [&](const Eigen::VectorXd& about) {
    std::vector<SizeHistogram> histograms;
    for (Eigen::Index j = 0; j < n; ++j) histograms.emplace_back(about[j]);
    return histograms;
  };

  Eigen::VectorXd has_rows = Eigen::VectorXd::Zero(n);
  const auto first_scale = [&](const Eigen::VectorXd& beta) {
    std::vector<SizeHistogram> histograms = histograms_for(start_noise);
    store.for_each([&](const regression::ObservationRows& rows) {
      check(rows);
      has_rows[rows.joint] += static_cast<double>(rows.tau.size());
      if (rows.tau.size() > 0)
        torque[rows.joint] = std::max(torque[rows.joint], rows.tau.cwiseAbs().maxCoeff());
      const Eigen::VectorXd r = rows.tau - rows.W * beta;
      for (const double e : r) histograms[static_cast<std::size_t>(rows.joint)].add(std::abs(e));
    });
    return scales_of(histograms, has_rows);
  };

  // Reweighted rows around β with given scales; with `slope`, stored so that the jackknife of the factors is
  // that of the M-estimate (robust.md).
  const auto look = [&](Loss loss, const Eigen::VectorXd& beta, const Eigen::VectorXd& scale,
                        const Eigen::VectorXd* slope) {
    Look out{
        regression::BlockFactors(static_cast<int>(n), static_cast<int>(b), options.block, options.max_blocks),
        {},
        Eigen::VectorXd::Zero(n),
        Eigen::VectorXd::Ones(n)};
    std::vector<SizeHistogram> histograms = histograms_for(scale);
    Eigen::VectorXd weights = Eigen::VectorXd::Zero(n), slopes = Eigen::VectorXd::Zero(n);
    store.for_each([&](const regression::ObservationRows& rows) {
      const int j = rows.joint;
      const double k = slope == nullptr ? 1.0 : (*slope)[j];
      const Eigen::VectorXd model = rows.W * beta;
      Eigen::VectorXd root(rows.tau.size()), target(rows.tau.size());
      for (Eigen::Index i = 0; i < rows.tau.size(); ++i) {
        const double r = rows.tau[i] - model[i];
        const Weight w = weight_of(loss, r / scale[j], options);
        histograms[static_cast<std::size_t>(j)].add(std::abs(r));
        out.downweighted[j] += w.weight < 0.5 ? 1.0 : 0.0;
        weights[j] += w.weight;
        slopes[j] += w.slope;
        root[i] = std::sqrt(w.weight * k);
        target[i] = root[i] * (model[i] + r / k);
      }
      out.factors.add(rows.log, j, rows.time, root.asDiagonal() * rows.W, target);
    });
    out.scale = scales_of(histograms, has_rows);
    for (Eigen::Index j = 0; j < n; ++j) {
      if (has_rows[j] > 0.0) out.downweighted[j] /= has_rows[j];
      // Below a tenth the weights have thrown out nearly all rows, and the first order says nothing.
      if (weights[j] > 0.0) out.slope_ratio[j] = std::clamp(slopes[j] / weights[j], 0.1, 1.0);
    }
    return out;
  };

  RobustFit fit{start_beta,
                start_noise,
                regression::BlockFactors(static_cast<int>(n), static_cast<int>(b), options.block),
                {},
                0,
                false};
  Eigen::VectorXd scale = first_scale(start_beta);
  // Huber moves the scales along; Tukey keeps those that Huber left, as MM-estimates do: a median that moves
  // with the weights can make the weights go round in circles.
  const auto iterate = [&](Loss loss, int limit) {
    for (int i = 0; i < limit; ++i) {
      const Look now = look(loss, fit.beta, scale, nullptr);
      const Eigen::VectorXd weights = scale.cwiseAbs2().cwiseInverse();
      const regression::TriangularFactor data = now.factors.weighted(weights);
      const Eigen::VectorXd next = options.solve ? options.solve(data) : solve_from(data, fit.beta);
      const double moved =
          (data.R() * (next - fit.beta)).norm() / std::sqrt(std::max(1.0, static_cast<double>(data.rows())));
      const double scale_moved = (now.scale - scale).cwiseQuotient(scale).cwiseAbs().maxCoeff();
      fit.beta = next;
      ++fit.iterations;
      if (loss == Loss::kHuber) scale = now.scale;
      if (moved < options.tolerance && (loss == Loss::kTukey || scale_moved < 10.0 * options.tolerance))
        return true;
    }
    return limit == 0;
  };
  fit.converged = iterate(Loss::kHuber, options.max_huber);
  Loss loss = Loss::kHuber;
  if (options.max_tukey > 0) {
    loss = Loss::kTukey;
    fit.converged = iterate(Loss::kTukey, options.max_tukey);
  }

  // The factors that go out: the ratio first, then the rows with it, both around the last β.
  const Look ratio = look(loss, fit.beta, scale, nullptr);
  Look last = look(loss, fit.beta, scale, &ratio.slope_ratio);
  fit.factors = std::move(last.factors);
  fit.noise_std = last.scale;
  fit.downweighted_share = last.downweighted;
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
