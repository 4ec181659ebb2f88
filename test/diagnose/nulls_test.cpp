// Simulated arms that lack nothing, measured badly: a coarse encoder, a clock that jitters, noise that is correlated.
// None of it is friction, and friction with a memory is still found through it.
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "heft/diagnose/diagnose.hpp"
#include "support/arms.hpp"
#include "support/null_log.hpp"
#include "support/synthetic_log.hpp"

namespace heft::diagnose {
namespace {

using test::MeasurementFault;
using test::NullLogs;
using test::NullSpec;
using test::UndeclaredCase;

std::string found_in(const UndeclaredCase& c) {
  std::string found;
  for (const Finding& f : diagnose(c.robot, {c.train}, {c.validate}).findings)
    found += fmt::format(" {}: {} on joint {}", c.name, f.effect.id(), f.joint + 1);
  return found;
}

TEST(NullsMeasuredBadly, HaveNoEffectInFourLogs) {
  const NullLogs logs("scara4", 100);
  for (const NullSpec& spec : {NullSpec{MeasurementFault::kCoarseEncoder, 100.0, false},
                               NullSpec{MeasurementFault::kCoarseEncoder, 100.0, true},
                               NullSpec{MeasurementFault::kUnevenStamps, 50.0, true},
                               NullSpec{MeasurementFault::kUnevenSamples, 50.0, true}})
    EXPECT_EQ(found_in(logs.measured(spec)), "");
}

// Rotor inertia and offsets are in every model that is written. A search that has not named them yet may take a tilted base,
// a cable or a ripple for them.
TEST(NullsWithRotorsAndOffsets, HaveNoEffect) {
  model::Robot robot = test::three_joint_arm();
  for (model::RobotJoint& joint : robot.joints) joint.actuation = {0.3, 5.0, 4.0, 0.2};
  std::string found;
  for (unsigned seed = 1; seed <= 12; ++seed) {
    const data::Log train = test::synthetic_log(robot, seed, 0.01), validate = test::synthetic_log(robot, seed + 500, 0.01);
    for (const Finding& f : diagnose(robot, {train}, {validate}).findings)
      found += fmt::format(" seed {}: {} on joint {}", seed, f.effect.id(), f.joint + 1);
  }
  EXPECT_EQ(found, "");
}

/// Every fault, with and without velocities.
class NullsOfTheCampaign : public testing::TestWithParam<unsigned> {};

TEST_P(NullsOfTheCampaign, HaveNoEffect) {
  const NullLogs logs("scara4", GetParam());
  for (const MeasurementFault fault : test::kMeasurementFaults) {
    for (const double rate : {50.0, 100.0, 500.0}) {
      for (const bool velocities : {false, true})
        EXPECT_EQ(found_in(logs.measured({fault, rate, velocities})), "");
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Campaign, NullsOfTheCampaign, testing::Values(101U, 104U));

TEST(PreslidingMeasuredBadly, IsFoundWhereItsLengthIsManyStepsOfTheEncoder) {
  UndeclaredCase c = test::make_undeclared_case("hysteresis", "scara4", 1);
  const test::UndeclaredEffect& effect = c.effects.front();
  const double length = effect.parameters.at("x0"), step = 5e-4;
  ASSERT_GT(length, 10.0 * step);
  for (data::Log* log : {&c.train, &c.validate}) log->q = (log->q.array() / step).round() * step;
  const Diagnosis d = diagnose(c.robot, {c.train}, {c.validate});
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings[0].effect.id(), "hysteresis");
  EXPECT_EQ(d.findings[0].joint, effect.joint);
  EXPECT_NEAR(d.findings[0].parameters[0].second, length, 0.2 * length);
}

}  // namespace
}  // namespace heft::diagnose
