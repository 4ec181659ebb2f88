/// The simulated campaign: five criteria against a known truth.
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

TEST(Campaign, MeetsTheFiveCriteria) {
  const test::TemporaryFolder folder;
  const std::string json = folder.path("out.json"), page = folder.path("page.html");
  const test::Outcome campaign =
      test::run_heft({"validate", "--campaign", "--urdf", "ur10e", "--seed", "1", "--json", json, "--report",
                      page, "-o", folder.path("files")});
  ASSERT_EQ(campaign.exit_code, 0) << campaign.err;
  const nlohmann::json result = nlohmann::json::parse(host::read_file(json, "result"));
  ASSERT_EQ(result["criteria"].size(), 5U);
  for (const auto& criterion : result["criteria"]) EXPECT_EQ(criterion["verdict"], "met") << criterion;
  EXPECT_EQ(result["seed"], 1);
  EXPECT_EQ(result["payloads"], (std::vector<double>{0, 2, 5, 10}));
  EXPECT_EQ(result["position_noise_std"], 0.001);
  EXPECT_EQ(result["torque_noise_std"], 0.5);
  int counted = 0;
  for (const auto& parameter : result["base_parameters"]) counted += parameter["counted"].get<bool>() ? 1 : 0;
  EXPECT_GT(counted, 25);
  EXPECT_THAT(host::read_file(page, "page"), HasSubstr("</html>"));

  // Its files are complete: the model from one log meets another, to the same figures.
  const std::string again = folder.path("again.json");
  const test::Outcome repeated =
      test::run_heft({"validate", "--model", folder.path("files/identified.json"), "--log",
                      folder.path("files/judged-0kg.csv"), "--json", again});
  ASSERT_EQ(repeated.exit_code, 0) << repeated.err;
  const nlohmann::json judged = nlohmann::json::parse(host::read_file(again, "result"));
  for (std::size_t j = 0; j < 6; ++j) {
    const double expected = result["rmse"][j];
    EXPECT_NEAR(judged["rmse"][j].get<double>(), expected, 1e-9 * expected);
  }
}

}  // namespace
}  // namespace heft
