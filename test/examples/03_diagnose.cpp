// Looks for what a model of rigid bodies and friction lacks, and keeps the model with what was found.
//   heft diagnose --urdf scara --log train.csv --validate judge.csv -o extended.json
#include <cstdio>

#include "heft/data/log_set.hpp"
#include "heft/diagnose/diagnose.hpp"
#include "heft/model/model_file.hpp"
#include "heft/report/diagnosis.hpp"
#include "heft/urdf/urdf_import.hpp"

int main() {
  const auto robot = heft::urdf::load_urdf(heft::urdf::resolve_robot("scara"));
  const auto logs =
      heft::data::open_logs(robot.joint_specs(), {.train = {"train.csv"}, .judge = {"judge.csv"}});
  const heft::diagnose::Diagnosis lacks = heft::diagnose::diagnose(robot, logs);
  std::fputs(heft::report::full(lacks).c_str(), stdout);
  heft::model::write_model("extended.json", lacks.model_file());
  return lacks.usable() ? 0 : 4;
}
