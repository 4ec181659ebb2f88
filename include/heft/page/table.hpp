/// @file
/// Tables: the same rows as aligned text for a terminal and as HTML for a report.
#pragma once

#include <string>
#include <vector>

namespace heft::page {

/// Headers and rows of text. Headers carry the unit: `"RMSE [N·m]"`.
/// A column whose cells are all numbers (or empty, or "–") is aligned to the right.
class Table {
 public:
  explicit Table(std::vector<std::string> headers) : headers_(std::move(headers)) {}

  /// Adds a row. Cells left out are empty; cells beyond the headers are dropped.
  Table& add_row(std::vector<std::string> cells);

  const std::vector<std::string>& headers() const { return headers_; }
  const std::vector<std::vector<std::string>>& rows() const { return rows_; }
  /// Whether a column holds numbers only.
  bool is_numeric(std::size_t column) const;

  /// Aligned columns with a rule under the headers, each line indented by `indent` blanks and ended by a newline.
  std::string to_text(int indent = 0) const;

 private:
  std::vector<std::string> headers_;
  std::vector<std::vector<std::string>> rows_;
};

/// A number for people: `significant` digits, no exponent between 1e-4 and 1e6, "–" for NaN.
std::string number(double value, int significant = 4);

/// Columns a UTF-8 text takes on a terminal (one per code point, none for combining marks).
std::size_t display_width(const std::string& text);

}  // namespace heft::page
