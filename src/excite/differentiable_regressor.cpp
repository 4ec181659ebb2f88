#include "differentiable_regressor.hpp"

#include <array>
#include <cmath>

#include <ceres/jet.h>

#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/dynamics/regressor.hpp"
#include "heft/model/sized.hpp"

namespace heft::excite {
namespace {

using regression::Column;
using regression::ColumnKind;
using regression::RegressionColumns;

template <typename Scalar, int N>
ArmModel<Scalar, N> converted(const ArmModel<double, N>& arm) {
  ArmModel<Scalar, N> result;
  for (std::size_t i = 0; i < static_cast<std::size_t>(N); ++i) {
    result.joints[i].type = arm.joints[i].type;
    for (std::size_t k = 0; k < 9; ++k) result.joints[i].rotation[k] = Scalar(arm.joints[i].rotation[k]);
    for (std::size_t k = 0; k < 3; ++k) {
      result.joints[i].position[k] = Scalar(arm.joints[i].position[k]);
      result.joints[i].axis[k] = Scalar(arm.joints[i].axis[k]);
    }
    for (std::size_t k = 0; k < 10; ++k) result.links[i][k] = Scalar(arm.links[i][k]);
  }
  for (std::size_t k = 0; k < 3; ++k) result.gravity[k] = Scalar(arm.gravity[k]);
  return result;
}

/// Instances take long to compile, so there are few. A smaller arm gets massless joints at its tip that do not move:
/// they change neither the torques of the others nor their columns.
constexpr int compiled_size(int joints) { return joints <= 6 ? 6 : joints <= 7 ? 7 : model::kMaxJoints; }

/// The robot with N joints.
template <int N>
ArmModel<double, N> padded_arm(model::Robot robot) {
  robot.joints.resize(static_cast<std::size_t>(N));
  return model::to_arm_model<N>(robot);
}

/// Vectors of n entries with zeros up to N.
template <int N>
JointVector<double, N> padded(const Eigen::VectorXd& v) {
  JointVector<double, N> result = JointVector<double, N>::Zero();
  result.head(v.size()) = v;
  return result;
}

/// For arms of up to N joints.
template <int N>
class Sized final : public DifferentiableRegressor {
 public:
  using Jet = ceres::Jet<double, 3 * N>;

  Sized(const RegressionColumns& columns, const std::vector<int>& chosen, const Eigen::VectorXd& sign_width)
      : n_(columns.num_joints()),
        fitted_(columns.robot().couplings),
        couplings_(columns.structure().couplings),
        sign_width_(sign_width) {
    for (const int c : chosen) columns_.push_back(columns[c]);
    const ArmModel<double, N> model = padded_arm<N>(columns.robot());
    arm_ = DynamicArm<double, N>(model);
    jet_arm_ = DynamicArm<Jet, N>(converted<Jet, N>(model));
    for (std::size_t i = 0; i < static_cast<std::size_t>(N); ++i) {
      for (std::size_t k = 0; k < 10; ++k) links_[static_cast<Eigen::Index>(10 * i + k)] = model.links[i][k];
      actuation_[i] = model.actuation[i];
    }
  }

  void evaluate(const Eigen::VectorXd& q, const Eigen::VectorXd& qd, const Eigen::VectorXd& qdd,
                Eigen::Ref<Eigen::MatrixXd> Y, Eigen::Ref<Eigen::VectorXd> tau) const override {
    const JointVector<double, N> position = padded<N>(q), velocity = padded<N>(qd),
                                 acceleration = padded<N>(qdd);
    LinkRegressor<double, N> links;
    link_regressor(arm_, joint_trigonometry<DynamicArm<double, N>>(position), position, velocity,
                   acceleration, links);
    tau = (links * links_).head(n_);
    for (int i = 0; i < n_; ++i) {
      const auto& a = actuation_[static_cast<std::size_t>(i)];
      tau[i] += a.rotor_inertia * qdd[i] + a.viscous_friction * qd[i] + a.friction_offset;
    }
    for (const auto& coupling : fitted_) {
      const double v = shared_motion(coupling, qd[coupling.driving], qd[coupling.driven]);
      const double a = shared_motion(coupling, qdd[coupling.driving], qdd[coupling.driven]);
      const double torque = coupling.rotor_inertia * a + coupling.viscous_friction * v;
      tau[coupling.driven] += torque;
      tau[coupling.driving] += coupling.ratio * torque;
    }
    Y.setZero();
    for (std::size_t c = 0; c < columns_.size(); ++c) {
      const auto at = static_cast<Eigen::Index>(c);
      const Column& column = columns_[c];
      const int j = column.joint;
      switch (column.kind) {
        case ColumnKind::kLink: Y.col(at) = links.col(10 * j + column.entry).head(n_); break;
        case ColumnKind::kRotorInertia: Y(j, at) = qdd[j]; break;
        case ColumnKind::kCoulomb: Y(j, at) = std::tanh(qd[j] / sign_width_[j]); break;
        case ColumnKind::kViscous: Y(j, at) = qd[j]; break;
        case ColumnKind::kOffset: Y(j, at) = 1.0; break;
        case ColumnKind::kCouplingInertia:
        case ColumnKind::kCouplingCoulomb:
        case ColumnKind::kCouplingViscous: {
          const auto& coupling = couplings_[static_cast<std::size_t>(column.coupling)];
          const double value = shared(coupling, column.kind, qd, qdd);
          Y(coupling.driven, at) = value;
          Y(coupling.driving, at) = coupling.ratio * value;
          break;
        }
      }
    }
  }

  void gradient(const Eigen::VectorXd& q, const Eigen::VectorXd& qd, const Eigen::VectorXd& qdd,
                const Eigen::Ref<const Eigen::MatrixXd>& G, const Eigen::VectorXd& h, Eigen::VectorXd& by_q,
                Eigen::VectorXd& by_qd, Eigen::VectorXd& by_qdd) const override {
    // Weight of every entry of the links' regressor: h xᵀ for the torque, G where the column is chosen.
    Eigen::Matrix<double, N, 10 * N> H = padded<N>(h) * links_.transpose();
    by_qd.setZero(n_);
    by_qdd.setZero(n_);
    for (int i = 0; i < n_; ++i) {
      const auto& a = actuation_[static_cast<std::size_t>(i)];
      by_qdd[i] = h[i] * a.rotor_inertia;
      by_qd[i] = h[i] * a.viscous_friction;
    }
    for (const auto& coupling : fitted_) {
      const double weight = h[coupling.driven] + coupling.ratio * h[coupling.driving];
      by_qdd[coupling.driven] += weight * coupling.rotor_inertia;
      by_qdd[coupling.driving] += coupling.ratio * weight * coupling.rotor_inertia;
      by_qd[coupling.driven] += weight * coupling.viscous_friction;
      by_qd[coupling.driving] += coupling.ratio * weight * coupling.viscous_friction;
    }
    for (std::size_t c = 0; c < columns_.size(); ++c) {
      const auto at = static_cast<Eigen::Index>(c);
      const Column& column = columns_[c];
      const int j = column.joint;
      switch (column.kind) {
        case ColumnKind::kLink: H.col(10 * j + column.entry).head(n_) += G.col(at); break;
        case ColumnKind::kRotorInertia: by_qdd[j] += G(j, at); break;
        case ColumnKind::kCoulomb: by_qd[j] += G(j, at) * sign_slope(qd[j], sign_width_[j]); break;
        case ColumnKind::kViscous: by_qd[j] += G(j, at); break;
        case ColumnKind::kOffset: break;
        case ColumnKind::kCouplingInertia:
        case ColumnKind::kCouplingCoulomb:
        case ColumnKind::kCouplingViscous: {
          const auto& coupling = couplings_[static_cast<std::size_t>(column.coupling)];
          double slope = G(coupling.driven, at) + coupling.ratio * G(coupling.driving, at);
          if (column.kind == ColumnKind::kCouplingCoulomb) {
            slope *= sign_slope(shared_motion(coupling, qd[coupling.driving], qd[coupling.driven]),
                                sign_width_[coupling.driven]);
          }
          Eigen::VectorXd& by = column.kind == ColumnKind::kCouplingInertia ? by_qdd : by_qd;
          by[coupling.driven] += slope;
          by[coupling.driving] += coupling.ratio * slope;
          break;
        }
      }
    }

    JointVector<Jet, N> position, velocity, acceleration;
    JointTrigonometry<DynamicArm<Jet, N>> trig;
    for (int i = 0; i < N; ++i) {
      position[i] = i < n_ ? Jet(q[i], i) : Jet(0.0);
      velocity[i] = i < n_ ? Jet(qd[i], N + i) : Jet(0.0);
      acceleration[i] = i < n_ ? Jet(qdd[i], 2 * N + i) : Jet(0.0);
      trig.joint[static_cast<std::size_t>(i)] = {sin(position[i]), cos(position[i])};
    }
    Table Y;
    link_regressor(jet_arm_, trig, position, velocity, acceleration, Y);
    Eigen::Matrix<double, 3 * N, 1> sum = Eigen::Matrix<double, 3 * N, 1>::Zero();
    for (int c = 0; c < 10 * n_; ++c) {
      for (int i = 0; i <= c / 10; ++i) {
        if (H(i, c) != 0.0) sum += H(i, c) * Y(i, c).v;
      }
    }
    by_q = sum.head(n_);
    by_qd += sum.segment(N, n_);
    by_qdd += sum.segment(2 * N, n_);
  }

 private:
  /// n × 10n numbers on the heap: with their derivatives they pass what a stack should hold.
  struct Table {
    std::vector<Jet> entries = std::vector<Jet>(10 * N * N);
    Jet& operator()(int i, int c) { return entries[static_cast<std::size_t>(N * c + i)]; }
  };

  double shared(const GearCoupling<double>& coupling, ColumnKind kind, const Eigen::VectorXd& qd,
                const Eigen::VectorXd& qdd) const {
    const double v = shared_motion(coupling, qd[coupling.driving], qd[coupling.driven]);
    if (kind == ColumnKind::kCouplingViscous) return v;
    if (kind == ColumnKind::kCouplingCoulomb) return std::tanh(v / sign_width_[coupling.driven]);
    return shared_motion(coupling, qdd[coupling.driving], qdd[coupling.driven]);
  }
  static double sign_slope(double velocity, double width) {
    const double s = std::tanh(velocity / width);
    return (1.0 - s * s) / width;
  }

  int n_;
  DynamicArm<double, N> arm_;
  DynamicArm<Jet, N> jet_arm_;
  Eigen::Matrix<double, 10 * N, 1> links_;
  std::array<JointActuation<double>, N> actuation_;
  std::vector<Column> columns_;
  std::vector<GearCoupling<double>> fitted_;     ///< with the robot's values, for the torque
  std::vector<GearCoupling<double>> couplings_;  ///< of the structure, for the columns
  Eigen::VectorXd sign_width_;
};

}  // namespace

std::unique_ptr<DifferentiableRegressor> make_differentiable_regressor(const RegressionColumns& columns,
                                                                       const std::vector<int>& chosen,
                                                                       const Eigen::VectorXd& sign_width) {
  const auto make = [&](auto n) -> std::unique_ptr<DifferentiableRegressor> {
    return std::make_unique<Sized<compiled_size(n)>>(columns, chosen, sign_width);
  };
  return model::with_joint_count(columns.num_joints(), columns.robot().name, make);
}

}  // namespace heft::excite
