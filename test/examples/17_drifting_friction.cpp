// Friction that falls while an arm warms up, followed by an extended Kalman filter. In the place of the robot is its own model along
// a motion, with friction that falls by 30 % in 20 s.
// Prints:
//   joint 2 cold: 5.00 N·m, the filter expects 5.00 ± 2.50
//   joint 2 warm: 3.50 N·m, the filter finds 3.51 ± 0.16
#include <cmath>
#include <cstdio>

#include "heft/core/estimate/extended_kalman_filter.hpp"
#include "heft/model/named_arms.hpp"

using Filter = heft::ExtendedKalmanFilter<double, 6>;

int main() {
  heft::ArmModel<double, 6> model = heft::model::Ur5Arm::kModel;
  for (auto& joint : model.actuation) joint.rotor_inertia = 0.3;
  const heft::DynamicArm<double, 6> robot(model);
  Filter filter;
  Filter::Config config;
  config.coulomb.time = config.viscous.time = 30;  // friction may change by its uncertainty in 30 s
  config.torque_is_held = false;                   // torques are measured
  if (filter.configure(config, model) != heft::Status::kOk) return 1;

  const double cold = model.actuation[1].coulomb_friction;
  const auto show = [&](const char* state, double is, const char* verb) {
    std::printf("joint 2 %s: %.2f N·m, the filter %s %.2f ± %.2f\n", state, is, verb, filter.coulomb(1),
                filter.standard_deviation(Filter::kCoulomb + 1));
  };
  show("cold", cold, "expects");
  Filter::Vector q, qd, qdd;
  Filter::Record record;
  double share = 1.0;
  for (int n = 0; n < 20'000; ++n) {
    share = 1.0 - 0.3 * n / 20'000;
    for (int i = 0; i < 6; ++i) {
      const double w = 1.1 + 0.4 * i, t = 1e-3 * n;
      q[i] = 0.6 * std::sin(w * t), qd[i] = 0.6 * w * std::cos(w * t),
      qdd[i] = -0.6 * w * w * std::sin(w * t);
    }
    Filter::Vector tau = heft::inverse_dynamics(robot, q, qd, qdd) + 0.3 * qdd;
    for (int i = 0; i < 6; ++i) {
      tau[i] += share * heft::friction_torque(model.actuation[static_cast<std::size_t>(i)], qd[i], 0.01);
    }
    if (filter.update(q, qd, tau, 1e-3, record) != heft::Status::kOk) return 1;
  }
  show("warm", share * cold, "finds");
}
