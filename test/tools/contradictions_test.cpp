// Logs whose numbers contradict the robot, as people bring them: each row alters a sound log, runs the command, and reads
// what it says. Nothing may be written.
#include <algorithm>
#include <filesystem>
#include <functional>
#include <iterator>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/data/log.hpp"
#include "heft/host/file.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/fourier_log.hpp"
#include "support/run_heft.hpp"
#include "support/temporary_folder.hpp"

namespace heft::test {
namespace {

namespace fs = std::filesystem;

/// A UR10e of its description, with friction and noise; no velocities were logged.
data::Log sound_log(unsigned seed) {
  FourierLogSettings settings;
  settings.seed = seed;
  settings.duration = 30.0;
  model::Robot arm = urdf::load_urdf(std::string(HEFT_URDF_DIR) + "/ur10e.urdf");
  data::Log log = fourier_log(arm, settings);
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 0.5);
  log.tau = log.tau.unaryExpr([&](double torque) { return torque + noise(random); });
  log.qdd.resize(0, 0);
  return log;
}

struct Contradiction {
  const char* name;
  std::function<void(data::Log&)> alter;
  std::vector<const char*> texts;  ///< all of them in what is said
  std::vector<std::string> command{"identify", "--urdf", "ur10e", "--log", "log.csv", "-o", "model.json"};
};

void PrintTo(const Contradiction& c, std::ostream* out) { *out << c.name; }

class Contradictions : public testing::TestWithParam<Contradiction> {};

TEST_P(Contradictions, AreNamedAndRefused) {
  const TemporaryFolder folder;
  data::write_log(folder.path("sound.csv"), sound_log(2));
  data::Log log = sound_log(1);
  GetParam().alter(log);
  data::write_log(folder.path("log.csv"), log);
  const Outcome outcome = run_heft(GetParam().command, folder.path(""));
  EXPECT_EQ(outcome.exit_code, 3) << outcome.err;
  for (const char* text : GetParam().texts) EXPECT_THAT(outcome.err, testing::HasSubstr(text));
  EXPECT_FALSE(fs::exists(folder.path("model.json")));
}

void flip_second(data::Log& log) { log.tau.col(1) *= -1.0; }

const std::vector<std::string> kDiagnose{"diagnose",   "--urdf",    "ur10e", "--log",     "log.csv",
                                         "--validate", "sound.csv", "-o",    "model.json"};
const std::vector<std::string> kJudgeOnIt{"identify",   "--urdf",  "ur10e", "--log",     "sound.csv",
                                          "--validate", "log.csv", "-o",    "model.json"};

const Contradiction kRows[] = {
    {"OppositeSign",
     flip_second,
     {"log.csv: the torque contradicts the robot", "tau2 fits with the opposite sign", "--accept-torque"}},
    {"OppositeSignOfAWristJoint",
     [](data::Log& log) { log.tau.col(5) *= -1.0; },
     {"tau6 fits with the opposite sign"}},
    {"InterchangedTorques",
     [](data::Log& log) { log.tau.col(1).swap(log.tau.col(2)); },
     {"tau2 and tau3 look interchanged"}},
    {"TorqueOfTheMotor",
     [](data::Log& log) { log.tau /= 101.0; },
     {"motor's side of the gears", "multiply by the gear ratios"}},
    {"Amperes", [](data::Log& log) { log.tau /= 11.0; }, {"motor currents in amperes", "--torque-constant"}},
    {"MillinewtonMetres", [](data::Log& log) { log.tau *= 1000.0; }, {"another unit"}},
    {"AllZeros",
     [](data::Log& log) { log.tau.setZero(); },
     {"tau1, tau2, tau3, tau4, tau5, tau6 never change"}},
    {"OneDeadColumn", [](data::Log& log) { log.tau.col(2).setConstant(0.25); }, {"tau3 never changes"}},
    {"OneJointInAnotherUnit", [](data::Log& log) { log.tau.col(1) /= 101.0; }, {"tau2 is 0.01"}},
    {"ZeroOffByAQuarterTurn",
     [](data::Log& log) { log.q.col(1).array() -= 0.5 * std::numbers::pi; },
     {"+90° is added to q2"}},
    {"ModelOfAnotherArm",
     [](data::Log&) {},
     {"fits ur10e", "check --urdf"},
     {"identify", "--urdf", "ur5e", "--log", "log.csv", "-o", "model.json"}},
    {"ArmOnAWall",
     [](data::Log&) {},
     {"gravity points along -z of the base", "--mount 0,0,0"},
     {"identify", "--urdf", "ur10e", "--mount", "0,1.5708,0", "--log", "log.csv", "-o", "model.json"}},
    {"ArmUnderACeiling",
     [](data::Log&) {},
     {"gravity points along -z of the base"},
     {"identify", "--urdf", "ur10e", "--mount", "3.141592653589793,0,0", "--log", "log.csv", "-o",
      "model.json"}},
    {"ClockOfAnotherRate", [](data::Log& log) { log.time *= 20.0; }, {"column 'time'", "divide time by 20"}},
    {"Degrees", [](data::Log& log) { log.q *= 180.0 / std::numbers::pi; }, {"degrees"}},
    {"SignInALogToJudgeOn", flip_second, {"log.csv: the torque contradicts the robot"}, kJudgeOnIt},
    {"SignBeforeADiagnosis", flip_second, {"tau2 fits with the opposite sign"}, kDiagnose},
    {"SignBeforeAValidation",
     flip_second,
     {"tau2 fits with the opposite sign"},
     {"validate", "--urdf", "ur10e", "--log", "log.csv"}},
    {"SignUnderALoad",
     flip_second,
     {"tau2 fits with the opposite sign"},
     {"payload", "--urdf", "ur10e", "--baseline", "sound.csv", "--log", "log.csv"}},
    {"SignOfTheUnloadedArm",
     flip_second,
     {"tau2 fits with the opposite sign"},
     {"payload", "--urdf", "ur10e", "--baseline", "log.csv", "--log", "sound.csv"}},
    {"SignBeforeStiffness",
     flip_second,
     {"tau2 fits with the opposite sign"},
     {"stiffness", "--urdf", "ur10e", "--log", "log.csv", "--validate", "sound.csv"}},
};

INSTANTIATE_TEST_SUITE_P(Numbers, Contradictions, testing::ValuesIn(kRows),
                         [](const auto& row) { return std::string(row.param.name); });

TEST(Contradictions, GoOnWhereTheyAreAcceptedButAreNeverGood) {
  const TemporaryFolder folder;
  data::Log log = sound_log(1);
  flip_second(log);
  data::write_log(folder.path("log.csv"), log);
  const Outcome outcome = run_heft(
      {"identify", "--urdf", "ur10e", "--log", "log.csv", "--accept-torque", "--json", "-"}, folder.path(""));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, testing::HasSubstr("warning: log.csv: tau2 fits with the opposite sign"));
  EXPECT_THAT(outcome.out, testing::HasSubstr("\"verdict\": \"bad\""));
}

TEST(Contradictions, OfTheUnloadedArmAreNeverGoodEither) {
  const TemporaryFolder folder;
  data::Log log = sound_log(1);
  flip_second(log);
  data::write_log(folder.path("log.csv"), log);
  data::write_log(folder.path("sound.csv"), sound_log(2));
  // The arm's model rests on the flipped log, the load on a sound one.
  const Outcome outcome = run_heft({"payload", "--urdf", "ur10e", "--baseline", "log.csv", "--log",
                                    "sound.csv", "--accept-torque", "--json", "-"},
                                   folder.path(""));
  EXPECT_THAT(outcome.out, testing::HasSubstr("\"verdict\": \"bad\""));
  EXPECT_THAT(outcome.out, testing::HasSubstr("log.csv: tau2 fits with the opposite sign"));
}

// A stream is refused by the same check, as soon as its first seconds show it, and not at its end with a load that cannot be.
TEST(Contradictions, OfAStreamAreRefusedAsThoseOfALog) {
  const TemporaryFolder folder;
  data::write_log(folder.path("sound.csv"), sound_log(2));
  data::write_log(folder.path("other.csv"), sound_log(3));
  ASSERT_EQ(run_heft({"payload", "--urdf", "ur10e", "--baseline", "sound.csv", "--log", "other.csv", "-o",
                      "bare.json"},
                     folder.path(""))
                .exit_code,
            0);
  for (const char* name : {"OppositeSign", "InterchangedTorques", "Degrees", "Amperes", "TorqueOfTheMotor"}) {
    const auto* row = std::find_if(std::begin(kRows), std::end(kRows),
                                   [&](const Contradiction& c) { return std::string(c.name) == name; });
    ASSERT_NE(row, std::end(kRows)) << name;
    data::Log log = sound_log(1);
    row->alter(log);
    data::write_log(folder.path("log.csv"), log);
    const Outcome outcome = piped_heft("payload - --urdf ur10e --model bare.json",
                                       host::read_file(folder.path("log.csv"), "log"), folder.path(""));
    EXPECT_EQ(outcome.exit_code, 3) << name << outcome.err;
    for (const std::string text : row->texts) {
      if (text.find("log.csv") != std::string::npos) continue;
      EXPECT_THAT(outcome.err, testing::HasSubstr(text)) << name;
    }
    EXPECT_THAT(outcome.out, testing::Not(testing::HasSubstr("samples taken"))) << name;
  }
  data::Log flipped = sound_log(1);
  flip_second(flipped);
  data::write_log(folder.path("log.csv"), flipped);
  const Outcome accepted = piped_heft("payload - --urdf ur10e --model bare.json --accept-torque",
                                      host::read_file(folder.path("log.csv"), "log"), folder.path(""));
  EXPECT_EQ(accepted.exit_code, 4) << accepted.err;
  EXPECT_THAT(accepted.err, testing::HasSubstr("warning: -: tau2 fits with the opposite sign"));
}

TEST(Contradictions, ASoundLogIsTaken) {
  const TemporaryFolder folder;
  data::write_log(folder.path("log.csv"), sound_log(1));
  const Outcome outcome =
      run_heft({"identify", "--urdf", "ur10e", "--method", "physical", "--log", "log.csv", "--json", "-"},
               folder.path(""));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, testing::Not(testing::HasSubstr("warning")));
  EXPECT_THAT(outcome.out, testing::HasSubstr("\"verdict\": \"good\""));
}

}  // namespace
}  // namespace heft::test
