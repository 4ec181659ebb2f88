// Claims on poses, load and the stiffnesses found.
#include <algorithm>
#include <cmath>
#include <string>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "ur5_stiffness_faults.hpp"
#include "ur5_stiffness_setup.hpp"

namespace heft::studies {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

/// Down, base frame.
const Vector3d kDown(0.0, 0.0, -1.0);

Fault load_direction(const StiffnessStudy& stiffness) {
  const Vector3d along = Vector3d(1.0, 1.0, 0.0).normalized();
  std::vector<double> angles;
  std::string list;
  for (const stiffness::LoadedPose& pose : stiffness.tool) {
    const Vector3d g = pose.tool.rotation.transpose() * kDown;
    angles.push_back(std::acos(std::clamp(g.dot(along), -1.0, 1.0)) / kDegree);
    list += fmt::format("{}({:.2f}, {:.2f}, {:.2f})", list.empty() ? "" : ", ", g.x(), g.y(), g.z());
  }
  return {
      "load-direction",
      "result",
      "(135)",
      "the weight pulls along (1, 1, 0)/√2 of the tool at every pose",
      fmt::format(
          "A weight pulls down, and down in axes of the tool is {} at poses 1 to 6: {:.0f}° away from the "
          "stated direction at pose 1, {:.0f}° at pose 4. It is nearly -y at five poses",
          list, angles[0], angles[3]),
      angles,
      *std::min_element(angles.begin(), angles.end()) > 30.0};
}

Fault pose_4(const model::Kinematics& kinematics, const StiffnessStudy& stiffness) {
  std::vector<double> rolls;
  std::string roll_list;
  for (const stiffness::LoadedPose& pose : stiffness.tool) {
    rolls.push_back((pose.q[1] + pose.q[2] + pose.q[3] + pose.q[5]) / kDegree);
    roll_list +=
        fmt::format("{}{:.1f}°", roll_list.empty() ? "" : ", ", std::round(10.0 * rolls.back()) / 10.0 + 0.0);
  }
  VectorXd q = stiffness.tool[3].q;
  q[5] = -1.0 * kDegree;
  const Vector3d mended = kinematics.tip(q).rotation.transpose() * kDown;
  return {"pose-4",
          "data",
          "table 6, pose 4",
          "θ6 = -51°",
          fmt::format("θ2 + θ3 + θ4 + θ6, which levels the tool, is {} at poses 1 to 6. With θ6 = "
                      "-1° pose 4 would have the weight along ({:.2f}, {:.2f}, {:.2f}) of the tool "
                      "like the others",
                      roll_list, mended.x(), mended.y(), mended.z()),
          rolls,
          std::abs(rolls[3]) > 40.0 && std::abs(mended.y() + 1.0) < 0.15};
}

Fault not_level(const StiffnessStudy& stiffness) {
  std::vector<double> tilts;  // of the tool's z axis [°]
  for (const stiffness::LoadedPose& pose : stiffness.tool) {
    tilts.push_back(std::asin((pose.tool.rotation.transpose() * kDown).z()) / kDegree);
  }
  return {"not-level",
          "data",
          "table 6, poses 2 to 4 and 6",
          "force in the plane of the tool, moment about its z axis",
          fmt::format("Where θ5 is not 0 the tool's z axis is not level: down has {:.2f} along it "
                      "at pose 2, so force and moment "
                      "of (135) lack components at four of six poses",
                      std::sin(tilts[1] * kDegree)),
          tilts,
          std::abs(tilts[1]) > 5.0};
}

Fault singular_poses(const StiffnessStudy& stiffness) {
  std::vector<std::string> singular;
  std::vector<double> values;
  for (const stiffness::LoadedPose& pose : stiffness.tool) {
    values.push_back(pose.dexterity);
    if (pose.dexterity < stiffness::kSingularDexterity) singular.push_back(pose.name);
  }
  return {
      "singular-poses",
      "result",
      "table 6, figure 41",
      "the poses are chosen for good dexterity; the direct method inverts J at each",
      fmt::format(
          "Poses {} have θ5 = 0 and are exactly singular, pose 6 (θ5 = 6°) has 1/k_F = {:.2f}. J⁻¹ does not "
          "exist at two of six poses: figure 41 cannot have come from these angles. The zones were sought "
          "with the wrist at 45°, the poses were measured without",
          fmt::join(singular, " and "), values.back()),
      values,
      singular == std::vector<std::string>{"1", "5"}};
}

Fault joint_6_unseen(const StiffnessStudy& stiffness) {
  double last = 0.0, most = 0.0;
  for (const stiffness::LoadedPose& pose : stiffness.tool) {
    const MatrixXd A = stiffness::compliance_rows(pose.J, pose.wrench, pose.rows);
    last = std::max(last, A.cwiseAbs()(0, 5));
    most = std::max(most, A.cwiseAbs().maxCoeff());
  }
  std::vector<int> below_zero;
  for (int j = 0; j < 6; ++j) {
    if (stiffness.zeros.joints[static_cast<std::size_t>(j)].compliance.value < 0.0)
      below_zero.push_back(j + 1);
  }
  return {
      "joint-6-unseen",
      "result",
      "(115), figures 38 to 40",
      "six stiffnesses from readings at the tool",
      fmt::format(
          "The tool point lies on the axis of joint 6, which therefore moves no reading: its column of B is "
          "{:.0e} of the largest, and BᵀB has no inverse. If what was not read counts as read and zero, "
          "joints {} get compliances below zero",
          last / most, fmt::join(below_zero, " and ")),
      {last / most},
      last < 1e-12 * most && !stiffness.own.joints[5].determined};
}

/// Load (135) at the poses of figure 40: the wrist at 45°.
Fault joint_5_unloaded(const model::Kinematics& kinematics, const StiffnessStudy& stiffness) {
  std::vector<VectorXd> wrists;
  for (const stiffness::LoadedPose& pose : stiffness.tool) {
    wrists.push_back(pose.q);
    wrists.back().tail<3>().setConstant(45.0 * kDegree);
  }
  double fifth = 0.0, largest = 0.0;
  for (const stiffness::LoadedPose& pose :
       loaded_with(kinematics, wrists, Instrument::kWhole, 1e-6, 1e-6, stiffness.length)) {
    const VectorXd torque = pose.J.transpose() * pose.wrench;
    fifth = std::max(fifth, std::abs(torque[4]));
    largest = std::max(largest, torque.cwiseAbs().maxCoeff());
  }
  return {"joint-5-unloaded",
          "result",
          "figure 40",
          "with the wrist at 45° every stiffness comes out well",
          fmt::format("With θ6 = 45° the load (135) puts {:.0e} N m on joint 5 (on the most loaded "
                      "one {:.1f} N m): no reading "
                      "at such a pose reveals its stiffness",
                      fifth, largest),
          {fifth, largest},
          fifth < 1e-9 && largest > 1.0};
}

/// Largest |K_C| over the softer stiffness.
double share_of_kc(const model::Kinematics& kinematics, const std::vector<stiffness::LoadedPose>& poses,
                   const VectorXd& compliance) {
  double most = 0.0;
  for (const stiffness::LoadedPose& pose : poses) {
    const MatrixXd K = kinematics.complementary_stiffness(pose.q, pose.wrench, WrenchFrame::kBase);
    most = std::max(most, K.norm() * compliance.maxCoeff());
  }
  return most;
}

Fault kc_is_small(const model::Kinematics& kinematics, const Ur5Measurements& measurements,
                  const StiffnessStudy& stiffness) {
  const double complementary = share_of_kc(kinematics, stiffness.tool, stiffness.truth);
  const double at_outside = share_of_kc(
      kinematics,
      loaded_with(kinematics, measurements.outside, Instrument::kWhole, 1e-6, 1e-6, stiffness.length),
      stiffness.truth);
  return {"kc-is-small",
          "result",
          "5.2.1, 5.2.2",
          "out of the zones the results vary because K_C is not negligible there",
          fmt::format("|K_C| is at most {:.2f} % of the softer stiffness at the poses of table 6 "
                      "and {:.2f} % at those of table "
                      "13. It depends on the load, not on 1/k_F, and explains nothing",
                      100 * complementary, 100 * at_outside),
          {complementary, at_outside},
          complementary < 0.02 && at_outside < 0.02};
}

Fault direct_negative(const StiffnessStudy& stiffness) {
  return {
      "direct-negative",
      "result",
      "(120), figure 41",
      "τ_i / δθ_i gives stiffnesses that vary less than those of least squares",
      fmt::format("{} of {} values at the four poses with an inverse are negative, which is impossible for "
                  "a spring",
                  stiffness.direct_negative, stiffness.direct.stiffness.size()),
      {static_cast<double>(stiffness.direct_negative)},
      stiffness.direct_negative > 0};
}

Fault not_zero(const StiffnessStudy& stiffness) {
  // The two-size stiffnesses predict the components that were taken as zero.
  double along = 0.0, across = 0.0, upright = 0.0, turned = 0.0,
         tilt = 0.0;  // sums of squares over the poses
  for (const stiffness::LoadedPose& pose : stiffness.tool) {
    const VectorXd d = pose.J * stiffness.truth.asDiagonal() * pose.J.transpose() * pose.wrench;
    const Vector3d move = pose.tool.rotation.transpose() * d.head<3>(),
                   turn = pose.tool.rotation.transpose() * d.tail<3>();
    along += 0.5 * std::pow(move.x() + move.y(), 2);
    across += 0.5 * std::pow(move.x() - move.y(), 2);
    upright += std::pow(move.z(), 2);
    turned += std::pow(turn.z(), 2);
    tilt += turn.head<2>().squaredNorm();
  }
  across = std::sqrt(across / along);
  upright = std::sqrt(upright / along);
  tilt = std::sqrt(tilt / turned);
  return {
      "not-zero",
      "result",
      "5.2.2, 5.3",
      "the deflection lies along (1, 1, 0) of the tool, the rotation about z; all else is negligible",
      fmt::format(
          "With the stiffnesses found the tool moves {:.2f} times as far across that direction and {:.2f} "
          "times as far along z (rms over the poses), and turns {:.2f} times as far about x and y as about "
          "z. The text has the displacement along z \"over\" the resolution; below must be meant",
          across, upright, tilt),
      {across, upright, tilt},
      std::max({across, upright, tilt}) > 0.5};
}

}  // namespace

std::vector<Fault> faults_of_load(const model::Kinematics& kinematics, const StiffnessStudy& stiffness) {
  return {load_direction(stiffness), pose_4(kinematics, stiffness), not_level(stiffness)};
}

std::vector<Fault> faults_of_stiffness(const model::Kinematics& kinematics,
                                       const Ur5Measurements& measurements, const StiffnessStudy& stiffness) {
  return {singular_poses(stiffness),
          joint_6_unseen(stiffness),
          joint_5_unloaded(kinematics, stiffness),
          kc_is_small(kinematics, measurements, stiffness),
          direct_negative(stiffness),
          not_zero(stiffness)};
}

}  // namespace heft::studies
