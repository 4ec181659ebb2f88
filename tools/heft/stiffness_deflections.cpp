/// @file
/// heft stiffness --measurements: compliances from loads and deflections.
#include <algorithm>
#include <cstdio>
#include <filesystem>

#include <fmt/format.h>

#include "console.hpp"
#include "heft/data/deflections.hpp"
#include "heft/host/error.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "stiffness_forward.hpp"
#include "stiffness_jobs.hpp"

namespace heft::tools {
namespace {

/// "1-3,4-6" as joints from 0.
std::vector<std::vector<int>> read_groups(const std::string& text, int n) {
  std::vector<std::vector<int>> groups;
  std::vector<bool> taken(static_cast<std::size_t>(n), false);
  const auto refuse = [&](const std::string& why) {
    throw InputError(fmt::format("--groups {}: {}; expected joints 1 to {} such as 1-3,4-6 (each joint once)",
                                 text, why, n));
  };
  std::size_t at = 0;
  while (at <= text.size() && !text.empty()) {
    const std::size_t comma = std::min(text.find(',', at), text.size());
    const std::string part = text.substr(at, comma - at);
    at = comma + 1;
    int first = 0, last = 0, used = 0;
    if (std::sscanf(part.c_str(), "%d-%d%n", &first, &last, &used) != 2 ||
        used != static_cast<int>(part.size())) {
      used = 0;
      if (std::sscanf(part.c_str(), "%d%n", &first, &used) != 1 || used != static_cast<int>(part.size())) {
        refuse(fmt::format("'{}' is no joint and no range of joints", part));
      }
      last = first;
    }
    if (first < 1 || last > n || first > last) refuse(fmt::format("'{}' is not among the joints", part));
    groups.emplace_back();
    for (int j = first - 1; j < last; ++j) {
      if (taken[static_cast<std::size_t>(j)]) refuse(fmt::format("joint {} is in two groups", j + 1));
      taken[static_cast<std::size_t>(j)] = true;
      groups.back().push_back(j);
    }
  }
  return groups;
}

/// The file itself, or one of that name that comes with heft.
std::string measurement_file(const std::string& name) {
  std::error_code ignored;
  if (std::filesystem::exists(name, ignored)) return name;
  try {
    return urdf::resolve_measurements(name);
  } catch (const DataError&) {
    return name;  // whose reader says what is wrong with it
  }
}

/// The poses measured at, as many as a table takes.
std::vector<stiffness::NamedPose> poses_of(const stiffness::DeflectionAnswer& answer) {
  constexpr std::size_t kMostPoses = 12;
  std::vector<stiffness::NamedPose> named;
  for (const stiffness::PoseInfluence& influence : answer.fit.poses) {
    if (named.size() == kMostPoses) break;
    const auto pose = std::find_if(answer.poses.begin(), answer.poses.end(),
                                   [&](const auto& p) { return p.name == influence.name; });
    named.push_back({influence.name, pose->q});
  }
  return named;
}

}  // namespace

void stiffness_from_deflections(const StiffnessCommandOptions& options) {
  const model::Robot robot = load_robot(options.robot);
  std::vector<data::Deflection> rows;
  std::vector<std::string> notes;
  for (const std::string& path : options.measurements) {
    const std::vector<data::Deflection> read =
        data::read_deflections(measurement_file(path), robot.num_joints(), robot.name, &notes);
    rows.insert(rows.end(), read.begin(), read.end());
  }
  stiffness::DeflectionOptions asked;
  asked.groups = read_groups(options.groups, robot.num_joints());
  asked.complementary = options.complementary;
  asked.keep_singular = options.keep_singular;
  asked.missing_is_zero = options.missing_is_zero;
  asked.sources = options.measurements;
  report::StiffnessReport answer;
  try {
    answer.stiffness = stiffness::from_deflections(robot, rows, asked, &notes);
  } catch (...) {
    for (const std::string& text : notes) note(text);
    throw;
  }
  for (const std::string& text : notes) note(text);
  const std::vector<stiffness::NamedPose> poses = poses_of(*answer.stiffness.deflections);
  const bool none = !answer.stiffness.found_any();
  answer.path = read_path(options, robot);
  finish_stiffness(options, std::move(answer), poses);
  if (none) {
    throw NotIdentifiableError(fmt::format(
        "no joint's stiffness can be determined from these readings{}: expected intervals with two ends; "
        "measure at more poses, with larger loads, or let joints with gears of one size share a stiffness "
        "(--groups 1-3,4-6)",
        options.model.empty() ? "" : ", nothing was written to " + options.model));
  }
}

}  // namespace heft::tools
