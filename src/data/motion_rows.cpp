#include "heft/data/motion_rows.hpp"

#include <fmt/format.h>

#include "heft/host/error.hpp"

namespace heft::data {

void refuse_many_rows(double duration, double rate) {
  if (duration * rate <= kMostMotionRows) return;
  throw ModelError(
      fmt::format("{:g} s at {:g} Hz: found {:.3g} rows, expected at most {:g}; take a lower rate", duration,
                  rate, duration * rate, kMostMotionRows));
}

}  // namespace heft::data
