// Who may include whom: read from the sources, so that a wrong include fails even where it happens to compile.
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>

#include <gtest/gtest.h>

namespace {

namespace fs = std::filesystem;

/// Rooms a room may include besides itself.
const std::map<std::string, std::set<std::string>>& allowed() {
  static const std::map<std::string, std::set<std::string>> table = {
      {"core", {}},
      {"host", {}},
      {"statistics", {"host"}},
      {"page", {"host"}},
      {"model", {"core", "host"}},
      {"data", {"core", "host"}},
      {"urdf", {"core", "host", "model"}},
      {"sim", {"core", "host", "model", "data"}},
      {"plausibility", {"core", "host", "model", "data"}},
      {"regression", {"core", "host", "model", "data"}},
      {"validate", {"core", "host", "model", "data"}},
      {"payload", {"core", "host", "model", "data", "statistics"}},
      {"stiffness", {"core", "host", "model", "data", "statistics"}},
      {"identify", {"core", "host", "model", "data", "statistics", "regression", "validate"}},
      {"collision", {"core", "host", "model"}},
      {"excite", {"core", "host", "model", "data", "sim", "collision", "regression"}},
      {"diagnose", {"core", "host", "model", "data", "statistics", "regression", "validate"}},
      {"report", {"core", "host", "model", "data", "statistics", "page", "validate", "payload", "stiffness", "identify", "diagnose", "plausibility"}}};
  return table;
}

TEST(Rooms, IncludeOnlyWhatTheTableAllows) {
  const fs::path source = HEFT_SOURCE_DIR;
  const std::regex include(R"re(#\s*include\s*"heft/([a-z]+)/)re");
  int files = 0;
  for (const char* tree : {"include/heft", "src"}) {
    for (const auto& entry : fs::recursive_directory_iterator(source / tree)) {
      const std::string extension = entry.path().extension().string();
      if (extension != ".hpp" && extension != ".cpp") {
        continue;
      }
      const std::string room = fs::relative(entry.path(), source / tree).begin()->string();
      ASSERT_TRUE(allowed().contains(room)) << entry.path() << " is in a room the table does not know";
      ++files;
      std::ifstream in(entry.path());
      for (std::string line; std::getline(in, line);) {
        std::smatch match;
        if (std::regex_search(line, match, include)) {
          const std::string other = match[1];
          EXPECT_TRUE(other == room || allowed().at(room).contains(other))
              << entry.path() << ": room " << room << " must not include room " << other;
        }
      }
    }
  }
  EXPECT_GT(files, 50);
}

TEST(Rooms, CoreIncludesNothingButEigenAndTheStandardLibrary) {
  const fs::path core = fs::path(HEFT_SOURCE_DIR) / "include/heft/core";
  const std::regex include(R"(#\s*include\s*<([^>]+)>)");
  const std::set<std::string> standard = {"algorithm",   "array",   "bit",         "cmath",
                                          "cstddef",     "cstdint", "limits",      "numbers",
                                          "string_view", "tuple",   "type_traits", "utility"};
  for (const auto& entry : fs::recursive_directory_iterator(core)) {
    if (entry.path().extension() != ".hpp") {
      continue;
    }
    std::ifstream in(entry.path());
    for (std::string line; std::getline(in, line);) {
      std::smatch match;
      if (std::regex_search(line, match, include)) {
        EXPECT_TRUE(standard.contains(match[1]) || match[1] == "Eigen/Core")
            << entry.path() << ": " << match[1];
      }
    }
  }
}

TEST(Rooms, PublicHeadersShowNoThirdPartyType) {
  const std::regex include(
      R"(#\s*include\s*<(kdl|urdf|cvode|sundials|nvector|sunmatrix|sunlinsol|ceres|fcl|nlohmann|CLI|fmt)[/.])");
  for (const auto& entry : fs::recursive_directory_iterator(fs::path(HEFT_SOURCE_DIR) / "include/heft")) {
    if (entry.path().extension() != ".hpp") {
      continue;
    }
    std::ifstream in(entry.path());
    for (std::string line; std::getline(in, line);) {
      EXPECT_FALSE(std::regex_search(line, include)) << entry.path() << ": " << line;
    }
  }
}

}  // namespace
