#include "heft/statistics/binned_means.hpp"

#include <algorithm>
#include <vector>

namespace heft::statistics {

using Eigen::Index;

BinnedMeans binned_means(const Eigen::VectorXd& x, const Eigen::MatrixXd& values) {
  constexpr int kBins = 240;
  BinnedMeans result;
  result.means.resize(0, values.cols());
  if (x.size() == 0) return result;
  const double low = x.minCoeff(), width = (x.maxCoeff() - low) / kBins;
  if (!(width > 0.0)) return result;
  // Columns: count, sum of x, sums of the values.
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(kBins, 2 + values.cols());
  for (Index i = 0; i < x.size(); ++i) {
    const Index bin = std::min<Index>(kBins - 1, static_cast<Index>((x[i] - low) / width));
    sums(bin, 0) += 1.0;
    sums(bin, 1) += x[i];
    sums.row(bin).tail(values.cols()) += values.row(i);
  }
  const double enough = std::max(4.0, static_cast<double>(x.size()) / (6.0 * kBins));
  std::vector<Eigen::RowVectorXd> merged;
  Eigen::RowVectorXd open = Eigen::RowVectorXd::Zero(sums.cols());
  for (Index bin = 0; bin < kBins; ++bin) {
    open += sums.row(bin);
    if (open[0] < enough) continue;
    merged.push_back(open);
    open.setZero();
  }
  if (!merged.empty()) merged.back() += open;
  result.x.resize(static_cast<Index>(merged.size()));
  result.means.resize(result.x.size(), values.cols());
  for (Index k = 0; k < result.x.size(); ++k) {
    const Eigen::RowVectorXd& sum = merged[static_cast<std::size_t>(k)];
    result.x[k] = sum[1] / sum[0];
    result.means.row(k) = sum.tail(values.cols()) / sum[0];
  }
  return result;
}

}  // namespace heft::statistics
