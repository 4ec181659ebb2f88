// How one candidate does: its coefficients, whether they hold all the time, and its gain on left-out blocks.
#include <algorithm>
#include <cmath>

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
  int without;                  ///< base column that the candidate replaces; -1: none
  std::vector<MatrixXd> folds;  ///< moments of each fold's blocks
  MatrixXd whole;
  Solved fit;
};

struct Problem::LeftOut {
  std::once_flag once;
  /// [block][joint]: squared error of the fit without the block's fold.
  std::vector<VectorXd> errors;
};

std::shared_ptr<Problem::LeftOut> Problem::new_left_out() { return std::make_shared<LeftOut>(); }

/// What every candidate is held against.
const Problem::LeftOut& Problem::left_out() const {
  std::call_once(left_out_->once, [this] {
    std::vector<VectorXd> thetas;
    for (const MatrixXd& fold : folds_)
      thetas.push_back(solve(total_ - fold, -1, steady_, ridge_).theta);
    for (std::size_t b = 0; b < table_->blocks.size(); ++b) {
      const VectorXd& theta = thetas[static_cast<std::size_t>(table_->blocks[b].fold)];
      VectorXd errors(num_joints());
      for (int j = 0; j < num_joints(); ++j) {
        const auto s = static_cast<std::size_t>(j);
        errors[j] = squared_error(*moments_[b][s], places_[s], theta, nullptr, b, -1, columns_);
      }
      left_out_->errors.push_back(std::move(errors));
    }
  });
  return *left_out_;
}

Trial Problem::judge(const ColumnMoments& m, int without, int tested, double least) const {
  const int k = m.count;
  Trial trial;
  trial.joint_before = trial.joint_after = VectorXd::Zero(num_joints());
  trial.coefficients = trial.std = VectorXd::Zero(k);

  std::vector<MatrixXd> wide;
  for (const MatrixXd& fold : folds_) wide.push_back(widened(fold, k));
  for (std::size_t b = 0; b < table_->blocks.size(); ++b) {
    add_columns(m, b, places_, noise_, columns_, wide[static_cast<std::size_t>(table_->blocks[b].fold)]);
  }
  MatrixXd whole = MatrixXd::Zero(columns_ + k + 1, columns_ + k + 1);
  for (const MatrixXd& fold : wide) whole += fold;
  Solved fit = solve(whole, without, steady_, ridge_, k);
  const Joint joint{m, without, std::move(wide), std::move(whole), std::move(fit)};

  trial.gain = error_ - joint.fit.error;
  trial.coefficients = joint.fit.theta.tail(k);
  trial.base = joint.fit.theta.head(columns_) + prior_;
  if (trial.gain < least) return trial;
  const MatrixXd scores = scores_of(joint);
  if (!test_coefficients(joint, scores, tested, trial)) return trial;
  trial.drift = drift_of(joint, scores);
  cross_validate(joint, trial);
  trial.valid = true;
  return trial;
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
      r = transposed_times(moments_[b][s]->leftCols(p), own);
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
/// @return false where the base explains the columns, or there are too few blocks
bool Problem::test_coefficients(const Joint& joint, const MatrixXd& scores, int tested, Trial& trial) const {
  const ColumnMoments& m = joint.candidate;
  const Solved& fit = joint.fit;
  const int k = m.count;
  const MatrixXd tail = fit.inverse.bottomRows(k);
  for (int c = 0; c < k; ++c) {
    // Part of the column that the base leaves: 1 / (inverse entry), against its whole.
    if (!(1.0 / tail(c, c) > 1e-5 * joint.whole(columns_ + c, columns_ + c))) return false;
  }
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
  const int t = tested > 0 ? tested : k;
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

/// Does the first coefficient hold all the time? In each quarter of the blocks the part of the column that the rest does
/// not explain, c̃ = c - X a, gives its own correction Σ c̃ᵀ r / Σ c̃ᵀ c̃.
double Problem::drift_of(const Joint& joint, const MatrixXd& scores) const {
  const ColumnMoments& m = joint.candidate;
  const int k = m.count;
  const double coefficient = joint.fit.theta[columns_];
  if (!(std::abs(coefficient) > 0.0)) return 0.0;
  // c̃ = [X C] a, a = 1 for the column itself
  const VectorXd a = joint.fit.inverse.col(0) / joint.fit.inverse(columns_, 0);
  /// Square of the column in one block.
  const auto square_of = [&](std::size_t b) {
    double sum = 0.0;
    for (int j = 0; j < num_joints(); ++j) {
      const auto s = static_cast<std::size_t>(j);
      const auto p = static_cast<Index>(places_[s].size());
      const VectorXd of_base = a(places_[s]);
      double own = of_base.dot(transposed_times(moments_[b][s]->topLeftCorner(p, p), of_base).col(0));
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
    if (std::abs(correction) > 3.0 * error) drift = std::max(drift, std::abs(correction / coefficient));
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
  const std::vector<VectorXd>& alone = left_out().errors;
  for (std::size_t out = 0; out < folds_.size(); ++out) {
    const Solved with = solve(joint.whole - joint.folds[out], joint.without, steady_, ridge_);
    for (std::size_t b = 0; b < table_->blocks.size(); ++b) {
      const Block& block = table_->blocks[b];
      if (static_cast<std::size_t>(block.fold) != out) continue;
      double gain = 0.0;
      for (int j = 0; j < n; ++j) {
        const auto s = static_cast<std::size_t>(j);
        const double rows = keep_->col(j).segment(block.begin, block.count).sum();
        if (!(rows > 0.0)) continue;
        const double before = alone[b][j];
        const double after =
            squared_error(*moments_[b][s], places_[s], with.theta, &m, b, place_of_joint[s], columns_);
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

double Problem::part_of_fall(const Columns& columns, const Trial& trial, int joint,
                             const VectorXd& where) const {
  const VectorXd before = residual_of(joint, theta_);
  VectorXd after = residual_of(joint, trial.base - prior_);
  for (std::size_t a = 0; a < columns.joints.size(); ++a) {
    if (columns.joints[a] == joint)
      after -= (columns.values[a] * trial.coefficients).cwiseProduct(keep_->col(joint));
  }
  const VectorXd fall = before.cwiseAbs2() - after.cwiseAbs2();
  const double all = fall.sum();
  return all > 0.0 ? fall.dot(where) / all : 0.0;
}

}  // namespace heft::diagnose
