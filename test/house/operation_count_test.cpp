// The counted cost of one estimator sample stays within what is promised. Counts are exact, so they can be asserted.
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <gtest/gtest.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

namespace {

const nlohmann::json& counts() {
  static const nlohmann::json document = [] {
    const auto path =
        std::filesystem::temp_directory_path() / ("heft_operation_count_" + std::to_string(getpid()));
    const std::string command = "\"" HEFT_OPERATION_COUNT "\" --json \"" + path.string() + "\" > /dev/null";
    EXPECT_EQ(std::system(command.c_str()), 0);
    std::ifstream in(path);
    nlohmann::json parsed = nlohmann::json::parse(in);
    std::filesystem::remove(path);
    return parsed;
  }();
  return document;
}

nlohmann::json form(const std::string& name, bool shared) {
  for (const auto& f : counts().at("forms")) {
    if (f.at("form") == name && f.at("shared_forward_pass") == shared &&
        f.at("method") == "instrumental variables") {
      return f;
    }
  }
  return {};
}

void expect_mean(const nlohmann::json& f, double mul, double add) {
  ASSERT_FALSE(f.is_null());
  EXPECT_LE(f.at("mean").at("mul").get<double>(), mul);
  EXPECT_LE(f.at("mean").at("add").get<double>(), add);
}

TEST(OperationCount, IsForEighteenParametersAndRowsFiveAndSix) {
  EXPECT_EQ(counts().at("k"), 5);
  EXPECT_EQ(counts().at("parameters"), 18);
  EXPECT_EQ(counts().at("publication").at("mul"), 1800);
}

TEST(OperationCount, InformationFormWithItsSolves) {
  const auto f = form("information", false);
  expect_mean(f, 540, 550);
  EXPECT_LE(f.at("worst_sample").at("mul").get<double>(), 900);
  EXPECT_LE(f.at("worst_sample").at("add").get<double>(), 900);
  EXPECT_EQ(f.at("solve_every"), 50);
}

TEST(OperationCount, InformationFormAlongWithComputedTorque) {
  expect_mean(form("information", true), 440, 490);
}

TEST(OperationCount, ContactMonitorInItsWorstSample) {
  const auto& monitor = counts().at("contact_monitor");
  EXPECT_GT(monitor.at("mul").get<double>(), 500);  // the load of a contact was looked into
  EXPECT_LE(monitor.at("mul").get<double>(), 1800);
  EXPECT_LE(monitor.at("add").get<double>(), 1600);
}

TEST(OperationCount, ExactEverySample) { expect_mean(form("factored", false), 1250, 1250); }

TEST(OperationCount, IsWhatTheReadmeSaysToOneDecimal) {
  std::ifstream in(HEFT_SOURCE_DIR "/README.md");
  const std::string readme((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  const auto figures = [](const nlohmann::json& f, const char* format) {
    char text[100];
    std::snprintf(text, sizeof text, format, f.at("mean").at("mul").get<double>(),
                  f.at("mean").at("add").get<double>());
    return std::string(text);
  };
  for (const std::string& text :
       {figures(form("information", false), "%.1f multiplications, %.1f additions (1984"),
        figures(form("information", true), "; %.1f, %.1f in addition to computed torque"),
        figures(form("factored", false),
                "exact after every sample | %.1f multiplications, %.1f additions |")}) {
    EXPECT_NE(readme.find(text), std::string::npos) << "README.md does not say: " << text;
  }
}

TEST(OperationCount, AControllerThatFeelsItsLoad) {
  const auto& cycle = counts().at("terminal_link_controller");
  EXPECT_TRUE(cycle.at("same_numbers_as_double").get<bool>());
  EXPECT_LE(cycle.at("mean").at("mul").get<double>(), 1500);
}

TEST(OperationCount, ALoopThatFollowsItsLoad) {
  const auto& loop = counts().at("control_sample");
  EXPECT_TRUE(loop.at("same_numbers_as_double").get<bool>());
  EXPECT_LE(loop.at("mean").at("mul").get<double>(), 900);
  EXPECT_LE(loop.at("worst_sample").at("mul").get<double>(), 1200);
  EXPECT_GT(loop.at("stages").at("load_observer").at("mul").get<double>(), 300);
}

TEST(OperationCount, AContactMonitorOnTheTorqueThatTheObserverExplains) {
  const auto& watched = counts().at("watched_sample");
  const auto& without = counts().at("control_sample");
  EXPECT_TRUE(watched.at("same_numbers_as_double").get<bool>());
  EXPECT_GT(watched.at("stages").at("contact_monitor").at("mul").get<double>(), 50);
  const double more = watched.at("mean").at("mul").get<double>() - without.at("mean").at("mul").get<double>();
  EXPECT_LE(more, 620);  // this arm has no effects, whose torques would share the pass
  EXPECT_LE(watched.at("worst_sample").at("mul").get<double>(), 1750);
}

TEST(OperationCount, AnAdaptiveController) {
  const auto& cycle = counts().at("adaptive_controller");
  EXPECT_TRUE(cycle.at("same_numbers_as_double").get<bool>());
  EXPECT_LE(cycle.at("mean").at("mul").get<double>(), 4500);
}

// Beside the terminal link's 509: what it costs to follow friction, or the whole arm.
TEST(OperationCount, EstimatorsOfFrictionAndOfTheArm) {
  for (const auto& [name, most] : {std::pair{"directional_least_squares", 6000.0},
                                   {"arm_estimating_controller", 35000.0},
                                   {"extended_kalman_filter", 26000.0},
                                   {"unscented_kalman_filter", 150000.0}}) {
    const auto& sample = counts().at(name);
    EXPECT_TRUE(sample.at("same_numbers_as_double").get<bool>()) << name;
    EXPECT_LE(sample.at("mean").at("mul").get<double>(), most) << name;
  }
}

TEST(OperationCount, WhatIsCountedIsWhatRuns) {
  for (const auto& per_k : counts().at("all_k")) {
    for (const auto& f : per_k.at("forms")) {
      EXPECT_TRUE(f.at("same_numbers_as_double").get<bool>()) << per_k.at("k") << " " << f.at("form");
    }
  }
}

TEST(OperationCount, CheaperFormsGiveTheBatchEstimate) {
  for (const auto& f : counts().at("forms")) {
    EXPECT_LT(f.at("difference_to_batch").get<double>(), 1e-8) << f.at("form");
  }
}

}  // namespace
