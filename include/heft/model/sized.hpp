/// @file
/// Core's templates for as many joints as a robot has at run time.
#pragma once

#include <string>
#include <type_traits>
#include <utility>

#include "heft/host/error.hpp"
#include "heft/model/dynamics.hpp"

namespace heft::model {

/// Calls f(std::integral_constant<int, N>{}) for the N that a robot has, 1 to kMaxJoints. All N are compiled, so f should
/// only make an object behind an interface.
/// @param robot  its name, for the message
/// @return what f returns, of one type for all N
/// @throws ModelError for another number of joints
template <int N = 1, typename F>
auto with_joint_count(int joints, const std::string& robot, F&& f) {
  if (joints == N) return f(std::integral_constant<int, N>{});
  if constexpr (N < kMaxJoints) {
    return with_joint_count<N + 1>(joints, robot, std::forward<F>(f));
  } else {
    throw ModelError("robot \"" + robot + "\" has " + std::to_string(joints) + " joints; heft handles 1 to " +
                     std::to_string(kMaxJoints));
  }
}

}  // namespace heft::model
