#include "lane_kernels.hpp"

namespace heft::model {

LaneArm* make_avx512_arm(int joints, const void* arm) { return make_lane_arm<8>(joints, arm); }

}  // namespace heft::model
