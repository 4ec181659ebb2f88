/// @file
/// An estimate with its 95 % interval.
#pragma once

#include "heft/host/numbers.hpp"
#include "heft/statistics/distributions.hpp"

namespace heft::statistics {

/// An estimate with its 95 % interval, which need not be symmetric. Units are those of the value.
struct Interval {
  double value{kNaN};
  double std{kNaN};                 ///< standard deviation; NaN: unknown
  double lower{kNaN}, upper{kNaN};  ///< infinite: open on that side

  /// @param factor  half-width in standard deviations, see interval_factor()
  static Interval around(double value, double std, double factor = kNormal95) {
    return {value, std, value - factor * std, value + factor * std};
  }

  double half_width() const { return 0.5 * (upper - lower); }
  bool contains(double x) const { return lower <= x && x <= upper; }
};

/// Of 1/x, for an x that cannot be negative: a stiffness from a compliance. Ends turned over, standard deviation to first
/// order. What is not above 0 counts as 0: as the lower end it leaves the reciprocal open above, as the value it makes it
/// infinite without a standard deviation; an upper end there leaves 0 as the lower one.
Interval reciprocal(const Interval& x);

/// Mean of a Poisson distribution from one count: the exact interval of Garwood (1936). Zero counted gives 0 to 3.69.
/// @param count  0 or more
Interval count_interval(long count);

}  // namespace heft::statistics
