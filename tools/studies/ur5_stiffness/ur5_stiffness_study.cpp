#include "ur5_stiffness_study.hpp"

#include <fmt/format.h>

namespace heft::studies {

namespace {

std::string verdict_of(const Ur5Study& study) {
  const StiffnessStudy& s = study.stiffness;
  const auto size = [&](std::size_t joint) {
    const stiffness::StiffnessEstimate& e = s.two.joints[joint];
    return fmt::format("{:.1f} kN m/rad [{:.1f}, {:.1f}]", 1e-3 * e.stiffness.value, 1e-3 * e.stiffness.lower,
                       1e-3 * e.stiffness.upper);
  };
  const bool decided = s.of_tool.accepted >= 0 || s.of_own.accepted >= 0 || s.of_both.accepted >= 0;
  return fmt::format(
      "Kinematics and dexterity map reproduce, the map only with lengths in millimetres; the joint "
      "stiffnesses do not. The six readings support one value for each size of gear: {} for joints 1 to 3, "
      "{} for joints 4 to 6. They leave a residual of {:.3f} mm, {:.0f} times the scatter of repeats. Its "
      "cause {} with six scalar measurements.",
      size(0), size(3), 1e3 * s.two.fit_rms, s.two.fit_rms / s.two.repeatability,
      decided ? "was decided" : "cannot be decided");
}

}  // namespace

Ur5Study run_ur5_study(int seeds, const std::function<void(double)>& progress) {
  Ur5Study study;
  const model::Kinematics kinematics(ur5_of_dh_table());
  study.measurements = read_ur5_measurements();
  study.reach = study_reach(kinematics);
  study.dexterity = study_dexterity(kinematics, study.measurements);
  study.stiffness = study_stiffness(kinematics, study.measurements);
  study.simulation = study_simulation(kinematics, study.measurements, study.stiffness, study.dexterity.length,
                                      seeds, progress);
  study.faults = find_faults(kinematics, study.measurements, study.reach, study.dexterity, study.stiffness);
  study.verdict = verdict_of(study);
  return study;
}

}  // namespace heft::studies
