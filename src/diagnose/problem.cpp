#include "problem.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "heft/host/parallel.hpp"
#include "moments.hpp"
#include "products.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;


}  // namespace

Problem::Problem(const MotionTable& table, const MatrixXd& keep, std::shared_ptr<const BaseRows> rows,
                 std::vector<std::vector<int>> places, const VectorXd& prior, double steady,
                 const MatrixXd& tau, const VectorXd& hold, const Problem* like)
    : table_(&table),
      keep_(&keep),
      rows_(std::move(rows)),
      own_(places.size(), MatrixXd(table.rows(), 0)),
      own_at_(places.size()),
      places_(std::move(places)),
      columns_(static_cast<int>(prior.size())),
      prior_(prior),
      steady_(steady > 0.0 ? steady : kLeastSteady),
      tau_(tau.cwiseProduct(keep)),
      moments_(table.blocks.size(), std::vector<BlockMoments>(places_.size())),
      summed_(places_.size(), false),
      counted_(keep.colwise().sum().transpose()),
      noise_(VectorXd::Zero(num_joints())),
      ridge_(hold.size() > 0 ? hold : VectorXd(VectorXd::Zero(prior.size()))) {
  host::for_each_parallel(places_.size(), [&](std::size_t s) {
    const auto j = static_cast<Index>(s);
    if (like != nullptr && like->rows_ == rows_ && like->prior_(places_[s]) == prior_(places_[s]) &&
        like->keep_->col(j) == keep.col(j)) {
      tau_.col(j) = like->tau_.col(j);
      return;
    }
    tau_.col(j) -= ((*rows_)[s] * prior_(places_[s])).cwiseProduct(keep.col(j));
  });
  host::for_each_parallel(table.blocks.size(), [&](std::size_t b) { collect(b, like); });
  reweight();
  if (!(steady > 0.0)) choose_steady();
}

void Problem::choose_steady() {
  double best = kLeastSteady, least = std::numeric_limits<double>::infinity();
  for (const double steady : {kLeastSteady, 1e-6, 1e-5, 1e-4, 1e-3}) {
    steady_ = steady;
    VectorXd error = VectorXd::Zero(num_joints());
    for (std::size_t out = 0; out < folds_.size(); ++out) {
      const VectorXd theta = solve(total_ - folds_[out], -1, steady_, ridge_).theta;
      for (int j = 0; j < num_joints(); ++j) {
        const auto s = static_cast<std::size_t>(j);
        error[j] += squared_error(moments_of_fold_[out][s], places_[s], theta);
      }
    }
    double sum = 0.0;
    for (int j = 0; j < num_joints(); ++j) sum += counted_[j] * std::log(std::max(1e-300, error[j]));
    if (sum < least) least = sum, best = steady;
  }
  steady_ = best;
  reweight();
}

bool Problem::has_same_rows(const Problem* like, const Block& block, int joint) const {
  return like != nullptr && like->rows_ == rows_ &&
         like->keep_->col(joint).segment(block.begin, block.count) ==
             keep_->col(joint).segment(block.begin, block.count);
}

void Problem::collect(std::size_t block, const Problem* like) {
  const Block& at = table_->blocks[block];
  for (int joint = 0; joint < num_joints(); ++joint) {
    const auto j = static_cast<std::size_t>(joint);
    const auto Xb = (*rows_)[j].middleRows(at.begin, at.count);
    const auto keep = keep_->col(joint).segment(at.begin, at.count);
    const auto yb = tau_.col(joint).segment(at.begin, at.count);
    const Index p = Xb.cols();
    MatrixXd M(p + 1, p + 1);
    if (has_same_rows(like, at, joint)) {
      M.topLeftCorner(p, p) = like->moments_[block][j]->topLeftCorner(p, p);
    } else if (keep.minCoeff() == 1.0) {
      M.topLeftCorner(p, p) = gram_of(Xb);
    } else {
      M.topLeftCorner(p, p) = gram_of((Xb.array().colwise() * keep.array()).matrix());
    }
    M.col(p).head(p) = transposed_times(Xb, yb);
    M.row(p).head(p) = M.col(p).head(p).transpose();
    M(p, p) = yb.squaredNorm();
    moments_[block][j] = std::make_shared<const MatrixXd>(std::move(M));
  }
}

double Problem::squares_of(int joint) const {
  const auto s = static_cast<std::size_t>(joint);
  double squares = 0.0;
  for (const auto& fold : moments_of_fold_) squares += squared_error(fold[s], places_[s], theta_);
  return squares;
}

MatrixXd Problem::counted_of(int joint, const MatrixXd& values) const {
  return values.array().colwise() * keep_->col(joint).array();
}

MatrixXd Problem::rows_times(int joint, Index begin, Index count, const Eigen::Ref<const MatrixXd>& C) const {
  const auto j = static_cast<std::size_t>(joint);
  const MatrixXd& base = (*rows_)[j];
  MatrixXd product(static_cast<Index>(places_[j].size()), C.cols());
  product.topRows(base.cols()) = transposed_times(base.middleRows(begin, count), C);
  // Columns that are being appended have no place yet.
  if (const auto own = static_cast<Index>(own_at_[j].size()); own > 0)
    product(own_at_[j], Eigen::all) = transposed_times(own_[j].leftCols(own).middleRows(begin, count), C);
  return product;
}

VectorXd Problem::noise_alone() const {
  // Directions that one joint's rows do not show are many; they stay where the prior has them.
  constexpr double kSteadyAlone = 1e-7;
  VectorXd noise = VectorXd::Zero(num_joints());
  for (int j = 0; j < num_joints(); ++j) {
    if (!(counted_[j] > 0.0)) continue;
    const auto s = static_cast<std::size_t>(j);
    const auto p = static_cast<Index>(places_[s].size());
    MatrixXd own = MatrixXd::Zero(p + 1, p + 1);
    for (const auto& fold : moments_of_fold_) own += fold[s];
    const double error = solve(own, -1, std::max(steady_, kSteadyAlone), {}).error;
    noise[j] = std::sqrt(std::max(0.0, error) / counted_[j]);
  }
  return noise;
}

VectorXd Problem::white_std() const {
  return solve(total_, -1, steady_, ridge_, columns_).inverse.diagonal().cwiseSqrt();
}

std::vector<int> Problem::append(std::span<const Columns> list) {
  std::vector<int> firsts;
  const int had = columns_;
  for (const Columns& columns : list) {
    firsts.push_back(columns_);
    columns_ += columns.count();
  }
  host::for_each_parallel(
      places_.size(), [&](std::size_t j) { append_to_joint(static_cast<int>(j), list, firsts); });
  for (VectorXd* values : {&prior_, &ridge_}) {
    values->conservativeResize(columns_);
    values->tail(columns_ - had).setZero();
  }
  return firsts;
}

/// @param firsts  global number of the first column of each
void Problem::append_to_joint(int joint, std::span<const Columns> list, const std::vector<int>& firsts) {
  const auto j = static_cast<std::size_t>(joint);
  std::vector<std::pair<const MatrixXd*, int>> reaching;  // values in this joint's rows, and their first number
  Index k = 0;
  for (std::size_t e = 0; e < list.size(); ++e) {
    for (std::size_t a = 0; a < list[e].joints.size(); ++a) {
      if (list[e].joints[a] != joint) continue;
      reaching.emplace_back(&list[e].values[a], firsts[e]);
      k += list[e].values[a].cols();
    }
  }
  if (k == 0) return;
  const Index had = own_[j].cols();
  own_[j].conservativeResize(Eigen::NoChange, had + k);
  auto C = own_[j].rightCols(k);
  const auto p = static_cast<Index>(places_[j].size());
  std::vector<int> places;
  for (const auto& [values, first] : reaching) {
    C.middleCols(static_cast<Index>(places.size()), values->cols()) =
        values->array().colwise() * keep_->col(joint).array();
    for (int c = 0; c < values->cols(); ++c) places.push_back(first + c);
  }
  host::for_each_parallel(table_->blocks.size(), [&](std::size_t b) {
    const Block& block = table_->blocks[b];
    const auto Cb = C.middleRows(block.begin, block.count);
    const MatrixXd& narrow = *moments_[b][j];
    MatrixXd M(p + k + 1, p + k + 1);
    M.topLeftCorner(p, p) = narrow.topLeftCorner(p, p);
    M.block(0, p, p, k) = rows_times(joint, block.begin, block.count, Cb);
    M.block(p, p, k, k) = gram_of(Cb);
    M.col(p + k).head(p) = narrow.col(p).head(p);
    M.col(p + k).segment(p, k) = transposed_times(Cb, tau_.col(joint).segment(block.begin, block.count));
    M.block(p, 0, k, p) = M.block(0, p, p, k).transpose();
    M.row(p + k).head(p + k) = M.col(p + k).head(p + k).transpose();
    M(p + k, p + k) = narrow(p, p);
    moments_[b][j] = std::make_shared<const MatrixXd>(std::move(M));
  });
  for (Index c = 0; c < k; ++c) own_at_[j].push_back(p + c);
  places_[j].insert(places_[j].end(), places.begin(), places.end());
  summed_[j] = false;
}

void Problem::replace(int joint, int column, const VectorXd& values) {
  const auto j = static_cast<std::size_t>(joint);
  const auto found = std::find(places_[j].begin(), places_[j].end(), column);
  if (found == places_[j].end()) return;
  const Index at = found - places_[j].begin(), p = static_cast<Index>(places_[j].size());
  const auto known = std::find(own_at_[j].begin(), own_at_[j].end(), at) - own_at_[j].begin();
  if (known == static_cast<std::ptrdiff_t>(own_at_[j].size())) {
    own_[j].conservativeResize(Eigen::NoChange, known + 1);
    own_at_[j].push_back(at);
  }
  own_[j].col(known) = values.cwiseProduct(keep_->col(joint));
  host::for_each_parallel(table_->blocks.size(), [&](std::size_t b) {
    const Block& block = table_->blocks[b];
    const auto Cb = own_[j].col(known).segment(block.begin, block.count);
    MatrixXd M = *moments_[b][j];
    M.col(at).head(p) = rows_times(joint, block.begin, block.count, Cb);
    M(p, at) = Cb.dot(tau_.col(joint).segment(block.begin, block.count));
    M.row(at) = M.col(at).transpose();
    moments_[b][j] = std::make_shared<const MatrixXd>(std::move(M));
  });
  summed_[j] = false;
}

/// Weights are found in passes, of which each needs no more than the sums of the folds.
void Problem::sum_folds() {
  int folds = 0;
  for (const Block& block : table_->blocks) folds = std::max(folds, block.fold + 1);
  moments_of_fold_.resize(static_cast<std::size_t>(folds), std::vector<MatrixXd>(places_.size()));
  host::for_each_parallel(places_.size(), [&](std::size_t j) {
    if (summed_[j]) return;
    for (std::vector<MatrixXd>& sums : moments_of_fold_) sums[j].resize(0, 0);
    for (std::size_t b = 0; b < table_->blocks.size(); ++b) {
      MatrixXd& sum = moments_of_fold_[static_cast<std::size_t>(table_->blocks[b].fold)][j];
      if (sum.size() == 0) {
        sum = *moments_[b][j];
      } else {
        sum += *moments_[b][j];
      }
    }
  });
  summed_.assign(summed_.size(), true);
}

void Problem::sum_base() {
  total_.setZero(columns_ + 1, columns_ + 1);
  folds_.assign(moments_of_fold_.size(), MatrixXd::Zero(columns_ + 1, columns_ + 1));
  for (std::size_t f = 0; f < folds_.size(); ++f) {
    for (int j = 0; j < num_joints(); ++j) {
      const auto s = static_cast<std::size_t>(j);
      add_moments(moments_of_fold_[f][s], places_[s], weight(j), folds_[f]);
    }
  }
  for (const MatrixXd& fold : folds_) total_ += fold;
  base_ = std::make_shared<const Factored>(factored(total_, -1, steady_, ridge_));
  theta_ = theta_of(*base_);
}

void Problem::reweight() {
  sum_folds();
  base_fits_ = new_base_fits();
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
      const double squares = squares_of(j);
      const double least = least_noise_.size() > 0 ? least_noise_[j] : 1e-9;
      const double rms = std::max(std::sqrt(std::max(0.0, squares) / std::max(1.0, counted_[j])), least);
      change = std::max(change, std::abs(rms / noise_[j] - 1.0));
      noise_[j] = rms;
    }
  }
  sum_base();
}

VectorXd Problem::residual_of(int joint, const VectorXd& all) const {
  const auto j = static_cast<std::size_t>(joint);
  const MatrixXd& base = (*rows_)[j];
  const VectorXd theta = all(places_[j]);
  VectorXd of_base = theta.head(base.cols());
  for (const Index at : own_at_[j]) {
    if (at < base.cols()) of_base[at] = 0.0;  // another column is in its place
  }
  return tau_.col(joint) - ((base * of_base).cwiseProduct(keep_->col(joint)) + own_[j] * theta(own_at_[j]));
}

MatrixXd Problem::residual() const {
  MatrixXd result(tau_.rows(), tau_.cols());
  host::for_each_parallel(places_.size(), [&](std::size_t joint) {
    result.col(static_cast<Index>(joint)) = residual_of(static_cast<int>(joint), theta_);
  });
  return result;
}

ColumnMoments Problem::moments(const Columns& columns) const {
  const std::vector<Block>& blocks = table_->blocks;
  ColumnMoments m;
  m.count = columns.count();
  m.joints = columns.joints;
  m.cross.resize(blocks.size());
  m.square.resize(blocks.size());
  for (std::size_t a = 0; a < columns.joints.size(); ++a) {
    const int joint = columns.joints[a];
    const MatrixXd C = counted_of(joint, columns.values[a]);
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      const Block& block = blocks[b];
      const auto Cb = C.middleRows(block.begin, block.count);
      const MatrixXd of_base = rows_times(joint, block.begin, block.count, Cb);
      MatrixXd cross(of_base.rows() + 1, m.count);
      cross << of_base, transposed_times(tau_.col(joint).segment(block.begin, block.count), Cb);
      m.cross[b].push_back(std::move(cross));
      m.square[b].push_back(gram_of(Cb));
    }
  }
  return m;
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
      cross << rows_times(joint, from, count, Cb), transposed_times(tau_.col(joint).segment(from, count), Cb);
      m.square[b][a] = gram_of(Cb);
    }
  }
  return m;
}

double Problem::gain(const ColumnMoments& m, int without) const {
  Added added = nothing_added(columns_, m.count);
  for (std::size_t b = 0; b < m.cross.size(); ++b) add_columns(m, b, places_, noise_, added);
  return std::max(0.0, base_->error - error_beside(base_without(without), added, steady_));
}

}  // namespace heft::diagnose
