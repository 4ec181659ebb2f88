#include "json.hpp"

#include <algorithm>

#include "heft/host/file.hpp"

namespace heft::host {

Json parse_json(std::string_view text, const std::string& file) {
  refuse_deep_json(text, file);
  try {
    constexpr bool kThrows = true, kTakesComments = true;
    return Json::parse(text, nullptr, kThrows, kTakesComments);
  } catch (const Json::out_of_range& e) {
    // The library's message ends with the number in quotes.
    const std::string_view reason = e.what();
    const std::size_t quote = reason.find('\'');
    throw ModelError(
        fmt::format("{}: found the number {}, which is too large; expected finite numbers in SI units; "
                    "correct it",
                    file, quote == std::string_view::npos ? reason : reason.substr(quote)));
  } catch (const Json::parse_error& e) {
    const std::size_t at = std::min(text.size(), e.byte > 0 ? e.byte - 1 : 0);
    const std::string_view before = text.substr(0, at);
    const auto line = std::count(before.begin(), before.end(), '\n') + 1;
    const std::size_t start = before.rfind('\n');
    const std::size_t column = start == std::string_view::npos ? at + 1 : at - start;
    const std::string near = at >= text.size()  ? "the end of the file"
                             : text[at] == '\n' ? "the end of the line"
                                                : fmt::format("'{}'", text[at]);
    throw ModelError(
        fmt::format("{}:{}:{}: found {} where JSON does not allow it; expected a JSON object; look for a "
                    "missing comma, quote or bracket just before",
                    file, line, column, near));
  }
}

}  // namespace heft::host
