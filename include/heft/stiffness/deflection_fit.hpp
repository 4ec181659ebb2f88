/// @file
/// Stiffness of joints from loads and deflections measured at poses where the arm is at rest.
///
/// Links are rigid, each joint is a spring between drive and link: k_i δθ_i = τ_i with τ = Jᵀ w (64), (65). A wrench w
/// then moves the tool by δd = J diag(x) Jᵀ w, linear in the compliances x_i = 1/k_i (106), (109). Numbers in brackets are
/// equations of UPC-ETSEIB (2017), "Experimental identification of the joints stiffness of the UR5 robot arm".
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/deflections.hpp"
#include "heft/model/kinematics.hpp"
#include "heft/statistics/interval.hpp"

namespace heft::stiffness {

/// A pose under load with what was read there, everything in the base frame. m readings, n joints.
struct LoadedPose {
  std::string name;           ///< poses of one name are left out together when poses are left out
  Eigen::VectorXd q;          ///< n [rad, m]
  ToolWrench<double> wrench;  ///< on the tool, moment about the tip [N, N·m]
  WrenchFrame follows{WrenchFrame::kBase};  ///< what the wrench stays fixed to while the arm gives way
  /// m × 6: a reading is its row times δd = (displacement of the tip [m], rotation of the tool [rad]).
  Eigen::MatrixXd rows;
  Eigen::VectorXd values;   ///< m [m or rad]; means where a pose was repeated
  Eigen::VectorXd sigmas;   ///< m, standard deviations of `values`, 0: not stated
  Eigen::VectorXd scatter;  ///< m, standard deviation of a single repeat about the mean; NaN without repeats
  int repeats{1};
  Eigen::Vector3d point;      ///< measured, from the tip [m]
  model::ToolPlacement tool;  ///< unloaded
  Eigen::MatrixXd J;          ///< 6 × n
  double dexterity{0.0};      ///< 1 / k_F with the length that all poses share
};

/// Puts the rows of a file onto a robot. Rows that differ in nothing but their values are repeats and become one pose.
/// @param length  of the normalised Jacobian [m]; 0: shared_length
/// @throws DataError on a pose outside the joint limits
std::vector<LoadedPose> loaded_poses(const model::Kinematics& kinematics,
                                     const std::vector<data::Deflection>& rows, double length = 0.0);

/// Root mean square of rms_axis_distance over the poses [m]: the length that dexterity and rotations are taken with when
/// none is given.
double shared_length(const std::vector<LoadedPose>& poses);

/// Poses with 1 / k_F below this are singular: there the tool does not move in some direction whatever the joints do.
inline constexpr double kSingularDexterity = 1e-6;
/// Poses with 1 / k_F below this are near a singularity and named in a warning.
inline constexpr double kLeastDexterity = 0.05;

struct StiffnessOptions {
  /// Joints (from 0) that share one compliance, as where gears are of one size; a joint in no group is rigid. Empty: each
  /// joint has its own.
  std::vector<std::vector<int>> groups{};
  /// With what the deflection itself changes: the load acts at the pose it has made, τ = J(q + δθ)ᵀ w, and the tool's
  /// path there is curved. To first order that is the complementary stiffness, (K_θ − K_C) δθ = Jᵀ w (88). Iterated.
  bool complementary{false};
  /// More columns, one row a reading in the order of the poses: what else may have moved the instrument.
  Eigen::MatrixXd extra{};
};

/// The answer for one joint.
struct StiffnessEstimate {
  bool determined{false};           ///< the readings distinguish it from the other joints
  int group{-1};                    ///< joints of one group have one answer; -1: rigid
  statistics::Interval compliance;  ///< x [rad/(N·m), m/N]; NaN when not determined
  /// 1/x [N·m/rad, N/m]: the upper end infinite where a rigid joint is possible; all NaN where the compliance is not
  /// determined or, beyond its interval, negative.
  statistics::Interval stiffness;
  std::string why{};  ///< where there is no answer: what is missing

  /// Whether the readings show a stiffness: the interval has two ends. With one end the joint may as well be rigid.
  bool has_stiffness() const;
};

/// How much a pose matters.
struct PoseInfluence {
  std::string name;
  double dexterity{0.0};  ///< 1 / k_F
  /// Largest change of a compliance when the pose is left out, in its standard deviations; infinite when the others
  /// alone do not determine all compliances.
  double shift{0.0};
  double residual{0.0};  ///< rms residual in the fit
  /// Rms error of its readings as predicted by the others [m; rotations times the length].
  double left_out{0.0};
};

/// Result of a fit. p compliances, m readings.
struct StiffnessFit {
  std::vector<StiffnessEstimate> joints;  ///< n
  Eigen::VectorXd extra;  ///< factors of StiffnessOptions::extra, with their standard deviations
  Eigen::VectorXd extra_deviation;
  Eigen::VectorXd prediction;        ///< m [m or rad]
  Eigen::VectorXd residual;          ///< m, read minus predicted
  std::vector<PoseInfluence> poses;  ///< by name, in the order of appearance
  double fit_rms{0.0};               ///< of the residual [m; rotations times the length]
  /// Of readings predicted from all other poses; infinite where these do not suffice.
  double left_out_rms{0.0};
  double repeatability{0.0};  ///< standard deviation of the mean of the repeats, pooled; NaN without repeats
  bool stated_noise{false};   ///< intervals rest on the stated standard deviations, else on the residual
  double condition{0.0};      ///< of the design with columns of unit length
  int readings{0};
  int unknowns{0};
  int iterations{0};  ///< of K_C; 0 without
};

/// Least squares (114), (115), weighted with the stated standard deviations; where none is stated all displacements
/// weigh the same and a radian as much as `length` metres.
///
/// The intervals: with stated deviations from these, widened when the residual is larger than they allow; else from the
/// residual with Student's t. They hold for errors that are independent from pose to pose; the mean of repeats counts
/// as one reading.
///
/// @param length  as in loaded_poses [m]
/// @throws NotIdentifiableError with fewer readings than compliances, or when no compliance is determined
StiffnessFit fit_stiffness(const model::Kinematics& kinematics, const std::vector<LoadedPose>& poses,
                           const StiffnessOptions& options = {}, double length = 1.0);

/// Direct method of UPC-ETSEIB (2017): δθ = J⁻¹ δd (117), k_i = τ_i / δθ_i (120), pose by pose.
struct DirectStiffness {
  std::vector<std::string> poses;  ///< those that could be used
  Eigen::MatrixXd torque;          ///< τ, poses × n
  Eigen::MatrixXd deflection;      ///< δθ, poses × n
  Eigen::MatrixXd stiffness;       ///< k, poses × n; may be negative or infinite, and is shown as it is
  /// Over the poses, with Student's t for 95 %; the interval is NaN for one pose.
  Eigen::VectorXd mean, low, high;
  std::vector<std::pair<std::string, std::string>> refused;  ///< pose, why
};

/// @param missing_is_zero  components of δd that were not read count as zero in axes of the tool, as in (118);
///                         else a pose needs six independent readings
/// @throws NotIdentifiableError when no pose can be used: singular, or without a whole δd
DirectStiffness direct_stiffness(const std::vector<LoadedPose>& poses, bool missing_is_zero);

}  // namespace heft::stiffness
