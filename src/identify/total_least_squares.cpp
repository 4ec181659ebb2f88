#include "total_least_squares.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/regression/block_groups.hpp"
#include "heft/statistics/jackknife.hpp"

namespace heft::identify {
namespace {

/// Places of the columns with and without error.
struct ColumnSplit {
  std::vector<Eigen::Index> exact, noisy;
};

/// @throws DataError when the options do not fit b columns
ColumnSplit split_columns(Eigen::Index b, const TotalLeastSquaresOptions& options) {
  if ((options.column_noise.size() > 0 && options.column_noise.size() != b) ||
      (!options.exact.empty() && static_cast<Eigen::Index>(options.exact.size()) != b)) {
    throw DataError(fmt::format(
        "total least squares: {} noise levels and {} exact flags; expected none or {}, one a column",
        options.column_noise.size(), options.exact.size(), b));
  }
  ColumnSplit split;
  for (Eigen::Index i = 0; i < b; ++i) {
    const bool exact = !options.exact.empty() && options.exact[static_cast<std::size_t>(i)];
    (exact ? split.exact : split.noisy).push_back(i);
  }
  return split;
}

double number_of_rows(const regression::TriangularFactor& data) {
  return std::max(1.0, static_cast<double>(data.rows()));
}

/// k + 1: what each noisy column, and last the torque, is divided by so that all errors are alike: the noise stated,
/// else the rms over the rows.
Eigen::VectorXd noise_scales(const regression::TriangularFactor& data,
                             const TotalLeastSquaresOptions& options,
                             const std::vector<Eigen::Index>& noisy) {
  const bool given = options.column_noise.size() > 0;
  const auto scale_of = [&](Eigen::Index column, double stated) {
    if (!given) {
      const double rms = data.full().col(column).norm() / std::sqrt(number_of_rows(data));
      return rms > 0.0 ? rms : 1.0;
    }
    if (!(stated > 0.0) || !std::isfinite(stated)) {
      throw DataError(
          fmt::format("total least squares: noise {} of column {}; expected a positive number (mark columns "
                      "without error as exact)",
                      stated, column + 1));
    }
    return stated;
  };
  const auto k = static_cast<Eigen::Index>(noisy.size());
  Eigen::VectorXd scale(k + 1);
  for (Eigen::Index i = 0; i < k; ++i) {
    const Eigen::Index column = noisy[static_cast<std::size_t>(i)];
    scale[i] = scale_of(column, given ? options.column_noise[column] : 0.0);
  }
  scale[k] = scale_of(data.columns(), options.torque_noise);
  return scale;
}

/// R of [exact noisy y] = Q [R11 R12 r1; 0 R22 r2].
Eigen::MatrixXd ordered_triangle(const regression::TriangularFactor& data, const ColumnSplit& split) {
  Eigen::MatrixXd ordered(data.columns() + 1, data.columns() + 1);
  Eigen::Index place = 0;
  for (const Eigen::Index column : split.exact) ordered.col(place++) = data.full().col(column);
  for (const Eigen::Index column : split.noisy) ordered.col(place++) = data.full().col(column);
  ordered.col(place) = data.full().col(data.columns());
  return triangle_of(ordered);
}

/// Compares the noisy columns alone with the noise, which is the smallest singular value of C.
/// @param C  scaled noisy columns and torque; fit.singular_values are its
/// @return how many directions rise above the noise
Eigen::Index separate(const Eigen::MatrixXd& C, double min_separation, TotalLeastSquaresFit& fit) {
  const Eigen::Index k = C.cols() - 1;
  fit.separation = std::numeric_limits<double>::infinity();
  if (k == 0) return 0;
  const double smallest = fit.singular_values[k];
  const Eigen::VectorXd alone = singular_values(C.topLeftCorner(k, k));
  // Below rounding everything is noise, also where there is none.
  const double rounding = 1e-12 * fit.singular_values[0];
  if (smallest > rounding) fit.separation = alone[k - 1] / smallest;
  if (alone[k - 1] <= rounding) fit.separation = 1.0;
  const Eigen::Index kept = (alone.array() > std::max(min_separation * smallest, rounding)).count();
  fit.left_out = static_cast<int>(k - kept);
  fit.separated = fit.left_out == 0;
  return kept;
}

}  // namespace

TotalLeastSquaresFit total_least_squares(const regression::TriangularFactor& data,
                                         const TotalLeastSquaresOptions& options) {
  const Eigen::Index b = data.columns();
  const ColumnSplit split = split_columns(b, options);
  const auto e = static_cast<Eigen::Index>(split.exact.size());
  const auto k = static_cast<Eigen::Index>(split.noisy.size());
  const Eigen::VectorXd scale = noise_scales(data, options, split.noisy);
  const Eigen::MatrixXd R = ordered_triangle(data, split);
  const Eigen::MatrixXd C = R.bottomRightCorner(k + 1, k + 1) * scale.cwiseInverse().asDiagonal();

  TotalLeastSquaresFit fit;
  const Svd svd = svd_of(C);
  fit.singular_values = svd.values;
  fit.noise =
      fit.singular_values[k] / std::sqrt(std::max(1.0, number_of_rows(data) - static_cast<double>(b)));
  const Eigen::Index kept = separate(C, options.min_separation, fit);

  // [x; −1] ∈ span of the right vectors that belong to the smallest singular values; of these the shortest.
  const Eigen::MatrixXd V = svd.V.rightCols(k + 1 - kept);
  const Eigen::VectorXd last = V.row(k).transpose();
  const double size = last.squaredNorm();
  if (size < 1e-20) fit.separated = false;
  Eigen::VectorXd x = size > 0.0 ? Eigen::VectorXd(-(V.topRows(k) * last) / size) : Eigen::VectorXd::Zero(k);
  // In scaled columns W_i/s_i · (x_i) = y/s_y.
  x = x.cwiseQuotient(scale.head(k)) * scale[k];

  fit.beta.resize(b);
  fit.beta(split.noisy) = x;
  if (e > 0) {
    const Eigen::VectorXd right = R.col(b).head(e) - R.block(0, e, e, k) * x;
    fit.beta(split.exact) = least_squares(R.topLeftCorner(e, e), right);
  }
  return fit;
}

TotalLeastSquaresSpread total_least_squares(const regression::BlockFactors& factors,
                                            const Eigen::VectorXd& weights,
                                            const TotalLeastSquaresOptions& options, double length,
                                            double edge_factor) {
  std::vector<regression::TriangularFactor> groups;
  for (const std::vector<int>& members : regression::groups_of(factors, length)) {
    regression::TriangularFactor group(factors.num_columns());
    for (const int block : members) {
      for (int j = 0; j < factors.num_joints(); ++j) group.add(factors.factor(block, j), weights[j]);
    }
    if (group.rows() > 0) groups.push_back(std::move(group));
  }
  const std::size_t B = groups.size();
  // after[i]: groups i and later. With the running sum of those before, all but one cost one addition.
  std::vector<regression::TriangularFactor> after(B + 1, regression::TriangularFactor(factors.num_columns()));
  for (std::size_t i = B; i-- > 0;) {
    after[i] = after[i + 1];
    after[i].add(groups[i]);
  }
  TotalLeastSquaresSpread out;
  out.fit = total_least_squares(after.front(), options);
  out.groups = static_cast<int>(B);
  out.covariance = Eigen::MatrixXd::Zero(factors.num_columns(), factors.num_columns());
  if (B < 2) return out;
  Eigen::MatrixXd changes(factors.num_columns(), static_cast<Eigen::Index>(B));
  regression::TriangularFactor before(factors.num_columns());
  for (std::size_t i = 0; i < B; ++i) {
    regression::TriangularFactor rest = before;
    rest.add(after[i + 1]);
    changes.col(static_cast<Eigen::Index>(i)) = total_least_squares(rest, options).beta - out.fit.beta;
    before.add(groups[i]);
  }
  out.covariance = statistics::jackknife_covariance(changes, edge_factor);
  return out;
}

std::vector<bool> exact_columns(const regression::RegressionColumns& columns,
                                const regression::BaseParameters& base) {
  std::vector<bool> exact;
  for (const int i : base.kept) exact.push_back(columns[i].kind == regression::ColumnKind::kOffset);
  return exact;
}

}  // namespace heft::identify
