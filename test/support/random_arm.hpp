/// @file
/// Random arms and states for property tests; local generators, so that a failing seed can be run again.
#pragma once

#include <array>
#include <random>

#include <Eigen/Dense>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/arm_model.hpp"
#include "heft/core/denavit_hartenberg.hpp"

namespace heft::test {

using Random = std::mt19937_64;

inline double uniform(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

template <int N>
JointVector<double, N> random_vector(Random& random, double size) {
  JointVector<double, N> v;
  for (int i = 0; i < N; ++i) {
    v[i] = uniform(random, -size, size);
  }
  return v;
}

/// Random unit vector.
inline Eigen::Vector3d random_direction(Random& random) {
  std::normal_distribution<double> normal;
  const double x = normal(random), y = normal(random), z = normal(random);
  return Eigen::Vector3d(x, y, z).normalized();
}

/// A physical body: positive mass, inertia of a solid (triangle inequality holds).
inline InertialParameters<double> random_body(Random& random) {
  const double mass = uniform(random, 0.5, 5.0);
  const Eigen::Vector3d com(uniform(random, -0.2, 0.2), uniform(random, -0.2, 0.2),
                            uniform(random, -0.2, 0.2));
  const Eigen::Quaterniond turn =
      Eigen::Quaterniond(Eigen::AngleAxisd(uniform(random, 0, 3), random_direction(random)));
  const Eigen::Vector3d second(uniform(random, 0.001, 0.03), uniform(random, 0.001, 0.03),
                               uniform(random, 0.001, 0.03));
  const Eigen::Matrix3d R = turn.toRotationMatrix();
  const Eigen::Matrix3d sigma = mass * (R * second.asDiagonal() * R.transpose());
  const Eigen::Matrix3d I = sigma.trace() * Eigen::Matrix3d::Identity() - sigma;
  return make_inertial_parameters<double>(mass, {com[0], com[1], com[2]},
                                          {I(0, 0), I(0, 1), I(1, 1), I(0, 2), I(1, 2), I(2, 2)});
}

/// A random arm with general placements and axes; a joint is prismatic with the given probability.
template <int N>
ArmModel<double, N> random_arm(Random& random, double prismatic_share) {
  ArmModel<double, N> arm;
  for (std::size_t j = 0; j < N; ++j) {
    auto& joint = arm.joints[j];
    joint.type = uniform(random, 0, 1) < prismatic_share ? JointType::kPrismatic : JointType::kRevolute;
    const Eigen::Matrix3d R =
        Eigen::AngleAxisd(uniform(random, -3, 3), random_direction(random)).toRotationMatrix();
    const Eigen::Vector3d axis = random_direction(random);
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        joint.rotation[static_cast<std::size_t>(3 * r + c)] = R(r, c);
      }
      joint.position[static_cast<std::size_t>(r)] = uniform(random, -0.5, 0.5);
      joint.axis[static_cast<std::size_t>(r)] = axis[r];
    }
    arm.links[j] = random_body(random);
    arm.actuation[j] = {uniform(random, 0, 0.5), uniform(random, 0, 5), uniform(random, 0, 5),
                        uniform(random, -1, 1)};
  }
  const Eigen::Vector3d g = 9.81 * random_direction(random);
  arm.gravity = {g[0], g[1], g[2]};
  return arm;
}

/// All ten-vectors of an arm in one column.
template <int N>
Eigen::Matrix<double, 10 * N, 1> stacked_links(const ArmModel<double, N>& arm) {
  Eigen::Matrix<double, 10 * N, 1> x;
  for (int j = 0; j < N; ++j) {
    for (int k = 0; k < 10; ++k) {
      x[10 * j + k] = arm.links[static_cast<std::size_t>(j)][static_cast<std::size_t>(k)];
    }
  }
  return x;
}

}  // namespace heft::test
