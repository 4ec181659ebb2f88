/// @file
/// What an instrumental variable fit keeps of the rows.
#pragma once

#include <map>
#include <vector>

#include <Eigen/Core>

#include "heft/regression/triangular_factor.hpp"

namespace heft::identify {

/// Sums of an instrumental variable fit by block of time and joint, and of the plain rows. Memory
/// is bounded as in BlockFactors.
class InstrumentSums {
 public:
  InstrumentSums(int joints, int columns, double block, int max_blocks = 96);
  /// Of rows whose plain sums are known: the same rows, in blocks of the same first length. `plain` is to stay.
  explicit InstrumentSums(const regression::BlockFactors& plain);

  /// Adds rows of one joint: time ascending, Z and W m × b, y m.
  void add(int log, int joint, const Eigen::Ref<const Eigen::VectorXd>& time,
           const Eigen::Ref<const Eigen::MatrixXd>& Z, const Eigen::Ref<const Eigen::MatrixXd>& W,
           const Eigen::Ref<const Eigen::VectorXd>& y);

  int num_joints() const { return plain().num_joints(); }
  int num_columns() const { return plain().num_columns(); }
  /// The same rows as for plain least squares; blocks of equal number are the same stretch of time.
  const regression::BlockFactors& plain() const { return known_ != nullptr ? *known_ : plain_; }
  int num_blocks() const { return static_cast<int>(blocks_.size()); }

  /// Zᵀ W (b × b) and Zᵀ y (b).
  struct Moments {
    Eigen::MatrixXd A;
    Eigen::VectorXd r;
  };
  /// Σ_j w_j of one block.
  Moments weighted(int block, const Eigen::VectorXd& weights) const;
  /// Σ_j w_j of all.
  Moments weighted(const Eigen::VectorXd& weights) const;

 private:
  void coarsen();

  regression::BlockFactors plain_;
  const regression::BlockFactors* known_{nullptr};  ///< instead of plain_
  regression::BlockPartition partition_;
  std::map<regression::BlockPartition::Key, std::vector<Moments>> blocks_;  ///< per joint
};

}  // namespace heft::identify
