/// @file
/// Forward use of joint stiffnesses: what the tool gives under load, and how to take it back.
///
/// Source: UPC-ETSEIB (2017), "Experimental identification of the joints stiffness of the UR5 robot arm", sections
/// 3.1 and 3.2, whose equation numbers are given at the functions. Links are rigid, joints linear springs.
///
/// Throughout, `stiffness` is n: k of each joint [N·m/rad; N/m on a prismatic joint], above zero, infinite
/// for a rigid joint; anything else is an InputError that names the joint.
#pragma once

#include <string>

#include <Eigen/Core>

#include "heft/model/kinematics.hpp"

namespace heft::stiffness {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

/// Compliance and stiffness of the tool at a pose, base frame, about the tip point.
struct CartesianStiffness {
  /// δd = C w: translation [m] and rotation [rad] of the tool per force [N] and moment [N·m]. Always defined.
  Matrix6d compliance;
  /// K_X = C⁻¹ (70), (90), where it exists; else NaN: in a singular pose, with fewer than six joints that
  /// give, the tool is rigid in some direction and K_X infinite there.
  Matrix6d stiffness;
  bool has_stiffness{false};
  /// False where the load overcomes the springs: K_θ - K_C has lost its positive definiteness, the arm would
  /// give way.
  bool stable{true};
  /// Why there is no stiffness, or no stability; empty otherwise.
  std::string note;
};

/// Without load: C = J K_θ⁻¹ Jᵀ (69.a), K_X = J⁻ᵀ K_θ J⁻¹ (95).
CartesianStiffness cartesian_stiffness(const model::Kinematics& kinematics, const Eigen::VectorXd& q,
                                       const Eigen::VectorXd& stiffness);
/// Around a pose that holds a wrench: C = J (K_θ - K_C)⁻¹ Jᵀ, K_X = J⁻ᵀ (K_θ - K_C) J⁻¹ (90), for a small
/// wrench on top of that one. Not symmetric where K_C is not. C maps the added wrench in base axes, also
/// where the standing one turns with the tool.
/// @param wrench  in the axes of `frame`
CartesianStiffness cartesian_stiffness(const model::Kinematics& kinematics, const Eigen::VectorXd& q,
                                       const Eigen::VectorXd& stiffness, const Vector6d& wrench,
                                       WrenchFrame frame = WrenchFrame::kBase);

/// Extremes of the deflection under a unit force (72)-(81).
struct PrincipalDeflections {
  /// Largest first: √λ of CᵀC, metres per newton for a translational block. Semi-axes of the ellipsoid {C f :
  /// |f| = 1}.
  Eigen::VectorXd magnitudes;
  /// Columns: unit forces that bring them, orthonormal, sign so that the largest component is positive.
  Eigen::MatrixXd forces;
  /// Columns: unit directions in which the tool then goes; equal to `forces` where C is symmetric.
  Eigen::MatrixXd directions;
};

/// @param compliance  m × m, one unit throughout: the translational block C.topLeftCorner<3, 3>(), its part
///                    in a plane, the rotational block
PrincipalDeflections principal_deflections(const Eigen::MatrixXd& compliance);

/// Outline of the ellipsoid {C f : |f| = 1} as seen along the third direction: points around, for a plot.
/// @param compliance  3 × 3
/// @param plane       3 × 2, orthonormal: horizontal and vertical direction of the picture
/// @return points × 2, closed (last equals first) [m/N]
Eigen::MatrixXd ellipsoid_outline(const Eigen::Matrix3d& compliance, const Eigen::Matrix<double, 3, 2>& plane,
                                  int points = 73);

/// What a load does to arm and tool.
struct ToolDeflection {
  Vector6d tool;          ///< translation of the tip point [m], rotation vector [rad], base axes
  Eigen::VectorXd joint;  ///< n [rad, m]
  int iterations{0};
};

/// To first order: δθ = K_θ⁻¹ Jᵀ w, δd = J δθ (106).
ToolDeflection linear_deflection(const model::Kinematics& kinematics, const Eigen::VectorXd& q,
                                 const Eigen::VectorXd& stiffness, const Vector6d& wrench,
                                 WrenchFrame frame = WrenchFrame::kBase);
/// Exactly: K_θ δθ = J(q + δθ)ᵀ w by Newton steps with K_θ - K_C, δd from the two placements of the tool.
/// @throws InputError when there is no equilibrium near: the joints are too soft for this load
ToolDeflection exact_deflection(const model::Kinematics& kinematics, const Eigen::VectorXd& q,
                                const Eigen::VectorXd& stiffness, const Vector6d& wrench,
                                WrenchFrame frame = WrenchFrame::kBase);

/// What hangs on the arm along a path.
struct SagLoad {
  double payload_mass{0.0};                              ///< [kg]
  Eigen::Vector3d payload_com{Eigen::Vector3d::Zero()};  ///< in the tool frame [m]
  /// Count the arm's own weight as load, too: the reference is then an arm without weight. Otherwise the arm
  /// without payload is the reference, and its joint positions are those of its links.
  bool own_weight{false};
};

/// Sag of the tool along a path, and how to take it back. Rows as in the path.
struct PathSag {
  Eigen::MatrixXd
      tool;  ///< rows × 6: loaded minus unloaded, translation [m] and rotation vector [rad], base axes
  Eigen::MatrixXd joint;        ///< rows × n: links minus motors [rad, m]
  Eigen::MatrixXd compensated;  ///< rows × n: motor positions that put the loaded links on the path
  /// Largest distance of the loaded tool from the path after compensation [m], by solving for the
  /// equilibrium.
  double left{0.0};
};

/// Quasi-static: gravity from the robot, no inertial loads. The command is exact, q + τ(q) / k (see
/// heft/core/kinematics/joint_deflection.hpp).
/// @param kinematics  its tool is the one the displacement is of
/// @param path        rows × n, motor positions [rad, m]
/// @throws InputError when the mass is negative, a length does not match, or no equilibrium is near
PathSag sag_along_path(const model::Kinematics& kinematics, const Eigen::MatrixXd& path,
                       const Eigen::VectorXd& stiffness, const SagLoad& load);

}  // namespace heft::stiffness
