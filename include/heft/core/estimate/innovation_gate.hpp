/// @file
/// Keeps outliers out by the size of the innovation, and lets in a change that lasts.
#pragma once

#include "heft/core/numeric_range.hpp"

namespace heft {

/// Refuses an innovation beyond `gate` standard deviations, or beyond `gate` times its usual size once that is larger
/// than a standard deviation: after a change of the load, or where the noise was set too small. The usual size follows
/// accepted innovations slowly and grows by a fixed share with each refused one, so that
///
///   outliers stay out while they are less than a fifth of all rows, however large they are;
///   a change that lasts is let in after ln(change / gate) / (4 widening) rows, 60 rows for one of 60 standard
///   deviations with gate 5 and widening 0.01.
template <typename Scalar>
class InnovationGate {
 public:
  /// Back to one standard deviation.
  void reset() noexcept { usual_ = Scalar(1); }

  /// Decides about one row.
  /// @param deviations  |innovation| over its standard deviation; NaN is refused
  /// @param gate        > 0
  /// @param widening    share of the usual size by which it follows a row, 0 to 0.25; 0: a gate of fixed width
  bool refuses(const Scalar& deviations, const Scalar& gate, const Scalar& widening) noexcept {
    const bool refuse = !(deviations <= gate * usual_);
    if (refuse) {
      if (is_usable(usual_ + usual_)) {
        usual_ += Scalar(4) * widening * usual_;
      }
    } else {
      usual_ += widening * (deviations - usual_);
      if (usual_ < Scalar(1)) {
        usual_ = Scalar(1);
      }
    }
    return refuse;
  }

  /// Usual size of an innovation, at least 1 [standard deviations].
  const Scalar& usual() const noexcept { return usual_; }

 private:
  Scalar usual_{1};
};

}  // namespace heft
