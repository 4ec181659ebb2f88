/// @file
/// heft stiffness --measurements: compliances from loads and deflections.
#include <cstdio>
#include <filesystem>
#include <numeric>
#include <sstream>

#include <fmt/format.h>

#include "console.hpp"
#include "heft/data/deflections.hpp"
#include "heft/host/error.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/stiffness/stiffness.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "stiffness_forward.hpp"
#include "stiffness_jobs.hpp"

namespace heft::tools {
namespace {

/// "3" or "1-3" as joints from 0.
std::vector<int> read_joints(const std::string& part, const std::string& text) {
  int first = 0, last = 0, used = 0;
  const auto is_all = [&] { return used == static_cast<int>(part.size()); };
  if (std::sscanf(part.c_str(), "%d-%d%n", &first, &last, &used) != 2 || !is_all()) {
    used = 0;
    if (std::sscanf(part.c_str(), "%d%n", &first, &used) != 1 || !is_all()) first = 0;
    last = first;
  }
  if (first < 1 || last < first || last > model::kMaxJoints) {
    throw InputError(fmt::format(
        "--groups {}: '{}' is neither a joint nor a range of joints; expected for example 1-3,4-6", text,
        part));
  }
  std::vector<int> joints(static_cast<std::size_t>(last - first + 1));
  std::iota(joints.begin(), joints.end(), first - 1);
  return joints;
}

/// "1-3,4-6": joints that share a stiffness.
std::vector<std::vector<int>> read_groups(const std::string& text) {
  std::vector<std::vector<int>> groups;
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, ',');) groups.push_back(read_joints(part, text));
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

std::vector<data::Deflection> read_all(const std::vector<std::string>& files, const model::Robot& robot,
                                       std::vector<std::string>& notes) {
  std::vector<data::Deflection> rows;
  for (const std::string& file : files) {
    const std::vector<data::Deflection> read =
        data::read_deflections(measurement_file(file), robot.num_joints(), robot.name, &notes);
    rows.insert(rows.end(), read.begin(), read.end());
  }
  return rows;
}

}  // namespace

void stiffness_from_deflections(const StiffnessCommandOptions& options) {
  const model::Robot robot = load_robot(options.robot);
  stiffness::DeflectionOptions asked;
  asked.complementary = options.complementary;
  asked.keep_singular = options.keep_singular;
  asked.missing_is_zero = options.missing_is_zero;
  asked.sources = options.measurements;
  report::StiffnessReport answer;
  std::vector<std::string> notes;
  const auto say = [&] {
    for (const std::string& text : notes) note(text);
  };
  try {
    const std::vector<data::Deflection> rows = read_all(options.measurements, robot, notes);
    asked.groups = read_groups(options.groups);
    answer.stiffness = stiffness::from_deflections(robot, rows, asked, &notes);
  } catch (...) {
    say();
    throw;
  }
  say();
  const std::string none = report::why_none(answer.stiffness, options.model);
  finish_stiffness(options, robot, std::move(answer));
  if (!none.empty()) throw NotIdentifiableError(none);
}

}  // namespace heft::tools
