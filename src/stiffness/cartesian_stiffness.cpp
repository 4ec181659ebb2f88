#include "heft/stiffness/cartesian_stiffness.hpp"

#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/model/dynamics.hpp"

namespace heft::stiffness {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// x = 1/k, 0 for a rigid joint.
VectorXd compliance_of(const model::Kinematics& kinematics, const VectorXd& q, const VectorXd& stiffness) {
  const Index n = kinematics.num_joints();
  if (q.size() != n || stiffness.size() != n) {
    throw InputError(
        fmt::format("robot \"{}\" has {} joints; the pose has {} positions and there are {} stiffnesses",
                    kinematics.robot().name, n, q.size(), stiffness.size()));
  }
  VectorXd x(n);
  for (Index j = 0; j < n; ++j) {
    if (!(stiffness[j] > 0.0)) {
      throw InputError(
          fmt::format("stiffness of joint {} is {}; it has to be above zero (inf for a rigid joint)", j + 1,
                      stiffness[j]));
    }
    x[j] = 1.0 / stiffness[j];
  }
  return x;
}

Vector6d turned(const Eigen::Matrix3d& R, const Vector6d& w) {
  Vector6d result;
  result << R * w.head<3>(), R * w.tail<3>();
  return result;
}

/// Rotation vector of R.
Eigen::Vector3d rotation_vector(const Eigen::Matrix3d& R) {
  // (R - Rᵀ)/2 = [a sin φ]×, tr R = 1 + 2 cos φ.
  const Eigen::Vector3d s(0.5 * (R(2, 1) - R(1, 2)), 0.5 * (R(0, 2) - R(2, 0)), 0.5 * (R(1, 0) - R(0, 1)));
  const double sine = s.norm();
  const double angle = std::atan2(sine, 0.5 * (R.trace() - 1.0));
  return sine > 0.0 ? Eigen::Vector3d(s * (angle / sine)) : s;
}

Vector6d displacement(const model::ToolPlacement& from, const model::ToolPlacement& to) {
  Vector6d d;
  d << to.position - from.position, rotation_vector(to.rotation * from.rotation.transpose());
  return d;
}

/// K_θ - K_C > 0 with its symmetric part, in the form E - √x K_C √x, which rigid joints leave alone.
bool holds(const VectorXd& x, const MatrixXd& K_C) {
  const VectorXd root = x.cwiseSqrt();
  const MatrixXd S = MatrixXd::Identity(x.size(), x.size()) -
                     root.asDiagonal() * (0.5 * (K_C + K_C.transpose())) * root.asDiagonal();
  return eigenvalues_of(S)[0] > 0.0;
}

/// Load on the joints and its derivative by the joint positions.
struct JointLoad {
  VectorXd torque;
  MatrixXd derivative;
};

/// Solves links = motors + x ∘ torque(links) by Newton's method.
/// @param load  from link positions
template <typename Load>
std::pair<VectorXd, int> equilibrium(const VectorXd& motors, const VectorXd& x, const Load& load) {
  const Index n = motors.size();
  constexpr int kMostSteps = 50;
  constexpr double kFar = 1.0;  // a joint that gives by more than this [rad, m] is no spring any more
  VectorXd links = motors;
  double before = std::numeric_limits<double>::infinity();
  for (int k = 1; k <= kMostSteps; ++k) {
    const JointLoad at = load(links);
    const VectorXd error = links - motors - x.cwiseProduct(at.torque);
    const MatrixXd slope = MatrixXd::Identity(n, n) - x.asDiagonal() * at.derivative;
    const VectorXd step = least_squares(slope, -error);
    links += step;
    const double size = step.cwiseAbs().maxCoeff();
    const double far = (links - motors).cwiseAbs().maxCoeff();
    if (!(far < kFar)) break;
    // Newton doubles the digits; once a step no longer shrinks, rounding is all that is left.
    if (size <= 1e-15 * (1.0 + links.cwiseAbs().maxCoeff()) || (size < 1e-9 && size >= 0.25 * before)) {
      if (!holds(x, load(links).derivative)) break;
      return {links, k};
    }
    before = size;
  }
  throw InputError(
      "the joints are too soft for this load: no equilibrium near the pose; check units of stiffness "
      "(N·m/rad) and load");
}

/// A wrench on the tool as a load.
auto wrench_load(const model::Kinematics& kinematics, const Vector6d& wrench, WrenchFrame frame) {
  return [&kinematics, wrench, frame](const VectorXd& q) {
    return JointLoad{kinematics.joint_torque(q, wrench, frame),
                     kinematics.complementary_stiffness(q, wrench, frame)};
  };
}

CartesianStiffness stiffness_at(const model::Kinematics& kinematics, const VectorXd& q,
                                const VectorXd& stiffness, const MatrixXd* K_C) {
  const VectorXd x = compliance_of(kinematics, q, stiffness);
  const Index n = x.size();
  const MatrixXd J = kinematics.jacobian(q);
  CartesianStiffness result;
  result.stiffness.setConstant(std::numeric_limits<double>::quiet_NaN());
  // δθ = (E - x K_C)⁻¹ x Jᵀ w.
  MatrixXd give = x.asDiagonal() * J.transpose();
  if (K_C != nullptr) {
    result.stable = holds(x, *K_C);
    const MatrixXd slope = MatrixXd::Identity(n, n) - x.asDiagonal() * (*K_C);
    give = least_squares(slope, give);
  }
  result.compliance = J * give;
  if (K_C == nullptr) result.compliance = 0.5 * (result.compliance + result.compliance.transpose()).eval();
  if (!result.stable) {
    result.note = "the load overcomes the springs: the arm would give way";
    return result;
  }
  const Index elastic = (x.array() > 0.0).count();
  if (elastic < 6) {
    result.note = fmt::format(
        "{} of {} joints give: the tool is rigid in some direction and its stiffness infinite there", elastic,
        n);
    return result;
  }
  // Rank of the tool's motions with springs behind them, lengths over the arm's own.
  MatrixXd B = J * x.cwiseSqrt().asDiagonal();
  double length = 0.0;
  for (Index j = 0; j < n; ++j) length = std::max(length, J.col(j).head<3>().norm());
  B.topRows<3>() /= length > 0.0 ? length : 1.0;
  const VectorXd values = singular_values(triangle_of(B.transpose()));
  if (values[5] <= 1e-12 * values[0]) {
    result.note =
        "the pose is singular: the tool is rigid in some direction and its stiffness infinite there";
    return result;
  }
  result.has_stiffness = true;
  if (n == 6) {
    // J⁻ᵀ (K_θ - K_C) J⁻¹, without the compliance, whose condition is the square.
    const MatrixXd inverse = least_squares(J, MatrixXd::Identity(6, 6));
    MatrixXd K = stiffness.asDiagonal();
    if (K_C != nullptr) K -= *K_C;
    result.stiffness = inverse.transpose() * K * inverse;
  } else {
    result.stiffness = least_squares(result.compliance, MatrixXd::Identity(6, 6));
  }
  return result;
}

}  // namespace

CartesianStiffness cartesian_stiffness(const model::Kinematics& kinematics, const VectorXd& q,
                                       const VectorXd& stiffness) {
  return stiffness_at(kinematics, q, stiffness, nullptr);
}

CartesianStiffness cartesian_stiffness(const model::Kinematics& kinematics, const VectorXd& q,
                                       const VectorXd& stiffness, const Vector6d& wrench, WrenchFrame frame) {
  const MatrixXd K_C = kinematics.complementary_stiffness(q, wrench, frame);
  return stiffness_at(kinematics, q, stiffness, &K_C);
}

PrincipalDeflections principal_deflections(const MatrixXd& compliance) {
  // CᵀC = V diag(λ) Vᵀ (76) by the singular values √λ of C; C v = √λ u.
  const Svd svd = svd_of(compliance);
  PrincipalDeflections result{svd.values, svd.V, svd.U};
  for (Index k = 0; k < svd.V.cols(); ++k) {
    Index largest = 0;
    svd.V.col(k).cwiseAbs().maxCoeff(&largest);
    if (svd.V(largest, k) < 0.0) {
      result.forces.col(k) *= -1.0;
      result.directions.col(k) *= -1.0;
    }
  }
  return result;
}

MatrixXd ellipsoid_outline(const Eigen::Matrix3d& compliance, const Eigen::Matrix<double, 3, 2>& plane,
                           int points) {
  // The shadow of {C f} on the plane is an ellipse whose half axes are those of PᵀC CᵀP.
  const Eigen::Matrix<double, 2, 3> seen = plane.transpose() * compliance;
  const MatrixXd M = seen * seen.transpose();
  const Eigensystem axes = eigensystem_of(M);
  MatrixXd outline(points, 2);
  for (int k = 0; k < points; ++k) {
    const double t = 2.0 * std::numbers::pi * (k % (points - 1)) / (points - 1);
    const Eigen::Vector2d on_circle(std::sqrt(std::max(0.0, axes.values[0])) * std::cos(t),
                                    std::sqrt(std::max(0.0, axes.values[1])) * std::sin(t));
    outline.row(k) = (axes.vectors * on_circle).transpose();
  }
  return outline;
}

ToolDeflection linear_deflection(const model::Kinematics& kinematics, const VectorXd& q,
                                 const VectorXd& stiffness, const Vector6d& wrench, WrenchFrame frame) {
  const VectorXd x = compliance_of(kinematics, q, stiffness);
  MatrixXd J;
  const model::ToolPlacement tip = kinematics.tip_and_jacobian(q, J);
  const Vector6d in_base = frame == WrenchFrame::kTool ? turned(tip.rotation, wrench) : wrench;
  ToolDeflection result;
  result.joint = x.cwiseProduct(J.transpose() * in_base);
  result.tool = J * result.joint;
  return result;
}

ToolDeflection exact_deflection(const model::Kinematics& kinematics, const VectorXd& q,
                                const VectorXd& stiffness, const Vector6d& wrench, WrenchFrame frame) {
  const VectorXd x = compliance_of(kinematics, q, stiffness);
  const auto [links, iterations] = equilibrium(q, x, wrench_load(kinematics, wrench, frame));
  return {displacement(kinematics.tip(q), kinematics.tip(links)), links - q, iterations};
}

PathSag sag_along_path(const model::Kinematics& kinematics, const MatrixXd& path, const VectorXd& stiffness,
                       const SagLoad& load) {
  const Index n = kinematics.num_joints();
  if (path.cols() != n) {
    throw InputError(fmt::format("robot \"{}\" has {} joints; the path has {} columns of positions",
                                 kinematics.robot().name, n, path.cols()));
  }
  if (!(load.payload_mass >= 0.0) || !std::isfinite(load.payload_mass)) {
    throw InputError(
        fmt::format("payload mass is {} kg; it has to be a number not below zero", load.payload_mass));
  }
  const VectorXd x = compliance_of(kinematics, VectorXd::Zero(n), stiffness);
  // The weight acts at the payload's centre of mass; a frame there carries it without moment.
  ToolFrame<double> at_com = kinematics.tool();
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      at_com.position[i] += at_com.rotation[3 * i + k] * load.payload_com[static_cast<Index>(k)];
    }
  }
  const model::Kinematics carried(kinematics.robot(), at_com);
  std::optional<model::Dynamics> arm;
  if (load.own_weight) arm.emplace(kinematics.robot());
  Vector6d weight = Vector6d::Zero();
  weight.head<3>() = load.payload_mass * Eigen::Vector3d(kinematics.robot().gravity.data());

  const auto torque_at = [&](const VectorXd& q) -> VectorXd {
    VectorXd torque = carried.joint_torque(q, weight);
    // gravity_torque is what the drives give against the weight.
    if (arm) torque -= arm->gravity_torque(q);
    return torque;
  };
  const auto load_at = [&](const VectorXd& q) {
    JointLoad at{torque_at(q), carried.complementary_stiffness(q, weight)};
    if (arm) {
      constexpr double kStep = 1e-5;  // only Newton's slope: its error slows the steps, not the answer
      for (Index j = 0; j < n; ++j) {
        VectorXd ahead = q, behind = q;
        ahead[j] += kStep;
        behind[j] -= kStep;
        at.derivative.col(j) -= (arm->gravity_torque(ahead) - arm->gravity_torque(behind)) / (2.0 * kStep);
      }
    }
    return at;
  };

  PathSag sag;
  sag.tool.resize(path.rows(), 6);
  sag.joint.resize(path.rows(), n);
  sag.compensated.resize(path.rows(), n);
  for (Index i = 0; i < path.rows(); ++i) {
    const VectorXd q = path.row(i).transpose();
    const model::ToolPlacement wanted = kinematics.tip(q);
    const VectorXd links = equilibrium(q, x, load_at).first;
    sag.joint.row(i) = (links - q).transpose();
    sag.tool.row(i) = displacement(wanted, kinematics.tip(links)).transpose();
    // θ = q + τ(q) / k, τ the drives' torque with the links on the path.
    const VectorXd motors = q - x.cwiseProduct(torque_at(q));
    sag.compensated.row(i) = motors.transpose();
    const VectorXd reached = equilibrium(motors, x, load_at).first;
    sag.left = std::max(sag.left, (kinematics.tip(reached).position - wanted.position).norm());
  }
  return sag;
}

}  // namespace heft::stiffness
