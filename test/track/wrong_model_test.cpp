/// How a model is made wrong.
#include "wrong_model.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "heft/model/physical_links.hpp"
#include "support/arms.hpp"

namespace heft::track {
namespace {

TEST(WrongModel, EveryShareIsWithinTheBoundsAndAnother) {
  const model::Robot right = test::planar_two_link();
  std::vector<double> shares;
  int above = 0;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const model::Robot wrong = wrong_model(right, {0.1, 0.3, seed});
    EXPECT_TRUE(model::has_physical_links(wrong));
    for (std::size_t j = 0; j < right.joints.size(); ++j) {
      const auto &a = right.joints[j].link, &b = wrong.joints[j].link;
      const double mass = b[kMass] / a[kMass], centre = (b[kMcx] / b[kMass]) / (a[kMcx] / a[kMass]);
      for (const double factor : {mass, centre}) {
        shares.push_back(std::abs(factor - 1));
        above += factor > 1 ? 1 : 0;
      }
    }
  }
  ASSERT_EQ(shares.size(), 200U);
  EXPECT_GE(*std::min_element(shares.begin(), shares.end()), 0.1 - 1e-12);
  EXPECT_LE(*std::max_element(shares.begin(), shares.end()), 0.3 + 1e-12);
  EXPECT_LT(*std::min_element(shares.begin(), shares.end()), 0.11);  // of 200 drawn, all but 3e-5 of the time
  EXPECT_GT(*std::max_element(shares.begin(), shares.end()), 0.29);
  EXPECT_EQ(std::set<double>(shares.begin(), shares.end()).size(), shares.size());
  EXPECT_NEAR(above, 100, 35);  // five standard deviations
}

TEST(WrongModel, MovesTheInertiaWithMassAndCentre) {
  // About the centre of mass it is the link's own, times the factor of the mass.
  const model::Robot right = test::planar_two_link(), wrong = wrong_model(right, {0.2, 0.2, 7});
  for (std::size_t j = 0; j < right.joints.size(); ++j) {
    const auto central = [](const InertialParameters<double>& link) {
      return link[kIzz] - (link[kMcx] * link[kMcx] + link[kMcy] * link[kMcy]) / link[kMass];
    };
    const auto &a = right.joints[j].link, &b = wrong.joints[j].link;
    EXPECT_NEAR(central(b), central(a) * b[kMass] / a[kMass], 1e-12) << j;
    EXPECT_NEAR(std::abs(b[kMass] / a[kMass] - 1), 0.2, 1e-12);
  }
}

}  // namespace
}  // namespace heft::track
