#include "heft/regression/triangular_factor.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Core>

#include "heft/host/parallel.hpp"

namespace heft::regression {
namespace {

/// Replaces R by the triangle of [R; rows]. `rows` is overwritten.
///
/// Householder reflections that use the triangle's zeros: column j touches R(j, j) and the new rows only, so
/// m rows cost 2 m p² operations instead of 2 (m + p) p²; of a triangle the first j + 1 rows only, 2 p³/3 in all.
/// @param triangle  whether `rows` is one
void take_up(Eigen::MatrixXd& R, Eigen::MatrixXd& rows, bool triangle) {
  const Eigen::Index p = R.cols();
  Eigen::RowVectorXd work(p);
  for (Eigen::Index j = 0; j < p; ++j) {
    const Eigen::Index filled = triangle ? j + 1 : rows.rows();
    const double below = rows.col(j).head(filled).squaredNorm();
    if (below == 0.0) continue;
    // v = [1; x/(α − β)], β = −sign(α)‖[α; x]‖, τ = (β − α)/β: H = I − τ v vᵀ turns [α; x] into [β; 0].
    const double alpha = R(j, j);
    const double beta = alpha >= 0.0 ? -std::sqrt(alpha * alpha + below) : std::sqrt(alpha * alpha + below);
    const double tau = (beta - alpha) / beta;
    auto v = rows.col(j).head(filled);
    v /= alpha - beta;
    R(j, j) = beta;
    const Eigen::Index rest = p - j - 1;
    if (rest == 0) continue;
    auto right = rows.topRightCorner(filled, rest);
    work.head(rest) = R.row(j).tail(rest);
    work.head(rest).noalias() += v.transpose() * right;
    work.head(rest) *= tau;
    R.row(j).tail(rest) -= work.head(rest);
    right.noalias() -= v * work.head(rest);
  }
}

}  // namespace

TriangularFactor::TriangularFactor(int columns) : R_(Eigen::MatrixXd::Zero(columns + 1, columns + 1)) {}

void TriangularFactor::add(const Eigen::Ref<const Eigen::MatrixXd>& W,
                           const Eigen::Ref<const Eigen::VectorXd>& y) {
  // A few rows at a time stay in the cache.
  constexpr Eigen::Index kRows = 128;
  const Eigen::Index p = columns();
  for (Eigen::Index first = 0; first < W.rows(); first += kRows) {
    const Eigen::Index m = std::min(kRows, W.rows() - first);
    Eigen::MatrixXd rows(m, p + 1);
    rows.leftCols(p) = W.middleRows(first, m);
    rows.col(p) = y.segment(first, m);
    take_up(R_, rows, false);
  }
  rows_ += static_cast<long>(W.rows());
}

void TriangularFactor::add(const TriangularFactor& other, double weight) {
  if (other.rows_ == 0) return;
  Eigen::MatrixXd rows = other.R_ * std::sqrt(weight);
  take_up(R_, rows, true);
  rows_ += other.rows_;
}

double TriangularFactor::squared_error(const Eigen::VectorXd& beta) const {
  const double rest = R_(columns(), columns());
  return (R_.topLeftCorner(columns(), columns()).triangularView<Eigen::Upper>() * beta - z()).squaredNorm() +
         rest * rest;
}

TriangularFactor weighted(const std::vector<TriangularFactor>& joints, const Eigen::VectorXd& weights) {
  TriangularFactor all(joints.front().columns());
  for (std::size_t j = 0; j < joints.size(); ++j) all.add(joints[j], weights[static_cast<Eigen::Index>(j)]);
  return all;
}

BlockFactors::BlockFactors(int joints, int columns, double block, int max_blocks)
    : joints_(joints), columns_(columns), partition_(block), max_blocks_(max_blocks) {}

BlockFactors::Block& BlockFactors::block_at(BlockPartition::Key key) {
  for (;;) {
    const auto place =
        std::lower_bound(blocks_.begin(), blocks_.end(), key,
                         [](const Block& block, const BlockPartition::Key& k) { return block.key < k; });
    if (place != blocks_.end() && place->key == key) return *place;
    if (num_blocks() < max_blocks_ || partition_.is_coarsest()) {
      return *blocks_.insert(place,
                             Block{key, std::vector<TriangularFactor>(static_cast<std::size_t>(joints_),
                                                                      TriangularFactor(columns_))});
    }
    coarsen();
    key = partition_.coarser(key);
  }
}

void BlockFactors::coarsen() {
  partition_.coarsen();
  for (Block& block : blocks_) block.key = partition_.coarser(block.key);
  // In sequence already but for logs that go together by their numbers.
  std::stable_sort(blocks_.begin(), blocks_.end(),
                   [](const Block& a, const Block& b) { return a.key < b.key; });
  std::vector<Block> merged;
  for (Block& block : blocks_) {
    if (!merged.empty() && merged.back().key == block.key) {
      for (std::size_t j = 0; j < block.joints.size(); ++j) merged.back().joints[j].add(block.joints[j]);
    } else {
      merged.push_back(std::move(block));
    }
  }
  blocks_ = std::move(merged);
}

void BlockFactors::coarsen_to(int level) {
  while (partition_.level() < level && !partition_.is_coarsest()) coarsen();
}

void BlockFactors::add(long log, int joint, const Eigen::Ref<const Eigen::VectorXd>& time,
                       const Eigen::Ref<const Eigen::MatrixXd>& W,
                       const Eigen::Ref<const Eigen::VectorXd>& y) {
  for (Eigen::Index first = 0; first < time.size();) {
    Block& block = block_at(partition_.key_of(log, time[first]));
    Eigen::Index end = first;
    while (end < time.size() && partition_.key_of(log, time[end]) == block.key) ++end;
    block.joints[static_cast<std::size_t>(joint)].add(W.middleRows(first, end - first),
                                                      y.segment(first, end - first));
    first = end;
  }
}

void BlockFactors::add(const BlockFactors& other) {
  coarsen_to(other.partition_.level());
  for (const Block& from : other.blocks_) {
    // The blocks may become coarser while this goes on: each starts from the level at which it is.
    BlockPartition partition = other.partition_;
    BlockPartition::Key key = from.key;
    while (partition.level() < partition_.level()) partition.coarsen(), key = partition.coarser(key);
    Block& to = block_at(key);
    for (std::size_t j = 0; j < to.joints.size(); ++j) to.joints[j].add(from.joints[j]);
  }
}

void BlockFactors::put(const BlockPartition::Key& key, int joint, TriangularFactor factor) {
  block_at(key).joints[static_cast<std::size_t>(joint)] = std::move(factor);
}

TriangularFactor BlockFactors::joint(int joint) const {
  TriangularFactor all(columns_);
  for (const Block& block : blocks_) all.add(block.joints[static_cast<std::size_t>(joint)]);
  return all;
}

std::vector<TriangularFactor> BlockFactors::joints() const {
  std::vector<TriangularFactor> all(static_cast<std::size_t>(joints_));
  host::for_each_parallel(all.size(), [&](std::size_t j) { all[j] = joint(static_cast<int>(j)); });
  return all;
}

TriangularFactor BlockFactors::weighted(const Eigen::VectorXd& weights) const {
  return regression::weighted(joints(), weights);
}

TriangularFactor BlockFactors::weighted(const Eigen::VectorXd& weights,
                                        const std::vector<bool>& leave_out) const {
  TriangularFactor all(columns_);
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    if (leave_out[b]) continue;
    for (int j = 0; j < joints_; ++j) all.add(blocks_[b].joints[static_cast<std::size_t>(j)], weights[j]);
  }
  return all;
}

}  // namespace heft::regression
