#include "stiffness_forward.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "console.hpp"
#include "heft/excite/excite.hpp"
#include "heft/host/decompositions.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/model/model_file.hpp"
#include "heft/stiffness/cartesian_stiffness.hpp"
#include "heft/stiffness/dexterity.hpp"
#include "page_lines.hpp"

namespace heft::tools {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using page::Table;

namespace {

/// A force at `point` of the tool frame as a wrench about the tip, base axes.
stiffness::Vector6d wrench_of(const Vector3d& force, const std::vector<double>& point,
                              const model::ToolPlacement& tip) {
  const Vector3d lever =
      point.empty() ? Vector3d(Vector3d::Zero()) : Vector3d(tip.rotation * Vector3d(point.data()));
  stiffness::Vector6d wrench;
  wrench << force, lever.cross(force);
  return wrench;
}

std::vector<double> numbers(const VectorXd& v) { return {v.data(), v.data() + v.size()}; }

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
  page.plots(fmt::format("Where the tool goes under 1 N at pose {}", pose), specs);
}

/// The log with other positions.
data::Log with_positions(data::Log log, const MatrixXd& compensated) {
  log.q = compensated;
  // Velocities and accelerations belong to the positions that were.
  log.qd.resize(log.q.rows(), 0);
  log.qdd.resize(log.q.rows(), 0);
  return log;
}

}  // namespace

namespace {

/// 1, 1e3 or 1e6, and the letter for it.
std::pair<double, const char*> prefix_of(double value) {
  if (std::abs(value) >= 1e6) return {1e6, "M"};
  if (std::abs(value) >= 1e3) return {1e3, "k"};
  return {1.0, ""};
}

const char* unit_of(bool prismatic) { return prismatic ? "N/m" : "N·m/rad"; }

}  // namespace

std::string stiffness_in_words(double stiffness, bool prismatic) {
  if (std::isnan(stiffness)) return "–";
  if (std::isinf(stiffness)) return "∞";
  const auto [scale, letter] = prefix_of(stiffness);
  return fmt::format("{} {}{}", page::number(stiffness / scale, 3), letter, unit_of(prismatic));
}

std::string stiffness_interval_in_words(double low, double high, bool prismatic) {
  if (std::isnan(low)) return "–";
  if (!std::isfinite(high))
    return low > 0.0 ? "at least " + stiffness_in_words(low, prismatic) : std::string("–");
  const auto [scale, letter] = prefix_of(low);
  return fmt::format("{} to {} {}{}", page::number(low / scale, 3), page::number(high / scale, 3), letter,
                     unit_of(prismatic));
}

void write_elastic_model(const std::string& path, model::Robot robot, const VectorXd& stiffness,
                         const std::string& method, const std::vector<std::string>& sources,
                         const std::vector<std::string>& notes) {
  robot.elasticities.clear();
  for (int j = 0; j < robot.num_joints(); ++j) {
    if (!std::isfinite(stiffness[j]) || stiffness[j] <= 0.0) continue;
    // Damping and the rotor's share of the inertia do not show in deflections at rest.
    robot.elasticities.push_back(
        {j, stiffness[j], 0.0, robot.joints[static_cast<std::size_t>(j)].actuation.rotor_inertia});
  }
  model::ModelFile file = model::make_model(robot);
  file.provenance.method = method;
  file.provenance.logs = sources;
  file.provenance.notes = notes;
  model::write_model(path, file);
}

data::Log read_path(const StiffnessCommandOptions& options, const model::Robot& robot) {
  if (options.path.empty()) return {};
  data::LogRequirements needs;
  needs.num_joints = robot.num_joints();
  needs.robot_name = robot.name;
  return data::read_log(options.path, needs);
}

ToolDescription describe_tool(const model::Kinematics& kinematics, const VectorXd& stiffness,
                              const std::vector<NamedPose>& poses, const data::Log& path,
                              const StiffnessCommandOptions& options, nlohmann::ordered_json& json,
                              page::Page& page) {
  std::string text;
  const model::Robot& robot = kinematics.robot();
  const bool loaded = options.payload.mass > 0.0;
  std::vector<std::string> headers{"pose",          "largest deflection [µm/N]",
                                   "along x, y, z", "smallest [µm/N]",
                                   "along x, y, z", "mean stiffness [N/mm]"};
  if (loaded) headers.push_back(fmt::format("sag under {:g} kg [mm]", options.payload.mass));
  Table table(headers);
  nlohmann::ordered_json at_poses = nlohmann::ordered_json::array();
  const auto direction = [](const VectorXd& v) {
    return fmt::format("{:.2f}, {:.2f}, {:.2f}", v[0], v[1], v[2]);
  };
  for (const NamedPose& pose : poses) {
    const stiffness::CartesianStiffness c = stiffness::cartesian_stiffness(kinematics, pose.q, stiffness);
    const Eigen::Matrix3d block = c.compliance.topLeftCorner<3, 3>();
    const stiffness::PrincipalDeflections p = stiffness::principal_deflections(block);
    std::vector<std::string> row{pose.name,
                                 page::number(1e6 * p.magnitudes[0], 3),
                                 direction(p.directions.col(0)),
                                 page::number(1e6 * p.magnitudes[2], 3),
                                 direction(p.directions.col(2)),
                                 page::number(3e-3 / block.trace(), 3)};
    nlohmann::ordered_json entry{{"pose", pose.name},
                                 {"compliance", nlohmann::ordered_json::array()},
                                 {"largest_deflection", p.magnitudes[0]},
                                 {"largest_direction", numbers(p.directions.col(0))},
                                 {"smallest_deflection", p.magnitudes[2]},
                                 {"smallest_direction", numbers(p.directions.col(2))},
                                 {"has_stiffness", c.has_stiffness}};
    for (int r = 0; r < 6; ++r) entry["compliance"].push_back(numbers(c.compliance.row(r)));
    if (loaded) {
      const stiffness::ToolDeflection sag =
          stiffness::exact_deflection(kinematics, pose.q, stiffness,
                                      wrench_of(options.payload.mass * Vector3d(robot.gravity.data()),
                                                options.payload.com, kinematics.tip(pose.q)));
      row.push_back(page::number(1e3 * sag.tool.head<3>().norm(), 3));
      entry["sag"] = numbers(sag.tool);
    }
    table.add_row(row);
    at_poses.push_back(entry);
  }
  if (!poses.empty()) {
    text += "\nThe tool under load (base axes; deflection under a force of 1 N):\n" + table.to_text(2);
    page.heading("The tool under load");
    page.paragraph(
        "Joint stiffnesses make a stiffness of the tool that changes with the pose. A force along a "
        "principal direction "
        "moves the tool along itself; all others move it sideways as well.");
    page.table(table, "Extreme deflections of the tool point, base axes");
    const stiffness::CartesianStiffness c =
        stiffness::cartesian_stiffness(kinematics, poses.front().q, stiffness);
    add_ellipsoid(c.compliance.topLeftCorner<3, 3>(), poses.front().name, page);
    json["tool"] = at_poses;
  }
  if (path.num_samples() == 0) return {text, {}};

  stiffness::SagLoad load;
  load.payload_mass = options.payload.mass;
  if (!options.payload.com.empty()) load.payload_com = Vector3d(options.payload.com.data());
  const stiffness::PathSag sag = stiffness::sag_along_path(kinematics, path.q, stiffness, load);
  const VectorXd distance = 1e3 * sag.tool.leftCols(3).rowwise().norm();
  const double largest = distance.maxCoeff(),
               rms = std::sqrt(distance.squaredNorm() / static_cast<double>(distance.size()));
  text += fmt::format(
      "\nAlong {}: {:g} kg on the tool make it sag by up to {} mm ({} mm rms); with the compensated "
      "positions {} mm are "
      "left.\n",
      options.path, options.payload.mass, page::number(largest, 3), page::number(rms, 3),
      page::number(1e3 * sag.left, 2));
  json["path"] = {{"log", options.path},
                  {"payload", options.payload.mass},
                  {"sag_max", 1e-3 * largest},
                  {"sag_rms", 1e-3 * rms},
                  {"left", sag.left}};
  page.heading("Along the path");
  page::PlotSpec spec;
  spec.title = "Sag of the tool";
  spec.x_label = "time [s]";
  spec.y_label = "displacement [mm]";
  const VectorXd x = 1e3 * sag.tool.col(0), y = 1e3 * sag.tool.col(1), z = 1e3 * sag.tool.col(2);
  spec.series = {page::line("x", path.time, x), page::line("y", path.time, y), page::line("z", path.time, z)};
  page.plot(spec);
  page.note(fmt::format("Largest distance {} mm; with the compensated positions {} mm are left.",
                        page::number(largest, 3), page::number(1e3 * sag.left, 2)));
  if (options.compensated.empty()) return {text, {}};
  return {text, with_positions(path, sag.compensated)};
}

void finish_with_path(const Console& console, const StiffnessCommandOptions& options,
                      const nlohmann::ordered_json& json, const page::Page& page,
                      const data::Log& compensated, const std::function<void()>& write_model) {
  const auto write_path = [&] {
    if (compensated.num_samples() == 0) return;
    data::write_log(options.compensated, compensated);
    if (!host::is_standard_output(options.compensated))
      console.print("Compensated positions: {}\n", options.compensated);
  };
  write_each({write_path, [&] { finish(console, options.model, options.result, json, page, write_model); }});
}

namespace {

VectorXd known_stiffness(const StiffnessCommandOptions& options, const model::Robot& robot) {
  const int n = robot.num_joints();
  if (static_cast<int>(options.stiffness.size()) != n) {
    throw InputError(
        fmt::format("--stiffness: found {} values, robot '{}' has {} joints; expected one a joint (inf for a "
                    "rigid one)",
                    options.stiffness.size(), robot.name, n));
  }
  return Eigen::Map<const VectorXd>(options.stiffness.data(), n);
}

}  // namespace

void stiffness_forward(const StiffnessCommandOptions& options) {
  const Console console{options.result.json, options.model, options.compensated};
  const model::Robot robot = load_robot(options.robot);
  const model::Kinematics kinematics(robot);
  const VectorXd stiffness = known_stiffness(options, robot);
  page::Page page = new_page("Joint stiffness", robot.name);
  nlohmann::ordered_json json{{"source", "given"}, {"stiffness", options.stiffness}};
  const data::Log path = read_path(options, robot);
  std::vector<NamedPose> poses;
  if (path.num_samples() == 0) {
    // No pose is named: the middle of the joint ranges.
    VectorXd q = VectorXd::Zero(robot.num_joints());
    for (int j = 0; j < robot.num_joints(); ++j) {
      const model::RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
      if (std::isfinite(joint.lower + joint.upper)) q[j] = 0.5 * (joint.lower + joint.upper);
    }
    poses.push_back({"middle of the ranges", q});
  } else {
    poses.push_back({"first of the path", path.q.row(0).transpose()});
  }
  const ToolDescription tool = describe_tool(kinematics, stiffness, poses, path, options, json, page);
  console.print("{}", tool.text);
  finish_with_path(console, options, json, page, tool.compensated, [&] {
    write_elastic_model(options.model, robot, stiffness, "stiffness", {}, {"stiffnesses as given"});
  });
}

namespace {

/// Dexterity over two joints through a pose, and its zones.
std::string describe_map(const model::Kinematics& kinematics, const VectorXd& q, double length,
                         const std::vector<int>& joints, nlohmann::ordered_json& json, page::Page& page) {
  const model::Robot& robot = kinematics.robot();
  constexpr int kSteps = 121;
  std::vector<stiffness::MapAxis> axes;
  std::vector<double> units;
  std::vector<std::string> names;
  for (const int joint : joints) {
    if (joint < 1 || joint > robot.num_joints()) {
      throw InputError(
          fmt::format("--map {}: robot '{}' has joints 1 to {}; expected two of them such as 2,3",
                      fmt::join(joints, ","), robot.name, robot.num_joints()));
    }
    const model::RobotJoint& j = robot.joints[static_cast<std::size_t>(joint - 1)];
    const bool slides = j.joint.type == JointType::kPrismatic;
    // More than a turn shows nothing new.
    const double low = slides ? j.lower : std::max(j.lower, -std::numbers::pi);
    const double high = slides ? j.upper : std::min(j.upper, std::numbers::pi);
    axes.push_back({joint - 1, low, high, kSteps});
    units.push_back(slides ? 1.0 : 180.0 / std::numbers::pi);
    names.push_back(fmt::format("q{} [{}]", joint, slides ? "m" : "°"));
  }
  const stiffness::DexterityMap map = stiffness::dexterity_map(kinematics, q, axes[0], axes[1], length);
  page::MapSpec spec;
  spec.title = "1/k_F through pose 1";
  spec.x_label = names[0];
  spec.y_label = names[1];
  spec.value_label = "1/k_F";
  for (const double v : map.first_values) spec.x.push_back(units[0] * v);
  for (const double v : map.second_values) spec.y.push_back(units[1] * v);
  spec.values = map.dexterity;
  for (int k = 1; 0.1 * k < map.dexterity.maxCoeff(); ++k) spec.levels.push_back(0.1 * k);
  spec.places.push_back({units[0] * q[axes[0].joint], units[1] * q[axes[1].joint], "1"});

  const double threshold = 0.7 * map.dexterity.maxCoeff();
  Table table({names[0], names[1], "largest 1/k_F", "share of the map [%]"});
  json["zones"] = nlohmann::ordered_json::array();
  constexpr std::size_t kMost = 6;
  for (const stiffness::DexterityZone& zone : stiffness::zones(map, threshold)) {
    if (json["zones"].size() == kMost) break;
    table.add_row({fmt::format("{:.4g} to {:.4g}", units[0] * zone.first_low, units[0] * zone.first_high),
                   fmt::format("{:.4g} to {:.4g}", units[1] * zone.second_low, units[1] * zone.second_high),
                   page::number(zone.best, 2), page::number(100.0 * zone.share, 2)});
    json["zones"].push_back({{"first", {zone.first_low, zone.first_high}},
                             {"second", {zone.second_low, zone.second_high}},
                             {"largest", zone.best}});
  }
  page.heading("Dexterity");
  page.plot(spec);
  const std::string caption =
      fmt::format("Zones of good dexterity through pose 1 (1/k_F above {:.2g})", threshold);
  page.table(table, caption);
  return fmt::format("\n{}:\n{}", caption, table.to_text(2));
}

}  // namespace

void plan_stiffness_measurements(const StiffnessCommandOptions& options) {
  const Console console{options.result.json, options.model};
  model::Robot robot = load_robot(options.robot);
  const int n = robot.num_joints();
  excite::MotionLimits limits = load_limits(options.robot, robot, options.safety, false).limits;
  // Poses are held, not run through: speeds and torques do not matter.
  limits.velocity.setOnes(n);
  limits.torque.setConstant(n, std::numeric_limits<double>::infinity());
  const excite::PoseCheck safe(robot, limits);
  for (int j = 0; j < n; ++j) {
    robot.joints[static_cast<std::size_t>(j)].lower = limits.lower[j];
    robot.joints[static_cast<std::size_t>(j)].upper = limits.upper[j];
  }
  const model::Kinematics kinematics(robot);
  const auto length_at = stiffness::characteristic_length(kinematics);
  const double length = std::isfinite(length_at.length) ? length_at.length : 1.0;

  const Vector3d pull(options.pull.data());

  // Three translations and three rotations of a tracker; a radian weighs as much as the characteristic length.
  MatrixXd directions = MatrixXd::Identity(6, 6);
  directions.bottomRows(3) *= length;
  constexpr int kCandidates = 3000;
  std::string missed;
  const auto candidates = stiffness::pose_candidates(kinematics, length, kCandidates, [&](const VectorXd& q) {
    if (!(safe.slack(q, &missed) > 0.0)) return MatrixXd();
    MatrixXd J;
    const model::ToolPlacement tip = kinematics.tip_and_jacobian(q, J);
    return stiffness::compliance_rows(J, wrench_of(pull, options.payload.com, tip), directions);
  });
  if (candidates.size() < 2 * static_cast<std::size_t>(options.plan)) {
    throw NotIdentifiableError(
        fmt::format("robot \"{}\": {} poses are to be chosen and only {} of {} tried are safe; the limit "
                    "missed last: {}; widen it or "
                    "ask for fewer",
                    robot.name, options.plan, candidates.size(), kCandidates, missed));
  }
  // Well away from singular poses: the better half.
  std::vector<double> sorted;
  for (const auto& candidate : candidates) sorted.push_back(candidate.dexterity);
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2),
                   sorted.end());
  const double least = sorted[sorted.size() / 2];
  const stiffness::PoseChoice choice = stiffness::choose_poses(candidates, options.plan, least);

  std::string csv = "pose";
  for (int j = 1; j <= n; ++j) csv += fmt::format(",q{}", j);
  csv += ",frame,fx,fy,fz,mx,my,mz,dx,dy,dz,rx,ry,rz\n";
  std::vector<std::string> headers{"pose"};
  for (int j = 1; j <= n; ++j) {
    const bool slides = robot.joints[static_cast<std::size_t>(j - 1)].joint.type == JointType::kPrismatic;
    headers.push_back(fmt::format("q{} [{}]", j, slides ? "m" : "°"));
  }
  headers.push_back("1/k_F");
  Table table(headers);
  int number = 0;
  for (const int index : choice.chosen) {
    const stiffness::PoseCandidate& candidate = candidates[static_cast<std::size_t>(index)];
    const stiffness::Vector6d wrench = wrench_of(pull, options.payload.com, kinematics.tip(candidate.q));
    csv += fmt::format("{},{:.6f},base,{:.6f},,,,,,\n", ++number, fmt::join(numbers(candidate.q), ","),
                       fmt::join(numbers(wrench), ","));
    std::vector<std::string> row{fmt::format("{}", number)};
    for (int j = 0; j < n; ++j) {
      const bool slides = robot.joints[static_cast<std::size_t>(j)].joint.type == JointType::kPrismatic;
      row.push_back(slides ? fmt::format("{:.3f}", candidate.q[j])
                           : fmt::format("{:.1f}", candidate.q[j] * 180.0 / std::numbers::pi));
    }
    row.push_back(page::number(candidate.dexterity, 2));
    table.add_row(row);
  }
  const MatrixXd covariance = solve_symmetric(choice.information, MatrixXd::Identity(n, n));
  std::vector<double> deviation;
  Table expected({"joint", "deviation of its compliance per µm of reading noise [rad/(N·m), m/N]"});
  for (int j = 0; j < n; ++j) {
    deviation.push_back(1e-6 * std::sqrt(covariance(j, j)));
    expected.add_row({fmt::format("{}", j + 1), page::number(deviation.back(), 2)});
  }
  page::Page page = new_page("Poses to measure stiffness at", robot.name);
  page.verdict(
      fmt::format("{} of {} safe poses: each joint's compliance known as well as so many poses allow.",
                  options.plan, candidates.size()));
  page.table(table, "Poses");
  page.table(expected, "What to expect of readings by a tracker");
  nlohmann::ordered_json json{{"poses", options.plan}, {"compliance_deviation_per_um", deviation}};
  const VectorXd& first = candidates[static_cast<std::size_t>(choice.chosen.front())].q;
  const std::string zones = describe_map(kinematics, first, length, options.map, json, page);
  console.print(
      "{} of {} safe poses (links clear of one another, of floor and obstacles; at most one turn a joint), "
      "chosen for the "
      "smallest volume of uncertainty (D-optimal) among the half with the best "
      "dexterity, {:.3g} N on the tool. The way from one to the next is not checked.\n{}\nExpected of a "
      "tracker:\n{}{}",
      options.plan, candidates.size(), pull.norm(), table.to_text(2), expected.to_text(2), zones);
  finish(console, options.model, options.result, json, page,
         [&] { host::write_file_atomically(options.model, csv); });
}

}  // namespace heft::tools
