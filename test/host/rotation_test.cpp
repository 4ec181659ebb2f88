#include "heft/host/rotation.hpp"

#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/LU>

namespace heft {
namespace {

TEST(RotationFromZ, IsTheShortestOneInEveryDirection) {
  for (const double z : {1.0, 0.3, 0.0, -0.6, -1.0 + 1e-9, -1.0 + 1e-15, -1.0}) {
    for (const double turn : {0.0, 0.7, 2.5, -1.9}) {
      const double side = std::sqrt((1 - z) * (1 + z));
      const Eigen::Vector3d d(side * std::cos(turn), side * std::sin(turn), z);
      const Eigen::Matrix3d R = rotation_from_z(3.0 * d);
      EXPECT_LT((R.col(2) - d).norm(), 1e-15) << d.transpose();
      EXPECT_LT((R * R.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-15) << d.transpose();
      EXPECT_NEAR(R.determinant(), 1.0, 1e-15);
      // The angle, from the trace, is the one between z and d.
      EXPECT_NEAR(R.trace(), 1.0 + 2.0 * z, 1e-14) << d.transpose();
    }
  }
}

}  // namespace
}  // namespace heft
