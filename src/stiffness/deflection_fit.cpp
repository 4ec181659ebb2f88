#include "heft/stiffness/deflection_fit.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/Geometry>

#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "heft/host/words.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/stiffness/dexterity.hpp"

#include "stiffness_design.hpp"

namespace heft::stiffness {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

void check_limits(const model::Robot& robot, const data::Deflection& row) {
  // Encoders are read with some error; a pose at a stop may read a little beyond it.
  constexpr double kSlack = 1e-3;
  for (int j = 0; j < robot.num_joints(); ++j) {
    const model::RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
    const double q = row.q[j];
    if (q < joint.lower - kSlack || q > joint.upper + kSlack) {
      const bool degrees = joint.joint.type == JointType::kRevolute && std::abs(q) > 7.0;
      throw DataError(
          fmt::format("{}: column 'q{}': pose '{}' has joint {} at {:g}, outside its limits [{:g}, {:g}]; "
                      "expected a pose the robot "
                      "can take{}; correct the pose or the limits in the URDF",
                      row.where, j + 1, row.pose, j + 1, q, joint.lower, joint.upper,
                      degrees ? " in rad (this looks like degrees)" : ""));
    }
  }
}

/// A row of the file in the base frame, not yet merged with its repeats.
LoadedPose on_robot(const model::Kinematics& kinematics, const data::Deflection& row) {
  check_limits(kinematics.robot(), row);
  LoadedPose pose;
  pose.name = row.pose;
  pose.q = row.q;
  pose.tool = kinematics.tip_and_jacobian(row.q, pose.J);
  const Eigen::Matrix3d axes =
      row.tool_axes ? pose.tool.rotation : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
  pose.wrench << axes * row.force, axes * row.moment;
  pose.follows = row.tool_axes ? WrenchFrame::kTool : WrenchFrame::kBase;
  pose.point = pose.tool.rotation * row.point;
  const auto m = static_cast<Index>(row.readings.size());
  pose.rows.resize(m, 6);
  pose.values.resize(m);
  pose.sigmas.resize(m);
  pose.scatter.setConstant(m, kNaN);
  for (Index r = 0; r < m; ++r) {
    const data::DeflectionReading& reading = row.readings[static_cast<std::size_t>(r)];
    const Vector3d u = axes * reading.direction;
    // A point p off the tip moves by δp + δω × p: along u that is u·δp + (p × u)·δω.
    if (reading.rotation) {
      pose.rows.row(r) << Eigen::RowVector3d::Zero(), u.transpose();
    } else {
      pose.rows.row(r) << u.transpose(), pose.point.cross(u).transpose();
    }
    pose.values[r] = reading.value;
    pose.sigmas[r] = reading.sigma;
  }
  return pose;
}

constexpr double kSame = 1e-9;

bool same_load(const LoadedPose& a, const LoadedPose& b) {
  return (a.q - b.q).norm() < kSame && (a.wrench - b.wrench).norm() < kSame * a.wrench.norm();
}

bool same_measurement(const LoadedPose& a, const LoadedPose& b) {
  return a.name == b.name && a.rows.rows() == b.rows.rows() && same_load(a, b) &&
         (a.rows - b.rows).norm() < kSame;
}

/// Mean, scatter and the deviation of the mean of repeats.
LoadedPose merged(const std::vector<LoadedPose>& repeats) {
  LoadedPose pose = repeats.front();
  const auto count = static_cast<double>(repeats.size());
  if (repeats.size() < 2) return pose;
  pose.repeats = static_cast<int>(repeats.size());
  pose.values.setZero();
  for (const LoadedPose& repeat : repeats) pose.values += repeat.values / count;
  pose.scatter.setZero(pose.values.size());
  for (const LoadedPose& repeat : repeats) {
    pose.scatter.array() += (repeat.values - pose.values).array().square() / (count - 1.0);
  }
  pose.scatter = pose.scatter.cwiseSqrt();
  pose.sigmas /= std::sqrt(count);
  return pose;
}

/// Why the readings do not determine a group's compliance.
std::string why_open(const std::vector<LoadedPose>& poses, const std::vector<int>& joints) {
  double torque = 0.0, shown = 0.0;
  for (const LoadedPose& pose : poses) {
    for (const int j : joints) {
      torque = std::max(torque, std::abs(pose.J.col(j).dot(pose.wrench)) / pose.wrench.norm());
      shown = std::max(shown, (pose.rows * pose.J.col(j)).cwiseAbs().maxCoeff());
    }
  }
  constexpr double kNone = 1e-9;
  if (torque < kNone) return "no load turns it: load the tool so that a torque about its axis arises";
  if (shown < kNone) {
    return "no reading sees it move: read a rotation about its axis, or a point off its axis";
  }
  return "the readings cannot distinguish it from other joints: add poses and directions";
}

/// Joint deflections under the load, and in `torque` what stretches the springs there: τ = J(q + δθ)ᵀ w, δθ = x τ. To
/// first order in δθ that is (K_θ − K_C) δθ = Jᵀ w (88).
VectorXd deflected(const model::Kinematics& kinematics, const LoadedPose& pose, const VectorXd& compliance,
                   VectorXd& torque) {
  ToolWrench<double> wrench = pose.wrench;
  if (pose.follows == WrenchFrame::kTool) {
    wrench.head<3>() = pose.tool.rotation.transpose() * pose.wrench.head<3>();
    wrench.tail<3>() = pose.tool.rotation.transpose() * pose.wrench.tail<3>();
  }
  VectorXd angles = VectorXd::Zero(pose.q.size());
  constexpr int kMost = 50;
  for (int round = 0; round < kMost; ++round) {
    const VectorXd next = compliance.cwiseProduct(torque);
    const double change = (next - angles).norm();
    angles = next;
    torque = kinematics.joint_torque(pose.q + angles, wrench, pose.follows);
    if (change <= 1e-14 + 1e-13 * angles.norm()) break;
  }
  return angles;
}

/// Names in the order of appearance, and which of them each pose has.
std::vector<std::string> names_of(const std::vector<LoadedPose>& poses, std::vector<int>& name_of_pose) {
  std::vector<std::string> names;
  for (const LoadedPose& pose : poses) {
    const auto found = std::find(names.begin(), names.end(), pose.name);
    name_of_pose.push_back(static_cast<int>(found - names.begin()));
    if (found == names.end()) names.push_back(pose.name);
  }
  return names;
}

}  // namespace

std::vector<LoadedPose> loaded_poses(const model::Kinematics& kinematics,
                                     const std::vector<data::Deflection>& rows, double length) {
  std::vector<std::vector<LoadedPose>> repeats;
  for (const data::Deflection& row : rows) {
    LoadedPose pose = on_robot(kinematics, row);
    const auto found = std::find_if(repeats.begin(), repeats.end(),
                                    [&](const auto& known) { return same_measurement(known.front(), pose); });
    if (found == repeats.end()) {
      repeats.push_back({std::move(pose)});
    } else {
      found->push_back(std::move(pose));
    }
  }
  std::vector<LoadedPose> poses;
  for (const auto& same : repeats) poses.push_back(merged(same));
  if (length <= 0.0) length = shared_length(poses);
  for (LoadedPose& pose : poses) pose.dexterity = dexterity(pose.J, length);
  return poses;
}

std::vector<std::vector<int>> groups_of(const StiffnessOptions& options, int n) {
  if (!options.groups.empty()) return options.groups;
  std::vector<std::vector<int>> own;
  for (int j = 0; j < n; ++j) own.push_back({j});
  return own;
}

bool is_rotation(const LoadedPose& pose, Index reading) {
  return pose.rows.row(reading).head<3>().isZero(0.0);
}

double shared_length(const std::vector<LoadedPose>& poses) {
  double square = 0.0;
  for (const LoadedPose& pose : poses) {
    square += std::pow(rms_axis_distance(pose.J), 2) / static_cast<double>(poses.size());
  }
  return square > 0.0 ? std::sqrt(square) : 1.0;
}

Design stiffness_design(const model::Kinematics& kinematics, const std::vector<LoadedPose>& poses,
                        const StiffnessOptions& options, const VectorXd& compliance, double length) {
  const int n = kinematics.num_joints();
  const auto groups = groups_of(options, n);
  const auto p = static_cast<Index>(groups.size());
  Index m = 0;
  bool stated = true;
  for (const LoadedPose& pose : poses) {
    m += pose.values.size();
    stated = stated && (pose.sigmas.array() > 0.0).all();
  }
  Design design;
  design.B = MatrixXd::Zero(m, p + options.extra.cols());
  if (options.extra.size() > 0) design.B.rightCols(options.extra.cols()) = options.extra;
  design.y.resize(m);
  design.weight.resize(m);
  design.scale.resize(m);
  design.stated_noise = stated;
  std::vector<int> name_of_pose;
  design.names = names_of(poses, name_of_pose);
  Index row = 0;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    const LoadedPose& pose = poses[k];
    VectorXd torque = pose.J.transpose() * pose.wrench;
    VectorXd beyond = VectorXd::Zero(pose.values.size());  // what a straight path of the tool leaves out
    if (compliance.size() == n) {
      const VectorXd angles = deflected(kinematics, pose, compliance, torque);
      const model::ToolPlacement there = kinematics.tip(pose.q + angles);
      const Eigen::AngleAxisd turn(there.rotation * pose.tool.rotation.transpose());
      VectorXd twist(6);
      twist << there.position - pose.tool.position, turn.angle() * turn.axis();
      beyond = pose.rows * (twist - pose.J * angles);
    }
    const MatrixXd seen = pose.rows * pose.J;  // how each joint shows in each reading
    for (Index r = 0; r < pose.values.size(); ++r, ++row) {
      for (Index g = 0; g < p; ++g) {
        for (const int j : groups[static_cast<std::size_t>(g)]) design.B(row, g) += seen(r, j) * torque[j];
      }
      design.y[row] = pose.values[r] - beyond[r];
      const bool rotation = is_rotation(pose, r);
      design.scale[row] = rotation ? length : 1.0;
      design.weight[row] = stated ? 1.0 / pose.sigmas[r] : design.scale[row];
      design.name_of_row.push_back(name_of_pose[k]);
    }
  }
  return design;
}

Solution solve(const Design& design) {
  const Index p = design.B.cols();
  Solution solution;
  const MatrixXd W = design.weight.asDiagonal() * design.B;
  VectorXd norms = W.colwise().norm();
  const double largest = norms.size() > 0 ? norms.maxCoeff() : 0.0;
  // Columns of unit length, so that rank and condition do not depend on units.
  constexpr double kRank = 1e-9;
  for (Index c = 0; c < p; ++c) norms[c] = norms[c] > kRank * largest ? norms[c] : 0.0;
  const VectorXd unit = norms.unaryExpr([](double v) { return v > 0.0 ? 1.0 / v : 0.0; });
  const MatrixXd U = W * unit.asDiagonal();
  const Eigensystem e = eigensystem_of(U.transpose() * U);
  // Eigenvalues are squares of the singular values and know these to half the digits only.
  constexpr double kLost = 1e-11;
  MatrixXd inverse = MatrixXd::Zero(p, p), null = MatrixXd::Zero(p, p);
  double least = kInfinity;
  for (Index c = 0; c < p; ++c) {
    const VectorXd v = e.vectors.col(c);
    if (e.values[c] > kLost * std::max(1.0, e.values[p - 1])) {
      inverse += v * v.transpose() / e.values[c];
      least = std::min(least, e.values[c]);
      ++solution.rank;
    } else {
      null += v * v.transpose();
    }
  }
  solution.condition = solution.rank > 0 ? std::sqrt(e.values[p - 1] / least) : kInfinity;
  solution.determined.resize(static_cast<std::size_t>(p));
  for (Index c = 0; c < p; ++c) {
    solution.determined[static_cast<std::size_t>(c)] = norms[c] > 0.0 && null(c, c) < 1e-6;
  }
  solution.inverse = unit.asDiagonal() * inverse * unit.asDiagonal();
  solution.x = solution.inverse * (W.transpose() * design.weight.cwiseProduct(design.y));
  return solution;
}

MatrixXd left_out_operator(const Design& design, const Solution& solution, std::vector<bool>* possible) {
  const Index m = design.B.rows();
  const MatrixXd W = design.weight.asDiagonal() * design.B;
  const MatrixXd H = W * solution.inverse * W.transpose();
  MatrixXd M = MatrixXd::Zero(m, m);
  if (possible != nullptr) possible->assign(design.names.size(), true);
  for (std::size_t name = 0; name < design.names.size(); ++name) {
    std::vector<Index> rows;
    for (Index r = 0; r < m; ++r) {
      if (design.name_of_row[static_cast<std::size_t>(r)] == static_cast<int>(name)) rows.push_back(r);
    }
    // Residual of rows S when fitted without them: (E − H_SS)⁻¹ (y − H y)_S, exact for least squares.
    const MatrixXd I_H = MatrixXd::Identity(m, m)(rows, rows) - H(rows, rows);
    const Eigensystem e = eigensystem_of(I_H);
    if (e.values[0] < 1e-9) {
      if (possible != nullptr) (*possible)[name] = false;
      continue;
    }
    const MatrixXd all = MatrixXd::Identity(m, m) - H;
    const MatrixXd part = least_squares(I_H, all(rows, Eigen::all));
    for (std::size_t r = 0; r < rows.size(); ++r) {
      // From weighted residuals to metres.
      M.row(rows[r]) = part.row(static_cast<Index>(r)) * design.weight.asDiagonal() *
                       (design.scale[rows[r]] / design.weight[rows[r]]);
    }
  }
  return M;
}

bool StiffnessEstimate::has_stiffness() const {
  return determined && std::isfinite(stiffness) && std::isfinite(stiffness_high);
}

StiffnessFit fit_stiffness(const model::Kinematics& kinematics, const std::vector<LoadedPose>& poses,
                           const StiffnessOptions& options, double length) {
  const int n = kinematics.num_joints();
  const auto groups = groups_of(options, n);
  const auto p = static_cast<Index>(groups.size());
  StiffnessFit fit;

  Design design = stiffness_design(kinematics, poses, options, {}, length);
  const Index m = design.B.rows();
  fit.readings = static_cast<int>(m);
  fit.unknowns = static_cast<int>(design.B.cols());
  if (m < design.B.cols()) {
    throw NotIdentifiableError(
        fmt::format("{} different readings for {} unknowns ({} compliances{}); expected at least as many "
                    "readings as unknowns, better "
                    "three times as many; repeats of a pose do not count; measure more poses or directions, "
                    "or let joints with "
                    "gears of one size share one compliance (--groups)",
                    m, design.B.cols(), p,
                    options.extra.cols() > 0 ? " and what else may have moved the instrument" : ""));
  }
  Solution solution = solve(design);

  const auto compliance_of_joints = [&] {
    VectorXd x = VectorXd::Zero(n);
    for (Index g = 0; g < p; ++g) {
      for (const int j : groups[static_cast<std::size_t>(g)]) x[j] = std::max(0.0, solution.x[g]);
    }
    return x;
  };
  if (options.complementary) {
    constexpr int kMost = 30;
    for (fit.iterations = 1; fit.iterations <= kMost; ++fit.iterations) {
      const VectorXd before = solution.x;
      design = stiffness_design(kinematics, poses, options, compliance_of_joints(), length);
      solution = solve(design);
      if ((solution.x - before).norm() <= 1e-12 * solution.x.norm()) break;
    }
    if (fit.iterations > kMost) {
      throw NotIdentifiableError(
          fmt::format("the fit with the complementary stiffness did not settle in {} rounds: the arm "
                      "deflects so far under the load that the measured poses change with it; load it less "
                      "or leave --complementary out",
                      kMost));
    }
  }
  if (std::none_of(solution.determined.begin(), solution.determined.begin() + static_cast<std::ptrdiff_t>(p),
                   [](bool d) { return d; })) {
    std::string list;
    for (const auto& joints : groups) {
      list += fmt::format("; {}: {}", host::joints_in_words(joints), why_open(poses, joints));
    }
    throw NotIdentifiableError("these readings do not determine any compliance" + list);
  }

  fit.prediction = design.B * solution.x;
  fit.residual = design.y - fit.prediction;
  const VectorXd scaled = fit.residual.cwiseProduct(design.scale);
  fit.fit_rms = std::sqrt(scaled.squaredNorm() / static_cast<double>(m));
  fit.stated_noise = design.stated_noise;
  fit.condition = solution.condition;

  // Variance of a weighted residual: 1 when the deviations are stated, else what is left. Residuals larger than stated
  // (three standard deviations of χ²) widen the intervals as well.
  const auto freedom = static_cast<int>(m) - solution.rank;
  const double square = fit.residual.cwiseProduct(design.weight).squaredNorm();
  double variance = 1.0, factor = 1.959964;
  if (!design.stated_noise || square > freedom + 3.0 * std::sqrt(2.0 * std::max(freedom, 1))) {
    variance = freedom > 0 ? square / freedom : kNaN;
    factor = freedom > 0 ? statistics::interval_factor(freedom) : kNaN;
  }
  fit.joints.assign(static_cast<std::size_t>(n), {});
  for (int j = 0; j < n; ++j) {
    StiffnessEstimate& joint = fit.joints[static_cast<std::size_t>(j)];
    joint.compliance = joint.deviation = joint.compliance_low = joint.compliance_high = kNaN;
    joint.stiffness = joint.stiffness_low = joint.stiffness_high = kNaN;
    joint.why = "taken as rigid";
  }
  for (Index g = 0; g < p; ++g) {
    const std::vector<int>& members = groups[static_cast<std::size_t>(g)];
    for (const int j : members) {
      StiffnessEstimate& joint = fit.joints[static_cast<std::size_t>(j)];
      joint.group = static_cast<int>(g);
      joint.determined = solution.determined[static_cast<std::size_t>(g)];
      joint.why.clear();
      if (!joint.determined) {
        joint.why = why_open(poses, members);
        continue;
      }
      joint.compliance = solution.x[g];
      joint.deviation = std::sqrt(variance * solution.inverse(g, g));
      joint.compliance_low = joint.compliance - factor * joint.deviation;
      joint.compliance_high = joint.compliance + factor * joint.deviation;
      if (joint.compliance_high < 0.0) {
        joint.why =
            "a negative compliance, which no spring has: load, direction or sign of the readings is not as "
            "stated";
        continue;
      }
      joint.stiffness = joint.compliance > 0.0 ? 1.0 / joint.compliance : kInfinity;
      joint.stiffness_low = 1.0 / joint.compliance_high;
      joint.stiffness_high = joint.compliance_low > 0.0 ? 1.0 / joint.compliance_low : kInfinity;
    }
  }
  fit.extra = solution.x.tail(options.extra.cols());
  fit.extra_deviation = (variance * solution.inverse.diagonal().tail(options.extra.cols())).cwiseSqrt();

  // Influence: leave out all poses of one name.
  std::vector<bool> possible;
  const MatrixXd M = left_out_operator(design, solution, &possible);
  const VectorXd left_out = M * design.y;
  bool all_possible = true;
  double pooled = 0.0;
  int pooled_count = 0;
  for (std::size_t name = 0; name < design.names.size(); ++name) {
    PoseInfluence influence;
    influence.name = design.names[name];
    Design others = design;
    double residual = 0.0, error = 0.0;
    int count = 0;
    for (Index r = 0; r < m; ++r) {
      if (design.name_of_row[static_cast<std::size_t>(r)] != static_cast<int>(name)) continue;
      others.weight[r] = 0.0;
      residual += scaled[r] * scaled[r];
      error += left_out[r] * left_out[r];
      ++count;
    }
    influence.residual = std::sqrt(residual / count);
    influence.left_out = possible[name] ? std::sqrt(error / count) : kInfinity;
    const Solution without = solve(others);
    influence.shift = without.rank < solution.rank ? kInfinity : 0.0;
    for (Index g = 0; g < p && std::isfinite(influence.shift); ++g) {
      const double deviation = std::sqrt(variance * solution.inverse(g, g));
      if (solution.determined[static_cast<std::size_t>(g)] && deviation > 0.0) {
        influence.shift = std::max(influence.shift, std::abs(without.x[g] - solution.x[g]) / deviation);
      }
    }
    all_possible = all_possible && possible[name];
    for (const LoadedPose& pose : poses) {
      if (pose.name != influence.name) continue;
      influence.dexterity = pose.dexterity;
      for (Index r = 0; r < pose.values.size(); ++r) {
        if (!std::isfinite(pose.scatter[r])) continue;
        const double scale = is_rotation(pose, r) ? length : 1.0;
        pooled += std::pow(scale * pose.scatter[r], 2) / pose.repeats;
        ++pooled_count;
      }
    }
    fit.poses.push_back(influence);
  }
  fit.left_out_rms = all_possible ? std::sqrt(left_out.squaredNorm() / static_cast<double>(m)) : kInfinity;
  fit.repeatability = pooled_count > 0 ? std::sqrt(pooled / pooled_count) : kNaN;
  return fit;
}

DirectStiffness direct_stiffness(const std::vector<LoadedPose>& poses, bool missing_is_zero) {
  // What was read at one pose under one load belongs together, whichever point it was read at.
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
  DirectStiffness result;
  std::vector<VectorXd> torques, angles;
  for (const LoadedPose& pose : whole) {
    if (pose.dexterity < kSingularDexterity) {
      result.refused.emplace_back(pose.name, "singular pose: J has no inverse there");
      continue;
    }
    // In axes of the tool, where "not read" means something to who measured.
    MatrixXd rows = pose.rows;
    rows.leftCols(3) = pose.rows.leftCols(3) * pose.tool.rotation;
    rows.rightCols(3) = pose.rows.rightCols(3) * pose.tool.rotation;
    const VectorXd s = singular_values(rows.transpose() * rows);
    const auto rank = (s.array() > 1e-9 * s[0]).count();
    if (rank < 6 && !missing_is_zero) {
      result.refused.emplace_back(
          pose.name,
          fmt::format("{} of 6 components of the deflection were read; the method needs all", rank));
      continue;
    }
    // The smallest δd that the readings allow: what they do not see is zero (118).
    const Eigensystem e = eigensystem_of(rows.transpose() * rows);
    VectorXd in_tool = VectorXd::Zero(6);
    for (Index k = 0; k < 6; ++k) {
      const VectorXd v = e.vectors.col(k);
      if (e.values[k] > 1e-9 * e.values[5])
        in_tool += v * v.dot(rows.transpose() * pose.values) / e.values[k];
    }
    VectorXd twist(6);
    twist << pose.tool.rotation * in_tool.head(3), pose.tool.rotation * in_tool.tail(3);
    result.poses.push_back(pose.name);
    torques.push_back(pose.J.transpose() * pose.wrench);
    angles.push_back(least_squares(pose.J, twist));
  }
  if (result.poses.empty()) {
    std::map<std::string, std::vector<std::string>> poses_of;
    for (const auto& [pose, why] : result.refused) poses_of[why].push_back(pose);
    std::string list;
    for (const auto& [why, names] : poses_of) {
      list += fmt::format("; {} {}: {}", names.size() == 1 ? "pose" : "poses", fmt::join(names, ", "), why);
    }
    throw NotIdentifiableError("δθ = J⁻¹ δd can be formed at none of the poses" + list +
                               "; measure whole deflections (dx dy dz rx ry rz) away from singular poses");
  }
  const auto count = static_cast<Index>(result.poses.size());
  const Index n = torques.front().size();
  result.torque.resize(count, n);
  result.deflection.resize(count, n);
  for (Index k = 0; k < count; ++k) {
    result.torque.row(k) = torques[static_cast<std::size_t>(k)];
    result.deflection.row(k) = angles[static_cast<std::size_t>(k)];
  }
  result.stiffness = result.torque.cwiseQuotient(result.deflection);
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
  return result;
}

}  // namespace heft::stiffness
