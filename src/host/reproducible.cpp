#include "heft/host/reproducible.hpp"

#include <Eigen/Core>

namespace heft::host {

void multiply_alike_everywhere() {
  constexpr std::ptrdiff_t kKibibyte = 1024;
  // Of a processor of today; a smaller or larger one loses little.
  Eigen::setCpuCacheSizes(48 * kKibibyte, 2048 * kKibibyte, 32768 * kKibibyte);
}

}  // namespace heft::host
