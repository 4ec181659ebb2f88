#include "wrong_model.hpp"

#include <array>
#include <cstddef>
#include <random>

#include "heft/core/denavit_hartenberg.hpp"

namespace heft::track {
namespace {

/// 1 ± a share. By hand, since the distributions of the standard library differ from one to the next.
double factor(std::mt19937_64& random, const WrongModel& wrong) {
  const auto draw = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };  // [0, 1)
  const double share = wrong.least + (wrong.most - wrong.least) * draw();
  return draw() < 0.5 ? 1.0 - share : 1.0 + share;
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
    }
    const InertialParameters<double> point = make_inertial_parameters<double>(mass, centre, {});
    std::array<double, 6> about_centre{};
    for (std::size_t k = 0; k < 6; ++k) about_centre[k] = scale * (link[kIxx + k] - point[kIxx + k]);
    link = make_inertial_parameters(scale * mass, moved, about_centre);
    JointActuation<double>& drive = joint.actuation;
    drive.coulomb_friction *= factor(random, wrong);
    drive.viscous_friction *= factor(random, wrong);
    drive.friction_offset *= factor(random, wrong);
  }
  return robot;
}

}  // namespace heft::track
