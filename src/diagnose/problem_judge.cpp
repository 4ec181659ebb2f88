// How one candidate does: its coefficients, whether they hold all the time, and its gain on left-out blocks.
#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>

#include "heft/host/decompositions.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/statistics/jackknife.hpp"
#include "moments.hpp"
#include "problem.hpp"
#include "products.hpp"

namespace heft::diagnose {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Base and candidate fitted together.
struct Problem::Joint {
  const ColumnMoments& candidate;
  Added whole;
  Solved fit;
  std::vector<VectorXd> left_out;  ///< theta without each fold
  /// [block][joint]: products of the block's moments M with three vectors, (p_j + 1) × 3: M [-θ; 1] of the fit, M [a; 0] of what the
  /// base and the candidate's other columns do not explain of the torque of those tested, c̃ = [X C] a, and M [θ; -1] of the fit
  /// without the block's fold. Moments of all blocks are more than the processor's cache holds, so that they are read once.
  std::vector<std::vector<MatrixXd>> products;
  VectorXd rest;  ///< a, with the coefficients tested for the columns themselves
};

struct Problem::BaseFits {
  std::mutex asked;
  std::map<int, Factored> whole;              ///< by the column without which
  std::map<int, std::vector<Factored>> folds;
  std::once_flag once;
  /// [block][joint]: squared error of the fit without the block's fold.
  std::vector<VectorXd> errors;
};

std::shared_ptr<Problem::BaseFits> Problem::new_base_fits() { return std::make_shared<BaseFits>(); }

const Factored& Problem::base_without(int without) const {
  if (without < 0) return *base_;
  const std::lock_guard<std::mutex> lock(base_fits_->asked);
  const auto found = base_fits_->whole.find(without);
  if (found != base_fits_->whole.end()) return found->second;
  return base_fits_->whole.emplace(without, factored(total_, without, steady_, ridge_)).first->second;
}

const std::vector<Factored>& Problem::folds_without(int without) const {
  const std::lock_guard<std::mutex> lock(base_fits_->asked);
  std::vector<Factored>& folds = base_fits_->folds[without];
  if (folds.empty()) {
    for (const MatrixXd& fold : folds_) folds.push_back(factored(total_ - fold, without, steady_, ridge_));
  }
  return folds;
}

/// What every candidate is held against.
const std::vector<VectorXd>& Problem::errors_left_out() const {
  std::call_once(base_fits_->once, [this] {
    std::vector<VectorXd> thetas;
    for (const Factored& fold : folds_without(-1)) thetas.push_back(theta_of(fold));
    for (std::size_t b = 0; b < table_->blocks.size(); ++b) {
      const VectorXd& theta = thetas[static_cast<std::size_t>(table_->blocks[b].fold)];
      VectorXd errors(num_joints());
      for (int j = 0; j < num_joints(); ++j) {
        const auto s = static_cast<std::size_t>(j);
        errors[j] = squared_error(*moments_[b][s], places_[s], theta);
      }
      base_fits_->errors.push_back(std::move(errors));
    }
  });
  return base_fits_->errors;
}

Trial Problem::judge(const ColumnMoments& m, int without, int tested, double least) const {
  const int k = m.count;
  Trial trial;
  trial.joint_before = trial.joint_after = VectorXd::Zero(num_joints());
  trial.coefficients = trial.std = VectorXd::Zero(k);

  std::vector<Added> of_folds(folds_.size(), nothing_added(columns_, k));
  for (std::size_t b = 0; b < table_->blocks.size(); ++b) {
    add_columns(m, b, places_, noise_, of_folds[static_cast<std::size_t>(table_->blocks[b].fold)]);
  }
  Added whole = nothing_added(columns_, k);
  for (const Added& fold : of_folds) whole.cross += fold.cross, whole.square += fold.square, whole.torque += fold.torque;
  Solved fit = solve_beside(base_without(without), whole, steady_);
  trial.gain = base_->error - fit.error;
  trial.coefficients = fit.theta.tail(k);
  trial.base = fit.theta.head(columns_) + prior_;
  Joint joint{m, std::move(whole), std::move(fit), {}, {}, {}};
  if (trial.gain < least || is_explained(joint)) return trial;
  const std::vector<Factored>& folds = folds_without(without);
  for (std::size_t f = 0; f < folds.size(); ++f) {
    const Added rest{joint.whole.cross - of_folds[f].cross, joint.whole.square - of_folds[f].square,
                     joint.whole.torque - of_folds[f].torque};
    joint.left_out.push_back(solve_beside(folds[f], rest, steady_).theta);
  }
  const int t = tested > 0 ? tested : k;
  VectorXd torque = trial.coefficients.head(t);
  if (!solve_positive(joint.fit.inverse.block(columns_, 0, t, t), torque)) return trial;
  joint.rest = joint.fit.inverse.leftCols(t) * torque;
  put_products(joint);
  const MatrixXd scores = scores_of(joint);
  if (!test_coefficients(joint, scores, t, trial)) return trial;
  trial.drift = drift_of(joint, scores);
  cross_validate(joint, trial);
  trial.valid = true;
  return trial;
}

/// Whether the base explains one of the candidate's columns.
bool Problem::is_explained(const Joint& joint) const {
  for (int c = 0; c < joint.candidate.count; ++c) {
    // Part of the column that the base leaves: 1 / (inverse entry), against its whole.
    if (!(1.0 / joint.fit.inverse(columns_ + c, c) > 1e-5 * joint.whole.square(c, c))) return true;
  }
  return false;
}

void Problem::put_products(Joint& joint) const {
  joint.products.assign(table_->blocks.size(), std::vector<MatrixXd>(places_.size()));
  for (std::size_t b = 0; b < table_->blocks.size(); ++b) {
    const VectorXd& left_out = joint.left_out[static_cast<std::size_t>(table_->blocks[b].fold)];
    for (std::size_t j = 0; j < places_.size(); ++j) {
      const std::vector<int>& places = places_[j];
      const auto p = static_cast<Index>(places.size());
      MatrixXd of(p + 1, 3);
      of.topRows(p) << -joint.fit.theta(places), joint.rest(places), left_out(places);
      of.row(p) << 1.0, 0.0, -1.0;
      joint.products[b][j] = transposed_times(*moments_[b][j], of);
    }
  }
}

/// Scores s_b = X_bᵀ W r_b of each block, p + k × blocks, X with the candidate's columns.
MatrixXd Problem::scores_of(const Joint& joint) const {
  const ColumnMoments& m = joint.candidate;
  const VectorXd& theta = joint.fit.theta;
  const int k = m.count;
  MatrixXd scores = MatrixXd::Zero(columns_ + k, static_cast<Index>(table_->blocks.size()));
  for (int j = 0; j < num_joints(); ++j) {
    const auto s = static_cast<std::size_t>(j);
    const double w = weight(j);
    const auto p = static_cast<Index>(places_[s].size());
    const auto a =
        static_cast<std::size_t>(std::find(m.joints.begin(), m.joints.end(), j) - m.joints.begin());
    VectorXd own(p + 1), r(p);
    own.head(p) = -theta(places_[s]);
    own[p] = 1.0;
    for (std::size_t b = 0; b < table_->blocks.size(); ++b) {
      auto score = scores.col(static_cast<Index>(b));
      r = joint.products[b][s].col(0).head(p);
      if (a < m.joints.size()) {
        r.noalias() -= m.cross[b][a].topRows(p) * theta.tail(k);
        score.tail(k) += w * (m.cross[b][a].transpose() * own - m.square[b][a] * theta.tail(k));
      }
      for (Index c = 0; c < p; ++c) score[places_[s][static_cast<std::size_t>(c)]] += w * r[c];
    }
  }
  return scores;
}

/// Robust covariance V = A⁻¹ (Σ s_b s_bᵀ) A⁻¹ B/(B-1), and Hotelling's test with it (H. Hotelling, Ann. Math. Statist. 2
/// (1931) 360).
/// @param t  how many of the first coefficients chance is asked of
/// @return false where there are too few blocks
bool Problem::test_coefficients(const Joint& joint, const MatrixXd& scores, int t, Trial& trial) const {
  const ColumnMoments& m = joint.candidate;
  const Solved& fit = joint.fit;
  const int k = m.count;
  const MatrixXd tail = fit.inverse.bottomRows(k);
  MatrixXd shares(k, static_cast<Index>(table_->blocks.size()));
  MatrixXd naive = tail;
  const MatrixXd bottom = fit.inverse.transpose();
  int used = 0;
  for (Index b = 0; b < scores.cols(); ++b) {
    if (scores.col(b).squaredNorm() > 0.0) shares.col(used++) = bottom * scores.col(b);
  }
  if (used < 4) return false;
  const MatrixXd meat = statistics::sandwich_covariance(shares.leftCols(used));
  trial.std = meat.diagonal().cwiseSqrt();
  VectorXd in_deviations = trial.coefficients.head(t);
  if (!solve_positive(meat.topLeftCorner(t, t), in_deviations)) return false;
  trial.wald = trial.coefficients.head(t).dot(in_deviations);
  // W (B - t) / (t (B - 1)) follows F(t, B - t).
  const double f = trial.wald * (used - t) / (static_cast<double>(t) * (used - 1));
  trial.p_value = statistics::fisher_tail(f, t, used - t);
  MatrixXd over_naive = meat;
  solve_positive(naive, over_naive);
  const double design = std::max(1.0, over_naive.trace() / k);
  trial.effective_rows = counted_.sum() / design;
  return true;
}

/// Does the torque of the coefficients tested, c = C θ, hold all the time? In each quarter of the blocks the part of it that the
/// rest does not explain, c̃ = c - X a, gives its own correction Σ c̃ᵀ r / Σ c̃ᵀ c̃. All of them together: one of several, as a
/// knot of a curve or the sine of a ripple, may be near zero, or known as little as its neighbour.
double Problem::drift_of(const Joint& joint, const MatrixXd& scores) const {
  const ColumnMoments& m = joint.candidate;
  const int k = m.count;
  const VectorXd& a = joint.rest;
  /// Square of c̃ in one block.
  const auto square_of = [&](std::size_t b) {
    double sum = 0.0;
    for (int j = 0; j < num_joints(); ++j) {
      const auto s = static_cast<std::size_t>(j);
      const auto p = static_cast<Index>(places_[s].size());
      const VectorXd of_base = a(places_[s]);
      double own = of_base.dot(joint.products[b][s].col(1).head(p));
      for (std::size_t q = 0; q < m.joints.size(); ++q) {
        if (m.joints[q] != j) continue;
        own += 2.0 * of_base.dot(m.cross[b][q].topRows(p) * a.tail(k)) +
               a.tail(k).dot(m.square[b][q] * a.tail(k));
      }
      sum += weight(j) * own;
    }
    return sum;
  };
  constexpr std::size_t kParts = 4;
  const std::size_t blocks = table_->blocks.size();
  double drift = 0.0;
  for (std::size_t part = 0; part < kParts; ++part) {
    double up = 0.0, down = 0.0, scatter = 0.0;
    const std::size_t from = blocks * part / kParts, to = blocks * (part + 1) / kParts;
    for (std::size_t b = from; b < to; ++b) {
      const double own = a.dot(scores.col(static_cast<Index>(b)));
      down += square_of(b);
      up += own;
      scatter += own * own;
    }
    const auto parts = static_cast<double>(to - from);
    if (!(down > 0.0) || parts < 3.0) continue;
    const double error = std::sqrt(std::max(0.0, scatter - up * up / parts) * parts / (parts - 1.0)) / down;
    const double correction = up / down;
    if (std::abs(correction) > 3.0 * error) drift = std::max(drift, std::abs(correction));
  }
  return drift;
}

double steadiness(const Eigen::Ref<const VectorXd>& gains) {
  const auto count = static_cast<double>(gains.size());
  if (gains.size() < 2) return 0.0;
  const double scatter = (gains.array() - gains.mean()).square().sum();
  const double error = std::sqrt(scatter / (count - 1.0) / count);
  return error > 0.0 ? gains.mean() / error : 0.0;
}

/// Left-out blocks. Gains count by n ln(before / after), the fall of the log-likelihood with the noise of each block its
/// own: a few violent blocks would drown all others otherwise.
void Problem::cross_validate(const Joint& joint, Trial& trial) const {
  const ColumnMoments& m = joint.candidate;
  const int n = num_joints();
  const auto runs = static_cast<Index>(table_->runs.size());
  MatrixXd run_before = MatrixXd::Zero(runs, n), run_after = run_before, run_rows = run_before;
  VectorXd gains(static_cast<Index>(table_->blocks.size()));
  std::vector<int> place_of_joint(static_cast<std::size_t>(n), -1);
  for (std::size_t a = 0; a < m.joints.size(); ++a)
    place_of_joint[static_cast<std::size_t>(m.joints[a])] = static_cast<int>(a);
  /// Squared error of a joint in a block that the fit has not seen.
  const auto error_with = [&](std::size_t b, std::size_t j) {
    const VectorXd& theta = joint.left_out[static_cast<std::size_t>(table_->blocks[b].fold)];
    const auto p = static_cast<Index>(places_[j].size());
    VectorXd own(p + 1);
    own << theta(places_[j]), -1.0;
    double error = own.dot(joint.products[b][j].col(2));
    if (const int place = place_of_joint[j]; place >= 0) {
      const auto a = static_cast<std::size_t>(place);
      const VectorXd c = theta.tail(m.count);
      error += 2.0 * own.dot(m.cross[b][a] * c) + c.dot(m.square[b][a] * c);
    }
    return error;
  };
  const std::vector<VectorXd>& alone = errors_left_out();
  for (std::size_t out = 0; out < folds_.size(); ++out) {
    for (std::size_t b = 0; b < table_->blocks.size(); ++b) {
      const Block& block = table_->blocks[b];
      if (static_cast<std::size_t>(block.fold) != out) continue;
      double gain = 0.0;
      for (int j = 0; j < n; ++j) {
        const auto s = static_cast<std::size_t>(j);
        const double rows = keep_->col(j).segment(block.begin, block.count).sum();
        if (!(rows > 0.0)) continue;
        const double before = alone[b][j];
        const double after = error_with(b, s);
        trial.joint_before[j] += before;
        trial.joint_after[j] += after;
        run_before(block.run, j) += before;
        run_after(block.run, j) += after;
        run_rows(block.run, j) += rows;
        // A block that fits perfectly would count without bound.
        const double floor = 1e-4 * noise_[j] * noise_[j] * rows;
        gain += rows * std::log(std::max(before, floor) / std::max(after, floor));
      }
      gains[static_cast<Index>(b)] = gain;
    }
  }
  trial.run_gain.assign(table_->runs.size(), 0.0);
  for (Index r = 0; r < runs; ++r) {
    for (int j = 0; j < n; ++j) {
      if (run_after(r, j) > 0.0 && run_before(r, j) > 0.0)
        trial.run_gain[static_cast<std::size_t>(r)] +=
            run_rows(r, j) * std::log(run_before(r, j) / run_after(r, j));
    }
  }
  for (int j = 0; j < n; ++j) {
    if (trial.joint_after[j] > 0.0 && trial.joint_before[j] > 0.0) {
      trial.cv_gain += counted_[j] * std::log(trial.joint_before[j] / trial.joint_after[j]);
    }
  }
  const Index half = gains.size() / 2;
  trial.cv_t = steadiness(gains);
  const double gained = gains.cwiseMax(0.0).sum();
  trial.lost = gained > 0.0 ? (gained - gains.sum()) / gained : 1.0;
  trial.half_t[0] = steadiness(gains.head(half));
  trial.half_t[1] = steadiness(gains.tail(gains.size() - half));
}

double Problem::part_of_fall(const Columns& columns, const Trial& trial, int joint, const VectorXd& where,
                             const Eigen::Ref<const VectorXd>& left_at_rest) const {
  const auto j = static_cast<std::size_t>(joint);
  const VectorXd now = trial.base - prior_;
  const VectorXd before = residual_of(joint, theta_);
  VectorXd after = residual_of(joint, now), of_columns = VectorXd::Zero(before.size());
  for (std::size_t a = 0; a < columns.joints.size(); ++a) {
    if (columns.joints[a] == joint) of_columns += columns.values[a] * trial.coefficients;
  }
  after -= of_columns.cwiseProduct(keep_->col(joint));
  const VectorXd fall = before.cwiseAbs2() - after.cwiseAbs2();
  // Rows of rest that do not count themselves; a column that another one replaces is 0 there.
  const VectorXd rests = (table_->resting.col(joint) - keep_->col(joint)).cwiseMax(0.0);
  double at_rest = 0.0;
  if (rests.any()) {
    const MatrixXd& base = (*rows_)[j];
    const VectorXd moved = (now - theta_)(places_[j]).head(base.cols());
    const VectorXd left = (left_at_rest - base * moved - of_columns).cwiseProduct(rests);
    at_rest = left_at_rest.cwiseProduct(rests).squaredNorm() - left.squaredNorm();
  }
  const double all = fall.sum() + std::max(0.0, at_rest);
  return all > 0.0 ? fall.dot(where) / all : 0.0;
}

}  // namespace heft::diagnose
