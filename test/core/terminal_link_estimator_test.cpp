#include "heft/core/estimate/terminal_link_estimator.hpp"

#include <limits>

#include <gtest/gtest.h>

#include "support/terminal_link_run.hpp"

namespace heft {
namespace {

using test::Arm6;
using test::Vector6;

template <EstimatorForm Form>
using Estimator = TerminalLinkEstimator<Arm6, 4, Form>;

template <EstimatorForm Form>
Estimator<Form> make(typename Estimator<Form>::Config config = {}) {
  Estimator<Form> estimator;
  const ReducedParameters<double, model::KawasakiArm> nominal{reduced_links(model::KawasakiArm::kModel)};
  EXPECT_EQ(estimator.configure(config, nominal, test::nominal_coulomb(), Vector6::Zero()), Status::kOk);
  return estimator;
}

/// Largest error against the truth, relative to the payload's largest change.
template <typename Row>
double error_of(const Row& estimate) {
  const auto truth = test::true_layout_parameters<4>(true), before = test::true_layout_parameters<4>(false);
  double error = 0, change = 0;
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    error = std::max(error, std::abs(estimate[i] - truth[i]));
    change = std::max(change, std::abs(truth[i] - before[i]));
  }
  return error / change;
}

template <typename Form>
class TerminalLink : public ::testing::Test {};
using Forms = ::testing::Types<std::integral_constant<EstimatorForm, EstimatorForm::kInformation>,
                               std::integral_constant<EstimatorForm, EstimatorForm::kFactored>>;
TYPED_TEST_SUITE(TerminalLink, Forms);

TYPED_TEST(TerminalLink, IsExactWithoutNoise) {
  auto estimator = make<TypeParam::value>();
  typename Estimator<TypeParam::value>::Record record;
  for (const auto& s : test::terminal_link_run(1500, 0.0, 1)) {
    ASSERT_EQ(estimator.update(s.q, s.qd, s.qdd, s.qdd, s.tau, record), Status::kOk);
  }
  EXPECT_EQ(estimator.source(), EstimateSource::kInstrumental);
  EXPECT_LT(error_of(estimator.estimate()), 1e-9);
}

TYPED_TEST(TerminalLink, TakesTheSinesAndCosinesOfAController) {
  auto estimator = make<TypeParam::value>();
  typename Estimator<TypeParam::value>::Record record;
  for (const auto& s : test::terminal_link_run(1500, 0.0, 1)) {
    ASSERT_EQ(estimator.update(joint_trigonometry<Arm6>(s.q), s.q, s.qd, s.qdd, s.qdd, s.tau, record),
              Status::kOk);
  }
  EXPECT_EQ(estimator.source(), EstimateSource::kInstrumental);
  EXPECT_LT(error_of(estimator.estimate()), 1e-9);
}

TYPED_TEST(TerminalLink, InstrumentsRemoveTheBiasOfLeastSquares) {
  auto instrumental = make<TypeParam::value>();
  typename Estimator<TypeParam::value>::Config config;
  config.use_instruments = false;
  auto least_squares = make<TypeParam::value>(config);
  typename Estimator<TypeParam::value>::Record record;
  for (const auto& s : test::terminal_link_run(20000, 10.0, 2)) {
    ASSERT_EQ(instrumental.update(s.q, s.qd, s.measured, s.qdd, s.tau, record), Status::kOk);
    ASSERT_EQ(least_squares.update(s.q, s.qd, s.measured, s.qdd, s.tau, record), Status::kOk);
  }
  const auto truth = test::true_layout_parameters<4>();
  double iv = 0, ls = 0, change = 0;
  const auto before = test::true_layout_parameters<4>(false);
  for (std::size_t i = 4; i < truth.size(); ++i) {
    iv += std::pow(instrumental.estimate()[i] - truth[i], 2);
    ls += std::pow(least_squares.estimate()[i] - truth[i], 2);
    change += std::pow(truth[i] - before[i], 2);
  }
  EXPECT_LT(std::sqrt(iv / change), 0.03);
  EXPECT_GT(std::sqrt(ls / iv), 5.0);
  EXPECT_EQ(least_squares.source(), EstimateSource::kLeastSquares);
}

TYPED_TEST(TerminalLink, HandsOutThePriorThenLeastSquaresThenInstruments) {
  auto estimator = make<TypeParam::value>();
  typename Estimator<TypeParam::value>::Record record;
  int first_least_squares = -1, first_instrumental = -1, n = 0;
  EstimateSource last = EstimateSource::kPrior;
  for (const auto& s : test::terminal_link_run(3000, 10.0, 3)) {
    ASSERT_EQ(estimator.update(s.q, s.qd, s.measured, s.qdd, s.tau, record), Status::kOk);
    ASSERT_GE(static_cast<int>(record.source), static_cast<int>(last)) << "the source never falls back";
    last = record.source;
    if (last == EstimateSource::kPrior) {
      for (std::size_t i = 0; i < estimator.estimate().size(); ++i) {
        ASSERT_EQ(estimator.estimate()[i], estimator.prior()[i]);
      }
    }
    if (last == EstimateSource::kLeastSquares && first_least_squares < 0) first_least_squares = n;
    if (last == EstimateSource::kInstrumental && first_instrumental < 0) first_instrumental = n;
    ++n;
  }
  EXPECT_GE(first_least_squares, 200);
  EXPECT_GT(first_instrumental, first_least_squares);
}

TYPED_TEST(TerminalLink, RefusesNumbersThatAreNotFinite) {
  auto estimator = make<TypeParam::value>(), untouched = make<TypeParam::value>();
  typename Estimator<TypeParam::value>::Record record;
  const double bad[] = {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
                        1e9};
  int n = 0;
  for (const auto& s : test::terminal_link_run(2500, 1.0, 4)) {
    if (n % 7 == 3) {
      // Any input of any joint may be the broken one; an angle of 1e9 rad has no sine.
      auto broken = s;
      Vector6* fields[] = {&broken.q, &broken.qd, &broken.measured, &broken.tau};
      const int field = n % 4;
      const int joint =
          1 + n % 5;  // the first angle of this arm moves no torque, the first rows are not used
      const double value = field == 0 ? bad[n % 3] : bad[n % 2];
      (*fields[field])[field == 3 ? 4 + n % 2 : joint] = value;
      EXPECT_EQ(estimator.update(broken.q, broken.qd, broken.measured, broken.qdd, broken.tau, record),
                Status::kNonFiniteInput)
          << "sample " << n << " field " << field << " joint " << joint;
    }
    ASSERT_EQ(estimator.update(s.q, s.qd, s.measured, s.qdd, s.tau, record), Status::kOk);
    ASSERT_EQ(untouched.update(s.q, s.qd, s.measured, s.qdd, s.tau, record), Status::kOk);
    ++n;
  }
  for (std::size_t i = 0; i < estimator.estimate().size(); ++i) {
    EXPECT_EQ(estimator.estimate()[i], untouched.estimate()[i]) << "a refused sample left a trace";
  }
}

TYPED_TEST(TerminalLink, GateRefusesOutliersAndLetsALastingChangeIn) {
  auto estimator = make<TypeParam::value>();
  typename Estimator<TypeParam::value>::Record record;
  int refused = 0, outliers = 0, n = 0;
  for (const auto& s : test::terminal_link_run(6000, 1.0, 5)) {
    Vector6 tau = s.tau;
    const bool outlier = n > 2000 && n % 50 == 0;
    if (outlier) {
      tau[5] += 50.0;
    }
    ASSERT_EQ(estimator.update(s.q, s.qd, s.measured, s.qdd, tau, record), Status::kOk);
    if (outlier) {
      EXPECT_FALSE(record.row_used[1]) << n;
      EXPECT_TRUE(record.row_used[0]) << n;
    }
    refused += n > 2000 && !record.row_used[1] ? 1 : 0;
    outliers += outlier ? 1 : 0;
    ++n;
  }
  ASSERT_EQ(outliers, 79);
  // The gate is at 8 mean magnitudes, 6.4 standard deviations: no good row among 4000 reaches it.
  EXPECT_EQ(refused, outliers) << "good rows were refused";
  EXPECT_LT(error_of(estimator.estimate()), 0.05);

  // The friction of joint 6 doubles for good: refused at first, taken in within a second.
  int used = 0;
  for (const auto& s : test::terminal_link_run(400, 1.0, 6, true, 30.0)) {
    Vector6 tau = s.tau;
    tau[5] += 3.0;
    ASSERT_EQ(estimator.update(s.q, s.qd, s.measured, s.qdd, tau, record), Status::kOk);
    used += record.row_used[1] ? 1 : 0;
  }
  EXPECT_GT(used, 200);
}

TEST(TerminalLinkEstimator, StaysAtThePriorWithoutMotion) {
  Estimator<EstimatorForm::kInformation>::Config config;
  config.forgetting_factor = 0.999;
  auto estimator = make<EstimatorForm::kInformation>(config);
  typename Estimator<EstimatorForm::kInformation>::Record record;
  const auto s = test::terminal_link_run(1, 0.0, 1).front();
  const Vector6 zero = Vector6::Zero();
  for (int n = 0; n < 50000; ++n) {
    ASSERT_EQ(estimator.update(s.q, zero, zero, zero, s.tau, record), Status::kOk);
  }
  EXPECT_EQ(estimator.source(), EstimateSource::kPrior);
  EXPECT_NE(estimator.status(), Status::kOk);
}

TEST(TerminalLinkEstimator, DoesNotWindUpInAMillionSamplesOfStandstill) {
  Estimator<EstimatorForm::kInformation>::Config config;
  config.forgetting_factor = 0.995;
  config.standstill_speed = 0.01;
  auto estimator = make<EstimatorForm::kInformation>(config);
  typename Estimator<EstimatorForm::kInformation>::Record record;
  const auto run = test::terminal_link_run(3000, 1.0, 7);
  for (const auto& s : run) {
    ASSERT_EQ(estimator.update(s.q, s.qd, s.measured, s.qdd, s.tau, record), Status::kOk);
  }
  ASSERT_EQ(estimator.source(), EstimateSource::kInstrumental);
  // A solve may still be under way; let it end, then nothing may move any more.
  const Vector6 zero = Vector6::Zero();
  const auto& s = run.back();
  for (int n = 0; n < 100; ++n) {
    ASSERT_EQ(estimator.update(s.q, zero, zero, zero, s.tau, record), Status::kOk);
  }
  const auto before = estimator.estimate();
  for (int n = 0; n < 1000000; ++n) {
    ASSERT_EQ(estimator.update(s.q, zero, zero, zero, s.tau, record), Status::kOk);
    ASSERT_TRUE(record.standstill);
  }
  EXPECT_EQ(estimator.estimate(), before);
}

TEST(TerminalLinkEstimator, ForgettingFollowsADroppedPayload) {
  Estimator<EstimatorForm::kInformation>::Config config;
  config.forgetting_factor = 0.998;
  auto estimator = make<EstimatorForm::kInformation>(config);
  typename Estimator<EstimatorForm::kInformation>::Record record;
  for (const auto& s : test::terminal_link_run(4000, 1.0, 8, true)) {
    ASSERT_EQ(estimator.update(s.q, s.qd, s.measured, s.qdd, s.tau, record), Status::kOk);
  }
  EXPECT_LT(error_of(estimator.estimate()), 0.1);
  for (const auto& s : test::terminal_link_run(6000, 1.0, 9, false, 20.0)) {
    ASSERT_EQ(estimator.update(s.q, s.qd, s.measured, s.qdd, s.tau, record), Status::kOk);
  }
  const auto empty = test::true_layout_parameters<4>(false);
  for (std::size_t i = 0; i < empty.size(); ++i) {
    EXPECT_NEAR(estimator.estimate()[i], empty[i], 0.02) << "parameter " << i;
  }
}

TEST(TerminalLinkEstimator, RowWeightsChangeNothingWithoutNoise) {
  Estimator<EstimatorForm::kInformation>::Config config;
  config.row_weight = {4.0, 0.25};
  auto estimator = make<EstimatorForm::kInformation>(config);
  typename Estimator<EstimatorForm::kInformation>::Record record;
  for (const auto& s : test::terminal_link_run(1500, 0.0, 10)) {
    ASSERT_EQ(estimator.update(s.q, s.qd, s.qdd, s.qdd, s.tau, record), Status::kOk);
  }
  EXPECT_LT(error_of(estimator.estimate()), 1e-9);
}

TEST(TerminalLinkEstimator, FloatFollowsDouble) {
  using ArmF = StaticArm<float, model::KawasakiArm>;
  TerminalLinkEstimator<ArmF, 4> single;
  ReducedParameters<float, model::KawasakiArm> nominal;
  const auto links = reduced_links(model::KawasakiArm::kModel);
  for (std::size_t j = 0; j < 6; ++j) {
    for (std::size_t i = 0; i < 10; ++i) {
      nominal.links[j][i] = static_cast<float>(links[j][i]);
    }
  }
  ASSERT_EQ(single.configure({}, nominal, test::nominal_coulomb().cast<float>().eval(), ArmF::Vector::Zero()),
            Status::kOk);
  auto twin = make<EstimatorForm::kInformation>();
  TerminalLinkEstimator<ArmF, 4>::Record record_f;
  typename Estimator<EstimatorForm::kInformation>::Record record;
  for (const auto& s : test::terminal_link_run(4000, 1.0, 11)) {
    ASSERT_EQ(single.update(s.q.cast<float>(), s.qd.cast<float>(), s.measured.cast<float>(),
                            s.qdd.cast<float>(), s.tau.cast<float>(), record_f),
              Status::kOk);
    ASSERT_EQ(twin.update(s.q, s.qd, s.measured, s.qdd, s.tau, record), Status::kOk);
  }
  double largest = 0;
  for (const double v : twin.estimate()) {
    largest = std::max(largest, std::abs(v));
  }
  for (std::size_t i = 0; i < 18; ++i) {
    EXPECT_NEAR(single.estimate()[i], twin.estimate()[i], 1e-3 * largest) << "parameter " << i;
  }
}

TEST(TerminalLinkEstimator, RefusesSettingsOutOfRange) {
  Estimator<EstimatorForm::kInformation> estimator;
  const ReducedParameters<double, model::KawasakiArm> nominal{reduced_links(model::KawasakiArm::kModel)};
  const Vector6 zero = Vector6::Zero();
  const auto status_with = [&](auto change) {
    Estimator<EstimatorForm::kInformation>::Config config;
    change(config);
    return estimator.configure(config, nominal, zero, zero);
  };
  EXPECT_EQ(status_with([](auto& c) { c.forgetting_factor = 0; }), Status::kOutOfRange);
  EXPECT_EQ(status_with([](auto& c) { c.forgetting_factor = 1.01; }), Status::kOutOfRange);
  EXPECT_EQ(status_with([](auto& c) { c.solve_every = 1; }), Status::kOutOfRange);
  EXPECT_EQ(status_with([](auto& c) { c.row_weight[0] = 0; }), Status::kOutOfRange);
  EXPECT_EQ(status_with([](auto& c) { c.prior_precision = -1; }), Status::kOutOfRange);
  EXPECT_EQ(status_with([](auto& c) { c.gate = -1; }), Status::kOutOfRange);
  Estimator<EstimatorForm::kInformation>::Record record;
  EXPECT_EQ(estimator.update(zero, zero, zero, zero, zero, record), Status::kNotConfigured);
}

TYPED_TEST(TerminalLink, KeepsItsStateWhenSettingsAreRefused) {
  auto estimator = make<TypeParam::value>(), untouched = make<TypeParam::value>();
  typename Estimator<TypeParam::value>::Record record;
  const ReducedParameters<double, model::KawasakiArm> other{
      reduced_links(model::KawasakiArmWithPayload::kModel)};
  int n = 0;
  for (const auto& s : test::terminal_link_run(1500, 1.0, 4)) {
    if (++n == 700) {
      typename Estimator<TypeParam::value>::Config config;
      config.standstill_speed = 0.5;
      for (const double bad : {0.0, 1.01, std::numeric_limits<double>::quiet_NaN()}) {
        config.forgetting_factor = bad;
        EXPECT_EQ(estimator.configure(config, other, Vector6::Ones(), Vector6::Ones()), Status::kOutOfRange);
      }
    }
    ASSERT_EQ(estimator.update(s.q, s.qd, s.measured, s.qdd, s.tau, record), Status::kOk);
    ASSERT_EQ(untouched.update(s.q, s.qd, s.measured, s.qdd, s.tau, record), Status::kOk);
  }
  EXPECT_EQ(estimator.estimate(), untouched.estimate());
  EXPECT_EQ(estimator.source(), untouched.source());
}

TEST(TerminalLinkEstimator, ReducedParametersReproduceTheTorquesOfTheLoadedArmInItsRows) {
  auto estimator = make<EstimatorForm::kInformation>();
  typename Estimator<EstimatorForm::kInformation>::Record record;
  for (const auto& s : test::terminal_link_run(1500, 0.0, 12)) {
    ASSERT_EQ(estimator.update(s.q, s.qd, s.qdd, s.qdd, s.tau, record), Status::kOk);
  }
  const auto reduced = estimator.reduced();
  Vector6 coulomb = test::nominal_coulomb(), viscous = Vector6::Zero();
  estimator.friction(coulomb, viscous);
  EXPECT_NEAR(coulomb[5], 0.25, 1e-9);
  double inboard = 0;
  for (const auto& s : test::terminal_link_run(50, 0.0, 13, true, 17.0)) {
    Vector6 tau = inverse_dynamics<Arm6>(reduced, s.q, s.qd, s.qdd);
    for (int i = 0; i < 6; ++i) {
      tau[i] += coulomb[i] * velocity_sign(s.qd[i], 0.0);
    }
    EXPECT_NEAR(tau[4], s.tau[4], 1e-9);
    EXPECT_NEAR(tau[5], s.tau[5], 1e-9);
    inboard = std::max(inboard, (tau - s.tau).head<4>().cwiseAbs().maxCoeff());
  }
  EXPECT_GT(inboard, 1e-3) << "rows before k cannot know the payload's mass from rows 5 and 6";
}

}  // namespace
}  // namespace heft
