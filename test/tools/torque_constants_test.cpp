/// heft torque-constants as a user runs it: results, files, messages, exit codes.
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heft/host/file.hpp"
#include "support/run_heft.hpp"
#include "support/temporary_folder.hpp"

namespace heft {
namespace {

using ::testing::HasSubstr;

const std::string kDrive = std::string(HEFT_SOURCE_DIR) + "/test/golden/inputs/drive.csv";

TEST(TorqueConstantsCommand, FindsTheConstantsOfADrive) {
  const test::TemporaryFolder folder;
  const std::string constants = folder.path("constants.json");
  const test::Outcome found = test::run_heft({"torque-constants", "--log", kDrive, "--json", constants});
  ASSERT_EQ(found.exit_code, 0) << found.err;
  EXPECT_THAT(found.out, HasSubstr("standstill"));
  const auto json = nlohmann::json::parse(host::read_file(constants, "constants"));
  EXPECT_EQ(json["verdict"], "good");
  EXPECT_NEAR(json["joints"][0]["value"].get<double>(), 10.7, 0.005);
  EXPECT_NEAR(json["joints"][1]["value"].get<double>(), 8.2, 0.005);
}

TEST(TorqueConstantsCommand, SaysWhatIsMissing) {
  const test::TemporaryFolder folder;
  folder.write("plain.csv",
               "time,q1,tau1\n0,0,1\n0.01,0.1,1\n0.02,0.2,1\n0.03,0.3,1\n0.04,0.4,1\n0.05,0.5,1\n");
  const test::Outcome outcome = test::run_heft({"torque-constants", "--log", folder.path("plain.csv")});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("tauref1"));
}

TEST(TorqueConstantsCommand, WantsAllThatAKnownLoadNeedsAndNothingElse) {
  EXPECT_EQ(test::run_heft({"torque-constants", "--log", kDrive, "--load-mass", "2"}).exit_code, 2);
  const test::Outcome alone = test::run_heft({"torque-constants", "--log", kDrive, "--load-com", "0,0,0.1"});
  EXPECT_EQ(alone.exit_code, 2);
  EXPECT_THAT(alone.err, HasSubstr("--load-mass"));
}

TEST(TorqueConstantsCommand, RefusesConstantsThatLackAJoint) {
  const test::TemporaryFolder folder;
  folder.write("constants.json", R"({"joints": [{"value": 10.7}, {"value": null}]})");
  const test::Outcome outcome = test::run_heft(
      {"identify", "--urdf", "scara", "--log", kDrive, "--torque-constants", folder.path("constants.json")});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("joint 2"));
}

}  // namespace
}  // namespace heft
