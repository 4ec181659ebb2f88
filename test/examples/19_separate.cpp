// The next experiment: a motion that decides between the explanations which a diagnosis left open.
//   heft excite --urdf scara --separate open.json --duration 8 --no-rehearsal -o next.csv
#include <cstdio>

#include "heft/data/log.hpp"
#include "heft/excite/separate.hpp"
#include "heft/report/separating_motion.hpp"
#include "heft/urdf/collision_shapes.hpp"
#include "heft/urdf/urdf_import.hpp"

int main() {
  const auto path = heft::urdf::resolve_robot("scara");
  const heft::model::Robot robot = heft::urdf::load_urdf(path);
  const heft::excite::Questions questions = heft::excite::read_questions(robot, "open.json");
  const auto shapes = heft::urdf::load_shapes(path, robot, nullptr);
  const heft::excite::LimitsFile limits{heft::excite::limits_of(robot, {.shapes = shapes}), {}, {}};
  const heft::excite::SeparatingMotion motion =
      heft::excite::separate(robot, limits, questions, {.duration = 8.0, .rehearse = false});
  std::fputs(heft::report::full(motion).c_str(), stdout);
  heft::data::write_log("next.csv", motion.log);
  return motion.usable() ? 0 : 4;
}
