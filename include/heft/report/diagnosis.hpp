/// @file
/// What a diagnosis found: as one sentence, as text, as JSON and as a page.
#pragma once

#include <string>
#include <vector>

#include "heft/diagnose/diagnose.hpp"
#include "heft/host/verdict.hpp"
#include "heft/model/model_file.hpp"
#include "heft/page/page.hpp"

namespace heft::report {

/// Context of a diagnosis: everything but its result.
struct DiagnosisContext {
  std::vector<std::string> train, validate;  ///< paths of the logs
  std::string torque_at{"motor"};
  std::string command;       ///< line that gives the same result; may be empty
  host::Judgement torque{};  ///< of the logs' torque, held against the robot
};

/// The answer: what is missing and what it is worth, that nothing is missing, or that something is left.
std::string brief(const diagnose::Diagnosis& diagnosis);
/// All of it for a terminal, as `heft diagnose` prints it.
std::string full(const diagnose::Diagnosis& diagnosis, const DiagnosisContext& context = {});
/// One JSON object; its fields are described in tools/README.md.
std::string json(const diagnose::Diagnosis& diagnosis, const DiagnosisContext& context = {});
/// Verdict, ranking, residuals of the joints that are worth a look, errors before and after, refusals.
page::Page page(const diagnose::Diagnosis& diagnosis, const DiagnosisContext& context = {});
/// The diagnosis as a model file, with its notes: the answer, each effect, what else was noticed.
model::ModelFile model_file(const diagnose::Diagnosis& diagnosis);

}  // namespace heft::report
