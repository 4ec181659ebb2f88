/// @file
/// A column that the simulator adds to its log.
#pragma once

#include <stdexcept>
#include <string>

#include <Eigen/Core>

#include "heft/data/log.hpp"

namespace heft::sim {

/// @throws std::runtime_error without such a column
inline const Eigen::VectorXd& extra(const data::Log& log, const std::string& name) {
  for (const auto& [column, values] : log.extra) {
    if (column == name) return values;
  }
  throw std::runtime_error("no column " + name);
}

}  // namespace heft::sim
