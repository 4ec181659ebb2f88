#include "ur5_stiffness_setup.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace heft::studies {

using Eigen::Index;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

// (135) in axes of the tool, and the cantilever's end that its moment puts the weight at.
const Vector3d kForce(13.20, 13.20, 0.0), kMoment(0.0, 0.0, 9.336);
const Vector3d kAlong = Vector3d(1.0, 1.0, 0.0).normalized();
const Vector3d kCantileverEnd = 0.5 * Vector3d(1.0, -1.0, 0.0).normalized();

/// Angle in [from, from + 360).
double turned_to(double angle, double from) { return angle - 360.0 * std::floor((angle - from) / 360.0); }

}  // namespace

VectorXd degrees(std::initializer_list<double> list) {
  VectorXd q(static_cast<Index>(list.size()));
  Index k = 0;
  for (const double v : list) q[k++] = v * kDegree;
  return q;
}

const std::vector<std::pair<std::string, ZoneAngles>>& printed_zones() {
  static const std::vector<std::pair<std::string, ZoneAngles>> zones{{"Z1c", {-237.0, -152.0, 100.0, 172.0}},
                                                                     {"Z2c", {-89.0, 23.0, 100.0, 172.0}}};
  return zones;
}

bool inside(const ZoneAngles& zone, double theta2, double theta3) {
  return turned_to(theta2, zone[0]) <= zone[1] && turned_to(theta3, zone[2]) <= zone[3];
}

bool in_a_zone(const VectorXd& q) {
  return std::any_of(printed_zones().begin(), printed_zones().end(),
                     [&](const auto& zone) { return inside(zone.second, q[1] / kDegree, q[2] / kDegree); });
}

double overlap(const ZoneAngles& a, const ZoneAngles& b) {
  const double width = std::min(a[1], b[1]) - std::max(a[0], b[0]),
               height = std::min(a[3], b[3]) - std::max(a[2], b[2]);
  const double common = std::max(0.0, width) * std::max(0.0, height);
  return common / ((a[1] - a[0]) * (a[3] - a[2]) + (b[1] - b[0]) * (b[3] - b[2]) - common);
}

std::vector<VectorXd> poses_of(const std::vector<data::Deflection>& rows) {
  std::vector<VectorXd> poses;
  std::string last;
  for (const data::Deflection& row : rows) {
    if (row.pose != last) poses.push_back(row.q);
    last = row.pose;
  }
  return poses;
}

std::vector<std::vector<int>> gear_sizes() { return {{0, 1, 2}, {3, 4, 5}}; }

std::vector<stiffness::LoadedPose> loaded_with(const model::Kinematics& kinematics,
                                               const std::vector<VectorXd>& poses, Instrument instrument,
                                               double sigma, double sigma_rotation, double length) {
  std::vector<data::Deflection> rows;
  for (const VectorXd& q : poses) {
    data::Deflection row;
    row.pose = fmt::format("{}", rows.size() + 1);
    row.where = "simulated";
    row.tool_axes = true;
    row.q = q;
    row.force = kForce;
    row.moment = kMoment;
    if (instrument == Instrument::kWhole) {
      for (const bool rotation : {false, true}) {
        for (Index a = 0; a < 3; ++a) {
          row.readings.push_back({rotation, Vector3d::Unit(a), 0.0, rotation ? sigma_rotation : sigma});
        }
      }
    } else {
      if (instrument == Instrument::kWireAtCantilever) row.point = kCantileverEnd;
      row.readings.push_back({false, kAlong, 0.0, sigma});
    }
    rows.push_back(std::move(row));
  }
  return stiffness::loaded_poses(kinematics, rows, length);
}

void set_values(std::vector<stiffness::LoadedPose>& poses, const VectorXd& compliance) {
  for (stiffness::LoadedPose& pose : poses) {
    pose.values = stiffness::compliance_rows(pose.J, pose.wrench, pose.rows) * compliance;
  }
}

}  // namespace heft::studies
