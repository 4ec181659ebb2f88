/// @file
/// What a search found, and what is left.
#pragma once

#include <vector>

#include "search.hpp"
#include "written_model.hpp"

namespace heft::diagnose {

/// The accepted effects with their evidence, and values and errors as the written model has them, strongest first. A
/// rotor inertia or an offset that the given model had a value for is no finding.
std::vector<Finding> findings_of(Search& search, const WrittenModel& written);

/// Structure above noise in the residuals of joints that the model explains.
/// @param engine  the model whose residuals these are
std::vector<Unexplained> unexplained_of(const Search& search, const Engine& engine);

}  // namespace heft::diagnose
