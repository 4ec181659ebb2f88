#include "lane_kernels.hpp"

namespace heft::model {

LaneArm* make_avx2_arm(int joints, const void* arm) { return make_lane_arm<4>(joints, arm); }

}  // namespace heft::model
