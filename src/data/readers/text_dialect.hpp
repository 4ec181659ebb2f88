/// @file
/// How a text file writes its rows: what separates fields, which mark the decimals have.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace heft::data {

struct TextDialect {
  char separator{','};  ///< ' ' stands for any run of blanks and tabs
  bool decimal_comma{false};

  /// "CSV", "CSV with semicolons and decimal commas", "text with blanks between fields".
  std::string words() const;
};

/// "commas", "semicolons", "tabs", "blanks"
std::string_view separator_words(char separator);

/// What separates the names of a header line: the comma where there is one and no semicolon, then semicolon, tab, blanks.
char separator_of(std::string_view header);

/// The fields of a line without the spaces and quotes around them; separators inside quotes separate nothing. At blanks,
/// a unit in brackets belongs to the name before it if `is_header`.
void split_fields(std::string_view line, char separator, bool is_header,
                  std::vector<std::string_view>& fields);

/// Whether a line is one of units below a header: "s;deg;Nm". @return the units, brackets taken off; nothing when it is none
std::optional<std::vector<std::string>> units_in(std::string_view line, char separator);

/// Whether a field is a number, with decimal point or comma.
bool is_number(std::string_view field);

}  // namespace heft::data
