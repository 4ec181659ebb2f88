/// Intervals hold as often as they claim: many experiments with residuals correlated in time.
#include <cmath>
#include <cstdint>

#include <gtest/gtest.h>

#include "payload/payload_run.hpp"
#include "payload/recursive_fit.hpp"
#include "support/arms.hpp"
#include "support/synthetic_log.hpp"

namespace heft::payload {
namespace {

const InertialParameters<double> kLoad =
    test::body(1.5, {0.04, 0.11, -0.05}, {0.01, 0.001, 0.008, -0.002, 0.0005, 0.012});

struct Count {
  int inside{0};
  int all{0};
  void take(const std::vector<Estimated>& estimated, const InertialParameters<double>& truth,
            std::size_t first) {
    for (std::size_t i = 0; i < estimated.size(); ++i) {
      if (!estimated[i].identifiable) continue;
      ++all;
      inside += estimated[i].contains(truth[first + i]) ? 1 : 0;
    }
  }
  double share() const { return static_cast<double>(inside) / all; }
};

TEST(PayloadCoverage, IntervalsHoldNinetyFiveTimesInAHundred) {
  const model::Robot arm = test::six_joint_arm();
  const model::Robot loaded = test::carrying(arm, kLoad);
  // The flange of this arm lies 82.3 mm out along y.
  auto at_flange = kLoad;
  at_flange[kMcy] -= 0.0823 * kLoad[kMass];
  constexpr int kExperiments = 400;
  for (const double correlation : {0.05, 0.2, 0.4}) {
    test::SyntheticSettings settings;
    settings.duration = 40;
    settings.noise = 0.06;
    settings.correlation = correlation;
    PayloadRunOptions options;
    options.residual = fit_recursively(arm, {test::synthetic_log(arm, settings)}).residual;
    Count mass, rest;
    for (std::uint32_t seed = 1; seed <= kExperiments; ++seed) {
      settings.noise_seed = 1000 + seed;
      settings.motion_seed = seed;
      const PayloadRun run = run_payload(arm, test::synthetic_log(loaded, settings), options);
      EXPECT_TRUE(run.changes.empty()) << "seed " << seed;
      mass.take({run.mass}, kLoad, 0);
      rest.take(run.first_moment, at_flange, 1);
    }
    EXPECT_EQ(mass.all, kExperiments) << "correlation " << correlation;
    EXPECT_GE(mass.share(), 0.93) << "correlation " << correlation;
    EXPECT_LE(mass.share(), 0.97) << "correlation " << correlation;
    EXPECT_GE(rest.share(), 0.93) << "correlation " << correlation;
    EXPECT_LE(rest.share(), 0.97) << "correlation " << correlation;
    std::printf("correlation %.2f s: mass %.3f, first moments %.3f\n", correlation, mass.share(),
                rest.share());
  }
}

TEST(PayloadCoverage, IntervalsHoldWithAModelFittedToOneLog) {
  const model::Robot arm = test::six_joint_arm();
  const model::Robot loaded = test::carrying(arm, kLoad);
  test::SyntheticSettings settings;
  settings.duration = 40;
  settings.noise = 0.03;
  settings.correlation = 0.1;
  Count mass;
  for (std::uint32_t seed = 1; seed <= 200; ++seed) {
    settings.noise_seed = settings.motion_seed = seed;
    const RecursiveFit fit = fit_recursively(arm, {test::synthetic_log(arm, settings)});
    model::Robot fitted = arm;
    model::apply(fit.model, fitted);
    PayloadRunOptions options;
    options.residual = fit.residual;
    options.model_covariance = fit.model.covariance;
    settings.noise_seed = settings.motion_seed = 5000 + seed;
    mass.take({run_payload(fitted, test::synthetic_log(loaded, settings), options).mass}, kLoad, 0);
  }
  std::printf("with a fitted model: mass %.3f\n", mass.share());
  EXPECT_EQ(mass.all, 200);
  EXPECT_GE(mass.share(), 0.93);
  // Few blocks for many parameters: the covariance of the model errs on the wide side.
  EXPECT_LE(mass.share(), 0.99);
}

}  // namespace
}  // namespace heft::payload
