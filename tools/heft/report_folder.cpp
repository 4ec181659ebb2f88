#include "report_folder.hpp"

#include "console.hpp"
#include "heft/host/file.hpp"

namespace heft::tools {
namespace {

std::string csv_cell(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

}  // namespace

std::string to_csv(const page::Table& table) {
  std::string text;
  const auto add = [&](const std::vector<std::string>& row) {
    for (std::size_t c = 0; c < row.size(); ++c) text += (c ? "," : "") + csv_cell(row[c]);
    text += "\n";
  };
  add(table.headers());
  for (const auto& row : table.rows()) add(row);
  return text;
}

ReportFolder::ReportFolder(const std::string& path) : folder_(path) {}

void ReportFolder::csv(const std::string& name, const page::Table& table) const {
  host::write_file_atomically(file(name), to_csv(table));
}

void ReportFolder::figure(const std::string& name, const page::PlotSpec& spec) const {
  warn_unless(page::write_svg(spec, file(name)));
}

void ReportFolder::figure(const std::string& name, const page::MapSpec& spec) const {
  warn_unless(page::write_svg(spec, file(name)));
}

void ReportFolder::warn_unless(bool written) const {
  if (written || warned_) return;
  note("gnuplot is missing or failed: figures are not written as files");
  warned_ = true;
}

}  // namespace heft::tools
