/// @file
/// An answer of a facade in the words of report.
#pragma once

#include <memory>

#include "binding.hpp"
#include "heft/report/fleet.hpp"
#include "heft/report/identification.hpp"
#include "heft/report/motion.hpp"
#include "heft/report/simulation.hpp"
#include "heft/report/validation.hpp"

namespace heft::python {

/// The four verbs of an answer.
template <typename Value>
Answer answer_of(const char* kind, std::shared_ptr<const Value> value) {
  Answer answer;
  answer.kind = kind;
  answer.brief = [value] { return report::brief(*value); };
  answer.full = [value] { return report::full(*value); };
  answer.json = [value] { return report::json(*value); };
  answer.page = [value] { return report::page(*value); };
  if constexpr (requires { value->judgement; }) answer.judgement = value->judgement;
  if constexpr (requires { value->notes.size(); }) answer.notes = value->notes;
  if constexpr (requires { value->model_file(); }) answer.model_file = [value] { return value->model_file(); };
  return answer;
}

}  // namespace heft::python
