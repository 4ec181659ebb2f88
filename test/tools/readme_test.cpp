/// The tables of README.md: each line is run as it stands there.
#include <array>
#include <filesystem>
#include <iterator>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/data/log.hpp"
#include "heft/host/file.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/arms.hpp"
#include "support/run_heft.hpp"
#include "support/synthetic_log.hpp"
#include "support/temporary_folder.hpp"

namespace heft {
namespace {

using ::testing::HasSubstr;

const std::string kSource = HEFT_SOURCE_DIR;
const std::string kForeign = kSource + "/test/data/foreign/";

std::string text_of(const std::string& path) { return host::read_file(path, "file"); }

/// What is marked as code in a line.
std::vector<std::string> code_in(const std::string& line) {
  std::vector<std::string> spans;
  for (std::size_t at = line.find('`'); at != std::string::npos; at = line.find('`', at + 1)) {
    const std::size_t end = line.find('`', at + 1);
    if (end == std::string::npos) break;
    spans.push_back(line.substr(at + 1, end - at - 1));
    at = end;
  }
  return spans;
}

/// Commands in the tables of a section of README.md. An option alone stands for the command before it with that option.
std::vector<std::string> commands_of(const std::string& section) {
  const std::string readme = text_of(kSource + "/README.md");
  const std::size_t begin = readme.find("\n## " + section + "\n");
  if (begin == std::string::npos) return {};
  std::istringstream text(readme.substr(begin + 1, readme.find("\n## ", begin + 1) - begin));
  std::vector<std::string> commands;
  for (std::string line; std::getline(text, line);) {
    if (!line.starts_with('|')) continue;
    const std::size_t before = commands.size();
    for (const std::string& code : code_in(line)) {
      if (code.starts_with("heft ")) {
        commands.push_back(code);
      } else if (code.starts_with("--") && commands.size() > before) {
        const std::string option = code.substr(0, code.find(' ') + 1), last = commands.back();
        commands.push_back(last.substr(0, last.find(option)) + code);
      }
    }
  }
  return commands;
}

test::Outcome run(const std::string& command, const std::string& folder) {
  std::istringstream text(command.substr(5));
  const std::vector<std::string> words{std::istream_iterator<std::string>(text), {}};
  return test::run_heft(words, folder);
}

TEST(Readme, EachLineOfYourLogIsRun) {
  const std::vector<std::string> commands = commands_of("Your log");
  EXPECT_GE(commands.size(), 17U);
  const test::TemporaryFolder folder;
  std::filesystem::copy(kForeign, folder.path("logs"), std::filesystem::copy_options::recursive);
  for (const auto& [fixture, name] :
       std::vector<std::pair<std::string, std::string>>{{"zstd.mcap", "run.mcap"},
                                                        {"rosbag2.db3", "run.db3"},
                                                        {"two_files", "rosbag2_folder"},
                                                        {"plain.mat", "run.mat"},
                                                        {"stored.npz", "run.npz"}})
    std::filesystem::copy(kForeign + "binary/" + fixture, folder.path("logs/" + name),
                          std::filesystem::copy_options::recursive);
  for (const std::string& command : commands) {
    const test::Outcome outcome = run(command, folder.path("logs"));
    EXPECT_EQ(outcome.exit_code, 0) << command << "\n" << outcome.err;
    EXPECT_EQ(outcome.out.find("Wrong"), std::string::npos) << command << "\n" << outcome.out;
  }
  EXPECT_THAT(text_of(folder.path("logs/run.csv")), HasSubstr("time,q1,q2,q3,q4,tau1"));
}

/// Loads, then the robot itself: an arm of two joints that weighs 1.2 kg.
TEST(Readme, EachLineOfYourRobotIsRun) {
  const std::vector<std::string> commands = commands_of("Your robot: where the answer goes");
  EXPECT_GE(commands.size(), 15U);
  const test::TemporaryFolder folder;
  model::Robot robot = urdf::load_urdf(HEFT_URDF_DIR "/ur5e.urdf");
  for (model::RobotJoint& joint : robot.joints)
    joint.actuation = {.rotor_inertia = 0.2, .coulomb_friction = 1.0, .viscous_friction = 1.0};
  test::SyntheticSettings settings;
  settings.noise = 0.002;
  settings.amplitude = 1.0;
  data::write_log(folder.path("run.csv"), test::synthetic_log(robot, settings));
  settings.noise_seed = settings.motion_seed = 2;
  const std::array<double, 3>& tip = robot.tip_position;
  const auto load = test::body(1.2, {tip[0], tip[1], tip[2] + 0.08}, {0.01, 0, 0.012, 0, 0, 0.008});
  data::write_log(folder.path("carrying.csv"), test::synthetic_log(test::carrying(robot, load), settings));
  std::filesystem::copy(HEFT_URDF_DIR "/ur5e.urdf", folder.path("own.urdf"));
  for (const std::string model : {"bare.json", "arm.json"}) {
    const test::Outcome fitted =
        run("heft identify --urdf own.urdf --log run.csv --method physical -o " + model, folder.path(""));
    ASSERT_EQ(fitted.exit_code, 0) << fitted.err;
  }
  // A controller that compensates for a quarter more viscous and a fifth less Coulomb friction than there is.
  for (model::RobotJoint& joint : robot.joints)
    joint.actuation = {.rotor_inertia = 0.2, .coulomb_friction = 0.8, .viscous_friction = 1.25};
  settings.noise_seed = settings.motion_seed = 3;
  data::write_log(folder.path("targets.csv"), test::synthetic_log(robot, settings));
  const test::Outcome of_controller =
      run("heft identify --urdf own.urdf --log targets.csv --method physical -o controller.json", folder.path(""));
  ASSERT_EQ(of_controller.exit_code, 0) << of_controller.err;
  for (const std::string& command : commands) {
    const test::Outcome outcome = run(command, folder.path(""));
    EXPECT_EQ(outcome.exit_code, 0) << command << "\n" << outcome.err;
    const std::size_t file = command.find(" -o ");
    if (command.find("ur-friction") != std::string::npos) {
      EXPECT_THAT(text_of(folder.path("arm.script")),
                  ::testing::AllOf(::testing::ContainsRegex("viscous_scale = .0\\.(7[7-9]|8[0-2])"),
                                   HasSubstr("coulomb_scale = [1.000, 1.000")));
    } else if (file != std::string::npos) {
      EXPECT_GT(text_of(folder.path(command.substr(file + 4).c_str())).size(), 500U) << command;
    } else if (command.find("payload") != std::string::npos) {
      EXPECT_THAT(outcome.out, ::testing::ContainsRegex("1\\.(19|20|2,|2\\b)")) << command;
    }
  }
  EXPECT_THAT(text_of(folder.path("new.urdf")), HasSubstr("<robot name=\"ur5e\""));
}

}  // namespace
}  // namespace heft
