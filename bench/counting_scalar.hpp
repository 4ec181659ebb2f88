/// @file
/// A scalar that computes as double does and counts every operation on the way.
#pragma once

#include <cmath>
#include <concepts>
#include <cstdint>

#include <Eigen/Core>

#include "heft/core/trigonometry.hpp"

namespace heft::bench {

/// Operations counted so far, by kind.
struct OperationCount {
  std::int64_t mul{0};
  std::int64_t add{0};  ///< additions and subtractions
  std::int64_t div{0};
  std::int64_t sqrt{0};
  std::int64_t trig{0};  ///< single sines and cosines, and calls of libm
  std::int64_t neg{0};   ///< sign changes: folded into additions by any compiler
  std::int64_t cmp{0};   ///< comparisons

  OperationCount& operator+=(const OperationCount& o) {
    mul += o.mul;
    add += o.add;
    div += o.div;
    sqrt += o.sqrt;
    trig += o.trig;
    neg += o.neg;
    cmp += o.cmp;
    return *this;
  }
  friend OperationCount operator-(OperationCount a, const OperationCount& b) {
    a.mul -= b.mul;
    a.add -= b.add;
    a.div -= b.div;
    a.sqrt -= b.sqrt;
    a.trig -= b.trig;
    a.neg -= b.neg;
    a.cmp -= b.cmp;
    return a;
  }
};

/// The counter all Counted numbers of this thread write to.
inline OperationCount& counter() {
  thread_local OperationCount count;
  return count;
}

/// A double that counts.
class Counted {
 public:
  constexpr Counted() = default;
  constexpr Counted(double v)
      : value_(v) {}  // NOLINT(google-explicit-constructor): constants read as in production code
  template <std::integral Whole>
  constexpr explicit Counted(Whole v) : value_(static_cast<double>(v)) {}
  constexpr double value() const { return value_; }
  constexpr explicit operator double() const { return value_; }
  template <std::integral Whole>
  constexpr explicit operator Whole() const {
    return static_cast<Whole>(value_);
  }

  friend Counted operator+(Counted a, Counted b) {
    ++counter().add;
    return Counted(a.value_ + b.value_);
  }
  friend Counted operator-(Counted a, Counted b) {
    ++counter().add;
    return Counted(a.value_ - b.value_);
  }
  friend Counted operator*(Counted a, Counted b) {
    ++counter().mul;
    return Counted(a.value_ * b.value_);
  }
  friend Counted operator/(Counted a, Counted b) {
    ++counter().div;
    return Counted(a.value_ / b.value_);
  }
  friend Counted operator-(Counted a) {
    ++counter().neg;
    return Counted(-a.value_);
  }
  Counted& operator+=(Counted b) { return *this = *this + b; }
  Counted& operator-=(Counted b) { return *this = *this - b; }
  Counted& operator*=(Counted b) { return *this = *this * b; }
  Counted& operator/=(Counted b) { return *this = *this / b; }
  friend bool operator<(Counted a, Counted b) {
    ++counter().cmp;
    return a.value_ < b.value_;
  }
  friend bool operator>(Counted a, Counted b) {
    ++counter().cmp;
    return a.value_ > b.value_;
  }
  friend bool operator<=(Counted a, Counted b) {
    ++counter().cmp;
    return a.value_ <= b.value_;
  }
  friend bool operator>=(Counted a, Counted b) {
    ++counter().cmp;
    return a.value_ >= b.value_;
  }
  friend bool operator==(Counted a, Counted b) {
    ++counter().cmp;
    return a.value_ == b.value_;
  }
  friend bool operator!=(Counted a, Counted b) {
    ++counter().cmp;
    return a.value_ != b.value_;
  }

 private:
  double value_{0};
};

inline Counted sqrt(Counted a) {
  ++counter().sqrt;
  return Counted(std::sqrt(a.value()));
}
/// Functions of libm count as one call each, as a sine does.
inline Counted exp(Counted a) {
  ++counter().trig;
  return Counted(std::exp(a.value()));
}
inline Counted sin(Counted a) {
  ++counter().trig;
  return Counted(std::sin(a.value()));
}
inline Counted pow(Counted a, Counted b) {
  ++counter().trig;
  return Counted(std::pow(a.value(), b.value()));
}
inline Counted abs(Counted a) { return Counted(std::abs(a.value())); }
inline bool isfinite(Counted a) { return std::isfinite(a.value()); }

}  // namespace heft::bench

namespace heft {

/// Counts a sine and a cosine an angle; what happens inside them is production code for double.
inline void sin_cos(const bench::Counted* angles, SinCos<bench::Counted>* results, int count) noexcept {
  for (int i = 0; i < count; ++i) {
    const double angle = angles[i].value();
    SinCos<double> one{};
    sin_cos(&angle, &one, 1);
    results[i] = {bench::Counted(one.sin), bench::Counted(one.cos)};
    bench::counter().trig += 2;
  }
}

}  // namespace heft

namespace Eigen {
template <>
struct NumTraits<heft::bench::Counted> : NumTraits<double> {
  using Real = heft::bench::Counted;
  using NonInteger = heft::bench::Counted;
  using Nested = heft::bench::Counted;
  using Literal = heft::bench::Counted;
  enum {
    IsComplex = 0,
    IsInteger = 0,
    IsSigned = 1,
    RequireInitialization = 1,
    ReadCost = 1,
    AddCost = 1,
    MulCost = 1
  };
};
}  // namespace Eigen
