#include "heft/report/separating_motion.hpp"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "effect_words.hpp"
#include "host/json.hpp"
#include "page_lines.hpp"
#include "safety_words.hpp"

namespace heft::report {
namespace {

using excite::SeparatingMotion;
using excite::Separation;

/// "Stribeck friction"; "a function of position".
std::string rival_in_words(const std::string& kind) {
  const EffectKind* effect = effect_with_id(kind);
  return effect != nullptr ? effect_name(*effect) : "a function of " + kind;
}

std::string pair_in_words(const Separation& pair) {
  return fmt::format("joint {}: {} and {}", pair.joint + 1, rival_in_words(pair.first),
                     rival_in_words(pair.second));
}

page::Table pairs_table(const SeparatingMotion& motion) {
  page::Table table({"joint", "rivals", "distance [standard deviations]", "decides"});
  for (const Separation& pair : motion.pairs) {
    table.add_row({fmt::format("{}", pair.joint + 1),
                   fmt::format("{} – {}", rival_in_words(pair.first), rival_in_words(pair.second)),
                   page::number(pair.distance, 3), pair.decides() ? "yes" : "no"});
  }
  return table;
}

std::string meaning() {
  return fmt::format(
      "Distance: what is left of the torque of one rival when everything else and the other rival are fitted to it, in the "
      "noise of the log, with {:g} independent rows a second; {:g} decide.",
      excite::kIndependentRate, excite::kDecides);
}

std::string compared(const SeparatingMotion& motion) {
  return fmt::format(
      "{}, the best of {} motions tried; smallest distance on random motions inside the same limits: {} (median)",
      motion.how, motion.tried, page::number(motion.median, 3));
}

constexpr const char* kNext =
    "Run it, add its log to those that the diagnosis was made from, and run heft diagnose again.";

}  // namespace

std::string brief(const SeparatingMotion& motion) {
  std::vector<std::string> open;
  for (const Separation& pair : motion.pairs) {
    if (!pair.decides()) open.push_back(pair_in_words(pair));
  }
  if (open.empty())
    return motion.pairs.size() == 1
               ? fmt::format("The motion decides between {}.", pair_in_words(motion.pairs.front()))
               : fmt::format("The motion decides between the rivals of all {} pairs.", motion.pairs.size());
  return fmt::format("Within these limits the motion does not decide between {}.", fmt::join(open, "; "));
}

std::string full(const SeparatingMotion& motion) {
  std::string text = fmt::format("{}: {}\n{}\n{}{}{}\n", motion.robot.name, compared(motion), brief(motion),
                                 verdict_text(motion.judgement), pairs_table(motion).to_text(2), meaning());
  for (const std::string& note : motion.asked.notes) text += "Note: " + note + "\n";
  text += safety_text(motion);
  text += fmt::format("Limits with {:g} % to spare; nearest: {}\n{}", 100.0 * motion.limits.margin,
                      motion.use.worst, limit_table(motion).to_text(2));
  return text + kNext + "\n";
}

std::string json(const SeparatingMotion& motion) {
  nlohmann::ordered_json json{{"robot", motion.robot.name},
                              {"for", "separate"},
                              {"duration", motion.path.duration()},
                              {"how", motion.how},
                              {"motions_tried", motion.tried},
                              {"median_distance_of_random_motions", host::number_or_null(motion.median)},
                              {"noise", host::json_array(motion.asked.noise)},
                              {"pairs", nlohmann::ordered_json::array()}};
  for (const Separation& pair : motion.pairs) {
    json["pairs"].push_back({{"joint", pair.joint + 1},
                             {"first", pair.first},
                             {"second", pair.second},
                             {"distance", host::number_or_null(pair.distance)},
                             {"decides", pair.decides()}});
  }
  json["notes"] = motion.asked.notes;
  add_safety(motion, json);
  return text_of(json);
}

page::Page page(const SeparatingMotion& motion) {
  page::Page page =
      page::new_page(fmt::format("{}: motion that separates rivals", motion.robot.name), motion.how);
  page.verdict(brief(motion), tone_of(motion));
  for (const std::string& reason : motion.judgement.reasons) page.paragraph(reason + ".");
  page.table(pairs_table(motion), meaning());
  page.paragraph(compared(motion) + ".");
  page.paragraph(kNext);
  for (const std::string& note : motion.asked.notes) page.note(note);
  add_safety(motion, page);
  return page;
}

}  // namespace heft::report
