#include "heft/model/couplings.hpp"

#include <fmt/format.h>

#include "heft/host/error.hpp"

namespace heft::model {

void refuse_wrong_couplings(const Robot& robot, const std::vector<GearCoupling<double>>& couplings) {
  const int n = robot.num_joints();
  const auto exists = [n](int joint) { return joint >= 0 && joint < n; };
  for (const GearCoupling<double>& coupling : couplings) {
    if (exists(coupling.driving) && exists(coupling.driven) && coupling.driving != coupling.driven) continue;
    throw ModelError(fmt::format(
        "gear coupling of joints {} and {}: expected two different joints of 1 to {}, as robot \"{}\" has",
        coupling.driving + 1, coupling.driven + 1, n, robot.name));
  }
}

}  // namespace heft::model
