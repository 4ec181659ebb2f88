// The torque that an ampere gives, from the drive's target torque and target current.
//   heft torque-constants --log drive.csv
#include <cstdio>

#include "heft/drive/torque_constants.hpp"
#include "heft/report/torque_constants.hpp"

int main() {
  const auto logs = heft::drive::open_logs({"drive.csv"});
  const heft::drive::TorqueConstants found = heft::drive::from_targets(logs);
  std::fputs(heft::report::full(found).c_str(), stdout);
  return found.usable() ? 0 : 4;
}
