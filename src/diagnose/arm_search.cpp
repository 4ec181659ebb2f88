#include "arm_search.hpp"

#include <numeric>

namespace heft::diagnose {

std::vector<int> all_joints(int n) {
  std::vector<int> joints(static_cast<std::size_t>(n));
  std::iota(joints.begin(), joints.end(), 0);
  return joints;
}

Columns columns_of_pair(const GearCoupling<double>& pair, const Eigen::MatrixXd& torque) {
  return {{pair.driving, pair.driven}, {pair.ratio * torque, torque}};
}

Trial judge(const Workbench& bench, const Candidate& candidate, double least) {
  return bench.problem->judge(bench.problem->moments(candidate.columns), -1, 0, least);
}

}  // namespace heft::diagnose
