#include "stiffness_parts.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "page_lines.hpp"

namespace heft::report {

using page::Table;

namespace {

/// Zones of a map above this share of its best are shown.
constexpr double kGoodShare = 0.7;
constexpr std::size_t kMostZones = 6;

/// What an entry of q is shown in: degrees, metres.
struct Unit {
  double factor;
  const char* name;
};
Unit unit_of(const model::Robot& robot, int joint) {
  return slides(robot, joint) ? Unit{1.0, "m"} : Unit{180.0 / std::numbers::pi, "°"};
}

std::string heading_of(const model::Robot& robot, int joint) {
  return fmt::format("q{} [{}]", joint + 1, unit_of(robot, joint).name);
}

double threshold_of(const stiffness::MeasurementPlan& plan) {
  return kGoodShare * plan.map.dexterity.maxCoeff();
}

std::vector<stiffness::DexterityZone> zones_of(const stiffness::MeasurementPlan& plan) {
  std::vector<stiffness::DexterityZone> zones = stiffness::zones(plan.map, threshold_of(plan));
  if (zones.size() > kMostZones) zones.resize(kMostZones);
  return zones;
}

std::string zone_caption(const stiffness::MeasurementPlan& plan) {
  return fmt::format("Zones of good dexterity through pose 1 (1/k_F above {:.2g})", threshold_of(plan));
}

Table zone_table(const stiffness::MeasurementPlan& plan) {
  const int first = plan.map.first.joint, second = plan.map.second.joint;
  const double a = unit_of(plan.robot, first).factor, b = unit_of(plan.robot, second).factor;
  Table table({heading_of(plan.robot, first), heading_of(plan.robot, second), "largest 1/k_F",
               "share of the map [%]"});
  for (const stiffness::DexterityZone& zone : zones_of(plan)) {
    table.add_row({fmt::format("{:.4g} to {:.4g}", a * zone.first_low, a * zone.first_high),
                   fmt::format("{:.4g} to {:.4g}", b * zone.second_low, b * zone.second_high),
                   page::number(zone.best, 2), page::number(100.0 * zone.share, 2)});
  }
  return table;
}

page::MapSpec map_of(const stiffness::MeasurementPlan& plan) {
  const stiffness::DexterityMap& map = plan.map;
  const int first = map.first.joint, second = map.second.joint;
  const double a = unit_of(plan.robot, first).factor, b = unit_of(plan.robot, second).factor;
  page::MapSpec spec;
  spec.title = "1/k_F through pose 1";
  spec.x_label = heading_of(plan.robot, first);
  spec.y_label = heading_of(plan.robot, second);
  spec.value_label = "1/k_F";
  for (const double v : map.first_values) spec.x.push_back(a * v);
  for (const double v : map.second_values) spec.y.push_back(b * v);
  spec.values = map.dexterity;
  for (int k = 1; 0.1 * k < map.dexterity.maxCoeff(); ++k) spec.levels.push_back(0.1 * k);
  const Eigen::VectorXd& q = plan.chosen.front().q;
  spec.places.push_back({a * q[first], b * q[second], "1"});
  return spec;
}

Table plan_table(const stiffness::MeasurementPlan& plan) {
  std::vector<std::string> headers{"pose"};
  for (int j = 0; j < plan.robot.num_joints(); ++j) headers.push_back(heading_of(plan.robot, j));
  headers.push_back("1/k_F");
  Table table(headers);
  for (std::size_t k = 0; k < plan.chosen.size(); ++k) {
    const Eigen::VectorXd& q = plan.chosen[k].q;
    std::vector<std::string> row{fmt::format("{}", k + 1)};
    for (int j = 0; j < plan.robot.num_joints(); ++j) {
      row.push_back(slides(plan.robot, j) ? fmt::format("{:.3f}", q[j])
                                          : fmt::format("{:.1f}", q[j] * 180.0 / std::numbers::pi));
    }
    row.push_back(page::number(plan.chosen[k].dexterity, 2));
    table.add_row(row);
  }
  return table;
}

Table deviation_table(const stiffness::MeasurementPlan& plan) {
  Table table({"joint", "standard deviation of its compliance per µm of reading noise [rad/(N·m), m/N]"});
  for (int j = 0; j < plan.robot.num_joints(); ++j)
    table.add_row({fmt::format("{}", j + 1), page::number(1e-6 * plan.deviation[j], 2)});
  return table;
}

}  // namespace

std::string brief(const stiffness::MeasurementPlan& plan) {
  return fmt::format("{} of {} safe poses: each joint's compliance known as well as so many poses allow.",
                     plan.chosen.size(), plan.safe);
}

std::string full(const stiffness::MeasurementPlan& plan) {
  return fmt::format(
      "{} of {} safe poses (links clear of one another, of floor and obstacles; at most one turn a joint), chosen "
      "for the smallest volume of uncertainty (D-optimal) among the half with the best dexterity, {:.3g} N on the "
      "tool. The way from one to the next is not checked.\n{}\nExpected of a tracker:\n{}\n{}:\n{}",
      plan.chosen.size(), plan.safe, plan.wrenches.front().head<3>().norm(), plan_table(plan).to_text(2),
      deviation_table(plan).to_text(2), zone_caption(plan), zone_table(plan).to_text(2));
}

nlohmann::ordered_json to_json(const stiffness::MeasurementPlan& plan) {
  nlohmann::ordered_json json{{"poses", plan.chosen.size()},
                              {"compliance_deviation_per_um", numbers(1e-6 * plan.deviation)},
                              {"zones", nlohmann::ordered_json::array()}};
  for (const stiffness::DexterityZone& zone : zones_of(plan)) {
    json["zones"].push_back({{"first", {zone.first_low, zone.first_high}},
                             {"second", {zone.second_low, zone.second_high}},
                             {"largest", zone.best}});
  }
  return json;
}

page::Page page(const stiffness::MeasurementPlan& plan) {
  page::Page page = page::new_page("Poses to measure stiffness at", plan.robot.name);
  page.verdict(brief(plan));
  page.table(plan_table(plan), "Poses");
  page.table(deviation_table(plan), "Expected accuracy with a tracker");
  page.heading("Dexterity");
  page.plot(map_of(plan));
  page.table(zone_table(plan), zone_caption(plan));
  return page;
}

}  // namespace heft::report
