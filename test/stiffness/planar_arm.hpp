/// @file
/// An arm whose compliance, dexterity and reach are known in closed form.
#pragma once

#include <algorithm>
#include <initializer_list>
#include <vector>

#include <Eigen/Core>

#include "heft/model/kinematics.hpp"

namespace heft::stiffness {

/// Links along x, joints about z.
inline model::Robot planar_arm(const std::vector<double>& lengths) {
  std::vector<DenavitHartenberg<double>> table;
  for (const double length : lengths) table.push_back({length, 0, 0, 1});
  return model::make_standard_dh_robot("planar", table);
}

inline Eigen::VectorXd vector(std::initializer_list<double> values) {
  Eigen::VectorXd v(static_cast<Eigen::Index>(values.size()));
  std::copy(values.begin(), values.end(), v.begin());
  return v;
}

}  // namespace heft::stiffness
