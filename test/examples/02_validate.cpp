// Judges a model on a log that it was not fitted to.
//   heft validate --model arm.json --log judge.csv
#include <cstdio>

#include "heft/data/log_set.hpp"
#include "heft/model/model_file.hpp"
#include "heft/report/validation.hpp"
#include "heft/validate/validate.hpp"

int main() {
  const heft::model::ModelFile file = heft::model::read_model("arm.json");
  const heft::model::Robot robot = heft::model::make_robot(file);
  const auto logs = heft::data::open_logs(robot.joint_specs(), {.judge = {"judge.csv"}});
  const heft::validate::Validation judged =
      heft::validate::validate(file, robot, logs, {.model = "arm.json"});
  std::fputs(heft::report::full(judged).c_str(), stdout);
  return judged.usable() ? 0 : 4;
}
