#include "heft/data/decimate.hpp"

#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

#include "heft/data/differentiate.hpp"

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
  for (const Case& c : cases) {
    SCOPED_TRACE(c.rows);
    DecimatedLowPass::Kept x = DecimatedLowPass::Kept::Random(c.rows, 4);
    x.col(1).array() += 1000.0;  // a large constant passes too
    const Eigen::MatrixXd whole = low_pass_zero_phase(x, c.rate, c.cutoff);
    DecimatedLowPass filter(c.rate, c.cutoff, 4, c.rows, c.first, c.step);
    for (Index row = 0; row < c.rows;) {
      const Index count = std::min<Index>(c.rows - row, 1 + row % 37);
      filter.add(x.data() + row * 4, count);
      row += count;
    }
    const DecimatedLowPass::Kept kept = filter.finish();
    ASSERT_EQ(kept.rows(), (c.rows - c.first - 1) / c.step + 1);
    for (Index k = 0; k < kept.rows(); ++k) {
      for (Index signal = 0; signal < 4; ++signal) {
        // Rounding of a thousand and of sums over all rows between two kept ones.
        EXPECT_NEAR(kept(k, signal), whole(c.first + k * c.step, signal), signal == 1 ? 1e-10 : 1e-11);
      }
    }
  }
}

TEST(DecimatedLowPass, KeepsNothingOfRowsBeforeTheFirstKeptOne) {
  DecimatedLowPass filter(100.0, 5.0, 2, 3, 4, 5);
  const std::vector<double> rows(6, 1.0);
  filter.add(rows.data(), 3);
  EXPECT_EQ(filter.finish().rows(), 0);
}

}  // namespace
}  // namespace heft::data
