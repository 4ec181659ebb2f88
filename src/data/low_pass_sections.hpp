/// @file
/// The fourth-order Butterworth low-pass, one direction of it: two second-order sections, each two trapezoidal integrators.
#pragma once

#include <cmath>
#include <numbers>

#include <Eigen/Core>

namespace heft::data {

/// One second-order section of signals in pairs.
/// H(s) = 1 / (s² + s/Q + 1) with s = (1/g) (z-1)/(z+1), g = tan(π f_c / f_s).
struct LowPassSection {
  /// Two signals: what a processor computes at once.
  using Pair = Eigen::Array2d;
  struct State {
    Pair s1 = Pair::Zero(), s2 = Pair::Zero();
  };

  LowPassSection(double g, double quality) {
    a1 = 1.0 / (1.0 + g * (g + 1.0 / quality));
    a2 = g * a1;
    a3 = g * a2;
  }
  /// The output for the next input. (A call would keep the states in memory: twice the time.)
  [[gnu::always_inline]] Pair step(State& state, const Pair& input) const {
    const Pair v3 = input - state.s2;
    const Pair v1 = a1 * state.s1 + a2 * v3;
    const Pair v2 = state.s2 + a2 * state.s1 + a3 * v3;
    state.s1 = 2.0 * v1 - state.s1;
    state.s2 = 2.0 * v2 - state.s2;
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
