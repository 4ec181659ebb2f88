// Shares of the torque, and which base parameters of a fit count.
#include "heft/identify/fit_record.hpp"

#include <cmath>
#include <memory>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/data/log.hpp"
#include "support/arms.hpp"

namespace heft::identify {
namespace {

using Eigen::Index;
using ::testing::HasSubstr;

TEST(TorqueShares, AreThoseOfAPendulum) {
  // One joint about a level axis: τ = Izz q̈ − g mcx cos(q)...: shares of inertia and weight in closed form.
  model::Robot pendulum = test::planar_two_link();
  pendulum.joints.pop_back();
  pendulum.joints[0].actuation = {};
  Fit fit;
  fit.columns = std::make_shared<const regression::RegressionColumns>(
      pendulum, regression::ModelStructure{false, false, false, false, {}});
  fit.base = regression::find_base_parameters(*fit.columns);
  const Eigen::VectorXd beta = fit.base.regrouping * fit.columns->values(pendulum);
  data::Log log;
  constexpr Index kRows = 3000;
  constexpr double kAmplitude = 1.2, kFrequency = 2.0 * std::numbers::pi * 0.5;
  log.time = Eigen::VectorXd::LinSpaced(kRows, 0.0, (kRows - 1) / 100.0);
  log.q = (kAmplitude * (kFrequency * log.time.array()).sin()).matrix();
  log.qd = (kAmplitude * kFrequency * (kFrequency * log.time.array()).cos()).matrix();
  log.qdd = -kFrequency * kFrequency * log.q;
  log.tau = Eigen::MatrixXd::Zero(kRows, 1);
  const Eigen::VectorXd shares = torque_shares(fit, beta, data::MotionStream(log));
  const auto& link = pendulum.joints[0].link;
  // Gravity along −y: a weight's torque is g mcx cos(q).
  double inertia = 0.0, weight = 0.0, whole = 0.0;
  for (Index k = 0; k < kRows; ++k) {
    const double a = link[kIzz] * log.qdd(k, 0), b = 9.81 * link[kMcx] * std::cos(log.q(k, 0));
    inertia += a * a;
    weight += b * b;
    whole += (a + b) * (a + b);
  }
  ASSERT_EQ(shares.size(), 3);  // mcx, mcy, Izz, in the order of the columns
  EXPECT_NEAR(shares[0], std::sqrt(weight / whole), 1e-3);
  EXPECT_NEAR(shares[1], 0.0, 1e-9);  // the centre of mass lies on x
  EXPECT_NEAR(shares[2], std::sqrt(inertia / whole), 1e-3);
}

TEST(CountedParameters, AreDeterminedOnesThatMoveTorque) {
  Fit fit;
  fit.determined = {true, false, true};
  const CountedParameters counted = counted_parameters(fit, Eigen::Vector3d(0.5, 0.4, 0.004));
  EXPECT_EQ(counted.counted, (std::vector<bool>{true, false, false}));
  EXPECT_EQ(counted.count(), 1);
  EXPECT_THAT(counted.reasons[1], HasSubstr("does not determine"));
  EXPECT_THAT(counted.reasons[2], HasSubstr("0.4 %"));
}

}  // namespace
}  // namespace heft::identify
