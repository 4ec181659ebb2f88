// The fastest motion along a path that points give, inside the limits of the arm.
//   heft retime --urdf scara --waypoints points.csv -o fast.csv
#include <cstdio>

#include "heft/data/log.hpp"
#include "heft/report/retime.hpp"
#include "heft/retime/retime.hpp"
#include "heft/urdf/urdf_import.hpp"

int main() {
  const auto robot = heft::urdf::load_urdf(heft::urdf::resolve_robot("scara"));
  const auto path = heft::retime::through(robot, heft::data::read_log("points.csv", {}));
  const heft::retime::Retiming found = heft::retime::retime(robot, path);
  std::fputs(heft::report::full(found).c_str(), stdout);
  heft::data::write_log("fast.csv", found.log);
  return found.usable() ? 0 : 4;
}
