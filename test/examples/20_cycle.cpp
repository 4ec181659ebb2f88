// An arm that is known at run time only, in the loop of a controller: its load, and the torque that carries it. In the place of the
// robot is its own model with 2 kg. Prints:
//   without a load: 0.0 kg, shoulder -36.3 N·m
//   after 5 s: known, 2.0 kg, shoulder -48.5 N·m
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "heft/cycle/cycle.hpp"

int main() {
  heft::cycle::Cycle cycle;
  if (cycle.configure({.urdf = "ur5"}) != heft::Status::kOk) return std::puts(cycle.message().c_str()), 1;
  heft::cycle::Output out;
  std::array<double, 6> q{}, qd{}, tau{}, command{};
  const std::array<double, 6> pose{0, -1, 1, 0, 0, 0}, rest{};
  const auto shoulder = [&] {
    return cycle.inverse_dynamics(pose, rest, rest, 0.002, command) == heft::Status::kOk ? command[1] : NAN;
  };
  std::printf("without a load: %.1f kg, shoulder %.1f N·m\n", out.mass, shoulder());
  const heft::model::Robot robot = [&] {
    heft::model::Robot loaded = heft::cycle::robot_of({.urdf = "ur5"});
    loaded.joints.back().link[0] += 2.0;
    return loaded;
  }();
  const heft::model::Dynamics arm(robot);
  for (double t = 0.002; t < 5.0; t += 0.002) {
    Eigen::VectorXd half(6), half_qd(6), half_qdd(6);  // torque acts half-way between two samples
    for (int i = 0; i < 6; ++i) {
      const double w = 1.1 + 0.4 * i, h = t - 0.001;
      const auto at = static_cast<std::size_t>(i);
      q[at] = 0.6 * std::sin(w * t), qd[at] = 0.6 * w * std::cos(w * t);
      half[i] = 0.6 * std::sin(w * h), half_qd[i] = 0.6 * w * std::cos(w * h), half_qdd[i] = -w * w * half[i];
    }
    const Eigen::VectorXd torque = arm.joint_torque(half, half_qd, half_qdd);
    std::copy(torque.begin(), torque.end(), tau.begin());
    if (cycle.update(q, qd, tau, 0.002, out) != heft::Status::kOk) return 1;
  }
  std::printf("after 5 s: %s, %.1f kg, shoulder %.1f N·m\n", heft::to_string(out.load_state), out.mass,
              shoulder());
}
