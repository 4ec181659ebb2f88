#include "heft/page/table.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include <fmt/format.h>

namespace heft::page {
namespace {

bool is_number(const std::string& cell) {
  if (cell.empty() || cell == "–") return true;
  char* end = nullptr;
  std::strtod(cell.c_str(), &end);
  if (end == cell.c_str()) return false;
  // A number may carry an interval or a percent sign: "2.81 ± 0.03", "12 %".
  std::string rest(end);
  for (const std::string& mark : {std::string("±"), std::string("%")}) {
    if (const auto at = rest.find(mark); at != std::string::npos) rest.erase(at, mark.size());
  }
  return rest.find_first_not_of(" 0123456789.e+-") == std::string::npos;
}

}  // namespace

Table& Table::add_row(std::vector<std::string> cells) {
  cells.resize(headers_.size());
  rows_.push_back(std::move(cells));
  return *this;
}

bool Table::is_numeric(std::size_t column) const {
  return !rows_.empty() &&
         std::all_of(rows_.begin(), rows_.end(), [&](const auto& row) { return is_number(row[column]); });
}

std::string Table::to_text(int indent) const {
  const std::size_t num_columns = headers_.size();
  std::vector<std::size_t> width(num_columns);
  std::vector<bool> right(num_columns);
  for (std::size_t c = 0; c < num_columns; ++c) {
    right[c] = is_numeric(c);
    width[c] = display_width(headers_[c]);
    for (const auto& row : rows_) width[c] = std::max(width[c], display_width(row[c]));
  }
  std::string text;
  const auto add_line = [&](const std::vector<std::string>& cells) {
    std::string line(static_cast<std::size_t>(indent), ' ');
    for (std::size_t c = 0; c < num_columns; ++c) {
      const std::string gap(width[c] - display_width(cells[c]), ' ');
      line += right[c] ? gap + cells[c] : cells[c] + gap;
      if (c + 1 < num_columns) line += "  ";
    }
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + '\n';
  };
  add_line(headers_);
  std::vector<std::string> rule(num_columns);
  for (std::size_t c = 0; c < num_columns; ++c) {
    for (std::size_t k = 0; k < width[c]; ++k) rule[c] += "─";
  }
  add_line(rule);
  for (const auto& row : rows_) add_line(row);
  return text;
}

std::string number(double value, int significant) {
  if (std::isnan(value)) return "–";
  if (std::isinf(value)) return value > 0 ? "∞" : "-∞";
  if (value == 0.0) return "0";
  const double magnitude = std::abs(value);
  if (magnitude < 1e-4 || magnitude >= 1e6)
    return fmt::format("{:.{}e}", value, std::max(0, significant - 1));
  const int decimals = std::max(0, significant - 1 - static_cast<int>(std::floor(std::log10(magnitude))));
  return fmt::format("{:.{}f}", value, decimals);
}

std::size_t display_width(const std::string& text) {
  std::size_t width = 0;
  for (std::size_t k = 0; k < text.size(); ++k) {
    const auto byte = static_cast<unsigned char>(text[k]);
    if ((byte & 0xC0U) == 0x80U) continue;         // continuation byte
    if (byte == 0xCCU || byte == 0xCDU) continue;  // U+0300..U+036F, combining marks
    ++width;
  }
  return width;
}

}  // namespace heft::page
