#include "heft/report/moving_horizon.hpp"

#include <algorithm>
#include <cstddef>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "heft/page/origin.hpp"
#include "host/json.hpp"
#include "page_lines.hpp"

namespace heft::report {
namespace {

using identify::HorizonEstimate;

int count_of(const HorizonEstimate& estimate) { return static_cast<int>(estimate.unknown.size()); }

page::Table parameters_table(const HorizonEstimate& estimate) {
  page::Table table({"parameter", "unit", "value", "±95 %", "from"});
  for (int i = 0; i < count_of(estimate); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const char* from = estimate.excited[at] ? "window" : estimate.determined[at] ? "samples before" : "robot";
    table.add_row({estimate.name(i), estimate.unit(i), page::number(estimate.value(i)),
                   page::number(estimate.interval(i).half_width()), from});
  }
  return table;
}

}  // namespace

std::string brief(const HorizonEstimate& estimate) {
  if (!estimate.usable()) return "The samples do not determine any parameter yet.";
  const auto determined = std::count(estimate.determined.begin(), estimate.determined.end(), true);
  return fmt::format(
      "At {:.2f} s the samples determine {} of {} parameters; {:.0f} % of the window's rows are outliers.",
      estimate.time, determined, count_of(estimate), 100.0 * estimate.outliers);
}

std::string full(const HorizonEstimate& estimate) {
  return fmt::format("{}\n{}", brief(estimate), parameters_table(estimate).to_text(2));
}

std::string json(const HorizonEstimate& estimate) {
  nlohmann::ordered_json json{{"time", host::number_or_null(estimate.time)}, {"usable", estimate.usable()}};
  json["parameters"] = nlohmann::ordered_json::array();
  for (int i = 0; i < count_of(estimate); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const statistics::Interval interval = estimate.interval(i);
    json["parameters"].push_back({{"name", estimate.name(i)},
                                  {"unit", estimate.unit(i)},
                                  {"value", estimate.value(i)},
                                  {"low", host::number_or_null(interval.lower)},
                                  {"high", host::number_or_null(interval.upper)},
                                  {"determined", static_cast<bool>(estimate.determined[at])},
                                  {"excited", static_cast<bool>(estimate.excited[at])}});
  }
  json["noise_std"] = std::vector<double>(estimate.noise_std.begin(), estimate.noise_std.end());
  json["outliers"] = estimate.outliers;
  json["smallest_eigenvalue"] = host::number_or_null(estimate.smallest_eigenvalue);
  return text_of(json);
}

page::Page page(const HorizonEstimate& estimate) {
  page::Page page = page::new_page("Parameters while the arm moves", estimate.columns->robot().name);
  page.paragraph(brief(estimate));
  page.table(parameters_table(estimate), "Parameters with 95 % intervals");
  page.note(
      "From the window: the last seconds alone determine the parameter. From samples before: the window does not show it, and its "
      "interval widens with the drift that is allowed. From the robot: no motion so far shows it.");
  return page;
}

}  // namespace heft::report
