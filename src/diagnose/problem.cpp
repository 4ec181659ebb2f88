#include "problem.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "heft/host/decompositions.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/statistics/jackknife.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Least weight of the prior: keeps directions that the motion does not show where the prior has them.
constexpr double kLeastSteady = 1e-8;

/// Aᵀ B. Not inlined: every other shape of block would have the compiler make the product anew.
[[gnu::noinline]] MatrixXd transposed_times(const Eigen::Ref<const MatrixXd>& A,
                                            const Eigen::Ref<const MatrixXd>& B) {
  return A.transpose() * B;
}

/// Adds the moments of one joint in one block to those of the whole.
void add(const MatrixXd& part, const std::vector<int>& places, double weight, MatrixXd& total) {
  const Index p = static_cast<Index>(places.size());
  const Index last = total.rows() - 1;
  for (Index c = 0; c < p; ++c) {
    const Index to = places[static_cast<std::size_t>(c)];
    for (Index r = 0; r < p; ++r) total(places[static_cast<std::size_t>(r)], to) += weight * part(r, c);
    total(last, to) += weight * part(p, c);
    total(to, last) += weight * part(c, p);
  }
  total(last, last) += weight * part(p, p);
}

}  // namespace

namespace {

/// Adds a candidate's moments in one block to the (p + k + 1)² moments of base and candidate.
void add_columns(const ColumnMoments& m, std::size_t block, const std::vector<std::vector<int>>& places,
                 const VectorXd& noise, int columns, MatrixXd& total) {
  const Index p = columns, k = m.count, last = p + k;
  for (std::size_t a = 0; a < m.joints.size(); ++a) {
    const auto j = static_cast<std::size_t>(m.joints[a]);
    const double w = 1.0 / (noise[m.joints[a]] * noise[m.joints[a]]);
    const MatrixXd& cross = m.cross[block][a];
    for (Index c = 0; c < k; ++c) {
      for (Index r = 0; r + 1 < cross.rows(); ++r) {
        const int place = places[j][static_cast<std::size_t>(r)];
        total(place, p + c) += w * cross(r, c);
        total(p + c, place) += w * cross(r, c);
      }
      total(last, p + c) += w * cross(cross.rows() - 1, c);
      total(p + c, last) += w * cross(cross.rows() - 1, c);
    }
    total.block(p, p, k, k) += w * m.square[block][a];
  }
}

/// (p + 1)² moments with room for k more columns before the torque's.
MatrixXd widened(const MatrixXd& base, int k) {
  const Index p = base.rows() - 1;
  MatrixXd wide = MatrixXd::Zero(p + k + 1, p + k + 1);
  wide.topLeftCorner(p, p) = base.topLeftCorner(p, p);
  wide.col(p + k).head(p) = base.col(p).head(p);
  wide.row(p + k).head(p) = base.row(p).head(p);
  wide(p + k, p + k) = base(p, p);
  return wide;
}

struct Solved {
  VectorXd theta;
  MatrixXd inverse;  ///< of the steadied normal matrix
  double error;
};

/// @param ridge  on top of `steady`, of the first columns, scaled as `steady` is
Solved solve(const MatrixXd& moments, int without, double steady, const VectorXd& ridge, bool with_inverse) {
  const Index p = moments.rows() - 1;
  VectorXd scale = moments.diagonal().head(p).cwiseSqrt();
  for (Index c = 0; c < p; ++c) {
    if (!(scale[c] > 0.0)) scale[c] = 1.0;
  }
  MatrixXd A =
      scale.cwiseInverse().asDiagonal() * moments.topLeftCorner(p, p) * scale.cwiseInverse().asDiagonal();
  A.diagonal().array() += steady;
  A.diagonal().head(ridge.size()) += ridge;
  if (without >= 0) A(without, without) += 1e12;
  const VectorXd right = moments.col(p).head(p).cwiseQuotient(scale);
  MatrixXd L;
  cholesky(A, L);
  VectorXd x = right;
  solve_lower(L, x);
  solve_lower_transposed(L, x);
  Solved s;
  s.theta = x.cwiseQuotient(scale);
  s.error = moments(p, p) - right.dot(x);
  if (with_inverse) {
    MatrixXd root = scale.cwiseInverse().asDiagonal();  // L⁻¹ S⁻¹, (S A S)⁻¹ = rootᵀ root
    solve_lower(L, root);
    s.inverse = root.transpose() * root;
  }
  return s;
}

/// Squared error of a solution in one block and joint, unweighted.
double squared_error(const MatrixXd& base, const std::vector<int>& places, const VectorXd& theta,
                     const ColumnMoments* m, std::size_t block, int place_of_joint, int columns) {
  const Index p = static_cast<Index>(places.size());
  VectorXd own(p + 1);
  own.head(p) = theta(places);
  own[p] = -1.0;
  double error = own.dot(base * own);
  if (m != nullptr && place_of_joint >= 0) {
    const auto a = static_cast<std::size_t>(place_of_joint);
    const VectorXd c = theta.segment(columns, m->count);
    error += 2.0 * own.dot(m->cross[block][a] * c) + c.dot(m->square[block][a] * c);
  }
  return error;
}

}  // namespace

Problem::Problem(const MotionTable& table, std::vector<MatrixXd> rows, std::vector<std::vector<int>> places,
                 const VectorXd& prior, double steady, const MatrixXd& tau, const VectorXd& hold)
    : table_(&table),
      rows_(std::move(rows)),
      places_(std::move(places)),
      columns_(static_cast<int>(prior.size())),
      prior_(prior),
      steady_(steady > 0.0 ? steady : kLeastSteady),
      tau_(tau.cwiseProduct(table.keep)),
      moments_(table.blocks.size(), std::vector<MatrixXd>(rows_.size())),
      counted_(table.keep.colwise().sum().transpose()),
      noise_(VectorXd::Zero(num_joints())),
      ridge_(hold.size() > 0 ? hold : VectorXd(VectorXd::Zero(prior.size()))) {
  for (int j = 0; j < num_joints(); ++j) {
    const auto s = static_cast<std::size_t>(j);
    rows_[s].array().colwise() *= table.keep.col(j).array();
    tau_.col(j) -= rows_[s] * prior_(places_[s]);
  }
  for (int j = 0; j < num_joints(); ++j) collect(j);
  reweight();
  if (!(steady > 0.0)) choose_steady();
}

void Problem::choose_steady() {
  double best = kLeastSteady, least = std::numeric_limits<double>::infinity();
  for (const double steady : {kLeastSteady, 1e-6, 1e-5, 1e-4, 1e-3}) {
    steady_ = steady;
    VectorXd error = VectorXd::Zero(num_joints());
    for (std::size_t out = 0; out < folds_.size(); ++out) {
      const VectorXd theta = solve(total_ - folds_[out], -1, steady_, ridge_, false).theta;
      for (std::size_t b = 0; b < table_->blocks.size(); ++b) {
        if (static_cast<std::size_t>(table_->blocks[b].fold) != out) continue;
        for (int j = 0; j < num_joints(); ++j) {
          const auto s = static_cast<std::size_t>(j);
          error[j] += squared_error(moments_[b][s], places_[s], theta, nullptr, b, -1, columns_);
        }
      }
    }
    double sum = 0.0;
    for (int j = 0; j < num_joints(); ++j) sum += counted_[j] * std::log(std::max(1e-300, error[j]));
    if (sum < least) least = sum, best = steady;
  }
  steady_ = best;
  reweight();
}

void Problem::collect(int joint) {
  const auto j = static_cast<std::size_t>(joint);
  const MatrixXd& X = rows_[j];
  const Index p = X.cols();
  for (std::size_t b = 0; b < table_->blocks.size(); ++b) {
    const Block& block = table_->blocks[b];
    const auto Xb = X.middleRows(block.begin, block.count);
    const auto yb = tau_.col(joint).segment(block.begin, block.count);
    MatrixXd M(p + 1, p + 1);
    M.topLeftCorner(p, p) = transposed_times(Xb, Xb);
    M.col(p).head(p) = transposed_times(Xb, yb);
    M.row(p).head(p) = M.col(p).head(p).transpose();
    M(p, p) = yb.squaredNorm();
    moments_[b][j] = std::move(M);
  }
}

VectorXd Problem::noise_alone() const {
  // Directions that one joint's rows do not show are many; they stay where the prior has them.
  constexpr double kSteadyAlone = 1e-7;
  VectorXd noise = VectorXd::Zero(num_joints());
  for (int j = 0; j < num_joints(); ++j) {
    if (!(counted_[j] > 0.0)) continue;
    const auto s = static_cast<std::size_t>(j);
    MatrixXd own = MatrixXd::Zero(rows_[s].cols() + 1, rows_[s].cols() + 1);
    for (const auto& block : moments_) own += block[s];
    const double error = solve(own, -1, std::max(steady_, kSteadyAlone), {}, false).error;
    noise[j] = std::sqrt(std::max(0.0, error) / counted_[j]);
  }
  return noise;
}

int Problem::append(const Columns& columns) {
  const int first = columns_;
  for (std::size_t a = 0; a < columns.joints.size(); ++a) {
    const auto j = static_cast<std::size_t>(columns.joints[a]);
    MatrixXd wider(rows_[j].rows(), rows_[j].cols() + columns.count());
    wider << rows_[j], columns.values[a];
    for (int c = 0; c < columns.count(); ++c) {
      wider.col(rows_[j].cols() + c).array() *= table_->keep.col(columns.joints[a]).array();
      places_[j].push_back(first + c);
    }
    rows_[j] = std::move(wider);
    collect(columns.joints[a]);
  }
  columns_ += columns.count();
  prior_.conservativeResize(columns_);
  prior_.tail(columns.count()).setZero();
  ridge_.conservativeResize(columns_);
  ridge_.tail(columns.count()).setZero();
  return first;
}

void Problem::replace(int joint, int column, const VectorXd& values) {
  const auto j = static_cast<std::size_t>(joint);
  for (std::size_t c = 0; c < places_[j].size(); ++c) {
    if (places_[j][c] == column) {
      rows_[j].col(static_cast<Index>(c)) = values.cwiseProduct(table_->keep.col(joint));
    }
  }
  collect(joint);
}

void Problem::sum_base() {
  total_.setZero(columns_ + 1, columns_ + 1);
  int folds = 0;
  for (const Block& block : table_->blocks) folds = std::max(folds, block.fold + 1);
  folds_.assign(static_cast<std::size_t>(folds), MatrixXd::Zero(columns_ + 1, columns_ + 1));
  for (std::size_t b = 0; b < table_->blocks.size(); ++b) {
    MatrixXd& fold = folds_[static_cast<std::size_t>(table_->blocks[b].fold)];
    for (int j = 0; j < num_joints(); ++j) {
      const auto s = static_cast<std::size_t>(j);
      add(moments_[b][s], places_[s], weight(j), fold);
    }
  }
  for (const MatrixXd& fold : folds_) total_ += fold;
  scale_ = total_.diagonal().head(columns_).cwiseSqrt();
  for (Index c = 0; c < columns_; ++c) {
    if (!(scale_[c] > 0.0)) scale_[c] = 1.0;
  }
  MatrixXd A = scale_.cwiseInverse().asDiagonal() * total_.topLeftCorner(columns_, columns_) *
               scale_.cwiseInverse().asDiagonal();
  A.diagonal().array() += steady_;
  A.diagonal() += ridge_;
  cholesky(A, factor_);
  VectorXd z = total_.col(columns_).head(columns_).cwiseQuotient(scale_);
  solve_lower(factor_, z);
  error_ = total_(columns_, columns_) - z.squaredNorm();
  solve_lower_transposed(factor_, z);
  theta_ = z.cwiseQuotient(scale_);
}

void Problem::reweight() {
  if (!(noise_.minCoeff() > 0.0)) {
    // A first guess: rms torque, so that large joints do not drown small ones.
    for (int j = 0; j < num_joints(); ++j) {
      noise_[j] = std::max(std::sqrt(tau_.col(j).squaredNorm() / std::max(1.0, counted_[j])), 1e-9);
    }
  }
  // Directions that the motion hardly shows follow the weights for long.
  constexpr int kMostPasses = 20;
  constexpr double kSettled = 1e-4;
  double change = 1.0;
  for (int pass = 0; pass < kMostPasses && change > kSettled; ++pass) {
    change = 0.0;
    sum_base();
    for (int j = 0; j < num_joints(); ++j) {
      const auto s = static_cast<std::size_t>(j);
      double squares = 0.0;
      for (std::size_t b = 0; b < table_->blocks.size(); ++b) {
        squares += squared_error(moments_[b][s], places_[s], theta_, nullptr, b, -1, columns_);
      }
      const double least = least_noise_.size() > 0 ? least_noise_[j] : 1e-9;
      const double rms = std::max(std::sqrt(std::max(0.0, squares) / std::max(1.0, counted_[j])), least);
      change = std::max(change, std::abs(rms / noise_[j] - 1.0));
      noise_[j] = rms;
    }
  }
  sum_base();
}

MatrixXd Problem::residual() const {
  MatrixXd result = tau_;
  for (std::size_t j = 0; j < rows_.size(); ++j) {
    result.col(static_cast<Index>(j)) -= rows_[j] * theta_(places_[j]);
  }
  return result;
}

std::vector<std::pair<double, VectorXd>> Problem::scan(int joint, const MatrixXd& values, int each) const {
  const auto j = static_cast<std::size_t>(joint);
  const double w = weight(joint);
  const MatrixXd C = values.array().colwise() * table_->keep.col(joint).array();
  MatrixXd own = transposed_times(rows_[j], C);
  MatrixXd B = MatrixXd::Zero(columns_, C.cols());
  for (Index r = 0; r < own.rows(); ++r) {
    const int place = places_[j][static_cast<std::size_t>(r)];
    B.row(place) = w / scale_[place] * own.row(r);
  }
  solve_lower(factor_, B);
  VectorXd z = total_.col(columns_).head(columns_).cwiseQuotient(scale_);
  solve_lower(factor_, z);
  const VectorXd t = w * (C.transpose() * tau_.col(joint)) - B.transpose() * z;
  std::vector<std::pair<double, VectorXd>> result;
  for (Index c = 0; c + each <= C.cols(); c += each) {
    const auto Ck = C.middleCols(c, each);
    const MatrixXd S = w * (Ck.transpose() * Ck);
    const MatrixXd left = S - B.middleCols(c, each).transpose() * B.middleCols(c, each);
    bool explained = false;
    for (Index k = 0; k < each; ++k) explained = explained || !(left(k, k) > 1e-5 * S(k, k));
    VectorXd c_hat = t.segment(c, each);
    if (explained || !solve_positive(left, c_hat)) {
      result.emplace_back(0.0, VectorXd::Zero(each));
      continue;
    }
    result.emplace_back(c_hat.dot(t.segment(c, each)), c_hat);
  }
  return result;
}

ColumnMoments Problem::moments(const Columns& columns) const {
  return std::move(moments_of({&columns, 1}).front());
}

std::vector<ColumnMoments> Problem::moments_of(std::span<const Columns> candidates) const {
  const Columns& first = candidates.front();
  const Index k = first.count();
  const std::size_t blocks = table_->blocks.size();
  ColumnMoments empty;
  empty.count = static_cast<int>(k);
  empty.joints = first.joints;
  empty.cross.resize(blocks);
  empty.square.resize(blocks);
  std::vector<ColumnMoments> all(candidates.size(), empty);
  MatrixXd C(table_->rows(), k * static_cast<Index>(candidates.size()));
  for (std::size_t a = 0; a < first.joints.size(); ++a) {
    const int joint = first.joints[a];
    const auto j = static_cast<std::size_t>(joint);
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      C.middleCols(k * static_cast<Index>(i), k) =
          candidates[i].values[a].array().colwise() * table_->keep.col(joint).array();
    }
    for (std::size_t b = 0; b < blocks; ++b) {
      const Block& block = table_->blocks[b];
      const auto Cb = C.middleRows(block.begin, block.count);
      const MatrixXd cross = transposed_times(rows_[j].middleRows(block.begin, block.count), Cb);
      const MatrixXd torque = transposed_times(tau_.col(joint).segment(block.begin, block.count), Cb);
      for (std::size_t i = 0; i < candidates.size(); ++i) {
        const Index at = k * static_cast<Index>(i);
        MatrixXd own(cross.rows() + 1, k);
        own << cross.middleCols(at, k), torque.middleCols(at, k);
        all[i].cross[b].push_back(std::move(own));
        all[i].square[b].push_back(transposed_times(Cb.middleCols(at, k), Cb.middleCols(at, k)));
      }
    }
  }
  return all;
}

ColumnMoments Problem::moments_from(Index row, const Columns& columns, const ColumnMoments& all) const {
  ColumnMoments m = all;
  for (std::size_t b = 0; b < table_->blocks.size(); ++b) {
    const Block& block = table_->blocks[b];
    if (block.begin >= row) break;
    // Rows of this block that are still counted.
    const Index from = std::min(row, block.begin + block.count), count = block.begin + block.count - from;
    for (std::size_t a = 0; a < columns.joints.size(); ++a) {
      const int joint = columns.joints[a];
      const MatrixXd Cb = columns.values[a].middleRows(from, count).array().colwise() *
                          table_->keep.col(joint).segment(from, count).array();
      MatrixXd& cross = m.cross[b][a];
      cross << transposed_times(rows_[static_cast<std::size_t>(joint)].middleRows(from, count), Cb),
          transposed_times(tau_.col(joint).segment(from, count), Cb);
      m.square[b][a] = transposed_times(Cb, Cb);
    }
  }
  return m;
}

std::vector<double> Problem::gains(const std::vector<Columns>& candidates, int without) const {
  std::vector<double> result;
  for (const ColumnMoments& m : moments_of(candidates)) result.push_back(gain(m, without));
  return result;
}

double Problem::gain(const ColumnMoments& m, int without) const {
  MatrixXd whole = widened(total_, m.count);
  for (std::size_t b = 0; b < table_->blocks.size(); ++b) add_columns(m, b, places_, noise_, columns_, whole);
  return std::max(0.0, error_ - solve(whole, without, steady_, ridge_, false).error);
}

Trial Problem::judge(const ColumnMoments& m, int without, int tested) const {
  const int n = num_joints();
  const int k = m.count;
  const std::size_t blocks = table_->blocks.size();
  Trial trial;
  trial.joint_before = trial.joint_after = VectorXd::Zero(n);
  trial.coefficients = trial.std = VectorXd::Zero(k);

  std::vector<MatrixXd> wide;
  for (const MatrixXd& fold : folds_) wide.push_back(widened(fold, k));
  for (std::size_t b = 0; b < blocks; ++b) {
    add_columns(m, b, places_, noise_, columns_, wide[static_cast<std::size_t>(table_->blocks[b].fold)]);
  }
  MatrixXd whole = MatrixXd::Zero(columns_ + k + 1, columns_ + k + 1);
  for (const MatrixXd& fold : wide) whole += fold;

  const Solved fit = solve(whole, without, steady_, ridge_, true);
  trial.gain = error_ - fit.error;
  trial.coefficients = fit.theta.tail(k);
  trial.base = fit.theta.head(columns_) + prior_;
  const MatrixXd tail = fit.inverse.bottomRightCorner(k, k);
  for (int c = 0; c < k; ++c) {
    // Part of the column that the base leaves: 1 / (inverse entry), against its whole.
    if (!(1.0 / tail(c, c) > 1e-5 * whole(columns_ + c, columns_ + c))) return trial;
  }

  // Robust covariance from the scores X_bᵀ W r_b of each block.
  MatrixXd shares(k, static_cast<Index>(blocks));
  MatrixXd naive = tail;
  const MatrixXd bottom = fit.inverse.bottomRows(k);
  int used = 0;
  for (std::size_t b = 0; b < blocks; ++b) {
    VectorXd score = VectorXd::Zero(columns_ + k);
    for (int j = 0; j < n; ++j) {
      const auto s = static_cast<std::size_t>(j);
      const double w = weight(j);
      const Index p = static_cast<Index>(places_[s].size());
      VectorXd own(p + 1);
      own.head(p) = -fit.theta(places_[s]);
      own[p] = 1.0;
      VectorXd r = moments_[b][s].topRows(p) * own;
      for (std::size_t a = 0; a < m.joints.size(); ++a) {
        if (m.joints[a] != j) continue;
        r -= m.cross[b][a].topRows(p) * fit.theta.tail(k);
        score.tail(k) += w * (m.cross[b][a].transpose() * own - m.square[b][a] * fit.theta.tail(k));
      }
      for (Index c = 0; c < p; ++c) score[places_[s][static_cast<std::size_t>(c)]] += w * r[c];
    }
    if (score.squaredNorm() > 0.0) shares.col(used++) = bottom * score;
  }
  if (used < 4) return trial;
  const MatrixXd meat = statistics::sandwich_covariance(shares.leftCols(used));
  trial.std = meat.diagonal().cwiseSqrt();
  const int t = tested > 0 ? tested : k;
  VectorXd in_deviations = trial.coefficients.head(t);
  if (!solve_positive(meat.topLeftCorner(t, t), in_deviations)) return trial;
  trial.wald = trial.coefficients.head(t).dot(in_deviations);
  // Hotelling: W (B - t) / (t (B - 1)) follows F(t, B - t).
  const double f = trial.wald * (used - t) / (static_cast<double>(t) * (used - 1));
  trial.p_value = statistics::fisher_tail(f, t, used - t);
  MatrixXd over_naive = meat;
  solve_positive(naive, over_naive);
  const double design = std::max(1.0, over_naive.trace() / k);
  trial.effective_rows = counted_.sum() / design;

  // Does the first coefficient hold all the time? In each quarter of the blocks the part of the column that the
  // rest does not explain, c̃ = c - X a, gives its own correction Σ c̃ᵀ r / Σ c̃ᵀ c̃.
  if (std::abs(trial.coefficients[0]) > 0.0) {
    VectorXd a = bottom.row(0).transpose() / bottom(0, columns_);  // c̃ = [X C] a, a = 1 for the column itself
    constexpr int kParts = 4;
    for (int part = 0; part < kParts; ++part) {
      double up = 0.0, down = 0.0, scatter = 0.0;
      const std::size_t from = blocks * static_cast<std::size_t>(part) / kParts;
      const std::size_t to = blocks * static_cast<std::size_t>(part + 1) / kParts;
      for (std::size_t b = from; b < to; ++b) {
        double own_up = 0.0;
        for (int j = 0; j < n; ++j) {
          const auto s = static_cast<std::size_t>(j);
          const Index p = static_cast<Index>(places_[s].size());
          MatrixXd M = MatrixXd::Zero(p + k + 1, p + k + 1);
          M.topLeftCorner(p, p) = moments_[b][s].topLeftCorner(p, p);
          M.col(p + k).head(p) = moments_[b][s].col(p).head(p);
          VectorXd ca = VectorXd::Zero(p + k + 1), r = VectorXd::Zero(p + k + 1);
          for (std::size_t q = 0; q < m.joints.size(); ++q) {
            if (m.joints[q] != j) continue;
            M.block(0, p, p, k) = m.cross[b][q].topRows(p);
            M.block(p, 0, k, p) = m.cross[b][q].topRows(p).transpose();
            M.block(p, p, k, k) = m.square[b][q];
            M.col(p + k).segment(p, k) = m.cross[b][q].row(p).transpose();
          }
          ca.head(p) = a(places_[s]);
          r.head(p) = -fit.theta(places_[s]);
          ca.segment(p, k) = a.tail(k);
          r.segment(p, k) = -fit.theta.tail(k);
          r[p + k] = 1.0;
          const VectorXd Mr = M * r, Mc = M * ca;
          own_up += weight(j) * ca.head(p + k).dot(Mr.head(p + k));
          down += weight(j) * ca.head(p + k).dot(Mc.head(p + k));
        }
        up += own_up;
        scatter += own_up * own_up;
      }
      const auto parts = static_cast<double>(to - from);
      if (!(down > 0.0) || parts < 3.0) continue;
      const double error = std::sqrt(std::max(0.0, scatter - up * up / parts) * parts / (parts - 1.0)) / down;
      const double correction = up / down;
      if (std::abs(correction) > 3.0 * error) {
        trial.drift = std::max(trial.drift, std::abs(correction / trial.coefficients[0]));
      }
    }
  }

  // Left-out blocks. Gains count by n ln(before / after), the fall of the log-likelihood with the noise of each
  // block its own: a few violent blocks would drown all others otherwise.
  const auto runs = static_cast<Index>(table_->runs.size());
  MatrixXd run_before = MatrixXd::Zero(runs, n), run_after = run_before, run_rows = run_before;
  std::vector<double> gains;
  std::vector<int> place_of_joint(static_cast<std::size_t>(n), -1);
  for (std::size_t a = 0; a < m.joints.size(); ++a)
    place_of_joint[static_cast<std::size_t>(m.joints[a])] = static_cast<int>(a);
  for (std::size_t f_out = 0; f_out < folds_.size(); ++f_out) {
    const Solved alone = solve(total_ - folds_[f_out], -1, steady_, ridge_, false);
    const Solved with = solve(whole - wide[f_out], without, steady_, ridge_, false);
    for (std::size_t b = 0; b < blocks; ++b) {
      if (static_cast<std::size_t>(table_->blocks[b].fold) != f_out) continue;
      double gain = 0.0;
      for (int j = 0; j < n; ++j) {
        const auto s = static_cast<std::size_t>(j);
        const double rows =
            table_->keep.col(j).segment(table_->blocks[b].begin, table_->blocks[b].count).sum();
        if (!(rows > 0.0)) continue;
        const double before =
            squared_error(moments_[b][s], places_[s], alone.theta, nullptr, b, -1, columns_);
        const double after =
            squared_error(moments_[b][s], places_[s], with.theta, &m, b, place_of_joint[s], columns_);
        trial.joint_before[j] += before;
        trial.joint_after[j] += after;
        const Index run = table_->blocks[b].run;
        run_before(run, j) += before;
        run_after(run, j) += after;
        run_rows(run, j) += rows;
        // A block that fits perfectly would count without bound.
        const double floor = 1e-4 * noise_[j] * noise_[j] * rows;
        gain += rows * std::log(std::max(before, floor) / std::max(after, floor));
      }
      gains.push_back(gain);
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
  double mean = 0.0, scatter = 0.0;
  const auto count = static_cast<double>(gains.size());
  for (const double g : gains) mean += g / count;
  for (const double g : gains) scatter += (g - mean) * (g - mean);
  const double error = std::sqrt(scatter / std::max(1.0, count - 1.0) / count);
  trial.cv_t = error > 0.0 ? mean / error : 0.0;
  trial.valid = true;
  return trial;
}

}  // namespace heft::diagnose
