// Damaged files, a few hundred a format: each is read, or ends in one message that names the file. The fuzzers beside this
// file ask the same of millions; read_log_from ends the process where it does not hold.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <random>

#include <gtest/gtest.h>

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

TEST(Mutations, OfEveryFormatAreReadOrRefused) {
  constexpr int kEach = 60;
  const std::vector<std::string_view> all = {"mcap", "rosbag2", "rosbag2.zstd", "npz", "npy", "mat5", "hdf5"};
  std::map<std::string, int> read, refused;
  for (const auto& entry : std::filesystem::directory_iterator(HEFT_SOURCE_DIR "/test/data/foreign/binary")) {
    const std::string name = entry.path().filename().string();
    if (!entry.is_regular_file() || name.ends_with(".csv")) continue;
    std::ifstream file(entry.path(), std::ios::binary);
    const std::string content{std::istreambuf_iterator<char>(file), {}};
    std::mt19937 random(static_cast<unsigned>(content.size()));
    for (int k = 0; k < kEach; ++k) {
      const fuzz::Outcome outcome = fuzz::read_log_from(damaged(content, random), all, {});
      ++(outcome.message.empty() ? read : refused)[entry.path().extension().string()];
    }
  }
  // Both happen, or the damage is none or the files are.
  for (const std::string kind : {".mcap", ".db3", ".npz", ".npy", ".mat"}) {
    EXPECT_GT(read[kind], 0) << kind;
    EXPECT_GT(refused[kind], 20) << kind;
  }
}

}  // namespace
}  // namespace heft
