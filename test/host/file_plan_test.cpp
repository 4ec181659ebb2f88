// Files of a program: what would lose data or fail in the end is refused before anything is read.
#include "heft/host/file_plan.hpp"

#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "support/temporary_folder.hpp"

namespace heft::host {
namespace {

namespace fs = std::filesystem;
using heft::test::message_of;
using heft::test::TemporaryFolder;
using testing::AllOf;
using testing::HasSubstr;

class Plan : public testing::Test {
 protected:
  std::string refusal() const {
    return message_of<InputError>([&] { plan_.check(); });
  }
  TemporaryFolder folder_;
  FilePlan plan_;
};

TEST_F(Plan, TakesFilesThatAreNotInTheWayOfEachOther) {
  plan_.add_measurements("--log", folder_.write("a.csv", "a"));
  plan_.add_measurements("--log", folder_.write("b.csv", "b"));
  plan_.add_output("-o", folder_.path("out.csv"));
  plan_.add_output("--json", folder_.path("out.json"));
  plan_.add_output_folder("--folder", folder_.path("new/folder"));
  EXPECT_EQ(refusal(), "");
  EXPECT_EQ(folder_.num_entries(), 2U) << "looking must leave nothing behind";
}

TEST_F(Plan, RefusesAnOutputThatIsAnInputUnderAnyName) {
  folder_.write("a.csv", "a");
  fs::create_symlink("a.csv", folder_.path("link.csv"));
  fs::create_hard_link(folder_.path("a.csv"), folder_.path("hard.csv"));
  fs::create_directory(folder_.path("sub"));
  for (const char* name : {"a.csv", "./a.csv", "sub/../a.csv", "link.csv", "hard.csv"}) {
    FilePlan plan;
    plan.add_input("--log", folder_.path("a.csv"));
    plan.add_output("-o", folder_.path(name));
    EXPECT_THAT(message_of<InputError>([&] { plan.check(); }),
                AllOf(HasSubstr("-o is the same file as"), HasSubstr("of --log")))
        << name;
  }
  EXPECT_EQ(read_file(folder_.path("a.csv"), "file"), "a");
}

TEST_F(Plan, RefusesTwoOutputsInOnePlaceAlsoBeforeItExists) {
  fs::create_symlink("new.csv", folder_.path("link.csv"));
  for (const char* name : {"new.csv", "./new.csv", "link.csv"}) {
    FilePlan plan;
    plan.add_output("-o", folder_.path("new.csv"));
    plan.add_output("--json", folder_.path(name));
    EXPECT_THAT(message_of<InputError>([&] { plan.check(); }),
                HasSubstr("-o and --json lead to the same place"))
        << name;
  }
}

TEST_F(Plan, LetsDevicesBeGivenSeveralTimes) {
  plan_.add_input("--log", "/dev/null");
  plan_.add_output("-o", "/dev/null");
  plan_.add_output("--json", "/dev/null");
  EXPECT_EQ(refusal(), "");
}

TEST_F(Plan, RefusesStandardOutputTwice) {
  plan_.add_output("-o", "-");
  plan_.add_output("--json", "/dev/stdout");
  EXPECT_THAT(refusal(), HasSubstr("-o and --json lead to the same place"));
}

TEST_F(Plan, SaysWhatIsWrongWithAFolder) {
  plan_.add_output("-o", folder_.path("missing/out.csv"));
  EXPECT_THAT(refusal(),
              AllOf(HasSubstr("(-o)"), HasSubstr("there is no folder"), HasSubstr("make the folder")));
}

TEST_F(Plan, RefusesAFileWhereAFolderShouldBeAndTheOtherWayRound) {
  folder_.write("file", "x");
  const auto message = [&](const std::string& path) {
    FilePlan plan;
    plan.add_output("-o", path);
    return message_of<InputError>([&] { plan.check(); });
  };
  EXPECT_THAT(message(folder_.path("file/out.csv")), HasSubstr("is a file, not a folder"));
  EXPECT_THAT(message(folder_.path("")), HasSubstr("this is a folder"));
  plan_.add_output_folder("-o", folder_.path("file/inner"));
  EXPECT_THAT(refusal(), HasSubstr("found a file of this name"));
}

TEST_F(Plan, RefusesAFileThatOnlyItsOwnerMayReplace) {
  if (::geteuid() != 0) GTEST_SKIP() << "needs root to be two users";
  const std::string path = folder_.write("theirs.csv", "x");
  ::chmod(folder_.path("").c_str(), 01777);
  ::chmod(path.c_str(), 0666);
  plan_.add_output("-o", path);
  EXPECT_EQ(refusal(), "");
  ASSERT_EQ(::seteuid(65534), 0);
  const std::string message = refusal();
  ASSERT_EQ(::seteuid(0), 0);
  EXPECT_THAT(message, HasSubstr("the file belongs to somebody else"));
}

TEST_F(Plan, TakesAFileInAFolderThatIsStillToBeMade) {
  plan_.add_output_folder("-o", folder_.path("out"));
  plan_.add_output("--json", folder_.path("out/also.json"));
  EXPECT_EQ(refusal(), "");
}

TEST_F(Plan, FindsADiskThatIsFullBeforeTheWork) {
  if (::geteuid() != 0 || std::system("command -v mount >/dev/null") != 0)
    GTEST_SKIP() << "needs root to mount";
  fs::create_directory(folder_.path("disk"));
  const std::string disk = folder_.path("disk");
  if (std::system(("mount -t tmpfs -o size=8k heft " + disk + " 2>/dev/null").c_str()) != 0)
    GTEST_SKIP() << "mounting is not allowed here";
  folder_.write("disk/fill", std::string(8192, 'x'));
  plan_.add_output("-o", disk + "/out.csv");
  const std::string message = refusal();
  EXPECT_EQ(std::system(("umount " + disk).c_str()), 0);
  EXPECT_THAT(message, AllOf(HasSubstr("No space left on device"), HasSubstr("(-o)")));
}

TEST_F(Plan, RefusesMeasurementsTwiceAndCopiesOfThem) {
  folder_.write("a.csv", "the same");
  folder_.write("copy.csv", "the same");
  folder_.write("other.csv", "not same");  // as long
  const auto message = [&](const char* option, const char* name) {
    FilePlan plan;
    plan.add_measurements("--log", folder_.path("a.csv"));
    plan.add_measurements(option, folder_.path(name));
    return message_of<InputError>([&] { plan.check(); });
  };
  EXPECT_THAT(message("--log", "a.csv"), HasSubstr("given to --log twice"));
  EXPECT_THAT(message("--validate", "a.csv"), HasSubstr("given to --log and to --validate"));
  EXPECT_THAT(message("--log", "copy.csv"), AllOf(HasSubstr("a copy of"), HasSubstr("byte for byte")));
  EXPECT_EQ(message("--log", "other.csv"), "");
}

TEST_F(Plan, LooksAtOutputsBeforeItReadsAnInput) {
  plan_.add_measurements("--log", folder_.path("missing.csv"));
  plan_.add_output("-o", folder_.path("no/out.csv"));
  EXPECT_THAT(refusal(), HasSubstr("no/out.csv"));
}

TEST_F(Plan, MakesAPipeReadableAsOftenAsNeeded) {
  const std::string fifo = folder_.path("fifo");
  ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);
  std::thread writer([&] { write_file_atomically(fifo, "time,q1\n0,1\n"); });
  plan_.add_measurements("--log", fifo);
  plan_.check();
  plan_.spool_pipes();
  writer.join();
  for (int k = 0; k < 3; ++k) EXPECT_EQ(read_file(fifo, "log"), "time,q1\n0,1\n");
}

TEST_F(Plan, RefusesBinaryDataThatNeverEnds) {
  plan_.add_measurements("--log", "/dev/zero");
  EXPECT_THAT(message_of<InputError>([&] { plan_.spool_pipes(); }), HasSubstr("zero byte"));
}

TEST(DeepJson, IsRefusedWithItsPlaceAndOrdinaryNestingIsNot) {
  const auto message = [](const std::string& text) {
    return message_of<InputError>([&] { refuse_deep_json(text, "s.json"); });
  };
  EXPECT_EQ(message("{\"a\": [[1, 2], [3]], \"b\": \"[[[{{{\\\"[[\"}"), "");
  std::string in_text = "{\"a\": \"" + std::string(200, '[') + "\"}";
  EXPECT_EQ(message(in_text), "") << "brackets in a text nest nothing";
  EXPECT_EQ(message("// \" a quote in a comment\n[1] /* \" */"), "");
  EXPECT_EQ(message(std::string(100, '[') + std::string(100, ']')), "");
  EXPECT_THAT(message("{\n\"a\":" + std::string(101, '[')), HasSubstr("s.json:2:104"));
}

}  // namespace
}  // namespace heft::host
