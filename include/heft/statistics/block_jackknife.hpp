/// @file
/// Covariance of a least squares estimate whose residuals are correlated in time.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace heft::statistics {

/// Least squares sums kept block by block in time, so that each block can be taken out again.
///
/// Estimate x = A⁻¹ r with A = P₀⁻¹ + Σ_b A_b, r = P₀⁻¹ x₀ + Σ_b r_b. Its covariance by the delete-a-block
/// jackknife, V = (B − 1)/B Σ_b (x₍b₎ − x)(x₍b₎ − x)ᵀ, x₍b₎ being the estimate without block b. For least
/// squares this is the cluster-robust sandwich estimate in its CR3 form, which makes up for the part of the
/// residuals that the fit itself takes away [1]. It holds whatever the correlation inside a block; blocks
/// must be several correlation times long.
///
/// [1] J. G. MacKinnon, M. Ø. Nielsen, M. D. Webb, Cluster-robust inference: a guide to empirical practice,
///     Journal of Econometrics 232 (2023).
class BlockJackknife {
 public:
  /// @param prior     x₀, p
  /// @param variance  diagonal of P₀, all > 0
  BlockJackknife(Eigen::VectorXd prior, Eigen::VectorXd variance);

  /// Adds one row y = w x + e to a block.
  /// @param block  from 0, any order
  /// @param noise_variance  of e, > 0
  void add(int block, const Eigen::VectorXd& w, double y, double noise_variance);

  /// Says for a row added that its y was made as y = (measured) − d·z with a z that is itself uncertain, so
  /// that dependence() can say what an error of z does to the estimate.
  void add_dependence(int block, const Eigen::VectorXd& w, const Eigen::VectorXd& d, double noise_variance);

  struct Result {
    Eigen::VectorXd estimate;
    Eigen::MatrixXd information_inverse;  ///< A⁻¹: covariance if the noise variances were right and white
    Eigen::MatrixXd covariance;           ///< V; zero with fewer than two blocks
    int blocks{0};                        ///< B: blocks (of the given length) that hold rows
    /// 0.975 quantile of Student's t with B − 1 degrees of freedom: half-width of a 95 % interval in
    /// standard deviations. Infinite with fewer than two blocks.
    double interval_factor{0.0};
  };
  /// @param members  blocks to use, in time order
  /// @param merge    this many neighbouring blocks count as one
  Result solve(const std::vector<int>& members, int merge = 1) const;
  /// The same with all blocks.
  Result solve() const;

  /// ∂x/∂z = −A⁻¹ Σ wᵀ d / σ² of these blocks, p × size of z. Empty when there was no dependence.
  Eigen::MatrixXd dependence(const std::vector<int>& members) const;

  int num_blocks() const { return static_cast<int>(blocks_.size()); }
  bool is_empty(int block) const;

 private:
  struct Block {
    Eigen::MatrixXd A;
    Eigen::VectorXd r;
    Eigen::MatrixXd H;
    long rows{0};
  };
  Block& at(int block);

  Eigen::VectorXd prior_, variance_;
  std::vector<Block> blocks_;
};

}  // namespace heft::statistics
