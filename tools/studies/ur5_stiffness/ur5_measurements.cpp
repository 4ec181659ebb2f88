// The measured numbers, as they come with heft.
#include <cmath>
#include <cstdlib>
#include <map>
#include <sstream>

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/urdf/urdf_import.hpp"

#include "ur5_stiffness_study.hpp"

namespace heft::studies {

using Eigen::VectorXd;

namespace {

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

}  // namespace heft::studies
