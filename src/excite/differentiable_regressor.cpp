#include "differentiable_regressor.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <vector>

#include "heft/model/batch_dynamics.hpp"
#include "regressor_slope.hpp"

namespace heft::excite {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using regression::Column;
using regression::ColumnKind;
using regression::RegressionColumns;

bool is_coupling(const Column& column) {
  return column.kind == ColumnKind::kCouplingInertia || column.kind == ColumnKind::kCouplingCoulomb ||
         column.kind == ColumnKind::kCouplingViscous;
}

/// Parameters of the links, ten a link.
VectorXd link_parameters(const model::Robot& robot) {
  VectorXd links(10 * robot.num_joints());
  Index at = 0;
  for (const model::RobotJoint& joint : robot.joints) {
    for (const double parameter : joint.link) links[at++] = parameter;
  }
  return links;
}

class ChosenColumns final : public DifferentiableRegressor {
 public:
  using Rows = std::vector<MatrixXd>;

  ChosenColumns(const RegressionColumns& columns, const std::vector<int>& chosen, const VectorXd& sign_width)
      : n_(columns.num_joints()),
        batch_(columns.robot()),
        slope_(columns.robot()),
        links_(link_parameters(columns.robot())),
        fitted_(columns.robot().couplings),
        couplings_(columns.structure().couplings),
        sign_width_(sign_width) {
    const auto last_row = [&](int c) {
      const Column& column = columns[chosen[static_cast<std::size_t>(c)]];
      if (!is_coupling(column)) return column.joint;
      const auto& coupling = couplings_[static_cast<std::size_t>(column.coupling)];
      return std::max(coupling.driven, coupling.driving);
    };
    order_.resize(chosen.size());
    std::iota(order_.begin(), order_.end(), 0);
    std::stable_sort(order_.begin(), order_.end(), [&](int a, int b) { return last_row(a) < last_row(b); });
    for (const int c : order_) columns_.push_back(columns[chosen[static_cast<std::size_t>(c)]]);
    for (Index i = 0; i < n_; ++i) {
      const auto felt = std::find_if(order_.begin(), order_.end(), [&](int c) { return last_row(c) >= i; });
      first_.push_back(felt - order_.begin());
    }
    for (Index i = 0; i < n_; ++i) {
      std::vector<int>& felt = link_columns_.emplace_back(static_cast<std::size_t>(10 * (n_ - i)));
      std::iota(felt.begin(), felt.end(), 10 * static_cast<int>(i));
    }
    for (const model::RobotJoint& joint : columns.robot().joints) actuation_.push_back(joint.actuation);
  }

  void evaluate(const MatrixXd& q, const MatrixXd& qd, const MatrixXd& qdd, Rows& rows,
                MatrixXd& tau) const override {
    const Index m = q.rows(), count = static_cast<Index>(columns_.size());
    rows.resize(static_cast<std::size_t>(n_));
    for (Index j = 0; j < n_; ++j) rows[static_cast<std::size_t>(j)].setZero(m, count - first(j));
    // The torque is summed over these rows, not taken from inverse dynamics, which rounds otherwise: the search ends in one of
    // many optima, and another last bit leads it to another motion.
    model::RegressorRows links;
    batch_.regressor_rows(q, qd, qdd, link_columns_, links);
    tau.setZero(m, n_);
    for (Index i = 0; i < n_; ++i) {
      const model::RegressorRows::Matrix felt = links[static_cast<std::size_t>(i)];
      for (Index k = 0; k < felt.cols(); ++k) tau.col(i) += felt.col(k) * links_[10 * i + k];
      for (std::size_t c = 0; c < columns_.size(); ++c) {
        const Column& column = columns_[c];
        if (column.kind == ColumnKind::kLink && column.joint >= i)
          column_of(rows, i, c) = felt.col(10 * (column.joint - i) + column.entry);
      }
    }
    add_drive_torque(qd, qdd, tau);
    for (std::size_t c = 0; c < columns_.size(); ++c) add_drive_column(c, qd, qdd, rows);
  }

  void add_gradient(const MatrixXd& q, const MatrixXd& qd, const MatrixXd& qdd, const Rows& G,
                    const MatrixXd& h, MatrixXd& by_q, MatrixXd& by_qd, MatrixXd& by_qdd) const override {
    add_drive_gradient(h, by_qd, by_qdd);
    for (std::size_t c = 0; c < columns_.size(); ++c) add_column_gradient(c, qd, G, by_qd, by_qdd);
    RegressorSlope::Weights H;
    RegressorSlope::Motion at, by;
    for (Index s = 0; s < q.rows(); s += 2) {
      // Weight of every entry of the links' regressor: h xᵀ for the torque, G where the column is chosen. An odd last
      // instant stands on both sides.
      const Index other = std::min(s + 1, q.rows() - 1);
      for (Index j = 0; j < n_; ++j) {
        const auto at_j = static_cast<std::size_t>(j);
        at.q[at_j] = Pair{q(s, j), q(other, j)};
        at.qd[at_j] = Pair{qd(s, j), qd(other, j)};
        at.qdd[at_j] = Pair{qdd(s, j), qdd(other, j)};
        for (Index i = 0; i <= j; ++i) {
          const Pair weight{h(s, i), h(other, i)};
          for (std::size_t k = 0; k < 10; ++k)
            H[static_cast<std::size_t>(i)][at_j][k] = weight * links_[10 * j + static_cast<Index>(k)];
        }
      }
      for (std::size_t c = 0; c < columns_.size(); ++c) {
        const Column& column = columns_[c];
        if (column.kind != ColumnKind::kLink) continue;
        const auto j = static_cast<std::size_t>(column.joint), k = static_cast<std::size_t>(column.entry);
        for (Index i = 0; i <= column.joint; ++i)
          H[static_cast<std::size_t>(i)][j][k] += Pair{entry(G, i, s, c), entry(G, i, other, c)};
      }
      slope_.gradient(at, H, by);
      for (Index j = 0; j < n_; ++j) {
        const auto at_j = static_cast<std::size_t>(j);
        for (int side = 0; side < (other > s ? 2 : 1); ++side) {
          by_q(s + side, j) += by.q[at_j][side];
          by_qd(s + side, j) += by.qd[at_j][side];
          by_qdd(s + side, j) += by.qdd[at_j][side];
        }
      }
    }
  }

 private:
  double& entry(Rows& rows, Index joint, Index sample, std::size_t column) const {
    return rows[static_cast<std::size_t>(joint)].coeffRef(sample, static_cast<Index>(column) - first(joint));
  }
  double entry(const Rows& rows, Index joint, Index sample, std::size_t column) const {
    return rows[static_cast<std::size_t>(joint)].coeff(sample, static_cast<Index>(column) - first(joint));
  }
  MatrixXd::ColXpr column_of(Rows& rows, Index joint, std::size_t column) const {
    return rows[static_cast<std::size_t>(joint)].col(static_cast<Index>(column) - first(joint));
  }
  MatrixXd::ConstColXpr column_of(const Rows& rows, Index joint, std::size_t column) const {
    return rows[static_cast<std::size_t>(joint)].col(static_cast<Index>(column) - first(joint));
  }

  void add_drive_torque(const MatrixXd& qd, const MatrixXd& qdd, MatrixXd& tau) const {
    for (Index i = 0; i < n_; ++i) {
      const auto& a = actuation_[static_cast<std::size_t>(i)];
      tau.col(i) += a.rotor_inertia * qdd.col(i) + a.viscous_friction * qd.col(i);
      tau.col(i).array() += a.friction_offset;
    }
    for (const auto& coupling : fitted_) {
      const VectorXd torque =
          coupling.rotor_inertia * shared(coupling, qdd) + coupling.viscous_friction * shared(coupling, qd);
      tau.col(coupling.driven) += torque;
      tau.col(coupling.driving) += coupling.ratio * torque;
    }
  }

  void add_drive_column(std::size_t c, const MatrixXd& qd, const MatrixXd& qdd, Rows& rows) const {
    const Column& column = columns_[c];
    const int j = column.joint;
    switch (column.kind) {
      case ColumnKind::kLink: return;
      case ColumnKind::kRotorInertia: column_of(rows, j, c) = qdd.col(j); return;
      case ColumnKind::kCoulomb: column_of(rows, j, c) = smooth_sign(qd.col(j), sign_width_[j]); return;
      case ColumnKind::kViscous: column_of(rows, j, c) = qd.col(j); return;
      case ColumnKind::kOffset: column_of(rows, j, c).setOnes(); return;
      case ColumnKind::kCouplingInertia:
      case ColumnKind::kCouplingCoulomb:
      case ColumnKind::kCouplingViscous: break;
    }
    const auto& coupling = couplings_[static_cast<std::size_t>(column.coupling)];
    VectorXd value = shared(coupling, column.kind == ColumnKind::kCouplingInertia ? qdd : qd);
    if (column.kind == ColumnKind::kCouplingCoulomb)
      value = smooth_sign(value, sign_width_[coupling.driven]).eval();
    column_of(rows, coupling.driven, c) = value;
    column_of(rows, coupling.driving, c) = coupling.ratio * value;
  }

  /// The torque's part.
  void add_drive_gradient(const MatrixXd& h, MatrixXd& by_qd, MatrixXd& by_qdd) const {
    for (Index i = 0; i < n_; ++i) {
      const auto& a = actuation_[static_cast<std::size_t>(i)];
      by_qdd.col(i) += a.rotor_inertia * h.col(i);
      by_qd.col(i) += a.viscous_friction * h.col(i);
    }
    for (const auto& coupling : fitted_) {
      const VectorXd weight = shared(coupling, h);
      add_shared(coupling, coupling.rotor_inertia * weight, by_qdd);
      add_shared(coupling, coupling.viscous_friction * weight, by_qd);
    }
  }

  void add_column_gradient(std::size_t c, const MatrixXd& qd, const Rows& G, MatrixXd& by_qd,
                           MatrixXd& by_qdd) const {
    const Column& column = columns_[c];
    const int j = column.joint;
    switch (column.kind) {
      case ColumnKind::kLink:
      case ColumnKind::kOffset: return;
      case ColumnKind::kRotorInertia: by_qdd.col(j) += column_of(G, j, c); return;
      case ColumnKind::kCoulomb:
        by_qd.col(j) += column_of(G, j, c).cwiseProduct(sign_slope(qd.col(j), sign_width_[j]));
        return;
      case ColumnKind::kViscous: by_qd.col(j) += column_of(G, j, c); return;
      case ColumnKind::kCouplingInertia:
      case ColumnKind::kCouplingCoulomb:
      case ColumnKind::kCouplingViscous: break;
    }
    const auto& coupling = couplings_[static_cast<std::size_t>(column.coupling)];
    VectorXd slope = column_of(G, coupling.driven, c) + coupling.ratio * column_of(G, coupling.driving, c);
    if (column.kind == ColumnKind::kCouplingCoulomb)
      slope = slope.cwiseProduct(sign_slope(shared(coupling, qd), sign_width_[coupling.driven])).eval();
    add_shared(coupling, slope, column.kind == ColumnKind::kCouplingInertia ? by_qdd : by_qd);
  }

  static VectorXd shared(const GearCoupling<double>& coupling, const MatrixXd& values) {
    return values.col(coupling.driven) + coupling.ratio * values.col(coupling.driving);
  }
  static void add_shared(const GearCoupling<double>& coupling, const VectorXd& slope, MatrixXd& by) {
    by.col(coupling.driven) += slope;
    by.col(coupling.driving) += coupling.ratio * slope;
  }
  static VectorXd smooth_sign(const VectorXd& velocity, double width) {
    return velocity.unaryExpr([width](double v) { return std::tanh(v / width); });
  }
  static VectorXd sign_slope(const VectorXd& velocity, double width) {
    return velocity.unaryExpr([width](double v) {
      const double s = std::tanh(v / width);
      return (1.0 - s * s) / width;
    });
  }

  Index n_;
  model::BatchDynamics batch_;
  RegressorSlope slope_;
  VectorXd links_;
  std::vector<JointActuation<double>> actuation_;
  std::vector<Column> columns_;                  ///< in their order
  std::vector<std::vector<int>> link_columns_;   ///< of the arm's regressor, for each joint: of the links that it moves
  std::vector<GearCoupling<double>> fitted_;     ///< with the robot's values, for the torque
  std::vector<GearCoupling<double>> couplings_;  ///< of the structure, for the columns
  VectorXd sign_width_;
};

}  // namespace

std::unique_ptr<DifferentiableRegressor> make_differentiable_regressor(const RegressionColumns& columns,
                                                                       const std::vector<int>& chosen,
                                                                       const Eigen::VectorXd& sign_width) {
  return std::make_unique<ChosenColumns>(columns, chosen, sign_width);
}

}  // namespace heft::excite
