#include "curves.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>

#include "heft/statistics/distributions.hpp"
#include "motion_signals.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kBins = 30;
constexpr int kLeastRows = 20;  ///< in a bin of a curve
constexpr int kGrid = 24, kLeastInCell = 5;
constexpr double kAway = 0.05;  ///< way looked at around a reversal: share of the joint's travel

/// One row of a curve: where it belongs, and what it holds.
struct Sample {
  double x;
  double second;          ///< since the begin of all logs: means of a second count as independent
  Eigen::Vector3d value;  ///< measured, before, after
};

/// Means in bins of about equal width of x.
JointCurves::Curve curve_of(const std::vector<Sample>& samples) {
  JointCurves::Curve curve;
  if (samples.size() < 2 * kLeastRows) return curve;
  const auto [least, most] = std::minmax_element(samples.begin(), samples.end(),
                                                 [](const Sample& a, const Sample& b) { return a.x < b.x; });
  const double low = least->x, width = (most->x - low) / kBins;
  if (!(width > 0.0)) return curve;
  struct Bin {
    double count{0.0}, x{0.0};
    Eigen::Vector3d sum{0.0, 0.0, 0.0};
    std::map<long, std::pair<double, double>> seconds;  ///< rows and sum of the measured values
  };
  std::vector<Bin> bins(kBins);
  for (const Sample& s : samples) {
    Bin& bin = bins[static_cast<std::size_t>(std::min<double>(kBins - 1, (s.x - low) / width))];
    bin.count += 1.0;
    bin.x += s.x;
    bin.sum += s.value;
    auto& [rows, sum] = bin.seconds[std::lround(s.second)];
    rows += 1.0;
    sum += s.value[0];
  }
  std::erase_if(bins, [](const Bin& bin) { return bin.count < kLeastRows; });
  const auto size = static_cast<Index>(bins.size());
  for (VectorXd* v : {&curve.x, &curve.measured, &curve.low, &curve.high, &curve.before, &curve.after})
    v->resize(size);
  for (Index b = 0; b < size; ++b) {
    const Bin& bin = bins[static_cast<std::size_t>(b)];
    const Eigen::Vector3d mean = bin.sum / bin.count;
    double squares = 0.0;  // of a mean of clusters of unequal size
    for (const auto& [second, cluster] : bin.seconds)
      squares += std::pow(cluster.second - mean[0] * cluster.first, 2);
    const auto clusters = static_cast<double>(bin.seconds.size());
    const double half =
        clusters > 1.0 ? statistics::kNormal95 * std::sqrt(squares * clusters / (clusters - 1.0)) / bin.count
                       : std::numeric_limits<double>::quiet_NaN();
    curve.x[b] = bin.x / bin.count;
    curve.measured[b] = mean[0];
    curve.low[b] = mean[0] - half;
    curve.high[b] = mean[0] + half;
    curve.before[b] = mean[1];
    curve.after[b] = mean[2];
  }
  return curve;
}

/// Rows around each change of direction, by the way from it along the new direction.
std::vector<Sample> around_reversals(const MotionTable& table, const MatrixXd& values, Index joint) {
  const double away = kAway * (table.q.col(joint).maxCoeff() - table.q.col(joint).minCoeff());
  std::vector<Sample> samples;
  for (std::size_t r = 0; r + 1 < table.run_begin.size(); ++r) {
    const Index first = table.run_begin[r], end = table.run_begin[r + 1];
    for (Index turn = first + 1; turn < end; ++turn) {
      if (!(table.qd(turn, joint) * table.qd(turn - 1, joint) < 0.0)) continue;
      const double sign = table.qd(turn, joint) > 0.0 ? 1.0 : -1.0;
      for (const Index step : {Index{-1}, Index{1}}) {
        for (Index i = step > 0 ? turn : turn - 1; i >= first && i < end; i += step) {
          const double way = std::abs(table.q(i, joint) - table.q(turn, joint));
          const bool same = (table.qd(i, joint) > 0.0) == (sign * static_cast<double>(step) > 0.0);
          if (!same || way > away || table.in_gap[i] > 0.0) break;
          samples.push_back({static_cast<double>(step) * way, table.time[i] + 1e4 * static_cast<double>(r),
                             sign * values.row(i).transpose()});
        }
      }
    }
  }
  return samples;
}

void put_map(const MotionTable& table, const VectorXd& residual, Index joint, JointCurves& curves) {
  const auto grid = [](const VectorXd& x) {
    std::vector<double> centres;
    const double low = x.minCoeff(), width = (x.maxCoeff() - low) / kGrid;
    for (int k = 0; k < kGrid; ++k) centres.push_back(low + (k + 0.5) * width);
    return centres;
  };
  const VectorXd q = table.q.col(joint), qd = table.qd.col(joint);
  if (!(q.maxCoeff() > q.minCoeff()) || !(qd.maxCoeff() > qd.minCoeff())) return;
  curves.position = grid(q);
  curves.velocity = grid(qd);
  MatrixXd sum = MatrixXd::Zero(kGrid, kGrid), count = sum;
  const auto cell = [](double value, const std::vector<double>& centres) {
    const double width = centres[1] - centres[0];
    return std::clamp(static_cast<Index>((value - centres[0]) / width + 0.5), Index{0}, Index{kGrid - 1});
  };
  for (Index i = 0; i < table.rows(); ++i) {
    if (table.keep(i, joint) == 0.0) continue;
    const Index a = cell(q[i], curves.position), b = cell(qd[i], curves.velocity);
    sum(a, b) += residual[i];
    count(a, b) += 1.0;
  }
  curves.residual =
      (count.array() >= kLeastInCell)
          .select(sum.array() / count.array().max(1.0), std::numeric_limits<double>::quiet_NaN())
          .matrix();
}

}  // namespace

std::vector<JointCurves> curves_of(const Diagnosis& diagnosis, const MotionTable& table) {
  bool fits = diagnosis.validate.size() + 1 == table.run_begin.size();
  for (std::size_t r = 0; fits && r < diagnosis.validate.size(); ++r)
    fits = diagnosis.validate[r].before.rows() == table.run_begin[r + 1] - table.run_begin[r];
  if (!fits) throw std::invalid_argument("curves_of: the traces are of another table");
  const MatrixXd load = load_of(diagnosis.after, table);
  MatrixXd before(table.rows(), table.num_joints), after = before;
  for (std::size_t r = 0; r < diagnosis.validate.size(); ++r) {
    const Traces& log = diagnosis.validate[r];
    before.middleRows(table.run_begin[r], log.before.rows()) = log.before;
    after.middleRows(table.run_begin[r], log.after.rows()) = log.after;
  }
  std::vector<JointCurves> curves(static_cast<std::size_t>(table.num_joints));
  for (Index j = 0; j < table.num_joints; ++j) {
    MatrixXd values(table.rows(), 3);
    const VectorXd measured = table.tau.col(j) - load.col(j);
    values << measured, measured - before.col(j), measured - after.col(j);
    std::vector<Sample> samples;
    for (std::size_t r = 0; r + 1 < table.run_begin.size(); ++r) {
      for (Index i = table.run_begin[r]; i < table.run_begin[r + 1]; ++i) {
        if (table.keep(i, j) > 0.0)
          samples.push_back(
              {table.qd(i, j), table.time[i] + 1e4 * static_cast<double>(r), values.row(i).transpose()});
      }
    }
    JointCurves& own = curves[static_cast<std::size_t>(j)];
    own.friction = curve_of(samples);
    own.reversal = curve_of(around_reversals(table, values, j));
    put_map(table, after.col(j), j, own);
  }
  return curves;
}

}  // namespace heft::diagnose
