/// Bodies that can exist, and the eigenvalues behind it.
#include <array>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "heft/core/denavit_hartenberg.hpp"
#include "heft/core/physical_body.hpp"
#include "support/random_arm.hpp"

namespace heft {
namespace {

template <typename Scalar>
class PhysicalBody : public ::testing::Test {};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(PhysicalBody, Scalars);

template <typename Scalar>
constexpr double kRounding = std::is_same_v<Scalar, float> ? 2e-6 : 4e-15;

/// V D Vᵀ from a product of three turns and eigenvalues over many orders of magnitude, so both are known.
TYPED_TEST(PhysicalBody, EigenvaluesAndVectorsRebuildTheMatrix) {
  using Scalar = TypeParam;
  test::Random random(3);
  for (int n = 0; n < 2000; ++n) {
    Matrix3<Scalar> A;
    const double scale = std::pow(10.0, test::uniform(random, -12, 12));
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j <= i; ++j) {
        const double spread = std::pow(10.0, n % 4 == 0 ? test::uniform(random, -6, 0) : 0.0);
        A(i, j) = A(j, i) = n % 7 == 0 && i != j
                                ? Scalar(0)
                                : static_cast<Scalar>(scale * spread * test::uniform(random, -1, 1));
      }
    }
    SymmetricEigen<Scalar> found;
    ASSERT_EQ(symmetric_eigen(A, found), Status::kOk);
    const Matrix3<Scalar> rebuilt = found.vectors * found.values.asDiagonal() * found.vectors.transpose();
    const double size = static_cast<double>(A.cwiseAbs().maxCoeff());
    EXPECT_LE(static_cast<double>((rebuilt - A).cwiseAbs().maxCoeff()), kRounding<Scalar> * size) << A;
    EXPECT_LE(
        static_cast<double>(
            (found.vectors.transpose() * found.vectors - Matrix3<Scalar>::Identity()).cwiseAbs().maxCoeff()),
        kRounding<Scalar>);
  }
}

TYPED_TEST(PhysicalBody, EigenRefusesWhatIsNotFiniteAndKeepsItsOutput) {
  using Scalar = TypeParam;
  SymmetricEigen<Scalar> found;
  found.values[0] = Scalar(7);
  for (const Scalar bad : {std::numeric_limits<Scalar>::quiet_NaN(), std::numeric_limits<Scalar>::infinity(),
                           std::numeric_limits<Scalar>::max()}) {
    Matrix3<Scalar> A = Matrix3<Scalar>::Identity();
    A(2, 1) = bad;
    EXPECT_EQ(symmetric_eigen(A, found), Status::kNonFiniteInput);
    EXPECT_EQ(found.values[0], Scalar(7));
  }
}

TYPED_TEST(PhysicalBody, PointsRodsPlatesAndSolidsExist) {
  using Scalar = TypeParam;
  const auto check = [](Scalar m, std::array<Scalar, 3> c, std::array<Scalar, 6> about_com) {
    return check_physical(make_inertial_parameters<Scalar>(m, c, about_com));
  };
  const Scalar t = static_cast<Scalar>(0.01);
  const std::array<Scalar, 3> c{static_cast<Scalar>(0.3), static_cast<Scalar>(-0.1),
                                static_cast<Scalar>(0.2)};
  EXPECT_EQ(check(2, c, {}), Status::kOk);                  // a point
  EXPECT_EQ(check(2, c, {0, 0, t, 0, 0, t}), Status::kOk);  // a rod
  EXPECT_EQ(check(2, c, {t, 0, t, 0, 0, 2 * t}), Status::kOk);
  EXPECT_EQ(check(2, c, {t, 0, t, 0, 0, t}), Status::kOk);
  EXPECT_EQ(check_physical(InertialParameters<Scalar>{}), Status::kOk);  // none
}

TYPED_TEST(PhysicalBody, WhatNoBodyHasIsRefused) {
  using Scalar = TypeParam;
  const Scalar t = static_cast<Scalar>(0.01);
  EXPECT_EQ(check_physical(make_inertial_parameters<Scalar>(-1, {}, {t, 0, t, 0, 0, t})),
            Status::kNotPositiveDefinite);
  EXPECT_EQ(check_physical(make_inertial_parameters<Scalar>(0, {}, {t, 0, t, 0, 0, t})),
            Status::kNotPositiveDefinite);
  // Positive moments of inertia that break the triangle inequality.
  EXPECT_EQ(check_physical(make_inertial_parameters<Scalar>(1, {}, {t, 0, t, 0, 0, 3 * t})),
            Status::kNotPositiveDefinite);
  InertialParameters<Scalar> p = make_inertial_parameters<Scalar>(1, {}, {t, 0, t, 0, 0, t});
  p[kMcy] = std::numeric_limits<Scalar>::quiet_NaN();
  EXPECT_EQ(check_physical(p), Status::kNonFiniteInput);
}

TYPED_TEST(PhysicalBody, TheNearestBodyExistsKeepsTheMassAndLeavesABodyAlone) {
  using Scalar = TypeParam;
  test::Random random(5);
  const Scalar reach = static_cast<Scalar>(0.4);
  int changed = 0;
  for (int n = 0; n < 500; ++n) {
    InertialParameters<Scalar> p;
    for (Scalar& value : p) value = static_cast<Scalar>(test::uniform(random, -1, 1));
    p[kMass] = static_cast<Scalar>(test::uniform(random, 0.1, 5));
    InertialParameters<Scalar> body = p;
    ASSERT_EQ(make_physical(body, reach), Status::kOk);
    EXPECT_EQ(check_physical(body), Status::kOk);
    EXPECT_EQ(body[kMass], p[kMass]);
    changed += body != p ? 1 : 0;
    InertialParameters<Scalar> again = body;
    ASSERT_EQ(make_physical(again, static_cast<Scalar>(1.0001) * reach), Status::kOk);
    for (std::size_t i = 0; i < 10; ++i) {
      EXPECT_NEAR(static_cast<double>(again[i]), static_cast<double>(body[i]), kRounding<Scalar>);
    }
  }
  EXPECT_GT(changed, 400);
  InertialParameters<Scalar> negative{};
  negative[kMass] = Scalar(-1);
  ASSERT_EQ(make_physical(negative, reach), Status::kOk);
  EXPECT_EQ(negative, InertialParameters<Scalar>{});
}

}  // namespace
}  // namespace heft
