/// @file
/// Several numbers side by side as one scalar, so that core's templates work on several states at once.
///
/// `DynamicArm<Pack<double, 8>, 6>` is eight arms of the same kind, `JointVector<Pack<double, 8>, 6>` eight joint
/// vectors, and `inverse_dynamics` of them eight torques, by the same source as one. Every lane sees the same
/// operations in the same order as a scalar would, so its result is the scalar's to the last bit, as long as the
/// compiler does not fuse products and sums (-ffp-contract=off, or a target without fused instructions). Templates that
/// decide by a number (DynamicArm::set_model) do not compile for packs: make a scalar arm and convert it.
///
/// How wide a pack pays off is the machine's affair: 16 bytes on SSE2 and NEON, 32 on AVX2, 64 on AVX-512. Wider ones
/// are correct everywhere and slow. Code that is compiled for another instruction set than the rest of a program must
/// use a width of its own: the type is then its own too, and the linker cannot give its functions to others.
/// model::BatchDynamics does all this for a host.
#pragma once

#include <bit>
#include <cstdint>
#include <type_traits>

#include <Eigen/Core>

namespace heft {
namespace detail {

/// The compiler's vector types. (They need a class of their own: GCC 12 takes an attribute that depends on a template
/// parameter for the type without it where functions are overloaded.)
template <typename T, int W>
struct VectorOf {
  typedef T Type __attribute__((vector_size(sizeof(T) * W)));
  /// The same at any address that a T may have.
  typedef T Loose __attribute__((vector_size(sizeof(T) * W), aligned(alignof(T)), may_alias));
};

}  // namespace detail

/// W numbers of type T.
///
/// @tparam T  float or double
/// @tparam W  a power of two
template <typename T, int W>
class Pack {
 public:
  using Lanes = typename detail::VectorOf<T, W>::Type;
  using Element = T;
  static constexpr int kWidth = W;

  Pack() = default;
  explicit Pack(const Lanes& lanes) noexcept : lanes_(lanes) {}
  /// The same number in every lane: constants read as in scalar code. (x − 0 is x, the sign of a zero included.)
  Pack(T value) noexcept : lanes_(value - Lanes{}) {}  // NOLINT(google-explicit-constructor)
  template <typename Number>
  requires(std::is_arithmetic_v<Number> && !std::is_same_v<Number, T>)
  explicit Pack(Number value) noexcept : Pack(static_cast<T>(value)) {}

  /// W numbers from `from` on, which need no more than the alignment of a T.
  static Pack load(const T* from) noexcept {
    return Pack(Lanes(*reinterpret_cast<const typename detail::VectorOf<T, W>::Loose*>(from)));
  }
  void store(T* to) const noexcept {
    *reinterpret_cast<typename detail::VectorOf<T, W>::Loose*>(to) = lanes_;
  }

  const Lanes& lanes() const noexcept { return lanes_; }
  T operator[](int lane) const noexcept { return lanes_[lane]; }
  void set(int lane, T value) noexcept { lanes_[lane] = value; }

  friend Pack operator+(const Pack& a, const Pack& b) noexcept { return Pack(Lanes(a.lanes_ + b.lanes_)); }
  friend Pack operator-(const Pack& a, const Pack& b) noexcept { return Pack(Lanes(a.lanes_ - b.lanes_)); }
  friend Pack operator*(const Pack& a, const Pack& b) noexcept { return Pack(Lanes(a.lanes_ * b.lanes_)); }
  friend Pack operator/(const Pack& a, const Pack& b) noexcept { return Pack(Lanes(a.lanes_ / b.lanes_)); }
  friend Pack operator-(const Pack& a) noexcept { return Pack(Lanes(-a.lanes_)); }
  Pack& operator+=(const Pack& b) noexcept { return *this = *this + b; }
  Pack& operator-=(const Pack& b) noexcept { return *this = *this - b; }
  Pack& operator*=(const Pack& b) noexcept { return *this = *this * b; }
  Pack& operator/=(const Pack& b) noexcept { return *this = *this / b; }

  /// True when it is so in every lane: code that asks `!(pivot > 0)` refuses the pack when one lane is to be refused.
  /// There is no other comparison, since code that takes one of two ways cannot take both.
  friend bool operator>(const Pack& a, const Pack& b) noexcept {
    bool all = true;
    for (int i = 0; i < W; ++i) all = all && a.lanes_[i] > b.lanes_[i];
    return all;
  }

  /// The bits of an element, as a whole number.
  using Word = std::conditional_t<sizeof(T) == 8, std::uint64_t, std::uint32_t>;
  /// Changes the same bits in every lane: the highest is the sign, also that of zero.
  Pack with_bits_changed(Word bits) const noexcept {
    using Words = typename detail::VectorOf<Word, W>::Type;
    return Pack(std::bit_cast<Lanes>(Words(std::bit_cast<Words>(lanes_) ^ bits)));
  }

  friend Pack sqrt(const Pack& a) noexcept {
    Pack root;
    for (int i = 0; i < W; ++i) root.lanes_[i] = root_of(a.lanes_[i]);
    return root;
  }

 private:
  static double root_of(double x) noexcept { return __builtin_sqrt(x); }
  static float root_of(float x) noexcept { return __builtin_sqrtf(x); }

  Lanes lanes_;
};

}  // namespace heft

namespace Eigen {

template <typename T, int W>
struct NumTraits<heft::Pack<T, W>> : NumTraits<T> {
  using Real = heft::Pack<T, W>;
  using NonInteger = heft::Pack<T, W>;
  using Nested = heft::Pack<T, W>;
  using Literal = heft::Pack<T, W>;
  enum {
    IsComplex = 0,
    IsInteger = 0,
    IsSigned = 1,
    RequireInitialization = 0,
    ReadCost = 1,
    AddCost = 1,
    MulCost = 1
  };
};

}  // namespace Eigen
