/// @file
/// Stiffnesses of joints in words, JSON and pages.
#pragma once

#include <string>
#include <vector>

#include "heft/data/log.hpp"
#include "heft/diagnose/diagnose.hpp"
#include "heft/host/verdict.hpp"
#include "heft/model/model_file.hpp"
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
/// The stiffness as a model file, with what was found as its notes.
model::ModelFile model_file(const stiffness::Stiffness& stiffness);
/// What `heft stiffness` prints.
std::string full(const StiffnessReport& report);
/// The fields that `heft stiffness --json` writes.
std::string json(const StiffnessReport& report);
page::Page page(const StiffnessReport& report);
/// Why readings determine no stiffness, and what to measure.
/// @param not_written  model file that was asked for; may be empty
std::string why_none(const stiffness::Stiffness& stiffness, const std::string& not_written);

std::string brief(const stiffness::MeasurementPlan& plan);
std::string full(const stiffness::MeasurementPlan& plan);
std::string json(const stiffness::MeasurementPlan& plan);
page::Page page(const stiffness::MeasurementPlan& plan);

/// Elastic joints among the effects of a diagnosis: what encoders and torque of the motor's side alone show.
struct MotorSideReport {
  diagnose::Diagnosis diagnosis;
  stiffness::Stiffness stiffness;  ///< of the arm with all effects, with the logs fitted to
  host::Judgement torque;          ///< what is known against the torque of the logs
  std::vector<data::Log> logs{};   ///< fitted to, for the page's lines
};

/// Why there is none, and what to record.
std::string why_none(const diagnose::Diagnosis& diagnosis);
std::string brief(const MotorSideReport& report);
std::string full(const MotorSideReport& report);
std::string json(const MotorSideReport& report);
page::Page page(const MotorSideReport& report);
/// The elastic joints as a model file, with the sentence as its note.
model::ModelFile model_file(const MotorSideReport& report);

}  // namespace heft::report
