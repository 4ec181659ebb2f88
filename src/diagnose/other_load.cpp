#include "other_load.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include <fmt/format.h>

#include "heft/statistics/block_jackknife.hpp"
#include "heft/statistics/distributions.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Mass and first moment of the last link, as far as the base has them: b × k; no columns without the mass.
MatrixXd load_share(const BaseModel& base, int num_joints) {
  const MatrixXd link = base.link_share(num_joints - 1);
  std::vector<int> entries;
  for (int e = 0; e < 4; ++e) {
    if (link.col(e).norm() > 1e-12) entries.push_back(e);
  }
  if (entries.empty() || entries.front() != 0) return {};
  return link(Eigen::all, entries);
}

/// What the written model leaves of the validation logs.
struct Left {
  const MotionTable& table;
  const BaseModel& base;
  BaseRows rows;
  std::vector<MatrixXd> columns;  ///< of the load in each joint
  MatrixXd predicted;             ///< m × n [N·m, N]
  VectorXd noise;                 ///< n: σ of each joint's rows [N·m, N]
};

struct Fitted {
  VectorXd estimate, half_width;  ///< the intervals hold in 99.9 %
  bool sure_of(Index entry) const { return std::abs(estimate[entry]) > half_width[entry]; }
};

/// Fits a load to it, error = x load, or a load and the torque's scale, error = x load + τ s; the errors were made with base
/// parameters that are uncertain themselves.
/// @param covariance  of these, b × b
Fitted fitted(const Left& left, bool with_scale, const MatrixXd& covariance) {
  constexpr double kChance = 1e-3;
  constexpr std::size_t kGroups = 10;  // of neighbouring blocks, which err together
  constexpr double kUnknown = 1e6;     // variance of a prior that says nothing [kg², (kg·m)², 1]
  const MotionTable& table = left.table;
  const Index k = left.columns.front().cols(), all = k + (with_scale ? 1 : 0);
  const std::size_t count = table.blocks.size(), groups = std::min(kGroups, count);
  statistics::BlockJackknife sums(VectorXd::Zero(all), VectorXd::Constant(all, kUnknown));
  VectorXd w(all);
  for (int j = 0; j < table.num_joints; ++j) {
    const auto s = static_cast<std::size_t>(j);
    const double variance = left.noise[j] * left.noise[j];
    VectorXd by_base = VectorXd::Zero(left.base.columns());
    for (std::size_t b = 0; b < count; ++b) {
      const Block& at = table.blocks[b];
      const auto group = static_cast<int>(b * groups / count);
      for (Index i = at.begin; i < at.begin + at.count; ++i) {
        if (table.keep(i, j) == 0.0) continue;
        w.head(k) = left.columns[s].row(i).transpose();
        if (with_scale) w[k] = left.predicted(i, j);
        by_base(left.base.places()[s]) = left.rows[s].row(i).transpose();
        sums.add(group, w, table.tau(i, j) - left.predicted(i, j), variance);
        sums.add_dependence(group, w, by_base, variance);
      }
    }
  }
  const statistics::BlockJackknife::Result found = sums.solve();
  const auto unknown = std::numeric_limits<double>::infinity();
  if (found.blocks < 2) return {found.estimate, VectorXd::Constant(all, unknown)};
  std::vector<int> members(static_cast<std::size_t>(sums.num_blocks()));
  std::iota(members.begin(), members.end(), 0);
  const MatrixXd D = sums.dependence(members);
  const VectorXd variance = (found.covariance + D * covariance * D.transpose()).diagonal().cwiseMax(0.0);
  return {found.estimate, statistics::student_quantile(kChance, found.blocks - 1.0) * variance.cwiseSqrt()};
}

/// Whether a load moves a joint by more than its training error, rms over rows that count.
bool moves_more(const Left& left, const VectorXd& load) {
  const MatrixXd& keep = left.table.keep;
  for (Index j = 0; j < keep.cols(); ++j) {
    const double rows = keep.col(j).sum();
    const VectorXd moved = (left.columns[static_cast<std::size_t>(j)] * load).cwiseProduct(keep.col(j));
    if (rows > 0.0 && moved.norm() > std::sqrt(rows) * left.noise[j]) return true;
  }
  return false;
}

}  // namespace

std::string in_words(const OtherLoad& load) {
  return fmt::format("in the validation logs the arm carries {:.2g} ± {:.2g} kg {} at its last link than in the training logs (99.9 %)",
                     std::abs(load.mass), load.half_width, load.mass > 0.0 ? "more" : "less");
}

std::optional<OtherLoad> other_load(const WrittenModel& written, const BaseModel& base,
                                    const model::FitRecord& parameters, const JudgedMotion& trained) {
  const MotionTable& table = written.judged().table();
  const Index b = base.columns();
  const MatrixXd share = load_share(base, table.num_joints);
  if (share.size() == 0 || parameters.parameter_covariance.rows() < b) return {};
  Left left{table, base, base.rows(rigid_motion(table)), {}, written.judged().predicted(written.robot()),
            trained.rms_error(trained.predicted(written.robot())).cwiseMax(1e-12)};
  left.columns = base.columns_of(left.rows, share);
  const MatrixXd covariance = parameters.parameter_covariance.topLeftCorner(b, b);
  // A torque scale is told from a load, and then left out if there is none.
  const Index k = share.cols();
  Fitted load = fitted(left, true, covariance);
  if (!load.sure_of(0)) return {};
  if (!load.sure_of(k)) load = fitted(left, false, covariance);
  if (!load.sure_of(0) || !moves_more(left, load.estimate.head(k))) return {};
  return OtherLoad{load.estimate[0], load.half_width[0]};
}

}  // namespace heft::diagnose
