/// Ten seeds of every robot in urdf/, and the condition number of the UR10e: long.
#include <string>

#include <gtest/gtest.h>

#include "safety_check.hpp"

namespace heft::excite {
namespace {

class EverySeed : public ::testing::TestWithParam<std::tuple<std::string, int>> {};

TEST_P(EverySeed, MovesSafelyInSimulation) {
  design_and_look(std::get<0>(GetParam()), static_cast<std::uint64_t>(std::get<1>(GetParam())));
}

INSTANTIATE_TEST_SUITE_P(Seeds, EverySeed,
                         ::testing::Combine(::testing::Values<std::string>("kawasaki6r", "panda", "scara", "ur10e", "ur5",
                                                              "ur5e"),
                                            ::testing::Range(1, 11)));

class Ur10eSeed : public ::testing::TestWithParam<int> {};

TEST_P(Ur10eSeed, ConditionNumberIsAtMostTen) {
  const model::Robot robot = urdf::load_urdf(path_of("ur10e"));
  Options options;
  options.search.seed = static_cast<std::uint64_t>(GetParam());
  options.search.starts = 4;
  const ExcitingMotion motion = design(robot, safe_limits(robot, path_of("ur10e")), options);
  EXPECT_EQ(motion.design->num_parameters(), 48);
  EXPECT_LE(motion.excitation.score.condition, 10.0);
  RecordProperty("condition", std::to_string(motion.excitation.score.condition));
}

INSTANTIATE_TEST_SUITE_P(Seeds, Ur10eSeed, ::testing::Range(1, 11));

}  // namespace
}  // namespace heft::excite
