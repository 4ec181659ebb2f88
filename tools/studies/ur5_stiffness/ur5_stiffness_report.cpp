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
#include "heft/page/page.hpp"
#include "host/json.hpp"
#include "page_lines.hpp"
#include "ur5_stiffness_study.hpp"

namespace heft::studies {
namespace {

using page::Hue;
using page::MapSpec;
using page::number;
using page::PlotSpec;
using page::Series;
using page::Style;
using page::Table;

constexpr double kDegree = std::numbers::pi / 180.0;
const std::vector<std::string> kJoints = {"joint 1", "joint 2", "joint 3", "joint 4", "joint 5", "joint 6"};

std::string kilo(double value) {
  if (std::isnan(value)) return "–";
  if (std::isinf(value)) return "∞";
  return fixed(1e-3 * value, std::abs(value) < 9950.0 ? 1 : 0);
}

std::string interval(const stiffness::StiffnessEstimate& e) {
  return e.determined && !std::isnan(e.stiffness_low)
             ? fmt::format("{} [{}, {}]", kilo(e.stiffness), kilo(e.stiffness_low), kilo(e.stiffness_high))
             : "–";
}

std::string percent(double share) {
  if (!std::isfinite(share)) return "–";
  return number(100.0 * share, 2);
}

std::string millimetres(double metres, int digits = 3) {
  return std::isfinite(metres) ? fixed(1e3 * metres, digits) : "–";
}

std::string effect_name(const std::string& id) {
  std::string name = id;
  std::replace(name.begin(), name.end(), '_', ' ');
  return name;
}

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
  Table table({"where", "the thesis", "evidence"});
  for (const Fault& f : faults) {
    if (f.kind == kind) table.add_row({f.where, f.says, f.found});
  }
  return table;
}

Table all_faults(const std::vector<Fault>& faults) {
  Table table({"id", "kind", "where", "the thesis", "evidence", "confirmed"});
  for (const Fault& f : faults)
    table.add_row({f.id, f.kind, f.where, f.says, f.found, f.confirmed ? "yes" : "no"});
  return table;
}

// ---------------------------------------------------------------------------------------------------------------------
// Dexterity.

MapSpec dexterity_map_plot(const Ur5Study& study, bool sound) {
  const stiffness::DexterityMap& map = sound ? study.dexterity.sound : study.dexterity.as_printed;
  MapSpec spec;
  spec.title =
      sound ? fmt::format("1/k_F with a length of {:.3f} m", study.dexterity.length)
            : "1/k_F over θ2 and θ3, wrist at 45°, lengths in millimetres over 0.8488 (figure 30 in kind)";
  spec.x_label = "θ2 [°]";
  spec.y_label = "θ3 [°]";
  spec.value_label = "1/k_F";
  spec.x_tics = 30;
  spec.y_tics = 45;
  for (const double v : map.first_values) spec.x.push_back(v / kDegree);
  for (const double v : map.second_values) spec.y.push_back(v / kDegree);
  // Both sides are whole turns: the first row and column once more at the end.
  spec.x.push_back(spec.x.front() + 360.0);
  spec.y.push_back(spec.y.front() + 360.0);
  const Eigen::Index rows = map.dexterity.rows(), cols = map.dexterity.cols();
  spec.values.resize(rows + 1, cols + 1);
  spec.values.topLeftCorner(rows, cols) = map.dexterity;
  spec.values.row(rows).head(cols) = map.dexterity.row(0);
  spec.values.col(cols) = spec.values.col(0);
  const double step = sound ? 0.1 : 0.0005;
  for (int k = 1; k * step < map.dexterity.maxCoeff(); ++k) spec.levels.push_back(k * step);
  for (const ZoneMatch& m : study.dexterity.matches) {
    spec.frames.push_back({m.printed[0], m.printed[1], m.printed[2], m.printed[3], m.name, false});
    if (sound) continue;
    spec.frames.push_back({std::max(m.found[0], -270.0), m.found[1], m.found[2], m.found[3], "", true});
    if (m.found[0] < -270.0) {  // goes on at the other end of the turn
      spec.frames.push_back({m.found[0] + 360.0, 90.0, m.found[2], m.found[3], "", true});
    }
  }
  for (const stiffness::LoadedPose& pose : study.stiffness.tool) {
    spec.places.push_back({pose.q[1] / kDegree, pose.q[2] / kDegree, pose.name});
  }
  return spec;
}

PlotSpec pose_dexterity_plot(const DexterityStudy& dexterity) {
  PlotSpec spec;
  spec.title = "1/k_F at the poses themselves, their own wrist";
  spec.x_label = "pose: six of table 6, nine of table 13";
  spec.y_label = "1/k_F";
  spec.height = 240;
  std::vector<double> measured, outside;
  for (const PoseDexterity& p : dexterity.poses) {
    spec.categories.push_back(p.measured ? p.name : p.name.substr(3));
    measured.push_back(p.measured ? p.sound : kNaN);
    outside.push_back(p.measured ? kNaN : p.sound);
  }
  // One bar a pose: points of the other kind are left out.
  Series a = page::bars("measured, \"in the zones\"", {}, Hue::kBlue),
         b = page::bars("\"out of the zones\"", {}, Hue::kOrange);
  for (std::size_t k = 0; k < measured.size(); ++k) {
    Series& s = dexterity.poses[k].measured ? a : b;
    // Two series share the width of a place; half of it to either side brings each to the middle.
    s.x.push_back(static_cast<double>(k) + (dexterity.poses[k].measured ? 0.2 : -0.2));
    s.y.push_back(dexterity.poses[k].sound);
  }
  spec.series = {a, b};
  return spec;
}

// ---------------------------------------------------------------------------------------------------------------------
// Stiffness.

Table stiffness_table(const StiffnessStudy& s) {
  Table table({"joint", "every joint its own", "two sizes of gear", "two sizes, both files",
               "its own, unread = zero", "direct, mean of 4 poses"});
  for (std::size_t j = 0; j < 6; ++j) {
    const auto i = static_cast<Eigen::Index>(j);
    table.add_row(
        {fmt::format("{}", j + 1), interval(s.own.joints[j]), interval(s.two.joints[j]),
         interval(s.two_both.joints[j]), interval(s.zeros.joints[j]),
         fmt::format("{} [{}, {}]", kilo(s.direct.mean[i]), kilo(s.direct.low[i]), kilo(s.direct.high[i]))});
  }
  return table;
}

Table fit_table(const StiffnessStudy& s) {
  Table table({"fit", "readings", "unknowns", "residual [mm]", "pose left out [mm]"});
  const auto add = [&](const char* name, const stiffness::StiffnessFit& fit, int unknowns) {
    table.add_row({name, fmt::format("{}", fit.readings), fmt::format("{}", unknowns),
                   millimetres(fit.fit_rms), millimetres(fit.left_out_rms)});
  };
  table.add_row({"the mean of the readings", "6", "1", "", millimetres(s.of_tool.mean_rms)});
  add("every joint its own", s.own, 5);
  add("two sizes of gear", s.two, 2);
  add("two sizes, both files", s.two_both, 2);
  return table;
}

Table direct_table(const stiffness::DirectStiffness& direct) {
  Table table({"pose", "joint 1", "joint 2", "joint 3", "joint 4", "joint 5", "joint 6"});
  std::vector<std::vector<std::string>> rows;
  for (std::size_t p = 0; p < direct.poses.size(); ++p) {
    std::vector<std::string> row{direct.poses[p]};
    for (Eigen::Index j = 0; j < 6; ++j) {
      row.push_back(kilo(direct.stiffness(static_cast<Eigen::Index>(p), j)));
    }
    rows.push_back(row);
  }
  for (const auto& [pose, why] : direct.refused) rows.push_back({pose, "–", "–", "–", "–", "–", "–"});
  std::sort(rows.begin(), rows.end());
  for (const auto& row : rows) table.add_row(row);
  return table;
}

PlotSpec least_squares_plot(const StiffnessStudy& s) {
  PlotSpec spec;
  spec.title = "Compliance of each joint by least squares, and with one pose left out (figure 38 in kind)";
  spec.y_label = "1/k [rad/(MN m)]";
  spec.categories = {kJoints.begin(), kJoints.begin() + 5};
  spec.y_range = std::pair<double, double>(-1500.0, 3200.0);
  Series whole{"every joint its own, 95 %", {}, {}, {}, Style::kIntervals, Hue::kSky},
      best{"every joint its own", {}, {}, {}, Style::kDots, Hue::kBlue},
      left{"the same with one pose left out", {}, {}, {}, Style::kDots, Hue::kVermillion},
      two{"two sizes of gear, 95 %", {}, {}, {}, Style::kIntervals, Hue::kGreen};
  const auto clip = [&](double v) { return std::clamp(v, spec.y_range->first, spec.y_range->second); };
  for (std::size_t j = 0; j < 5; ++j) {
    const auto x = static_cast<double>(j);
    whole.x.push_back(x - 0.15);
    whole.y.push_back(clip(1e6 * s.own.joints[j].compliance_low));
    whole.y_high.push_back(clip(1e6 * s.own.joints[j].compliance_high));
    best.x.push_back(x - 0.15);
    best.y.push_back(1e6 * s.own.joints[j].compliance);
    for (std::size_t k = 0; k < s.left_out.size(); ++k) {
      const double v = 1e6 * s.left_out[k].own[j];
      if (v < spec.y_range->first || v > spec.y_range->second) continue;
      left.x.push_back(x + 0.04 * (static_cast<double>(k) - 2.5));
      left.y.push_back(v);
    }
    two.x.push_back(x + 0.22);
    two.y.push_back(1e6 * s.two.joints[j].compliance_low);
    two.y_high.push_back(1e6 * s.two.joints[j].compliance_high);
  }
  spec.series = {whole, best, left, two};
  spec.marks = {{page::Mark::Direction::kHorizontal, 0.0, "rigid"}};
  return spec;
}

PlotSpec readings_plot(const StiffnessStudy& s) {
  PlotSpec spec;
  spec.title = "The six readings, the fit with two sizes of gear, and what the other five say";
  spec.x_label = "pose";
  spec.y_label = "displacement [mm]";
  spec.height = 240;
  std::vector<double> read, fitted, left;
  for (std::size_t k = 0; k < s.tool.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    const double value = s.tool[k].values[0];
    read.push_back(1e3 * value);
    fitted.push_back(1e3 * s.two.prediction[i]);
    // Along the reading's side on which the fit lies.
    const double sign = s.two.residual[i] < 0.0 ? -1.0 : 1.0;
    left.push_back(1e3 * (value - sign * s.two.poses[k].left_out));
    spec.categories.push_back(s.tool[k].name);
  }
  spec.series = {page::bars("read (mean of six)", read, Hue::kNeutral),
                 page::bars("fitted", fitted, Hue::kBlue),
                 page::bars("from the other five poses", left, Hue::kVermillion)};
  return spec;
}

PlotSpec direct_plot(const stiffness::DirectStiffness& direct) {
  PlotSpec spec;
  spec.title = "τ_i / δθ_i at the four poses that have an inverse (figure 41 in kind; cut at ±110)";
  spec.y_label = "stiffness [kN m/rad]";
  spec.categories = kJoints;
  spec.y_range = std::pair<double, double>(-110.0, 110.0);
  for (std::size_t p = 0; p < direct.poses.size(); ++p) {
    std::vector<double> values;
    for (Eigen::Index j = 0; j < 6; ++j) {
      values.push_back(std::clamp(1e-3 * direct.stiffness(static_cast<Eigen::Index>(p), j), -110.0, 110.0));
    }
    spec.series.push_back(page::bars("pose " + direct.poses[p], values));
  }
  spec.marks = {{page::Mark::Direction::kHorizontal, 0.0, ""}};
  return spec;
}

PlotSpec precision_plot(const SimulationStudy& simulation) {
  PlotSpec spec;
  spec.title =
      "What poses and instrument alone do: spread of each compliance by least squares (figures 38 to 40 in "
      "kind)";
  spec.y_label = "spread [%]";
  spec.log_y = true;
  spec.categories = kJoints;
  spec.y_range = std::pair<double, double>(0.1, 100.0);
  const std::array<std::pair<std::size_t, std::string>, 4> rows{
      {{0, "table 6, wire"},
       {1, "table 13, wire"},
       {3, "table 13, whole deflection"},
       {4, "table 6 with wrist at 45°, whole deflection"}}};
  for (const auto& [index, name] : rows) {
    std::vector<double> values;
    for (const double v : simulation.precisions[index].least_squares) {
      values.push_back(std::isfinite(v) ? std::min(100.0 * v, 100.0) : kNaN);
    }
    spec.series.push_back(page::bars(name, values));
  }
  return spec;
}

PlotSpec singles_plot(const SimulationStudy& simulation) {
  PlotSpec spec;
  spec.title = "One pose, whole deflection read by a tracker, stiffness by δθ = J⁻¹ δd";
  spec.x_label = "1/k_F of the pose";
  spec.y_label = "standard deviation of a joint's compliance, middle of the six joints [%]";
  spec.log_x = spec.log_y = true;
  spec.y_range = std::pair<double, double>(0.5, 2000.0);
  Series anywhere{"any pose", {}, {}, {}, Style::kPoints, Hue::kOrange},
      zone{"in the zones of table 5, wrist near 45°", {}, {}, {}, Style::kPoints, Hue::kBlue};
  for (const SinglePose& p : simulation.singles) {
    Series& s = p.in_zone ? zone : anywhere;
    s.x.push_back(p.dexterity);
    s.y.push_back(std::min(100.0 * p.error, 2000.0));
  }
  spec.series = {anywhere, zone};
  return spec;
}

Table precision_table(const SimulationStudy& simulation) {
  Table table({"poses", "instrument", "method", "1/k_F", "joint 1", "2", "3", "4", "5", "6"});
  for (const Precision& p : simulation.precisions) {
    const std::string range = fmt::format("{:.2f} to {:.2f}", p.least_dexterity, p.most_dexterity);
    std::vector<std::string> row{p.poses, p.instrument, "least squares", range};
    for (const double v : p.least_squares) row.push_back(percent(v));
    table.add_row(row);
    if (std::isnan(p.direct[0])) continue;
    row = {"", "", "direct", ""};
    for (std::size_t j = 0; j < 6; ++j) {
      row.push_back(std::isfinite(p.least_squares[j]) ? percent(p.direct[j]) : "–");
    }
    table.add_row(row);
  }
  return table;
}

std::vector<PlotSpec> ellipse_plots(const StiffnessStudy& s) {
  std::vector<PlotSpec> plots;
  const Eigen::Matrix3d C = s.cartesian.compliance.topLeftCorner<3, 3>();
  for (const bool from_above : {false, true}) {
    Eigen::Matrix<double, 3, 2> plane;
    plane.col(0) = Eigen::Vector3d::UnitX();
    plane.col(1) = from_above ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitZ();
    const Eigen::MatrixXd outline = 1e6 * stiffness::ellipsoid_outline(C, plane, 97);
    PlotSpec spec;
    spec.title = from_above ? "from above" : "from the side";
    spec.x_label = "x [µm/N]";
    spec.y_label = from_above ? "y [µm/N]" : "z [µm/N]";
    spec.equal_axes = true;
    spec.series = {page::line("all forces of 1 N", outline.col(0), outline.col(1), Hue::kBlue)};
    const std::array<Hue, 3> hues{Hue::kVermillion, Hue::kGreen, Hue::kPurple};
    const std::array<const char*, 3> names{"softest", "middle", "stiffest"};
    for (Eigen::Index k = 0; k < 3; ++k) {
      const Eigen::Vector2d tip =
          1e6 * s.principal.magnitudes[k] * (plane.transpose() * s.principal.directions.col(k));
      Series axis{names[static_cast<std::size_t>(k)], {-tip[0], tip[0]}, {-tip[1], tip[1]}, {}, Style::kLine,
                  hues[static_cast<std::size_t>(k)]};
      spec.series.push_back(axis);
    }
    plots.push_back(spec);
  }
  return plots;
}

// ---------------------------------------------------------------------------------------------------------------------
// The loop closed.

std::string parameter_of(const stiffness::StiffnessTrial& t) {
  if (std::isnan(t.parameter)) return "";
  if (t.unit == "rad") return fmt::format("{:.0f}°", t.parameter / kDegree);
  if (t.unit == "m") return fmt::format("{:.3f} mm", 1e3 * t.parameter);
  if (t.unit == "1") return fmt::format("× {:.1f}", t.parameter);
  return fmt::format("{} {}", number(t.parameter, 2), t.unit);
}

Table trial_table(const stiffness::StiffnessDiagnosis& d, const std::vector<std::string>& unseen) {
  Table table({"effect", "meaning", "best value", "residual [mm]", "pose left out [mm]", "p"});
  table.add_row({"none", "two sizes of gear alone", "", millimetres(d.before.fit_rms),
                 millimetres(d.before.left_out_rms), ""});
  for (const stiffness::StiffnessTrial& t : d.trials) {
    if (!t.possible) {
      const bool seen = std::find(unseen.begin(), unseen.end(), t.id) == unseen.end();
      table.add_row({effect_name(t.id), t.meaning,
                     seen ? "springs would give back energy" : "moves none of these readings", "–", "–",
                     "–"});
      continue;
    }
    table.add_row({effect_name(t.id), t.meaning, parameter_of(t), millimetres(t.fit_rms),
                   millimetres(t.left_out_rms), fmt::format("{:.2f}", t.p_value)});
  }
  return table;
}

Table correlation_table(const stiffness::StiffnessDiagnosis& tool,
                        const stiffness::StiffnessDiagnosis& both) {
  Table table({"residual against", "at the tool: r", "p", "both files: r", "p"});
  for (std::size_t k = 0; k < tool.correlations.size(); ++k) {
    const auto& a = tool.correlations[k];
    const auto& b = both.correlations[k];
    table.add_row(
        {a.with, fixed(a.coefficient, 2), fixed(a.p_value, 2), fixed(b.coefficient, 2), fixed(b.p_value, 2)});
  }
  return table;
}

Table power_table(const SimulationStudy& simulation) {
  Table table({"had this been the cause", "of this size", "six of table 6 [%]", "12 in the zones [%]",
               "20 in the zones [%]"});
  for (const Power& p : simulation.powers) {
    const bool seen = p.at_six + p.at_twelve + p.at_twenty > 0.0;
    table.add_row({effect_name(p.effect), p.size, seen ? fixed(100 * p.at_six, 0) : "–",
                   seen ? fixed(100 * p.at_twelve, 0) : "–", seen ? fixed(100 * p.at_twenty, 0) : "–"});
  }
  return table;
}

Table plan_table(const SimulationStudy& simulation) {
  Table table({"instrument", "poses", "joint 1", "2", "3", "4", "5", "6"});
  for (const Plan& p : simulation.plans) {
    std::vector<std::string> row{p.instrument, fmt::format("{}", p.poses)};
    for (const double v : p.half_width) row.push_back(percent(v));
    table.add_row(row);
  }
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
         {"compliance", host::number_or_null(e.compliance)},
         {"compliance_95", {host::number_or_null(e.compliance_low), host::number_or_null(e.compliance_high)}},
         {"stiffness", host::number_or_null(e.stiffness)},
         {"stiffness_95", {host::number_or_null(e.stiffness_low), host::number_or_null(e.stiffness_high)}}});
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

StudyReport report_of(const Ur5Study& study, const std::vector<Check>& checks) {
  const StiffnessStudy& s = study.stiffness;
  const SimulationStudy& simulation = study.simulation;
  StudyReport report{
      report::new_page(
          "Joint stiffness of the UR5, reproduced",
          "the thesis \"Experimental identification of the joints stiffness of the UR5 robot arm\", from its "
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
  page.facts({{"joints 1 to 3 [kN m/rad]", kilo(s.two.joints[0].stiffness),
               fmt::format("95 %: {} to {}", kilo(s.two.joints[0].stiffness_low),
                           kilo(s.two.joints[0].stiffness_high))},
              {"joints 4 to 6 [kN m/rad]", kilo(s.two.joints[3].stiffness),
               fmt::format("95 %: {} to {}", kilo(s.two.joints[3].stiffness_low),
                           kilo(s.two.joints[3].stiffness_high))},
              {"left by the fit", millimetres(s.two.fit_rms) + " mm",
               fmt::format("repeats scatter by {} mm", millimetres(s.two.repeatability))},
              {"maximum reach [mm]", fmt::format("{:.1f}", 1e3 * study.reach.maximum.value),
               "the thesis has 1019.2"},
              {"inconsistencies", fmt::format("{}", confirmed), "each with its evidence below"}});

  page.heading("What reproduces and what does not");
  page.table(check_table(checks));

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

  page.heading("Stiffness from the measured tables");
  page.paragraph(
      "Least squares of the compliances on the six mean readings of tables 7 to 12. The UR5 has gears of one "
      "size in joints 1 to 3 and of a smaller one in 4 to 6; with one compliance for each size two numbers "
      "remain, which six readings can bear. Five or six cannot.");
  page.table(stiffness_table(s), "Stiffness [kN m/rad] with 95 % intervals");
  report.csv("stiffness.csv", stiffness_table(s));
  page.table(fit_table(s));
  report.csv("fits.csv", fit_table(s));
  PlotSpec figure_38 = least_squares_plot(s);
  page.plot(figure_38);
  report.figure("figure_38.svg", figure_38);
  page.note(
      "Joint 6 is not there: no reading at the tool moves with it. The intervals of single joints rest on "
      "one spare reading and go beyond the drawing; two of the five best values are negative.");
  PlotSpec readings = readings_plot(s);
  page.plot(readings);
  report.figure("readings.svg", readings);
  page.table(direct_table(s.direct), "Direct method, τ_i / δθ_i [kN m/rad]; –: singular, J has no inverse");
  report.csv("direct.csv", direct_table(s.direct));
  PlotSpec figure_41 = direct_plot(s.direct);
  page.plot(figure_41);
  report.figure("figure_41.svg", figure_41);
  page.note(
      fmt::format("The direct method needs the whole deflection. As in the thesis, the displacement is put "
                  "along (1, 1, 0) of the tool, the rotation about z is the difference of the two sets over "
                  "0.5 m, all else is zero. {} of {} values are negative. With one pose and the whole "
                  "deflection read, least squares and the direct method are the same computation; they "
                  "differ only in how poses are put together.",
                  s.direct_negative, s.direct.stiffness.size()));

  page.heading("The tool at pose 3");
  page.paragraph(
      fmt::format("With the two stiffnesses found, a force of 1 N moves the tool by {:.1f} µm in the softest "
                  "and {:.1f} µm in the stiffest direction.",
                  1e6 * s.principal.magnitudes[0], 1e6 * s.principal.magnitudes[2]));
  std::vector<PlotSpec> ellipses = ellipse_plots(s);
  page.plots("Displacement of the tool under a force of 1 N, all directions", ellipses);
  report.figure("ellipse_side.svg", ellipses[0]);
  report.figure("ellipse_above.svg", ellipses[1]);

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

  page.heading("What the model leaves");
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
      fmt::format("\"Errors as large as now\": {:.0f} µm, what the six poses leave. Joint 5 stays worst: the "
                  "load has a lever of 82 mm about it. The load should be stated in base axes, hung at more "
                  "than one point, and the full deflection read.",
                  1e6 * simulation.unexplained));

  page.heading("What does not reproduce or is inconsistent");
  page.table(fault_table(study.faults, "result"), "What changes results");
  page.table(fault_table(study.faults, "data"), "Measured tables");
  page.table(fault_table(study.faults, "slip"), "Slips of formulas and text");
  report.csv("inconsistencies.csv", all_faults(study.faults));
  page.note(
      "No number of figures 38 to 41 is printed; they are rebuilt in kind. All evidence is computed from the "
      "tables; nothing was adjusted to fit.");
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
