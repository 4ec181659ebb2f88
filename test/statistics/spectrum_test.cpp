#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "heft/statistics/binned_means.hpp"
#include "heft/statistics/spectrum.hpp"

namespace heft::statistics {
namespace {

Eigen::VectorXd white_noise(Eigen::Index samples, double mean) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal(mean, 1.0);
  return Eigen::VectorXd::NullaryExpr(samples, [&](Eigen::Index) { return normal(random); });
}

TEST(Spectrum, OfASignalLessItsMeanIsPowerAboutMean) {
  const Eigen::VectorXd x = white_noise(1000, 5.0);
  Spectrum raw(128), centred(128);
  for (const double value : x) {
    raw.add(value);
    centred.add(value - x.mean());
  }
  EXPECT_GT(raw.segments(), 10);
  EXPECT_GT(raw.power()[0], 100.0 * centred.power()[0]);
  EXPECT_LT((raw.power_about_mean() - centred.power()).cwiseAbs().maxCoeff(),
            1e-9 * centred.power().maxCoeff());
}

TEST(Spectrum, OfWhiteNoiseIsItsVarianceTimesTheWindowsEnergy) {
  Spectrum spectrum(64);
  for (const double value : white_noise(100000, 0.0)) spectrum.add(value);
  const double expected = spectrum.window_energy();
  EXPECT_NEAR(spectrum.power().segment(2, 28).mean(), expected, 0.02 * expected);
  const Eigen::VectorXd rho = spectrum.autocorrelation(spectrum.power());
  EXPECT_DOUBLE_EQ(rho[0], 1.0);
  EXPECT_LT(rho.tail(rho.size() - 1).cwiseAbs().maxCoeff(), 0.03);
}

TEST(Spectrum, SegmentsDoNotReachAcrossABreak) {
  Spectrum spectrum(64);
  for (int piece = 0; piece < 4; ++piece) {
    for (int k = 0; k < 63; ++k) spectrum.add(1.0);
    spectrum.interrupt();
  }
  EXPECT_EQ(spectrum.segments(), 0);
}

TEST(Periodogram, PadsAShorterSignalWithZerosAfterALongerOne) {
  const Eigen::VectorXd x = white_noise(64, 1.0);
  Periodogram fresh(64), used(64);
  used.of(x, 0.0);
  const auto expected = fresh.of(x.head(20), 1.0);
  const auto& found = used.of(x.head(20), 1.0);
  ASSERT_EQ(found.size(), 33U);
  for (std::size_t k = 0; k < found.size(); ++k) EXPECT_EQ(found[k], expected[k]);
}

TEST(AmplitudeDensity, MeetsTheClosedForms) {
  // White noise of variance s² has s √(2 / rate); a sine of amplitude A has the power A²/2 under its peak.
  constexpr double kRate = 250.0, kSigma = 0.3;
  std::mt19937 random(3);
  std::normal_distribution<double> normal(0.0, kSigma);
  Eigen::VectorXd noise(20000), sine(20000);
  for (Eigen::Index i = 0; i < noise.size(); ++i) {
    noise[i] = 5.0 + normal(random);
    sine[i] = 2.0 * std::sin(2.0 * std::numbers::pi * 11.0 * static_cast<double>(i) / kRate);
  }
  const AmplitudeDensity white = amplitude_density(noise, kRate);
  EXPECT_NEAR(std::sqrt(white.density.cwiseAbs2().mean()), kSigma * std::sqrt(2.0 / kRate),
              0.1 * kSigma * 0.09);
  const AmplitudeDensity line = amplitude_density(sine, kRate);
  Eigen::Index peak = 0;
  line.density.maxCoeff(&peak);
  EXPECT_NEAR(line.frequency[peak], 11.0, 0.2);
  double power = 0.0;
  for (Eigen::Index k = 1; k + 1 < line.frequency.size(); ++k) {
    power += line.density[k] * line.density[k] * 0.5 * (line.frequency[k + 1] - line.frequency[k - 1]);
  }
  EXPECT_NEAR(power, 2.0, 0.1);
  EXPECT_EQ(amplitude_density(noise.head(20), kRate).frequency.size(), 0);
}

TEST(BinnedMeans, AverageWhatFallsTogether) {
  const Eigen::VectorXd x = Eigen::VectorXd::LinSpaced(4801, -1.0, 1.0);
  Eigen::MatrixXd values(x.size(), 2);
  values.col(0) = 3.0 * x;
  values.col(1).setConstant(2.0);
  const BinnedMeans bins = binned_means(x, values);
  ASSERT_GT(bins.x.size(), 100);
  EXPECT_LT((bins.means.col(0) - 3.0 * bins.x).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LT((bins.means.col(1).array() - 2.0).abs().maxCoeff(), 1e-12);
  EXPECT_EQ(binned_means(Eigen::VectorXd::Constant(10, 1.0), Eigen::MatrixXd::Ones(10, 1)).x.size(), 0);
}

}  // namespace
}  // namespace heft::statistics
