#include "physical_problem.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include <Eigen/Cholesky>

#include "heft/core/inertia.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/model/physical_links.hpp"

namespace heft::identify {

using Eigen::Matrix4d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

constexpr double kSqrt2 = 1.4142135623730951;

/// Entries of a symmetric 4 × 4 matrix in the order used here, row ≤ column.
constexpr std::array<std::array<int, 2>, 10> kEntry{
    {{0, 0}, {1, 1}, {2, 2}, {3, 3}, {0, 1}, {0, 2}, {1, 2}, {0, 3}, {1, 3}, {2, 3}}};

/// A rod from the joint to the next one: what a link is when nothing is known of it.
Matrix4d plausible_body(double mass, const Vector3d& center, const Vector3d& extent, double least_length) {
  const double length = std::max(extent.norm(), least_length);
  const double radius = 0.25 * length;
  Matrix4d P = Matrix4d::Zero();
  // Σ = m (c cᵀ + d dᵀ / 12 + ¼ r² E): rod along d, as thick in every direction as a cylinder of radius r.
  P.topLeftCorner<3, 3>() = mass * (center * center.transpose() + extent * extent.transpose() / 12.0 +
                                    0.25 * radius * radius * Eigen::Matrix3d::Identity());
  P.topRightCorner<3, 1>() = mass * center;
  P.bottomLeftCorner<1, 3>() = mass * center.transpose();
  P(3, 3) = mass;
  return P;
}

/// Priors of the links that can be used: positive definite and not extremely thin.
std::vector<Matrix4d> usable_priors(const regression::RegressionColumns& columns, const VectorXd& prior,
                                    std::vector<int>& repaired) {
  const model::Robot& robot = columns.robot();
  const std::size_t n = robot.joints.size();
  std::vector<InertialParameters<double>> links(n);
  std::vector<Vector3d> extents(n);
  std::vector<double> masses;
  double longest = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < 10; ++k) links[i][k] = prior[static_cast<Eigen::Index>(10 * i + k)];
    const auto& next = i + 1 < n ? robot.joints[i + 1].joint.position : robot.tip_position;
    extents[i] = Vector3d(next[0], next[1], next[2]);
    longest = std::max(longest, extents[i].norm());
    if (links[i][kMass] > 0.0) masses.push_back(links[i][kMass]);
  }
  if (longest == 0.0) longest = 0.3;
  double typical_mass = 1.0;
  if (!masses.empty()) {
    const auto middle = masses.begin() + static_cast<std::ptrdiff_t>(masses.size() / 2);
    std::nth_element(masses.begin(), middle, masses.end());
    typical_mass = *middle;
  }

  std::vector<Matrix4d> priors(n);
  for (std::size_t i = 0; i < n; ++i) {
    if (!model::is_physical(links[i])) repaired.push_back(static_cast<int>(i) + 1);
    const double mass = links[i][kMass];
    if (mass <= 0.0) {
      priors[i] = plausible_body(typical_mass, 0.5 * extents[i], extents[i], 0.3 * longest);
      continue;
    }
    // Second moments that are too small (or negative) are lifted to a hundredth of those of a rod with the same
    // mass and centre: a prior of a point mass would forbid any inertia.
    const Vector3d center = Vector3d(links[i][kMcx], links[i][kMcy], links[i][kMcz]) / mass;
    const Matrix4d body = plausible_body(mass, center, extents[i], 0.3 * longest);
    const Matrix4d root = body.llt().matrixL();
    const auto lower = root.triangularView<Eigen::Lower>();
    const Matrix4d half = lower.solve(model::pseudo_inertia_matrix(links[i]));
    const Matrix4d relative = lower.solve(half.transpose());
    const Eigensystem eigen = eigensystem_of(0.5 * (relative + relative.transpose()));
    const Matrix4d lifted =
        eigen.vectors * eigen.values.cwiseMax(0.01).asDiagonal() * eigen.vectors.transpose();
    priors[i] = eigen.values[0] < 0.01 ? Matrix4d(root * lifted * root.transpose())
                                       : model::pseudo_inertia_matrix(links[i]);
  }
  return priors;
}

/// How much of each column explains the data best: least squares with least values, by cyclic descent. Rough is
/// enough, it only sets units.
VectorXd rough_sizes(const MatrixXd& columns, const VectorXd& z, const VectorXd& start,
                     const VectorXd& least) {
  constexpr double kPull = 1e-3;
  VectorXd size = start.cwiseMax(least);
  VectorXd left = z - columns * size;
  for (int sweep = 0; sweep < 200; ++sweep) {
    for (Eigen::Index k = 0; k < size.size(); ++k) {
      const double curvature = columns.col(k).squaredNorm();
      if (!(curvature > 0.0)) continue;
      const double step =
          (columns.col(k).dot(left) / curvature + kPull * (start[k] - size[k])) / (1.0 + kPull);
      const double next = std::max(size[k] + step, least[k]);
      left -= columns.col(k) * (next - size[k]);
      size[k] = next;
    }
  }
  return size;
}

/// What the whole of each link (as a factor on its prior), and each other parameter, is about. n + number of others.
VectorXd sizes_of(const regression::RegressionColumns& columns, const MatrixXd& W, const VectorXd& z,
                  const std::vector<Matrix4d>& priors, const VectorXd& prior) {
  const int n = columns.num_joints(), p = columns.count();
  MatrixXd whole(W.rows(), p - 9 * n);
  VectorXd start = VectorXd::Zero(p - 9 * n), least = start;
  for (int i = 0; i < n; ++i) {
    const InertialParameters<double> link = model::link_with(priors[static_cast<std::size_t>(i)]);
    whole.col(i) = W.middleCols<10>(10 * i) * Eigen::Map<const Vector10>(link.data());
    start[i] = 1.0;
    least[i] = 0.1;
  }
  for (int k = 10 * n; k < p; ++k) {
    whole.col(k - 9 * n) = W.col(k);
    start[k - 9 * n] = prior[k];
    least[k - 9 * n] =
        columns[k].kind == regression::ColumnKind::kOffset ? -std::numeric_limits<double>::infinity() : 0.0;
  }
  return rough_sizes(whole, z, start, least);
}

/// A link of the problem: P = L (ε E + (1 − ε) S) Lᵀ.
void add_link(int i, const Matrix4d& prior, double margin, PhysicalProblem& problem) {
  const Matrix4d L = prior.llt().matrixL();
  const InertialParameters<double> edge = model::link_with(margin * prior);
  problem.x0.segment<10>(10 * i) = Eigen::Map<const Vector10>(edge.data());
  for (int k = 0; k < 10; ++k) {
    const Matrix4d E = to_symmetric(Vector10::Unit(k));
    const InertialParameters<double> column = model::link_with((1.0 - margin) * (L * E * L.transpose()));
    problem.T.block<10, 1>(10 * i, 10 * i + k) = Eigen::Map<const Vector10>(column.data());
  }
  problem.blocks.push_back({Unknown::kLink, 10 * i, 10, i});
  problem.degree += 4.0;
}

/// Friction, offset or rotor inertia, the k-th parameter.
/// @param unit  what the data give it
void add_number(int k, bool free, double prior, double unit, PhysicalProblem& problem) {
  if (free) {
    problem.x0[k] = prior;
    problem.T(k, k) = unit;
    problem.blocks.push_back({Unknown::kFree, k, 1});
  } else {
    problem.T(k, k) = prior > 0.1 * unit ? prior : unit;
    problem.blocks.push_back({Unknown::kPositive, k, 1});
    problem.degree += 1.0;
  }
}

}  // namespace

Vector10 to_vector(const Matrix4d& S) {
  Vector10 s;
  for (int k = 0; k < 10; ++k) {
    const auto [i, j] = kEntry[static_cast<std::size_t>(k)];
    s[k] = i == j ? S(i, i) : kSqrt2 * S(i, j);
  }
  return s;
}

Matrix4d to_symmetric(const Eigen::Ref<const Vector10>& s) {
  Matrix4d S;
  for (int k = 0; k < 10; ++k) {
    const auto [i, j] = kEntry[static_cast<std::size_t>(k)];
    S(i, j) = i == j ? s[k] : s[k] / kSqrt2;
    S(j, i) = S(i, j);
  }
  return S;
}

PhysicalProblem make_problem(const regression::RegressionColumns& columns,
                             const regression::BaseParameters& base, const regression::TriangularFactor& data,
                             const VectorXd& prior, double margin, PriorChanges& changes) {
  const int n = columns.num_joints(), p = columns.count();
  const MatrixXd W = data.R() * base.regrouping;
  const VectorXd z = data.z();
  std::vector<Matrix4d> priors = usable_priors(columns, prior, changes.repaired);
  const VectorXd sizes = sizes_of(columns, W, z, priors, prior);
  for (int i = 0; i < n; ++i) {
    // From a prior that is far too light the way would be long.
    if (!(sizes[i] > 10.0)) continue;
    priors[static_cast<std::size_t>(i)] *= sizes[i];
    changes.rescaled.push_back(i + 1);
  }

  PhysicalProblem problem;
  problem.x0 = VectorXd::Zero(p);
  problem.T = MatrixXd::Zero(p, p);
  for (int i = 0; i < n; ++i) add_link(i, priors[static_cast<std::size_t>(i)], margin, problem);
  for (int k = 10 * n; k < p; ++k) {
    // In units of what the data give it, at least a hundredth of what would explain the whole torque.
    const double norm = W.col(k).norm();
    const double unit = norm > 0.0 ? std::max(std::abs(sizes[k - 9 * n]), 0.01 * z.norm() / norm) : 0.0;
    add_number(k, columns[k].kind == regression::ColumnKind::kOffset, prior[k], unit, problem);
  }
  problem.A = W * problem.T;
  problem.z = z - W * problem.x0;
  return problem;
}

PhysicalProblem part_of(const PhysicalProblem& whole, const std::vector<int>& columns) {
  PhysicalProblem part;
  part.x0 = whole.x0(columns);
  part.T = whole.T(columns, columns);
  for (PhysicalBlock block : whole.blocks) {
    const auto place = std::lower_bound(columns.begin(), columns.end(), block.first);
    if (place == columns.end() || *place != block.first) continue;
    block.first = static_cast<int>(place - columns.begin());
    part.blocks.push_back(block);
    part.degree += block.kind == Unknown::kLink ? 4.0 : block.kind == Unknown::kPositive ? 1.0 : 0.0;
  }
  return part;
}

}  // namespace heft::identify
