#include "other_load.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "heft/host/decompositions.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/statistics/jackknife.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Sums over rows of all joints, each weighted by the training error w = 1/σ², x the columns of the load.
struct Sums {
  MatrixXd A;  ///< Σ w xᵀx
  VectorXd g;  ///< Σ w xᵀ error
};

struct Gathered {
  std::vector<Sums> groups;  ///< of neighbouring rows, which err together
  Sums all;
  MatrixXd by_base;               ///< Σ w xᵀ W, W the base columns
  std::vector<MatrixXd> columns;  ///< x of each joint, 0 in rows that do not count
};

/// @param share  b × k, what the load's parameters add to the base parameters
/// @param noise  n, σ
Gathered gathered(const MotionTable& table, const BaseModel& base, const MatrixXd& share, const MatrixXd& error,
                  const VectorXd& noise) {
  constexpr std::size_t kGroups = 10;
  const Index k = share.cols();
  const BaseRows rows = base.rows(rigid_motion(table));
  const std::size_t count = table.blocks.size(), groups = std::min(kGroups, count);
  const Sums none{MatrixXd::Zero(k, k), VectorXd::Zero(k)};
  Gathered made{std::vector<Sums>(groups, none), none, MatrixXd::Zero(k, base.columns()), {}};
  for (int j = 0; j < table.num_joints; ++j) {
    const auto s = static_cast<std::size_t>(j);
    const std::vector<int>& places = base.places()[s];
    const double weight = 1.0 / (noise[j] * noise[j]);
    made.columns.push_back((rows[s] * share(places, Eigen::all)).array().colwise() * table.keep.col(j).array());
    for (std::size_t block = 0; block < count; ++block) {
      const Block& at = table.blocks[block];
      const auto x = made.columns[s].middleRows(at.begin, at.count);
      Sums& sums = made.groups[block * groups / count];
      sums.A.noalias() += weight * (x.transpose() * x);
      sums.g.noalias() += weight * (x.transpose() * error.col(j).segment(at.begin, at.count));
    }
    made.by_base(Eigen::all, places) += weight * (made.columns[s].transpose() * rows[s]);
  }
  for (const Sums& one : made.groups) made.all.A += one.A, made.all.g += one.g;
  return made;
}

/// Whether a load moves a joint by more than its training error, rms over rows that count.
bool moves_more(const Gathered& made, const MatrixXd& keep, const VectorXd& load, const VectorXd& noise) {
  for (Index j = 0; j < keep.cols(); ++j) {
    const double rows = keep.col(j).sum();
    const VectorXd moved = made.columns[static_cast<std::size_t>(j)] * load;
    if (rows > 0.0 && moved.norm() > std::sqrt(rows) * noise[j]) return true;
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
  constexpr double kChance = 1e-3;
  const MotionTable& table = written.judged().table();
  const MatrixXd error = table.tau - written.judged().predicted(written.robot());
  const VectorXd noise = trained.rms_error(trained.predicted(written.robot())).cwiseMax(1e-12);
  const Index b = base.columns();
  if (parameters.parameter_covariance.rows() < b) return {};
  // Mass and first moment, as far as the base has them.
  const MatrixXd link = base.link_share(table.num_joints - 1);
  std::vector<int> entries;
  for (int e = 0; e < 4; ++e) {
    if (link.col(e).norm() > 1e-12) entries.push_back(e);
  }
  if (entries.empty() || entries.front() != 0) return {};

  Gathered made = gathered(table, base, link(Eigen::all, entries), error, noise);
  Sums& all = made.all;
  const double seen = all.A.diagonal().maxCoeff();
  if (!(seen > 0.0) || made.groups.size() < 2) return {};
  all.A.diagonal().array() += 1e-9 * seen;
  const VectorXd load = solve_symmetric(all.A, all.g);
  MatrixXd changes(load.size(), static_cast<Index>(made.groups.size()));
  for (Index group = 0; group < changes.cols(); ++group) {
    const Sums& own = made.groups[static_cast<std::size_t>(group)];
    changes.col(group) = VectorXd(solve_symmetric(all.A - own.A, all.g - own.g)) - load;
  }
  // The load takes up what the training logs leave open as well: Δx = A⁻¹ (Σ w xᵀ W) Δβ.
  const MatrixXd H = solve_symmetric(all.A, made.by_base);
  const MatrixXd covariance = statistics::jackknife_covariance(changes) +
                              H * parameters.parameter_covariance.topLeftCorner(b, b) * H.transpose();
  const double factor = statistics::student_quantile(kChance, static_cast<double>(changes.cols()) - 1.0);
  const OtherLoad found{load[0], factor * std::sqrt(std::max(0.0, covariance(0, 0)))};
  if (!(std::abs(found.mass) > found.half_width) || !moves_more(made, table.keep, load, noise)) return {};
  return found;
}

}  // namespace heft::diagnose
