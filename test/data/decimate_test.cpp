#include "heft/data/decimate.hpp"

#include <algorithm>
#include <cstdlib>
#include <vector>

#include <gtest/gtest.h>

#include "heft/data/differentiate.hpp"
#include "low_pass_sections.hpp"
#include "signal_lanes.hpp"

namespace heft::data {
namespace {

using Eigen::Index;

struct Case {
  Index rows;
  double rate, cutoff;
  Index first, step;
};

TEST(DecimatedLowPass, KeepsTheRowsThatTheWholeFilterGives) {
  const std::vector<Case> cases{{6000, 1000.0, 5.0, 0, 50}, {6000, 1000.0, 5.0, 17, 50}, {300, 1000.0, 5.0, 17, 50},
                                {40, 125.0, 10.0, 2, 3},    {1, 100.0, 10.0, 0, 2},      {2, 100.0, 10.0, 1, 2},
                                {3, 100.0, 10.0, 1, 7},     {999, 100.0, 44.0, 0, 1},    {1000, 100.0, 25.0, 0, 2},
                                {4000, 1000.0, 0.5, 3, 500}};
  constexpr Index kSignals = 14;  // lanes of any width, and some that they leave
  for (const Case& c : cases) {
    SCOPED_TRACE(c.rows);
    DecimatedLowPass::Kept x = DecimatedLowPass::Kept::Random(c.rows, kSignals);
    x.col(1).array() += 1000.0;  // a large constant passes too
    const Eigen::MatrixXd whole = low_pass_zero_phase(x, c.rate, c.cutoff);
    DecimatedLowPass filter(c.rate, c.cutoff, kSignals, c.rows, c.first, c.step);
    for (Index row = 0; row < c.rows;) {
      const Index count = std::min<Index>(c.rows - row, 1 + row % 37);
      filter.add(x.data() + row * kSignals, count);
      row += count;
    }
    const DecimatedLowPass::Kept kept = filter.finish();
    ASSERT_EQ(kept.rows(), (c.rows - c.first - 1) / c.step + 1);
    for (Index k = 0; k < kept.rows(); ++k) {
      for (Index signal = 0; signal < kSignals; ++signal) {
        // Rounding of a thousand and of sums over all rows between two kept ones.
        EXPECT_NEAR(kept(k, signal), whole(c.first + k * c.step, signal), signal == 1 ? 1e-10 : 1e-11);
      }
    }
  }
}

TEST(DecimatedLowPass, TakesColumnsAsItTakesRows) {
  constexpr Index kSignals = 12, kLength = 100;
  const Eigen::MatrixXd x = Eigen::MatrixXd::Random(kLength, kSignals);
  const DecimatedLowPass::Kept rows = x;
  DecimatedLowPass by_rows(100.0, 10.0, kSignals, kLength, 1, 3), by_columns = by_rows;
  by_rows.add(rows.data(), kLength);
  for (Index row = 0; row < kLength;) {
    const Index count = std::min<Index>(kLength - row, 1 + row % 13);
    std::vector<const double*> columns;
    for (Index signal = 0; signal < kSignals; ++signal) columns.push_back(x.col(signal).data() + row);
    by_columns.add_columns(columns.data(), count);
    row += count;
  }
  EXPECT_EQ(by_columns.finish(), by_rows.finish());
}

TEST(DecimatedLowPass, KeepsNothingOfRowsBeforeTheFirstKeptOne) {
  DecimatedLowPass filter(100.0, 5.0, 2, 3, 4, 5);
  const std::vector<double> rows(6, 1.0);
  filter.add(rows.data(), 3);
  EXPECT_EQ(filter.finish().rows(), 0);
}

// What a log gives must not depend on the processor.
TEST(SignalLanes, AllHaveTheSameBits) {
  constexpr Index kNumRows = 50, kSignals = 22, kFiltered = 24, kStates = StretchFilter::kStates, kSums = SignalLanes::kSums;
  std::srand(3);
  const DecimatedLowPass::Kept rows = DecimatedLowPass::Kept::Random(kNumRows, kFiltered);
  const Eigen::VectorXd numbers = Eigen::VectorXd::Random(kSums * kNumRows);
  const Eigen::VectorXd behind = Eigen::VectorXd::Random(kStates * kSignals);
  const StretchFilter over{numbers.data(), numbers.data() + 16, numbers.data() + 32, numbers.data() + 36, numbers[40]};
  const LowPass low_pass(100.0, 7.0);
  struct Found {
    Eigen::MatrixXd filtered;
    Eigen::VectorXd sums, forward, output, behind, back, backward;
  };
  const auto with = [&](const SignalLanes& lanes) {
    const auto some = [&](Index count) { return Eigen::VectorXd(numbers.head(count * kSignals)); };
    Found f{rows, some(kSums), some(kStates), some(1), some(kStates), some(1), some(kStates)};
    for (Index first = 0; first < kFiltered; first += lanes.width) {
      lanes.filter(low_pass, f.filtered.col(first).data(), kNumRows, kNumRows, lanes.width, false, nullptr, 0);
      lanes.filter(low_pass, f.filtered.col(first).data() + 5, kNumRows - 5, kNumRows, lanes.width, true, nullptr, 0);
    }
    const DecimatedLowPass::Kept narrow = rows.leftCols(kSignals);
    lanes.add(f.sums.data(), narrow.data(), numbers.data(), kSignals, kNumRows);
    const Eigen::VectorXd sums = f.sums;
    lanes.end(over, f.sums.data(), f.forward.data(), f.output.data(), f.behind.data(), kSignals);
    EXPECT_TRUE((f.sums.array() == 0.0).all());
    f.sums = sums;
    lanes.back(over, f.back.data(), behind.data(), f.backward.data(), kSignals);
    return f;
  };
  const Found twos = with(*available_signal_lanes().front());
  for (const SignalLanes* lanes : available_signal_lanes()) {
    const Found f = with(*lanes);
    EXPECT_EQ(f.filtered, twos.filtered) << lanes->width;
    EXPECT_EQ(f.sums, twos.sums) << lanes->width;
    EXPECT_EQ(f.forward, twos.forward) << lanes->width;
    EXPECT_EQ(f.output, twos.output) << lanes->width;
    EXPECT_EQ(f.behind, twos.behind) << lanes->width;
    EXPECT_EQ(f.back, twos.back) << lanes->width;
    EXPECT_EQ(f.backward, twos.backward) << lanes->width;
  }
}

// The trapezoidal section one signal at a time, one row at a time.
TEST(SignalLanes, FilterAsTheSectionSays) {
  const LowPass low_pass(100.0, 7.0);
  const auto alone = [&](Eigen::VectorXd x, bool backward) {
    if (backward) x.reverseInPlace();
    double s1[2] = {0.0, 0.0}, s2[2] = {x[0], x[0]};
    for (double& value : x) {
      for (int section = 0; section < 2; ++section) {
        const auto [a1, a2, a3] = section == 0 ? low_pass.first() : low_pass.second();
        const double v3 = value - s2[section], v1 = a1 * s1[section] + a2 * v3;
        value = s2[section] + a2 * s1[section] + a3 * v3;
        s1[section] = 2.0 * v1 - s1[section];
        s2[section] = 2.0 * value - s2[section];
      }
    }
    if (backward) x.reverseInPlace();
    return x;
  };
  for (const SignalLanes* lanes : available_signal_lanes()) {
    for (const Index rows : {1, 7, 8, 29}) {
      for (const bool backward : {false, true}) {
        const Eigen::MatrixXd x = Eigen::MatrixXd::Random(rows, lanes->width);
        Eigen::MatrixXd y = x;
        lanes->filter(low_pass, y.data(), rows, rows, lanes->width, backward, nullptr, 0);
        for (Index signal = 0; signal < lanes->width; ++signal) {
          const Eigen::VectorXd expected = alone(x.col(signal), backward);
          EXPECT_LT((y.col(signal) - expected).cwiseAbs().maxCoeff(), 1e-14) << lanes->width << ' ' << rows;
        }
      }
    }
  }
}

// Several lanes side by side, and as many as there are at most.
TEST(SignalLanes, FilterAsManyAsTheyTakeAtOnce) {
  const LowPass low_pass(100.0, 7.0);
  for (const SignalLanes* lanes : available_signal_lanes()) {
    const Eigen::MatrixXd rows = Eigen::MatrixXd::Random(41, lanes->most);
    for (Index signals = lanes->width; signals <= lanes->most; signals += lanes->width) {
      Eigen::MatrixXd together = rows, alone = rows;
      lanes->filter(low_pass, together.data(), 41, 41, signals, false, nullptr, 0);
      for (Index first = 0; first < signals; first += lanes->width)
        lanes->filter(low_pass, alone.col(first).data(), 41, 41, lanes->width, false, nullptr, 0);
      EXPECT_EQ(together, alone) << lanes->width;
    }
  }
}

}  // namespace
}  // namespace heft::data
