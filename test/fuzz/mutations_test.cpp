// Damaged files, a few hundred a format: each is read, or ends in one message that names the file. The fuzzers beside this
// file ask the same of millions; read_log_from() and try_to_read() end the process where it does not hold.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <random>

#include <gtest/gtest.h>

#include "parsers.hpp"
#include "read_log.hpp"

namespace heft {
namespace {

/// Bytes changed, cut out, doubled or cut off: what disks and broken writers do, and lengths that lead astray.
std::string damaged(std::string content, std::mt19937& random) {
  const auto below = [&](std::size_t most) {
    return std::uniform_int_distribution<std::size_t>(0, most - 1)(random);
  };
  static const std::vector<std::string> numbers = {std::string(8, '\0'), std::string(4, '\xff'),
                                                   std::string(8, '\xff'), std::string("\0\0\0\x7f", 4),
                                                   std::string("\1\0\0\0\0\0\0\x10", 8)};
  for (std::size_t changes = 1 + below(4); changes > 0 && content.size() > 16; --changes) {
    const std::size_t at = below(content.size());
    switch (below(5)) {
      case 0: content[at] = static_cast<char>(content[at] ^ (1 << below(8))); break;
      case 1: content[at] = static_cast<char>(below(256)); break;
      case 2: {
        const std::string& number = numbers[below(numbers.size())];
        content.replace(at, number.size(), number);
        break;
      }
      case 3: content.insert(at, content.substr(at, below(200))); break;
      default:
        if (below(2) == 0) content.resize(std::max<std::size_t>(at, 16));
        else content.erase(at, below(64));
    }
  }
  return content;
}

/// Files of a folder, by name.
std::vector<std::filesystem::path> files_in(const std::string& folder) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.is_regular_file()) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::string content_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// What breaks text: words of another kind in the place of a number, marks doubled or left out, one line twice.
std::string damaged_text(std::string content, std::mt19937& random) {
  static const std::vector<std::string> words = {"nan", "-1e999", "1e308", "\"",    "null", "[",
                                                 "}",   ",,",     ";",     "\r",    "<",    "/>",
                                                 "&",   "\xff",   "-",     "0x1p3", "\n\n"};
  const auto below = [&](std::size_t most) {
    return std::uniform_int_distribution<std::size_t>(0, most - 1)(random);
  };
  for (std::size_t changes = 1 + below(3); changes > 0 && content.size() > 4; --changes) {
    const std::size_t digit = content.find_first_of("0123456789", below(content.size()));
    const std::size_t at = digit == std::string::npos ? below(content.size()) : digit;
    const std::string& word = words[below(words.size())];
    if (below(2) == 0) content.replace(at, 1 + below(3), word);
    else if (below(4) == 0) content.insert(at, content.substr(at, below(100)));
    else if (below(4) == 0) content.erase(below(content.size()), 1 + below(20));
    else content.insert(below(content.size()), word);
  }
  return content;
}

TEST(Mutations, OfEveryFormatAreReadOrRefused) {
  constexpr int kEach = 60;
  const std::vector<std::string_view> all = {"mcap", "rosbag2", "rosbag2.zstd", "npz", "npy", "mat5", "hdf5"};
  std::map<std::string, int> read, refused;
  for (const std::filesystem::path& path : files_in(HEFT_SOURCE_DIR "/test/data/foreign/binary")) {
    if (path.extension() == ".csv") continue;
    const std::string content = content_of(path);
    std::mt19937 random(static_cast<unsigned>(content.size()));
    for (int k = 0; k < kEach; ++k) {
      const fuzz::Outcome outcome = fuzz::read_log_from(damaged(content, random), all, {});
      ++(outcome.message.empty() ? read : refused)[path.extension().string()];
    }
  }
  // Both happen, or the damage is none or the files are.
  for (const std::string kind : {".mcap", ".db3", ".npz", ".npy", ".mat"}) {
    EXPECT_GT(read[kind], 0) << kind;
    EXPECT_GT(refused[kind], 20) << kind;
  }
}

/// Seeds as they are: each fuzzer begins with a file that is read.
TEST(Seeds, OfEveryParserAreReadAtLeastOne) {
  for (const fuzz::Parser& parser : fuzz::parsers()) {
    bool any = false;
    for (const std::filesystem::path& path : files_in(HEFT_SOURCE_DIR "/test/" + std::string(parser.seeds)))
      any = fuzz::try_to_read(parser, content_of(path)).empty() || any;
    EXPECT_TRUE(any) << parser.name;
  }
}

class TextMutations : public testing::TestWithParam<fuzz::Parser> {};

TEST_P(TextMutations, AreReadOrRefused) {
  constexpr int kAll = 150;
  const std::vector<std::filesystem::path> seeds =
      files_in(HEFT_SOURCE_DIR "/test/" + std::string(GetParam().seeds));
  ASSERT_FALSE(seeds.empty());
  std::mt19937 random(1);
  int refused = 0;
  for (int k = 0; k < kAll; ++k) {
    const std::string content = content_of(seeds[static_cast<std::size_t>(k) % seeds.size()]);
    const std::string text = k % 2 == 0 ? damaged_text(content, random) : damaged(content, random);
    if (!fuzz::try_to_read(GetParam(), text).empty()) ++refused;
  }
  // What is no mesh is told, and the link gets the capsule of its kinematics.
  if (GetParam().name == "mesh") {
    EXPECT_EQ(refused, 0);
  } else {
    EXPECT_GT(refused, kAll / 10);
  }
}

INSTANTIATE_TEST_SUITE_P(Of, TextMutations, testing::ValuesIn(fuzz::parsers().begin(), fuzz::parsers().end()),
                         [](const auto& each) { return std::string(each.param.name); });

}  // namespace
}  // namespace heft
