#include "heft/statistics/block_jackknife.hpp"

#include <cmath>
#include <limits>
#include <numeric>

#include "heft/host/decompositions.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/statistics/jackknife.hpp"

namespace heft::statistics {

BlockJackknife::BlockJackknife(Eigen::VectorXd prior, Eigen::VectorXd variance)
    : prior_(std::move(prior)), variance_(std::move(variance)) {}

BlockJackknife::Block& BlockJackknife::at(int block) {
  if (block >= num_blocks()) blocks_.resize(static_cast<std::size_t>(block) + 1);
  Block& b = blocks_[static_cast<std::size_t>(block)];
  if (b.A.size() == 0) {
    b.A = Eigen::MatrixXd::Zero(prior_.size(), prior_.size());
    b.r = Eigen::VectorXd::Zero(prior_.size());
  }
  return b;
}

void BlockJackknife::add(int block, const Eigen::VectorXd& w, double y, double noise_variance) {
  Block& b = at(block);
  b.A.selfadjointView<Eigen::Lower>().rankUpdate(w, 1.0 / noise_variance);
  b.r += w * (y / noise_variance);
  ++b.rows;
}

void BlockJackknife::add_dependence(int block, const Eigen::VectorXd& w, const Eigen::VectorXd& d,
                                    double noise_variance) {
  Block& b = at(block);
  if (b.H.size() == 0) b.H = Eigen::MatrixXd::Zero(prior_.size(), d.size());
  b.H.noalias() += (w / noise_variance) * d.transpose();
}

bool BlockJackknife::is_empty(int block) const {
  return block >= num_blocks() || blocks_[static_cast<std::size_t>(block)].rows == 0;
}

BlockJackknife::Result BlockJackknife::solve() const {
  std::vector<int> all(blocks_.size());
  std::iota(all.begin(), all.end(), 0);
  return solve(all);
}

BlockJackknife::Result BlockJackknife::solve(const std::vector<int>& members, int merge) const {
  Eigen::MatrixXd A = variance_.cwiseInverse().asDiagonal();
  Eigen::VectorXd r = prior_.cwiseQuotient(variance_);
  struct Sum {
    Eigen::MatrixXd A;
    Eigen::VectorXd r;
  };
  std::vector<Sum> sums;
  int previous = -1;
  for (const int b : members) {
    if (is_empty(b)) continue;
    const Block& block = blocks_[static_cast<std::size_t>(b)];
    const Eigen::MatrixXd full = block.A.selfadjointView<Eigen::Lower>();
    A += full;
    r += block.r;
    // Blocks are merged by their place in time, so that an empty one leaves a gap and not a shift.
    if (b / merge != previous)
      sums.push_back({Eigen::MatrixXd::Zero(A.rows(), A.cols()), Eigen::VectorXd::Zero(r.size())});
    previous = b / merge;
    sums.back().A += full;
    sums.back().r += block.r;
  }
  Result result;
  // One decomposition for both.
  Eigen::MatrixXd right(A.rows(), A.cols() + 1);
  right << r, Eigen::MatrixXd::Identity(A.rows(), A.cols());
  const Eigen::MatrixXd solved = solve_symmetric(A, right);
  result.estimate = solved.col(0);
  result.information_inverse = solved.rightCols(A.cols());
  result.covariance = Eigen::MatrixXd::Zero(A.rows(), A.cols());
  result.blocks = static_cast<int>(sums.size());
  result.interval_factor = interval_factor(result.blocks - 1);
  if (result.blocks < 2) return result;
  Eigen::MatrixXd changes(A.rows(), result.blocks);
  for (Eigen::Index b = 0; b < changes.cols(); ++b) {
    const Sum& sum = sums[static_cast<std::size_t>(b)];
    changes.col(b) = solve_symmetric(A - sum.A, r - sum.r) - result.estimate;
  }
  result.covariance = jackknife_covariance(changes);
  return result;
}

Eigen::MatrixXd BlockJackknife::dependence(const std::vector<int>& members) const {
  Eigen::MatrixXd A = variance_.cwiseInverse().asDiagonal();
  Eigen::MatrixXd H;
  for (const int b : members) {
    if (is_empty(b)) continue;
    const Block& block = blocks_[static_cast<std::size_t>(b)];
    A += Eigen::MatrixXd(block.A.selfadjointView<Eigen::Lower>());
    if (block.H.size() == 0) continue;
    if (H.size() == 0) {
      H = block.H;
    } else {
      H += block.H;
    }
  }
  if (H.size() == 0) return H;
  return -solve_symmetric(A, H);
}

}  // namespace heft::statistics
