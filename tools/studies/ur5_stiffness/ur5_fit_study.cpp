// Stiffness of the joints from the measured deflections, and what a fit leaves.
#include <cmath>

#include "heft/host/numbers.hpp"

#include "ur5_stiffness_setup.hpp"

namespace heft::studies {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

using Poses = std::vector<stiffness::LoadedPose>;

stiffness::StiffnessOptions with_groups(const std::vector<std::vector<int>>& groups) {
  stiffness::StiffnessOptions options;
  options.groups = groups;
  return options;
}

/// Joints 1 to 5: no reading at the tool moves with joint 6.
stiffness::StiffnessOptions without_last() { return with_groups({{0}, {1}, {2}, {3}, {4}}); }

/// A (110) has six rows a pose: displacement along u as read, all else counts as read and zero.
Poses with_zeros(Poses poses) {
  for (stiffness::LoadedPose& pose : poses) {
    const Vector3d along = pose.rows.row(0).head<3>().transpose();
    const double value = pose.values[0];
    pose.rows = MatrixXd::Identity(6, 6);
    pose.values = VectorXd::Zero(6);
    pose.values.head<3>() = value * along;
    pose.sigmas = VectorXd::Zero(6);
    pose.scatter = VectorXd::Constant(6, kNaN);
  }
  return poses;
}

/// Fits without the pose of index `left`.
StiffnessStudy::LeftOut leave_out(const model::Kinematics& kinematics, const Poses& poses, std::size_t left,
                                  double length) {
  Poses others = poses;
  others.erase(others.begin() + static_cast<std::ptrdiff_t>(left));
  StiffnessStudy::LeftOut out;
  out.pose = poses[left].name;
  out.own.fill(kNaN);
  const stiffness::StiffnessFit five = stiffness::fit_stiffness(kinematics, others, without_last(), length);
  for (std::size_t j = 0; j < 5; ++j) out.own[j] = five.joints[j].compliance.value;
  const stiffness::StiffnessFit sizes =
      stiffness::fit_stiffness(kinematics, others, with_groups(gear_sizes()), length);
  out.two = {sizes.joints[0].compliance.value, sizes.joints[3].compliance.value};
  return out;
}

/// The direct method: displacement of the tool along u; rotation about z from the cantilever's end, 0.5 m away at right
/// angles to u, minus the tool; all else zero.
stiffness::DirectStiffness direct_method(const model::Kinematics& kinematics,
                                         const Ur5Measurements& measurements) {
  std::vector<data::Deflection> combined = measurements.tool;
  for (std::size_t k = 0; k < combined.size(); ++k) {
    const double rotation =
        (measurements.cantilever[k].readings.front().value - combined[k].readings.front().value) / 0.5;
    combined[k].readings.push_back({true, Vector3d::UnitZ(), rotation, 0.0});
  }
  return stiffness::direct_stiffness(stiffness::loaded_poses(kinematics, combined), true);
}

/// Looks for a cause of what the springs leave.
void diagnose(const model::Kinematics& kinematics, StiffnessStudy& study) {
  const std::vector<stiffness::StiffnessEffect> effects =
      stiffness::known_stiffness_effects(kinematics.robot());
  for (const stiffness::StiffnessEffect& effect : effects) {
    if (!effect.column) continue;
    for (const auto& [poses, unseen] :
         {std::pair{&study.tool, &study.unseen_at_tool}, std::pair{&study.both, &study.unseen_in_both}}) {
      if (effect.column(*poses).cwiseAbs().maxCoeff() < 1e-12) unseen->push_back(effect.id);
    }
  }
  const auto look = [&](const Poses& poses, const stiffness::StiffnessOptions& options) {
    return stiffness::diagnose_stiffness(kinematics, poses, options, effects, study.length);
  };
  study.of_own = look(study.tool, without_last());
  study.of_tool = look(study.tool, with_groups(gear_sizes()));
  study.of_both = look(study.both, with_groups(gear_sizes()));
}

}  // namespace

StiffnessStudy study_stiffness(const model::Kinematics& kinematics, const Ur5Measurements& measurements) {
  StiffnessStudy study;
  std::vector<data::Deflection> rows = measurements.tool;
  rows.insert(rows.end(), measurements.cantilever.begin(), measurements.cantilever.end());
  study.tool = stiffness::loaded_poses(kinematics, measurements.tool);
  study.both = stiffness::loaded_poses(kinematics, rows);
  study.length = stiffness::shared_length(study.tool);

  const stiffness::StiffnessOptions own = with_groups({{0}, {1}, {2}, {3}, {4}, {5}}),
                                    two = with_groups(gear_sizes());
  study.own = stiffness::fit_stiffness(kinematics, study.tool, own, study.length);
  study.two = stiffness::fit_stiffness(kinematics, study.tool, two, study.length);
  study.two_both = stiffness::fit_stiffness(kinematics, study.both, two, study.length);
  study.truth.resize(6);
  for (std::size_t j = 0; j < 6; ++j)
    study.truth[static_cast<Eigen::Index>(j)] = study.two.joints[j].compliance.value;
  study.zeros = stiffness::fit_stiffness(kinematics, with_zeros(study.tool), own, study.length);
  for (std::size_t left = 0; left < study.tool.size(); ++left) {
    study.left_out.push_back(leave_out(kinematics, study.tool, left, study.length));
  }
  study.direct = direct_method(kinematics, measurements);
  study.direct_negative = static_cast<int>((study.direct.stiffness.array() < 0.0).count());
  diagnose(kinematics, study);
  study.cartesian = stiffness::cartesian_stiffness(kinematics, study.tool[2].q, study.truth.cwiseInverse());
  study.principal = stiffness::principal_deflections(study.cartesian.compliance.topLeftCorner<3, 3>());
  return study;
}

}  // namespace heft::studies
