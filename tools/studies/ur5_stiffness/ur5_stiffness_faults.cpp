/// @file
/// Claims of the thesis (UPC-ETSEIB, 2017) that its own numbers do not support.
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <string>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/Geometry>

#include "ur5_stiffness_study.hpp"

namespace heft::studies {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kForce = 18.6718;  // the weight [N]
constexpr int kToolTable = 7, kCantileverTable = 14, kPoses = 6;

std::vector<PrintedReading> table(const Ur5Measurements& m, int number) {
  std::vector<PrintedReading> rows;
  for (const PrintedReading& r : m.printed) {
    if (r.table == number) rows.push_back(r);
  }
  return rows;
}

double mean_difference(const std::vector<PrintedReading>& rows) {
  double sum = 0.0;
  for (const PrintedReading& r : rows) sum += r.difference();
  return sum / static_cast<double>(rows.size());
}

bool is_same(double a, double b) { return std::abs(a - b) < 5e-4; }  // tables have three decimals [mm]

// ---------------------------------------------------------------------------------------------------------------------
// Kinematics and dexterity.

void add_reach(std::vector<Fault>& faults, const ReachStudy& reach, const DexterityStudy& dexterity) {
  faults.push_back(
      {"length-value",
       "result",
       "text before table 4",
       "L = R/R̄ = 850 mm / 1019.2 mm = 0.8488",
       fmt::format(
           "850/{:.1f} is {:.4f}. 0.8488 is 850/{:.1f}, the distance of the same pose with θ5 turned to 180°",
           1e3 * reach.distance, reach.ratio, 1e3 * reach.turned_wrist),
       {reach.ratio, reach.turned_ratio},
       std::abs(reach.ratio - reach.printed_ratio) > 0.01 &&
           std::abs(reach.turned_ratio - reach.printed_ratio) < 1e-4});
  const double most = dexterity.as_printed.dexterity.maxCoeff();
  faults.push_back(
      {"length-unit",
       "result",
       "(104), (134)",
       "a ratio of two lengths is a length of 0.8488 m",
       fmt::format(
           "With 0.8488 m the map reaches {:.2f}. The printed values (0.0035 to 0.005) come back only with "
           "lengths in millimetres over 0.8488: then it reaches {:.4f}. With the root mean square distance "
           "of the axes, {:.3f} m, it reaches {:.2f}",
           dexterity.in_metres, most, dexterity.length, dexterity.sound.dexterity.maxCoeff()),
       {dexterity.in_metres, most, dexterity.sound.dexterity.maxCoeff()},
       most > 0.004 && most < 0.007 && dexterity.in_metres > 0.1});
  faults.push_back(
      {"reach-maximum",
       "result",
       "3.2.1, second table 3",
       "1019.2 mm is the maximum reach, global because a norm is convex",
       fmt::format("The arm reaches {:.1f} mm. At the printed pose all slopes vanish, but the distance "
                   "curves upwards in one direction ({:+.3f} m/rad²): a saddle. A norm is convex in the "
                   "position, not in the joint angles",
                   1e3 * reach.maximum.value, reach.curvature),
       {reach.maximum.value, reach.slope, reach.curvature},
       reach.maximum.value > reach.distance + 0.01 && reach.slope < 1e-6 && reach.curvature > 0.01});
  faults.push_back(
      {"ranges-overlap",
       "slip",
       "text at figure 30",
       "1/k_F is high from 0.0035 to 0.005 and low from 0.001 to 0.005",
       fmt::format("The second range contains the first. {:.0f} % of the map would be low, {:.0f} % of it "
                   "high at the same time. 0.001 to 0.0005 may be meant",
                   100 * dexterity.share_called_bad, 100 * dexterity.share_called_good),
       {dexterity.share_called_bad, dexterity.share_called_good},
       dexterity.share_called_good > 0.0 && dexterity.share_called_bad > dexterity.share_called_good});
  faults.push_back(
      {"length-moves-zones",
       "result",
       "3.2.1",
       "1/k_F depends on L, the location of the zones does not",
       fmt::format(
           "Of the places that are high with lengths in millimetres {:.0f} % are among as many highest with "
           "{:.3f} m: the map in millimetres weighs translation only",
           100 * dexterity.zones_that_stay, dexterity.length),
       {dexterity.zones_that_stay},
       dexterity.zones_that_stay < 0.9});
  faults.push_back({"elbow-folded",
                    "slip",
                    "text before table 5",
                    "there is a singularity at θ3 = 0",
                    fmt::format("There is (1/k_F = {:.4f}). The folded arm, θ3 = 180°, is singular as well "
                                "({:.4f}) and is not named, though the zones end only 8° before it",
                                dexterity.straight, dexterity.folded),
                    {dexterity.straight, dexterity.folded},
                    dexterity.straight < 1e-9 && dexterity.folded < 1e-9});
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
  faults.push_back({"outside-is-better",
                    "result",
                    "table 13",
                    "nine poses out of the zones of good dexterity",
                    fmt::format("θ2 and θ3 of poses {} lie in the zones of table 5. The nine poses have "
                                "1/k_F of {:.2f} on average, "
                                "the six measured ones {:.2f}: the poses called bad are the better ones",
                                fmt::join(inside, " and "), mean_outside, mean_measured),
                    {static_cast<double>(inside.size()), mean_outside, mean_measured},
                    !inside.empty() && mean_outside > mean_measured});
}

void add_transform(std::vector<Fault>& faults, const StiffnessStudy& stiffness) {
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
  faults.push_back(
      {"transform-3",
       "slip",
       "(129.c)",
       "the third transform shifts by -392 (cos θ2, sin θ2)",
       fmt::format(
           "It must be -392.25 (cos θ3, sin θ3). As printed the tool is off by up to {:.0f} mm at the "
           "measured poses, with θ3 but 392 by {:.2f} mm",
           1e3 * literal, 1e3 * rounded),
       {literal, rounded},
       literal > 0.1});
}

void add_notation(std::vector<Fault>& faults, const StiffnessStudy& stiffness) {
  const MatrixXd& J = stiffness.tool[3].J;
  const double trace = J.bottomRows(3).squaredNorm();
  faults.push_back(
      {"isotropy",
       "slip",
       "(97) to (99)",
       "Σ z zᵀ = σ E, and so n = 3 σ²",
       fmt::format("The trace of Σ z zᵀ is {:.0f} at every pose, of σ E it is 3 σ: n = 3 σ by (98), and 3 σ² "
                   "only if σ denotes its square in (96) to (98)",
                   trace),
       {trace},
       std::abs(trace - 6.0) < 1e-9});
  double plain = 0.0, square = 0.0;
  for (Index j = 0; j < 6; ++j) {
    plain += J.col(j).head<3>().norm() / 6.0;
    square += J.col(j).head<3>().squaredNorm() / 6.0;
  }
  faults.push_back({"squares-missing",
                    "slip",
                    "(100), (101)",
                    "L² is the mean of the distances of the axes",
                    fmt::format("L² would then be metres; the mean of the squares is meant. At pose 4 that "
                                "gives {:.3f} m; as printed the number is {:.3f} with metres and {:.1f} with "
                                "millimetres",
                                std::sqrt(square), std::sqrt(plain), std::sqrt(1e3 * plain)),
                    {std::sqrt(square), std::sqrt(plain)},
                    std::abs(std::sqrt(square) - std::sqrt(plain)) > 0.01});
  const stiffness::DirectStiffness& direct = stiffness.direct;
  const double with_first = direct.torque(0, 1) / direct.deflection(0, 0), with_own = direct.stiffness(0, 1);
  faults.push_back(
      {"index",
       "slip",
       "(120)",
       "K_i = τ_i / δθ_1",
       fmt::format("Each joint's own δθ_i is meant. At pose {} joint 2 would get {:.0f} kN m/rad with δθ_1, "
                   "{:.0f} with δθ_2",
                   direct.poses.front(), 1e-3 * with_first, 1e-3 * with_own),
       {with_first, with_own},
       std::abs(with_first - with_own) > 1.0});
}

// ---------------------------------------------------------------------------------------------------------------------
// The load and the measurements.

void add_poses(std::vector<Fault>& faults, const model::Kinematics& kinematics,
               const Ur5Measurements& measurements, const StiffnessStudy& stiffness) {
  std::vector<std::string> singular;
  std::vector<double> values;
  for (const stiffness::LoadedPose& pose : stiffness.tool) {
    values.push_back(pose.dexterity);
    if (pose.dexterity < stiffness::kSingularDexterity) singular.push_back(pose.name);
  }
  faults.push_back(
      {"singular-poses", "result", "table 6, figure 41",
       "the poses are chosen for good dexterity; the direct method inverts J at each",
       fmt::format(
           "Poses {} have θ5 = 0 and are exactly singular, pose 6 (θ5 = 6°) has 1/k_F = {:.2f}. J⁻¹ does not "
           "exist at two of six poses: figure 41 cannot have come from these angles. The zones were sought "
           "with the wrist at 45°, the poses were measured without",
           fmt::join(singular, " and "), values.back()),
       values, singular == std::vector<std::string>{"1", "5"}});

  double last = 0.0, most = 0.0;
  for (const stiffness::LoadedPose& pose : stiffness.tool) {
    const MatrixXd A = stiffness::compliance_rows(pose.J, pose.wrench, pose.rows);
    last = std::max(last, A.cwiseAbs()(0, 5));
    most = std::max(most, A.cwiseAbs().maxCoeff());
  }
  std::vector<int> below_zero;
  for (int j = 0; j < 6; ++j) {
    if (stiffness.zeros.joints[static_cast<std::size_t>(j)].compliance < 0.0) below_zero.push_back(j + 1);
  }
  faults.push_back(
      {"joint-6-unseen",
       "result",
       "(115), figures 38 to 40",
       "six stiffnesses from readings at the tool",
       fmt::format(
           "The tool point lies on the axis of joint 6, which therefore moves no reading: its column of B is "
           "{:.0e} of the largest, and BᵀB has no inverse. If what was not read counts as read and zero, "
           "joints {} get compliances below zero",
           last / most, fmt::join(below_zero, " and ")),
       {last / most},
       last < 1e-12 * most && !stiffness.own.joints[5].determined});

  // Load (135) at the poses of figure 40: the wrist at 45°.
  double fifth = 0.0, largest = 0.0, complementary = 0.0, at_outside = 0.0;
  const auto share_of_kc = [&](const stiffness::LoadedPose& pose) {
    const MatrixXd K = kinematics.complementary_stiffness(pose.q, pose.wrench, WrenchFrame::kBase);
    return K.norm() * stiffness.truth.maxCoeff();
  };
  std::vector<VectorXd> wrists, outside = measurements.outside;
  for (const stiffness::LoadedPose& pose : stiffness.tool) {
    VectorXd q = pose.q;
    q.tail<3>().setConstant(45.0 * kDegree);
    wrists.push_back(q);
    complementary = std::max(complementary, share_of_kc(pose));
  }
  for (const stiffness::LoadedPose& pose :
       loaded_with(kinematics, wrists, Instrument::kWhole, 1e-6, 1e-6, stiffness.length)) {
    const VectorXd torque = pose.J.transpose() * pose.wrench;
    fifth = std::max(fifth, std::abs(torque[4]));
    largest = std::max(largest, torque.cwiseAbs().maxCoeff());
  }
  for (const stiffness::LoadedPose& pose :
       loaded_with(kinematics, outside, Instrument::kWhole, 1e-6, 1e-6, stiffness.length)) {
    at_outside = std::max(at_outside, share_of_kc(pose));
  }
  faults.push_back({"joint-5-unloaded",
                    "result",
                    "figure 40",
                    "with the wrist at 45° every stiffness comes out well",
                    fmt::format("With θ6 = 45° the load (135) puts {:.0e} N m on joint 5 (on the most loaded "
                                "one {:.1f} N m): no reading "
                                "at such a pose reveals its stiffness",
                                fifth, largest),
                    {fifth, largest},
                    fifth < 1e-9 && largest > 1.0});
  faults.push_back({"kc-is-small",
                    "result",
                    "5.2.1, 5.2.2",
                    "out of the zones the results vary because K_C is not negligible there",
                    fmt::format("|K_C| is at most {:.2f} % of the softer stiffness at the poses of table 6 "
                                "and {:.2f} % at those of table "
                                "13. It depends on the load, not on 1/k_F, and explains nothing",
                                100 * complementary, 100 * at_outside),
                    {complementary, at_outside},
                    complementary < 0.02 && at_outside < 0.02});

  faults.push_back(
      {"direct-negative",
       "result",
       "(120), figure 41",
       "τ_i / δθ_i gives stiffnesses that vary less than those of least squares",
       fmt::format("{} of {} values at the four poses with an inverse are negative, which is impossible for "
                   "a spring",
                   stiffness.direct_negative, stiffness.direct.stiffness.size()),
       {static_cast<double>(stiffness.direct_negative)},
       stiffness.direct_negative > 0});

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
  faults.push_back(
      {"not-zero",
       "result",
       "5.2.2, 5.3",
       "the deflection lies along (1, 1, 0) of the tool, the rotation about z; all else is negligible",
       fmt::format(
           "With the stiffnesses found the tool moves {:.2f} times as far across that direction and {:.2f} "
           "times as far along z (rms over the poses), and turns {:.2f} times as far about x and y as about "
           "z. The text has the displacement along z \"over\" the resolution; below must be meant",
           across, upright, tilt),
       {across, upright, tilt},
       std::max({across, upright, tilt}) > 0.5});
}

void add_load(std::vector<Fault>& faults, const model::Kinematics& kinematics,
              const StiffnessStudy& stiffness) {
  const Vector3d down(0.0, 0.0, -1.0), along = Vector3d(1.0, 1.0, 0.0).normalized();
  std::vector<double> angles, rolls, tilts;
  std::string list, roll_list;
  for (const stiffness::LoadedPose& pose : stiffness.tool) {
    const Vector3d g = pose.tool.rotation.transpose() * down;
    angles.push_back(std::acos(std::clamp(g.dot(along), -1.0, 1.0)) / kDegree);
    tilts.push_back(std::asin(g.z()) / kDegree);
    list += fmt::format("{}({:.2f}, {:.2f}, {:.2f})", list.empty() ? "" : ", ", g.x(), g.y(), g.z());
    rolls.push_back((pose.q[1] + pose.q[2] + pose.q[3] + pose.q[5]) / kDegree);
    roll_list +=
        fmt::format("{}{:.1f}°", roll_list.empty() ? "" : ", ", std::round(10.0 * rolls.back()) / 10.0 + 0.0);
  }
  faults.push_back(
      {"load-direction", "result", "(135)", "the weight pulls along (1, 1, 0)/√2 of the tool at every pose",
       fmt::format(
           "A weight pulls down, and down in axes of the tool is {} at poses 1 to 6: {:.0f}° away from the "
           "stated direction at pose 1, {:.0f}° at pose 4. It is nearly -y at five poses",
           list, angles[0], angles[3]),
       angles, *std::min_element(angles.begin(), angles.end()) > 30.0});
  VectorXd q = stiffness.tool[3].q;
  q[5] = -1.0 * kDegree;
  const Vector3d mended = kinematics.tip(q).rotation.transpose() * down;
  faults.push_back({"pose-4", "data", "table 6, pose 4", "θ6 = -51°",
                    fmt::format("θ2 + θ3 + θ4 + θ6, which levels the tool, is {} at poses 1 to 6. With θ6 = "
                                "-1° pose 4 would have the weight along ({:.2f}, {:.2f}, {:.2f}) of the tool "
                                "like the others",
                                roll_list, mended.x(), mended.y(), mended.z()),
                    rolls, std::abs(rolls[3]) > 40.0 && std::abs(mended.y() + 1.0) < 0.15});
  faults.push_back({"not-level", "data", "table 6, poses 2 to 4 and 6",
                    "force in the plane of the tool, moment about its z axis",
                    fmt::format("Where θ5 is not 0 the tool's z axis is not level: down has {:.2f} along it "
                                "at pose 2, so force and moment "
                                "of (135) lack components at four of six poses",
                                std::sin(tilts[1] * kDegree)),
                    tilts, std::abs(tilts[1]) > 5.0});
}

void add_readings(std::vector<Fault>& faults, const Ur5Measurements& m) {
  // Printed deflections.
  std::map<int, int> differ;
  for (const PrintedReading& r : m.printed) {
    if (!is_same(r.difference(), r.printed)) ++differ[r.table];
  }
  {
    const std::vector<PrintedReading> rows = table(m, 10);
    const PrintedReading& last = rows.back();
    faults.push_back(
        {"table-10",
         "data",
         "table 10, column 6",
         fmt::format("{:.3f} mm", last.printed),
         fmt::format("{:.3f} - ({:.3f}) = {:.3f} mm", last.unloaded, last.loaded, last.difference()),
         {last.difference(), last.printed},
         differ[10] == 1 && !is_same(last.difference(), last.printed)});
  }
  {
    int absolutes = 0;
    for (const PrintedReading& r : table(m, 14)) {
      absolutes += is_same(std::abs(r.loaded) - std::abs(r.unloaded), r.printed) ? 1 : 0;
    }
    const PrintedReading& first = table(m, 14).front();
    faults.push_back({"table-14",
                      "data",
                      "table 14",
                      fmt::format("deflections such as {:.3f} mm", first.printed),
                      fmt::format("{} of 6 are |loaded| - |unloaded| although the reading went through zero; "
                                  "the difference is {:.3f} mm "
                                  "in column 1",
                                  absolutes, first.difference()),
                      {static_cast<double>(absolutes), first.difference()},
                      absolutes == 6 && differ[14] == 6});
  }
  {
    int lost = 0;
    for (const int number : {16, 18}) {
      for (const PrintedReading& r : table(m, number)) lost += is_same(-r.difference(), r.printed) ? 1 : 0;
    }
    faults.push_back(
        {"sign-lost",
         "data",
         "tables 16 and 18",
         "deflections of the cantilever's end without sign",
         fmt::format("All {} are loaded minus unloaded, in every other table it is the other way round: the "
                     "end went {:.3f} and {:.3f} mm against the direction in which the tool went {:.3f} and "
                     "{:.3f} mm",
                     lost, -mean_difference(table(m, 16)), -mean_difference(table(m, 18)),
                     mean_difference(table(m, 9)), mean_difference(table(m, 11))),
         {static_cast<double>(lost)},
         lost == 12});
  }
  // Work of the load: w · δd = F d + M (d_c - d)/0.5, from what was read alone; Σ τ²/k for springs, never negative.
  {
    std::vector<double> work;
    std::vector<std::string> negative;
    for (int pose = 0; pose < kPoses; ++pose) {
      const double d = mean_difference(table(m, kToolTable + pose)),
                   end = mean_difference(table(m, kCantileverTable + pose));
      work.push_back(kForce * d + 9.336 * (end - d) / 0.5);  // [mJ], twice the stored energy
      if (work.back() < 0.0) negative.push_back(fmt::format("{} ({:.1f} mJ)", pose + 1, work.back()));
    }
    faults.push_back(
        {"work-negative", "data", "tables 7 to 12 with 14 to 19",
         "force and moment (135) bend an arm of springs by what both tables say",
         fmt::format("F d + M (d_end - d)/0.5 m is what the load gives, from readings alone. It is negative "
                     "at poses {}: no stiffness gives that. Load, direction or one of the tables is not as "
                     "stated",
                     fmt::join(negative, " and ")),
         work, !negative.empty()});
  }
  // The second set repeats the first.
  struct Pair {
    int pose;
    bool loaded;
    int count;
    double shift;
  };
  std::vector<Pair> pairs;
  double pooled = 0.0;
  int freedom = 0;
  for (int pose = 0; pose < kPoses; ++pose) {
    const auto first = table(m, kToolTable + pose), second = table(m, kCantileverTable + pose);
    for (const bool loaded : {false, true}) {
      std::map<int, int> shifts;  // [µm]
      double mean = 0.0;
      for (std::size_t k = 0; k < first.size(); ++k) {
        const double a = loaded ? first[k].loaded : first[k].unloaded,
                     b = loaded ? second[k].loaded : second[k].unloaded;
        ++shifts[static_cast<int>(std::lround(1e3 * (b - a)))];
        mean += a / static_cast<double>(first.size());
      }
      for (std::size_t k = 0; k < first.size(); ++k) {
        const double a = loaded ? first[k].loaded : first[k].unloaded;
        pooled += (a - mean) * (a - mean);
      }
      freedom += static_cast<int>(first.size()) - 1;
      const auto most = std::max_element(shifts.begin(), shifts.end(),
                                         [](const auto& a, const auto& b) { return a.second < b.second; });
      pairs.push_back({pose, loaded, most->second, 1e-3 * most->first});
    }
  }
  // Chance that six differences of independent readings, rounded to 1 µm, agree: Σ_k p_k⁶ with a normal of √2 σ.
  const double sigma = 1e3 * std::sqrt(pooled / freedom);  // [µm]
  double chance = 0.0;
  for (int k = -200; k <= 200; ++k) {
    const double s = 2.0 * sigma;  // √2 of the difference times √2 of erf
    chance += std::pow(0.5 * (std::erf((k + 0.5) / s) - std::erf((k - 0.5) / s)), 6);
  }
  std::string list;
  int all_six = 0, all_but_one = 0;
  for (const Pair& p : pairs) {
    if (p.count < 5) continue;
    (p.count == 6 ? all_six : all_but_one) += 1;
    list += fmt::format("{}{}/{} {} {:+.3f} mm ({} of 6)", list.empty() ? "" : ", ", kToolTable + p.pose,
                        kCantileverTable + p.pose, p.loaded ? "loaded" : "unloaded", p.shift, p.count);
  }
  faults.push_back({"repeated",
                    "data",
                    "tables 7 to 12 against 14 to 19",
                    "the deflection of the cantilever's end was measured separately, six times a pose",
                    fmt::format("{} of 12 series are a series at the tool plus a constant, to the "
                                "micrometre, in all six columns, {} more in all but one: {}. Single readings "
                                "scatter by {:.1f} µm; independent ones would agree like this once in {:.0e} "
                                "series. They are not independent measurements",
                                all_six, all_but_one, list, sigma, 1.0 / chance),
                    {static_cast<double>(all_six), static_cast<double>(all_but_one), chance},
                    all_six >= 5 && chance < 1e-4});
}

void add_remarks(std::vector<Fault>& faults) {
  // By reading; there is nothing to compute.
  faults.push_back(
      {"figures-without-numbers",
       "result",
       "figures 38 to 41",
       "stiffness of every joint, drawn",
       "No number of these figures is printed, no unit, no interval; they can be rebuilt in kind only. No "
       "deflections are printed for the nine poses of figure 39. Those of figure 40 were chosen, not "
       "measured",
       {},
       true});
  faults.push_back(
      {"table-numbers",
       "slip",
       "tables 3 to 5",
       "two tables are numbered 3; table 4 has θ2 from 0° to 360°, table 5 has zones at negative angles; the "
       "text sends the reader to figure 28 for the map in figure 30",
       "The angles agree once a turn is taken off",
       {},
       true});
}

}  // namespace

std::vector<Fault> find_faults(const model::Kinematics& kinematics, const Ur5Measurements& measurements,
                               const ReachStudy& reach, const DexterityStudy& dexterity,
                               const StiffnessStudy& stiffness) {
  std::vector<Fault> faults;
  add_readings(faults, measurements);
  add_load(faults, kinematics, stiffness);
  add_poses(faults, kinematics, measurements, stiffness);
  add_reach(faults, reach, dexterity);
  add_transform(faults, stiffness);
  add_notation(faults, stiffness);
  add_remarks(faults);
  // What changes results first.
  std::stable_sort(faults.begin(), faults.end(), [](const Fault& a, const Fault& b) {
    const auto rank = [](const Fault& f) { return f.kind == "result" ? 0 : f.kind == "data" ? 1 : 2; };
    return rank(a) < rank(b);
  });
  return faults;
}

}  // namespace heft::studies
