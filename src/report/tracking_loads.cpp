#include <cstddef>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "heft/report/tracking.hpp"
#include "host/json.hpp"
#include "page_lines.hpp"
#include "tracking_runs.hpp"

namespace heft::report {
namespace {

using track::LoadComparison;
using track::Method;
using track::Tracking;

std::string kilograms(double mass) { return fmt::format("{:.6g} kg", mass); }

/// From Tracking::from on with every load, also where nothing is grasped.
const track::Run& run_of(const Tracking& tracking, Method method) {
  return tracking.counted[static_cast<std::size_t>(method)];
}

/// Error of the controller that estimates, as a share of another's [%].
double share(const Tracking& tracking, Method other) {
  return 100 * run_of(tracking, tracking.estimating()).rms() / run_of(tracking, other).rms();
}

/// Joint error, largest joint error, tool error and largest tool error of all controllers with one load.
page::Table load_table(const Tracking& tracking) {
  page::Table table({"controller", "joints [mrad]", "largest [mrad]", "tool [mm]", "tool, largest [mm]",
                     "of nominal [%]", "of PD [%]"});
  for (const track::Run& run : tracking.counted) {
    table.add_row({run.name, page::number(1e3 * run.rms(), 3), page::number(1e3 * run.peak(), 3),
                   page::number(1e3 * run.tool_rms(), 3), page::number(1e3 * run.tool_peak(), 3),
                   page::number(100 * run.rms() / run_of(tracking, Method::kComputedTorque).rms(), 3),
                   page::number(100 * run.rms() / run_of(tracking, Method::kPd).rms(), 3)});
  }
  return table;
}

std::string heading(const LoadComparison& comparison) {
  const Tracking& first = comparison.tracking.front();
  std::string text = fmt::format("{}, {:.6g} s at {:.6g} Hz, every controller with {:.3g} Hz bandwidth",
                                 first.robot, first.duration, first.sample_rate, first.settings.bandwidth_hz);
  return first.from > 0 ? text + fmt::format("; errors from {:.6g} s on", first.from) : text;
}

}  // namespace

std::string brief(const LoadComparison& comparison) {
  std::string text = "Computed torque with what is estimated leaves";
  for (std::size_t k = 0; k < comparison.masses.size(); ++k) {
    const Tracking& tracking = comparison.tracking[k];
    text += fmt::format("{} {:.3g} % of the error of nominal values and {:.3g} % of that of PD with {}",
                        k > 0 ? "," : "", share(tracking, Method::kComputedTorque),
                        share(tracking, Method::kPd), kilograms(comparison.masses[k]));
  }
  return text + ".";
}

std::string full(const LoadComparison& comparison) {
  std::string text = heading(comparison) + "\n";
  for (std::size_t k = 0; k < comparison.masses.size(); ++k) {
    text += fmt::format("Load of {}, RMS tracking error:\n{}", kilograms(comparison.masses[k]),
                        load_table(comparison.tracking[k]).to_text(2));
  }
  const std::string wrong = wrong_sentence(comparison.tracking.front().wrong);
  if (!wrong.empty()) text += wrong + "\n";
  return text + fmt::format("{}\n{}", brief(comparison), verdict_text(comparison.judgement));
}

std::string json(const LoadComparison& comparison) {
  const Tracking& first = comparison.tracking.front();
  nlohmann::ordered_json json{{"scenario", first.scenario},
                              {"robot", first.robot},
                              {"bandwidth_hz", first.settings.bandwidth_hz},
                              {"from", first.from},
                              {"model_effects", first.model_effects}};
  put_wrong(json, first.wrong);
  json["loads"] = nlohmann::ordered_json::array();
  for (std::size_t k = 0; k < comparison.masses.size(); ++k) {
    const Tracking& tracking = comparison.tracking[k];
    json["loads"].push_back(
        {{"mass", comparison.masses[k]}, {"controllers", tracking_json(tracking.counted)}});
    if (!tracking.after.empty()) {
      json["loads"].back()["after_last_payload_event"] = {{"from", tracking.settled},
                                                          {"controllers", tracking_json(tracking.after)}};
    }
  }
  put_verdict(json, comparison.judgement);
  return text_of(json);
}

page::Page page(const LoadComparison& comparison) {
  const Tracking& first = comparison.tracking.front();
  page::Page page = page::new_page(fmt::format("{}: tracking with several loads", first.robot),
                                   file_name_of(first.scenario));
  page.verdict(brief(comparison), comparison.judgement);
  page.paragraph(heading(comparison) + ".");
  if (first.wrong) page.paragraph(wrong_sentence(first.wrong));
  for (std::size_t k = 0; k < comparison.masses.size(); ++k) {
    page.table(load_table(comparison.tracking[k]),
               fmt::format("Root mean square tracking error with {}", kilograms(comparison.masses[k])));
    page.plot(tracking_bars(comparison.tracking[k].counted));
  }
  return page;
}

}  // namespace heft::report
