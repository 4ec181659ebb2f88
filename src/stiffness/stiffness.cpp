#include "heft/stiffness/stiffness.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/Geometry>

#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"

namespace heft::stiffness {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

/// "pose 3 is", "poses 1, 5 are".
std::string poses_are(const std::vector<std::string>& names) {
  return fmt::format("{} {} {}", names.size() == 1 ? "pose" : "poses", fmt::join(names, ", "),
                     names.size() == 1 ? "is" : "are");
}

void look_at_singular(const std::vector<LoadedPose>& poses, bool keep, std::vector<std::string>* notes) {
  std::vector<std::string> singular, near;
  for (const LoadedPose& pose : poses) {
    if (pose.dexterity >= kLeastDexterity) continue;
    auto& list = pose.dexterity < kSingularDexterity ? singular : near;
    if (std::find(list.begin(), list.end(), pose.name) == list.end()) list.push_back(pose.name);
  }
  if (!near.empty() && notes != nullptr) {
    notes->push_back(
        fmt::format("{} close to a singular pose (1/k_F below {:g}): what is read there depends strongly on "
                    "errors of the angles",
                    poses_are(near), kLeastDexterity));
  }
  if (singular.empty()) return;
  if (!keep) {
    throw NotIdentifiableError(
        fmt::format("{} singular: the Jacobian has no inverse there, the tool is rigid in some direction "
                    "whatever the joints do; expected poses with 1/k_F above {:g}; measure at others (--plan "
                    "N names some), or fit them anyway with --keep-singular",
                    poses_are(singular), kLeastDexterity));
  }
  if (notes != nullptr)
    notes->push_back(
        fmt::format("{} singular and kept; the direct method leaves them out", poses_are(singular)));
}

void refuse_wrong_groups(const model::Robot& robot, const std::vector<std::vector<int>>& groups) {
  const int n = robot.num_joints();
  const auto refuse = [&](const std::string& why) {
    throw InputError(
        fmt::format("--groups: {}; expected joints 1 to {} such as 1-3,4-6 (each joint once)", why, n));
  };
  std::vector<bool> taken(static_cast<std::size_t>(n), false);
  for (const std::vector<int>& group : groups) {
    for (const int joint : group) {
      if (joint < 0 || joint >= n) refuse(fmt::format("robot '{}' has no joint {}", robot.name, joint + 1));
      if (taken[static_cast<std::size_t>(joint)]) refuse(fmt::format("joint {} is in two groups", joint + 1));
      taken[static_cast<std::size_t>(joint)] = true;
    }
  }
}

}  // namespace

bool Stiffness::found_any() const { return joints.array().isFinite().any(); }

model::ModelFile Stiffness::model_file() const {
  model::Robot elastic = robot;
  elastic.elasticities.clear();
  for (int j = 0; j < elastic.num_joints(); ++j) {
    if (!std::isfinite(joints[j]) || joints[j] <= 0.0) continue;
    // Damping and the rotor's share of the inertia do not show in deflections at rest.
    elastic.elasticities.push_back(
        {j, joints[j], 0.0, elastic.joints[static_cast<std::size_t>(j)].actuation.rotor_inertia});
  }
  model::ModelFile file = model::make_model(elastic);
  file.provenance.method = "stiffness";
  file.provenance.logs = sources;
  return file;
}

Stiffness from_deflections(const model::Robot& robot, const std::vector<data::Deflection>& deflections,
                           const DeflectionOptions& options, std::vector<std::string>* notes) {
  refuse_wrong_groups(robot, options.groups);
  const model::Kinematics kinematics(robot);
  DeflectionAnswer answer;
  answer.poses = loaded_poses(kinematics, deflections);
  const double length = shared_length(answer.poses);
  look_at_singular(answer.poses, options.keep_singular, notes);
  StiffnessOptions asked;
  asked.groups = options.groups;
  answer.diagnosis =
      diagnose_stiffness(kinematics, answer.poses, asked, known_stiffness_effects(robot), length);
  asked.complementary = options.complementary;
  const bool changed = answer.diagnosis.accepted >= 0;
  answer.fit = options.complementary && !changed ? fit_stiffness(kinematics, answer.poses, asked, length)
                                                 : answer.diagnosis.after;
  for (const data::Deflection& row : deflections) answer.readings += static_cast<int>(row.readings.size());
  try {
    answer.direct = direct_stiffness(answer.poses, options.missing_is_zero);
  } catch (const NotIdentifiableError& error) {
    answer.no_direct = error.what();
  }
  Stiffness result;
  result.robot = robot;
  result.joints.resize(robot.num_joints());
  for (Index j = 0; j < result.joints.size(); ++j) {
    const StiffnessEstimate& joint = answer.fit.joints[static_cast<std::size_t>(j)];
    result.joints[j] = joint.has_stiffness() ? joint.stiffness.value : kInfinity;
  }
  result.judgement = judge(answer.fit, answer.diagnosis);
  result.sources = options.sources;
  result.deflections = std::move(answer);
  return result;
}

Stiffness from_encoders(const model::Robot& robot, const data::LogSet& logs, const EncoderOptions& options) {
  const auto n = static_cast<std::size_t>(robot.num_joints());
  if (!options.rotor_inertia.empty() && options.rotor_inertia.size() != n) {
    throw InputError(
        fmt::format("--rotor-inertia: found {} values, robot '{}' has {} joints; expected one a joint",
                    options.rotor_inertia.size(), robot.name, n));
  }
  JointEncoderOptions asked;
  asked.cutoff = options.cutoff;
  asked.rotor_inertia = options.rotor_inertia;
  for (const model::RobotJoint& joint : robot.joints) {
    if (options.rotor_inertia.empty()) asked.rotor_inertia.push_back(joint.actuation.rotor_inertia);
    asked.coulomb_friction.push_back(joint.actuation.coulomb_friction);
  }
  // A sensor behind the gear sees neither the rotor nor the friction of the motor's side.
  const bool behind_gear = logs.torque_at() == data::TorqueAt::kJoint;
  if (behind_gear) asked.rotor_inertia.assign(n, 0.0);
  const bool rotors_known = behind_gear || std::any_of(asked.rotor_inertia.begin(), asked.rotor_inertia.end(),
                                                       [](double J) { return J != 0.0; });
  if (std::all_of(asked.coulomb_friction.begin(), asked.coulomb_friction.end(),
                  [](double f) { return f == 0.0; })) {
    asked.coulomb_friction.clear();
  }
  std::vector<data::Log> read;
  for (const data::LogSource& log : logs.train()) read.push_back(data::read(log));
  Stiffness result;
  result.robot = robot;
  result.sources = logs.train_paths();
  result.encoders = fit_joint_encoders(read, asked);
  result.joints = VectorXd::Constant(robot.num_joints(), kInfinity);
  std::vector<std::string> missing;
  for (const JointStiffness& joint : result.encoders->pooled) {
    if (joint.identifiable) result.joints[joint.joint] = joint.stiffness.value;
    else missing.push_back(fmt::format("joint {}: {}", joint.joint + 1, joint.reason));
  }
  if (!result.found_any()) {
    throw NotIdentifiableError(
        fmt::format("these logs do not determine any stiffness; {}", fmt::join(missing, "; ")));
  }
  result.judgement = judge(*result.encoders, rotors_known);
  result.judgement.add(options.torque);
  return result;
}

Stiffness given(const model::Robot& robot, const VectorXd& joints) {
  if (joints.size() != robot.num_joints()) {
    throw InputError(
        fmt::format("--stiffness: found {} values, robot '{}' has {} joints; expected one a joint (inf for a "
                    "rigid one)",
                    joints.size(), robot.name, robot.num_joints()));
  }
  Stiffness result;
  result.robot = robot;
  result.joints = joints;
  return result;
}

Stiffness given(const model::Robot& robot) {
  VectorXd joints = VectorXd::Constant(robot.num_joints(), kInfinity);
  for (const Elasticity<double>& spring : robot.elasticities) joints[spring.joint] = spring.stiffness;
  return given(robot, joints);
}

Vector6d wrench_of(const Vector3d& force, const Vector3d& point, const model::ToolPlacement& tip) {
  const Vector3d lever = tip.rotation * point;
  Vector6d wrench;
  wrench << force, lever.cross(force);
  return wrench;
}

ToolUse tool_use(const Stiffness& stiffness, const std::vector<NamedPose>& poses, const SagLoad& load,
                 const MatrixXd& path) {
  const model::Kinematics kinematics(stiffness.robot);
  ToolUse use;
  use.load = load;
  for (const NamedPose& pose : poses) {
    ToolAtPose tool{pose, cartesian_stiffness(kinematics, pose.q, stiffness.joints), {}};
    tool.extremes = principal_deflections(tool.stiffness.compliance.topLeftCorner<3, 3>());
    if (load.payload_mass > 0.0) {
      const Vector3d weight = load.payload_mass * Vector3d(stiffness.robot.gravity.data());
      tool.sag = exact_deflection(kinematics, pose.q, stiffness.joints,
                                  wrench_of(weight, load.payload_com, kinematics.tip(pose.q)));
    }
    use.poses.push_back(std::move(tool));
  }
  if (path.rows() > 0) use.path = sag_along_path(kinematics, path, stiffness.joints, load);
  return use;
}

namespace {

/// One side of a map: the joint's range, of a revolute one a turn at most, beyond which nothing is new.
MapAxis axis_of(const model::Robot& robot, int joint, const std::array<int, 2>& asked) {
  constexpr int kSteps = 121;
  if (joint < 0 || joint >= robot.num_joints()) {
    throw InputError(
        fmt::format("--map {},{}: robot '{}' has joints 1 to {}; expected two of them such as 2,3",
                    asked[0] + 1, asked[1] + 1, robot.name, robot.num_joints()));
  }
  const model::RobotJoint& j = robot.joints[static_cast<std::size_t>(joint)];
  if (j.joint.type == JointType::kPrismatic) return {joint, j.lower, j.upper, kSteps};
  return {joint, std::max(j.lower, -std::numbers::pi), std::min(j.upper, std::numbers::pi), kSteps};
}

}  // namespace

MeasurementPlan plan_measurements(const model::Robot& robot, const PlanOptions& options) {
  constexpr int kCandidates = 3000;
  const int n = robot.num_joints();
  const model::Kinematics kinematics(robot);
  const MapAxis first = axis_of(robot, options.map[0], options.map);
  const MapAxis second = axis_of(robot, options.map[1], options.map);
  MeasurementPlan plan;
  plan.robot = robot;
  const double characteristic = characteristic_length(kinematics).length;
  if (std::isfinite(characteristic)) plan.length = characteristic;
  // Three translations and three rotations of a tracker; a radian weighs as much as the characteristic length.
  MatrixXd directions = MatrixXd::Identity(6, 6);
  directions.bottomRows(3) *= plan.length;
  std::string missed;
  const auto rows = [&](const VectorXd& q) {
    const std::string why = options.refuse ? options.refuse(q) : std::string();
    if (!why.empty()) {
      missed = why;
      return MatrixXd();
    }
    MatrixXd J;
    const model::ToolPlacement tip = kinematics.tip_and_jacobian(q, J);
    return compliance_rows(J, wrench_of(options.force, options.point, tip), directions);
  };
  const std::vector<PoseCandidate> candidates = pose_candidates(kinematics, plan.length, kCandidates, rows);
  plan.safe = static_cast<int>(candidates.size());
  if (plan.safe < 2 * options.poses) {
    throw NotIdentifiableError(
        fmt::format("robot \"{}\": {} poses are to be chosen and only {} of {} tried are safe; the limit "
                    "missed last: {}; widen it or ask for fewer",
                    robot.name, options.poses, plan.safe, kCandidates, missed));
  }
  // Well away from singular poses: the better half.
  std::vector<double> sorted;
  for (const PoseCandidate& candidate : candidates) sorted.push_back(candidate.dexterity);
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  const PoseChoice choice = choose_poses(candidates, options.poses, *middle);
  for (const int index : choice.chosen) {
    const PoseCandidate& candidate = candidates[static_cast<std::size_t>(index)];
    plan.chosen.push_back(candidate);
    plan.wrenches.push_back(wrench_of(options.force, options.point, kinematics.tip(candidate.q)));
  }
  plan.map = dexterity_map(kinematics, plan.chosen.front().q, first, second, plan.length);
  plan.deviation = solve_symmetric(choice.information, MatrixXd::Identity(n, n)).diagonal().cwiseSqrt();
  return plan;
}

std::string measurement_form(const MeasurementPlan& plan) {
  std::string csv = "pose";
  for (int j = 1; j <= plan.robot.num_joints(); ++j) csv += fmt::format(",q{}", j);
  csv += ",frame,fx,fy,fz,mx,my,mz,dx,dy,dz,rx,ry,rz\n";
  for (std::size_t k = 0; k < plan.chosen.size(); ++k) {
    csv += fmt::format("{},{:.6f},base,{:.6f},,,,,,\n", k + 1, fmt::join(plan.chosen[k].q, ","),
                       fmt::join(plan.wrenches[k], ","));
  }
  return csv;
}

}  // namespace heft::stiffness
