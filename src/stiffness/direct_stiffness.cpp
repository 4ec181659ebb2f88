// δθ = J⁻¹ δd and k = τ / δθ, pose by pose: the method that the fit is compared with.
#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/stiffness/deflection_fit.hpp"

#include "stiffness_design.hpp"

namespace heft::stiffness {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Poses with all their readings: what was read at one pose under one load belongs together, whichever point it was
/// read at.
std::vector<LoadedPose> with_readings_together(const std::vector<LoadedPose>& poses) {
  std::vector<LoadedPose> whole;
  for (const LoadedPose& pose : poses) {
    const auto same = std::find_if(whole.begin(), whole.end(), [&](const LoadedPose& known) {
      return known.name == pose.name && same_load(known, pose);
    });
    if (same == whole.end()) {
      whole.push_back(pose);
      continue;
    }
    MatrixXd rows(same->rows.rows() + pose.rows.rows(), 6);
    rows << same->rows, pose.rows;
    VectorXd values(rows.rows());
    values << same->values, pose.values;
    same->rows = rows;
    same->values = values;
  }
  return whole;
}

/// Share of the largest below which a singular value of the rows is none.
constexpr double kNoComponent = 1e-9;

/// Deflection of the tool, or, where it cannot be had, nothing and in `why` the reason.
/// @return 6 [m, rad], base frame
VectorXd whole_deflection(const LoadedPose& pose, bool missing_is_zero, std::string& why) {
  if (pose.dexterity < kSingularDexterity) {
    why = "singular pose: J has no inverse there";
    return {};
  }
  // In axes of the tool, where "not read" means something to those who measured.
  MatrixXd rows = pose.rows;
  rows.leftCols(3) = pose.rows.leftCols(3) * pose.tool.rotation;
  rows.rightCols(3) = pose.rows.rightCols(3) * pose.tool.rotation;
  const VectorXd s = singular_values(rows.transpose() * rows);
  const auto rank = (s.array() > kNoComponent * s[0]).count();
  if (rank < 6 && !missing_is_zero) {
    why = fmt::format("{} of 6 components of the deflection were read; the method needs all", rank);
    return {};
  }
  // The smallest δd that the readings allow: what they do not see is zero (118).
  const Eigensystem e = eigensystem_of(rows.transpose() * rows);
  VectorXd in_tool = VectorXd::Zero(6);
  for (Index k = 0; k < 6; ++k) {
    const VectorXd v = e.vectors.col(k);
    if (e.values[k] > kNoComponent * e.values[5])
      in_tool += v * v.dot(rows.transpose() * pose.values) / e.values[k];
  }
  VectorXd twist(6);
  twist << pose.tool.rotation * in_tool.head(3), pose.tool.rotation * in_tool.tail(3);
  return twist;
}

[[noreturn]] void refuse_without_a_pose(const DirectStiffness& result) {
  std::map<std::string, std::vector<std::string>> poses_of;
  for (const auto& [pose, why] : result.refused) poses_of[why].push_back(pose);
  std::string list;
  for (const auto& [why, names] : poses_of) {
    list += fmt::format("; {} {}: {}", names.size() == 1 ? "pose" : "poses", fmt::join(names, ", "), why);
  }
  throw NotIdentifiableError("δθ = J⁻¹ δd can be formed at none of the poses" + list +
                             "; measure whole deflections (dx dy dz rx ry rz) away from singular poses");
}

/// Mean over the poses and its interval, from the stiffnesses.
void average(DirectStiffness& result) {
  const Index count = result.stiffness.rows();
  result.mean = result.stiffness.colwise().mean();
  const double half =
      statistics::interval_factor(static_cast<int>(count) - 1) / std::sqrt(static_cast<double>(count));
  const VectorXd deviation = ((result.stiffness.rowwise() - result.mean.transpose()).colwise().squaredNorm() /
                              static_cast<double>(count - 1))
                                 .cwiseSqrt();
  result.low = result.mean - half * deviation;
  result.high = result.mean + half * deviation;
  if (count < 2) {
    result.low.setConstant(kNaN);
    result.high.setConstant(kNaN);
  }
}

}  // namespace

DirectStiffness direct_stiffness(const std::vector<LoadedPose>& poses, bool missing_is_zero) {
  DirectStiffness result;
  std::vector<VectorXd> torques, angles;
  for (const LoadedPose& pose : with_readings_together(poses)) {
    std::string why;
    const VectorXd twist = whole_deflection(pose, missing_is_zero, why);
    if (twist.size() == 0) {
      result.refused.emplace_back(pose.name, why);
      continue;
    }
    result.poses.push_back(pose.name);
    torques.push_back(pose.J.transpose() * pose.wrench);
    angles.push_back(least_squares(pose.J, twist));
  }
  if (result.poses.empty()) refuse_without_a_pose(result);
  const auto count = static_cast<Index>(result.poses.size());
  const Index n = torques.front().size();
  result.torque.resize(count, n);
  result.deflection.resize(count, n);
  for (Index k = 0; k < count; ++k) {
    result.torque.row(k) = torques[static_cast<std::size_t>(k)];
    result.deflection.row(k) = angles[static_cast<std::size_t>(k)];
  }
  result.stiffness = result.torque.cwiseQuotient(result.deflection);
  average(result);
  return result;
}

}  // namespace heft::stiffness
