// An effect that the model lacks is no contradiction: simulated arms with springs, elastic joints, ripple, payloads and
// the rest are not suspected of a wrong sign, unit or order.
#include <algorithm>
#include <cctype>
#include <string>
#include <tuple>

#include <gtest/gtest.h>

#include "heft/plausibility/plausibility.hpp"
#include "support/undeclared_case.hpp"

namespace heft::plausibility {
namespace {

class Undeclared : public testing::TestWithParam<std::tuple<std::string, std::string>> {};

TEST_P(Undeclared, EffectsAreNoContradictions) {
  const auto& [kind, arm] = GetParam();
  if (kind == "wrist_coupling" && arm == "scara4") GTEST_SKIP() << "needs a wrist: joints 5 and 6";
  const test::UndeclaredCase c = test::make_undeclared_case(kind, arm, 3);
  for (const data::Log* log : {&c.train, &c.validate}) {
    for (const Finding& f : check_torque(c.robot, *log).findings)
      ADD_FAILURE() << c.name << ": " << f.message;
  }
}

/// Weight on upright axes shows as it would on a wall, but a base off level by some degrees says as much.
TEST(TiltedBase, OfAScaraIsNotTakenForAWall) {
  const test::UndeclaredCase c = test::make_undeclared_case("base_tilt", "scara4", 702);
  for (const data::Log* log : {&c.train, &c.validate}) {
    for (const Finding& f : check_torque(c.robot, *log).findings) ADD_FAILURE() << f.message;
  }
}

const auto kName = [](const auto& p) {
  std::string name = std::get<0>(p.param) + "_on_" + std::get<1>(p.param);
  std::replace_if(
      name.begin(), name.end(), [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0; }, '_');
  return name;
};

INSTANTIATE_TEST_SUITE_P(Known, Undeclared,
                         testing::Combine(testing::ValuesIn(test::undeclared_kinds()),
                                          testing::ValuesIn(test::undeclared_arms())),
                         kName);
INSTANTIATE_TEST_SUITE_P(Outside, Undeclared,
                         testing::Combine(testing::ValuesIn(test::outside_kinds()),
                                          testing::ValuesIn(test::undeclared_arms())),
                         kName);

}  // namespace
}  // namespace heft::plausibility
