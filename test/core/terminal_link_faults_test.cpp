// What must not harm the terminal-link estimator: forgotten gains, glitches of every size, numbers without bound.
#include <limits>

#include <gtest/gtest.h>

#include "support/terminal_link_faults.hpp"

namespace heft {
namespace {

using test::Glitch;
using test::struck;
using test::terminal_link_run;

template <typename Case>
class TerminalLinkFaults : public ::testing::Test {};
TYPED_TEST_SUITE(TerminalLinkFaults, test::TerminalLinkCases);

TYPED_TEST(TerminalLinkFaults, FollowsARemovedPayloadAfterTheGainWrapped) {
  typename TypeParam::Config config;
  config.forgetting_factor = typename TypeParam::Scalar(0.99);  // the gain wraps every 1375 samples
  typename TypeParam::Estimator estimator;
  ASSERT_EQ(TypeParam::configure(estimator, config), Status::kOk);
  for (const auto& s : terminal_link_run(4500, 0.1, 21)) {
    ASSERT_EQ(TypeParam::update(estimator, s), Status::kOk);
  }
  ASSERT_EQ(estimator.source(), EstimateSource::kInstrumental);
  for (const auto& s : terminal_link_run(1200, 0.1, 22, false, 30.0)) {
    ASSERT_EQ(TypeParam::update(estimator, s), Status::kOk);
  }
  // Twelve memories on: e^-12 of the old information.
  EXPECT_LT(TypeParam::torque_error(estimator, terminal_link_run(200, 0.0, 23, false, 36.0)), 0.02);
}

TYPED_TEST(TerminalLinkFaults, AGlitchLeavesNoTraceOnceTheEstimateRestsOnData) {
  using Scalar = typename TypeParam::Scalar;
  for (const Glitch glitch : {Glitch::kTorque, Glitch::kMeasured, Glitch::kInstrument}) {
    typename TypeParam::Estimator estimator, untouched;
    ASSERT_EQ(TypeParam::configure(estimator, {}), Status::kOk);
    ASSERT_EQ(TypeParam::configure(untouched, {}), Status::kOk);
    const double sizes[] = {1e4, 1e6, 1e10, 1e25, static_cast<double>(std::numeric_limits<Scalar>::max())};
    int n = 0;
    for (const auto& s : terminal_link_run(2000, 1.0, 24)) {
      if (n >= 1500 && n % 50 == 0) {
        const Status status = TypeParam::update(estimator, struck(s, glitch, sizes[n / 50 % 5]));
        ASSERT_TRUE(status == Status::kOk || status == Status::kNonFiniteInput);
      }
      if (n < 1500 || n % 50 != 0) {
        ASSERT_EQ(TypeParam::update(estimator, s), Status::kOk);
        ASSERT_EQ(TypeParam::update(untouched, s), Status::kOk);
      }
      ++n;
    }
    ASSERT_EQ(estimator.source(), EstimateSource::kInstrumental);
    // Joint 5's row of a struck sample may be used: the same estimate, but for one more true row.
    const auto judged = terminal_link_run(200, 0.0, 25, true, 30.0);
    EXPECT_NEAR(TypeParam::torque_error(estimator, judged), TypeParam::torque_error(untouched, judged), 0.002)
        << "glitch " << static_cast<int>(glitch);
  }
}

TYPED_TEST(TerminalLinkFaults, AGlitchBeforeTheFirstEstimateDelaysItByNoMoreThanItsOwnSamples) {
  using Scalar = typename TypeParam::Scalar;
  const double largest = static_cast<double>(std::numeric_limits<Scalar>::max());
  const auto clean = terminal_link_run(2500, 1.0, 26);
  const auto judged = terminal_link_run(200, 0.0, 27, true, 30.0);
  for (const Glitch glitch : {Glitch::kTorque, Glitch::kMeasured, Glitch::kInstrument}) {
    for (const double size : {1e4, 1e6, 1e15, 1e30, largest}) {
      for (const int at : {0, 3, 12, 90}) {
        typename TypeParam::Estimator estimator;
        ASSERT_EQ(TypeParam::configure(estimator, {}), Status::kOk);  // λ = 1: nothing is ever forgotten
        for (int n = 0; n < 2500; ++n) {
          const auto& s = clean[static_cast<std::size_t>(n)];
          const Status status = TypeParam::update(estimator, n == at ? struck(s, glitch, size) : s);
          ASSERT_TRUE(status == Status::kOk || n == at);
        }
        ASSERT_EQ(estimator.source(), EstimateSource::kInstrumental)
            << "glitch " << static_cast<int>(glitch) << " of " << size << " at sample " << at;
        EXPECT_LT(TypeParam::torque_error(estimator, judged), 0.05)
            << "glitch " << static_cast<int>(glitch) << " of " << size << " at sample " << at;
      }
    }
  }
}

TYPED_TEST(TerminalLinkFaults, WithoutGateEveryEstimateIsFiniteAndAWildOneIsForgotten) {
  using Scalar = typename TypeParam::Scalar;
  const auto judged = terminal_link_run(200, 0.0, 28, true, 60.0);
  for (const Glitch glitch : {Glitch::kTorque, Glitch::kMeasured, Glitch::kInstrument}) {
    for (const double size : {1e4, 1e7, 1e25, static_cast<double>(std::numeric_limits<Scalar>::max())}) {
      typename TypeParam::Config config;
      config.gate = 0;
      config.forgetting_factor = Scalar(0.99);
      typename TypeParam::Estimator estimator;
      ASSERT_EQ(TypeParam::configure(estimator, config), Status::kOk);
      int n = 0;
      for (const auto& s : terminal_link_run(9000, 0.1, 29)) {
        static_cast<void>(TypeParam::update(estimator, n == 1500 ? struck(s, glitch, size) : s));
        for (const Scalar& v : estimator.estimate()) ASSERT_TRUE(std::isfinite(v)) << size << " at " << n;
        ++n;
      }
      // ln(1e7²) memories and some; in double 1e25 is taken as well, and asks for ln(1e50) = 115 memories.
      if (size <= 1e7 || std::is_same_v<Scalar, float>) {
        EXPECT_LT(TypeParam::torque_error(estimator, judged), 0.05)
            << "glitch " << static_cast<int>(glitch) << " of " << size;
      }
    }
  }
}

TYPED_TEST(TerminalLinkFaults, RefusesNumbersOfEveryJointAndEveryInput) {
  using Vector = typename TypeParam::Vector;
  using Scalar = typename TypeParam::Scalar;
  typename TypeParam::Estimator estimator;
  ASSERT_EQ(TypeParam::configure(estimator, {}), Status::kOk);
  const auto s = terminal_link_run(1, 0.0, 30).front();
  typename TypeParam::Estimator::Record record;
  for (const Scalar bad :
       {std::numeric_limits<Scalar>::quiet_NaN(), std::numeric_limits<Scalar>::infinity()}) {
    for (int field = 0; field < 5; ++field) {
      for (int joint = 0; joint < 6; ++joint) {
        std::array<Vector, 5> inputs{s.q.cast<Scalar>(), s.qd.cast<Scalar>(), s.measured.cast<Scalar>(),
                                     s.qdd.cast<Scalar>(), s.tau.cast<Scalar>()};
        inputs[static_cast<std::size_t>(field)][joint] = bad;
        const bool unused = field == 4 && joint < 4;  // torques of rows before k
        EXPECT_EQ(estimator.update(inputs[0], inputs[1], inputs[2], inputs[3], inputs[4], record),
                  unused ? Status::kOk : Status::kNonFiniteInput)
            << "field " << field << " joint " << joint;
      }
    }
  }
}

TYPED_TEST(TerminalLinkFaults, RefusesSettingsThatWouldEndInNan) {
  using Scalar = typename TypeParam::Scalar;
  const Scalar nan = std::numeric_limits<Scalar>::quiet_NaN(), inf = std::numeric_limits<Scalar>::infinity();
  const auto status_with = [](auto change) {
    typename TypeParam::Config config;
    change(config);
    typename TypeParam::Estimator estimator;
    return TypeParam::configure(estimator, config);
  };
  for (const Scalar bad : {nan, inf}) {
    EXPECT_EQ(status_with([&](auto& c) { c.row_weight[1] = bad; }), Status::kOutOfRange);
    EXPECT_EQ(status_with([&](auto& c) { c.prior_precision = bad; }), Status::kOutOfRange);
    EXPECT_EQ(status_with([&](auto& c) { c.gate = bad; }), Status::kOutOfRange);
    EXPECT_EQ(status_with([&](auto& c) { c.standstill_speed = bad; }), Status::kOutOfRange);
    EXPECT_EQ(status_with([&](auto& c) { c.forgetting_factor = bad; }), Status::kOutOfRange);
  }
  EXPECT_EQ(status_with([&](auto& c) { c.max_amplification = nan; }), Status::kOutOfRange);
  EXPECT_EQ(status_with([&](auto& c) { c.max_amplification_least_squares = nan; }), Status::kOutOfRange);
  EXPECT_EQ(status_with([&](auto& c) { c.forgetting_factor = Scalar(1e-30); }), Status::kOutOfRange);
}

TYPED_TEST(TerminalLinkFaults, DefaultSettingsHoldTheEstimateAtRest) {
  typename TypeParam::Config config;
  config.forgetting_factor = typename TypeParam::Scalar(0.99);
  typename TypeParam::Estimator estimator;
  ASSERT_EQ(TypeParam::configure(estimator, config), Status::kOk);
  const auto run = terminal_link_run(2500, 1.0, 31);
  for (const auto& s : run) ASSERT_EQ(TypeParam::update(estimator, s), Status::kOk);
  const auto judged = terminal_link_run(200, 0.0, 32, true, 30.0);
  const double before = TypeParam::torque_error(estimator, judged);
  auto at_rest = run.back();
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  for (int n = 0; n < 100000; ++n) {
    for (int i = 0; i < 6; ++i) {
      at_rest.qd[i] = 1e-3 * normal(random);
      at_rest.measured[i] = normal(random);
      at_rest.qdd[i] = 0;
    }
    ASSERT_EQ(TypeParam::update(estimator, at_rest), Status::kOk);
  }
  EXPECT_NEAR(TypeParam::torque_error(estimator, judged), before, 0.01);
}

}  // namespace
}  // namespace heft
