/// @file
/// Arithmetic that knows its zeros and ones at compile time.
///
/// The dynamics are written once, over vectors whose three components may have different types. A component
/// is either a Scalar or an `Int<K>`, a number known from its type. Products with `Int<0>` and sums with it
/// vanish, products with `Int<1>` and `Int<-1>` are copies: for a compile-time geometry the zero pattern of
/// every rotation and offset runs through the whole recursion and only what is left is computed. For a
/// run-time geometry every component is a Scalar and the same source is ordinary dense arithmetic.
#pragma once

#include <array>
#include <cstddef>
#include <type_traits>

namespace heft::structural {

/// The whole number K as a type.
template <int K>
struct Int {};

using Zero = Int<0>;
using One = Int<1>;

template <typename T>
struct IsInt : std::false_type {};
template <int K>
struct IsInt<Int<K>> : std::true_type {};

/// True for Int<K> of any K.
template <typename T>
inline constexpr bool kIsInt = IsInt<std::remove_cvref_t<T>>::value;
/// True for Int<K> of this K.
template <typename T, int K>
inline constexpr bool kIs = std::is_same_v<std::remove_cvref_t<T>, Int<K>>;
/// True for the known zero.
template <typename T>
inline constexpr bool kIsZero = kIs<T, 0>;

template <typename A, typename B>
concept EitherInt = kIsInt<A> || kIsInt<B>;

// The operators live in the namespace of Int, so that argument-dependent lookup finds them for any Scalar.

template <int K>
constexpr Int<-K> operator-(Int<K>) {
  return {};
}

template <typename A, typename B>
requires EitherInt<A, B>
constexpr auto operator*(const A& a, const B& b) {
  if constexpr (kIsZero<A> || kIsZero<B>) {
    return Zero{};
  } else if constexpr (kIs<A, 1>) {
    return b;
  } else if constexpr (kIs<B, 1>) {
    return a;
  } else if constexpr (kIs<A, -1>) {
    return -b;
  } else if constexpr (kIs<B, -1>) {
    return -a;
  } else if constexpr (kIs<A, 2>) {
    return b + b;
  } else if constexpr (kIs<B, 2>) {
    return a + a;
  } else {
    static_assert(kIsZero<A>, "this whole number does not occur in the dynamics");
  }
}

template <typename A, typename B>
requires EitherInt<A, B>
constexpr auto operator+(const A& a, const B& b) {
  if constexpr (kIsZero<A>) {
    return b;
  } else if constexpr (kIsZero<B>) {
    return a;
  } else if constexpr (kIsInt<A> && kIsInt<B>) {
    return []<int KA, int KB>(Int<KA>, Int<KB>) { return Int<KA + KB>{}; }(a, b);
  } else if constexpr (kIsInt<A>) {
    return []<int KA>(Int<KA>, const B& v) { return B(KA) + v; }(a, b);
  } else {
    return b + a;
  }
}

template <typename A, typename B>
requires EitherInt<A, B>
constexpr auto operator-(const A& a, const B& b) {
  if constexpr (kIsZero<B>) {
    return a;
  } else {
    return a + (-b);
  }
}

/// The number as a Scalar.
template <typename Scalar, typename T>
constexpr Scalar value(const T& x) {
  if constexpr (kIsInt<T>) {
    return []<int K>(Int<K>) { return Scalar(K); }(x);
  } else {
    return x;
  }
}

/// A vector of three components, each of its own type.
template <typename X, typename Y, typename Z>
struct Vec3 {
  [[no_unique_address]] X x;
  [[no_unique_address]] Y y;
  [[no_unique_address]] Z z;
};

// Members of equal empty type may not share an address, so a vector of zeros still takes a few bytes; the
// optimiser removes them.
template <typename X, typename Y, typename Z>
constexpr Vec3<X, Y, Z> vec3(const X& x, const Y& y, const Z& z) {
  return {x, y, z};
}

/// The vector of zeros.
using Zero3 = Vec3<Zero, Zero, Zero>;

/// A vector of three ordinary scalars.
template <typename Scalar>
using Dense3 = Vec3<Scalar, Scalar, Scalar>;

/// Every component as a Scalar.
template <typename Scalar, typename X, typename Y, typename Z>
constexpr Dense3<Scalar> dense(const Vec3<X, Y, Z>& v) {
  return {value<Scalar>(v.x), value<Scalar>(v.y), value<Scalar>(v.z)};
}

template <typename X, typename Y, typename Z>
constexpr auto operator-(const Vec3<X, Y, Z>& a) {
  return vec3(-a.x, -a.y, -a.z);
}

template <typename AX, typename AY, typename AZ, typename BX, typename BY, typename BZ>
constexpr auto operator+(const Vec3<AX, AY, AZ>& a, const Vec3<BX, BY, BZ>& b) {
  return vec3(a.x + b.x, a.y + b.y, a.z + b.z);
}

template <typename AX, typename AY, typename AZ, typename BX, typename BY, typename BZ>
constexpr auto operator-(const Vec3<AX, AY, AZ>& a, const Vec3<BX, BY, BZ>& b) {
  return vec3(a.x - b.x, a.y - b.y, a.z - b.z);
}

/// Vector times number.
template <typename X, typename Y, typename Z, typename S>
constexpr auto scale(const Vec3<X, Y, Z>& a, const S& s) {
  return vec3(a.x * s, a.y * s, a.z * s);
}

template <typename AX, typename AY, typename AZ, typename BX, typename BY, typename BZ>
constexpr auto dot(const Vec3<AX, AY, AZ>& a, const Vec3<BX, BY, BZ>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

template <typename AX, typename AY, typename AZ, typename BX, typename BY, typename BZ>
constexpr auto cross(const Vec3<AX, AY, AZ>& a, const Vec3<BX, BY, BZ>& b) {
  return vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

/// A 3 × 3 matrix by rows, each a Vec3.
template <typename R0, typename R1, typename R2>
struct Mat3 {
  [[no_unique_address]] R0 row0;
  [[no_unique_address]] R1 row1;
  [[no_unique_address]] R2 row2;
};

template <typename R0, typename R1, typename R2>
constexpr Mat3<R0, R1, R2> mat3(const R0& r0, const R1& r1, const R2& r2) {
  return {r0, r1, r2};
}

/// Matrix times vector.
template <typename R0, typename R1, typename R2, typename X, typename Y, typename Z>
constexpr auto operator*(const Mat3<R0, R1, R2>& m, const Vec3<X, Y, Z>& v) {
  return vec3(dot(m.row0, v), dot(m.row1, v), dot(m.row2, v));
}

/// Transposed matrix times vector.
template <typename R0, typename R1, typename R2, typename X, typename Y, typename Z>
constexpr auto transpose_times(const Mat3<R0, R1, R2>& m, const Vec3<X, Y, Z>& v) {
  return scale(m.row0, v.x) + scale(m.row1, v.y) + scale(m.row2, v.z);
}

/// Numbers closer than this to 0 or ±1 are taken as 0 or ±1 when a constant becomes a type: geometry and
/// inertia come from decimal text or from cosines of right angles and carry that much dirt.
inline constexpr double kSnap = 1e-12;

/// 0, 1 or -1 for a number that is one of these, 2 for any other.
constexpr int whole_number_class(double v) noexcept {
  if (v < kSnap && v > -kSnap) {
    return 0;
  }
  if (v - 1 < kSnap && v - 1 > -kSnap) {
    return 1;
  }
  return v + 1 < kSnap && v + 1 > -kSnap ? -1 : 2;
}

template <typename Scalar, int kClass>
constexpr auto classified(double v) {
  if constexpr (kClass == 2) {
    return Scalar(v);
  } else {
    static_cast<void>(v);
    return Int<kClass>{};
  }
}

/// The entry I of a constexpr table as an Int or a Scalar.
template <typename Scalar, const auto& kTable, int I>
constexpr auto constant() {
  return classified<Scalar, whole_number_class(kTable[static_cast<std::size_t>(I)])>(
      kTable[static_cast<std::size_t>(I)]);
}

/// Three entries from I on as a vector.
template <typename Scalar, const auto& kTable, int I>
constexpr auto constant3() {
  return vec3(constant<Scalar, kTable, I>(), constant<Scalar, kTable, I + 1>(),
              constant<Scalar, kTable, I + 2>());
}

}  // namespace heft::structural
