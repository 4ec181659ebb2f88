#include "lane_kernels.hpp"

namespace heft::model {

LaneArm* make_baseline_arm(int joints, const void* arm) { return make_lane_arm<2>(joints, arm); }

}  // namespace heft::model
