// Learns thresholds from a log in which nothing touched the arm, and finds the contacts in another.
//   heft monitor --model arm.json --learn judge.csv --log touched.csv -o watched.json
#include <cstdio>

#include "heft/data/log_set.hpp"
#include "heft/model/model_file.hpp"
#include "heft/monitor/monitor.hpp"
#include "heft/report/monitor.hpp"

int main() {
  const heft::model::ModelFile file = heft::model::read_model("arm.json");
  const heft::model::Robot robot = heft::model::make_robot(file);
  const auto logs = heft::data::open_logs(robot.joint_specs(),
                                          {.train = {"judge.csv"}, .judge = {"touched.csv"}, .split = 0.0});
  const heft::monitor::Thresholds thresholds = heft::monitor::learn(file, robot, logs);
  const auto found = heft::monitor::monitor(file, robot, logs, thresholds);
  std::printf("%s\n%s", heft::report::full(thresholds).c_str(), heft::report::full(found.front()).c_str());
  heft::model::write_model("watched.json", thresholds.model_file(file));
  return 0;
}
