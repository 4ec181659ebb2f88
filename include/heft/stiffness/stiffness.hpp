/// @file
/// Stiffness of a robot's joints: from deflections under load, or from encoders on both sides of the gears; where to
/// measure; what the joints mean for the tool.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/deflections.hpp"
#include "heft/data/log.hpp"
#include "heft/data/log_set.hpp"
#include "heft/host/verdict.hpp"
#include "heft/model/model_file.hpp"
#include "heft/stiffness/cartesian_stiffness.hpp"
#include "heft/stiffness/deflection_fit.hpp"
#include "heft/stiffness/dexterity.hpp"
#include "heft/stiffness/joint_encoders.hpp"
#include "heft/stiffness/judgement.hpp"
#include "heft/stiffness/stiffness_effects.hpp"

namespace heft::stiffness {

/// What deflections under load show.
struct DeflectionAnswer {
  StiffnessFit fit;
  StiffnessDiagnosis diagnosis;   ///< what springs alone leave, and whether something known explains it
  std::vector<LoadedPose> poses;  ///< as measured
  int readings{0};                ///< before repeats were merged
  /// Pose by pose, k = τ/δθ; none where no pose can be used, for the reason in `no_direct`.
  std::optional<DirectStiffness> direct{};
  std::string no_direct{};
};

/// A pose to look at.
struct NamedPose {
  std::string name;
  Eigen::VectorXd q;  ///< n [rad, m]
};

/// The tool at a pose.
struct ToolAtPose {
  NamedPose pose;
  CartesianStiffness stiffness;
  PrincipalDeflections extremes;        ///< of the translation under a force
  std::optional<ToolDeflection> sag{};  ///< under the load, where there is one
};

/// What joint stiffnesses mean for the tool.
struct ToolUse {
  SagLoad load;
  std::vector<ToolAtPose> poses;
  std::optional<PathSag> path{};
};

/// Springs of a robot's joints, and what they rest on.
struct Stiffness {
  model::Robot robot;  ///< whose joints they are
  Eigen::VectorXd
      joints;  ///< n [N·m/rad, N/m]; infinite where a joint is rigid or has no stiffness of two ends
  host::Judgement judgement;
  std::vector<std::string> sources;  ///< files that they come from
  std::optional<DeflectionAnswer> deflections{};
  std::optional<JointEncoderFit> encoders{};

  /// Whether any joint has a stiffness.
  bool found_any() const;
  /// Whether there is a model: deflections that determine no stiffness give none.
  bool has_model() const { return !deflections || found_any(); }
  bool usable() const noexcept { return judgement.usable(); }
  /// The robot with these joints as elastic ones. A joint without finite stiffness stays rigid.
  model::ModelFile model_file() const;
};

struct DeflectionOptions {
  /// Joints (from 0) that share one stiffness; see StiffnessOptions.
  std::vector<std::vector<int>> groups{};
  /// The load turns with the arm as it gives way; see StiffnessOptions.
  bool complementary{false};
  /// Fits singular poses, too; else they end in an error. The direct method leaves them out all the same.
  bool keep_singular{false};
  /// Direct method: components of the deflection that were not read are zero in axes of the tool.
  bool missing_is_zero{false};
  std::vector<std::string> sources{};
};

/// Springs from loads and deflections at rest: fit, its closer look at the residual, and the direct method.
/// @param notes  gets remarks about the poses; may be null
/// @throws InputError on groups with a joint that the robot does not have or that is in two of them; DataError on a
///         pose outside the joint limits; NotIdentifiableError on singular poses, with fewer readings
///         than stiffnesses, or when none is determined
Stiffness from_deflections(const model::Robot& robot, const std::vector<data::Deflection>& deflections,
                           const DeflectionOptions& options = {}, std::vector<std::string>* notes = nullptr);

struct EncoderOptions {
  /// Rotor inertias on the link side of the gear, ratio² times the rotor's [kg·m², kg]; empty: the robot's. A torque
  /// sensor behind the gear sees none of them.
  std::vector<double> rotor_inertia{};
  double cutoff{0.0};  ///< low-pass of positions and torque [Hz]; 0: from the bandwidth of the motion
  /// What is known against the torque of the logs before (heft/plausibility); goes into the judgement.
  host::Judgement torque{};
};

/// Springs from the motor's and the link's encoder, all training logs together and each for itself.
/// @param logs  with qlink1..; logs to judge on take no part
/// @throws DataError on logs without link encoders or torque, or too short; InputError when the number of inertias is not
///         that of the joints; NotIdentifiableError when no joint has a stiffness
Stiffness from_encoders(const model::Robot& robot, const data::LogSet& logs,
                        const EncoderOptions& options = {});

/// Known springs, to ask what they mean for the tool.
/// @param joints  n [N·m/rad, N/m], infinite for a rigid joint
/// @throws InputError when there is not one a joint
Stiffness given(const model::Robot& robot, const Eigen::VectorXd& joints);
/// The springs that a robot has as elastic joints; the others are rigid.
Stiffness given(const model::Robot& robot);

/// Poses at which to look at the tool: those measured at, twelve at most; for given springs the first of the path, without
/// a path the middle of the joint ranges; none for springs from encoders.
std::vector<NamedPose> poses_to_look_at(const Stiffness& stiffness, const Eigen::MatrixXd& path = {});

/// Extremes of the tool's deflection at poses, its sag under a load there and along a path.
/// @param path  rows × n; empty: none
ToolUse tool_use(const Stiffness& stiffness, const std::vector<NamedPose>& poses, const SagLoad& load,
                 const Eigen::MatrixXd& path = {});

/// The path with positions that compensate for the sag. Velocities and accelerations, which belonged to the positions as
/// they were, are left out.
data::Log compensated(data::Log path, const PathSag& sag);

/// A force at `point` of the tool frame as a wrench about the tip, base axes [N, N·m].
Vector6d wrench_of(const Eigen::Vector3d& force, const Eigen::Vector3d& point,
                   const model::ToolPlacement& tip);

struct PlanOptions {
  int poses{20};
  Eigen::Vector3d force{0.0, 0.0, 0.0};  ///< on the tool, base axes [N]
  Eigen::Vector3d point{0.0, 0.0, 0.0};  ///< where it acts, in the tool frame from the tip [m]
  std::array<int, 2> map{1, 2};          ///< joints (from 0) of the map of dexterity through the first pose
  /// What rules out a pose within the joint limits, "" when nothing does; may be empty.
  std::function<std::string(const Eigen::VectorXd& q)> refuse{};
};

/// Poses to measure at.
struct MeasurementPlan {
  model::Robot robot;
  double length{1.0};                 ///< characteristic length [m]; a radian weighs as much
  std::vector<PoseCandidate> chosen;  ///< in the order of measuring
  std::vector<Vector6d> wrenches;     ///< on the tool at each of them [N, N·m]
  int safe{0};                        ///< poses among which was chosen
  DexterityMap map;                   ///< through the first pose
  Eigen::VectorXd
      deviation;  ///< n: of each compliance per metre of reading noise of a tracker [1/N, rad/(N·m²)]
};

/// Where a tracker (three translations, three rotations) would determine the joints' compliances best: D-optimal among the
/// half of 3000 random poses with the better dexterity.
/// @throws NotIdentifiableError when too few poses are safe, or when no choice determines all joints; InputError on joints
///         of the map that the robot does not have
MeasurementPlan plan_measurements(const model::Robot& robot, const PlanOptions& options);

/// A file of measurements with the poses and loads of a plan; deflections are left to be filled in.
std::string measurement_form(const MeasurementPlan& plan);

}  // namespace heft::stiffness
