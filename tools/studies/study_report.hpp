/// @file
/// What a study found, in the forms in which a command hands it on: text, page, tables, figures, JSON.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "heft/page/page.hpp"
#include "heft/page/plot.hpp"
#include "heft/page/table.hpp"

namespace heft::studies {

struct StudyReport {
  page::Page page;
  std::string text;  ///< for the terminal
  /// By the name of the file that each belongs in.
  std::vector<std::pair<std::string, page::Table>> tables;
  std::vector<std::pair<std::string, page::PlotSpec>> plots;
  std::vector<std::pair<std::string, page::MapSpec>> maps;
  nlohmann::ordered_json json;

  /// `json` as it is written to a file.
  std::string json_text() const;
  void csv(const std::string& name, const page::Table& table) { tables.emplace_back(name, table); }
  void figure(const std::string& name, const page::PlotSpec& spec) { plots.emplace_back(name, spec); }
  void figure(const std::string& name, const page::MapSpec& spec) { maps.emplace_back(name, spec); }
};

/// JSON text that `report` gives, for a study's own JSON.
nlohmann::ordered_json as_json(const std::string& text);

/// Fixed digits without a negative zero.
std::string fixed(double value, int digits);

}  // namespace heft::studies
