#include "terminal_link_report.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "heft/page/origin.hpp"
#include "heft/report/tracking.hpp"
#include "host/json.hpp"
#include "terminal_link_claims.hpp"
#include "terminal_link_closed_loop.hpp"
#include "terminal_link_figures.hpp"

namespace heft::studies {
namespace {

using page::PlotSpec;
using page::Table;

constexpr const char* kPublication =
    "H. Kawasaki, K. Nishimura, Terminal-link parameter estimation and trajectory control of robotic "
    "manipulators, 1984";
std::vector<double> rms_of(const track::Run& run) {
  std::vector<double> rms;
  for (Eigen::Index j = 0; j < run.error.cols(); ++j) {
    rms.push_back(std::sqrt(run.error.col(j).squaredNorm() / static_cast<double>(run.error.rows())));
  }
  return rms;
}

double rms_of_all(const track::Run& run) {
  return std::sqrt(run.error.squaredNorm() / static_cast<double>(run.error.size()));
}

Table closed_loop_table(const ClosedLoop& loop) {
  Table table({"controller", "joint 1", "2", "3", "4", "5", "6", "all [mrad]", "of PD [%]"});
  const double reference = rms_of_all(loop.runs.front());
  for (const track::Run& run : loop.runs) {
    std::vector<std::string> row{run.name};
    for (const double v : rms_of(run)) row.push_back(fmt::format("{:.2f}", 1e3 * v));
    row.push_back(fmt::format("{:.2f}", 1e3 * rms_of_all(run)));
    row.push_back(fmt::format("{:.1f}", 100 * rms_of_all(run) / reference));
    table.add_row(row);
  }
  return table;
}

Table encoder_table(const ClosedLoop& loop) {
  Table table({"accelerations and estimator", "e"});
  for (const EncoderEstimate& e : loop.estimates)
    table.add_row({e.name, std::isfinite(e.error) ? fmt::format("{:.3f}", e.error) : "no solution"});
  return table;
}

nlohmann::ordered_json claims_json(const std::vector<Claim>& claims) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const Claim& c : claims) {
    json.push_back({{"id", c.id},
                    {"scenario", c.scenario.empty() ? nlohmann::ordered_json(nullptr)
                                                    : nlohmann::ordered_json(c.scenario)},
                    {"claim", c.text},
                    {"stated", c.expected},
                    {"found", c.found},
                    {"values", c.values},
                    {"holds", c.holds}});
  }
  return json;
}

struct Parameter {
  std::size_t index;
  const char* unit_name;
  const char* file;
};
// SI to Kawasaki and Nishimura's g, m, s is a factor of a thousand for all.
constexpr std::array<Parameter, 4> kFigureParameters = {{{12, "g m²", "inertia6_33"},
                                                         {9, "g m", "moment6_x"},
                                                         {3, "g m²", "inertia5_22"},
                                                         {16, "mN m", "coulomb6"}}};

void add_figures(const Study& study, StudyReport& report) {
  report.page.heading("Estimates against the number of samples (figures 2 and 3 of the paper)");
  report.page.paragraph(
      "Four of the eighteen base parameters, LSM against IVM with the joint model (35). The band holds all "
      "seeds, the line is their mean from where all of them are on the drawing, the dashed line the truth. "
      "LSM settles quickly, on a wrong value; IVM scatters at first and converges. Scenario B, in which the "
      "torque is computed from the motor input and carries the rotor's share of the acceleration noise.");
  for (const double period : study.options.periods) {
    std::vector<PlotSpec> plots;
    for (const Parameter& p : kFigureParameters) {
      plots.push_back(parameter_plot(study, true, period, p.index, 1e3, p.unit_name));
      report.figure(fmt::format("figure_{}_{}.svg", period < 0.003 ? 3 : 2, p.file), plots.back());
    }
    report.page.plots(fmt::format("Figure {}: sampled every {:.0f} ms", period < 0.003 ? 3 : 2, 1e3 * period),
                      plots);
  }
  for (const bool b : {false, true}) {
    const PlotSpec spec = error_plot(study, b, 0.005);
    report.figure(fmt::format("error_{}.svg", b ? "b" : "a"), spec);
    report.page.plot(spec);
  }
}

void add_closed_loop(const ClosedLoop& loop, StudyReport& report) {
  report.page.heading("Closed loop with 250 g at the wrist (figures 4 and 5 of the paper)");
  const double pd = rms_of_all(loop.runs[0]), k5 = rms_of_all(loop.runs[3]),
               carried = rms_of_all(loop.runs[4]), whole = rms_of_all(loop.runs[5]);
  report.page.paragraph(fmt::format(
      "The arm of the paper with rotors, Coulomb friction that sticks, encoders of 131072 steps a turn and "
      "torque noise, simulated in continuous time and controlled at 1 kHz; nominal values within ±10 %. All "
      "controllers get the same bandwidth of 4 Hz: the PD gains are the computed torque's times the mean "
      "inertia of each joint. Estimates come from 20 s of the exciting trajectory, errors from another one. "
      "Position-velocity feedback leaves {:.1f} mrad, computed torque with the k = 5 estimate {:.1f} mrad "
      "({:.0f} %), with the payload carried into every row {:.1f} mrad ({:.0f} %), with all rows estimated "
      "{:.1f} mrad ({:.0f} %).",
      1e3 * pd, 1e3 * k5, 100 * k5 / pd, 1e3 * carried, 100 * carried / pd, 1e3 * whole, 100 * whole / pd));
  const Table table = closed_loop_table(loop);
  report.page.table(table, "Root mean square tracking error [mrad] from 2 s on");
  report.csv("closed_loop_tracking.csv", table);

  const auto subset = [&](const std::vector<std::size_t>& which) {
    std::vector<track::Run> runs;
    for (const std::size_t i : which) runs.push_back(loop.runs[i]);
    return runs;
  };
  const auto plots_of = [&](const std::vector<std::size_t>& which, const char* name) {
    std::vector<PlotSpec> plots = report::tracking_plots(subset(which));
    for (std::size_t j = 0; j < plots.size(); ++j) {
      plots[j].width = 460;
      plots[j].height = 200;
      report.figure(fmt::format("{}_joint{}.svg", name, j + 1), plots[j]);
    }
    return plots;
  };
  report.page.plots("Figure 4: position-velocity feedback against computed torque with the k = 5 estimate",
                    plots_of({0, 3}, "figure_4"));
  report.page.plots(
      "Figure 5: computed torque with nominal values, with k = 5, and with the payload's mass in every row",
      plots_of({2, 3, 4}, "figure_5"));
  const PlotSpec bars = report::tracking_bars(loop.runs);
  report.figure("closed_loop_rms.svg", bars);
  report.page.plot(bars);
  report.page.paragraph(fmt::format(
      "The payload as a body of its own, from rows 4 to 6 of an arm that was calibrated without it by the "
      "same estimator: {:.1f} g ± {:.1f} g "
      "(in truth {:.0f} g), centre of mass {:.1f}, {:.1f}, {:.1f} mm (in truth {:.0f}, {:.0f}, {:.0f} mm).",
      1e3 * loop.payload_mass, 1e3 * loop.payload_half_width, 1e3 * loop.payload_true,
      1e3 * loop.payload_com[0], 1e3 * loop.payload_com[1], 1e3 * loop.payload_com[2],
      1e3 * loop.payload_com_true[0], 1e3 * loop.payload_com_true[1], 1e3 * loop.payload_com_true[2]));
  Table knows({"controller", "what it knows"});
  for (std::size_t i = 0; i < loop.runs.size(); ++i) knows.add_row({loop.runs[i].name, loop.run_notes[i]});
  report.page.table(knows);
  const Table encoders = encoder_table(loop);
  report.page.table(
      encoders,
      "Error e of k = 5 estimates from the encoders of the loaded arm, by how the acceleration was made");
  report.csv("closed_loop_estimates.csv", encoders);
  report.page.note(
      "The authors saw LSM and IVM give nearly the same values in this experiment. So does the simulation "
      "once position is filtered before it is differentiated: there is then little noise left to be biased "
      "by, and what remains is common to both (reversals, the nonlinearity of the filtered equations). Only "
      "where encoders are differenced twice without a filter do instruments decide, and then an "
      "acceleration one sample old is no instrument: it shares encoder readings with the present one. It takes three "
      "samples, or the desired acceleration.");
}

void add_contradictions(const Study& study, const ClosedLoop& loop, page::Page& page) {
  const auto find = [&](const char* id, const char* scenario) {
    for (const auto* list : {&study.table, &study.requirements}) {
      for (const Claim& c : *list) {
        if (c.id == id && c.scenario == scenario) return c.found;
      }
    }
    return std::string("–");
  };
  page.heading("Where the paper is contradicted");
  page.paragraph(
      fmt::format("The instruments as printed. Read literally, (33) puts the instrument rows into a "
                  "block-diagonal matrix; (32) is then least squares with a weight for each sample, and has "
                  "the same kind of bias: e = {} in scenario A, {} in B at 2000 and 20000 samples. It does "
                  "not converge. Stacked instruments, as the text intends, do.",
                  find("literal", "A"), find("literal", "B")));
  page.paragraph(
      fmt::format("The missing mass. Equation (39) says that a change of the terminal link shows "
                  "in its own eleven coefficients only. Its mass "
                  "also sits in the coefficients of every link inboard. Fitted over all six rows without any "
                  "noise, (39) gives {}; with the mass as "
                  "a twelfth parameter everything is exact. A k = 5 estimate corrects joints 5 and 6 only: "
                  "{} mN m of {} mN m are left at joints 1 to 4, "
                  "and joint 2 is worse off than without any correction.",
                  find("mass-missing", ""), find("rows-k5", ""), find("rows-uncorrected", "")));
  double lsm = 0, ivm = 0;
  for (const EncoderEstimate& e : loop.estimates) {
    if (e.name == "filtered, LSM") lsm = e.error;
    if (e.name == "filtered, IVM, desired acceleration") ivm = e.error;
  }
  page.paragraph(
      fmt::format("\"LSM and IVM nearly the same with encoder signals.\" True (e = {:.3f} and {:.3f} here), "
                  "but it says that the noise the method is made "
                  "for was not there, not that the method does as well without it: with white acceleration "
                  "noise of 10 rad/s² LSM is off by "
                  "{} in scenario B however long it runs, IVM by {}.",
                  lsm, ivm, find("lsm-constant-5ms", "B"), find("ivm-20000", "B")));
}

/// How many claims hold.
struct Tally {
  int held{0}, all{0};
  std::string sentence() const {
    return held == all ? fmt::format("All {} claims hold.", all)
                       : fmt::format("{} of {} claims hold; those that do not are marked.", held, all);
  }
};

Tally tally_of(const Study& study) {
  Tally tally;
  for (const auto* list : {&study.table, &study.requirements}) {
    for (const Claim& c : *list) {
      tally.held += c.holds ? 1 : 0;
      ++tally.all;
    }
  }
  return tally;
}

std::string text_of(const Study& study, const ClosedLoop& loop, const Tally& tally) {
  return fmt::format("{}\n\n{}\n{}\n", tally.sentence(), claim_table(study.table).to_text(2),
                     claim_table(study.requirements).to_text(2)) +
         fmt::format("Closed loop, 250 g at the wrist, rms tracking error [mrad]:\n{}\n",
                     closed_loop_table(loop).to_text(2));
}

void add_verdict(const Study& study, const ClosedLoop& loop, const Tally& tally, page::Page& page) {
  page.verdict(fmt::format("{} {} seeds of noise, scenarios A and B, sampled every 5 ms and 1 ms.",
                           tally.sentence(), study.options.seeds),
               page::tone_of(tally.held == tally.all ? host::Verdict::kGood : host::Verdict::kBad));
  const auto e_of = [&](ProtocolMethod m) { return errors_of(study.runs, true, 0.005, m, 20000).rms; };
  const double pd = rms_of_all(loop.runs[0]);
  page.facts({{"least squares", fmt::format("e = {:.3f}", e_of(ProtocolMethod::kLeastSquares)),
               "scenario B, 20000 samples: biased for good"},
              {"instrumental variables", fmt::format("e = {:.4f}", e_of(ProtocolMethod::kInstrumentModel)),
               "the same data: converges with √N"},
              {"computed torque, k = 5", fmt::format("{:.0f} %", 100 * rms_of_all(loop.runs[3]) / pd),
               "of the tracking error of PD, 250 g at the wrist"},
              {"with the payload's mass", fmt::format("{:.0f} %", 100 * rms_of_all(loop.runs[4]) / pd),
               "carried into every row"}});
}

void add_claims(const Study& study, page::Page& page) {
  page.heading("The table of claims");
  page.table(claim_table(study.table));
  page.note(
      "How printed digits are treated: a value is compared after rounding to the digits its range is printed "
      "with. A single figure that is itself an rms over seeds (the two IVM errors) counts as met within a "
      "quarter either way, since two such figures over some tens of seeds differ that much now and then; "
      "single noise-free figures count within one unit of the last digit. LSM figures are means over the "
      "seeds at the two N that the table names. Between these N the bias wanders with the part of the motion "
      "that the window holds, and may leave the range; those values are in brackets.");
  page.heading("Further requirements, and figures of the corrected equations");
  page.table(claim_table(study.requirements));
}

void add_instruments(const Study& study, page::Page& page) {
  page.heading("Instruments");
  page.table(instrument_table(study), "Error e, rms over seeds");
  page.note(
      "Anything correlated with the acceleration and independent of this sample's noise will do: the joint "
      "model (35) fitted to an earlier run, the mean of three earlier measured accelerations (the noise is "
      "white here), the desired acceleration, forward dynamics with the running estimate. At 5 ms they agree "
      "within the scatter from 20 s on.");
  page.table(base_table(study),
             "The eighteen base parameters, scenario B, 5 ms, 20000 samples; g m², g m, mN m, g m²/s; mean ± "
             "standard deviation over seeds");
}

void add_startup(const Study& study, page::Page& page) {
  page.heading("Start-up: what the estimator hands out");
  page.paragraph(
      "The production estimator with its default settings. Below about three seconds of this motion the "
      "instrumental system is poorly conditioned and its solution sometimes worthless; the estimator hands "
      "out the nominal values until least squares is determined, least squares until the instrumental "
      "system passes its conditioning check, instrumental variables from then on. Counts are seeds. "
      "Duration decides, not the number of samples.");
  page.table(startup_table(study, false, false), "Scenario A, 5 ms");
  page.table(startup_table(study, true, true), "Scenario B, 1 ms");
}

void add_missing_mass(const Study& study, page::Page& page) {
  page.heading("The mass that is missing in (39)");
  page.table(mass_column_table(study.mass_column),
             "Change of the terminal link from all six rows of the validation trajectory, noise-free");
  page.table(uncorrected_rows_table(study.uncorrected_rows),
             "Residual at joints 1 to 4, validation trajectory");
  page.table(rank_table(study.ranks), "Identifiable parameters of rows k to 6");
}

void add_files(const Study& study, StudyReport& report) {
  report.csv("table.csv", claim_table(study.table));
  report.csv("requirements.csv", claim_table(study.requirements));
  report.csv("instruments.csv", instrument_table(study));
  report.csv("base_parameters.csv", base_table(study));
  report.csv("startup_a_5ms.csv", startup_table(study, false, false));
  report.csv("startup_b_1ms.csv", startup_table(study, true, true));
  report.csv("mass_column.csv", mass_column_table(study.mass_column));
  report.csv("uncorrected_rows.csv", uncorrected_rows_table(study.uncorrected_rows));
  report.csv("runs.csv", points_table(study));
}

/// e over the seeds, of every scenario, period, estimator and number of samples.
nlohmann::ordered_json errors_json(const Study& study) {
  nlohmann::ordered_json errors = nlohmann::ordered_json::array();
  for (const bool b : {false, true}) {
    for (const double period : study.options.periods) {
      for (const ProtocolMethod method : protocol_methods()) {
        for (const int n : samples_of(study)) {
          const Spread s = errors_of(study.runs, b, period, method, n);
          if (s.count == 0) continue;
          errors.push_back({{"scenario", scenario_name(b)},
                            {"period", period},
                            {"estimator", to_string(method)},
                            {"samples", n},
                            {"e_rms", s.rms},
                            {"e_mean", s.mean},
                            {"e_std", s.deviation}});
        }
      }
    }
  }
  return errors;
}

nlohmann::ordered_json closed_loop_json(const ClosedLoop& loop) {
  nlohmann::ordered_json estimates = nlohmann::ordered_json::array();
  for (const EncoderEstimate& e : loop.estimates) {
    estimates.push_back({{"name", e.name}, {"e", host::number_or_null(e.error)}});
  }
  return {{"payload",
           {{"true", loop.payload_true},
            {"mass", loop.payload_mass},
            {"half_width_95", loop.payload_half_width},
            {"com", loop.payload_com},
            {"com_true", loop.payload_com_true}}},
          {"tracking", as_json(report::json(loop.runs))},
          {"estimates", estimates}};
}

nlohmann::ordered_json json_of(const Study& study, const ClosedLoop& loop, const Tally& tally) {
  return {{"publication", kPublication},
          {"seeds", study.options.seeds},
          {"claims", tally.all},
          {"held", tally.held},
          {"table", claims_json(study.table)},
          {"requirements", claims_json(study.requirements)},
          {"errors", errors_json(study)},
          {"closed_loop", closed_loop_json(loop)}};
}

}  // namespace

StudyReport reproduce_terminal_link(int seeds, const std::function<void(double)>& progress) {
  StudyOptions study_options;
  study_options.seeds = seeds;
  study_options.progress = progress;
  const Study study = run_study(study_options);
  const ClosedLoop loop = run_closed_loop(1);
  const Tally tally = tally_of(study);

  StudyReport report{page::new_page("Terminal-link estimation, reproduced", kPublication),
                     text_of(study, loop, tally),
                     {},
                     {},
                     {},
                     json_of(study, loop, tally)};
  page::Page& page = report.page;
  add_verdict(study, loop, tally, page);
  add_claims(study, page);
  add_figures(study, report);
  add_instruments(study, page);
  add_startup(study, page);
  add_missing_mass(study, page);
  add_closed_loop(loop, report);
  add_contradictions(study, loop, page);
  add_files(study, report);
  return report;
}

}  // namespace heft::studies
