// Output files: what was at a path before is kept in kind, and nothing is left behind.
#include <csignal>
#include <thread>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/host/output_folder.hpp"
#include "heft/host/signals.hpp"
#include "support/temporary_folder.hpp"

namespace heft::host {
namespace {

namespace fs = std::filesystem;
using heft::test::message_of;
using heft::test::TemporaryFolder;
using testing::AllOf;
using testing::HasSubstr;

struct stat status_of(const std::string& path) {
  struct stat status {};
  EXPECT_EQ(::lstat(path.c_str(), &status), 0) << path;
  return status;
}

TEST(Output, KeepsTheModeOfTheFileItReplaces) {
  const TemporaryFolder folder;
  const std::string path = folder.write("out.txt", "old");
  ::chmod(path.c_str(), 0640);
  write_file_atomically(path, "new");
  EXPECT_EQ(status_of(path).st_mode & 07777, 0640U);
  EXPECT_EQ(read_file(path, "file"), "new");
}

TEST(Output, KeepsTheOwnerOfTheFileItReplaces) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root may give a file to another user";
  const TemporaryFolder folder;
  const std::string path = folder.write("out.txt", "old");
  ASSERT_EQ(::chown(path.c_str(), 1234, 4321), 0);
  write_file_atomically(path, "new");
  EXPECT_EQ(status_of(path).st_uid, 1234U);
  EXPECT_EQ(status_of(path).st_gid, 4321U);
}

TEST(Output, GivesANewFileTheModeThatTheUserAskedFor) {
  const TemporaryFolder folder;
  const mode_t before = ::umask(027);
  write_file_atomically(folder.path("out.txt"), "new");
  ::umask(before);
  EXPECT_EQ(status_of(folder.path("out.txt")).st_mode & 07777, 0640U);
}

TEST(Output, FollowsLinksAlsoToWhatDoesNotExistYet) {
  const TemporaryFolder folder;
  fs::create_directory(folder.path("store"));
  fs::create_symlink("store/real.txt", folder.path("link"));
  fs::create_symlink("link", folder.path("second"));
  for (const char* content : {"first", "then replaced"}) {
    write_file_atomically(folder.path("second"), content);
    EXPECT_TRUE(S_ISLNK(status_of(folder.path("link")).st_mode));
    EXPECT_TRUE(S_ISLNK(status_of(folder.path("second")).st_mode));
    EXPECT_EQ(read_file(folder.path("store/real.txt"), "file"), content);
  }
}

TEST(Output, RefusesLinksInACircle) {
  const TemporaryFolder folder;
  fs::create_symlink("b", folder.path("a"));
  fs::create_symlink("a", folder.path("b"));
  EXPECT_THAT(message_of<InputError>([&] { write_file_atomically(folder.path("a"), "x"); }),
              HasSubstr("circle"));
}

TEST(Output, WritesThroughADeviceAndLeavesItADevice) {
  const TemporaryFolder folder;
  const std::string path = folder.path("null");
  if (::mknod(path.c_str(), S_IFCHR | 0666, (1 << 8) | 3) != 0) GTEST_SKIP() << "only root may make a device";
  write_file_atomically(path, "gone");
  EXPECT_TRUE(S_ISCHR(status_of(path).st_mode));
}

TEST(Output, WritesThroughAFifo) {
  const TemporaryFolder folder;
  const std::string path = folder.path("fifo");
  ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
  std::string received;
  std::thread reader([&] { received = read_file(path, "file"); });
  write_file_atomically(path, "through");
  reader.join();
  EXPECT_EQ(received, "through");
  EXPECT_TRUE(S_ISFIFO(status_of(path).st_mode));
}

TEST(Output, WritesToADescriptorOfTheProcess) {
  const TemporaryFolder folder;
  const int descriptor = ::open(folder.path("out").c_str(), O_WRONLY | O_CREAT, 0600);
  ASSERT_GE(descriptor, 0);
  write_file_atomically("/dev/fd/" + std::to_string(descriptor), "to a descriptor");
  ::close(descriptor);
  EXPECT_EQ(read_file(folder.path("out"), "file"), "to a descriptor");
}

TEST(Output, SaysThatADeviceIsFull) {
  EXPECT_THAT(message_of<InputError>([] { write_file_atomically("/dev/full", "x"); }),
              AllOf(HasSubstr("/dev/full"), HasSubstr("No space left on device")));
}

TEST(Output, DoesNotReplaceAFileThatIsWriteProtected) {
  const TemporaryFolder folder;
  const std::string path = folder.write("measured.csv", "a day's work");
  ::chmod(path.c_str(), 0444);
  EXPECT_THAT(message_of<InputError>([&] { write_file_atomically(path, "x"); }),
              HasSubstr("write-protected"));
  EXPECT_EQ(read_file(path, "file"), "a day's work");
}

TEST(Output, TakesTheLongestNameThatTheFileSystemTakes) {
  const TemporaryFolder folder;
  for (const std::size_t length : {200U, 249U, 255U}) {
    const std::string path = folder.path(std::string(length, 'n'));
    write_file_atomically(path, "x");
    EXPECT_EQ(read_file(path, "file"), "x");
  }
  EXPECT_THAT(message_of<InputError>([&] { write_file_atomically(folder.path(std::string(256, 'n')), "x"); }),
              HasSubstr("File name too long"));
}

TEST(Output, KeepsTheOldFileWhenTheNewOneDoesNotFit) {
  const TemporaryFolder folder;
  const std::string path = folder.write("out.txt", "old");
  const pid_t child = ::fork();
  if (child == 0) {
    const rlimit small{1000, 1000};
    ::setrlimit(RLIMIT_FSIZE, &small);
    std::signal(SIGXFSZ, SIG_IGN);
    const std::string message =
        message_of<InputError>([&] { write_file_atomically(path, std::string(5000, 'x')); });
    ::_exit(message.find("File too large") != std::string::npos ? 0 : 1);
  }
  int result = -1;
  ASSERT_EQ(::waitpid(child, &result, 0), child);
  EXPECT_EQ(result, 0);
  EXPECT_EQ(read_file(path, "file"), "old");
  EXPECT_EQ(folder.num_entries(), 1U);
}

/// Runs `work` in a process that has the signal handlers, sends it a signal once `ready` is there, and returns how it
/// ended.
template <typename Work, typename Ready>
int status_after(int number, const Work& work, const Ready& ready) {
  const pid_t child = ::fork();
  if (child == 0) {
    std::signal(number, SIG_DFL);  // a test started in the background inherits signals that are ignored
    remove_temporaries_on_signals();
    work();
    ::_exit(0);
  }
  for (int k = 0; k < 5000 && !ready(); ++k) ::usleep(1000);
  EXPECT_TRUE(ready());
  ::kill(child, number);
  int result = -1;
  ::waitpid(child, &result, 0);
  return result;
}

TEST(Output, LeavesNothingBehindAfterASignal) {
  for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGQUIT}) {
    const TemporaryFolder folder;
    const std::string path = folder.write("out.txt", "old");
    // Writes again and again, so that the signal comes at any place of it.
    const std::string content(1 << 20, 'x');
    const int result = status_after(
        number,
        [&] {
          for (;;) write_file_atomically(path, content);
        },
        [&] { return read_file(path, "file") != "old"; });
    EXPECT_TRUE(WIFSIGNALED(result) && WTERMSIG(result) == number)
        << "a shell has to see the signal " << number;
    EXPECT_EQ(read_file(path, "file"), content) << "half a file";
    EXPECT_EQ(folder.num_entries(), 1U) << "a temporary file after signal " << number;
  }
}

TEST(Output, LeavesNoEmptyFolderBehindAfterASignal) {
  const TemporaryFolder folder;
  const int result = status_after(
      SIGINT,
      [&] {
        const OutputFolder made(folder.path("out/of/nothing"));
        for (;;) ::pause();
      },
      [&] { return fs::exists(folder.path("out/of/nothing")); });
  EXPECT_TRUE(WIFSIGNALED(result));
  EXPECT_EQ(folder.num_entries(), 0U);
}

TEST(Output, KeepsAnIgnoredSignalIgnored) {
  const TemporaryFolder folder;
  const pid_t child = ::fork();
  if (child == 0) {
    std::signal(SIGHUP, SIG_IGN);  // as nohup does
    remove_temporaries_on_signals();
    std::raise(SIGHUP);
    ::_exit(7);
  }
  int result = -1;
  ASSERT_EQ(::waitpid(child, &result, 0), child);
  EXPECT_TRUE(WIFEXITED(result) && WEXITSTATUS(result) == 7);
}

TEST(OutputFolder, StaysWhenItHoldsSomethingAndGoesWhenItDoesNot) {
  const TemporaryFolder folder;
  { const OutputFolder made(folder.path("empty/inner")); }
  EXPECT_FALSE(fs::exists(folder.path("empty")));
  {
    const OutputFolder made(folder.path("full/inner"));
    write_file_atomically(made.file("page.html"), "x");
  }
  EXPECT_TRUE(fs::exists(folder.path("full/inner/page.html")));
  fs::create_directory(folder.path("before"));
  { const OutputFolder found(folder.path("before")); }
  EXPECT_TRUE(fs::exists(folder.path("before"))) << "a folder that was there already is not ours to remove";
}

TEST(OutputFolder, RefusesAFileInItsPlace) {
  const TemporaryFolder folder;
  folder.write("file", "x");
  EXPECT_THAT(message_of<InputError>([&] { OutputFolder(folder.path("file/inner")); }),
              HasSubstr("found a file of this name"));
  EXPECT_EQ(read_file(folder.path("file"), "file"), "x");
}

}  // namespace
}  // namespace heft::host
