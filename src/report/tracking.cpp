#include "heft/report/tracking.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "heft/statistics/distributions.hpp"
#include "host/json.hpp"
#include "page_lines.hpp"
#include "tracking_runs.hpp"

namespace heft::report {
namespace {

using track::Method;
using track::Tracking;

double rms(const Tracking& tracking, Method method) { return tracking.judged(method).rms(); }

/// "the estimated load".
const char* estimated(const Tracking& tracking) {
  return tracking.wrong ? "the estimated arm" : "the estimated load";
}

std::string load_sentence(const Tracking& tracking) {
  const double mass = tracking.mass(), half = tracking.mass_half_width();
  if (!std::isfinite(half)) return "The motion did not determine the load before the run ended.";
  if (tracking.wrong) {
    return fmt::format(
        "The observer that takes the arm for right puts the load at {:.4f} kg, in truth {:.4f} kg; the errors of the arm go into "
        "it, so that it has no interval.",
        mass, tracking.true_mass);
  }
  std::string text =
      fmt::format("Estimated load at the end: {:.4f} kg ± {:.4f} kg (95 %), in truth {:.4f} kg.", mass, half,
                  tracking.true_mass);
  if (mass + half < 0) {
    text += " The estimated mass is negative, so the arm model must be wrong; the estimate is not used.";
  }
  return text;
}

std::vector<page::Mark> marks_of(const Tracking& tracking) {
  std::vector<page::Mark> marks;
  for (const track::LoadEvent& event : tracking.events) {
    marks.push_back({page::Mark::Direction::kVertical, event.time, event.grasp ? "grasp" : "release"});
  }
  return marks;
}

page::PlotSpec mass_plot(const Tracking& tracking) {
  const track::LoadTrace& load = tracking.load;
  page::PlotSpec spec;
  spec.title = tracking.wrong ? "Mass that the observer estimates, the arm's errors in it"
                              : "Estimated mass of the load with its 95 % interval";
  spec.x_label = "time [s]";
  spec.y_label = "mass [kg]";
  const double largest = std::max(0.05, tracking.largest_mass);
  spec.y_range = std::pair<double, double>(-0.6 * largest, 1.8 * largest);
  page::Series interval{"95 % interval", load.time, {}, {}, page::Style::kBand, page::Hue::kBlue};
  std::vector<double> shown;
  const auto clamped = [&](double v) { return std::clamp(v, spec.y_range->first, spec.y_range->second); };
  for (std::size_t k = 0; k < load.mass.size(); ++k) {
    interval.y.push_back(clamped(load.mass[k] - load.mass_half_width[k]));
    interval.y_high.push_back(clamped(load.mass[k] + load.mass_half_width[k]));
    shown.push_back(clamped(load.mass[k]));
  }
  if (!tracking.wrong) spec.series.push_back(interval);
  spec.series.push_back({"estimate", load.time, shown, {}, page::Style::kLine, page::Hue::kBlue});
  spec.marks = marks_of(tracking);
  return spec;
}

}  // namespace

std::string brief(const Tracking& tracking) {
  return fmt::format(
      "Computed torque with {} leaves {:.3g} mrad, with nominal values {:.3g} mrad, PD {:.3g} mrad{}.",
      estimated(tracking), 1e3 * rms(tracking, tracking.estimating()),
      1e3 * rms(tracking, Method::kComputedTorque), 1e3 * rms(tracking, Method::kPd),
      tracking.after.empty() ? "" : " after the last payload event");
}

std::string full(const Tracking& tracking) {
  std::string text = fmt::format(
      "{}, {:.6g} s at {:.6g} Hz, every controller with {:.3g} Hz bandwidth\nRMS tracking error{}:\n{}",
      tracking.robot, tracking.duration, tracking.sample_rate, tracking.settings.bandwidth_hz,
      tracking.from > 0 ? fmt::format(" from {:.6g} s on", tracking.from) : "",
      tracking_table(tracking.counted).to_text(2));
  if (!tracking.after.empty()) {
    text += fmt::format("From {:.6g} s on, 1 s after the last payload event:\n{}", tracking.settled,
                        tracking_table(tracking.after).to_text(2));
  }
  if (tracking.wrong) text += wrong_sentence(tracking.wrong) + "\n";
  return text + fmt::format("{}\n{}", load_sentence(tracking), verdict_text(tracking.judgement));
}

std::string json(const Tracking& tracking) {
  nlohmann::ordered_json json{{"scenario", tracking.scenario},
                              {"robot", tracking.robot},
                              {"bandwidth_hz", tracking.settings.bandwidth_hz},
                              {"from", tracking.from},
                              {"model_effects", tracking.model_effects},
                              {"controllers", tracking_json(tracking.counted)}};
  put_wrong(json, tracking.wrong);
  if (!tracking.after.empty()) {
    json["after_last_payload_event"] = {{"from", tracking.settled},
                                        {"controllers", tracking_json(tracking.after)}};
  }
  put_verdict(json, tracking.judgement);
  // The errors of a wrong arm go into the load.
  const double half = tracking.wrong ? kNaN : tracking.mass_half_width();
  json["load"] = {{"mass",
                   {{"value", host::number_or_null(tracking.mass())},
                    {"std", host::number_or_null(half / statistics::kNormal95)},
                    {"half_width_95", host::number_or_null(half)},
                    {"identifiable", std::isfinite(half)},
                    {"true", tracking.true_mass}}},
                  {"changes", tracking.load.change},
                  {"rows", tracking.settings.rows}};
  return text_of(json);
}

page::Page page(const Tracking& tracking) {
  page::Page page =
      page::new_page(fmt::format("{}: tracking", tracking.robot), file_name_of(tracking.scenario));
  page.verdict(brief(tracking), tracking.judgement);
  if (tracking.wrong) page.paragraph(wrong_sentence(tracking.wrong));
  page.paragraph(load_sentence(tracking));
  page.table(tracking_table(tracking.counted), "Root mean square tracking error per joint");
  if (!tracking.after.empty()) {
    page.table(tracking_table(tracking.after),
               fmt::format("The same from {:.6g} s on, 1 s after the last payload event", tracking.settled));
  }
  page.plot(tracking_bars(tracking.judged()));
  if (!tracking.load.time.empty()) page.plot(mass_plot(tracking));
  std::vector<page::PlotSpec> plots = tracking_plots(tracking.runs, marks_of(tracking));
  for (page::PlotSpec& spec : plots) {
    spec.width = 460;
    spec.height = 200;
  }
  page.plots("Tracking error", plots);
  page.note(
      "PD gains are those of computed torque times the mean inertia of each joint, so that all controllers have the same "
      "bandwidth. The estimated load comes from encoder positions and reported torques while the arm moves; it is carried "
      "into every row of the model.");
  return page;
}

}  // namespace heft::report
