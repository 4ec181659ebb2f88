#include "heft/host/file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/error.hpp"
#include "support/temporary_folder.hpp"

namespace heft::host {
namespace {

using heft::test::message_of;
using heft::test::TemporaryFolder;
using testing::HasSubstr;

TEST(File, WritesWhatItReadsBack) {
  const TemporaryFolder folder;
  const std::string content("a\0b\r\nc", 6);
  write_file_atomically(folder.path("out.txt"), content);
  EXPECT_EQ(read_file(folder.path("out.txt"), "file"), content);
  EXPECT_EQ(folder.num_entries(), 1u) << "a temporary file was left behind";
}

TEST(File, ReplacesAnOlderFile) {
  const TemporaryFolder folder;
  folder.write("out.txt", "old, and longer than the new one");
  write_file_atomically(folder.path("out.txt"), "new");
  EXPECT_EQ(read_file(folder.path("out.txt"), "file"), "new");
}

TEST(File, SaysWhyItCannotWriteAndLeavesNothingBehind) {
  const TemporaryFolder folder;
  const std::string path = folder.path("missing/out.txt");
  const std::string message = message_of<InputError>([&] { write_file_atomically(path, "text"); });
  EXPECT_THAT(message, HasSubstr(path));
  EXPECT_THAT(message, HasSubstr("check that the folder exists"));
  EXPECT_EQ(folder.num_entries(), 0u);
}

TEST(File, KeepsTheTargetWhenItCannotBeReplaced) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder.path("out"));
  folder.write("out/inside", "x");
  EXPECT_THAT(message_of<InputError>([&] { write_file_atomically(folder.path("out"), "text"); }),
              HasSubstr("this is a folder; name a file in it"));
  EXPECT_EQ(folder.num_entries(), 1u) << "a temporary file was left behind";
}

TEST(File, SaysWhatKindOfFileIsMissing) {
  const TemporaryFolder folder;
  const std::string message =
      message_of<InputError>([&] { read_file(folder.path("none.json"), "scenario"); });
  EXPECT_THAT(message, HasSubstr(folder.path("none.json")));
  EXPECT_THAT(message, HasSubstr("cannot read the scenario: No such file"));
}

TEST(File, DoesNotReadAFolder) {
  const TemporaryFolder folder;
  EXPECT_THAT(message_of<InputError>([&] { read_file(folder.path("."), "model"); }),
              HasSubstr("is a folder; expected a model file"));
}

}  // namespace
}  // namespace heft::host
