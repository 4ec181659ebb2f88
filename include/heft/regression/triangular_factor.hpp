/// @file
/// Least squares without keeping the rows: a triangular factor takes them up.
#pragma once

#include <utility>
#include <vector>

#include <Eigen/Core>

#include "heft/regression/block_partition.hpp"

namespace heft::regression {

/// R of the QR factorisation of all rows [W y] added so far, (p+1) × (p+1) upper triangular.
///
/// ‖W β − y‖² = ‖R₁ β − z‖² + ρ², with R₁ the leading p × p block, z the last column above its end and ρ the
/// last entry. Same conditioning as QR of the rows themselves (normal equations would square it); memory
/// depends on p only.
class TriangularFactor {
 public:
  explicit TriangularFactor(int columns = 0);
  /// As full() and rows() of another gave them.
  /// @param R  (p+1) × (p+1), upper triangular
  TriangularFactor(Eigen::MatrixXd R, long rows) : R_(std::move(R)), rows_(rows) {}

  int columns() const { return static_cast<int>(R_.cols()) - 1; }  ///< p
  long rows() const { return rows_; }
  /// Adds rows y = W β + e. Cost O(m p²).
  /// @param W  m × p
  /// @param y  m
  void add(const Eigen::Ref<const Eigen::MatrixXd>& W, const Eigen::Ref<const Eigen::VectorXd>& y);
  /// Adds the rows of another factor, each times `weight`.
  void add(const TriangularFactor& other, double weight = 1.0);

  const Eigen::MatrixXd& full() const { return R_; }
  Eigen::MatrixXd R() const { return R_.topLeftCorner(columns(), columns()); }
  Eigen::VectorXd z() const { return R_.col(columns()).head(columns()); }
  /// ‖W β − y‖² of these rows.
  double squared_error(const Eigen::VectorXd& beta) const;
  /// Wᵀ W and Wᵀ (y − W β).
  Eigen::MatrixXd information() const { return R().transpose() * R(); }
  Eigen::VectorXd gradient(const Eigen::VectorXd& beta) const { return R().transpose() * (z() - R() * beta); }

 private:
  Eigen::MatrixXd R_;
  long rows_{0};
};

/// Rows of all joints, those of joint j times weights[j].
/// @param joints  n, of as many columns
TriangularFactor weighted(const std::vector<TriangularFactor>& joints, const Eigen::VectorXd& weights);

/// One factor for each joint and each block of time. Memory is bounded: when there would be more than
/// `max_blocks`, neighbours are merged and the blocks become twice as long, then whole logs, then several logs
/// together (BlockPartition).
///
/// Weights per joint, covariances that hold for residuals correlated in time, and cross-validation over blocks
/// all follow from these factors without reading the rows again.
class BlockFactors {
 public:
  /// @param joints, columns  n, p
  /// @param block            length of a block at first [s]
  BlockFactors(int joints, int columns, double block, int max_blocks = 96);

  /// Adds rows of one joint. Rows of one call lie in one block each by their time.
  /// @param log   logs are kept apart: a block spans two only where max_blocks leaves no other choice
  /// @param time  m, ascending
  void add(long log, int joint, const Eigen::Ref<const Eigen::VectorXd>& time,
           const Eigen::Ref<const Eigen::MatrixXd>& W, const Eigen::Ref<const Eigen::VectorXd>& y);
  /// Adds the rows of others, of the same joints, columns and first length, and of other logs. In whatever order and
  /// grouping factors are added, the blocks are the same; their triangles agree up to rounding.
  void add(const BlockFactors& other);
  /// Puts a factor into a block as it is, to build up what partition(), key() and factor() of another gave.
  void put(const BlockPartition::Key& key, int joint, TriangularFactor factor);
  void coarsen_to(int level);

  int num_joints() const { return joints_; }
  int num_columns() const { return columns_; }
  const BlockPartition& partition() const { return partition_; }
  double block_length() const { return partition_.length(); }  ///< present length [s]
  int max_blocks() const { return max_blocks_; }
  int num_blocks() const { return static_cast<int>(blocks_.size()); }
  const BlockPartition::Key& key(int block) const { return blocks_[static_cast<std::size_t>(block)].key; }
  const TriangularFactor& factor(int block, int joint) const {
    return blocks_[static_cast<std::size_t>(block)].joints[static_cast<std::size_t>(joint)];
  }
  /// All rows of a joint.
  TriangularFactor joint(int joint) const;
  std::vector<TriangularFactor> joints() const;  ///< n
  /// All rows, those of joint j times weights[j].
  TriangularFactor weighted(const Eigen::VectorXd& weights) const;
  /// The same without the blocks for which `leave_out` is true.
  TriangularFactor weighted(const Eigen::VectorXd& weights, const std::vector<bool>& leave_out) const;

 private:
  struct Block {
    BlockPartition::Key key;
    std::vector<TriangularFactor> joints;
  };
  Block& block_at(BlockPartition::Key key);
  void coarsen();

  int joints_, columns_;
  BlockPartition partition_;
  int max_blocks_;
  std::vector<Block> blocks_;  ///< by key
};

}  // namespace heft::regression
