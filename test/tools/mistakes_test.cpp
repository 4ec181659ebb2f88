// Mistakes that people make with files and options: each row runs the command in a folder with a day's work in it, reads
// the message, and looks that nothing there was lost, changed or half written.
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "heft/host/file.hpp"
#include "support/run_heft.hpp"
#include "support/temporary_folder.hpp"

namespace heft::test {
namespace {

namespace fs = std::filesystem;

struct Mistake {
  const char* name;
  const char* command;  ///< for bash, in the folder; H is the heft command
  int exit_code;
  std::vector<const char*> texts;  ///< all of them occur in what is printed on standard error
  const char* may_appear{""};      ///< a file that is rightly written
};

void PrintTo(const Mistake& mistake, std::ostream* out) { *out << mistake.command; }

constexpr const char* kPoses = "time,q1,q2,q3,q4\n0,0,0,0.1,0\n1,0.5,-0.25,0.15,0.3\n2,0.6,-0.3,0.1,0.4\n";
constexpr const char* kScenario = R"({
  "robot": "scara", "duration": 0.5, "sample_rate": 1000,
  "reference": {"kind": "hold", "position": [0, 0, 0.1, 0]},
  "controller": {"kind": "pd", "kp": 100, "kd": 10}
})";

/// Path, kind, mode and content of everything below a folder.
std::map<std::string, std::string> snapshot(const std::string& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    struct stat status {};
    ::lstat(entry.path().c_str(), &status);
    std::string what = std::to_string(status.st_mode) + " " + std::to_string(status.st_uid) + " ";
    if (entry.is_symlink()) what += fs::read_symlink(entry.path()).string();
    else if (entry.is_regular_file()) what += host::read_file(entry.path().string(), "file");
    files[fs::relative(entry.path(), folder).string()] = what;
  }
  return files;
}

class Mistakes : public testing::TestWithParam<Mistake> {
 protected:
  void SetUp() override {
    folder_.write("a.csv", kPoses);
    folder_.write("b.csv", std::string(kPoses) + "3,0.7,-0.3,0.1,0.4\n");
    folder_.write("copy.csv", kPoses);
    folder_.write("scenario.json", kScenario);
    fs::copy_file(fs::path(HEFT_SOURCE_DIR) / "urdf/scara.urdf", folder_.path("mine.urdf"));
    folder_.write("old.csv", "last week's result\n");
    ::chmod(folder_.path("old.csv").c_str(), 0640);
    folder_.write("protected.csv", "measured once\n");
    ::chmod(folder_.path("protected.csv").c_str(), 0444);
    fs::create_symlink("a.csv", folder_.path("link.csv"));
    fs::create_directory(folder_.path("folder"));
    folder_.write("deep.json", "{\"robot\":" + std::string(90000, '[') + std::string(90000, ']') + "}");
    folder_.write("huge.json", R"({"robot": "scara", "duration": 1e999})");
    folder_.write("cut.csv", "time,q1,q2,q3,q4\n" + rows(20) + "20,0.000,0.000,0.100,0.0");
    folder_.write("wild.csv",
                  "time,q1,q2,q3,q4,qd1,qd2,qd3,qd4,qdd1,qdd2,qdd3,qdd4\n"
                  "0,0,0,0,0,0,0,0,0,0,0,0,0\n1,0,0,0,0,0,0,0,0,1e308,1e308,-1e308,1e308\n");
    folder_.write("zeros.csv", std::string(3000000, '\0'));
  }

  static std::string rows(int count) {
    std::string text;
    for (int k = 0; k < count; ++k) text += std::to_string(k) + ",0.000,0.000,0.100,0.000\n";
    return text;
  }

  Outcome run(const std::string& command) const {
    const TemporaryFolder streams;
    const std::string line = "cd " + shell_quote(folder_.path("")) +
                             " && H=" + shell_quote(command_without_blanks(streams)) + " && { " + command +
                             "; } >" + shell_quote(streams.path("out")) + " 2>" +
                             shell_quote(streams.path("err")) + " </dev/null";
    const int status = std::system(("bash -c " + shell_quote(line)).c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, host::read_file(streams.path("out"), "output"),
            host::read_file(streams.path("err"), "output")};
  }

  TemporaryFolder folder_;
};

TEST_P(Mistakes, AreNamedAndNothingIsLost) {
  const Mistake& mistake = GetParam();
  const auto before = snapshot(folder_.path(""));
  const Outcome outcome = run(mistake.command);
  EXPECT_EQ(outcome.exit_code, mistake.exit_code) << outcome.err;
  for (const char* text : mistake.texts) EXPECT_THAT(outcome.err, testing::HasSubstr(text));
  EXPECT_THAT(outcome.err, testing::Not(testing::HasSubstr("defect of heft")));
  auto after = snapshot(folder_.path(""));
  if (const std::string written = mistake.may_appear; !written.empty()) {
    EXPECT_EQ(after.erase(written), 1U) << written << " was not written";
  }
  for (const auto& [name, what] : before) {
    ASSERT_TRUE(after.contains(name)) << name << " is gone";
    EXPECT_TRUE(after[name] == what) << name << " was changed";
  }
  for (const auto& [name, what] : after) EXPECT_TRUE(before.contains(name)) << name << " was left behind";
}

const Mistake kOutputOverInput[] = {
    {"IdentifyOverItsLog",
     "$H identify --urdf scara --log a.csv -o a.csv",
     3,
     {"a.csv: -o is the same file as a.csv of --log", "give another name to -o"}},
    {"ReportOverItsLog",
     "$H identify --urdf scara --log a.csv --report a.csv",
     3,
     {"--report is the same file as"}},
    {"JsonOverItsLog",
     "$H identify --urdf scara --log a.csv --json ./a.csv",
     3,
     {"--json is the same file as"}},
    {"DynamicsOverItsLogByALink",
     "$H dynamics --urdf scara --log a.csv -o link.csv",
     3,
     {"link.csv: -o is the same file as a.csv of --log"}},
    {"DynamicsOverTheSecondLog",
     "$H dynamics --urdf scara --log a.csv --log b.csv -o b.csv",
     3,
     {"-o is the same file as b.csv of --log"}},
    {"PayloadOverItsBaseline",
     "$H payload --urdf scara --baseline a.csv --log b.csv -o a.csv",
     3,
     {"-o is the same file as a.csv of --baseline"}},
    {"DiagnoseOverItsJudge",
     "$H diagnose --urdf scara --log a.csv --validate b.csv -o b.csv",
     3,
     {"-o is the same file as b.csv of --validate"}},
    {"WriteUrdfOverItsRobot",
     "$H identify --urdf mine.urdf --log a.csv --write-urdf mine.urdf",
     3,
     {"mine.urdf: --write-urdf is the same file as", "of --urdf"}},
    {"ModelOverWriteUrdfsModel",
     "$H identify --urdf scara --log a.csv --write-urdf new.urdf -o new.heft.json",
     3,
     {"new.heft.json: -o and the model next to --write-urdf lead to the same place"}},
    {"ModelOverItself",
     "$H validate --model deep.json --log a.csv --json deep.json",
     3,
     {"--json is the same file as deep.json of --model"}},
    {"SimulateOverItsScenario",
     "$H simulate --scenario scenario.json -o scenario.json",
     3,
     {"-o is the same file as scenario.json of --scenario"}},
    {"TrackOverItsScenario",
     "$H track --scenario scenario.json --report scenario.json",
     3,
     {"--report is the same file as scenario.json of --scenario"}},
    {"ExciteOverItsLimits",
     "$H excite --urdf scara --limits huge.json -o huge.json",
     3,
     {"-o is the same file as huge.json of --limits"}},
    {"StiffnessOverItsMeasurements",
     "$H stiffness --urdf scara --measurements a.csv -o a.csv",
     3,
     {"-o is the same file as a.csv of --measurements"}},
    {"CompensatedOverItsPath",
     "$H stiffness --urdf scara --stiffness 1e4,1e4,1e6,1e4 --payload 1 --path a.csv --compensated a.csv",
     3,
     {"--compensated is the same file as a.csv of --path"}},
    {"ExportOverItsRobot", "$H export --urdf mine.urdf -o mine.urdf", 3, {"-o is the same file as"}},
    {"TwoOutputsInOneFile",
     "$H dynamics --urdf scara --log a.csv -o q.csv --json q.csv",
     3,
     {"q.csv: -o and --json lead to the same place"}},
    {"TwoOutputsInOneOldFile",
     "$H dynamics --urdf scara --log a.csv -o old.csv --json ./old.csv",
     3,
     {"-o and --json lead to the same place"}},
    {"TwoOutputsOnStandardOutput",
     "$H dynamics --urdf scara --log a.csv -o - --json -",
     3,
     {"-o and --json lead to the same place"}},
};

const Mistake kOutputNowhere[] = {
    {"NoSuchFolder",
     "$H dynamics --urdf scara --log a.csv -o none/q.csv",
     3,
     {"none/q.csv: cannot write (-o): there is no folder none/", "make the folder"}},
    {"BadOutputIsNamedBeforeTheMissingLog",
     "$H identify --urdf scara --log missing.csv -o none/m.json",
     3,
     {"none/m.json", "(-o)"}},
    {"BadOutputIsNamedBeforeTheBadRobot",
     "$H diagnose --urdf nobody --log a.csv --validate b.csv --report none/r.html",
     3,
     {"none/r.html", "(--report)"}},
    {"BadOutputIsNamedBeforeTheBadScenario",
     "$H track --scenario huge.json --json none/t.json",
     3,
     {"none/t.json", "(--json)"}},
    {"BadOutputIsNamedBeforeALongSearch",
     "$H excite --urdf ur10e --duration 600 -o none/motion.csv",
     3,
     {"none/motion.csv"}},
    {"FolderInPlaceOfAFile",
     "$H dynamics --urdf scara --log a.csv -o folder",
     3,
     {"folder: cannot write: this is a folder; name a file in it (-o)"}},
    {"FileInPlaceOfAFolder",
     "$H dynamics --urdf scara --log a.csv -o a.csv/q.csv",
     3,
     {"a.csv/ is a file, not a folder"}},
    {"DemoIntoAFile", "$H demo -o old.csv", 3, {"old.csv: found a file of this name"}},
    {"ReproduceBelowAFile",
     "$H reproduce terminal-link -o old.csv/out",
     3,
     {"old.csv: found a file of this name"}},
    {"WriteProtectedResult",
     "$H dynamics --urdf scara --log a.csv -o protected.csv",
     3,
     {"protected.csv: cannot write (-o): the file is write-protected"}},
    {"EmptyName", "$H dynamics --urdf scara --log a.csv -o ''", 2, {"--output: found an empty name"}},
    {"NameTooLong",
     "$H dynamics --urdf scara --log a.csv -o $(printf 'n%.0s' {1..256})",
     3,
     {"File name too long"}},
    {"FullDevice",
     "$H dynamics --urdf scara --log a.csv --what gravity -o /dev/full",
     3,
     {"/dev/full: cannot write: No space left on device"}},
    {"FullStandardOutputForAFile",
     "$H dynamics --urdf scara --log a.csv --what gravity -o - >/dev/full",
     3,
     {"standard output: cannot write: No space left on device"}},
    {"FullStandardOutputForText",
     "$H export --urdf scara -o robot.hpp >/dev/full",
     3,
     {"standard output: results could not be written: No space left on device"},
     "robot.hpp"},
    {"FullStandardOutputOfAHelpText", "$H export --help >/dev/full", 3, {"No space left on device"}},
    // Longer than the buffer of a stream (4096 B): the write that fails is not the last one.
    {"FullStandardOutputOfALongHelpText", "$H excite --help >/dev/full", 3, {"No space left on device"}},
    {"ClosedStandardOutput",
     "$H export --urdf scara -o robot.hpp >&-",
     3,
     {"standard output: results could not be written"},
     "robot.hpp"},
    {"ClosedStandardOutputBehindAPipe",
     "$H dynamics --urdf scara --log <(cat a.csv) --what gravity -o q.csv <&- >&-",
     3,
     {"standard output: results could not be written"},
     "q.csv"},
    {"FullDeviceForTheJson",
     "$H simulate --scenario scenario.json -o q.csv --json /dev/full",
     3,
     {"/dev/full: cannot write: No space left on device"},
     "q.csv"},
    {"LimitOnTheSizeOfFiles",
     "ulimit -f 8; $H simulate --scenario scenario.json -o old.csv",
     3,
     {"old.csv: writing failed: File too large", "ulimit -f"}},
    {"LimitTooLowForAnyFile", "ulimit -f 1; $H demo -o new/demo", 3, {"File too large", "ulimit -f"}},
};

const Mistake kInputs[] = {
    {"LogTwice", "$H identify --urdf scara --log a.csv --log ./a.csv", 3, {"./a.csv: given to --log twice"}},
    {"LogTwiceByALink",
     "$H validate --urdf scara --log a.csv --log link.csv",
     3,
     {"link.csv: given to --log twice"}},
    {"CopyOfALog",
     "$H identify --urdf scara --log a.csv --log copy.csv",
     3,
     {"copy.csv: a copy of a.csv, the same samples byte for byte"}},
    {"JudgedOnItsTrainingLog",
     "$H identify --urdf scara --log a.csv --validate a.csv",
     3,
     {"given to --log and to --validate", "a model is not judged on the log it was fitted to"}},
    {"LoadAndBaselineTheSame", "$H payload --urdf scara --baseline a.csv --log copy.csv", 3, {"a copy of"}},
    {"MeasurementsTwice",
     "$H stiffness --urdf scara --measurements a.csv --measurements a.csv",
     3,
     {"given to --measurements twice"}},
    {"OnePipeTwice",
     "cat a.csv | $H dynamics --urdf scara --log - --log /dev/stdin -o q.csv",
     3,
     {"given to --log twice"}},
    {"BinaryLog", "$H dynamics --urdf scara --log zeros.csv -o q.csv", 3, {"zeros.csv:1: found a zero byte"}},
    {"CompressedLogInAPipe",
     "gzip -c zeros.csv | $H dynamics --urdf scara --log - -o q.csv",
     3,
     {"-:1: found a zero byte", "convert it"}},
    {"PipeOfZeros",
     "cat /dev/zero | $H dynamics --urdf scara --log - -o q.csv",
     3,
     {"-: cannot read the log", "nothing but zero bytes"}},
    {"EndlessPipe", "$H dynamics --urdf scara --log /dev/zero -o q.csv", 3, {"/dev/zero", "zero byte"}},
    {"LogCutInsideItsLastNumber",
     "$H dynamics --urdf scara --what gravity --log cut.csv -o q.csv",
     3,
     {"cut.csv:22: column 'q4': found '0.0' and the end of the file", "expected 3 decimals",
      "remove the line"}},
    {"TorqueThatIsNotFinite",
     "$H dynamics --urdf scara --log wild.csv -o old.csv",
     3,
     {"wild.csv: row 2 (time 1 s): the result is not finite"}},
    {"NumberBeyondDouble",
     "$H simulate --scenario huge.json -o q.csv",
     3,
     {"huge.json: found the number '1e999'"}},
    {"NumberBeyondDoubleInLimits", "$H excite --urdf scara --limits huge.json -o q.csv", 3, {"'1e999'"}},
    {"NestedScenario",
     "$H simulate --scenario deep.json -o q.csv",
     3,
     {"deep.json:1:", "more than 100 deep"}},
    {"NestedModel",
     "$H export --urdf scara --model deep.json -o q.hpp",
     3,
     {"deep.json:1:", "more than 100 deep"}},
    {"PathTooLong", "$H validate --model $(printf 'n%.0s' {1..5000}) --log a.csv", 3, {"File name too long"}},
    {"MoreSamplesThanMemory",
     "ulimit -v 4000000; sed 's/0.5,/1e5,/' scenario.json | $H simulate --scenario - -o q.csv",
     3,
     {"duration", "expected a log of at most 2 GB"}},
};

const Mistake kOptions[] = {
    {"RateOfThresholdsThatAreNotLearnt",
     "$H monitor --model m.json --log a.csv --rate 0.1",
     2,
     {"--rate", "give --learn FREE.csv"}},
    {"FreeWithoutLog",
     "$H monitor --model m.json --learn a.csv --free",
     2,
     {"--free is about the logs of --log"}},
    {"MisspeltOption",
     "$H identify --urdf scara --logs a.csv",
     2,
     {"there is no option '--logs'; did you mean '--log'?"}},
    {"FileWithoutOption",
     "$H identify a.csv --urdf scara",
     2,
     {"'a.csv' belongs to no option", "as in --log a.csv"}},
    {"MisspeltCommand", "$H identfy --urdf scara", 2, {"did you mean 'identify'?"}},
    {"BandNan",
     "$H identify --urdf scara --log a.csv --band nan",
     2,
     {"--band: found nan, expected a finite number"}},
    {"BandNegative",
     "$H identify --urdf scara --log a.csv --band -3",
     2,
     {"--band: found -3, expected a finite number greater than 0"}},
    {"SplitNan", "$H identify --urdf scara --log a.csv --split nan", 2, {"--split: found nan"}},
    {"SplitOne",
     "$H identify --urdf scara --log a.csv --split 1",
     2,
     {"--split: found 1, expected a number of at least 0 and less than 1"}},
    {"RidgeNan", "$H identify --urdf scara --log a.csv --ridge nan", 2, {"--ridge: found nan"}},
    {"CouplingNan",
     "$H identify --urdf scara --log a.csv --coupling 1,2,nan",
     2,
     {"--coupling 1,2,nan: found nan, expected finite numbers"}},
    {"FromNan", "$H track --scenario scenario.json --from nan", 2, {"--from: found nan"}},
    {"PullNan", "$H stiffness --urdf scara --plan 5 --pull nan,0,0", 2, {"--pull: found nan"}},
    {"RotorInertiaNan",
     "$H stiffness --urdf scara --log a.csv --rotor-inertia nan",
     2,
     {"--rotor-inertia: found nan"}},
    {"MountInfinite",
     "$H dynamics --urdf scara --log a.csv --mount inf,0,0 -o q.csv",
     2,
     {"--mount: found inf"}},
    {"RateZero",
     "$H excite --urdf scara --rate 0 -o q.csv",
     2,
     {"--rate: found 0, expected a finite number greater than 0"}},
    {"NoScenario", "$H simulate -o q.csv", 2, {"--scenario is required", "heft simulate --example"}},
};

std::string name_of(const testing::TestParamInfo<Mistake>& info) { return info.param.name; }
INSTANTIATE_TEST_SUITE_P(OutputOverInput, Mistakes, testing::ValuesIn(kOutputOverInput), name_of);
INSTANTIATE_TEST_SUITE_P(OutputNowhere, Mistakes, testing::ValuesIn(kOutputNowhere), name_of);
INSTANTIATE_TEST_SUITE_P(Inputs, Mistakes, testing::ValuesIn(kInputs), name_of);
INSTANTIATE_TEST_SUITE_P(Options, Mistakes, testing::ValuesIn(kOptions), name_of);

}  // namespace
}  // namespace heft::test
