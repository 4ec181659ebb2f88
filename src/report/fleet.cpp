#include "heft/report/fleet.hpp"

#include <algorithm>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "comparison_words.hpp"
#include "effect_words.hpp"
#include "host/json.hpp"
#include "page_lines.hpp"

namespace heft::report {
namespace {

using compare::Change;
using compare::Deviation;
using compare::FleetComparison;
using compare::FleetParameter;

constexpr std::size_t kMostSentences = 10;

/// "arm-17: joint 2: Coulomb friction 11.4 N·m, the others 8.1 N·m (+41 %), beyond what arms and fits allow (±1.2)".
std::string sentence(const Deviation& deviation) {
  const Change& change = deviation.change;
  const std::string share = percent(change);
  return fmt::format("{}: {}: {} {} {}, the others {} {}{}, beyond what arms and fits allow (±{})",
                     deviation.arm, place(change), quantity(change), short_number(change.after, 3),
                     change.unit, short_number(change.before, 3), change.unit,
                     share.empty() ? "" : " (" + share + ")",
                     short_number(change.difference.half_width(), 2));
}

page::Table deviation_table(const FleetComparison& fleet) {
  page::Table table({"arm", "parameter", "unit", "this arm", "the others", "difference", "low", "high"});
  for (const auto& [arm, change] : fleet.deviations) {
    table.add_row({arm, change.parameter, change.unit, page::number(change.after, 4),
                   page::number(change.before, 4), page::number(change.difference.value, 3),
                   page::number(change.difference.lower, 3), page::number(change.difference.upper, 3)});
  }
  return table;
}

page::Table parameter_table(const FleetComparison& fleet) {
  page::Table table({"parameter", "unit", "arms", "mean", "from arm to arm", "from the fits"});
  for (const FleetParameter& parameter : fleet.parameters) {
    table.add_row({parameter.about.parameter, parameter.about.unit, fmt::format("{}", parameter.arms),
                   page::number(parameter.mean, 4), page::number(parameter.scatter, 2),
                   page::number(parameter.uncertainty, 2)});
  }
  return table;
}

constexpr const char* kDeviationMeaning =
    "low and high: of the difference; all intervals of all arms together hold in 95 % of fleets without an odd arm";
constexpr const char* kParameterMeaning =
    "standard deviations: from arm to arm beyond what the fits leave open, and of the fit of one arm (median); arms "
    "that differ are left out";

}  // namespace

std::string brief(const FleetComparison& fleet) {
  if (fleet.deviations.empty()) {
    return fmt::format(
        "None of the {} arms differs from the others beyond what arms and fits allow ({} comparisons).",
        fleet.arms, fleet.comparisons);
  }
  std::string text;
  const std::size_t told = std::min(fleet.deviations.size(), kMostSentences);
  for (std::size_t k = 0; k < told; ++k) text += (k == 0 ? "" : "\n") + sentence(fleet.deviations[k]) + ".";
  if (fleet.deviations.size() > told) text += fmt::format("\nAnd {} more.", fleet.deviations.size() - told);
  return text;
}

std::string full(const FleetComparison& fleet) {
  std::string text = fmt::format("{}: {} arms\n{}\n{}", fleet.robot, fleet.arms, brief(fleet),
                                 verdict_text(fleet.judgement));
  if (!fleet.deviations.empty())
    text += fmt::format("\nWhat differs; {}\n{}", kDeviationMeaning, deviation_table(fleet).to_text(2));
  text += fmt::format("\nWhat the arms have in common; {}\n{}", kParameterMeaning,
                      parameter_table(fleet).to_text(2));
  for (const std::string& note : fleet.notes) text += "Note: " + note + "\n";
  return text;
}

std::string json(const FleetComparison& fleet) {
  nlohmann::ordered_json json{
      {"robot", fleet.robot}, {"arms", fleet.arms}, {"comparisons", fleet.comparisons}};
  put_verdict(json, fleet.judgement);
  json["summary"] = brief(fleet);
  json["odd_arms"] = fleet.odd_arms();
  json["deviations"] = nlohmann::ordered_json::array();
  for (const auto& [arm, change] : fleet.deviations) {
    json["deviations"].push_back({{"arm", arm},
                                  {"parameter", change.parameter},
                                  {"joint", change.joint + 1},
                                  {"kind", compare::to_string(change.kind)},
                                  {"unit", change.unit},
                                  {"value", change.after},
                                  {"others", change.before},
                                  {"low", host::number_or_null(change.difference.lower)},
                                  {"high", host::number_or_null(change.difference.upper)},
                                  {"p_value", host::number_or_null(change.p_value)}});
  }
  json["parameters"] = nlohmann::ordered_json::array();
  for (const FleetParameter& parameter : fleet.parameters) {
    json["parameters"].push_back({{"parameter", parameter.about.parameter},
                                  {"joint", parameter.about.joint + 1},
                                  {"kind", compare::to_string(parameter.about.kind)},
                                  {"unit", parameter.about.unit},
                                  {"arms", parameter.arms},
                                  {"mean", parameter.mean},
                                  {"scatter", parameter.scatter},
                                  {"uncertainty", parameter.uncertainty}});
  }
  json["notes"] = fleet.notes;
  return text_of(json);
}

page::Page page(const FleetComparison& fleet) {
  page::Page page =
      page::new_page(fmt::format("{}: {} arms", fleet.robot, fleet.arms), "which of them differ");
  page.verdict(brief(fleet), fleet.judgement);
  if (!fleet.deviations.empty())
    page.table(deviation_table(fleet), std::string("What differs; ") + kDeviationMeaning);
  page.table(parameter_table(fleet), std::string("What the arms have in common; ") + kParameterMeaning);
  for (const std::string& note : fleet.notes) page.note(note);
  return page;
}

}  // namespace heft::report
