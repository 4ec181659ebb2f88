#include "ur5_stiffness_study.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <numbers>
#include <random>
#include <sstream>

#include <fmt/format.h>
#include <Eigen/Dense>

#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/host/numbers.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/host/parallel.hpp"
#include "heft/urdf/urdf_import.hpp"

namespace heft::studies {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kStatedReach = 0.850;  // of the maker [m]
// (135) in axes of the tool, and the cantilever's end that its moment puts the weight at.
const Vector3d kForce(13.20, 13.20, 0.0), kMoment(0.0, 0.0, 9.336);
const Vector3d kAlong = Vector3d(1.0, 1.0, 0.0).normalized();
const Vector3d kCantileverEnd = 0.5 * Vector3d(1.0, -1.0, 0.0).normalized();

VectorXd degrees(std::initializer_list<double> list) {
  VectorXd q(static_cast<Index>(list.size()));
  Index k = 0;
  for (const double v : list) q[k++] = v * kDegree;
  return q;
}

/// Rows of numbers of a file of ours, by the names in its first line.
std::vector<std::map<std::string, double>> read_columns(const std::string& name) {
  const std::string path = urdf::resolve_measurements(name);
  std::istringstream text(host::read_file(path, "measurements"));
  const auto split = [](const std::string& line) {
    std::vector<std::string> cells;
    std::istringstream stream(line);
    for (std::string cell; std::getline(stream, cell, ',');) cells.push_back(cell);
    return cells;
  };
  std::string line;
  std::getline(text, line);
  const std::vector<std::string> names = split(line);
  std::vector<std::map<std::string, double>> rows;
  for (int number = 2; std::getline(text, line); ++number) {
    if (line.empty()) continue;
    const std::vector<std::string> cells = split(line);
    if (cells.size() != names.size()) {
      throw DataError(fmt::format("{}:{}: found {} columns, expected {} as in the first line", path, number,
                                  cells.size(), names.size()));
    }
    std::map<std::string, double> row;
    for (std::size_t c = 0; c < cells.size(); ++c) row[names[c]] = std::strtod(cells[c].c_str(), nullptr);
    rows.push_back(std::move(row));
  }
  return rows;
}

double distance_at(const model::Kinematics& kinematics, const VectorXd& q) {
  return kinematics.tip(q).position.norm();
}

/// Largest slope and curvature of the distance from the base.
std::pair<double, double> shape_of_distance(const model::Kinematics& kinematics, const VectorXd& q) {
  const Index n = q.size();
  constexpr double h = 1e-4;
  VectorXd slope(n);
  MatrixXd curvature(n, n);
  const auto at = [&](Index i, double a, Index j, double b) {
    VectorXd moved = q;
    moved[i] += a;
    moved[j] += b;
    return distance_at(kinematics, moved);
  };
  for (Index i = 0; i < n; ++i) {
    slope[i] = (at(i, h, i, 0) - at(i, -h, i, 0)) / (2 * h);
    for (Index j = 0; j < n; ++j) {
      curvature(i, j) = (at(i, h, j, h) - at(i, h, j, -h) - at(i, -h, j, h) + at(i, -h, j, -h)) / (4 * h * h);
    }
  }
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(0.5 * (curvature + curvature.transpose()));
  return {slope.cwiseAbs().maxCoeff(), eigen.eigenvalues().maxCoeff()};
}

/// (71), (77), (81) on an arm of two joints, against the closed forms: largest relative error.
double check_planar_arm() {
  const double l1 = 0.4, l2 = 0.3, k1 = 8000.0, k2 = 3000.0;
  const model::Kinematics arm(model::make_standard_dh_robot("planar", {{l1, 0, 0, 1}, {l2, 0, 0, 1}}));
  double worst = 0.0;
  for (const double q2 : {0.3, 1.1, -2.0}) {
    const VectorXd q = Eigen::Vector2d(0.7, q2), k = Eigen::Vector2d(k1, k2);
    const Eigen::Matrix2d C = stiffness::cartesian_stiffness(arm, q, k).compliance.topLeftCorner<2, 2>();
    const double x = l1 * std::cos(q[0]) + l2 * std::cos(q[0] + q2),
                 y = l1 * std::sin(q[0]) + l2 * std::sin(q[0] + q2);
    const double s = l2 * std::sin(q[0] + q2), c = l2 * std::cos(q[0] + q2);
    Eigen::Matrix2d closed;
    closed << y * y / k1 + s * s / k2, -x * y / k1 - c * s / k2, -x * y / k1 - c * s / k2,
        x * x / k1 + c * c / k2;
    worst = std::max(worst, (C - closed).cwiseAbs().maxCoeff() / closed.cwiseAbs().maxCoeff());
    const Eigen::Matrix2d square = closed * closed;
    const double root = std::sqrt(std::pow(square(0, 0) - square(1, 1), 2) + 4 * square(0, 1) * square(0, 1));
    const stiffness::PrincipalDeflections p = stiffness::principal_deflections(C);
    worst = std::max(worst,
                     std::abs(p.magnitudes[0] / std::sqrt(0.5 * (square(0, 0) + square(1, 1) + root)) - 1.0));
  }
  return worst;
}

/// Angle in [from, from + 360).
double turned_to(double angle, double from) { return angle - 360.0 * std::floor((angle - from) / 360.0); }

const std::vector<std::pair<std::string, std::array<double, 4>>>& printed_zones() {
  static const std::vector<std::pair<std::string, std::array<double, 4>>> zones{
      {"Z1c", {-237.0, -152.0, 100.0, 172.0}}, {"Z2c", {-89.0, 23.0, 100.0, 172.0}}};
  return zones;
}

bool inside(const std::array<double, 4>& zone, double theta2, double theta3) {
  return turned_to(theta2, zone[0]) <= zone[1] && turned_to(theta3, zone[2]) <= zone[3];
}

bool in_a_zone(const VectorXd& q) {
  return std::any_of(printed_zones().begin(), printed_zones().end(),
                     [&](const auto& zone) { return inside(zone.second, q[1] / kDegree, q[2] / kDegree); });
}

/// Common area over joint area.
double overlap(const std::array<double, 4>& a, const std::array<double, 4>& b) {
  const double width = std::min(a[1], b[1]) - std::max(a[0], b[0]),
               height = std::min(a[3], b[3]) - std::max(a[2], b[2]);
  const double common = std::max(0.0, width) * std::max(0.0, height);
  return common / ((a[1] - a[0]) * (a[3] - a[2]) + (b[1] - b[0]) * (b[3] - b[2]) - common);
}

/// Half the width that holds the middle 68 % of the values.
double middle_spread(std::vector<double> values) {
  if (values.empty()) return kNaN;
  std::sort(values.begin(), values.end());
  const auto at = [&](double part) {
    return values[static_cast<std::size_t>(part * static_cast<double>(values.size() - 1))];
  };
  return 0.5 * (at(0.84) - at(0.16));
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

/// Poses in the zones of table 5, the wrist near 45° as in table 4 but for the last joint, which 1/k_F does not depend
/// on: at 45° the load (135) puts no torque on joint 5.
std::vector<VectorXd> poses_in_zones(int count, std::uint32_t seed) {
  std::mt19937_64 random(seed);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  std::vector<VectorXd> poses;
  for (int k = 0; k < count; ++k) {
    const std::array<double, 4>& zone = printed_zones()[static_cast<std::size_t>(k) % 2].second;
    VectorXd q(6);
    q << uniform(-180, 180), uniform(zone[0], zone[1]), uniform(zone[2], zone[3]), uniform(30, 60),
        uniform(30, 60), uniform(-180, 180);
    poses.push_back(q * kDegree);
  }
  return poses;
}

/// Poses anywhere with 1/k_F between two values.
std::vector<VectorXd> poses_between(const model::Kinematics& kinematics, double length, double low,
                                    double high, int count, std::uint32_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> turn(-std::numbers::pi, std::numbers::pi);
  std::vector<VectorXd> poses;
  while (static_cast<int>(poses.size()) < count) {
    VectorXd q(6);
    for (double& v : q) v = turn(random);
    const double dexterity = stiffness::dexterity(kinematics.jacobian(q), length);
    if (dexterity >= low && dexterity < high) poses.push_back(q);
  }
  return poses;
}

void add_noise(std::vector<stiffness::LoadedPose>& poses, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  for (stiffness::LoadedPose& pose : poses) {
    for (Index r = 0; r < pose.values.size(); ++r) pose.values[r] += pose.sigmas[r] * normal(random);
  }
}

/// Joints that move a reading at all.
bool is_seen(const std::vector<stiffness::LoadedPose>& poses, Index joint) {
  double most = 0.0, of_this = 0.0;
  for (const stiffness::LoadedPose& pose : poses) {
    const MatrixXd A = stiffness::compliance_rows(pose.J, pose.wrench, pose.rows);
    most = std::max(most, A.cwiseAbs().maxCoeff());
    of_this = std::max(of_this, A.col(joint).cwiseAbs().maxCoeff());
  }
  return of_this > 1e-9 * most;
}

Precision precision_of(const model::Kinematics& kinematics, const std::string& name,
                       const std::string& instrument, const std::vector<VectorXd>& where, Instrument kind,
                       double sigma, double sigma_rotation, const VectorXd& truth, double length, int draws) {
  std::vector<stiffness::LoadedPose> exact =
      loaded_with(kinematics, where, kind, sigma, sigma_rotation, length);
  set_values(exact, truth);
  Precision precision;
  precision.poses = name;
  precision.instrument = instrument;
  precision.count = static_cast<int>(where.size());
  precision.least_dexterity = kInfinity;
  for (const stiffness::LoadedPose& pose : exact) {
    precision.least_dexterity = std::min(precision.least_dexterity, pose.dexterity);
    precision.most_dexterity = std::max(precision.most_dexterity, pose.dexterity);
  }
  stiffness::StiffnessOptions options;
  std::vector<bool> seen;
  for (Index j = 0; j < 6; ++j) {
    seen.push_back(is_seen(exact, j));
    if (seen.back()) options.groups.push_back({static_cast<int>(j)});
  }
  std::array<std::vector<double>, 6> compliance, stiffness;
  std::mt19937_64 random(1);
  for (int draw = 0; draw < draws; ++draw) {
    std::vector<stiffness::LoadedPose> poses = exact;
    add_noise(poses, random);
    const stiffness::StiffnessFit fit = stiffness::fit_stiffness(kinematics, poses, options, length);
    for (std::size_t j = 0; j < 6; ++j) {
      if (fit.joints[j].determined) {
        compliance[j].push_back(fit.joints[j].compliance / truth[static_cast<Index>(j)]);
      }
    }
    if (kind != Instrument::kWhole) continue;
    const stiffness::DirectStiffness direct = stiffness::direct_stiffness(poses, false);
    for (std::size_t j = 0; j < 6; ++j) {
      stiffness[j].push_back(direct.mean[static_cast<Index>(j)] * truth[static_cast<Index>(j)]);
    }
  }
  for (std::size_t j = 0; j < 6; ++j) {
    precision.least_squares[j] = seen[j] ? middle_spread(compliance[j]) : kInfinity;
    precision.direct[j] = middle_spread(stiffness[j]);
  }
  return precision;
}

std::vector<SinglePose> single_poses(const model::Kinematics& kinematics, const SimulationStudy& simulation,
                                     const VectorXd& truth, double length) {
  std::vector<VectorXd> where = poses_in_zones(150, 5);
  const std::vector<VectorXd> anywhere = poses_between(kinematics, length, 0.002, 1.0, 450, 6);
  where.insert(where.end(), anywhere.begin(), anywhere.end());
  std::vector<SinglePose> singles;
  for (const stiffness::LoadedPose& pose :
       loaded_with(kinematics, where, Instrument::kWhole, simulation.tracker_noise,
                   simulation.tracker_rotation, length)) {
    // x = A⁻¹ δd: with one pose both methods are the same.
    const MatrixXd A = stiffness::compliance_rows(pose.J, pose.wrench, pose.rows);
    const Eigen::PartialPivLU<MatrixXd> lu(A);
    const MatrixXd inverse = lu.inverse() * pose.sigmas.asDiagonal();
    std::vector<double> relative;
    for (Index j = 0; j < 6; ++j) relative.push_back(inverse.row(j).norm() / truth[j]);
    std::sort(relative.begin(), relative.end());
    singles.push_back(
        {pose.dexterity, static_cast<int>(singles.size()) < 150, 0.5 * (relative[2] + relative[3])});
  }
  return singles;
}

std::vector<Plan> plans_of(const model::Kinematics& kinematics, const SimulationStudy& simulation,
                           const VectorXd& truth, double length) {
  constexpr double kLeast = 0.25;
  std::vector<Plan> plans;
  struct Choice {
    const char* name;
    Instrument instrument;
    double sigma, sigma_rotation;
    std::vector<int> counts;
  };
  for (const Choice& choice :
       {Choice{"wire at the tool", Instrument::kWire, simulation.wire_noise, 0.0, {6, 12}},
        Choice{"wire at the cantilever's end",
               Instrument::kWireAtCantilever,
               simulation.wire_noise,
               0.0,
               {6, 12}},
        Choice{
            "tracker", Instrument::kWhole, simulation.tracker_noise, simulation.tracker_rotation, {3, 6, 10}},
        Choice{"tracker, errors as large as at present",
               Instrument::kWhole,
               simulation.unexplained,
               simulation.unexplained / 0.5,
               {6, 10, 20}}}) {
    const bool sees_last = choice.instrument != Instrument::kWire;
    const Index p = sees_last ? 6 : 5;
    const std::vector<stiffness::PoseCandidate> candidates = stiffness::pose_candidates(
        kinematics, length, 400,
        [&](const VectorXd& q) -> MatrixXd {
          const stiffness::LoadedPose pose =
              loaded_with(kinematics, {q}, choice.instrument, choice.sigma, choice.sigma_rotation, length)
                  .front();
          const MatrixXd A = stiffness::compliance_rows(pose.J, pose.wrench, pose.rows);
          return (pose.sigmas.cwiseInverse().asDiagonal() * A).leftCols(p);
        },
        3);
    for (const int count : choice.counts) {
      const stiffness::PoseChoice chosen = stiffness::choose_poses(candidates, count, kLeast);
      const MatrixXd covariance = chosen.information.ldlt().solve(MatrixXd::Identity(p, p));
      Plan plan;
      plan.instrument = choice.name;
      plan.poses = count;
      plan.least_dexterity = kLeast;
      plan.half_width.fill(kInfinity);
      for (Index j = 0; j < p; ++j) {
        plan.half_width[static_cast<std::size_t>(j)] =
            statistics::kNormal95 * std::sqrt(covariance(j, j)) / truth[j];
      }
      plans.push_back(plan);
    }
  }
  return plans;
}

/// Effects put into simulated readings, in a size that would matter.
struct Cause {
  std::string id, size;
  double parameter;
};
const std::vector<Cause>& causes() {
  static const std::vector<Cause> list{{"sensor_offset", "0.08 mm", 0.08e-3},
                                       {"tool_bending", "20 µrad/(N m)", 20e-6},
                                       {"measuring_direction", "30°", 30 * kDegree},
                                       {"load_direction", "30°", 30 * kDegree},
                                       {"arm_of_load", "× 0.5", 0.5},
                                       {"load_is_weight", "", 0.0}};
  return list;
}

/// Share of the draws in which a cause is accepted under its own name.
double share_named(const model::Kinematics& kinematics, const std::vector<stiffness::LoadedPose>& nominal,
                   const std::vector<stiffness::StiffnessEffect>& effects, const Cause& cause,
                   const VectorXd& truth, double length, int draws) {
  const auto effect =
      std::find_if(effects.begin(), effects.end(), [&](const auto& e) { return e.id == cause.id; });
  std::vector<stiffness::LoadedPose> exact =
      effect->change ? effect->change(nominal, cause.parameter) : nominal;
  set_values(exact, truth);
  if (effect->column) {
    const VectorXd column = effect->column(nominal);
    Index row = 0;
    for (stiffness::LoadedPose& pose : exact) {
      for (double& v : pose.values) v += cause.parameter * column[row++];
    }
  }
  stiffness::StiffnessOptions options;
  options.groups = {{0, 1, 2}, {3, 4, 5}};
  std::mt19937_64 random(11);
  int named = 0;
  for (int draw = 0; draw < draws; ++draw) {
    std::vector<stiffness::LoadedPose> poses = nominal;
    for (std::size_t k = 0; k < poses.size(); ++k) poses[k].values = exact[k].values;
    add_noise(poses, random);
    const stiffness::StiffnessDiagnosis d =
        stiffness::diagnose_stiffness(kinematics, poses, options, effects, length);
    named += d.accepted >= 0 && d.trials[static_cast<std::size_t>(d.accepted)].id == cause.id ? 1 : 0;
  }
  return static_cast<double>(named) / draws;
}

std::string verdict_of(const Ur5Study& study) {
  const StiffnessStudy& s = study.stiffness;
  const auto size = [&](std::size_t joint) {
    const stiffness::StiffnessEstimate& e = s.two.joints[joint];
    return fmt::format("{:.1f} kN m/rad [{:.1f}, {:.1f}]", 1e-3 * e.stiffness, 1e-3 * e.stiffness_low,
                       1e-3 * e.stiffness_high);
  };
  const bool decided = s.of_tool.accepted >= 0 || s.of_own.accepted >= 0 || s.of_both.accepted >= 0;
  return fmt::format(
      "Kinematics and dexterity map reproduce, the map only with lengths in millimetres; the joint "
      "stiffnesses do not. The six readings support one value for each size of gear: {} for joints 1 to 3, "
      "{} for joints 4 to 6. They leave a residual of {:.3f} mm, {:.0f} times the scatter of repeats. Its "
      "cause {} with six scalar measurements.",
      size(0), size(3), 1e3 * s.two.fit_rms, s.two.fit_rms / s.two.repeatability,
      decided ? "was decided" : "cannot be decided");
}

}  // namespace

Ur5Measurements read_ur5_measurements() {
  Ur5Measurements m;
  for (const bool cantilever : {false, true}) {
    const std::string name = cantilever ? "ur5-stiffness/cantilever.csv" : "ur5-stiffness/tool.csv";
    (cantilever ? m.cantilever : m.tool) = data::read_deflections(urdf::resolve_measurements(name), 6, "ur5");
    for (const auto& row : read_columns(name)) {
      // The tables have thousandths of a millimetre.
      const auto millimetres = [&](const char* column) { return std::round(1e6 * row.at(column)) * 1e-3; };
      m.printed.push_back({static_cast<int>(row.at("table")), static_cast<int>(row.at("pose")),
                           static_cast<int>(row.at("repeat")), millimetres("unloaded"), millimetres("loaded"),
                           millimetres("printed")});
    }
  }
  for (const auto& row : read_columns("ur5-stiffness/outside-zones.csv")) {
    VectorXd q(6);
    for (int j = 0; j < 6; ++j) q[j] = row.at(fmt::format("q{}", j + 1));
    m.outside.push_back(q);
  }
  return m;
}

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

ReachStudy study_reach(const model::Kinematics& kinematics) {
  ReachStudy reach;
  reach.pose = degrees({0, -90, 0, -90, 0, 0});
  const Vector3d tip = kinematics.tip(reach.pose).position;
  reach.distance = tip.norm();
  reach.height = tip.z();
  std::tie(reach.slope, reach.curvature) = shape_of_distance(kinematics, reach.pose);
  reach.maximum = stiffness::maximum_reach(kinematics);
  reach.turned_wrist = distance_at(kinematics, degrees({0, -90, 0, -90, 180, 0}));
  reach.ratio = kStatedReach / reach.distance;
  reach.turned_ratio = kStatedReach / reach.turned_wrist;
  const model::Kinematics of_urdf(urdf::load_urdf(urdf::resolve_robot("ur5")));
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> turn(-std::numbers::pi, std::numbers::pi);
  for (int k = 0; k < 200; ++k) {
    VectorXd q(6);
    for (double& v : q) v = turn(random);
    reach.urdf_distance =
        std::max(reach.urdf_distance, std::abs(distance_at(kinematics, q) - distance_at(of_urdf, q)));
  }
  reach.planar_arm = check_planar_arm();
  return reach;
}

DexterityStudy study_dexterity(const model::Kinematics& kinematics, const Ur5Measurements& measurements) {
  DexterityStudy study;
  const VectorXd wrist = degrees({0, 0, 0, 45, 45, 45});
  // Three degrees apart; whole turns.
  const stiffness::MapAxis theta2{1, -270 * kDegree, 90 * kDegree, 120}, theta3{2, 0.0, 360 * kDegree, 120};
  const double printed_length = 0.8488e-3;  // lengths of J in mm over 0.8488
  study.as_printed = stiffness::dexterity_map(kinematics, wrist, theta2, theta3, printed_length);
  study.zones = stiffness::zones(study.as_printed, study.threshold);
  // The threshold with which the regions of the map are most like table 5.
  const auto match_at = [&](double threshold, std::vector<ZoneMatch>& matches) {
    matches.clear();
    double sum = 0.0;
    const std::vector<stiffness::DexterityZone> zones = stiffness::zones(study.as_printed, threshold);
    for (const auto& [name, printed] : printed_zones()) {
      ZoneMatch match;
      match.name = name;
      match.printed = printed;
      for (const stiffness::DexterityZone& zone : zones) {
        std::array<double, 4> found{zone.first_low / kDegree, zone.first_high / kDegree,
                                    zone.second_low / kDegree, zone.second_high / kDegree};
        // The same turn as the printed one.
        const double shift = 360.0 * std::round((printed[0] + printed[1] - found[0] - found[1]) / 720.0);
        found[0] += shift;
        found[1] += shift;
        const double common = overlap(printed, found);
        if (common > match.overlap) {
          match.overlap = common;
          match.found = found;
        }
      }
      sum += match.overlap;
      matches.push_back(match);
    }
    return sum / static_cast<double>(matches.size());
  };
  double best_overlap = -1.0;
  for (int step = 0; step <= 28; ++step) {
    std::vector<ZoneMatch> matches;
    const double threshold = 0.0028 + 0.0001 * step;
    if (const double mean = match_at(threshold, matches); mean > best_overlap) {
      best_overlap = mean;
      study.matches = matches;
      study.matching_threshold = threshold;
    }
  }
  study.in_metres = stiffness::dexterity_map(kinematics, wrist, theta2, theta3, 0.8488).dexterity.maxCoeff();

  const std::vector<VectorXd> measured = poses_of(measurements.tool);
  double square = 0.0;
  for (const VectorXd& q : measured) {
    square += std::pow(stiffness::rms_axis_distance(kinematics.jacobian(q)), 2);
  }
  study.length = std::sqrt(square / static_cast<double>(measured.size()));
  study.least = stiffness::characteristic_length(kinematics);
  study.sound = stiffness::dexterity_map(kinematics, wrist, theta2, theta3, study.length);

  const MatrixXd& D = study.as_printed.dexterity;
  const auto count = static_cast<double>(D.size());
  study.share_called_bad = static_cast<double>((D.array() >= 0.001 && D.array() <= 0.005).count()) / count;
  study.share_called_good = static_cast<double>((D.array() >= 0.0035 && D.array() <= 0.005).count()) / count;
  for (Index i = 0; i < D.rows(); ++i) {
    VectorXd q = wrist;
    q[1] = study.as_printed.first_values[i];
    for (const auto& [angle, value] : {std::pair{0.0, &study.straight}, std::pair{180.0, &study.folded}}) {
      q[2] = angle * kDegree;
      *value = std::max(*value, stiffness::dexterity(kinematics.jacobian(q), study.length));
    }
  }

  for (ZoneMatch& match : study.matches) {
    std::vector<double> values;
    for (Index i = 0; i < D.rows(); ++i) {
      for (Index j = 0; j < D.cols(); ++j) {
        if (!inside(match.printed, study.as_printed.first_values[i] / kDegree,
                    study.as_printed.second_values[j] / kDegree)) {
          continue;
        }
        values.push_back(D(i, j));
        match.best = std::max(match.best, study.sound.dexterity(i, j));
      }
    }
    std::sort(values.begin(), values.end());
    match.low = values.front();
    match.median = values[values.size() / 2];
    match.high = values.back();
  }
  // As many points of the other map as are high in this one: do they lie at the same place?
  std::vector<double> sorted(study.sound.dexterity.data(),
                             study.sound.dexterity.data() + study.sound.dexterity.size());
  std::sort(sorted.begin(), sorted.end(), std::greater<>());
  const auto high = static_cast<std::size_t>((D.array() >= study.threshold).count());
  const double equal = sorted[std::min(high, sorted.size() - 1)];
  const auto both =
      static_cast<double>((D.array() >= study.threshold && study.sound.dexterity.array() > equal).count());
  study.zones_that_stay = both / static_cast<double>(high);

  const auto add = [&](const std::string& name, const VectorXd& q, bool is_measured) {
    const MatrixXd J = kinematics.jacobian(q);
    study.poses.push_back({name, stiffness::dexterity(J, printed_length),
                           stiffness::dexterity(J, study.length), is_measured, in_a_zone(q)});
  };
  for (std::size_t k = 0; k < measured.size(); ++k) add(fmt::format("{}", k + 1), measured[k], true);
  for (std::size_t k = 0; k < measurements.outside.size(); ++k) {
    add(fmt::format("13.{}", k + 1), measurements.outside[k], false);
  }
  return study;
}

StiffnessStudy study_stiffness(const model::Kinematics& kinematics, const Ur5Measurements& measurements) {
  StiffnessStudy study;
  std::vector<data::Deflection> rows = measurements.tool;
  rows.insert(rows.end(), measurements.cantilever.begin(), measurements.cantilever.end());
  study.tool = stiffness::loaded_poses(kinematics, measurements.tool);
  study.both = stiffness::loaded_poses(kinematics, rows);
  double square = 0.0;
  for (const stiffness::LoadedPose& pose : study.tool)
    square += std::pow(stiffness::rms_axis_distance(pose.J), 2);
  study.length = std::sqrt(square / static_cast<double>(study.tool.size()));

  stiffness::StiffnessOptions own, two;
  own.groups = {{0}, {1}, {2}, {3}, {4}, {5}};
  two.groups = {{0, 1, 2}, {3, 4, 5}};
  study.own = stiffness::fit_stiffness(kinematics, study.tool, own, study.length);
  study.two = stiffness::fit_stiffness(kinematics, study.tool, two, study.length);
  study.two_both = stiffness::fit_stiffness(kinematics, study.both, two, study.length);
  study.truth.resize(6);
  for (std::size_t j = 0; j < 6; ++j) study.truth[static_cast<Index>(j)] = study.two.joints[j].compliance;

  // A (110) has six rows a pose: displacement along u as read, all else zero.
  std::vector<stiffness::LoadedPose> zeros = study.tool;
  for (stiffness::LoadedPose& pose : zeros) {
    const Vector3d along = pose.rows.row(0).head<3>().transpose();
    const double value = pose.values[0];
    pose.rows = MatrixXd::Identity(6, 6);
    pose.values = VectorXd::Zero(6);
    pose.values.head<3>() = value * along;
    pose.sigmas = VectorXd::Zero(6);
    pose.scatter = VectorXd::Constant(6, kNaN);
  }
  study.zeros = stiffness::fit_stiffness(kinematics, zeros, own, study.length);

  stiffness::StiffnessOptions without_last;
  without_last.groups = {{0}, {1}, {2}, {3}, {4}};
  for (std::size_t left = 0; left < study.tool.size(); ++left) {
    std::vector<stiffness::LoadedPose> others = study.tool;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(left));
    StiffnessStudy::LeftOut out;
    out.pose = study.tool[left].name;
    out.own.fill(kNaN);
    const stiffness::StiffnessFit five =
        stiffness::fit_stiffness(kinematics, others, without_last, study.length);
    for (std::size_t j = 0; j < 5; ++j) out.own[j] = five.joints[j].compliance;
    const stiffness::StiffnessFit sizes = stiffness::fit_stiffness(kinematics, others, two, study.length);
    out.two = {sizes.joints[0].compliance, sizes.joints[3].compliance};
    study.left_out.push_back(out);
  }

  // The direct method: displacement of the tool along u; rotation about z from the cantilever's end, 0.5 m away at
  // right angles to u, minus the tool; all else zero.
  std::vector<data::Deflection> combined = measurements.tool;
  for (std::size_t k = 0; k < combined.size(); ++k) {
    const double rotation =
        (measurements.cantilever[k].readings.front().value - combined[k].readings.front().value) / 0.5;
    combined[k].readings.push_back({true, Vector3d::UnitZ(), rotation, 0.0});
  }
  study.direct = stiffness::direct_stiffness(stiffness::loaded_poses(kinematics, combined), true);
  study.direct_negative = static_cast<int>((study.direct.stiffness.array() < 0.0).count());

  const std::vector<stiffness::StiffnessEffect> effects =
      stiffness::known_stiffness_effects(kinematics.robot());
  for (const stiffness::StiffnessEffect& effect : effects) {
    if (!effect.column) continue;
    for (const auto& [poses, unseen] :
         {std::pair{&study.tool, &study.unseen_at_tool}, std::pair{&study.both, &study.unseen_in_both}}) {
      if (effect.column(*poses).cwiseAbs().maxCoeff() < 1e-12) unseen->push_back(effect.id);
    }
  }
  study.of_own = stiffness::diagnose_stiffness(kinematics, study.tool, without_last, effects, study.length);
  study.of_tool = stiffness::diagnose_stiffness(kinematics, study.tool, two, effects, study.length);
  study.of_both = stiffness::diagnose_stiffness(kinematics, study.both, two, effects, study.length);

  study.cartesian = stiffness::cartesian_stiffness(kinematics, study.tool[2].q, study.truth.cwiseInverse());
  study.principal = stiffness::principal_deflections(study.cartesian.compliance.topLeftCorner<3, 3>());
  return study;
}

SimulationStudy study_simulation(const model::Kinematics& kinematics, const Ur5Measurements& measurements,
                                 const StiffnessStudy& stiffness, double length, int seeds,
                                 const std::function<void(double)>& progress) {
  SimulationStudy study;
  study.wire_noise = stiffness.two.repeatability;
  study.unexplained = stiffness.two.fit_rms * std::sqrt(6.0 / 4.0);  // six readings, two unknowns
  study.draws = 15 * seeds;
  study.power_draws = std::max(10, seeds / 2);
  const VectorXd& truth = stiffness.truth;
  const std::vector<VectorXd> measured = poses_of(measurements.tool);
  std::vector<VectorXd> at_45 = measured;
  for (VectorXd& q : at_45) q.tail<3>().setConstant(45 * kDegree);

  const double wire = study.wire_noise, wire_rotation = wire / 0.5;
  struct Case {
    std::string poses, instrument;
    std::vector<VectorXd> where;
    Instrument kind;
    double sigma, sigma_rotation;
  };
  const std::vector<Case> cases{
      {"six of table 6", "wire", measured, Instrument::kWire, wire, 0.0},
      {"nine of table 13", "wire", measurements.outside, Instrument::kWire, wire, 0.0},
      {"six of table 6", "whole", measured, Instrument::kWhole, wire, wire_rotation},
      {"nine of table 13", "whole", measurements.outside, Instrument::kWhole, wire, wire_rotation},
      {"six of table 6, wrist at 45°", "whole", at_45, Instrument::kWhole, wire, wire_rotation},
      {"ten in the zones", "tracker", poses_in_zones(10, 1), Instrument::kWhole, study.tracker_noise,
       study.tracker_rotation},
      {"ten with 1/k_F below 0.1", "tracker", poses_between(kinematics, length, 0.01, 0.1, 10, 2),
       Instrument::kWhole, study.tracker_noise, study.tracker_rotation},
      {"ten with 1/k_F below 0.02", "tracker", poses_between(kinematics, length, 0.002, 0.02, 10, 3),
       Instrument::kWhole, study.tracker_noise, study.tracker_rotation}};

  const std::vector<stiffness::StiffnessEffect> effects =
      stiffness::known_stiffness_effects(kinematics.robot());
  struct Readings {
    std::vector<stiffness::LoadedPose> poses;
    double Power::*share;
    int draws;
  };
  const std::vector<Readings> readings{
      {loaded_with(kinematics, measured, Instrument::kWire, wire, 0.0, length), &Power::at_six,
       study.power_draws},
      {loaded_with(kinematics, poses_in_zones(12, 7), Instrument::kWire, wire, 0.0, length),
       &Power::at_twelve, study.power_draws},
      {loaded_with(kinematics, poses_in_zones(20, 8), Instrument::kWire, wire, 0.0, length),
       &Power::at_twenty, study.power_draws}};
  for (const Cause& cause : causes()) study.powers.push_back({cause.id, cause.size});

  study.precisions.resize(cases.size());
  const std::size_t powers = causes().size() * readings.size();
  host::for_each_parallel(
      cases.size() + powers + 2,
      [&](std::size_t job) {
        if (job < powers) {
          const Readings& r = readings[job % readings.size()];
          const std::size_t cause = job / readings.size();
          study.powers[cause].*r.share =
              share_named(kinematics, r.poses, effects, causes()[cause], truth, length, r.draws);
        } else if (job < powers + cases.size()) {
          const Case& c = cases[job - powers];
          study.precisions[job - powers] =
              precision_of(kinematics, c.poses, c.instrument, c.where, c.kind, c.sigma, c.sigma_rotation,
                           truth, length, study.draws);
        } else if (job == powers + cases.size()) {
          study.plans = plans_of(kinematics, study, truth, length);
        } else {
          study.singles = single_poses(kinematics, study, truth, length);
        }
      },
      progress);
  return study;
}

Ur5Study run_ur5_study(int seeds, const std::function<void(double)>& progress) {
  Ur5Study study;
  const model::Kinematics kinematics(make_thesis_ur5());
  study.measurements = read_ur5_measurements();
  study.reach = study_reach(kinematics);
  study.dexterity = study_dexterity(kinematics, study.measurements);
  study.stiffness = study_stiffness(kinematics, study.measurements);
  study.simulation = study_simulation(kinematics, study.measurements, study.stiffness, study.dexterity.length,
                                      seeds, progress);
  study.faults = find_faults(kinematics, study.measurements, study.reach, study.dexterity, study.stiffness);
  study.verdict = verdict_of(study);
  return study;
}

}  // namespace heft::studies
