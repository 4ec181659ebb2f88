#include "heft/model/physical_links.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/host/parallel.hpp"
#include "heft/model/batch_dynamics.hpp"

namespace heft::model {

using Eigen::Matrix4d;
using Eigen::MatrixXd;
using Eigen::VectorXd;

Matrix4d pseudo_inertia_matrix(const InertialParameters<double>& link) {
  const PseudoInertia<double> s = to_pseudo_inertia(link);
  Matrix4d P;
  P << s[kS11], s[kS12], s[kS13], s[kPhx],  //
      s[kS12], s[kS22], s[kS23], s[kPhy],   //
      s[kS13], s[kS23], s[kS33], s[kPhz],   //
      s[kPhx], s[kPhy], s[kPhz], s[kPm];
  return P;
}

InertialParameters<double> link_with(const Matrix4d& P) {
  return to_inertial_parameters(PseudoInertia<double>{P(3, 3), P(0, 3), P(1, 3), P(2, 3), P(0, 0), P(0, 1),
                                                      P(1, 1), P(0, 2), P(1, 2), P(2, 2)});
}

bool is_physical(const InertialParameters<double>& link) {
  const Matrix4d P = pseudo_inertia_matrix(link);
  if (!P.allFinite() || !(P.diagonal().array() > 0.0).all()) return false;
  // Scaled to a diagonal of ones the answer does not depend on the unit of length.
  const Eigen::Vector4d scale = P.diagonal().cwiseSqrt().cwiseInverse();
  const Matrix4d scaled = scale.asDiagonal() * P * scale.asDiagonal();
  return eigenvalues_of(scaled)[0] > 1e-13;
}

bool has_physical_links(const Robot& robot) {
  return std::all_of(robot.joints.begin(), robot.joints.end(),
                     [](const RobotJoint& joint) { return is_physical(joint.link); });
}

bool is_physically_consistent(const Robot& robot) {
  return has_physical_links(robot) &&
         std::all_of(robot.joints.begin(), robot.joints.end(), [](const RobotJoint& joint) {
           return joint.actuation.rotor_inertia >= 0.0 && joint.actuation.coulomb_friction >= 0.0 &&
                  joint.actuation.viscous_friction >= 0.0;
         });
}

InertialParameters<double> nearest_physical(const InertialParameters<double>& link, double margin) {
  const Matrix4d P = pseudo_inertia_matrix(link);
  if (!P.allFinite()) throw ModelError("nearest physical link: the parameters are not finite numbers");
  const Eigensystem eigen = eigensystem_of(P);
  const double least = margin * std::max(P.trace(), 1.0);
  if (eigen.values[0] >= least) return link;
  return link_with(eigen.vectors * eigen.values.cwiseMax(least).asDiagonal() * eigen.vectors.transpose());
}

MassMatrixCheck check_mass_matrix(const Robot& robot, int poses, std::uint64_t seed) {
  const BatchDynamics dynamics(robot);
  const Eigen::Index n = robot.num_joints();
  MatrixXd rotors = MatrixXd::Zero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    rotors(i, i) = robot.joints[static_cast<std::size_t>(i)].actuation.rotor_inertia;
  }
  // A shared motor with inertia I that turns with q_j + r q_i.
  for (const auto& coupling : robot.couplings) {
    VectorXd turn = VectorXd::Zero(n);
    turn[coupling.driven] = 1.0;
    turn[coupling.driving] = coupling.ratio;
    rotors += coupling.rotor_inertia * turn * turn.transpose();
  }

  std::mt19937_64 generator(seed);
  MatrixXd q(poses, n);
  for (Eigen::Index pose = 0; pose < poses; ++pose) {
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto& joint = robot.joints[static_cast<std::size_t>(i)];
      const double share = std::generate_canonical<double, 53>(generator);
      if (joint.joint.type == JointType::kRevolute) {
        q(pose, i) = std::numbers::pi * (2.0 * share - 1.0);
      } else {
        const double lower = std::isfinite(joint.lower) ? joint.lower : -1.0;
        const double upper = std::isfinite(joint.upper) ? joint.upper : 1.0;
        q(pose, i) = lower + share * (upper - lower);
      }
    }
  }
  // What is positive stays so with more.
  const bool rotors_add = eigenvalues_of(rotors)[0] >= 0.0;
  const auto smallest_of = [](const MatrixXd& M) { return eigenvalues_of(M)[0]; };
  VectorXd smallest(poses);
  std::vector<char> positive_with_rotors(static_cast<std::size_t>(poses), 1);
  constexpr Eigen::Index kPart = 500;
  host::for_each_parallel(static_cast<std::size_t>((poses + kPart - 1) / kPart), [&](std::size_t part) {
    const Eigen::Index first = static_cast<Eigen::Index>(part) * kPart, count = std::min(kPart, poses - first);
    MatrixXd masses(count, n * n);
    dynamics.mass_matrix(q.middleRows(first, count), masses);
    for (Eigen::Index k = 0; k < count; ++k) {
      const VectorXd columns = masses.row(k);
      const MatrixXd M = Eigen::Map<const MatrixXd>(columns.data(), n, n);
      const double value = smallest[first + k] = smallest_of(M);
      if (!(value > 0.0 && rotors_add))
        positive_with_rotors[static_cast<std::size_t>(first + k)] = smallest_of(M + rotors) > 0.0 ? 1 : 0;
    }
  });
  MassMatrixCheck check;
  check.poses = poses;
  check.smallest_eigenvalue = std::numeric_limits<double>::infinity();
  for (Eigen::Index pose = 0; pose < poses; ++pose) {
    if (!(smallest[pose] > 0.0)) ++check.not_positive;
    if (positive_with_rotors[static_cast<std::size_t>(pose)] == 0) ++check.not_positive_with_rotors;
    if (smallest[pose] < check.smallest_eigenvalue || check.worst_pose.size() == 0) {
      check.smallest_eigenvalue = smallest[pose];
      check.worst_pose = q.row(pose);
    }
  }
  return check;
}

}  // namespace heft::model
