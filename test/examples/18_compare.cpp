// What changed between two models of one robot.
//   heft compare arm.json later.json
#include <cstdio>

#include "heft/compare/compare.hpp"
#include "heft/model/model_file.hpp"
#include "heft/report/comparison.hpp"

int main() {
  const heft::model::ModelFile before = heft::model::read_model("arm.json");
  const heft::model::ModelFile after = heft::model::read_model("later.json");
  const heft::compare::Comparison changes = heft::compare::compare(before, after);
  std::fputs(heft::report::full(changes).c_str(), stdout);
  return changes.usable() ? 0 : 4;
}
