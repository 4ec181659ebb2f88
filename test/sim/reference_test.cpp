#include "heft/sim/reference.hpp"

#include <cmath>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "heft/host/error.hpp"

namespace heft::sim {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

struct Point {
  VectorXd q, qd, qdd;
};

Point at(const Reference& reference, double t) {
  const int n = reference.num_joints();
  Point p{VectorXd(n), VectorXd(n), VectorXd(n)};
  reference.evaluate(t, p.q, p.qd, p.qdd);
  return p;
}

FourierMotion fourier() {
  FourierMotion motion;
  motion.q0 = Eigen::Vector2d(0.2, -0.4);
  motion.amplitude = (MatrixXd(2, 2) << 0.3, 0.1, 0.5, 0.2).finished();
  motion.frequency_hz = (MatrixXd(2, 2) << 0.4, 1.1, 0.3, 0.7).finished();
  motion.phase = (MatrixXd(2, 2) << 0.1, 2.0, -1.0, 0.6).finished();
  return motion;
}

std::vector<std::shared_ptr<const Reference>> motions() {
  const MatrixXd points = (MatrixXd(2, 4) << 0.0, 0.5, -0.3, 0.2, 1.0, 0.8, 0.9, -0.4).finished();
  const std::vector<double> times{0.5, 1.0, 2.2, 3.0};
  return {make_fourier(fourier()), ramp_in(make_fourier(fourier()), Eigen::Vector2d(0.0, 0.1), 1.5),
          make_quintic(Eigen::Vector2d(0.0, 1.0), Eigen::Vector2d(0.7, -1.0), 2.0),
          make_waypoints(times, points, WaypointOrder::kCubic),
          make_waypoints(times, points, WaypointOrder::kQuintic)};
}

TEST(Reference, DerivativesAgreeWithDifferences) {
  const double h = 1e-5;
  for (const auto& motion : motions()) {
    for (double t = 0.013; t < 3.5; t += 0.0971) {
      const Point p = at(*motion, t), next = at(*motion, t + h), last = at(*motion, t - h);
      EXPECT_LT(((next.q - last.q) / (2 * h) - p.qd).norm(), 1e-7) << "t = " << t;
      EXPECT_LT(((next.qd - last.qd) / (2 * h) - p.qdd).norm(), 1e-5) << "t = " << t;
    }
  }
}

TEST(Reference, RampStartsAtRestAndJoinsTheMotion) {
  const Eigen::Vector2d start(0.0, 0.1);
  const auto motion = make_fourier(fourier());
  const auto ramped = ramp_in(motion, start, 1.5);
  const Point begin = at(*ramped, 0.0);
  EXPECT_EQ(begin.q, start);
  EXPECT_EQ(begin.qd.norm(), 0.0);
  EXPECT_EQ(begin.qdd.norm(), 0.0);
  EXPECT_LT((at(*ramped, 1.5 - 1e-9).q - at(*motion, 1.5).q).norm(), 1e-7);
  EXPECT_EQ(at(*ramped, 2.0).qdd, at(*motion, 2.0).qdd);
}

TEST(Reference, WaypointsArePassedWithContinuousVelocityAndAcceleration) {
  const MatrixXd points = (MatrixXd(1, 4) << 0.0, 0.5, -0.3, 0.2).finished();
  const std::vector<double> times{0.5, 1.0, 2.2, 3.0};
  for (WaypointOrder order : {WaypointOrder::kCubic, WaypointOrder::kQuintic}) {
    const auto motion = make_waypoints(times, points, order);
    for (std::size_t k = 0; k < times.size(); ++k) {
      EXPECT_NEAR(at(*motion, times[k]).q[0], points(0, static_cast<Eigen::Index>(k)), 1e-14);
      if (k == 0 || k + 1 == times.size()) continue;
      const Point before = at(*motion, times[k] - 1e-9), after = at(*motion, times[k] + 1e-9);
      EXPECT_NEAR(before.qd[0], after.qd[0], 1e-7);
      EXPECT_NEAR(before.qdd[0], after.qdd[0], 1e-6);
    }
    EXPECT_NEAR(at(*motion, 0.5).qd[0], 0.0, 1e-14);
    EXPECT_NEAR(at(*motion, 3.0 - 1e-12).qd[0], 0.0, 1e-9);
    EXPECT_EQ(at(*motion, 4.0).q[0], 0.2);
  }
  EXPECT_NEAR(at(*make_waypoints(times, points, WaypointOrder::kQuintic), 0.5).qdd[0], 0.0, 1e-12);
}

TEST(Reference, RefusesTimesThatDoNotIncrease) {
  EXPECT_THROW(make_waypoints({0.0, 1.0, 1.0}, MatrixXd::Zero(1, 3), WaypointOrder::kCubic), ModelError);
}

TEST(Reference, SamplesAreMetWithTheirDerivativesAndFollowedBetween) {
  // A sine at 100 Hz: a fifth-order piece of h = 0.01 s leaves h⁶/46080 · max|q⁽⁶⁾| = 1e-15.
  const Eigen::VectorXd times = Eigen::VectorXd::LinSpaced(201, 0.0, 2.0);
  Eigen::MatrixXd q(201, 1), qd(201, 1), qdd(201, 1);
  q.col(0) = (2.0 * times.array()).sin();
  qd.col(0) = 2.0 * (2.0 * times.array()).cos();
  qdd.col(0) = -4.0 * (2.0 * times.array()).sin();
  const auto reference = make_sampled(times, q, qd, qdd);
  Eigen::VectorXd a(1), v(1), d(1);
  for (double t = 0.003; t < 2.0; t += 0.0171) {
    reference->evaluate(t, a, v, d);
    EXPECT_NEAR(a[0], std::sin(2.0 * t), 1e-12);
    EXPECT_NEAR(v[0], 2.0 * std::cos(2.0 * t), 1e-10);
    EXPECT_NEAR(d[0], -4.0 * std::sin(2.0 * t), 1e-7);
  }
  reference->evaluate(3.0, a, v, d);
  EXPECT_EQ(a[0], q(200, 0));
  EXPECT_EQ(v[0], 0.0);
  EXPECT_THROW(make_sampled(times, q, qd.topRows(3), qdd), ModelError);
}

}  // namespace
}  // namespace heft::sim
