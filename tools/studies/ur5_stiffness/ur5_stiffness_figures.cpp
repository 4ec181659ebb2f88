#include "ur5_stiffness_figures.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "heft/host/numbers.hpp"
#include "study_report.hpp"
#include "ur5_stiffness_setup.hpp"

namespace heft::studies {

using page::Hue;
using page::MapSpec;
using page::number;
using page::PlotSpec;
using page::Series;
using page::Style;
using page::Table;

namespace {

const std::vector<std::string> kJoints = {"joint 1", "joint 2", "joint 3", "joint 4", "joint 5", "joint 6"};

std::string parameter_of(const stiffness::StiffnessTrial& t) {
  if (std::isnan(t.parameter)) return "";
  if (t.unit == "rad") return fmt::format("{:.0f}°", t.parameter / kDegree);
  if (t.unit == "m") return fmt::format("{:.3f} mm", 1e3 * t.parameter);
  return fmt::format("{} {}", number(t.parameter, 2), t.unit);
}

}  // namespace

std::string kilo(double value) {
  if (std::isnan(value)) return "–";
  if (std::isinf(value)) return "∞";
  return fixed(1e-3 * value, std::abs(value) < 9950.0 ? 1 : 0);
}

std::string interval(const stiffness::StiffnessEstimate& e) {
  return e.determined && !std::isnan(e.stiffness.lower)
             ? fmt::format("{} [{}, {}]", kilo(e.stiffness.value), kilo(e.stiffness.lower),
                           kilo(e.stiffness.upper))
             : "–";
}

std::string percent(double share) {
  if (!std::isfinite(share)) return "–";
  return number(100.0 * share, 2);
}

std::string millimetres(double metres, int digits) {
  return std::isfinite(metres) ? fixed(1e3 * metres, digits) : "–";
}

std::string effect_name(const std::string& id) {
  std::string name = id;
  std::replace(name.begin(), name.end(), '_', ' ');
  return name;
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
    whole.y.push_back(clip(1e6 * s.own.joints[j].compliance.lower));
    whole.y_high.push_back(clip(1e6 * s.own.joints[j].compliance.upper));
    best.x.push_back(x - 0.15);
    best.y.push_back(1e6 * s.own.joints[j].compliance.value);
    for (std::size_t k = 0; k < s.left_out.size(); ++k) {
      const double v = 1e6 * s.left_out[k].own[j];
      if (v < spec.y_range->first || v > spec.y_range->second) continue;
      left.x.push_back(x + 0.04 * (static_cast<double>(k) - 2.5));
      left.y.push_back(v);
    }
    two.x.push_back(x + 0.22);
    two.y.push_back(1e6 * s.two.joints[j].compliance.lower);
    two.y_high.push_back(1e6 * s.two.joints[j].compliance.upper);
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

}  // namespace heft::studies
