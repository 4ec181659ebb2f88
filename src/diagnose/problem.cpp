#include "problem.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "heft/host/decompositions.hpp"
#include "moments.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Least weight of the prior: keeps directions that the motion does not show where the prior has them.
constexpr double kLeastSteady = 1e-8;

/// Aᵀ B. Not inlined: every other shape of block would have the compiler compile the product again.
[[gnu::noinline]] MatrixXd transposed_times(const Eigen::Ref<const MatrixXd>& A,
                                            const Eigen::Ref<const MatrixXd>& B) {
  return A.transpose() * B;
}

}  // namespace

Problem::Problem(const MotionTable& table, const MatrixXd& keep, std::vector<MatrixXd> rows,
                 std::vector<std::vector<int>> places, const VectorXd& prior, double steady,
                 const MatrixXd& tau, const VectorXd& hold)
    : table_(&table),
      keep_(&keep),
      rows_(std::move(rows)),
      places_(std::move(places)),
      columns_(static_cast<int>(prior.size())),
      prior_(prior),
      steady_(steady > 0.0 ? steady : kLeastSteady),
      tau_(tau.cwiseProduct(keep)),
      moments_(table.blocks.size(), std::vector<MatrixXd>(rows_.size())),
      counted_(keep.colwise().sum().transpose()),
      noise_(VectorXd::Zero(num_joints())),
      ridge_(hold.size() > 0 ? hold : VectorXd(VectorXd::Zero(prior.size()))) {
  for (int j = 0; j < num_joints(); ++j) {
    const auto s = static_cast<std::size_t>(j);
    rows_[s].array().colwise() *= keep.col(j).array();
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

VectorXd Problem::white_std() const {
  return solve(total_, -1, steady_, ridge_, true).inverse.diagonal().cwiseSqrt();
}

int Problem::append(const Columns& columns) {
  const int first = columns_;
  for (std::size_t a = 0; a < columns.joints.size(); ++a) {
    const auto j = static_cast<std::size_t>(columns.joints[a]);
    MatrixXd wider(rows_[j].rows(), rows_[j].cols() + columns.count());
    wider << rows_[j], columns.values[a];
    for (int c = 0; c < columns.count(); ++c) {
      wider.col(rows_[j].cols() + c).array() *= keep_->col(columns.joints[a]).array();
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
      rows_[j].col(static_cast<Index>(c)) = values.cwiseProduct(keep_->col(joint));
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
      add_moments(moments_[b][s], places_[s], weight(j), fold);
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
  const MatrixXd C = values.array().colwise() * keep_->col(joint).array();
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
          candidates[i].values[a].array().colwise() * keep_->col(joint).array();
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
                          keep_->col(joint).segment(from, count).array();
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

}  // namespace heft::diagnose
