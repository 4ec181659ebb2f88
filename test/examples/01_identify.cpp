// Fits a model to one log, judges it on another and keeps it.
//   heft identify --urdf scara --log train.csv --validate judge.csv -o arm.json
#include <cstdio>

#include "heft/data/log_set.hpp"
#include "heft/identify/identify.hpp"
#include "heft/model/model_file.hpp"
#include "heft/report/identification.hpp"
#include "heft/urdf/urdf_import.hpp"

int main() {
  const auto robot = heft::urdf::load_urdf(heft::urdf::resolve_robot("scara"));
  const auto logs =
      heft::data::open_logs(robot.joint_specs(), {.train = {"train.csv"}, .judge = {"judge.csv"}});
  const heft::identify::Identification found = heft::identify::identify(robot, logs);
  std::fputs(heft::report::full(found).c_str(), stdout);
  heft::model::write_model("arm.json", found.model_file());
  return found.usable() ? 0 : 4;
}
