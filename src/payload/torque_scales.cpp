#include "torque_scales.hpp"

#include <cmath>

#include "heft/host/decompositions.hpp"
#include "heft/statistics/block_jackknife.hpp"

namespace heft::payload {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A joint that hardly feels the load has no scale worth naming.
constexpr double kWidest = 0.5;

}  // namespace

TorqueScales::TorqueScales(int joints) : dependence_(static_cast<std::size_t>(joints)), joints_(joints) {}

void TorqueScales::add(int block, int joint, const VectorXd& load, const VectorXd& friction,
                       double residual) {
  const auto at = static_cast<std::size_t>(block);
  if (at >= blocks_.size())
    blocks_.resize(at + 1, std::vector<Moments>(static_cast<std::size_t>(joints_), Moments::Zero()));
  Eigen::Matrix<double, kColumns + 1, 1> row;
  row << load, friction, residual;
  blocks_[at][static_cast<std::size_t>(joint)] += row * row.transpose();
}

void TorqueScales::add_dependence(int joint, const VectorXd& load, const VectorXd& friction,
                                  const VectorXd& arm) {
  MatrixXd& sum = dependence_[static_cast<std::size_t>(joint)];
  if (sum.size() == 0) sum = MatrixXd::Zero(kColumns, arm.size());
  VectorXd row(kColumns);
  row << load, friction;
  sum += row * arm.transpose();
}

std::vector<Estimated> TorqueScales::solve(const std::vector<int>& members, int merge, double edge_factor,
                                           const VectorXd& x, const std::optional<MatrixXd>& model) const {
  std::vector<Estimated> scales(static_cast<std::size_t>(joints_));
  // The load's ten columns become one.
  MatrixXd P = MatrixXd::Zero(kColumns + 1, 4);
  P.block(0, 0, 10, 1) = x;
  P.bottomRightCorner(3, 3).setIdentity();
  for (std::size_t j = 0; j < scales.size(); ++j) {
    // Friction hardly leans on 0: only where the joint shows none.
    VectorXd loose = VectorXd::Constant(3, 1e12);
    statistics::BlockJackknife sums(VectorXd::Zero(3), loose);
    Eigen::Matrix4d whole = Eigen::Matrix4d::Zero();
    for (const int block : members) {
      if (static_cast<std::size_t>(block) >= blocks_.size()) continue;
      const Eigen::Matrix4d M = P.transpose() * blocks_[static_cast<std::size_t>(block)][j] * P;
      whole += M;
      // The block as the rows of its triangular factor, which have the same sums.
      const Eigensystem eigen = eigensystem_of(M);
      for (int k = 0; k < 4; ++k) {
        if (!(eigen.values[k] > 0.0)) continue;
        const VectorXd row = std::sqrt(eigen.values[k]) * eigen.vectors.col(k);
        sums.add(block, row.head(3), row[3], 1.0);
      }
    }
    if (!(whole(0, 0) > 0.0)) continue;
    const statistics::BlockJackknife::Result solved = sums.solve(members, merge);
    if (solved.blocks < 3) continue;
    double variance = edge_factor * solved.covariance(0, 0);
    if (model && dependence_[j].size() > 0) {
      const VectorXd slope =
          (solved.information_inverse * P.topLeftCorner(kColumns, 3).transpose() * dependence_[j])
              .row(0)
              .transpose();
      variance += slope.dot(*model * slope);
    }
    const auto scale =
        statistics::Interval::around(solved.estimate[0], std::sqrt(variance), solved.interval_factor);
    scales[j] = {scale, scale.half_width() < kWidest};
  }
  return scales;
}

MatrixXd TorqueScales::gain_sensitivity(const std::vector<int>& members, const VectorXd& x,
                                        const MatrixXd& information_inverse,
                                        const VectorXd& noise_variance) const {
  MatrixXd S = MatrixXd::Zero(information_inverse.rows(), joints_);
  for (int j = 0; j < joints_; ++j) {
    VectorXd pull = VectorXd::Zero(kColumns);  // Σ wᵀ (w x) of the rows of this joint, its own columns
    for (const int block : members) {
      if (static_cast<std::size_t>(block) >= blocks_.size()) continue;
      pull +=
          blocks_[static_cast<std::size_t>(block)][static_cast<std::size_t>(j)].topLeftCorner(kColumns, 10) *
          x;
    }
    pull /= noise_variance[j];
    S.col(j) = -(information_inverse.leftCols(10) * pull.head(10) +
                 information_inverse.middleCols(10 + 2 * j, 2) * pull.tail(2));
  }
  return S;
}

}  // namespace heft::payload
