#include "ur5_stiffness_report.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "heft/host/numbers.hpp"
#include "heft/page/origin.hpp"
#include "host/json.hpp"
#include "ur5_stiffness_figures.hpp"
#include "ur5_stiffness_study.hpp"

namespace heft::studies {
namespace {

using page::MapSpec;
using page::PlotSpec;
using page::Table;

// ---------------------------------------------------------------------------------------------------------------------
// What reproduces.

struct Check {
  std::string text, stated, found;
  bool holds;
};

std::vector<Check> checks_of(const Ur5Study& study) {
  const ReachStudy& reach = study.reach;
  const DexterityStudy& dexterity = study.dexterity;
  const std::size_t areas = stiffness::zones(dexterity.as_printed, 0.003).size();
  std::vector<Check> checks{
      {"distance of the tip from the base at (0°, -90°, 0°, -90°, 0°, 0°)", "1019.2 mm",
       fmt::format("{:.1f} mm", 1e3 * reach.distance), std::abs(reach.distance - 1.0192) < 0.05e-3},
      {"this is the maximum reach", "1019.2 mm", fmt::format("{:.1f} mm", 1e3 * reach.maximum.value),
       reach.maximum.value - reach.distance < 0.05e-3},
      {"ratio of reaches", "0.8488", fmt::format("{:.4f}", reach.ratio),
       std::abs(reach.ratio - 0.8488) < 5e-5},
      {"1/k_F in the zones of table 5 (middle value)", "0.0035 to 0.005",
       fmt::format("{:.4f}, {:.4f}, with lengths in mm", dexterity.matches[0].median,
                   dexterity.matches[1].median),
       dexterity.matches[0].median >= 0.0035 && dexterity.matches[0].median <= 0.005 &&
           dexterity.matches[1].median >= 0.0035 && dexterity.matches[1].median <= 0.005},
      {"areas of the map with acceptable values", "4",
       fmt::format("{} at 0.003, {} at 0.0035", areas, dexterity.zones.size()), areas == 4}};
  for (const ZoneMatch& m : dexterity.matches) {
    checks.push_back(
        {fmt::format("zone {}: θ2, θ3", m.name),
         fmt::format("{:.0f}° to {:.0f}°, {:.0f}° to {:.0f}°", m.printed[0], m.printed[1], m.printed[2],
                     m.printed[3]),
         fmt::format("{:.0f}° to {:.0f}°, {:.0f}° to {:.0f}° ({:.0f} % common) at {:.4f}", m.found[0],
                     m.found[1], m.found[2], m.found[3], 100 * m.overlap, dexterity.matching_threshold),
         m.overlap > 0.5});
  }
  checks.push_back({"singular at θ3 = 0°", "yes",
                    dexterity.straight < 1e-9 ? std::string("1/k_F = 0")
                                              : fmt::format("1/k_F = {:.4f}", dexterity.straight),
                    dexterity.straight < 1e-9});
  checks.push_back({"compliance and principal deflections of an arm of two joints, (71) to (81)",
                    "closed form", fmt::format("differ by {:.0e}", reach.planar_arm),
                    reach.planar_arm < 1e-12});
  checks.push_back({"table 3 is the ur5 that comes with heft", "",
                    reach.urdf_distance > 0.0
                        ? fmt::format("distances differ by {:.0e} m", reach.urdf_distance)
                        : std::string("the same at 200 poses"),
                    reach.urdf_distance < 1e-6});
  return checks;
}

Table check_table(const std::vector<Check>& checks) {
  Table table({"", "statement", "stated", "found"});
  for (const Check& c : checks)
    table.add_row({c.holds ? "holds" : "DOES NOT HOLD", c.text, c.stated, c.found});
  return table;
}

Table fault_table(const std::vector<Fault>& faults, const std::string& kind) {
  Table table({"where", "published", "evidence"});
  for (const Fault& f : faults) {
    if (f.kind == kind) table.add_row({f.where, f.says, f.found});
  }
  return table;
}

Table all_faults(const std::vector<Fault>& faults) {
  Table table({"id", "kind", "where", "published", "evidence", "confirmed"});
  for (const Fault& f : faults)
    table.add_row({f.id, f.kind, f.where, f.says, f.found, f.confirmed ? "yes" : "no"});
  return table;
}

// ---------------------------------------------------------------------------------------------------------------------
// Results for programs.

nlohmann::ordered_json json_fit(const stiffness::StiffnessFit& fit) {
  nlohmann::ordered_json json{{"residual_rms", host::number_or_null(fit.fit_rms)},
                              {"left_out_rms", host::number_or_null(fit.left_out_rms)},
                              {"joints", nlohmann::ordered_json::array()}};
  for (const stiffness::StiffnessEstimate& e : fit.joints) {
    json["joints"].push_back(
        {{"determined", e.determined},
         {"compliance", host::number_or_null(e.compliance.value)},
         {"compliance_95",
          {host::number_or_null(e.compliance.lower), host::number_or_null(e.compliance.upper)}},
         {"stiffness", host::number_or_null(e.stiffness.value)},
         {"stiffness_95",
          {host::number_or_null(e.stiffness.lower), host::number_or_null(e.stiffness.upper)}}});
  }
  return json;
}

nlohmann::ordered_json json_diagnosis(const stiffness::StiffnessDiagnosis& d) {
  nlohmann::ordered_json json{
      {"verdict", d.verdict},
      {"accepted", d.accepted >= 0 ? nlohmann::ordered_json(d.trials[static_cast<std::size_t>(d.accepted)].id)
                                   : nlohmann::ordered_json(nullptr)},
      {"mean_rms", host::number_or_null(d.mean_rms)},
      {"before_left_out_rms", host::number_or_null(d.before.left_out_rms)},
      {"after_left_out_rms", host::number_or_null(d.after.left_out_rms)},
      {"trials", nlohmann::ordered_json::array()},
      {"correlations", nlohmann::ordered_json::array()}};
  for (const auto& t : d.trials) {
    json["trials"].push_back({{"id", t.id},
                              {"parameter", host::number_or_null(t.parameter)},
                              {"unit", t.unit},
                              {"residual_rms", host::number_or_null(t.fit_rms)},
                              {"left_out_rms", host::number_or_null(t.left_out_rms)},
                              {"p", host::number_or_null(t.p_value)}});
  }
  for (const auto& c : d.correlations) {
    json["correlations"].push_back({{"with", c.with}, {"r", c.coefficient}, {"p", c.p_value}});
  }
  return json;
}

nlohmann::ordered_json json_of(const Ur5Study& study, const std::vector<Check>& checks) {
  nlohmann::ordered_json json{
      {"publication", "Experimental identification of the joints stiffness of the UR5 robot arm"},
      {"verdict", study.verdict}};
  json["checks"] = nlohmann::ordered_json::array();
  for (const Check& c : checks) {
    json["checks"].push_back(
        {{"statement", c.text}, {"stated", c.stated}, {"found", c.found}, {"holds", c.holds}});
  }
  json["reach"] = {{"at_printed_pose", study.reach.distance},
                   {"maximum", study.reach.maximum.value},
                   {"ratio", study.reach.ratio}};
  nlohmann::ordered_json poses = nlohmann::ordered_json::array();
  for (const PoseDexterity& p : study.dexterity.poses) {
    poses.push_back(
        {{"pose", p.name}, {"dexterity", p.sound}, {"as_printed", p.as_printed}, {"in_zone", p.in_zone}});
  }
  json["dexterity"] = {
      {"length", study.dexterity.length}, {"zones_at", study.dexterity.matching_threshold}, {"poses", poses}};
  for (const ZoneMatch& m : study.dexterity.matches) {
    json["dexterity"]["zones"].push_back(
        {{"name", m.name}, {"printed", m.printed}, {"found", m.found}, {"overlap", m.overlap}});
  }
  json["least_squares"] = {{"own", json_fit(study.stiffness.own)},
                           {"two_sizes", json_fit(study.stiffness.two)},
                           {"two_sizes_both_files", json_fit(study.stiffness.two_both)}};
  nlohmann::ordered_json direct = nlohmann::ordered_json::array();
  for (std::size_t p = 0; p < study.stiffness.direct.poses.size(); ++p) {
    std::vector<double> row;
    for (Eigen::Index j = 0; j < 6; ++j)
      row.push_back(study.stiffness.direct.stiffness(static_cast<Eigen::Index>(p), j));
    direct.push_back({{"pose", study.stiffness.direct.poses[p]}, {"stiffness", row}});
  }
  json["direct"] = direct;
  json["repeatability"] = study.stiffness.two.repeatability;
  json["diagnosis"] = {{"tool", json_diagnosis(study.stiffness.of_tool)},
                       {"both_files", json_diagnosis(study.stiffness.of_both)},
                       {"tool_own", json_diagnosis(study.stiffness.of_own)}};
  json["faults"] = nlohmann::ordered_json::array();
  for (const Fault& f : study.faults) {
    json["faults"].push_back({{"id", f.id},
                              {"kind", f.kind},
                              {"where", f.where},
                              {"says", f.says},
                              {"found", f.found},
                              {"values", f.values},
                              {"confirmed", f.confirmed}});
  }
  return json;
}

void add_dexterity(const Ur5Study& study, StudyReport& report) {
  page::Page& page = report.page;
  page.heading("Dexterity");
  page.paragraph(
      "1/k_F says how evenly the joints move the tool: 1 in every direction alike, 0 in a singular pose. "
      "Full frames are the zones of table 5, dashed ones the regions found. Numbers are the six measured "
      "poses. They lie in the zone by θ2 and θ3, but the map holds for a wrist at 45°, and theirs was not.");
  MapSpec map = dexterity_map_plot(study, false);
  page.plot(map);
  report.figure("figure_30.svg", map);
  page.plot(dexterity_map_plot(study, true));
  report.figure("dexterity_sound_length.svg", dexterity_map_plot(study, true));
  PlotSpec poses = pose_dexterity_plot(study.dexterity);
  page.plot(poses);
  report.figure("dexterity_of_poses.svg", poses);
  page.note(fmt::format(
      "Poses 1 and 5 have θ5 = 0 and are singular, pose 6 nearly so. Length: {:.3f} m, the root mean square "
      "distance of the joint axes from the tool over the six poses; over all poses k_F is least with {:.3f} "
      "m.",
      study.dexterity.length, study.dexterity.least.length));
}

void add_stiffness(const Ur5Study& study, StudyReport& report) {
  const StiffnessStudy& s = study.stiffness;
  page::Page& page = report.page;
  page.heading("Stiffness from the measured tables");
  page.paragraph(
      "Least squares of the compliances on the six mean readings of tables 7 to 12. The UR5 has gears of "
      "one size in joints 1 to 3 and of a smaller one in 4 to 6; with one compliance for each size two "
      "unknowns remain, which six readings can determine; five or six unknowns they cannot.");
  page.table(stiffness_table(s), "Stiffness [kN m/rad] with 95 % intervals");
  report.csv("stiffness.csv", stiffness_table(s));
  page.table(fit_table(s));
  report.csv("fits.csv", fit_table(s));
  PlotSpec figure_38 = least_squares_plot(s);
  page.plot(figure_38);
  report.figure("figure_38.svg", figure_38);
  page.note(
      "Joint 6 is missing: no reading at the tool moves with it. The intervals of single joints rest on one "
      "spare reading and exceed the drawing; two of the five best values are negative.");
  PlotSpec readings = readings_plot(s);
  page.plot(readings);
  report.figure("readings.svg", readings);
  page.table(direct_table(s.direct), "Direct method, τ_i / δθ_i [kN m/rad]; –: singular, J has no inverse");
  report.csv("direct.csv", direct_table(s.direct));
  PlotSpec figure_41 = direct_plot(s.direct);
  page.plot(figure_41);
  report.figure("figure_41.svg", figure_41);
  page.note(
      fmt::format("The direct method needs the whole deflection. As published, the displacement is put "
                  "along (1, 1, 0) of the tool, the rotation about z is the difference of the two sets over "
                  "0.5 m, all else is zero. {} of {} values are negative. With one pose and the whole "
                  "deflection read, least squares and the direct method are the same computation; they "
                  "differ only in how poses are put together.",
                  s.direct_negative, s.direct.stiffness.size()));
}

void add_tool(const Ur5Study& study, StudyReport& report) {
  const StiffnessStudy& s = study.stiffness;
  page::Page& page = report.page;
  page.heading("The tool at pose 3");
  page.paragraph(
      fmt::format("With the two stiffnesses found, a force of 1 N moves the tool by {:.1f} µm in the softest "
                  "and {:.1f} µm in the stiffest direction.",
                  1e6 * s.principal.magnitudes[0], 1e6 * s.principal.magnitudes[2]));
  std::vector<PlotSpec> ellipses = ellipse_plots(s);
  page.plots("Displacement of the tool under a force of 1 N, all directions", ellipses);
  report.figure("ellipse_side.svg", ellipses[0]);
  report.figure("ellipse_above.svg", ellipses[1]);
}

void add_poses(const Ur5Study& study, StudyReport& report) {
  const SimulationStudy& simulation = study.simulation;
  page::Page& page = report.page;
  page.heading("Poses and instrument: in the zones and out of them");
  page.paragraph(
      fmt::format("No deflections are printed for table 13, and those of figure 40 were chosen. Simulated "
                  "readings of an arm with the two "
                  "stiffnesses show what the poses alone do ({} draws). The wire and \"whole\" err as the "
                  "measured means do ({:.1f} µm, "
                  "over 0.5 m for rotations), the tracker by {:.0f} µm and {:.0f} µrad. Spread: half the "
                  "width that holds the middle "
                  "68 %, over the true value. A joint without a bar is not seen.",
                  simulation.draws, 1e6 * simulation.wire_noise, 1e6 * simulation.tracker_noise,
                  1e6 * simulation.tracker_rotation));
  PlotSpec precision = precision_plot(simulation);
  page.plot(precision);
  report.figure("figures_38_39_40.svg", precision);
  PlotSpec singles = singles_plot(simulation);
  page.plot(singles);
  report.figure("in_and_out_of_the_zones.svg", singles);
  page.table(
      precision_table(simulation),
      "Spread of each joint [%]: compliance by least squares, stiffness by the direct method; –: not seen");
  report.csv("simulated_precision.csv", precision_table(simulation));
  page.note(
      "The direct method inverts J at each pose and suffers where 1/k_F is small. Least squares never "
      "inverts J: stacked poses do nearly as well out of the zones, and the nine poses of table 13 do better "
      "than the six that were measured. What matters to least squares is that the load bends each joint and "
      "that the reading sees it. 1/k_F knows neither: with θ6 = 45° the load puts no torque on joint 5 at "
      "all.");
}

void add_effects(const Ur5Study& study, StudyReport& report) {
  const SimulationStudy& simulation = study.simulation;
  const StiffnessStudy& s = study.stiffness;
  page::Page& page = report.page;
  page.heading("What the model leaves unexplained");
  page.paragraph(s.of_tool.verdict);
  page.table(trial_table(s.of_tool, s.unseen_at_tool),
             "Effects tried on the six readings at the tool, each together with the two stiffnesses");
  report.csv("effects_tool.csv", trial_table(s.of_tool, s.unseen_at_tool));
  page.table(trial_table(s.of_both, s.unseen_in_both), "The same on both sets, twelve readings");
  report.csv("effects_both.csv", trial_table(s.of_both, s.unseen_in_both));
  page.note(
      "p: how often the best of all effects does as well on residuals shuffled among the poses. An effect is "
      "accepted below 0.05 if it takes a tenth of the error on poses left out at least. None is.");
  page.table(correlation_table(s.of_tool, s.of_both), "Correlation of the residual with the pose");
  report.csv("correlations.csv", correlation_table(s.of_tool, s.of_both));
  page.table(
      power_table(simulation),
      fmt::format("Simulated readings with one cause put in: found and named, of {} draws, wire at the tool",
                  simulation.power_draws));
  report.csv("power.csv", power_table(simulation));
  page.paragraph(
      "So each effect that a reading at the tool can show would nearly always have been named at these six "
      "poses, had it been the only cause and of that size. None was. Several together, stiffnesses that "
      "differ within a gear size, or tables that are not what they say remain, and six numbers cannot "
      "separate these: two go into the stiffnesses, and each cause takes one or two more. The second set "
      "does not help, since it repeats the first.");
  page.table(plan_table(simulation),
             fmt::format("What would decide: half width of the 95 % interval of each joint's compliance [%], "
                         "poses with 1/k_F of at least {:.2f} chosen best of 400; –: not seen",
                         simulation.plans.empty() ? 0.0 : simulation.plans.front().least_dexterity));
  report.csv("plans.csv", plan_table(simulation));
  page.note(
      fmt::format("\"Errors as large as at present\": {:.0f} µm, what the six poses leave. Joint 5 stays "
                  "worst: the load has a lever of 82 mm about it. The load should be stated in base axes, "
                  "hung at more than one point, and the full deflection read.",
                  1e6 * simulation.unexplained));
}

void add_faults(const Ur5Study& study, StudyReport& report) {
  page::Page& page = report.page;
  page.heading("What does not reproduce or is inconsistent");
  page.table(fault_table(study.faults, "result"), "What changes results");
  page.table(fault_table(study.faults, "data"), "Measured tables");
  page.table(fault_table(study.faults, "slip"), "Slips of formulas and text");
  report.csv("inconsistencies.csv", all_faults(study.faults));
  page.note(
      "No number of figures 38 to 41 is printed; they are rebuilt in kind. All evidence is computed from the "
      "tables; nothing was adjusted to fit.");
}

StudyReport report_of(const Ur5Study& study, const std::vector<Check>& checks) {
  const StiffnessStudy& s = study.stiffness;
  StudyReport report{
      page::new_page(
          "Joint stiffness of the UR5, reproduced",
          "UPC-ETSEIB, Experimental identification of the joints stiffness of the UR5 robot arm, 2017, from its "
          "own tables"),
      {},
      {},
      {},
      {},
      {}};
  page::Page& page = report.page;
  page.verdict(study.verdict, page::Tone::kNeutral);
  const auto confirmed = static_cast<int>(
      std::count_if(study.faults.begin(), study.faults.end(), [](const Fault& f) { return f.confirmed; }));
  page.facts(
      {{"joints 1 to 3 [kN m/rad]", kilo(s.two.joints[0].stiffness.value),
        fmt::format("95 %: {} to {}", kilo(s.two.joints[0].stiffness.lower),
                    kilo(s.two.joints[0].stiffness.upper))},
       {"joints 4 to 6 [kN m/rad]", kilo(s.two.joints[3].stiffness.value),
        fmt::format("95 %: {} to {}", kilo(s.two.joints[3].stiffness.lower),
                    kilo(s.two.joints[3].stiffness.upper))},
       {"left by the fit", millimetres(s.two.fit_rms) + " mm",
        fmt::format("repeats scatter by {} mm", millimetres(s.two.repeatability))},
       {"maximum reach [mm]", fmt::format("{:.1f}", 1e3 * study.reach.maximum.value), "published: 1019.2"},
       {"inconsistencies", fmt::format("{}", confirmed), "each with its evidence below"}});

  page.heading("What reproduces and what does not");
  page.table(check_table(checks));
  add_dexterity(study, report);
  add_stiffness(study, report);
  add_tool(study, report);
  add_poses(study, report);
  add_effects(study, report);
  add_faults(study, report);
  return report;
}

}  // namespace

StudyReport reproduce_ur5_stiffness(int seeds, const std::function<void(double)>& progress) {
  const Ur5Study study = run_ur5_study(seeds, progress);
  const std::vector<Check> checks = checks_of(study);
  StudyReport report = report_of(study, checks);
  report.text = fmt::format("{}\n\n{}\n", study.verdict, check_table(checks).to_text(2));
  report.text += fmt::format("Stiffness [kN m/rad] with 95 % intervals:\n{}\n",
                             stiffness_table(study.stiffness).to_text(2));
  report.text += fmt::format("Effects tried on the residual of the six readings at the tool:\n{}\n",
                             trial_table(study.stiffness.of_tool, study.stiffness.unseen_at_tool).to_text(2));
  report.text += fmt::format("Inconsistencies ({}):\n", study.faults.size());
  for (const Fault& f : study.faults) {
    report.text += fmt::format("  {}: {}\n    {}\n", f.where, f.says, f.found);
  }
  report.text += "\n";
  report.csv("checks.csv", check_table(checks));
  report.json = json_of(study, checks);
  return report;
}

}  // namespace heft::studies
