#include "stiffness_parts.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

namespace heft::report {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using page::Table;

std::vector<double> numbers(const VectorXd& v) { return {v.data(), v.data() + v.size()}; }

namespace {

/// Outlines of the deflection ellipsoid in the three planes of the base.
void add_ellipsoid(const Eigen::Matrix3d& compliance, const std::string& pose, page::Page& page) {
  const char* axes = "xyz";
  std::vector<page::PlotSpec> specs;
  for (int first = 0; first < 3; ++first) {
    const int a = first == 2 ? 0 : first, b = first == 0 ? 1 : 2;  // xy, yz, xz
    Eigen::Matrix<double, 3, 2> plane;
    plane << Vector3d::Unit(a), Vector3d::Unit(b);
    const MatrixXd outline = 1e6 * stiffness::ellipsoid_outline(compliance, plane);
    page::PlotSpec spec;
    spec.title = fmt::format("{}{} plane", axes[a], axes[b]);
    spec.x_label = fmt::format("{} [µm/N]", axes[a]);
    spec.y_label = fmt::format("{} [µm/N]", axes[b]);
    spec.series = {page::line("deflection under 1 N in every direction", outline.col(0), outline.col(1))};
    spec.equal_axes = true;
    spec.width = 300;
    spec.height = 300;
    specs.push_back(spec);
  }
  page.plots(fmt::format("Displacement of the tool under 1 N at pose {}", pose), specs);
}

Table pose_table(const stiffness::ToolUse& use) {
  std::vector<std::string> headers{"pose",          "largest deflection [µm/N]",
                                   "along x, y, z", "smallest [µm/N]",
                                   "along x, y, z", "mean stiffness [N/mm]"};
  if (use.load.payload_mass > 0.0)
    headers.push_back(fmt::format("sag under {:g} kg [mm]", use.load.payload_mass));
  Table table(headers);
  const auto direction = [](const VectorXd& v) {
    return fmt::format("{:.2f}, {:.2f}, {:.2f}", v[0], v[1], v[2]);
  };
  for (const stiffness::ToolAtPose& at : use.poses) {
    const Eigen::Matrix3d block = at.stiffness.compliance.topLeftCorner<3, 3>();
    const stiffness::PrincipalDeflections& p = at.extremes;
    std::vector<std::string> row{at.pose.name,
                                 page::number(1e6 * p.magnitudes[0], 3),
                                 direction(p.directions.col(0)),
                                 page::number(1e6 * p.magnitudes[2], 3),
                                 direction(p.directions.col(2)),
                                 page::number(3e-3 / block.trace(), 3)};
    if (at.sag) row.push_back(page::number(1e3 * at.sag->tool.head<3>().norm(), 3));
    table.add_row(row);
  }
  return table;
}

/// Of the tool's distance from where it would be without load [mm].
struct Distance {
  double largest{0.0}, rms{0.0};
};
Distance distance_of(const stiffness::PathSag& sag) {
  const VectorXd distance = 1e3 * sag.tool.leftCols(3).rowwise().norm();
  return {distance.maxCoeff(), std::sqrt(distance.squaredNorm() / static_cast<double>(distance.size()))};
}

}  // namespace

std::string tool_text(const stiffness::ToolUse& use, const data::Log& path) {
  std::string text;
  if (!use.poses.empty())
    text +=
        "\nThe tool under load (base axes; deflection under a force of 1 N):\n" + pose_table(use).to_text(2);
  if (!use.path) return text;
  const Distance distance = distance_of(*use.path);
  text += fmt::format(
      "\nAlong {}: {:g} kg on the tool make it sag by up to {} mm ({} mm rms); with the compensated positions "
      "{} mm are left.\n",
      path.path, use.load.payload_mass, page::number(distance.largest, 3), page::number(distance.rms, 3),
      page::number(1e3 * use.path->left, 2));
  return text;
}

void put_tool(nlohmann::ordered_json& json, const stiffness::ToolUse& use, const data::Log& path) {
  nlohmann::ordered_json at_poses = nlohmann::ordered_json::array();
  for (const stiffness::ToolAtPose& at : use.poses) {
    const stiffness::PrincipalDeflections& p = at.extremes;
    nlohmann::ordered_json entry{{"pose", at.pose.name},
                                 {"compliance", nlohmann::ordered_json::array()},
                                 {"largest_deflection", p.magnitudes[0]},
                                 {"largest_direction", numbers(p.directions.col(0))},
                                 {"smallest_deflection", p.magnitudes[2]},
                                 {"smallest_direction", numbers(p.directions.col(2))},
                                 {"has_stiffness", at.stiffness.has_stiffness}};
    for (int r = 0; r < 6; ++r) entry["compliance"].push_back(numbers(at.stiffness.compliance.row(r)));
    if (at.sag) entry["sag"] = numbers(at.sag->tool);
    at_poses.push_back(entry);
  }
  if (!use.poses.empty()) json["tool"] = at_poses;
  if (!use.path) return;
  const Distance distance = distance_of(*use.path);
  json["path"] = {{"log", path.path},
                  {"payload", use.load.payload_mass},
                  {"sag_max", 1e-3 * distance.largest},
                  {"sag_rms", 1e-3 * distance.rms},
                  {"left", use.path->left}};
}

void add_tool(page::Page& page, const stiffness::ToolUse& use, const data::Log& path) {
  if (!use.poses.empty()) {
    page.heading("The tool under load");
    page.paragraph(
        "The joint stiffnesses give the tool a stiffness that changes with the pose. A force along a "
        "principal direction moves the tool along itself; all others move it sideways as well.");
    page.table(pose_table(use), "Extreme deflections of the tool point, base axes");
    const stiffness::ToolAtPose& first = use.poses.front();
    add_ellipsoid(first.stiffness.compliance.topLeftCorner<3, 3>(), first.pose.name, page);
  }
  if (!use.path) return;
  const stiffness::PathSag& sag = *use.path;
  page.heading("Along the path");
  page::PlotSpec spec;
  spec.title = "Sag of the tool";
  spec.x_label = "time [s]";
  spec.y_label = "displacement [mm]";
  const VectorXd x = 1e3 * sag.tool.col(0), y = 1e3 * sag.tool.col(1), z = 1e3 * sag.tool.col(2);
  spec.series = {page::line("x", path.time, x), page::line("y", path.time, y), page::line("z", path.time, z)};
  page.plot(spec);
  page.note(fmt::format("Largest distance {} mm; with the compensated positions {} mm are left.",
                        page::number(distance_of(sag).largest, 3), page::number(1e3 * sag.left, 2)));
}

}  // namespace heft::report
