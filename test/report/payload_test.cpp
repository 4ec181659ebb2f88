/// Loads and tracking comparisons in words, as JSON, as pages.
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "heft/host/numbers.hpp"
#include "heft/report/payload.hpp"
#include "heft/report/tracking.hpp"

namespace heft {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

payload::Payload payload_example() {
  payload::Payload load;
  load.robot = "ur10e";
  load.log = "carrying.csv";
  payload::PayloadRun& run = load.run;
  run.first_joint = 4;
  run.samples = 100;
  const auto estimated = [](double value, double std, bool known) -> payload::Estimated {
    return {statistics::Interval::around(value, std), known};
  };
  run.mass = estimated(2.8, 0.05, true);
  run.com = {estimated(0.01, 0.001, true), estimated(-0.02, 0.001, true), estimated(kNaN, kNaN, false)};
  run.inertia.assign(6, estimated(0.01, 0.1, false));
  run.changes = {{3.5, kNaN, 2.8, kNaN}};
  run.time = Eigen::VectorXd::LinSpaced(100, 0, 10);
  run.mass_history = Eigen::VectorXd::Constant(100, 2.8);
  run.mass_std_history = Eigen::VectorXd::Constant(100, 0.05);
  load.before.rmse = load.before.rmse_in_band = Eigen::Vector2d(2.0, 1.0);
  load.after = load.before;
  load.after->rmse = load.after->rmse_in_band = Eigen::Vector2d(1.0, 0.9);
  return load;
}

TEST(PayloadReport, JsonHasTheDocumentedFields) {
  const auto json = nlohmann::json::parse(report::json(payload_example()));
  EXPECT_EQ(json.at("mass").at("value"), 2.8);
  EXPECT_EQ(json.at("mass").at("std"), 0.05);
  EXPECT_EQ(json.at("mass").at("identifiable"), true);
  EXPECT_EQ(json.at("com").at("value").size(), 3U);
  EXPECT_TRUE(json.at("com").at("value").at(2).is_null()) << "an unknown number is null, not NaN";
  EXPECT_EQ(json.at("inertia").at("value").size(), 6U);
  EXPECT_EQ(json.at("rows"), 4);
  EXPECT_EQ(json.at("samples"), 100);
  EXPECT_TRUE(json.at("converged_at").is_null());
  EXPECT_EQ(json.at("changes").at(0).at("time"), 3.5);
  EXPECT_EQ(json.at("changes").at(0).at("mass"), 2.8);
}

TEST(PayloadReport, SeveralLoadsAreAList) {
  EXPECT_EQ(nlohmann::json::parse(report::json(payload::Weighing{{}, {payload_example(), payload_example()}}))
                .size(),
            2U);
}

TEST(PayloadReport, TextGivesTheIntervalAndWhatIsNotKnown) {
  EXPECT_THAT(report::full(payload_example()),
              AllOf(HasSubstr("2.800 kg ± 0.098 kg (95 %)"), HasSubstr("not identifiable"),
                    HasSubstr("Not converged"), HasSubstr("-50")));
  payload::Payload nothing = payload_example();
  nothing.run.mass.identifiable = false;
  EXPECT_THAT(report::full(nothing), AllOf(HasSubstr("cannot be determined"), Not(HasSubstr("2.8 kg ±"))));
}

TEST(PayloadReport, PageShowsMassAndTorqueError) {
  EXPECT_THAT(
      report::page(payload::Weighing{{}, {payload_example()}}).html(),
      AllOf(HasSubstr("Mass of the load"), HasSubstr("Torque error per joint"), HasSubstr("95 % interval")));
}

TEST(Tracking, TableAndJsonGiveRootMeanSquares) {
  track::Run run{"PD", Eigen::VectorXd::LinSpaced(4, 0, 1), Eigen::MatrixXd(4, 1), {}};
  run.error << 0.003, -0.003, 0.003, -0.003;
  EXPECT_THAT(report::tracking_table({run}).to_text(), AllOf(HasSubstr("PD"), HasSubstr("3.00")));
  const auto json = nlohmann::json::parse(report::json(std::vector<track::Run>{run}));
  EXPECT_NEAR(json.at(0).at("rms_error").at(0).get<double>(), 0.003, 1e-15);
  EXPECT_EQ(report::tracking_plots({run}).size(), 1U);
  EXPECT_EQ(report::tracking_bars({run}).categories.size(), 1U);
}

}  // namespace
}  // namespace heft
