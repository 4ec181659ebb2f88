// Documents that a reader finds: a README in each room, every kind of effect in the list of JSON results, and no reference to
// a document that is not in the repository.
#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "heft/core/effects/arm_effects.hpp"

namespace heft {
namespace {

namespace fs = std::filesystem;

const fs::path kRoot = HEFT_SOURCE_DIR;

std::string text_of(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST(Documents, EachRoomHasAReadmeThatSaysWhatItMustNeverDo) {
  int rooms = 0;
  for (const auto& entry : fs::directory_iterator(kRoot / "src")) {
    if (!entry.is_directory()) continue;
    ++rooms;
    const std::string name = entry.path().filename().string();
    const std::string text = text_of(entry.path() / "README.md");
    EXPECT_TRUE(text.starts_with("# " + name + ": "))
        << "src/" << name << "/README.md begins with \"# " << name << ": \" and its question";
    EXPECT_NE(text.find(" must never "), std::string::npos) << "src/" << name << "/README.md";
    EXPECT_NE(text_of(kRoot / "src/README.md").find("| `" + name + "` |"), std::string::npos)
        << "src/README.md has no row for room " << name;
  }
  EXPECT_GE(rooms, 15);
}

TEST(Documents, NameEveryKindOfEffect) {
  const std::string results = text_of(kRoot / "tools/README.md");
  int kinds = 0;
  const auto is_named = [&]<typename Effect>(Effect) {
    ++kinds;
    EXPECT_NE(results.find("| `" + std::string(Effect::kId) + "` |"), std::string::npos)
        << "tools/README.md has no row for " << Effect::kId;
    for (const EffectParameter& parameter : Effect::kParameters) {
      if (parameter.name.starts_with("com_")) continue;  // in JSON one entry, com
      EXPECT_NE(results.find("`" + std::string(parameter.name) + "`"), std::string::npos)
          << "tools/README.md does not name " << parameter.name << " of " << Effect::kId;
    }
  };
  std::apply([&](auto... effect) { (is_named(effect), ...); }, EffectTypes());
  EXPECT_GE(kinds, 15);
}

/// Whether a path that a file mentions leads anywhere: from the root, from include/heft, from the file's own folder, or, for a
/// public header, from the folder of its room's sources.
bool leads_somewhere(std::string mentioned, const fs::path& from) {
  if (mentioned.starts_with('/')) mentioned.erase(0, 1);
  const fs::path folder = fs::relative(from.parent_path(), kRoot);
  std::vector<fs::path> bases = {kRoot, kRoot / "include/heft", kRoot / folder};
  if (folder.string().starts_with("include/heft"))
    bases.push_back(kRoot / "src" / fs::relative(folder, "include/heft"));
  for (const fs::path& base : bases) {
    if (fs::exists(base / mentioned)) return true;
  }
  return false;
}

TEST(Documents, ThatAreMentionedExist) {
  // What the developers called documents of their own.
  const std::vector<std::string> absent = {"the contract", "corrected text", "protocol section"};
  const std::regex document(R"([A-Za-z0-9_\-/.]*[A-Za-z0-9_\-]\.md\b)");
  int mentioned = 0;
  for (const char* tree : {"include", "src", "tools", "bench", "test"}) {
    for (const auto& entry : fs::recursive_directory_iterator(kRoot / tree)) {
      const std::string extension = entry.path().extension().string();
      if (extension != ".hpp" && extension != ".cpp" && extension != ".md") continue;
      if (entry.path().filename() == "documents_test.cpp") continue;
      const std::string text = text_of(entry.path());
      std::istringstream lines(text);
      for (std::string line; std::getline(lines, line);) {
        if (line.find(".md") == std::string::npos) continue;
        for (std::sregex_iterator at(line.begin(), line.end(), document), end; at != end; ++at) {
          ++mentioned;
          EXPECT_TRUE(leads_somewhere(at->str(), entry.path())) << entry.path() << " mentions " << at->str();
        }
      }
      for (const std::string& words : absent) {
        EXPECT_EQ(text.find(words), std::string::npos)
            << entry.path() << ": \"" << words << "\" is no document that a reader has";
      }
    }
  }
  EXPECT_GE(mentioned, 30);
}

}  // namespace
}  // namespace heft
