#include "heft/core/structural.hpp"

#include <type_traits>

#include <gtest/gtest.h>

namespace heft::structural {
namespace {

TEST(Structural, ProductsWithKnownZerosVanishByType) {
  static_assert(std::is_same_v<decltype(Zero{} * 2.0), Zero>);
  static_assert(std::is_same_v<decltype(2.0F * Zero{}), Zero>);
  static_assert(std::is_same_v<decltype(Zero{} + 2.0), double>);
  static_assert(std::is_same_v<decltype(Zero{} * Int<-1>{}), Zero>);
  static_assert(std::is_same_v<decltype(One{} + One{}), Int<2>>);
  EXPECT_EQ(One{} * 3.5, 3.5);
  EXPECT_EQ(Int<-1>{} * 3.5, -3.5);
  EXPECT_EQ(Int<2>{} * 3.5, 7.0);
  EXPECT_EQ(One{} + 3.5, 4.5);
  EXPECT_EQ(One{} - 3.5, -2.5);
  EXPECT_EQ(3.5 - One{}, 2.5);
}

TEST(Structural, CrossProductOfCoordinateAxesIsKnownByType) {
  const auto x = vec3(One{}, Zero{}, Zero{});
  const auto y = vec3(Zero{}, One{}, Zero{});
  using Product = decltype(cross(x, y));
  static_assert(kIsZero<decltype(Product::x)> && kIsZero<decltype(Product::y)> &&
                kIs<decltype(Product::z), 1>);
}

TEST(Structural, DenseAndTypedMatricesAgree) {
  const double a = 0.3, b = -1.7;
  const auto typed = mat3(vec3(a, Zero{}, One{}), vec3(Zero{}, Int<-1>{}, b), vec3(b, a, Zero{}));
  const auto dense_matrix = mat3(vec3(a, 0.0, 1.0), vec3(0.0, -1.0, b), vec3(b, a, 0.0));
  const auto v = vec3(2.0, 3.0, 5.0);
  const auto p = dense<double>(typed * v);
  const auto q = dense_matrix * v;
  EXPECT_EQ(p.x, q.x);
  EXPECT_EQ(p.y, q.y);
  EXPECT_EQ(p.z, q.z);
  const auto pt = dense<double>(transpose_times(typed, v));
  const auto qt = transpose_times(dense_matrix, v);
  EXPECT_EQ(pt.x, qt.x);
  EXPECT_EQ(pt.y, qt.y);
  EXPECT_EQ(pt.z, qt.z);
}

constexpr std::array<double, 4> kTable = {1.0 + 1e-14, 6.1e-17, -1.0, 0.25};

TEST(Structural, ConstantsWithTheDirtOfRightAnglesBecomeWholeNumbers) {
  static_assert(kIs<decltype(constant<double, kTable, 0>()), 1>);
  static_assert(kIs<decltype(constant<double, kTable, 1>()), 0>);
  static_assert(kIs<decltype(constant<double, kTable, 2>()), -1>);
  EXPECT_EQ((constant<double, kTable, 3>()), 0.25);
}

}  // namespace
}  // namespace heft::structural
