// Stiffness of the gears from a log with encoders on both of their sides.
//   heft stiffness --urdf scara --log elastic.csv --rotor-inertia 0.05,0.03,2,0.01
#include <cstdio>

#include "heft/data/log_set.hpp"
#include "heft/report/stiffness.hpp"
#include "heft/stiffness/stiffness.hpp"
#include "heft/urdf/urdf_import.hpp"

int main() {
  const auto robot = heft::urdf::load_urdf(heft::urdf::resolve_robot("scara"));
  const auto logs = heft::data::open_logs(robot.joint_specs(), {.train = {"elastic.csv"}, .split = 0.0});
  const heft::stiffness::Stiffness found =
      heft::stiffness::from_encoders(robot, logs, {.rotor_inertia = {0.05, 0.03, 2.0, 0.01}});
  std::fputs(heft::report::full(heft::report::StiffnessReport{found}).c_str(), stdout);
  return found.usable() ? 0 : 4;
}
