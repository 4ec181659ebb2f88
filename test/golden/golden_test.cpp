// What the command prints and writes for the command lines of commands.txt, compared with what is kept in expected/.
// Words must be the same, numbers to a relative 1e-9 (another order of a sum moves the last digits).
//   HEFT_GOLDEN_UPDATE=1 ctest -R golden     keeps what the command prints now; read the diff before you commit it.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "heft/host/file.hpp"
#include "support/run_heft.hpp"

namespace heft::test {
namespace {

namespace fs = std::filesystem;

constexpr double kRelative = 1e-9;
/// Rows kept of a table of numbers (.csv) besides the first two: every so many.
constexpr std::size_t kEvery = 400;
const std::string kFolder = std::string(HEFT_SOURCE_DIR) + "/test/golden";

struct Command {
  std::string chain;
  std::string name;
  std::vector<std::string> arguments;
};

/// The rows "CHAIN NAME: ARGUMENTS" of commands.txt.
std::vector<Command> commands() {
  std::istringstream in(host::read_file(kFolder + "/commands.txt", "list of commands"));
  std::vector<Command> all;
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line.front() == '#') continue;
    std::istringstream words(line);
    Command command;
    words >> command.chain >> command.name;
    command.name.pop_back();
    for (std::string word; words >> word;) command.arguments.push_back(word);
    all.push_back(command);
  }
  return all;
}

/// A page as a reader sees its text: without its pictures, styles and tags.
std::string page_text(std::string page) {
  for (const char* tag : {"svg", "style", "script"}) {
    const std::string open = std::string("<") + tag, close = std::string("</") + tag + ">";
    for (std::size_t at = page.find(open); at != std::string::npos; at = page.find(open)) {
      const std::size_t end = page.find(close, at);
      page.erase(at, end == std::string::npos ? std::string::npos : end + close.size() - at);
    }
  }
  page = std::regex_replace(
      page, std::regex("\\d{4}-\\d\\d-\\d\\d \\d\\d:\\d\\d UTC, heft [0-9.]+(, commit [0-9a-f]+)?"),
      "(when and by what)");
  return std::regex_replace(page, std::regex("\\s*<[^>]*>(<[^>]*>|\\s)*"), "\n");
}

std::string some_rows(const std::string& table) {
  std::istringstream in(table);
  std::string kept;
  std::size_t row = 0;
  for (std::string line; std::getline(in, line); ++row) {
    if (row < 2 || row % kEvery == 0) kept += line + "\n";
  }
  return kept + std::to_string(row) + " rows\n";
}

std::string as_kept(const fs::path& file) {
  const std::string content = host::read_file(file.string(), "result");
  if (file.extension() == ".html") return page_text(content) + "\n";
  if (file.extension() == ".csv") return some_rows(content);
  return content;
}

/// Time and size of every file below a folder: what a command changes is what it wrote.
std::map<std::string, std::pair<fs::file_time_type, std::uintmax_t>> files_below(const fs::path& folder) {
  std::map<std::string, std::pair<fs::file_time_type, std::uintmax_t>> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) {
      files[fs::relative(entry.path(), folder).string()] = {entry.last_write_time(), entry.file_size()};
    }
  }
  return files;
}

std::string run_in(const fs::path& folder, const Command& command) {
  const auto before = files_below(folder);
  const Outcome done = run_heft(command.arguments, folder.string());
  // How far a command has come is said after ten seconds only: on a machine that has other work to do.
  const std::string error =
      std::regex_replace(done.err, std::regex("heft: [^\n]* \\d+ % after \\d+ s\n"), "");
  std::string result = "exit code " + std::to_string(done.exit_code) + "\n==== standard output\n" + done.out +
                       "==== standard error\n" + error;
  for (const auto& [name, state] : files_below(folder)) {
    const auto old = before.find(name);
    if (old != before.end() && old->second == state) continue;
    const std::string extension = fs::path(name).extension().string();
    if (extension == ".svg" || extension == ".png") continue;
    result += "==== " + name + "\n" + as_kept(folder / name);
    if (result.back() != '\n') result += '\n';
  }
  return result;
}

/// Where two numbers are the same to kRelative, or both no more than rounding of quantities near 1.
bool same_number(double a, double b) {
  return a == b || std::abs(a - b) <= kRelative * std::max(std::abs(a), std::abs(b)) ||
         std::max(std::abs(a), std::abs(b)) < 1e-10;
}

/// @return whether two lines have the same words, and numbers to kRelative.
bool same_line(const std::string& a, const std::string& b) {
  if (a == b) return true;
  static const std::regex number(R"([-+−]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?)");
  if (std::regex_replace(a, number, "#") != std::regex_replace(b, number, "#")) return false;
  for (std::sregex_iterator i(a.begin(), a.end(), number), j(b.begin(), b.end(), number), end;
       i != end && j != end; ++i, ++j) {
    if (i->str() != j->str() &&
        !same_number(std::strtod(i->str().c_str(), nullptr), std::strtod(j->str().c_str(), nullptr))) {
      return false;
    }
  }
  return true;
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

void expect_same(const std::string& name, const std::string& expected, const std::string& found) {
  const std::vector<std::string> want = lines_of(expected), have = lines_of(found);
  int shown = 0;
  for (std::size_t k = 0; k < std::max(want.size(), have.size()) && shown < 5; ++k) {
    const std::string a = k < want.size() ? want[k] : "(nothing)",
                      b = k < have.size() ? have[k] : "(nothing)";
    if (same_line(a, b)) continue;
    ++shown;
    ADD_FAILURE() << "expected/" << name << ".txt:" << k + 1 << "\n  kept: " << a << "\n  now:  " << b;
  }
}

class Golden : public testing::TestWithParam<const char*> {};

TEST_P(Golden, CommandsPrintAndWriteWhatTheyDid) {
  const bool update = std::getenv("HEFT_GOLDEN_UPDATE") != nullptr;
  const TemporaryFolder folder;
  for (const std::string& from : {kFolder + "/inputs", std::string(HEFT_URDF_DIR) + "/ur5-stiffness"}) {
    for (const auto& entry : fs::directory_iterator(from)) fs::copy(entry.path(), folder.path(""));
  }
  // The C library takes other versions of exp, sin and the like on other processors, which differ in the last digit;
  // stick-slip makes more of that. With the oldest of them every x86-64 processor computes the same.
  setenv("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F", 1);
  int run = 0;
  for (const Command& command : commands()) {
    if (command.chain != GetParam()) continue;
    ++run;
    SCOPED_TRACE(command.name);
    const std::string found = run_in(folder.path(""), command);
    const std::string kept = kFolder + "/expected/" + command.name + ".txt";
    if (update) {
      host::write_file_atomically(kept, found);
    } else {
      expect_same(command.name, host::read_file(kept, "expected output"), found);
    }
  }
  EXPECT_GT(run, 0) << "no command of chain " << GetParam();
}

INSTANTIATE_TEST_SUITE_P(Chains, Golden,
                         testing::Values("fit", "load", "stiff", "motion", "path", "whole", "drive", "help"),
                         [](const auto& chain) { return std::string(chain.param); });

}  // namespace
}  // namespace heft::test
