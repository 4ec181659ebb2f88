// Where the command's results go: they are never lost when a file fails, pipes are as good as files, interrupted commands
// leave nothing behind, help fits into a terminal.
#include <algorithm>
#include <csignal>
#include <regex>
#include <sstream>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include "heft/data/log.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/fourier_log.hpp"
#include "support/run_heft.hpp"

namespace heft::test {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

constexpr const char* kCommands[] = {"dynamics", "simulate", "excite",    "identify", "validate",  "diagnose",
                                     "payload",  "track",    "stiffness", "export",   "reproduce", "demo"};

class Files : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    logs_ = new TemporaryFolder;
    write_log("a.csv", 1, 0.3);
    write_log("b.csv", 2, 0.3);
    // As fast as its sampling allows, so that there is no band for its error.
    write_log("fast.csv", 1, 4.0);
  }
  static void write_log(const char* name, std::uint64_t seed, double base_frequency) {
    model::Robot robot = urdf::load_urdf(HEFT_URDF_DIR "/scara.urdf");
    for (model::RobotJoint& joint : robot.joints) joint.actuation = {0.05, 0.8, 0.6, 0.1};
    data::write_log(
        logs_->path(name),
        fourier_log(robot,
                    {.duration = 20.0, .seed = seed, .amplitude = 0.05, .base_frequency = base_frequency}));
  }
  static void TearDownTestSuite() { delete logs_; }

  void SetUp() override {
    for (const char* name : {"a.csv", "b.csv"}) fs::copy_file(logs_->path(name), folder_.path(name));
  }
  std::string path(const std::string& name) const { return folder_.path(name); }
  std::string read(const std::string& name) const { return host::read_file(path(name), "file"); }
  Outcome bash(const std::string& command) const {
    const TemporaryFolder streams;
    const std::string line = "cd " + shell_quote(path("")) +
                             " && H=" + shell_quote(command_without_blanks(streams)) + " && { " + command +
                             "; } >" + shell_quote(streams.path("out")) + " 2>" +
                             shell_quote(streams.path("err")) + " </dev/null";
    const int status = std::system(("bash -c " + shell_quote(line)).c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, host::read_file(streams.path("out"), "output"),
            host::read_file(streams.path("err"), "output")};
  }

  static TemporaryFolder* logs_;
  TemporaryFolder folder_;
};
TemporaryFolder* Files::logs_ = nullptr;

TEST_F(Files, ResultIsPrintedAndOtherFilesAreWrittenThoughOneFails) {
  const struct {
    const char* command;
    const char* printed;
  } cases[] = {
      {"$H dynamics --urdf scara --log a.csv -o /dev/full --json r.json --report r.html",
       "torque with rotor inertia"},
      {"$H identify --urdf scara --log a.csv -o /dev/full --json r.json --report r.html", "base parameters"},
      {"$H validate --urdf scara --log a.csv --json /dev/full --report r.html", "Acceptance"},
      {"$H payload --urdf scara --baseline a.csv --log b.csv -o /dev/full --json r.json --report r.html",
       "Model:"},
      {"$H diagnose --urdf scara --log a.csv --validate b.csv -o /dev/full --json r.json --report r.html",
       "error"},
      {"$H excite --urdf scara --duration 3 --harmonics 2 --starts 1 --compare 0 -o /dev/full --json r.json "
       "--report r.html",
       "Condition number"},
      {"$H stiffness --urdf scara --stiffness 1e4,1e4,1e6,1e4 -o /dev/full --json r.json --report r.html",
       "middle of the ranges"},
      {"$H simulate --example > s.json; $H simulate --scenario s.json -o /dev/full --json r.json --report "
       "r.html",
       "simulated for"},
  };
  for (const auto& [command, printed] : cases) {
    const Outcome outcome = bash(command);
    EXPECT_EQ(outcome.exit_code, 3) << command << "\n" << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("/dev/full: cannot write: No space left on device")) << command;
    EXPECT_THAT(outcome.out, HasSubstr(printed)) << command;
    EXPECT_TRUE(fs::exists(path("r.html"))) << command << ": the page is not what failed";
    fs::remove(path("r.html"));
  }
}

TEST_F(Files, FullStandardOutputIsExitCode3ForEveryCommand) {
  const char* const commands[] = {
      "$H dynamics --urdf scara --log a.csv -o q.csv",
      "$H identify --urdf scara --log a.csv",
      "$H validate --urdf scara --log a.csv",
      "$H payload --urdf scara --baseline a.csv --log b.csv",
      "$H export --urdf scara -o q.hpp",
      "$H stiffness --urdf scara --stiffness 1e4,1e4,1e6,1e4",
      "$H simulate --example",
      "$H --help",
      "$H identify --urdf scara --log a.csv --json -",
      "$H excite --urdf scara --duration 3 --harmonics 2 --starts 1 --compare 0 -o -",
      "$H export --urdf scara -o -"};
  for (const char* command : commands) {
    const Outcome outcome = bash(std::string(command) + " >/dev/full");
    EXPECT_EQ(outcome.exit_code, 3) << command << "\n" << outcome.err;
    EXPECT_THAT(outcome.err, AllOf(HasSubstr("standard output"), HasSubstr("No space left on device")))
        << command;
    EXPECT_THAT(outcome.err, Not(HasSubstr("defect"))) << command;
  }
}

TEST_F(Files, AreWrittenThoughTheReaderOfTheTextLeaves) {
  const Outcome outcome = bash("{ $H identify --urdf scara --log a.csv -o m.json; echo $? >code; } | true");
  EXPECT_TRUE(fs::exists(path("m.json"))) << outcome.err;
  EXPECT_EQ(read("code"), "141\n") << "as every program ends in front of head: by SIGPIPE, without a message";
  EXPECT_THAT(outcome.err, Not(HasSubstr("standard output")));
  const Outcome table =
      bash("{ $H dynamics --urdf scara --log a.csv -o - --json r.json; echo $? >code; } | true");
  EXPECT_EQ(read("code"), "141\n") << table.err;
  EXPECT_THAT(table.err, Not(HasSubstr("standard output")));
  EXPECT_TRUE(fs::exists(path("r.json")));
}

TEST_F(Files, DoNotTakeTheTextOfAClosedStandardOutput) {
  EXPECT_EQ(bash("$H export --urdf scara -o q.hpp >&-").exit_code, 3);
  EXPECT_THAT(read("q.hpp"), Not(HasSubstr("Written")));
}

TEST_F(Files, PipesGiveWhatFilesGiveInEveryCommand) {
  const char* const commands[] = {
      "$H dynamics --urdf scara --log A -o -",
      "$H identify --urdf scara --log A --json -",
      "$H validate --urdf scara --log A --json -",
      "$H payload --urdf scara --baseline b.csv --log A --json -",
      "$H diagnose --urdf scara --log A --validate b.csv --json -",
      "$H excite --urdf scara --duration 3 --harmonics 2 --starts 1 --compare 0 --given A -o -",
  };
  for (const std::string command : commands) {
    const auto with = [&](const std::string& log) {
      std::string line = command;
      line.replace(line.find(" A ") + 1, 1, log);
      return line;
    };
    // The name of the log is in some results.
    const std::string unnamed =
        " | sed 's#\"[^\"]*\\(a.csv\\|/dev/[a-z0-9/]*\\|-\\|fifo\\)[^\"]*\"##; s#/dev/[a-z0-9/]*##g'";
    const Outcome of_file = bash("cat a.csv >/dev/null; " + with("a.csv") + unnamed);
    ASSERT_EQ(of_file.exit_code, 0) << of_file.err;
    ASSERT_GT(of_file.out.size(), 100U);
    std::vector<std::string> pipes = {with("<(cat a.csv)") + unnamed};
    if (command.find("identify") != std::string::npos) {  // the command that reads its log most often
      pipes.push_back("cat a.csv | " + with("-") + unnamed);
      pipes.push_back("cat a.csv | " + with("/dev/stdin") + unnamed);
      pipes.push_back("mkfifo fifo; cat a.csv >fifo & " + with("fifo") + unnamed + "; rm fifo");
    }
    for (const std::string& pipe : pipes) {
      const Outcome of_pipe = bash(pipe);
      EXPECT_GT(of_pipe.out.size(), 100U) << pipe << "\n" << of_pipe.err;
      EXPECT_TRUE(of_pipe.out == of_file.out) << pipe;
    }
  }
}

TEST_F(Files, WithNamesThatAreNotUtf8KeepTheirResults) {
  const Outcome outcome =
      bash("cp a.csv up$'\\xe4'.csv; $H identify --urdf scara --log up$'\\xe4'.csv -o m.json --json r.json");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  for (const char* name : {"m.json", "r.json"}) EXPECT_TRUE(nlohmann::json::accept(read(name))) << name;
}

/// Starts the command in `folder`, sends it a signal after a moment, returns how it ended.
int interrupted(const std::string& folder, const std::vector<std::string>& arguments,
                const std::string& awaited) {
  const pid_t child = ::fork();
  if (child == 0) {
    if (::chdir(folder.c_str()) != 0) ::_exit(99);
    std::signal(SIGINT, SIG_DFL);  // a test started in the background inherits signals that are ignored
    const int nowhere = ::open("/dev/null", O_RDWR);
    for (const int stream : {0, 1, 2}) ::dup2(nowhere, stream);
    std::vector<char*> words{const_cast<char*>(HEFT_COMMAND)};
    for (const std::string& argument : arguments) words.push_back(const_cast<char*>(argument.c_str()));
    words.push_back(nullptr);
    ::execv(HEFT_COMMAND, words.data());
    ::_exit(98);
  }
  for (int k = 0; k < 10000 && !fs::exists(folder + "/" + awaited); ++k) ::usleep(1000);
  ::kill(child, SIGINT);
  int result = -1;
  ::waitpid(child, &result, 0);
  return result;
}

TEST_F(Files, AreNotLeftBehindByAnInterruptedReproduction) {
  fs::remove(path("a.csv"));
  fs::remove(path("b.csv"));
  const int result = interrupted(path(""), {"reproduce", "terminal-link", "-o", "out/study"}, "out/study");
  EXPECT_TRUE(WIFSIGNALED(result) && WTERMSIG(result) == SIGINT);
  EXPECT_EQ(folder_.num_entries(), 0U);
}

TEST_F(Files, ExampleScenarioRunsAndTracks) {
  const Outcome outcome = bash(
      "$H simulate --example | $H simulate --scenario - -o q.csv && "
      "$H simulate --example | $H track --scenario /dev/stdin");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("2 payload events"), HasSubstr("RMS tracking error")));
}

TEST_F(Files, EveryOptionThatNamesAFileIsLookedAtBeforeTheWork) {
  const std::regex option(R"((--[a-z-]+) [A-Z.,]*(?:FILE|FOLDER|ROBOT|\.csv|\.json|\.html|\.urdf|\.hpp))");
  int count = 0;
  for (const char* command : kCommands) {
    const std::string help = bash("$H " + std::string(command) + " --help").out;
    // The table of options; examples follow it.
    const std::string table = help.substr(0, help.find("\n\n", help.find("Options:")));
    for (std::sregex_iterator found(table.begin(), table.end(), option), end; found != end; ++found) {
      const std::string name = (*found)[1];
      const Outcome outcome = bash("$H " + std::string(command) + " " + name + " ''");
      EXPECT_EQ(outcome.exit_code, 2) << command << " " << name;
      EXPECT_THAT(outcome.err, HasSubstr("found an empty name"))
          << command << " " << name << ": its option has to say names_file()";
      ++count;
    }
  }
  EXPECT_GE(count, 50);
}

TEST_F(Files, PageOnStandardOutputIsAPageAlone) {
  const Outcome outcome = bash("$H identify --urdf scara --log a.csv --report -");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.out.substr(0, 15), "<!DOCTYPE html>");
  EXPECT_EQ(outcome.out.substr(outcome.out.size() - 8), "</html>\n");
  EXPECT_THAT(outcome.err, HasSubstr("base parameters"));
}

TEST_F(Files, ProseFitsIntoTheTerminal) {
  if (bash("command -v script").exit_code != 0)
    GTEST_SKIP() << "script, which makes a terminal, is not there";
  const Outcome outcome =
      bash("script -qec \"stty cols 72; $H identify --urdf scara --log a.csv\" /dev/null");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out;
  std::istringstream lines(outcome.out);
  const std::regex cells(R"(\S   *\S.*\S   *\S)");
  int prose = 0;
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (std::regex_search(line, cells)) continue;  // a row of a table
    const auto letters = std::count_if(line.begin(), line.end(), [](char c) { return (c & 0xC0) != 0x80; });
    EXPECT_LE(letters, 72) << line;
    prose += letters > 40 ? 1 : 0;
  }
  EXPECT_GT(prose, 10);
}

TEST_F(Files, HelpFitsIntoATerminalAndNamesTheScenariosKeys) {
  for (const char* command : {"", "dynamics", "simulate", "excite", "identify", "validate", "diagnose",
                              "payload", "track", "stiffness", "export", "reproduce", "demo"}) {
    const Outcome outcome = bash("unset COLUMNS; $H " + std::string(command) + " --help");
    std::istringstream lines(outcome.out);
    for (std::string line; std::getline(lines, line);) {
      const auto letters = std::count_if(line.begin(), line.end(), [](char c) { return (c & 0xC0) != 0x80; });
      EXPECT_LE(letters, 80) << command << ": " << line;
    }
  }
  for (const char* command : {"simulate", "track"}) {
    EXPECT_THAT(bash("$H " + std::string(command) + " --help").out,
                AllOf(HasSubstr("SCENARIO.json"), HasSubstr("pd_gravity"), HasSubstr("simulate --example")));
  }
}

TEST_F(Files, ProgressOnATerminalNeverRunsBackwards) {
  if (bash("command -v script").exit_code != 0)
    GTEST_SKIP() << "script, which makes a terminal, is not there";
  const Outcome outcome =
      bash("script -qec \"$H diagnose --urdf scara --log a.csv --validate b.csv\" /dev/null");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out;
  const std::regex percent(R"((\d+) %)");
  int last = 0, shown = 0;
  // Every update begins with the code that clears the line.
  for (std::size_t at = outcome.out.find("\033[K"); at != std::string::npos;
       at = outcome.out.find("\033[K", at + 1)) {
    std::smatch match;
    const std::string update = outcome.out.substr(at, outcome.out.find('\r', at) - at);
    if (update.find("diagnosing") == std::string::npos || !std::regex_search(update, match, percent))
      continue;
    const int now = std::stoi(match[1]);
    EXPECT_GE(now, last);
    last = now;
    ++shown;
  }
  if (shown == 0) GTEST_SKIP() << "done within a second: nothing was shown";
}

TEST_F(Files, ProgressIsALineEveryTenSecondsWithoutATerminal) {
  const Outcome quick = bash("$H identify --urdf scara --log a.csv");
  EXPECT_THAT(quick.err, Not(HasSubstr(" % after "))) << "nothing is said of what takes less";
  EXPECT_THAT(quick.err, Not(HasSubstr("\033"))) << "no terminal's codes in a file";
}

TEST_F(Files, ValidateHasNoNanInItsText) {
  const Outcome outcome = bash("$H validate --urdf scara --log " + shell_quote(logs_->path("fast.csv")));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("in band not known"));
  EXPECT_THAT(outcome.out + outcome.err, Not(HasSubstr("nan")));
}

}  // namespace
}  // namespace heft::test
