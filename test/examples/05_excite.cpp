// Designs a motion that reveals the parameters, inside all limits, rehearsed on the simulated arm.
//   heft excite --urdf scara --duration 8 --starts 2 --compare 0 -o exciting.csv
#include <cstdio>

#include "heft/data/log.hpp"
#include "heft/excite/excite.hpp"
#include "heft/host/reproducible.hpp"
#include "heft/report/motion.hpp"
#include "heft/urdf/collision_shapes.hpp"
#include "heft/urdf/urdf_import.hpp"

int main() {
  heft::host::multiply_alike_everywhere();  // as the command does
  const auto path = heft::urdf::resolve_robot("scara");
  const auto robot = heft::urdf::load_urdf(path);
  heft::excite::Options options;
  options.search.duration = 8.0;
  options.search.starts = 2;
  const auto limits =
      heft::excite::limits_of(robot, {.shapes = heft::urdf::load_shapes(path, robot, nullptr)});
  const heft::excite::ExcitingMotion motion = heft::excite::design(robot, limits, options);
  std::fputs(heft::report::full(motion).c_str(), stdout);
  heft::data::write_log("exciting.csv", motion.log);
  return motion.usable() ? 0 : 4;
}
