#include "wrong_model.hpp"

#include <array>
#include <cstddef>
#include <random>

namespace heft::track {
namespace {

/// 1 ± a share. By hand, since the distributions of the standard library differ from one to the next.
double factor(std::mt19937_64& random, const WrongModel& wrong) {
  const auto draw = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };  // [0, 1)
  const double share = wrong.least + (wrong.most - wrong.least) * draw();
  return draw() < 0.5 ? 1.0 - share : 1.0 + share;
}

/// mass (|c|² E − c cᵀ), as it stands in InertialParameters from kIxx on.
std::array<double, 6> of_point(double mass, const std::array<double, 3>& c) {
  const double xx = c[0] * c[0], yy = c[1] * c[1], zz = c[2] * c[2];
  return {mass * (yy + zz),    -mass * c[0] * c[1], mass * (xx + zz),
          -mass * c[0] * c[2], -mass * c[1] * c[2], mass * (xx + yy)};
}

}  // namespace

model::Robot wrong_model(model::Robot robot, const WrongModel& wrong) {
  std::mt19937_64 random(wrong.seed);
  for (model::RobotJoint& joint : robot.joints) {
    InertialParameters<double>& link = joint.link;
    const double scale = factor(random, wrong), mass = link[kMass];
    std::array<double, 3> centre{}, moved{};
    for (std::size_t a = 0; a < 3; ++a) {
      centre[a] = mass > 0 ? link[kMcx + a] / mass : 0.0;
      moved[a] = centre[a] * factor(random, wrong);
      link[kMcx + a] = scale * mass * moved[a];
    }
    link[kMass] = scale * mass;
    const std::array<double, 6> before = of_point(mass, centre), after = of_point(scale * mass, moved);
    for (std::size_t k = 0; k < 6; ++k) link[kIxx + k] = scale * (link[kIxx + k] - before[k]) + after[k];
    JointActuation<double>& drive = joint.actuation;
    drive.coulomb_friction *= factor(random, wrong);
    drive.viscous_friction *= factor(random, wrong);
    drive.friction_offset *= factor(random, wrong);
  }
  return robot;
}

}  // namespace heft::track
