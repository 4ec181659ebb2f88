// Rests are told from slow motion, and from joints that never move.
#include "heft/regression/rests.hpp"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace heft::regression {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kRate = 200.0;

VectorXd speed_over(double seconds, double (*speed)(double t)) {
  return VectorXd::NullaryExpr(static_cast<Index>(seconds * kRate),
                               [&](Index i) { return speed(static_cast<double>(i) / kRate); });
}

Index resting(const VectorXd& qd, bool prismatic = false) { return resting_rows(qd, kRate, prismatic).count(); }

TEST(Rests, AreStretchesWithoutMotion) {
  // 1 s of motion either side of a rest that begins and ends where the speed falls below the rest speed.
  const VectorXd qd = speed_over(3.0, [](double t) { return t < 1.0 || t >= 2.0 ? -0.4 : 1e-3 * std::sin(300.0 * t); });
  const auto rests = resting_rows(qd, kRate, false);
  EXPECT_EQ(rests.count(), 200);
  EXPECT_TRUE(rests.segment(200, 200).all());
}

TEST(Rests, AreNoReversalsAndNoCrawls) {
  const auto short_stop = [](double t) { return t < 1.0 || t >= 1.2 ? 0.4 : 0.0; };
  EXPECT_EQ(resting(speed_over(3.0, short_stop)), 0) << "a fifth of a second";
  // Turns back slowly: 0.1 rad/s at 0.5 Hz is below the rest speed for 0.03 s.
  EXPECT_EQ(resting(speed_over(4.0, [](double t) { return 0.1 * std::sin(std::numbers::pi * t); })), 0);
  EXPECT_EQ(resting(speed_over(4.0, [](double) { return 0.01; })), 0);
  EXPECT_EQ(resting(speed_over(4.0, [](double) { return 0.003; })), 800);
  EXPECT_EQ(resting(speed_over(4.0, [](double) { return 0.003; }), true), 0) << "3 mm/s is motion of a slide";
}

TEST(Rests, AreNoneOfAJointThatMovesNowhere) {
  data::StreamSummary log;
  log.travel = Eigen::Vector3d(1.0, 0.005, 1.0);
  log.top_speed = Eigen::Vector3d(0.5, 0.5, 0.01);
  EXPECT_TRUE(moves(log, 0, false));
  EXPECT_FALSE(moves(log, 1, false)) << "5 mrad";
  EXPECT_FALSE(moves(log, 2, false)) << "drifts";
  EXPECT_TRUE(moves(log, 2, true));
}

}  // namespace
}  // namespace heft::regression
