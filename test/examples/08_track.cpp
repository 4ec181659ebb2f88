// Controllers side by side in the simulator; the arm grips a load on its way.
//   heft track --scenario pick.json --from 2.5
#include <cstdio>

#include "heft/host/file.hpp"
#include "heft/report/tracking.hpp"
#include "heft/sim/scenario.hpp"
#include "heft/track/track.hpp"
#include "heft/urdf/urdf_import.hpp"

int main() {
  const heft::sim::Scenario scenario = heft::sim::parse_scenario(
      heft::host::read_file("pick.json", "scenario"), "pick.json",
      [](const std::string& name) { return heft::urdf::load_urdf(heft::urdf::resolve_robot(name)); });
  heft::track::Options options;
  options.from = 2.5;
  const heft::track::Tracking tracking = heft::track::track(scenario, options);
  std::fputs(heft::report::full(tracking).c_str(), stdout);
  return tracking.usable() ? 0 : 4;
}
