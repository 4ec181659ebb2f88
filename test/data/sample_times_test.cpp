// When samples were taken, where time stamps scatter: told from the positions alone.
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "sample_times.hpp"

namespace heft::data {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kPeriod = 0.002;  // [s]

/// Two joints in smooth motion, encoders of 20 µrad, sampled at one time and stamped with another; every hundredth row is
/// lost.
struct Recording {
  Log log;
  VectorXd taken;  ///< [s]
};

using Times = std::function<double(double even, double jitter)>;

Recording record(const Times& taken_at, const Times& stamped_at, double amplitude = 0.8, Index samples = 6000) {
  constexpr double kStep = 2e-5;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-0.2 * kPeriod, 0.2 * kPeriod);
  std::vector<double> taken, stamps;
  for (Index k = 0; k < samples; ++k) {
    const double even = kPeriod * static_cast<double>(k), jitter = uniform(random);
    if (k % 100 == 37) continue;
    taken.push_back(taken_at(even, jitter));
    stamps.push_back(stamped_at(even, jitter));
  }
  Recording r;
  r.taken = Eigen::Map<const VectorXd>(taken.data(), static_cast<Index>(taken.size()));
  r.log.path = "a.csv";
  r.log.time = Eigen::Map<const VectorXd>(stamps.data(), static_cast<Index>(stamps.size()));
  r.log.q.resize(r.taken.size(), 2);
  for (Index k = 0; k < r.taken.size(); ++k) {
    for (int j = 0; j < 2; ++j) {
      const double q = amplitude * std::sin(2.0 * std::numbers::pi * (0.4 + 0.3 * j) * r.taken[k]);
      r.log.q(k, j) = std::round(q / kStep) * kStep;
    }
  }
  return r;
}

const Times kEven = [](double even, double) { return even; };
const Times kJitters = [](double even, double jitter) { return even + jitter; };

double root_mean_square(const VectorXd& x) {
  return std::sqrt(x.squaredNorm() / static_cast<double>(x.size()));
}

TEST(SampleTimes, AreTheStampsOfAnEvenClock) {
  Log log;
  log.time = VectorXd::LinSpaced(100, 0.0, 0.198);
  log.q = VectorXd::LinSpaced(100, 0.0, 1.0);
  const SampleTimes times = sample_times(log);
  EXPECT_EQ(times.time, log.time);
  EXPECT_FALSE(times.known());
  EXPECT_EQ(times.scatter, 0.0);
}

TEST(SampleTimes, AreThoseOfTheEvenClockThatThePositionsFollow) {
  const Recording r = record(kEven, kJitters);
  const SampleTimes times = sample_times(r.log);
  EXPECT_NEAR(times.scatter, 0.4 / std::sqrt(12.0), 0.01) << "uniform, 40 % of a period wide";
  EXPECT_NEAR(times.followed, 0.0, 0.03);
  EXPECT_LT(times.std, 0.02);
  EXPECT_LT(root_mean_square(times.time - r.taken), 0.15 * root_mean_square(r.log.time - r.taken));
  EXPECT_NE(times.note("a.csv").find("placed accordingly"), std::string::npos);
}

TEST(SampleTimes, AreTheStampsThatThePositionsFollow) {
  const Recording r = record(kJitters, kJitters);
  const SampleTimes times = sample_times(r.log);
  EXPECT_NEAR(times.followed, 1.0, 0.03);
  EXPECT_EQ(times.time, r.log.time);
  EXPECT_TRUE(times.note("a.csv").empty());
}

TEST(SampleTimes, SeeThroughStampsOfFewDigits) {
  // 2.3 ms between samples, stamps in whole milliseconds: 2, 2, 3, 2, 2, 3, ... of which none is a period.
  const Recording r = record([](double even, double) { return 1.15 * even; },
                             [](double even, double) { return std::round(1e3 * 1.15 * even) * 1e-3; });
  const SampleTimes times = sample_times(r.log);
  EXPECT_NEAR(times.followed, 0.0, 0.05);
  EXPECT_LT(root_mean_square(times.time - r.taken), 0.2 * root_mean_square(r.log.time - r.taken));
}

// As a user's program stamps what it receives: each sample a little late, and now and then the program was interrupted. A stamp late by
// more than half a period counted as a lost row, and nothing took the row back again: the clock ran ahead.
Recording stamped_late(Index samples = 6000) {
  std::mt19937 random(9);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  double last = -1.0;
  const Times stamps = [&](double even, double) {
    double late = 0.25 * std::abs(normal(random));
    if (uniform(random) < 1.0 / 300.0) late = 1.0 + 3.0 * uniform(random);
    return last = std::max(even + kPeriod * late, last + 0.02 * kPeriod);
  };
  return record(kEven, stamps, 0.8, samples);
}

TEST(SampleTimes, SeeThroughStampsThatComeLate) {
  const Recording r = stamped_late();
  const SampleTimes times = sample_times(r.log);
  EXPECT_NEAR(times.followed, 0.0, 0.03);
  // All are late by the same: that is the clock's zero.
  const VectorXd off = times.time - r.taken;
  EXPECT_LT(root_mean_square(off.array() - off.mean()), 0.03 * kPeriod);
  const Index steps = off.size() - 1;
  EXPECT_LT(root_mean_square(off.tail(steps) - off.head(steps)), 5e-5 * kPeriod) << "the clock's rate is even, too";
}

// Long logs are dated in blocks, which must not show.
TEST(SampleTimes, AreAsGoodWhereALongLogIsCut) {
  const Recording r = stamped_late(200000);
  const SampleTimes times = sample_times(r.log);
  ASSERT_TRUE(times.placed);
  const VectorXd off = times.time - r.taken;
  // Of two thousand lost rows a few are taken for lost some rows off, wherever the log is cut: a period too much and one too little.
  const Index steps = off.size() - 1;
  const Eigen::ArrayXd change = (off.tail(steps) - off.head(steps)).array().abs();
  EXPECT_LE((change > 0.5 * kPeriod).count(), 2 * 10);
  // Late stamps change the clock's rate by up to a thousandth of a period a row.
  EXPECT_EQ((change > 1e-3 * kPeriod && change < 0.5 * kPeriod).count(), 0);
  EXPECT_LT(root_mean_square(off.array() - off.mean()), 0.03 * kPeriod);
}

// Three stamps off within a second: what follows from them agrees with itself, and says nothing of its spread.
TEST(SampleTimes, AreNotKnownOfASingleSecond) {
  const Recording r = record(kEven, [](double even, double jitter) { return even + (even > 5.0 && even < 5.3 ? jitter : 0.0); });
  const SampleTimes times = sample_times(r.log);
  EXPECT_GT(times.scatter, 0.01);
  EXPECT_FALSE(times.known());
  EXPECT_EQ(times.time, r.log.time);
}

// A program that polls at a rate of its own gets some samples twice and some never: its rows are none of the samples' clock, and the
// time that passes between them is that of the stamps.
TEST(SampleTimes, AreTheStampsOfRowsThatKeepNoBeat) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> uniform(0.9, 1.1);
  double polled = 0.0;
  const auto rate = [&] { return 1.0 + 0.3 * std::sin(2.0 * std::numbers::pi * 0.2 * polled); };
  Recording r = record(kEven, kEven);
  for (Index k = 0; k < r.log.time.size(); ++k) {
    r.log.time[k] = polled += kPeriod * rate() * uniform(random);
    const double taken = std::floor(polled / kPeriod) * kPeriod;
    for (int j = 0; j < 2; ++j) r.log.q(k, j) = 0.8 * std::sin(2.0 * std::numbers::pi * (0.4 + 0.3 * j) * taken);
  }
  const SampleTimes times = sample_times(r.log);
  EXPECT_FALSE(times.keeps_beat());
  EXPECT_FALSE(times.placed);
  EXPECT_EQ(times.time, r.log.time);
}

// A clock that was set leaves a gap of years, with as many seconds in it.
TEST(SampleTimes, PassOverAGapOfYears) {
  Recording r = stamped_late();
  constexpr double kYears = 1e9;  // [s]
  const Index half = r.log.time.size() / 2;
  r.log.time.tail(half).array() += kYears;
  const SampleTimes times = sample_times(r.log);
  ASSERT_TRUE(times.placed);
  EXPECT_LT(root_mean_square(times.time.head(half) - r.taken.head(half)), 0.3 * kPeriod);
}

// Row 36 of each hundred comes late, row 37 is lost: by the stamps alone it might as well be the other way round.
TEST(SampleTimes, TakeForLostWhatThePositionsShow) {
  const Recording r = record(kEven, [](double even, double jitter) {
    const bool late = std::lround(even / kPeriod) % 100 == 36;
    return even + (late ? 0.7 * kPeriod : 0.25 * jitter);
  });
  const SampleTimes times = sample_times(r.log);
  ASSERT_TRUE(times.known());
  const VectorXd off = times.time - r.taken;
  EXPECT_LT((off.array() - off.mean()).abs().maxCoeff(), 0.1 * kPeriod);
}

TEST(SampleTimes, AreNotKnownOfAnArmThatRests) {
  const Recording r = record(kEven, kJitters, 0.0);
  const SampleTimes times = sample_times(r.log);
  EXPECT_FALSE(times.known());
  EXPECT_EQ(times.time, r.log.time);
  EXPECT_NE(times.note("a.csv").find("does not show"), std::string::npos) << "nobody knows, and that is said";
}

}  // namespace
}  // namespace heft::data
