#include "heft/page/origin.hpp"

#include <ctime>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include "heft/host/words.hpp"

namespace heft::page {
namespace {

std::string& command_line() {
  static std::string line;
  return line;
}

}  // namespace

void remember_command(int argc, const char* const* argv) {
  // How the program was found says nothing about the result.
  command_line() = "heft";
  for (int k = 1; k < argc; ++k) command_line() += " " + host::shell_word(argv[k]);
}

Page new_page(const std::string& title, const std::string& subtitle) {
  Page page(title, subtitle);
  if (!command_line().empty()) page.footer(command_line());
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  page.footer(fmt::format("{:%Y-%m-%d %H:%M} UTC, heft {}, commit {}.", utc, HEFT_VERSION, HEFT_COMMIT));
  return page;
}

}  // namespace heft::page
