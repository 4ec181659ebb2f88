#include "text_dialect.hpp"

#include <algorithm>
#include <charconv>

#include "../csv_fields.hpp"
#include "../units.hpp"

namespace heft::data {
namespace {

std::string_view bare(std::string_view field) {
  field = trim(field);
  if (field.size() >= 2 && field.front() == '"' && field.back() == '"')
    field = trim(field.substr(1, field.size() - 2));
  return field;
}

void split_blanks(std::string_view line, bool is_header, std::vector<std::string_view>& fields) {
  for (std::size_t at = 0;;) {
    while (at < line.size() && is_space(line[at])) ++at;
    if (at == line.size()) return;
    const std::size_t begin = at;
    bool quoted = false;
    for (; at < line.size() && (quoted || !is_space(line[at])); ++at) quoted = quoted != (line[at] == '"');
    const std::string_view field = line.substr(begin, at - begin);
    const bool bracket = field.front() == '[' || field.front() == '(';
    if (is_header && bracket && !fields.empty()) {
      const std::string_view name = fields.back();
      fields.back() =
          std::string_view(name.data(), static_cast<std::size_t>(field.data() + field.size() - name.data()));
    } else {
      fields.push_back(bare(field));
    }
  }
}

}  // namespace

std::string_view separator_words(char separator) {
  switch (separator) {
    case ';': return "semicolons";
    case '\t': return "tabs";
    case ' ': return "blanks";
    default: return "commas";
  }
}

std::string TextDialect::words() const {
  if (separator == ',') return "CSV";
  return "text separated by " + std::string(separator_words(separator)) +
         (decimal_comma ? " with decimal commas" : "");
}

char separator_of(std::string_view header) {
  bool quoted = false;
  std::size_t commas = 0, semicolons = 0, tabs = 0;
  for (const char c : header) {
    quoted = quoted != (c == '"');
    if (quoted) continue;
    commas += c == ',' ? 1 : 0;
    semicolons += c == ';' ? 1 : 0;
    tabs += c == '\t' ? 1 : 0;
  }
  if (semicolons > 0 && semicolons >= commas) return ';';
  if (commas > 0) return ',';
  if (tabs > 0) return '\t';
  return trim(header).find(' ') != std::string_view::npos && trim(header).front() != '"' ? ' ' : ',';
}

void split_fields(std::string_view line, char separator, bool is_header,
                  std::vector<std::string_view>& fields) {
  fields.clear();
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  if (separator == ' ') return split_blanks(line, is_header, fields);
  bool quoted = false;
  std::size_t begin = 0;
  for (std::size_t at = 0; at < line.size(); ++at) {
    if (line[at] == '"') quoted = !quoted;
    if (line[at] != separator || quoted) continue;
    fields.push_back(bare(line.substr(begin, at - begin)));
    begin = at + 1;
  }
  if (quoted) {  // a lone quote is a letter as any other
    fields.clear();
    begin = 0;
    for (std::size_t at = line.find(separator); at != std::string_view::npos;
         at = line.find(separator, begin)) {
      fields.push_back(bare(line.substr(begin, at - begin)));
      begin = at + 1;
    }
  }
  fields.push_back(bare(line.substr(begin)));
}

std::optional<std::vector<std::string>> units_in(std::string_view line, char separator) {
  std::vector<std::string_view> fields;
  split_fields(line, separator, false, fields);
  std::vector<std::string> units;
  bool any = false;
  for (std::string_view field : fields) {
    if (field.size() > 2 && (field.front() == '[' || field.front() == '('))
      field = trim(field.substr(1, field.size() - 2));
    const bool none = field.empty() || field == "-" || field == "1" || field == "%";
    if (!none && !is_unit(field)) return {};
    any = any || !none;
    units.emplace_back(none ? std::string_view() : field);
  }
  if (!any) return {};
  return units;
}

bool is_number(std::string_view field) {
  std::string text(bare(field));
  std::replace(text.begin(), text.end(), ',', '.');
  const char* at = text.data();
  double value = 0.0;
  return read_number(at, text.data() + text.size(), value) == FieldProblem::kNone &&
         at == text.data() + text.size();
}

}  // namespace heft::data
