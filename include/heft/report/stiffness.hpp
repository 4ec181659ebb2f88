/// @file
/// Stiffnesses of joints in words, JSON and pages.
#pragma once

#include <string>
#include <vector>

#include "heft/data/log.hpp"
#include "heft/page/page.hpp"
#include "heft/stiffness/stiffness.hpp"

namespace heft::report {

/// A stiffness and what it means for the tool.
struct StiffnessReport {
  stiffness::Stiffness stiffness;
  stiffness::ToolUse tool{};
  data::Log path{};               ///< whose positions the tool was to follow; without samples: none
  std::vector<data::Log> logs{};  ///< that encoders were read from, for the page's plots
};

/// One sentence.
std::string brief(const stiffness::Stiffness& stiffness);
/// What to write into a model file as notes.
std::vector<std::string> notes(const stiffness::Stiffness& stiffness);
/// What `heft stiffness` prints.
std::string full(const StiffnessReport& report);
/// The fields that `heft stiffness --json` writes.
std::string json(const StiffnessReport& report);
page::Page page(const StiffnessReport& report);

std::string brief(const stiffness::MeasurementPlan& plan);
std::string full(const stiffness::MeasurementPlan& plan);
std::string json(const stiffness::MeasurementPlan& plan);
page::Page page(const stiffness::MeasurementPlan& plan);

}  // namespace heft::report
