#include "heft/model/run_time_arm.hpp"

#include <cstddef>
#include <string>

#include "heft/host/error.hpp"

namespace heft::model {

void hand_parts(const Robot& robot, PartsTaker& model) {
  const auto hand = [&](const auto& parts, const char* name, int most, const char* expected) {
    for (const auto& part : parts) {
      if (model.add(part) == Status::kOk) continue;
      throw ModelError("robot \"" + robot.name + "\" has " + std::to_string(parts.size()) + name + " on " +
                       std::to_string(robot.num_joints()) + " joints; expected at most " + std::to_string(most) + expected);
    }
  };
  hand(robot.effects, " effects", kMaxEffects, ", each of a joint and with finite values");
  hand(robot.couplings, " gear couplings", kMaxCouplings, ", each of two joints and with finite values");
  hand(robot.cables, " cables", kMaxCouplings, ", each of two joints, with finite values and a stiffness of at least 0");
  hand(robot.elasticities, " elasticities", robot.num_joints(), ", one a joint, each of positive stiffness");
}

}  // namespace heft::model
