// Scenarios that no arm could follow: heft simulate ends soon, with the exit code and the words that help.
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/run_heft.hpp"
#include "support/temporary_folder.hpp"

namespace heft {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

test::Outcome simulate(const test::TemporaryFolder& folder, const std::string& keys) {
  std::ofstream(folder.path("s.json"))
      << R"({"robot": "scara", "duration": 0.2, "torque_limit": "none", "friction": "none", )" << keys << "}";
  return test::run_heft({"simulate", "--scenario", folder.path("s.json"), "-o", folder.path("s.csv")});
}

TEST(SimulateLimits, OutOfScaleIsBadInput) {
  const test::TemporaryFolder folder;
  const std::string rest = R"("initial": {"position": [0, 0, 0, 0]}, )";
  const struct {
    std::string keys, says;
  } cases[] = {
      {R"("initial": {"position": [1e300, 0, 0, 0]})", "initial_position, entry 1: found 1e+300"},
      {R"("initial": {"position": [0, 0, 0, 0], "velocity": [0, 1e10, 0, 0]})", "initial_velocity, entry 2"},
      {rest + R"("gravity": [0, 0, -1e300])", "gravity, entry 3"},
      {rest + R"("solver": {"max_step": 1e-300})", "solver.max_step"},
      {rest + R"("solver": {"max_steps_per_second": 0})", "/solver/max_steps_per_second"},
      {rest + R"("sample_rate": 3e8)", "at most 2 GB"}};
  for (const auto& bad : cases) {
    const test::Outcome outcome = simulate(folder, bad.keys);
    EXPECT_EQ(outcome.exit_code, 3) << bad.keys << outcome.err;
    EXPECT_THAT(outcome.err, AllOf(HasSubstr(bad.says), HasSubstr("expected"))) << bad.keys;
    EXPECT_FALSE(std::ifstream(folder.path("s.csv")).good()) << bad.keys;
  }
}

TEST(SimulateLimits, AMotionWithoutBoundIsNoAnswer) {
  const test::TemporaryFolder folder;
  const std::string pd =
      R"("reference": {"kind": "hold", "position": [0.5, 0, 0, 0]}, "initial": {"position": [0, 0, 0, 0]}, )";
  for (const std::string& keys :
       {pd + R"("controller": {"kind": "pd", "kp": 1e200, "kd": 0})",
        pd + R"("controller": {"kind": "pd", "kp": 1e12, "kd": 0})",
        std::string(R"("initial": {"position": [0, 0, 0, 0]}, "torque": {"offset": [1e300, 0, 0, 0]})")}) {
    const test::Outcome outcome = simulate(folder, keys);
    EXPECT_EQ(outcome.exit_code, 4) << keys << outcome.err;
    EXPECT_THAT(outcome.err, AllOf(HasSubstr("simulation: joint "), HasSubstr(" at t = "),
                                   HasSubstr("expected"), HasSubstr("check")))
        << keys;
    EXPECT_FALSE(std::ifstream(folder.path("s.csv")).good()) << keys;
  }
}

}  // namespace
}  // namespace heft
