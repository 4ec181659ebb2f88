/// Friction that follows the temperature of its joint, where the log has it.
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "heft/core/effects/arm_effects.hpp"
#include "heft/diagnose/diagnose.hpp"
#include "heft/validate/predict.hpp"
#include "support/two_link_log.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kCoulombSlope = -0.04, kViscousSlope = -0.02;  // [N·m/K], [N·m·s/(rad·K)]
constexpr double kAt = 25.0;                                    // where the friction is that of the arm [°C]

/// Both joints warm up from one temperature towards another; the friction of the first one follows by `part` of the
/// slopes above.
data::Log warming_log(unsigned seed, double from, double to, double part) {
  test::TwoLinkLog made = test::two_link_motion("warming", seed);
  made.add_torque(test::two_link_with_friction());
  data::Log& log = made.log;
  log.temperature.resize(log.time.size(), 2);
  for (Index k = 0; k < log.time.size(); ++k) {
    const double temperature = to + (from - to) * std::exp(-log.time[k] / 10.0);
    log.temperature.row(k) << temperature, 0.5 * temperature;
    const double qd = made.qd(k, 0);
    log.tau(k, 0) +=
        part * (kCoulombSlope * std::tanh(qd / 1e-3) + kViscousSlope * qd) * (temperature - kAt);
  }
  made.add_noise(seed + 100);
  return log;
}

Diagnosis diagnosed(data::Log train, data::Log validate) {
  return diagnose(test::two_link_with_friction(), {std::move(train)}, {std::move(validate)});
}

const Finding* temperature_of(const Diagnosis& d) {
  const auto found = std::find_if(d.findings.begin(), d.findings.end(),
                                  [](const Finding& f) { return f.effect.is<FrictionTemperature>(); });
  return found == d.findings.end() ? nullptr : &*found;
}

TEST(Temperature, ThatFrictionFollowsIsFoundWithItsSlopes) {
  const Diagnosis d = diagnosed(warming_log(1, 20.0, 45.0, 1.0), warming_log(2, 30.0, 50.0, 1.0));
  const Finding* found = temperature_of(d);
  ASSERT_NE(found, nullptr);
  EXPECT_EQ(found->joint, 0);
  EXPECT_EQ(d.findings.size(), 1U);
  ASSERT_EQ(found->parameters.size(), 3U);
  EXPECT_NEAR(found->parameters[0].second, kCoulombSlope, 0.1 * std::abs(kCoulombSlope));
  EXPECT_NEAR(found->parameters[1].second, kViscousSlope, 0.15 * std::abs(kViscousSlope));
  const double at = found->parameters[2].second;
  EXPECT_GT(at, 20.0);
  EXPECT_LT(at, 45.0);
  // The declared friction is that at this temperature.
  const JointActuation<double>& friction = d.after.joints[0].actuation;
  EXPECT_NEAR(friction.coulomb_friction, 2.0 + kCoulombSlope * (at - kAt), 0.06);
  EXPECT_NEAR(friction.viscous_friction, 1.0 + kViscousSlope * (at - kAt), 0.06);
  EXPECT_LT(found->validate_after, 0.6 * found->validate_before);
}

TEST(Temperature, OfTheWrittenModelHoldsBetweenThoseSeen) {
  const Diagnosis d = diagnosed(warming_log(1, 20.0, 45.0, 1.0), warming_log(2, 30.0, 50.0, 1.0));
  ASSERT_EQ(d.after.effects.size(), 1U);
  const JointEffect<double>& effect = d.after.effects[0];
  EXPECT_NEAR(effect.seen.temperature.low, 20.0, 1.5);
  EXPECT_NEAR(effect.seen.temperature.high, 50.0, 3.0);
  const auto friction_at = [&](const VectorXd& temperatures) {
    const Index rows = temperatures.size();
    MatrixXd still = MatrixXd::Zero(rows, 2), moving = still, at(rows, 2);
    moving.col(0).setConstant(0.5);
    at << temperatures, temperatures;
    return validate::Predictor(d.after, 0.0)
        .rows({VectorXd::LinSpaced(rows, 0.0, 1.0), still, moving, still, {}, {}, at})
        .col(0)
        .eval();
  };
  const VectorXd torque = friction_at((VectorXd(5) << 10.0, effect.seen.temperature.low, effect.parameters[2],
                                       std::nan(""), 90.0).finished());
  EXPECT_EQ(torque[0], torque[1]);  // colder than seen: as at the coldest
  EXPECT_EQ(torque[2], torque[3]);  // not known: that of the declared friction
  EXPECT_NEAR(torque[1] - torque[4], -(kCoulombSlope + 0.5 * kViscousSlope) * 30.0, 0.3);
}

TEST(Temperature, IsNotNamedWhereFrictionDoesNotFollowIt) {
  EXPECT_TRUE(diagnosed(warming_log(1, 20.0, 45.0, 0.0), warming_log(2, 30.0, 50.0, 0.0)).findings.empty());
}

TEST(Temperature, IsNotNamedWhereNobodyMeasuredIt) {
  data::Log train = warming_log(1, 20.0, 45.0, 1.0), validate = warming_log(2, 30.0, 50.0, 1.0);
  train.temperature.resize(0, 0);
  EXPECT_EQ(temperature_of(diagnosed(train, validate)), nullptr);
  // Nor where only the log to judge on lacks it.
  train = warming_log(1, 20.0, 45.0, 1.0);
  validate.temperature.resize(0, 0);
  EXPECT_EQ(temperature_of(diagnosed(train, validate)), nullptr);
}

}  // namespace
}  // namespace heft::diagnose
