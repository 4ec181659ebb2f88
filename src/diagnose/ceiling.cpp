#include "ceiling.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "boosted_trees.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/parallel.hpp"
#include "motion_signals.hpp"
#include "products.hpp"
#include "residual_structure.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Rows of each of the two sets of logs: more say little new, since neighbours are correlated, and cost time.
constexpr Index kMostCeilingRows = 3000;
constexpr int kFolds = 4;
/// Stretch that is left out as one [s], and how many of them a set of logs has if it is short. Noise that drifts over
/// seconds would be read off the neighbours of shorter ones.
constexpr double kLeastStretch = 0.5, kMostStretch = 5.0, kStretches = 8.0;
/// Rows this near to what is judged are not fitted to: share of a stretch.
constexpr double kGuard = 0.15;

/// Of what a function explains between neighbours in time, the share that it explains of other logs at least.
constexpr double kRepeats = 0.25;
/// Structure above white noise, as a share, below which nothing is sought.
constexpr double kWhite = 0.02;

/// Rows picked from a table, with the stretch that each belongs to.
struct Picked {
  std::vector<Index> rows;
  std::vector<int> fold;                      ///< that it is judged in
  std::vector<int> fold_before, fold_behind;  ///< of the rows a guard before and behind it
};

Picked picked_rows(const MotionTable& table) {
  double seconds = 0.0;
  for (const double s : table.run_seconds) seconds += s;
  const double stretch = std::clamp(seconds / kStretches, kLeastStretch, kMostStretch);
  const Index stride = std::max<Index>(1, table.rows() / kMostCeilingRows);
  Picked picked;
  int first = 0;
  for (std::size_t r = 0; r + 1 < table.run_begin.size(); ++r) {
    const auto fold_at = [&](double t) {
      return (first + static_cast<int>(std::floor(std::max(0.0, t) / stretch))) % kFolds;
    };
    for (Index i = table.run_begin[r]; i < table.run_begin[r + 1]; i += stride) {
      if (table.keep.row(i).maxCoeff() == 0.0) continue;
      picked.rows.push_back(i);
      picked.fold.push_back(fold_at(table.time[i]));
      picked.fold_before.push_back(fold_at(table.time[i] - kGuard * stretch));
      picked.fold_behind.push_back(fold_at(table.time[i] + kGuard * stretch));
    }
    if (table.run_begin[r + 1] > table.run_begin[r])
      first += static_cast<int>(std::floor(table.time[table.run_begin[r + 1] - 1] / stretch)) + 1;
  }
  return picked;
}

/// Rows to fit to, and rows to judge on.
struct Fold {
  std::vector<Index> fitted, left_out;
};

/// The rows of one joint, those of the other logs before those judged on.
struct Rows {
  MatrixXd terms, features;
  VectorXd residual;
  std::vector<Fold> folds;  ///< of the judged logs; each is fitted to the other logs as well
  Fold others;              ///< all judged rows, by the other logs alone
};

/// What was said of the rows that were left out, at their places.
struct OutOfFold {
  VectorXd value;
  double squares{0.0};  ///< of what is left of the residual
};

double squares_of(const Rows& rows, const std::vector<Fold>& folds, const VectorXd& value) {
  double sum = 0.0;
  for (const Fold& fold : folds) {
    for (const Index i : fold.left_out) sum += std::pow(rows.residual[i] - value[i], 2);
  }
  return sum;
}

/// Ridge regression on the terms, its steadiness chosen for all folds at once.
/// @param whole  gets the function of each fold at every row, which trees go on from
OutOfFold by_terms(const Rows& rows, const std::vector<Fold>& folds, std::vector<VectorXd>& whole) {
  constexpr std::array<double, 4> kRidges{3e-1, 3e-2, 3e-3, 3e-4};  // of the columns scaled to an rms of 1
  const Index m = rows.terms.rows();
  OutOfFold best{VectorXd::Zero(m), 0.0};
  best.squares = squares_of(rows, folds, best.value);
  whole.assign(folds.size(), VectorXd::Zero(m));
  VectorXd scale =
      (rows.terms.colwise().squaredNorm() / static_cast<double>(std::max<Index>(1, m))).cwiseSqrt();
  for (double& s : scale) s = s > 1e-12 ? 1.0 / s : 0.0;
  const MatrixXd terms = rows.terms * scale.asDiagonal();
  std::vector<MatrixXd> information;
  std::vector<VectorXd> right;
  for (const Fold& fold : folds) {
    const MatrixXd of_fold = terms(fold.fitted, Eigen::all);
    information.push_back(gram_of(of_fold));
    right.emplace_back(of_fold.transpose() * rows.residual(fold.fitted));
  }
  for (const double ridge : kRidges) {
    OutOfFold tried{VectorXd::Zero(m), 0.0};
    std::vector<VectorXd> functions;
    for (std::size_t f = 0; f < folds.size(); ++f) {
      MatrixXd steadied = information[f];
      steadied.diagonal().array() += ridge * static_cast<double>(folds[f].fitted.size()) + 1e-9;
      VectorXd coefficients = right[f];
      if (!solve_positive(steadied, coefficients)) return best;
      functions.emplace_back(terms * coefficients);
      for (const Index i : folds[f].left_out) tried.value[i] = functions[f][i];
    }
    tried.squares = squares_of(rows, folds, tried.value);
    if (tried.squares >= best.squares) continue;
    best = tried;
    whole = functions;
  }
  return best;
}

/// Terms, then trees on what these leave, as many as serve all folds best.
OutOfFold explained_by(const Rows& rows, const BinnedFeatures& features, const std::vector<Fold>& folds) {
  std::vector<VectorXd> whole;
  const OutOfFold terms = by_terms(rows, folds, whole);
  const BoostingOptions options;
  MatrixXd stages = MatrixXd::Zero(rows.residual.size(), options.stages + 1);
  host::for_each_parallel(folds.size(), [&](std::size_t f) {
    const MatrixXd of_fold =
        boosted(features, rows.residual - whole[f], folds[f].fitted, folds[f].left_out, options);
    for (std::size_t k = 0; k < folds[f].left_out.size(); ++k)
      stages.row(folds[f].left_out[k]) = of_fold.row(static_cast<Index>(k));
  });
  OutOfFold best = terms;
  for (Index s = 1; s < stages.cols(); ++s) {
    const VectorXd value = terms.value + stages.col(s);
    const double squares = squares_of(rows, folds, value);
    if (squares < best.squares) best = {value, squares};
  }
  return best;
}

/// What functions explain of a joint. One that explains its own log between its neighbours and next to nothing of
/// another log follows a drift, of which position tells the time: it does not count.
/// @param all  squares of the residual
OutOfFold explained_of(const Rows& rows, double all) {
  const BinnedFeatures features(rows.features);
  const OutOfFold within = explained_by(rows, features, rows.folds);
  if (rows.others.fitted.empty() || within.squares > 0.98 * all) return within;
  const OutOfFold across = explained_by(rows, features, {rows.others});
  return all - across.squares > kRepeats * (all - within.squares) ? within : across;
}

/// The rows of a joint that count, of both sets of logs.
Rows rows_of(Index joint, const LogResiduals& others, const Picked& of_others,
             const JointSignals& other_signals, const LogResiduals& judged, const Picked& of_judged,
             const JointSignals& judged_signals) {
  const auto other = static_cast<Index>(of_others.rows.size()),
             mine = static_cast<Index>(of_judged.rows.size());
  Rows rows;
  rows.terms.resize(other + mine, judged_signals.terms.cols());
  rows.terms << other_signals.terms, judged_signals.terms;
  rows.features.resize(other + mine, judged_signals.features.cols());
  rows.features << other_signals.features, judged_signals.features;
  rows.residual.resize(other + mine);
  std::vector<Index> learnt;
  for (Index i = 0; i < other; ++i) {
    const Index row = of_others.rows[static_cast<std::size_t>(i)];
    rows.residual[i] = others.after(row, joint);
    if (others.table->keep(row, joint) > 0.0) learnt.push_back(i);
  }
  rows.folds.assign(kFolds, {learnt, {}});
  rows.others.fitted = learnt;
  for (std::size_t i = 0; i < of_judged.rows.size(); ++i) {
    const Index row = of_judged.rows[i], at = other + static_cast<Index>(i);
    rows.residual[at] = judged.after(row, joint);
    if (judged.table->keep(row, joint) == 0.0) continue;
    rows.folds[static_cast<std::size_t>(of_judged.fold[i])].left_out.push_back(at);
    rows.others.left_out.push_back(at);
    for (int f = 0; f < kFolds; ++f) {
      if (of_judged.fold[i] != f && of_judged.fold_before[i] != f && of_judged.fold_behind[i] != f)
        rows.folds[static_cast<std::size_t>(f)].fitted.push_back(at);
    }
  }
  return rows;
}

/// Puts what was said of the judged rows into a column, by straight lines over rows that were not picked or do not
/// count.
void put_function(const OutOfFold& said, const Picked& judged, Index joint, const MotionTable& table,
                  MatrixXd& function) {
  const Index first = said.value.size() - static_cast<Index>(judged.rows.size());
  Index last = -1;
  for (std::size_t i = 0; i < judged.rows.size(); ++i) {
    const Index row = judged.rows[i];
    if (table.keep(row, joint) == 0.0) continue;
    function(row, joint) = said.value[first + static_cast<Index>(i)];
    for (Index between = last + 1; last >= 0 && between < row; ++between) {
      const double share = static_cast<double>(between - last) / static_cast<double>(row - last);
      function(between, joint) = (1.0 - share) * function(last, joint) + share * function(row, joint);
    }
    last = row;
  }
}

}  // namespace

double Ceiling::reached() const {
  constexpr double kNextToNothing = 0.02;  // of the mean square: as much as chance gives
  return explainable > kNextToNothing ? explained / explainable : std::numeric_limits<double>::quiet_NaN();
}

CeilingEstimate ceiling_of(const model::Robot& robot, const LogResiduals& others,
                           const LogResiduals& judged) {
  const MotionTable& table = *judged.table;
  const Picked of_others = picked_rows(*others.table), of_judged = picked_rows(table);
  std::vector<JointSignals> other_signals, judged_signals;
  host::for_each_parallel(2, [&](std::size_t k) {
    const MotionTable& of = k == 0 ? *others.table : table;
    (k == 0 ? other_signals : judged_signals) =
        joint_signals(robot, of, signals_of(robot, of), k == 0 ? of_others.rows : of_judged.rows);
  });
  const VectorXd white = white_noise(table, table.keep, judged.after);
  CeilingEstimate estimate;
  estimate.function = MatrixXd::Zero(table.rows(), table.num_joints);
  estimate.joints.resize(static_cast<std::size_t>(table.num_joints));
  host::for_each_parallel(estimate.joints.size(), [&](std::size_t j) {
    const auto joint = static_cast<Index>(j);
    const Rows rows =
        rows_of(joint, others, of_others, other_signals[j], judged, of_judged, judged_signals[j]);
    double count = 0.0, before = 0.0, after = 0.0;
    for (std::size_t i = 0; i < of_judged.rows.size(); ++i) {
      const Index row = of_judged.rows[i];
      if (table.keep(row, joint) == 0.0) continue;
      count += 1.0;
      before += std::pow(judged.before(row, joint), 2);
      after += std::pow(judged.after(row, joint), 2);
    }
    Ceiling& ceiling = estimate.joints[j];
    if (count < 30.0 || !(before > 0.0)) return;
    const double noise = white[joint] * white[joint] * count;
    ceiling.rms = std::sqrt(before / count);
    ceiling.white_noise = std::min(1.0, noise / before);
    ceiling.explained = 1.0 - after / before;
    ceiling.explainable = std::max(0.0, ceiling.explained);
    if (noise > (1.0 - kWhite) * after) return;
    const OutOfFold best = explained_of(rows, after);
    put_function(best, of_judged, joint, table, estimate.function);
    ceiling.explainable = std::clamp(1.0 - best.squares / before, ceiling.explainable, 1.0);
  });
  return estimate;
}

}  // namespace heft::diagnose
