// Stiffness of the joints from loads and deflections measured at rest; the first three gears are of one size, as the rest are.
//   heft stiffness --urdf ur5 --measurements tool.csv --groups 1-3,4-6 --keep-singular
#include <cstdio>

#include "heft/data/deflections.hpp"
#include "heft/report/stiffness.hpp"
#include "heft/stiffness/stiffness.hpp"
#include "heft/urdf/urdf_import.hpp"

int main() {
  const auto robot = heft::urdf::load_urdf(heft::urdf::resolve_robot("ur5"));
  const auto readings = heft::data::read_deflections("tool.csv", robot.num_joints(), robot.name);
  const heft::stiffness::Stiffness found = heft::stiffness::from_deflections(
      robot, readings, {.groups = {{0, 1, 2}, {3, 4, 5}}, .keep_singular = true, .sources = {"tool.csv"}});
  std::puts(heft::report::brief(found).c_str());
  return found.usable() ? 0 : 4;
}
