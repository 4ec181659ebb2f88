// Who may include whom: read from the sources, so that a wrong include fails even where it happens to compile.
#include <algorithm>
#include <filesystem>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "source_tree.hpp"

namespace heft {
namespace {

namespace fs = std::filesystem;
using test::SourceFile;
using Rooms = std::set<std::string>;

/// Other rooms that each room includes: no more, no less.
const std::map<std::string, Rooms>& table() {
  static const std::map<std::string, Rooms> rooms = {
      {"core", {}},
      {"host", {}},
      {"statistics", {"host"}},
      {"page", {"host"}},
      {"model", {"core", "host"}},
      {"data", {"core", "host", "statistics"}},
      {"urdf", {"core", "host", "model"}},
      {"exchange", {"core", "host", "model"}},
      {"sim", {"core", "data", "host", "model"}},
      {"plausibility", {"core", "data", "host", "model", "statistics"}},
      {"collision", {"host", "model"}},
      {"regression", {"core", "data", "host", "model", "statistics"}},
      {"validate", {"core", "data", "host", "model", "statistics"}},
      {"drive", {"data", "host", "model", "statistics", "validate"}},
      {"payload", {"core", "data", "drive", "host", "model", "statistics", "validate"}},
      {"monitor", {"core", "data", "host", "model", "statistics", "validate"}},
      {"cycle", {"core", "host", "model", "monitor", "urdf"}},
      {"stiffness", {"data", "host", "model", "statistics"}},
      {"identify", {"core", "data", "host", "model", "regression", "statistics", "validate"}},
      {"excite", {"collision", "core", "data", "host", "model", "regression", "sim", "statistics"}},
      {"retime", {"data", "host", "model", "sim"}},
      {"diagnose", {"core", "data", "host", "model", "regression", "statistics", "validate"}},
      {"compare", {"core", "host", "model", "regression", "statistics"}},
      {"track", {"core", "host", "model", "sim", "statistics", "validate"}},
      {"report",
       {"compare", "data", "diagnose", "drive", "exchange", "excite", "host", "identify", "model", "monitor",
        "page", "payload", "plausibility", "retime", "sim", "statistics", "stiffness", "track", "validate"}},
      {"bench",
       {"core", "data", "diagnose", "host", "identify", "model", "page", "regression", "sim", "urdf", "validate"}},
      {"tools/studies",
       {"bench", "core", "data", "excite", "host", "identify", "model", "page", "report", "sim", "statistics",
        "stiffness", "track", "urdf", "validate"}},
      {"tools/heft",
       {"compare",  "data",  "diagnose",  "drive",         "exchange", "excite",       "host",
        "identify", "model", "monitor",   "page",          "payload",  "plausibility", "report",
        "retime",   "sim",   "stiffness", "tools/studies", "track",    "urdf",         "validate"}}};
  return rooms;
}

/// The room that a file belongs to: that of the library, bench, or a folder of tools.
std::string room_of(const fs::path& file) {
  std::vector<std::string> parts;
  for (const fs::path& part : file) parts.push_back(part.string());
  if (parts[0] == "src") return parts[1];
  if (parts[0] == "include") return parts[2];
  return parts[0] == "tools" ? parts[0] + "/" + parts[1] : parts[0];
}

/// Files named in quotes by #include.
std::vector<std::string> quoted_includes(const SourceFile& file) {
  static const std::regex include(R"re(^\s*#\s*include\s*"([^"]+)")re");
  std::vector<std::string> names;
  for (const std::string& line : file.lines) {
    std::smatch match;
    if (std::regex_search(line, match, include)) names.push_back(match[1]);
  }
  return names;
}

std::vector<SourceFile> all_sources() {
  return test::sources_in({"include/heft", "src", "bench", "tools/heft", "tools/studies"});
}

/// The file that an #include in another one means; empty when there is none.
fs::path resolve(const fs::path& from, const std::string& name, const std::set<fs::path>& known) {
  if (name.rfind("heft/", 0) == 0)
    return known.contains("include/" + name) ? fs::path("include/" + name) : fs::path();
  const fs::path beside = (from.parent_path() / name).lexically_normal();
  if (known.contains(beside)) return beside;
  for (const fs::path& file : known) {
    const std::string path = file.string(), end = "/" + name;
    if (file.begin()->string() != "include" && path.size() > end.size() &&
        path.compare(path.size() - end.size(), end.size(), end) == 0) {
      return file;
    }
  }
  return {};
}

TEST(Rooms, IncludeWhatTheTableSaysAndNothingElse) {
  const std::vector<SourceFile> files = all_sources();
  EXPECT_GT(files.size(), 150U);
  std::set<fs::path> known;
  for (const SourceFile& file : files) known.insert(file.path);
  std::map<std::string, std::map<std::string, std::string>> found;  // room, other room: an example
  for (const SourceFile& file : files) {
    const std::string room = room_of(file.path);
    found[room];
    for (const std::string& name : quoted_includes(file)) {
      const fs::path target = resolve(file.path, name, known);
      ASSERT_FALSE(target.empty()) << file.path << " includes \"" << name << "\", which is in no room";
      const std::string other = room_of(target);
      if (other == room) continue;
      found[room].emplace(other, file.path.string() + " includes " + name);
      // What is private to src/<room> is for that room; bench and the folders of tools have no public part.
      EXPECT_TRUE(target.begin()->string() != "src" || target == "src/host/json.hpp")
          << file.path << " includes \"" << name << "\", which is private to room " << other;
    }
  }
  for (const auto& [room, needs] : table()) found[room];
  for (const auto& [room, others] : found) {
    std::string row;
    for (const auto& [other, example] : others) row += (row.empty() ? "\"" : ", \"") + other + "\"";
    SCOPED_TRACE("the sources say: {\"" + room + "\", {" + row + "}}");
    EXPECT_TRUE(table().contains(room)) << "the table does not know room " << room;
    const Rooms allowed = table().contains(room) ? table().at(room) : Rooms();
    for (const auto& [other, example] : others) {
      EXPECT_TRUE(allowed.contains(other))
          << "room " << room << " must not include room " << other << ": " << example;
    }
    for (const std::string& other : allowed) {
      EXPECT_TRUE(others.contains(other)) << "room " << room << " includes nothing of room " << other
                                          << " any more; take it out of the table";
    }
  }
}

// A question is answered without another one; all are judged by the same scorer. What is said of an answer is above.
TEST(Rooms, OfQuestionsKnowNoOtherQuestion) {
  const Rooms questions = {"collision", "compare",      "diagnose", "excite",    "identify", "monitor",
                           "payload",   "plausibility", "retime",   "stiffness", "track"};
  const std::map<std::string, Rooms> exceptions = {
      {"excite", {"collision"}}};  // motions that keep clear of the arm
  for (const auto& [room, needs] : table()) {
    const bool is_program = room == "bench" || room.rfind("tools/", 0) == 0;
    for (const std::string& other : needs) {
      EXPECT_TRUE(is_program || other != "report") << room << " includes what is said of answers";
      if (!questions.contains(room)) continue;
      const bool excepted = exceptions.contains(room) && exceptions.at(room).contains(other);
      EXPECT_TRUE(!questions.contains(other) || excepted)
          << room << " and " << other << " are questions both";
    }
  }
}

TEST(Rooms, HaveNoCircle) {
  std::set<std::string> done;
  for (bool progress = true; progress;) {
    progress = false;
    for (const auto& [room, needs] : table()) {
      const bool ready = std::all_of(needs.begin(), needs.end(),
                                     [&](const std::string& other) { return done.contains(other); });
      progress = (ready && done.insert(room).second) || progress;
    }
  }
  for (const auto& [room, needs] : table())
    EXPECT_TRUE(done.contains(room)) << room << " is part of a circle";
}

// A header that no other room includes, nor any header that others include, is no part of the interface.
TEST(Rooms, PublicHeadersAreUsedOutsideTheirRoom) {
  const std::vector<SourceFile> files = all_sources();
  std::map<fs::path, std::vector<fs::path>> includes;
  std::set<fs::path> known, used, pending;
  for (const SourceFile& file : files) known.insert(file.path);
  std::vector<SourceFile> users = files;
  // Programs of users: the README's, the examples, the firmware, the Python module.
  for (SourceFile& file : test::sources_in({"test/examples", "test/firmware", "tools/python/binding"}))
    users.push_back(std::move(file));
  users.push_back({"README.md", test::lines_of("README.md")});
  for (const SourceFile& file : users) {
    for (const std::string& name : quoted_includes(file)) {
      const fs::path target = resolve(file.path, name, known);
      if (target.empty() || target.begin()->string() != "include") continue;
      if (file.path.begin()->string() == "include") includes[file.path].push_back(target);
      const std::string top = file.path.begin()->string();
      const bool outside = top == "test" || top == "README.md" || room_of(file.path) != room_of(target);
      if (outside) pending.insert(target);
    }
  }
  // The room's facade is named as the room is.
  for (const fs::path& file : known) {
    if (file.begin()->string() == "include" && file.stem() == room_of(file)) pending.insert(file);
  }
  while (!pending.empty()) {
    const fs::path header = *pending.begin();
    pending.erase(pending.begin());
    if (!used.insert(header).second) continue;
    for (const fs::path& next : includes[header]) pending.insert(next);
  }
  for (const fs::path& file : known) {
    if (file.begin()->string() != "include" || file.parent_path().filename() == "detail") continue;
    const std::string name = fs::relative(file, "include/heft").string();
    EXPECT_TRUE(used.contains(file))
        << name
        << " is used in its own room only: move it to src, or under detail/ where a template asks for it";
  }
}

TEST(Rooms, CoreIncludesNothingButEigenAndTheStandardLibrary) {
  const std::regex include(R"(#\s*include\s*<([^>]+)>)");
  const std::set<std::string> standard = {"algorithm",   "array",   "bit",         "cmath",
                                          "cstddef",     "cstdint", "limits",      "numbers",
                                          "string_view", "tuple",   "type_traits", "utility"};
  const std::vector<SourceFile> files = test::sources_in({"include/heft/core"});
  EXPECT_GT(files.size(), 30U);
  for (const SourceFile& file : files) {
    for (const std::string& line : file.lines) {
      std::smatch match;
      if (std::regex_search(line, match, include)) {
        EXPECT_TRUE(standard.contains(match[1]) || match[1] == "Eigen/Core") << file.path << ": " << match[1];
      }
    }
  }
}

TEST(Rooms, PublicHeadersShowNoThirdPartyType) {
  const std::regex include(
      R"(#\s*include\s*<(kdl|urdf|cvode|sundials|nvector|sunmatrix|sunlinsol|ceres|fcl|nlohmann|CLI|fmt)[/.])");
  for (const SourceFile& file : test::sources_in({"include/heft"})) {
    for (const std::string& line : file.lines)
      EXPECT_FALSE(std::regex_search(line, include)) << file.path << ": " << line;
  }
}

}  // namespace
}  // namespace heft
