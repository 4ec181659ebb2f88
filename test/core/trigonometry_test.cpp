#include "heft/core/trigonometry.hpp"

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace heft {
namespace {

TEST(SinCos, IsWithinTwoUlpOfOneOfTheLongDoubleValueInDouble) {
  std::mt19937_64 random(11);
  double worst = 0;
  for (const double size : {1.0, 10.0, 1e3, 1e5}) {
    std::uniform_real_distribution<double> uniform(-size, size);
    for (int n = 0; n < 200000; ++n) {
      const double angle = uniform(random);
      SinCos<double> sc{};
      sin_cos(&angle, &sc, 1);
      const long double exact = static_cast<long double>(angle);
      worst =
          std::max(worst, static_cast<double>(std::abs(static_cast<long double>(sc.sin) - std::sin(exact))));
      worst =
          std::max(worst, static_cast<double>(std::abs(static_cast<long double>(sc.cos) - std::cos(exact))));
    }
  }
  EXPECT_LT(worst, 2.3e-16);
}

TEST(SinCos, IsWithinTwoUlpOfOneInFloat) {
  std::mt19937_64 random(12);
  std::uniform_real_distribution<float> uniform(-20.0F, 20.0F);
  double worst = 0;
  for (int n = 0; n < 500000; ++n) {
    const float angle = uniform(random);
    SinCos<float> sc{};
    sin_cos(&angle, &sc, 1);
    worst = std::max(worst, std::abs(static_cast<double>(sc.sin) - std::sin(static_cast<double>(angle))));
    worst = std::max(worst, std::abs(static_cast<double>(sc.cos) - std::cos(static_cast<double>(angle))));
  }
  EXPECT_LT(worst, 1.3e-7);
}

TEST(SinCos, HitsTheQuarterTurns) {
  const double half_pi = 1.5707963267948966;
  for (int quarter = -40; quarter <= 40; ++quarter) {
    const double angle = quarter * half_pi;
    SinCos<double> sc{};
    sin_cos(&angle, &sc, 1);
    EXPECT_NEAR(sc.sin, std::sin(angle), 1.2e-16) << quarter;
    EXPECT_NEAR(sc.cos, std::cos(angle), 1.2e-16) << quarter;
  }
}

TEST(SinCos, AnswersNanForAnglesThatAreNotFiniteOrTooLarge) {
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity(),
                           -std::numeric_limits<double>::infinity(), 1.01e6, -1e300}) {
    // Among good ones, as the vectorised loop sees it.
    const std::vector<double> angles = {0.1, bad, 0.2, bad};
    std::vector<SinCos<double>> sc(4);
    sin_cos(angles.data(), sc.data(), 4);
    EXPECT_TRUE(std::isnan(sc[1].sin)) << bad;
    EXPECT_TRUE(std::isnan(sc[1].cos)) << bad;
    EXPECT_TRUE(std::isnan(sc[3].sin)) << bad;
    EXPECT_NEAR(sc[0].sin, std::sin(0.1), 1e-16);
    EXPECT_NEAR(sc[2].cos, std::cos(0.2), 1.2e-16);
  }
  const float bad = 2e4F;
  SinCos<float> sc{};
  sin_cos(&bad, &sc, 1);
  EXPECT_TRUE(std::isnan(sc.sin) && std::isnan(sc.cos));
}

}  // namespace
}  // namespace heft
