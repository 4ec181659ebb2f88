/// Several numbers as one scalar: every lane is what it would be alone.
#include "heft/core/pack.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "heft/core/dynamics/inverse_dynamics.hpp"
#include "heft/core/dynamics/joint_space.hpp"
#include "heft/core/trigonometry.hpp"
#include "support/random_arm.hpp"

namespace heft {
namespace {

// Packs of 16 bytes: what every processor has, and passes in registers.
template <typename T>
inline constexpr int kWidth = static_cast<int>(16 / sizeof(T));

template <typename T>
class PackOf : public ::testing::Test {};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(PackOf, Scalars);

TYPED_TEST(PackOf, ComputesInEveryLaneWhatAScalarDoes) {
  using T = TypeParam;
  constexpr int kW = kWidth<T>;
  using P = Pack<T, kW>;
  std::mt19937_64 random(41);
  std::uniform_real_distribution<T> uniform(T(-4), T(4));
  for (int n = 0; n < 100; ++n) {
    std::array<T, kW> a, b, sum, difference, product, quotient, root, opposite;
    for (int i = 0; i < kW; ++i) a[i] = uniform(random), b[i] = uniform(random);
    const P x = P::load(a.data()), y = P::load(b.data());
    (x + y).store(sum.data()), (x - y).store(difference.data()), (x * y).store(product.data());
    (x / y).store(quotient.data()), sqrt(x).store(root.data()), (-x).store(opposite.data());
    bool greater = true;
    for (int i = 0; i < kW; ++i) {
      EXPECT_EQ(sum[i], a[i] + b[i]);
      EXPECT_EQ(difference[i], a[i] - b[i]);
      EXPECT_EQ(product[i], a[i] * b[i]);
      EXPECT_EQ(quotient[i], a[i] / b[i]);
      EXPECT_EQ(opposite[i], -a[i]);
      EXPECT_TRUE(a[i] < 0 ? std::isnan(root[i]) : root[i] == std::sqrt(a[i])) << a[i];
      constexpr auto kSign = typename P::Word{1} << (8 * sizeof(T) - 1);
      EXPECT_EQ(x.with_bits_changed(kSign)[i], -a[i]);
      EXPECT_EQ(x.with_bits_changed(0)[i], a[i]);
      greater = greater && a[i] > b[i];
    }
    EXPECT_EQ(x > y, greater);
  }
}

TYPED_TEST(PackOf, KeepsTheSignOfZeroOfAConstant) {
  const Pack<TypeParam, kWidth<TypeParam>> minus(TypeParam(-0.0));
  for (int i = 0; i < kWidth<TypeParam>; ++i) EXPECT_TRUE(std::signbit(minus[i]));
}

TYPED_TEST(PackOf, HasTheScalarsSineAndCosineToTheLastBit) {
  using T = TypeParam;
  constexpr int kW = kWidth<T>, kPacks = 3;
  constexpr T kInfinity = std::numeric_limits<T>::infinity();
  std::mt19937_64 random(42);
  for (const T size : {T(1), T(10), T(1e3), T(1.1) * T(kMaxAngleFloat), T(1e6)}) {
    std::uniform_real_distribution<T> uniform(-size, size);
    for (int n = 0; n < 2000; ++n) {
      std::array<T, kW * kPacks> angles;
      for (T& angle : angles) angle = uniform(random);
      if (n % 10 == 0) angles[static_cast<std::size_t>(n) % angles.size()] = n % 20 == 0 ? kInfinity : T(0);
      std::array<SinCos<T>, kW * kPacks> one_by_one;
      sin_cos(angles.data(), one_by_one.data(), kW * kPacks);
      std::array<Pack<T, kW>, kPacks> packs;
      std::array<SinCos<Pack<T, kW>>, kPacks> together;
      for (int p = 0; p < kPacks; ++p) packs[p] = Pack<T, kW>::load(&angles[static_cast<std::size_t>(kW * p)]);
      sin_cos(packs.data(), together.data(), kPacks);
      for (int i = 0; i < kW * kPacks; ++i) {
        const T sine = together[i / kW].sin[i % kW], cosine = together[i / kW].cos[i % kW];
        const SinCos<T>& expected = one_by_one[i];
        EXPECT_TRUE(sine == expected.sin || (std::isnan(sine) && std::isnan(expected.sin))) << angles[i];
        EXPECT_TRUE(cosine == expected.cos || (std::isnan(cosine) && std::isnan(expected.cos))) << angles[i];
      }
    }
  }
}

/// In float, since model::BatchDynamics is tested in double.
TEST(Pack, GivesTheTorqueOfEveryStateInFloat) {
  constexpr int kW = 4;
  using P = Pack<float, kW>;
  test::Random random(43);
  for (int n = 0; n < 50; ++n) {
    const ArmModel<double, 5> model = test::random_arm<5>(random, 0.3);
    ArmModel<float, 5> single;
    for (std::size_t j = 0; j < 5; ++j) {
      single.joints[j].type = model.joints[j].type;
      for (std::size_t k = 0; k < 9; ++k) single.joints[j].rotation[k] = static_cast<float>(model.joints[j].rotation[k]);
      for (std::size_t k = 0; k < 3; ++k) single.joints[j].position[k] = static_cast<float>(model.joints[j].position[k]);
      for (std::size_t k = 0; k < 3; ++k) single.joints[j].axis[k] = static_cast<float>(model.joints[j].axis[k]);
      for (std::size_t k = 0; k < 10; ++k) single.links[j][k] = static_cast<float>(model.links[j][k]);
    }
    const DynamicArm<float, 5> arm(single);
    const DynamicArm<P, 5> arms(arm);
    JointVector<P, 5> q, qd, qdd, tau;
    std::array<JointVector<float, 5>, kW> expected;
    for (int lane = 0; lane < kW; ++lane) {
      const JointVector<float, 5> a = test::random_vector<5>(random, 3).cast<float>(),
                                  b = test::random_vector<5>(random, 2).cast<float>(),
                                  c = test::random_vector<5>(random, 5).cast<float>();
      for (int j = 0; j < 5; ++j) q[j].set(lane, a[j]), qd[j].set(lane, b[j]), qdd[j].set(lane, c[j]);
      expected[static_cast<std::size_t>(lane)] = inverse_dynamics(arm, a, b, c);
    }
    inverse_dynamics(arms, joint_trigonometry<DynamicArm<P, 5>>(q), q, qd, qdd, tau);
    for (int lane = 0; lane < kW; ++lane) {
      for (int j = 0; j < 5; ++j) EXPECT_FLOAT_EQ(tau[j][lane], expected[static_cast<std::size_t>(lane)][j]);
    }
  }
}

TEST(Pack, RefusesAllAccelerationsWhenOneLaneHasNone) {
  using P = Pack<double, 2>;
  MassMatrix<P, 2> mass;
  mass << P(2.0), P(0.5), P(0.5), P(1.0);
  const JointVector<P, 2> none(P(0.0), P(0.0)), tau(P(1.0), P(2.0));
  JointVector<P, 2> qdd(P(7.0), P(7.0));
  mass(1, 1).set(1, 0.1);  // 0.1 < 0.5² / 2
  EXPECT_EQ((forward_dynamics<P, 2>(mass, none, none, tau, qdd)), Status::kNotPositiveDefinite);
  EXPECT_EQ(qdd[0][0], 7.0);
  mass(1, 1).set(1, 1.0);
  EXPECT_EQ((forward_dynamics<P, 2>(mass, none, none, tau, qdd)), Status::kOk);
  EXPECT_DOUBLE_EQ(qdd[0][0], 0.0);  // (2, 0.5; 0.5, 1) (0, 2) = (1, 2)
  EXPECT_DOUBLE_EQ(qdd[1][1], 2.0);
}

}  // namespace
}  // namespace heft
