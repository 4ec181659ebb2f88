/// Intervals of the parameters of effects, against the truth of logs whose noise is correlated in time.
#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "heft/core/effects/arm_effects.hpp"
#include "heft/core/effects/effects.hpp"
#include "heft/diagnose/diagnose.hpp"
#include "support/two_link_log.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;

/// Effect on a joint, and its true parameters by name.
struct Truth {
  JointEffect<double> effect;
  std::vector<std::pair<std::string, double>> parameters;
};

template <typename Effect>
Truth truth_of(int joint, const EffectParameters<double>& values) {
  Truth truth{{joint_effect_kind<Effect>(), joint, values}, {}};
  for (std::size_t k = 0; k < Effect::kParameters.size(); ++k)
    truth.parameters.emplace_back(std::string(Effect::kParameters[k].name), values[k]);
  return truth;
}

/// Noise that remembers itself for 50 ms, ten samples.
void add_correlated_noise(data::Log& log, unsigned seed) {
  constexpr double kKept = 0.905, kNew = 0.03;
  std::mt19937 random(seed);
  std::normal_distribution<double> step(0.0, kNew);
  for (Index j = 0; j < log.tau.cols(); ++j) {
    double now = step(random) / std::sqrt(1.0 - kKept * kKept);
    for (Index k = 0; k < log.tau.rows(); ++k) {
      log.tau(k, j) += now;
      now = kKept * now + step(random);
    }
  }
}

data::Log log_with(const Truth& truth, unsigned motion, unsigned noise) {
  model::Robot robot = test::two_link_with_friction();
  robot.effects.push_back(truth.effect);
  test::TwoLinkLog made = test::two_link_motion("intervals", motion);
  made.add_torque(robot);
  add_correlated_noise(made.log, noise);
  return made.log;
}

/// How often intervals hold the truth, and errors in parts of the half width.
struct Coverage {
  int held{0};
  std::vector<double> errors;
  int all() const { return static_cast<int>(errors.size()); }
};

/// Of one effect, each time in other motion and other noise.
Coverage coverage_of(const Truth& truth, unsigned repeats) {
  Coverage coverage;
  for (unsigned seed = 1; seed <= repeats; ++seed) {
    const Diagnosis d = diagnose(test::two_link_with_friction(), {log_with(truth, seed, 100 + seed)},
                                 {log_with(truth, 50 + seed, 200 + seed)});
    const auto found = std::find_if(d.findings.begin(), d.findings.end(), [&](const Finding& f) {
      return f.effect.joint_effect() == truth.effect.kind && f.joint == truth.effect.joint;
    });
    if (found == d.findings.end()) continue;
    EXPECT_EQ(found->half_widths.size(), found->parameters.size());
    for (std::size_t k = 0; k < found->half_widths.size(); ++k) {
      const auto& [name, value] = found->parameters[k];
      EXPECT_EQ(name, truth.parameters[k].first);
      EXPECT_TRUE(std::isfinite(found->half_widths[k])) << name;
      coverage.errors.push_back(std::abs(value - truth.parameters[k].second) / found->half_widths[k]);
      if (coverage.errors.back() <= 1.0) ++coverage.held;
    }
  }
  return coverage;
}

TEST(IntervalsOfEffects, HoldTheTruthAsOftenAsTheyClaim) {
  constexpr unsigned kRepeats = 15;
  Coverage sum;
  for (const Truth& truth : {truth_of<Stribeck>(0, {1.2, 0.15}), truth_of<Spring>(1, {3.0, 0.4}),
                             truth_of<Ripple>(0, {0.6, 8.0, 0.2})}) {
    const Coverage c = coverage_of(truth, kRepeats);
    sum.held += c.held;
    sum.errors.insert(sum.errors.end(), c.errors.begin(), c.errors.end());
    RecordProperty("held_" + std::to_string(truth.effect.kind), std::to_string(c.held) + " of " + std::to_string(c.all()));
  }
  ASSERT_GT(sum.all(), 90) << "or there is nothing to count";
  EXPECT_GE(sum.held, 0.90 * sum.all());
  // Of a normal distribution half of the errors are within 0.34 of the 95 % interval.
  std::sort(sum.errors.begin(), sum.errors.end());
  EXPECT_GT(sum.errors[sum.errors.size() / 2], 0.1) << "intervals are too wide";
}

}  // namespace
}  // namespace heft::diagnose
