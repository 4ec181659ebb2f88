// Text on several threads: the same rows and the same refusals as line by line.
#include <algorithm>
#include <bit>
#include <charconv>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "csv_fields.hpp"
#include "heft/host/error.hpp"
#include "heft/host/parallel.hpp"
#include "log_file.hpp"
#include "support/temporary_folder.hpp"

namespace heft::data {
namespace {

using heft::test::message_of;
using heft::test::TemporaryFolder;
using testing::HasSubstr;

constexpr int kRows = 30000;  // several blocks of the reader

std::vector<std::string> sound_lines() {
  std::vector<std::string> lines{"time,q1,tau1,mode,spare"};
  for (int k = 0; k < kRows; ++k)
    lines.push_back(fmt::format("{:.3f},{:.6f},{:.6f},auto,{}", 0.001 * k, 0.001 * ((k * 7919) % 3000), -0.5 * k, k));
  return lines;
}

std::string text_of(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

/// Rows and message as next() gives them, one by one.
struct Read {
  std::vector<double> numbers;
  std::string message;
  /// Rows of a file that is refused are of no use.
  bool operator==(const Read& other) const {
    return message == other.message && (!message.empty() || numbers == other.numbers);
  }
};

Read line_by_line(const std::string& path) {
  Read read;
  read.message = message_of<DataError>([&] {
    LogFile file(path, {});
    std::vector<double> row(file.num_columns());
    while (file.next(row.data())) read.numbers.insert(read.numbers.end(), {row[0], row[1], row[2]});
  });
  return read;
}

Read on_threads(const std::string& path, std::size_t threads) {
  host::set_threads(threads);
  Read read;
  read.message = message_of<DataError>([&] {
    LogFile file(path, {});
    file.for_each_rows({{1, 1.0}, {2, 1.0}}, [&](const FileRows& rows) {
      for (Eigen::Index k = 0; k < rows.time.size(); ++k)
        read.numbers.insert(read.numbers.end(), {rows.time[k], rows.values(k, 0), rows.values(k, 1)});
    });
  });
  host::set_threads(0);
  return read;
}

void expect_alike(const std::vector<std::string>& lines, const std::string& what, bool cut = false) {
  SCOPED_TRACE(what);
  const TemporaryFolder folder;
  std::string text = text_of(lines);
  if (cut) text.resize(text.size() - 4);
  const std::string path = folder.write("log.csv", text);
  const Read expected = line_by_line(path);
  if (!what.empty()) {
    EXPECT_THAT(expected.message, HasSubstr(what));
  }
  for (const std::size_t threads : {1, 2, 3, 8}) EXPECT_TRUE(on_threads(path, threads) == expected) << threads;
}

TEST(TextOnThreads, GivesTheRowsOfTheWholeFile) {
  const TemporaryFolder folder;
  const std::string path = folder.write("log.csv", text_of(sound_lines()));
  const Read read = on_threads(path, 3);
  ASSERT_EQ(read.numbers.size(), std::size_t{3 * kRows});
  EXPECT_EQ(read.message, "");
  EXPECT_EQ(read.numbers[3 * 20000], 20.0);
  EXPECT_EQ(read.numbers[3 * 20000 + 2], -10000.0);
  EXPECT_TRUE(read == line_by_line(path));
}

TEST(TextOnThreads, RefusesTheFirstBadLineWithItsNumber) {
  const auto with = [](int row, const std::string& line, int second = 0, const std::string& other = {}) {
    std::vector<std::string> lines = sound_lines();
    lines[static_cast<std::size_t>(row)] = line;
    if (second > 0) lines[static_cast<std::size_t>(second)] = other;
    return lines;
  };
  // Line 1 is the header; lines are at their number less one.
  expect_alike(with(20000, "20,abc,0,auto,0"), "log.csv:20001: column 'q1': found 'abc'");
  expect_alike(with(20000, "20,nan,0,auto,0"), "log.csv:20001: column 'q1': found 'nan'");
  expect_alike(with(20000, "20,,0,auto,0"), "log.csv:20001: column 'q1': found an empty field");
  expect_alike(with(20000, "20,1"), "log.csv:20001: column 'tau1' is missing: found 2 fields");
  expect_alike(with(20000, "20,1,2,auto,0,7"), "log.csv:20001: column 'spare' is followed by more fields");
  expect_alike(with(20000, "1e999,1,2,auto,0"), "log.csv:20001: column 'time': found '1e999', which is too large");
  expect_alike(with(20000, "3.5,1,2,auto,0"), "log.csv:20001: column 'time': found 3.5 after 19.998 (line 20000)");
  expect_alike(with(20000, ""), "log.csv:20001: column 'time': found a blank line between rows");
  expect_alike(with(20000, "3.5,1,2,auto,0", 15000, "15,x,2,auto,0"), "log.csv:15001: column 'q1'");
  expect_alike(with(20000, "20,x,2,auto,0", 19990, "3.5,1,2,auto,0"), "log.csv:19991: column 'time'");
}

TEST(TextOnThreads, TakesWhatLineByLineTakes) {
  std::vector<std::string> lines = sound_lines();
  lines[9000] = "+8.999 , 1e-3,-0.000000,\"auto, x\",0";  // signs, blanks, exponents, quotes
  lines[12000] = "11.9990000000000001,0.1000000000000000055511151231257827,5e-324,auto,word";
  expect_alike(lines, "");
  for (std::string& line : lines) line += "\r";
  expect_alike(lines, "");
  lines = sound_lines();
  lines.insert(lines.end(), {"", " ", ""});  // blank lines at the end
  expect_alike(lines, "");
}

TEST(TextOnThreads, NoticesALogThatWasCutInsideItsLastNumber) {
  std::vector<std::string> lines{"time,q1,tau1"};
  for (int k = 0; k < kRows; ++k) lines.push_back(fmt::format("{:.3f},{:.6f},{:.6f}", 0.001 * k, 0.5, 1.25));
  expect_alike(lines, "the log was cut inside this number", true);
}

TEST(TextOnThreads, RefusesAZeroByteWhereverItIs) {
  std::vector<std::string> lines = sound_lines();
  lines[25000][3] = '\0';
  expect_alike(lines, "found a zero byte");
}

/// Numbers as programs write them, and what only looks like one.
TEST(PlainNumbers, HaveTheBitsOfFromChars) {
  std::mt19937_64 random(3);
  const auto below = [&](std::uint64_t n) { return random() % n; };
  int taken = 0;
  for (int k = 0; k < 200000; ++k) {
    std::string text = below(2) == 0 ? "-" : "";
    for (std::uint64_t digits = below(12); digits > 0; --digits) text += static_cast<char>('0' + below(10));
    if (below(4) > 0) text += '.';
    for (std::uint64_t digits = below(14); digits > 0; --digits) text += static_cast<char>('0' + below(10));
    if (below(20) == 0) text += "e-05";
    const std::size_t length = text.size();
    text += below(2) == 0 ? ",7" : "";
    const char* at = text.data();
    double found = -1.0;
    if (!read_plain_number(at, text.data() + text.size(), found)) {
      EXPECT_EQ(at, text.data());
      continue;
    }
    ++taken;
    double expected = 0.0;
    const auto [stop, error] = std::from_chars(text.data(), text.data() + length, expected);
    EXPECT_EQ(error, std::errc()) << text;
    EXPECT_EQ(stop, at) << text;
    EXPECT_EQ(std::bit_cast<std::uint64_t>(found), std::bit_cast<std::uint64_t>(expected)) << text;
  }
  EXPECT_GT(taken, 100000);
}

}  // namespace
}  // namespace heft::data
