#include "heft/statistics/interval.hpp"

namespace heft::statistics {

Interval reciprocal(const Interval& x) {
  Interval turned{kInfinity, kNaN, 0.0, kInfinity};
  if (x.value > 0.0) {
    turned.value = 1.0 / x.value;
    turned.std = x.std / (x.value * x.value);
  }
  if (x.upper > 0.0) turned.lower = 1.0 / x.upper;
  if (x.lower > 0.0) turned.upper = 1.0 / x.lower;
  return turned;
}

}  // namespace heft::statistics
