#include "study_report.hpp"

#include <fmt/format.h>

namespace heft::studies {

std::string StudyReport::json_text() const {
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

nlohmann::ordered_json as_json(const std::string& text) { return nlohmann::ordered_json::parse(text); }

std::string fixed(double value, int digits) {
  const std::string text = fmt::format("{:.{}f}", value, digits);
  return text.find_first_of("123456789") == std::string::npos && text.front() == '-' ? text.substr(1) : text;
}

}  // namespace heft::studies
