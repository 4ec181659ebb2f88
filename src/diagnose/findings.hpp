/// @file
/// What a search found, and what is left.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "search.hpp"

namespace heft::diagnose {

/// The accepted effects with their evidence, strongest first.
/// @param without_each  of reject_overfitted()
std::vector<Finding> findings_of(Search& search,
                                 const std::vector<std::vector<Eigen::VectorXd>>& without_each);

/// Structure above noise in the residuals of joints that the model explains.
std::vector<Unexplained> unexplained_of(const Search& search);

}  // namespace heft::diagnose
