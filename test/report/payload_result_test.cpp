/// How payload and tracking results are shown: JSON fields of the contract, text, page.
#include <cmath>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "payload_result.hpp"

namespace heft::tools {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

report::PayloadResult example() {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  report::PayloadResult result;
  result.robot = "ur10e";
  result.log = "carrying.csv";
  result.rows = 4;
  result.samples = 100;
  result.mass = {Eigen::VectorXd::Constant(1, 2.8), Eigen::VectorXd::Constant(1, 0.05), {true}};
  result.com = {Eigen::Vector3d(0.01, -0.02, nan), Eigen::Vector3d(0.001, 0.001, nan), {true, true, false}};
  result.inertia = {Eigen::VectorXd::Constant(6, 0.01), Eigen::VectorXd::Constant(6, 0.1),
                    std::vector<bool>(6, false)};
  result.changes = {{3.5, 2.8}};
  result.rmse_before = Eigen::Vector2d(2.0, 1.0);
  result.rmse_after = Eigen::Vector2d(1.0, 0.9);
  result.time = Eigen::VectorXd::LinSpaced(100, 0, 10);
  result.mass_history = Eigen::VectorXd::Constant(100, 2.8);
  result.mass_std_history = Eigen::VectorXd::Constant(100, 0.05);
  return result;
}

TEST(PayloadResult, JsonHasTheFieldsOfTheContract) {
  const auto json = report::to_json(example());
  EXPECT_EQ(json.at("mass").at("value"), 2.8);
  EXPECT_EQ(json.at("mass").at("std"), 0.05);
  EXPECT_EQ(json.at("mass").at("identifiable"), true);
  EXPECT_EQ(json.at("com").at("value").size(), 3U);
  EXPECT_TRUE(json.at("com").at("value").at(2).is_null()) << "a number nobody knows is null, not NaN";
  EXPECT_EQ(json.at("inertia").at("value").size(), 6U);
  EXPECT_EQ(json.at("rows"), 4);
  EXPECT_EQ(json.at("samples"), 100);
  EXPECT_TRUE(json.at("converged_at").is_null());
  EXPECT_EQ(json.at("changes").at(0).at("time"), 3.5);
  EXPECT_EQ(json.at("changes").at(0).at("mass"), 2.8);
}

TEST(PayloadResult, TextGivesTheIntervalAndWhatIsNotKnown) {
  EXPECT_THAT(report::to_text(example()),
              AllOf(HasSubstr("2.800 kg ± 0.098 kg (95 %)"), HasSubstr("not identifiable"),
                    HasSubstr("Not converged"), HasSubstr("-50")));
  report::PayloadResult nothing = example();
  nothing.mass.identifiable = {false};
  EXPECT_THAT(report::to_text(nothing), AllOf(HasSubstr("cannot be determined"), Not(HasSubstr("2.8 kg ±"))));
}

TEST(PayloadResult, PageShowsMassAndTorqueError) {
  page::Page page("Load");
  report::add_to(page, example());
  EXPECT_THAT(page.html(), AllOf(HasSubstr("Mass of the load"), HasSubstr("Torque error per joint"),
                                 HasSubstr("95 % interval")));
}

TEST(Tracking, TableAndJsonGiveRootMeanSquares) {
  report::TrackingRun run{"PD", Eigen::VectorXd::LinSpaced(4, 0, 1), Eigen::MatrixXd(4, 1), {}};
  run.error << 0.003, -0.003, 0.003, -0.003;
  EXPECT_THAT(report::tracking_table({run}).to_text(), AllOf(HasSubstr("PD"), HasSubstr("3.00")));
  EXPECT_NEAR(report::tracking_json({run}).at(0).at("rms_error").at(0).get<double>(), 0.003, 1e-15);
  EXPECT_EQ(report::tracking_plots({run}).size(), 1U);
  EXPECT_EQ(report::tracking_bars({run}).categories.size(), 1U);
}

}  // namespace
}  // namespace heft::tools
