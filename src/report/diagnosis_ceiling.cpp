// How much of each joint's error any function of the motion could explain: table, sentence, JSON, bars.
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "diagnosis_result.hpp"
#include "heft/host/words.hpp"
#include "host/json.hpp"

namespace heft::report {
namespace {

using diagnose::Ceiling;
using diagnose::Diagnosis;

std::string percent(double share) {
  return std::isfinite(share) ? fmt::format("{:.0f}", std::round(100.0 * share) + 0.0) : "–";  // + 0: no "-0"
}

std::string sentence_case(const std::vector<std::string>& parts) {
  std::string text = fmt::format("{}", fmt::join(parts, "; "));
  return text.empty() ? text : host::capital(text) + ".";
}

}  // namespace

page::Table ceiling_table(const Diagnosis& diagnosis) {
  page::Table table({"joint", fmt::format("error identified [{}]", torque_unit(diagnosis.after)),
                     "explained [%]", "explainable, but unknown [%]", "noise [%]",
                     "explained of explainable"});
  for (std::size_t j = 0; j < diagnosis.ceilings.size(); ++j) {
    const Ceiling& c = diagnosis.ceilings[j];
    table.add_row({fmt::format("{}", j + 1), page::number(c.rms, 3), percent(c.explained),
                   percent(c.missing()), percent(c.noise()),
                   std::isfinite(c.reached()) ? fmt::format("{:.2f}", c.reached()) : "–"});
  }
  return table;
}

std::string ceiling_in_words(const Diagnosis& diagnosis) {
  std::vector<std::string> parts;
  std::vector<int> nothing;
  for (std::size_t j = 0; j < diagnosis.ceilings.size(); ++j) {
    const Ceiling& c = diagnosis.ceilings[j];
    if (std::isfinite(c.reached())) {
      parts.push_back(fmt::format("joint {}: explained {:.2f} of what is explainable", j + 1, c.reached()));
    } else if (std::isfinite(c.explainable)) {
      nothing.push_back(static_cast<int>(j));
    }
  }
  if (!nothing.empty()) parts.push_back("nothing is explainable in " + host::joints_in_words(nothing));
  return sentence_case(parts);
}

nlohmann::ordered_json ceilings_json(const Diagnosis& diagnosis) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (std::size_t j = 0; j < diagnosis.ceilings.size(); ++j) {
    const Ceiling& c = diagnosis.ceilings[j];
    json.push_back({{"joint", j + 1},
                    {"rms", host::number_or_null(c.rms)},
                    {"noise", host::number_or_null(c.noise())},
                    {"white_noise", host::number_or_null(c.white_noise)},
                    {"explained", host::number_or_null(c.explained)},
                    {"explainable", host::number_or_null(c.explainable)},
                    {"explained_of_explainable", host::number_or_null(c.reached())}});
  }
  return json;
}

page::PlotSpec ceiling_bars(const Diagnosis& diagnosis) {
  page::PlotSpec spec;
  spec.title = "Squared error of each joint as identified: explained, explainable but unknown, noise";
  spec.y_label = "share of the squared error [%]";
  spec.height = 210;
  std::vector<double> explained, missing, noise;
  for (std::size_t j = 0; j < diagnosis.ceilings.size(); ++j) {
    const Ceiling& c = diagnosis.ceilings[j];
    if (!std::isfinite(c.explainable)) continue;
    spec.categories.push_back(fmt::format("joint {}", j + 1));
    explained.push_back(100.0 * c.explained);
    missing.push_back(100.0 * c.missing());
    noise.push_back(100.0 * c.noise());
  }
  spec.series = {page::bars("explained", explained, page::Hue::kBlue),
                 page::bars("explainable, but unknown", missing, page::Hue::kVermillion),
                 page::bars("noise", noise, page::Hue::kNeutral)};
  return spec;
}

}  // namespace heft::report
