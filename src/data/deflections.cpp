#include "heft/data/deflections.hpp"

#include <array>
#include <cmath>
#include <map>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "heft/host/error.hpp"
#include "heft/host/file.hpp"

#include "csv_fields.hpp"

namespace heft::data {
namespace {

using Eigen::Vector3d;

constexpr std::array<std::string_view, 3> kForce{"fx", "fy", "fz"}, kMoment{"mx", "my", "mz"},
    kShift{"dx", "dy", "dz"}, kTurn{"rx", "ry", "rz"}, kDirection{"ux", "uy", "uz"}, kPoint{"px", "py", "pz"};

/// Larger deflections are millimetres or degrees [m, rad].
constexpr double kMost = 0.25;

/// The header and one row after the other.
class Table {
 public:
  Table(const std::string& path, std::string_view text) : path_(path), text_(text) {
    if (text_.starts_with("\xEF\xBB\xBF"))
      text_.remove_prefix(3);  // spreadsheets put a byte-order mark in front
    if (!next_line()) {
      throw DataError(fmt::format(
          "{}: the file is empty; expected a header line (pose,q1,...,fx,...,dx,...) and rows", path_));
    }
    std::size_t index = 0;
    for (const std::string_view name : fields_) {
      if (!columns_.emplace(std::string(name), index++).second && !name.empty()) {
        fail("column '{}' is there twice; expected every name once; rename or drop one", name);
      }
    }
    names_.assign(fields_.begin(), fields_.end());
  }

  /// @return false at the end of the file
  bool next_row() {
    if (!next_line()) return false;
    if (fields_.size() != names_.size()) {
      fail(
          "found {} fields; expected {} as in the header; complete the row (a decimal comma also looks like "
          "this)",
          fields_.size(), names_.size());
    }
    return true;
  }

  bool has(std::string_view name) const { return columns_.find(name) != columns_.end(); }
  const std::vector<std::string>& names() const { return names_; }
  std::string where() const { return fmt::format("{}:{}", path_, line_); }

  std::string_view field(std::string_view name) const {
    const auto column = columns_.find(name);
    return column == columns_.end() ? std::string_view() : fields_[column->second];
  }
  /// Nothing when the column is missing or the field empty.
  std::optional<double> number(std::string_view name) const {
    const std::string_view text = field(name);
    if (text.empty()) return std::nullopt;
    double value = 0.0;
    const char* at = text.data();
    if (read_number(at, text.data() + text.size(), value) != FieldProblem::kNone) {
      fail(
          "column '{}': found '{}'; expected a finite number in SI units (decimal point, no unit); correct "
          "or remove the row",
          name, shown(text));
    }
    return value;
  }
  double required(std::string_view name) const {
    const std::optional<double> value = number(name);
    if (!value) fail("column '{}': found an empty field; expected a number; fill it or remove the row", name);
    return *value;
  }
  Vector3d vector(const std::array<std::string_view, 3>& names) const {
    return {number(names[0]).value_or(0.0), number(names[1]).value_or(0.0), number(names[2]).value_or(0.0)};
  }
  bool has_any(const std::array<std::string_view, 3>& names) const {
    return has(names[0]) || has(names[1]) || has(names[2]);
  }

  template <typename... Args>
  [[noreturn]] void fail(fmt::format_string<Args...> format, Args&&... args) const {
    throw DataError(fmt::format("{}: {}", where(), fmt::format(format, std::forward<Args>(args)...)));
  }

 private:
  bool next_line() {
    while (!text_.empty()) {
      const std::size_t stop = text_.find('\n');
      std::string_view line = text_.substr(0, stop);
      text_.remove_prefix(stop == std::string_view::npos ? text_.size() : stop + 1);
      ++line_;
      if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
      if (is_blank(line) || line.front() == '#') continue;
      fields_ = split(line);
      return true;
    }
    return false;
  }

  std::string path_;
  std::string_view text_;
  int line_{0};
  std::vector<std::string_view> fields_;
  std::vector<std::string> names_;
  std::map<std::string, std::size_t, std::less<>> columns_;
};

void check_header(const Table& table, int num_joints, const std::string& robot_name) {
  int joints = 0;
  while (table.has(fmt::format("q{}", joints + 1))) ++joints;
  if (joints != num_joints) {
    table.fail(
        "found joint columns q1 to q{}, robot '{}' has {} joints; expected q1 to q{} [rad, m]; give the file "
        "of this robot or name the right URDF",
        joints, robot_name, num_joints, num_joints);
  }
  if (!table.has_any(kForce) && !table.has_any(kMoment)) {
    for (const char* magnitude : {"f", "force", "load", "mass", "weight", "payload"}) {
      if (table.has(magnitude)) {
        table.fail(
            "column '{}' gives the size of the force but not its direction: the wrench has no direction; "
            "expected components fx, fy, fz [N] (and mx, my, mz [N m] about the tip), in axes of the base or "
            "of the tool (column 'frame'); replace it by them",
            magnitude);
      }
    }
    table.fail(
        "no load: found {}; expected at least one of fx, fy, fz [N], mx, my, mz [N m about the tip]; add "
        "them",
        fmt::join(table.names(), ", "));
  }
  if (table.has("d") != table.has_any(kDirection)) {
    const std::string_view problem =
        table.has("d")
            ? "column 'd' is a displacement without direction; expected ux, uy, uz as well, the direction "
              "along which it was measured; add them, or use dx, dy, dz"
            : "columns ux, uy, uz give a direction along which nothing was measured; expected column 'd' [m] "
              "as well; add it";
    table.fail("{}", problem);
  }
  if (!table.has("d") && !table.has_any(kShift) && !table.has_any(kTurn)) {
    table.fail(
        "no deflection: found {}; expected some of dx, dy, dz [m], rx, ry, rz [rad], or d [m] with ux, uy, "
        "uz; add them",
        fmt::join(table.names(), ", "));
  }
}

/// The standard deviation of a row's displacements or rotations, 0 when not given.
double sigma_of(const Table& table, std::string_view column) {
  const double sigma = table.number(column).value_or(0.0);
  if (sigma < 0.0) {
    table.fail("column '{}': found {}; expected a standard deviation above 0; correct it or leave it empty",
               column, sigma);
  }
  return sigma;
}

/// What was measured in the present row.
std::vector<DeflectionReading> readings_of(const Table& table) {
  std::vector<DeflectionReading> readings;
  const double sigma = sigma_of(table, "sigma"), sigma_r = sigma_of(table, "sigma_r");
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<std::size_t>(axis);
    if (const auto value = table.number(kShift[a])) {
      readings.push_back({false, Vector3d::Unit(axis), *value, sigma});
    }
    if (const auto value = table.number(kTurn[a])) {
      readings.push_back({true, Vector3d::Unit(axis), *value, sigma_r});
    }
  }
  if (const auto value = table.number("d")) {
    const Vector3d direction = table.vector(kDirection);
    if (direction.norm() < 1e-9) {
      table.fail("columns ux, uy, uz: the direction is zero; expected a vector along the wire; correct it");
    }
    readings.push_back({false, direction.normalized(), *value, sigma});
  }
  if (readings.empty()) {
    table.fail(
        "nothing was measured in this row; expected a value in one of dx, dy, dz, rx, ry, rz, d; fill it "
        "or remove the row");
  }
  for (const DeflectionReading& reading : readings) {
    if (std::abs(reading.value) > kMost) {
      table.fail(
          "found a deflection of {:g} {}; expected at most {:g}: a linear stiffness is valid only for "
          "small deflections; give metres and radians (0.2 mm is 0.0002)",
          reading.value, reading.rotation ? "rad" : "m", kMost);
    }
  }
  return readings;
}

/// The present row.
/// @param number  its pose's name where it states none
Deflection deflection_of(const Table& table, int num_joints, std::size_t number) {
  Deflection row;
  row.where = table.where();
  row.pose = table.field("pose").empty() ? fmt::format("{}", number) : std::string(table.field("pose"));
  if (const std::string_view frame = table.field("frame"); !frame.empty() && frame != "base") {
    if (frame != "tool") {
      table.fail(
          "column 'frame': found '{}'; expected base or tool, the axes of load and deflection; correct it",
          shown(frame));
    }
    row.tool_axes = true;
  }
  row.q.resize(num_joints);
  for (int j = 0; j < num_joints; ++j) row.q[j] = table.required(fmt::format("q{}", j + 1));
  row.force = table.vector(kForce);
  row.moment = table.vector(kMoment);
  if (row.force.isZero(0.0) && row.moment.isZero(0.0)) {
    table.fail(
        "force and moment are zero; expected the load that made the deflection; without a load a pose says "
        "nothing about stiffness; remove the row or correct it");
  }
  row.point = table.vector(kPoint);
  row.readings = readings_of(table);
  return row;
}

/// Notes which columns are none of ours.
void note_columns_left_alone(const Table& table, const std::string& path, int num_joints,
                             std::vector<std::string>& notes) {
  std::vector<std::string> left;
  for (const std::string& name : table.names()) {
    const auto among = [&](const auto& names) {
      return std::find(names.begin(), names.end(), name) != names.end();
    };
    bool known = among(kForce) || among(kMoment) || among(kShift) || among(kTurn) || among(kDirection) ||
                 among(kPoint) || name == "d" || name == "pose" || name == "frame" || name == "sigma" ||
                 name == "sigma_r";
    for (int j = 1; j <= num_joints; ++j) known = known || name == fmt::format("q{}", j);
    if (!known) left.push_back(name);
  }
  if (!left.empty()) notes.push_back(fmt::format("{}: columns left alone: {}", path, fmt::join(left, ", ")));
}

}  // namespace

std::vector<Deflection> read_deflections(const std::string& path, int num_joints,
                                         const std::string& robot_name, std::vector<std::string>* notes) {
  const std::string text = host::read_file(path, "measurements");
  Table table(path, text);
  check_header(table, num_joints, robot_name);
  std::vector<Deflection> rows;
  while (table.next_row()) rows.push_back(deflection_of(table, num_joints, rows.size() + 1));
  if (rows.empty())
    table.fail("the file ends after its header; expected a row for each loaded pose; add them");
  if (notes != nullptr) note_columns_left_alone(table, path, num_joints, *notes);
  return rows;
}

}  // namespace heft::data
