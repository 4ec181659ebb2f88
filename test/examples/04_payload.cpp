// Fits the arm without load, checks it on another log without load, and weighs what the arm carries.
//   heft payload --urdf scara --baseline empty.csv --zero zero.csv --log carrying.csv -o unloaded.json
#include <cstdio>

#include "heft/data/log_set.hpp"
#include "heft/model/model_file.hpp"
#include "heft/payload/payload.hpp"
#include "heft/report/payload.hpp"
#include "heft/urdf/urdf_import.hpp"

int main() {
  const auto robot = heft::urdf::load_urdf(heft::urdf::resolve_robot("scara"));
  const auto logs = heft::data::open_logs(robot.joint_specs(),
                                          {.train = {"empty.csv"}, .judge = {"zero.csv", "carrying.csv"}});
  const heft::payload::UnloadedArm arm = heft::payload::fit_unloaded(robot, logs, 1);  // one log to check it
  const heft::payload::Payload load = heft::payload::estimate(arm, logs.judge().back());
  std::fputs(heft::report::full(load).c_str(), stdout);
  heft::model::write_model("unloaded.json", arm.model_file());
  return load.usable() ? 0 : 4;
}
