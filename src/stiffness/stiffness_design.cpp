#include "stiffness_design.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "heft/host/decompositions.hpp"
#include "heft/host/numbers.hpp"

namespace heft::stiffness {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

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

std::vector<std::vector<int>> groups_of(const StiffnessOptions& options, int n) {
  if (!options.groups.empty()) return options.groups;
  std::vector<std::vector<int>> own;
  for (int j = 0; j < n; ++j) own.push_back({j});
  return own;
}

bool is_rotation(const LoadedPose& pose, Index reading) {
  return pose.rows.row(reading).head<3>().isZero(0.0);
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

}  // namespace heft::stiffness
