#include "data_file.hpp"

#include <cmath>
#include <cstdint>

#include "compact_svg.hpp"
#include "extent.hpp"
#include "host/json.hpp"

namespace heft::page {
namespace {

host::Json json_of(const DataFile::Column& column, int places) {
  constexpr const char* kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  Range range;
  for (const double value : column.values) range.include(value);
  if (range.empty()) range = {0.0, 0.0};
  const std::int64_t none = (std::int64_t{1} << (6 * places)) - 1;
  const double step = (range.high - range.low) / static_cast<double>(none - 1);
  std::string data;
  for (const double value : column.values) {
    const std::int64_t n = !std::isfinite(value) ? none
                           : step > 0.0          ? std::llround((value - range.low) / step)
                                                 : 0;
    for (int k = places - 1; k >= 0; --k) data += kDigits[(n >> (6 * k)) & 63];
  }
  return {{"name", column.name}, {"low", range.low}, {"step", step}, {"places", places}, {"data", data}};
}

}  // namespace

std::string data_file_html(const DataFile& file) {
  if (file.columns.empty() || file.columns.front().values.empty()) return {};
  host::Json json{
      {"label", file.label}, {"name", file.name}, {"notes", file.notes}, {"columns", host::Json::array()}};
  for (const DataFile::Column& column : file.columns)
    json["columns"].push_back(json_of(column, json["columns"].empty() ? 4 : 3));
  std::string text = json.dump(-1, ' ', false, host::Json::error_handler_t::replace);
  replace_all(text, "<", "\\u003c");  // no text may end the element
  return "<script class=\"file\" type=\"application/json\">" + text + "</script>\n";
}

}  // namespace heft::page
