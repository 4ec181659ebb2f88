/// @file
/// The fourth-order Butterworth low-pass, one direction of it: two second-order sections, each two trapezoidal integrators.
#pragma once

#include <cmath>
#include <numbers>

#include <Eigen/Core>

namespace heft::data {

/// One second-order section.
/// H(s) = 1 / (s² + s/Q + 1) with s = (1/g) (z-1)/(z+1), g = tan(π f_c / f_s).
struct LowPassSection {
  LowPassSection(double g, double quality) {
    a1 = 1.0 / (1.0 + g * (g + 1.0 / quality));
    a2 = g * a1;
    a3 = g * a2;
  }
  /// The output for the next input. (A call would keep the states in memory: twice the time.)
  /// @tparam T  a number, or a vector of the compiler
  template <typename T>
  [[gnu::always_inline]] T step(T& s1, T& s2, const T& input) const {
    const T v3 = input - s2;
    const T v1 = a1 * s1 + a2 * v3;
    const T v2 = s2 + a2 * s1 + a3 * v3;
    s1 = 2.0 * v1 - s1;
    s2 = 2.0 * v2 - s2;
    return v2;
  }

  double a1, a2, a3;
};

/// Both sections, one behind the other.
class LowPass {
 public:
  /// Butterworth poles of order 4 at ±22.5° and ±67.5° from the negative real axis: Q = 1/(2 cos θ).
  LowPass(double sample_rate, double cutoff)
      : first_(std::tan(std::numbers::pi * cutoff / sample_rate), 1.0 / (2.0 * std::cos(std::numbers::pi / 8.0))),
        second_(std::tan(std::numbers::pi * cutoff / sample_rate),
                1.0 / (2.0 * std::cos(3.0 * std::numbers::pi / 8.0))) {}

  const LowPassSection& first() const { return first_; }
  const LowPassSection& second() const { return second_; }

 private:
  LowPassSection first_, second_;
};

/// Rows by which a signal of `rows` rows is continued at its ends before it is filtered.
/// The slowest pole decays as exp(-0.38·2π f_c t): 8e-4 is left of the start-up after three periods.
inline Eigen::Index low_pass_padding(Eigen::Index rows, double sample_rate, double cutoff) {
  const double wanted = std::ceil(3.0 * sample_rate / cutoff);
  return wanted < static_cast<double>(rows - 1) ? static_cast<Eigen::Index>(wanted) : rows - 1;
}

}  // namespace heft::data
