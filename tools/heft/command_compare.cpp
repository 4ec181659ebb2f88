/// @file
/// heft compare: what changed between two models of one robot.
#include <memory>
#include <string>
#include <vector>

#include "command.hpp"
#include "console.hpp"
#include "heft/compare/compare.hpp"
#include "heft/host/error.hpp"
#include "heft/model/model_file.hpp"
#include "heft/report/comparison.hpp"
#include "options.hpp"

namespace heft::tools {
namespace {

struct CompareOptions {
  std::vector<std::string> models;
  ResultOptions result;
};

void run(const CompareOptions& options) {
  const Console console{options.result.json};
  const compare::Comparison comparison =
      compare::compare(model::read_model(options.models[0]), model::read_model(options.models[1]));
  console.print("{}", report::full(comparison));
  finish(console, "", options.result, report::json(comparison), report::page(comparison));
  if (!comparison.usable()) throw NotIdentifiableError(comparison.judgement.reasons.front());
}

}  // namespace

Action set_up_compare(CommandLine line) {
  auto options = std::make_shared<CompareOptions>();
  line.add_option("models", options->models,
                  "model before and model after, as heft identify or heft diagnose wrote them")
      .type_name("MODEL.json")
      .names_file(FileUse::kInput)
      .expected(2)
      .required();
  add_result_options(line, options->result);
  line.footer(
      "Parameters are compared where both models know them with an interval: friction, offsets, rotor inertias, base\n"
      "parameters of the links. What differs by more than both fits leave open is named, with the torque that it moves.\n"
      "Two different robots are refused.\n"
      "Example: heft compare january.json june.json --report changes.html");
  return [options] { run(*options); };
}

}  // namespace heft::tools
