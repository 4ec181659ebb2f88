// Claims on reach and dexterity, and slips of formulas.
#include <cmath>
#include <numbers>
#include <string>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/Geometry>

#include "ur5_stiffness_faults.hpp"

namespace heft::studies {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

Fault length_value(const ReachStudy& reach) {
  return {
      "length-value",
      "result",
      "text before table 4",
      "L = R/R̄ = 850 mm / 1019.2 mm = 0.8488",
      fmt::format(
          "850/{:.1f} is {:.4f}. 0.8488 is 850/{:.1f}, the distance of the same pose with θ5 turned to 180°",
          1e3 * reach.distance, reach.ratio, 1e3 * reach.turned_wrist),
      {reach.ratio, reach.turned_ratio},
      std::abs(reach.ratio - reach.printed_ratio) > 0.01 &&
          std::abs(reach.turned_ratio - reach.printed_ratio) < 1e-4};
}

Fault length_unit(const DexterityStudy& dexterity) {
  const double most = dexterity.as_printed.dexterity.maxCoeff();
  return {
      "length-unit",
      "result",
      "(104), (134)",
      "a ratio of two lengths is a length of 0.8488 m",
      fmt::format(
          "With 0.8488 m the map reaches {:.2f}. The printed values (0.0035 to 0.005) come back only with "
          "lengths in millimetres over 0.8488: then it reaches {:.4f}. With the root mean square distance "
          "of the axes, {:.3f} m, it reaches {:.2f}",
          dexterity.in_metres, most, dexterity.length, dexterity.sound.dexterity.maxCoeff()),
      {dexterity.in_metres, most, dexterity.sound.dexterity.maxCoeff()},
      most > 0.004 && most < 0.007 && dexterity.in_metres > 0.1};
}

Fault reach_maximum(const ReachStudy& reach) {
  return {"reach-maximum",
          "result",
          "3.2.1, second table 3",
          "1019.2 mm is the maximum reach, global because a norm is convex",
          fmt::format("The arm reaches {:.1f} mm. At the printed pose all slopes vanish, but the distance "
                      "curves upwards in one direction ({:+.3f} m/rad²): a saddle. A norm is convex in the "
                      "position, not in the joint angles",
                      1e3 * reach.maximum.value, reach.curvature),
          {reach.maximum.value, reach.slope, reach.curvature},
          reach.maximum.value > reach.distance + 0.01 && reach.slope < 1e-6 && reach.curvature > 0.01};
}

Fault ranges_overlap(const DexterityStudy& dexterity) {
  return {"ranges-overlap",
          "slip",
          "text at figure 30",
          "1/k_F is high from 0.0035 to 0.005 and low from 0.001 to 0.005",
          fmt::format("The second range contains the first. {:.0f} % of the map would be low, {:.0f} % of it "
                      "high at the same time. 0.001 to 0.0005 may be meant",
                      100 * dexterity.share_called_bad, 100 * dexterity.share_called_good),
          {dexterity.share_called_bad, dexterity.share_called_good},
          dexterity.share_called_good > 0.0 && dexterity.share_called_bad > dexterity.share_called_good};
}

Fault length_moves_zones(const DexterityStudy& dexterity) {
  return {
      "length-moves-zones",
      "result",
      "3.2.1",
      "1/k_F depends on L, the location of the zones does not",
      fmt::format(
          "Of the places that are high with lengths in millimetres {:.0f} % are among as many highest with "
          "{:.3f} m: the map in millimetres weighs translation only",
          100 * dexterity.zones_that_stay, dexterity.length),
      {dexterity.zones_that_stay},
      dexterity.zones_that_stay < 0.9};
}

Fault elbow_folded(const DexterityStudy& dexterity) {
  return {"elbow-folded",
          "slip",
          "text before table 5",
          "there is a singularity at θ3 = 0",
          fmt::format("There is (1/k_F = {:.4f}). The folded arm, θ3 = 180°, is singular as well "
                      "({:.4f}) and is not named, though the zones end only 8° before it",
                      dexterity.straight, dexterity.folded),
          {dexterity.straight, dexterity.folded},
          dexterity.straight < 1e-9 && dexterity.folded < 1e-9};
}

Fault outside_is_better(const DexterityStudy& dexterity) {
  std::vector<std::string> inside;
  double sum_measured = 0.0, sum_outside = 0.0;
  int measured = 0;
  for (const PoseDexterity& p : dexterity.poses) {
    (p.measured ? sum_measured : sum_outside) += p.sound;
    measured += p.measured ? 1 : 0;
    if (!p.measured && p.in_zone) inside.push_back(p.name.substr(3));
  }
  const double mean_measured = sum_measured / measured,
               mean_outside = sum_outside / static_cast<double>(dexterity.poses.size() - 6);
  return {"outside-is-better",
          "result",
          "table 13",
          "nine poses out of the zones of good dexterity",
          fmt::format("θ2 and θ3 of poses {} lie in the zones of table 5. The nine poses have "
                      "1/k_F of {:.2f} on average, "
                      "the six measured ones {:.2f}: the poses called bad are the better ones",
                      fmt::join(inside, " and "), mean_outside, mean_measured),
          {static_cast<double>(inside.size()), mean_outside, mean_measured},
          !inside.empty() && mean_outside > mean_measured};
}

Fault transform_3(const StiffnessStudy& stiffness) {
  // (129.c) as printed: T3 turns by θ3 but shifts by -392 (cos θ2, sin θ2).
  double literal = 0.0;
  const double rounded = 0.39225 - 0.392;
  for (const stiffness::LoadedPose& pose : stiffness.tool) {
    const VectorXd& q = pose.q;
    const Eigen::Matrix3d R2 = (Eigen::AngleAxisd(q[0], Vector3d::UnitZ()) *
                                Eigen::AngleAxisd(0.5 * std::numbers::pi, Vector3d::UnitX()) *
                                Eigen::AngleAxisd(q[1], Vector3d::UnitZ()))
                                   .toRotationMatrix();
    const Vector3d right(-0.39225 * std::cos(q[2]), -0.39225 * std::sin(q[2]), 0.0);
    const Vector3d as_printed(-0.392 * std::cos(q[1]), -0.392 * std::sin(q[1]), 0.0);
    literal = std::max(literal, (R2 * (as_printed - right)).norm());
  }
  return {
      "transform-3",
      "slip",
      "(129.c)",
      "the third transform shifts by -392 (cos θ2, sin θ2)",
      fmt::format("It must be -392.25 (cos θ3, sin θ3). As printed the tool is off by up to {:.0f} mm at the "
                  "measured poses, with θ3 but 392 by {:.2f} mm",
                  1e3 * literal, 1e3 * rounded),
      {literal, rounded},
      literal > 0.1};
}

Fault isotropy(const StiffnessStudy& stiffness) {
  const MatrixXd& J = stiffness.tool[3].J;
  const double trace = J.bottomRows(3).squaredNorm();
  return {
      "isotropy",
      "slip",
      "(97) to (99)",
      "Σ z zᵀ = σ E, and so n = 3 σ²",
      fmt::format("The trace of Σ z zᵀ is {:.0f} at every pose, of σ E it is 3 σ: n = 3 σ by (98), and 3 σ² "
                  "only if σ denotes its square in (96) to (98)",
                  trace),
      {trace},
      std::abs(trace - 6.0) < 1e-9};
}

Fault squares_missing(const StiffnessStudy& stiffness) {
  const MatrixXd& J = stiffness.tool[3].J;
  double plain = 0.0, square = 0.0;
  for (Index j = 0; j < 6; ++j) {
    plain += J.col(j).head<3>().norm() / 6.0;
    square += J.col(j).head<3>().squaredNorm() / 6.0;
  }
  return {"squares-missing",
          "slip",
          "(100), (101)",
          "L² is the mean of the distances of the axes",
          fmt::format("L² would then be metres; the mean of the squares is meant. At pose 4 that "
                      "gives {:.3f} m; as printed the number is {:.3f} with metres and {:.1f} with "
                      "millimetres",
                      std::sqrt(square), std::sqrt(plain), std::sqrt(1e3 * plain)),
          {std::sqrt(square), std::sqrt(plain)},
          std::abs(std::sqrt(square) - std::sqrt(plain)) > 0.01};
}

Fault index_of_deflection(const StiffnessStudy& stiffness) {
  const stiffness::DirectStiffness& direct = stiffness.direct;
  const double with_first = direct.torque(0, 1) / direct.deflection(0, 0), with_own = direct.stiffness(0, 1);
  return {
      "index",
      "slip",
      "(120)",
      "K_i = τ_i / δθ_1",
      fmt::format("Each joint's own δθ_i is meant. At pose {} joint 2 would get {:.0f} kN m/rad with δθ_1, "
                  "{:.0f} with δθ_2",
                  direct.poses.front(), 1e-3 * with_first, 1e-3 * with_own),
      {with_first, with_own},
      std::abs(with_first - with_own) > 1.0};
}

}  // namespace

std::vector<Fault> faults_of_dexterity(const ReachStudy& reach, const DexterityStudy& dexterity) {
  return {length_value(reach),         length_unit(dexterity),        reach_maximum(reach),
          ranges_overlap(dexterity),   length_moves_zones(dexterity), elbow_folded(dexterity),
          outside_is_better(dexterity)};
}

std::vector<Fault> slips_of_formulas(const StiffnessStudy& stiffness) {
  return {transform_3(stiffness), isotropy(stiffness), squares_missing(stiffness),
          index_of_deflection(stiffness)};
}

}  // namespace heft::studies
