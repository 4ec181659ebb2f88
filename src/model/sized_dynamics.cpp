#include "heft/model/sized_dynamics.hpp"

namespace heft {
HEFT_DYNAMICS_OF_ALL_SIZES()
}  // namespace heft
