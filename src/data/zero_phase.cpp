#include <array>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "heft/data/differentiate.hpp"
#include "heft/host/error.hpp"

namespace heft::data {
namespace {

using Eigen::Index;

/// One second-order low-pass section as two trapezoidal integrators.
/// H(s) = 1 / (s² + s/Q + 1) with s = (1/g) (z-1)/(z+1), g = tan(π f_c / f_s).
struct Section {
  double a1, a2, a3;
  double state1{0.0}, state2{0.0};

  Section(double g, double quality) {
    a1 = 1.0 / (1.0 + g * (g + 1.0 / quality));
    a2 = g * a1;
    a3 = g * a2;
  }

  /// State that holds the constant input `value` for ever.
  void rest_at(double value) {
    state1 = 0.0;
    state2 = value;
  }

  double step(double input) {
    const double v3 = input - state2;
    const double v1 = a1 * state1 + a2 * v3;
    const double v2 = state2 + a2 * state1 + a3 * v3;
    state1 = 2.0 * v1 - state1;
    state2 = 2.0 * v2 - state2;
    return v2;
  }
};

}  // namespace

Eigen::MatrixXd low_pass_zero_phase(const Eigen::MatrixXd& signal, double sample_rate, double cutoff) {
  if (!(cutoff > 0.0 && cutoff < 0.5 * sample_rate)) {
    throw DataError(
        fmt::format("cut-off {:.6g} Hz at a sample rate of {:.6g} Hz; expected more than 0 and less than "
                    "half the rate, {:.6g} Hz; choose another cut-off",
                    cutoff, sample_rate, 0.5 * sample_rate));
  }
  const Index n = signal.rows();
  if (n < 2) return signal;
  // The slowest pole decays as exp(-0.38·2π f_c t): 8e-4 is left of the start-up after three periods.
  const double wanted = std::ceil(3.0 * sample_rate / cutoff);
  const Index pad = wanted < static_cast<double>(n - 1) ? static_cast<Index>(wanted) : n - 1;

  const double g = std::tan(std::numbers::pi * cutoff / sample_rate);
  // Butterworth poles of order 4 at ±22.5° and ±67.5° from the negative real axis: Q = 1/(2 cos θ).
  const std::array<double, 2> quality{1.0 / (2.0 * std::cos(std::numbers::pi / 8.0)),
                                      1.0 / (2.0 * std::cos(3.0 * std::numbers::pi / 8.0))};
  const auto run = [&](Eigen::VectorXd& x, bool backwards) {
    Section first(g, quality[0]);
    Section second(g, quality[1]);
    const Index count = x.size();
    const double start = backwards ? x[count - 1] : x[0];
    first.rest_at(start);
    second.rest_at(start);
    for (Index step = 0; step < count; ++step) {
      double& value = x[backwards ? count - 1 - step : step];
      value = second.step(first.step(value));
    }
  };

  Eigen::MatrixXd result(n, signal.cols());
  Eigen::VectorXd padded(n + 2 * pad);
  for (Index column = 0; column < signal.cols(); ++column) {
    const auto x = signal.col(column);
    for (Index k = 0; k < pad; ++k) {
      padded[k] = 2.0 * x[0] - x[pad - k];
      padded[pad + n + k] = 2.0 * x[n - 1] - x[n - 2 - k];
    }
    padded.segment(pad, n) = x;
    run(padded, false);
    run(padded, true);
    result.col(column) = padded.segment(pad, n);
  }
  return result;
}

}  // namespace heft::data
