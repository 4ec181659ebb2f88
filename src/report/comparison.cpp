#include "heft/report/comparison.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "comparison_words.hpp"
#include "effect_words.hpp"
#include "host/json.hpp"
#include "page_lines.hpp"

namespace heft::report {
namespace {

using compare::Change;
using compare::Comparison;
using compare::Kind;

std::string torque_unit_of(const Comparison& comparison, int joint) {
  return is_prismatic(comparison.before, joint) ? "N" : "N·m";
}

/// "joint 2: Coulomb friction 8.1 → 11.4 N·m (+41 %), beyond what the fits allow (±1.2); up to 3.3 N·m".
std::string sentence(const Comparison& comparison, const Change& change) {
  const std::string share = percent(change);
  const bool link = change.kind == Kind::kLink || change.kind == Kind::kCoupling;
  std::string text =
      fmt::format("{}: {} {} → {} {}{}, beyond what the fits allow (±{})", place(change), quantity(change),
                  short_number(change.before, 3), short_number(change.after, 3), change.unit,
                  share.empty() ? "" : " (" + share + ")", short_number(change.difference.half_width(), 2));
  if (link)
    text += fmt::format("; moves joint {} by up to {} {}", change.moved_joint + 1,
                        short_number(change.torque, 2), torque_unit_of(comparison, change.moved_joint));
  return text;
}

constexpr std::size_t kMostSentences = 6;

std::string small_in_words(const Comparison& comparison) {
  const auto small = std::count_if(comparison.changes.begin(), comparison.changes.end(),
                                   [](const Change& c) { return c.significant && !c.relevant; });
  if (small == 0) return "";
  return fmt::format(
      "{} more differ{} by more than the fits allow, but move{} the torque by less than {:g} % of the largest.",
      small, small == 1 ? "s" : "", small == 1 ? "s" : "", 100.0 * compare::kRelevantShare);
}

page::Table changes_table(const Comparison& comparison, bool all) {
  page::Table table(
      {"", "parameter", "unit", "before", "after", "change", "low", "high", "torque [N·m, N]", "at joint"});
  for (const Change& change : comparison.changes) {
    if (!all && !change.significant) continue;
    table.add_row({change.named()       ? "changed"
                   : change.significant ? "small"
                                        : "",
                   change.parameter, change.unit, page::number(change.before, 4),
                   page::number(change.after, 4), page::number(change.difference.value, 3),
                   page::number(change.difference.lower, 3), page::number(change.difference.upper, 3),
                   page::number(change.torque, 3), fmt::format("{}", change.moved_joint + 1)});
  }
  return table;
}

page::Table parts_table(const Comparison& comparison) {
  page::Table table(
      {"joint", "part", "before [N·m, N]", "after", "change", "from the fits' uncertainty alone"});
  for (const compare::TorquePart& part : comparison.parts) {
    table.add_row({fmt::format("{}", part.joint + 1), compare::to_string(part.part),
                   page::number(part.before, 3), page::number(part.after, 3), page::number(part.change, 3),
                   page::number(part.open, 3)});
  }
  return table;
}

constexpr const char* kPartsMeaning =
    "rms over 200 random states within the limits; static: gravity and offset; change: rms of the difference, state by state";
constexpr const char* kKeepInMind =
    "The intervals hold what the logs of one day leave open. Friction follows temperature: compare models from logs "
    "after the same time of motion.";

page::PlotSpec friction_plot(const Comparison& comparison, const compare::FrictionCurve& curve) {
  const bool slides = is_prismatic(comparison.before, curve.joint);
  page::PlotSpec spec;
  spec.title = fmt::format("joint {}", curve.joint + 1);
  spec.x_label = slides ? "speed [m/s]" : "speed [rad/s]";
  spec.y_label = slides ? "friction [N]" : "friction [N·m]";
  const auto add = [&](const char* label, const Eigen::VectorXd& value, const Eigen::VectorXd& half,
                       page::Hue hue) {
    if (half.allFinite())
      spec.series.push_back(
          page::band(fmt::format("{}, 95 %", label), curve.speed, value - half, value + half, hue));
    spec.series.push_back(page::line(label, curve.speed, value, hue));
  };
  add("before", curve.before, curve.before_half, page::Hue::kVermillion);
  add("after", curve.after, curve.after_half, page::Hue::kBlue);
  return spec;
}

}  // namespace

std::string brief(const Comparison& comparison) {
  const auto named = static_cast<std::size_t>(comparison.count_named());
  if (named == 0) {
    return fmt::format("Nothing changed beyond what the fits allow ({} parameter{} compared).",
                       comparison.changes.size(), comparison.changes.size() == 1 ? "" : "s");
  }
  std::string text;
  for (std::size_t k = 0; k < std::min(named, kMostSentences); ++k)
    text += (k == 0 ? "" : "\n") + sentence(comparison, comparison.changes[k]) + ".";
  if (named > kMostSentences) text += fmt::format("\nAnd {} more.", named - kMostSentences);
  return text;
}

std::string full(const Comparison& comparison) {
  std::string text = fmt::format("{} → {}\n{}\n{}", comparison.before_path, comparison.after_path,
                                 brief(comparison), verdict_text(comparison.judgement));
  const std::string small = small_in_words(comparison);
  if (!small.empty()) text += small + "\n";
  if (const page::Table table = changes_table(comparison, false); !table.rows().empty())
    text +=
        "\nParameters that changed; low and high: of the change, all intervals together hold in 95 % of comparisons\n" +
        table.to_text(2);
  text += fmt::format("\nTorque by its parts, {}\n{}", kPartsMeaning, parts_table(comparison).to_text(2));
  for (const std::string& note : comparison.notes) text += "Note: " + note + "\n";
  return text + kKeepInMind + "\n";
}

std::string json(const Comparison& comparison) {
  nlohmann::ordered_json json{
      {"robot", comparison.after.name}, {"before", comparison.before_path}, {"after", comparison.after_path}};
  put_verdict(json, comparison.judgement);
  json["summary"] = brief(comparison);
  json["changes"] = nlohmann::ordered_json::array();
  for (const Change& change : comparison.changes) {
    json["changes"].push_back({{"parameter", change.parameter},
                               {"joint", change.joint + 1},
                               {"before", change.before},
                               {"after", change.after},
                               {"low", host::number_or_null(change.difference.lower)},
                               {"high", host::number_or_null(change.difference.upper)},
                               {"significant", change.significant},
                               {"named", change.named()},
                               {"kind", compare::to_string(change.kind)},
                               {"meaning", change.meaning},
                               {"unit", change.unit},
                               {"p_value", host::number_or_null(change.p_value)},
                               {"torque", host::number_or_null(change.torque)},
                               {"moved_joint", change.moved_joint + 1}});
  }
  json["parts"] = nlohmann::ordered_json::array();
  for (const compare::TorquePart& part : comparison.parts) {
    json["parts"].push_back({{"joint", part.joint + 1},
                             {"part", compare::to_string(part.part)},
                             {"before", host::number_or_null(part.before)},
                             {"after", host::number_or_null(part.after)},
                             {"change", host::number_or_null(part.change)},
                             {"open", host::number_or_null(part.open)}});
  }
  json["friction"] = nlohmann::ordered_json::array();
  for (const compare::FrictionCurve& curve : comparison.friction) {
    json["friction"].push_back({{"joint", curve.joint + 1},
                                {"speed", host::json_array(curve.speed)},
                                {"before", host::json_array(curve.before)},
                                {"before_half_width", host::json_array(curve.before_half)},
                                {"after", host::json_array(curve.after)},
                                {"after_half_width", host::json_array(curve.after_half)}});
  }
  json["notes"] = comparison.notes;
  return text_of(json);
}

page::Page page(const Comparison& comparison) {
  page::Page page = page::new_page(fmt::format("{}: what changed", comparison.after.name),
                                   file_names_of({comparison.before_path, comparison.after_path}));
  page.verdict(brief(comparison), comparison.judgement);
  if (const std::string small = small_in_words(comparison); !small.empty()) page.paragraph(small);
  std::vector<page::PlotSpec> plots;
  for (const compare::FrictionCurve& curve : comparison.friction)
    plots.push_back(friction_plot(comparison, curve));
  page.plots("Friction over speed, forward, without offset", plots);
  page.table(parts_table(comparison), std::string("Torque by its parts: ") + kPartsMeaning);
  page.table(
      changes_table(comparison, true),
      "Everything compared; low and high: of the change, all intervals together hold in 95 % of comparisons");
  for (const std::string& note : comparison.notes) page.note(note);
  page.note(kKeepInMind);
  return page;
}

}  // namespace heft::report
