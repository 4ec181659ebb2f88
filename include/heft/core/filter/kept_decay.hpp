/// @file
/// An exponential that is computed anew only when its argument changes.
#pragma once

#include <cmath>

namespace heft {

/// e^{−x} of a step x: a loop whose period stands still computes it once.
template <typename Scalar>
class KeptDecay {
 public:
  /// @param x  ≥ 0
  Scalar operator()(const Scalar& x) noexcept {
    if (!(x == x_)) {
      using std::exp;
      x_ = x;
      decay_ = exp(-x);
    }
    return decay_;
  }

 private:
  Scalar x_{0}, decay_{1};
};

}  // namespace heft
