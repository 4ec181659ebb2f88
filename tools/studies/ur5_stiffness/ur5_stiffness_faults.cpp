#include "ur5_stiffness_faults.hpp"

#include <algorithm>

namespace heft::studies {

namespace {

/// By reading; there is nothing to compute.
std::vector<Fault> remarks() {
  return {
      {"figures-without-numbers",
       "result",
       "figures 38 to 41",
       "stiffness of every joint, drawn",
       "No number of these figures is printed, no unit, no interval; they can be rebuilt in kind only. No "
       "deflections are printed for the nine poses of figure 39. Those of figure 40 were chosen, not "
       "measured",
       {},
       true},
      {"table-numbers",
       "slip",
       "tables 3 to 5",
       "two tables are numbered 3; table 4 has θ2 from 0° to 360°, table 5 has zones at negative angles; the "
       "text sends the reader to figure 28 for the map in figure 30",
       "The angles agree once a turn is taken off",
       {},
       true}};
}

/// What changes results first.
int rank(const Fault& fault) { return fault.kind == "result" ? 0 : fault.kind == "data" ? 1 : 2; }

}  // namespace

std::vector<Fault> find_faults(const model::Kinematics& kinematics, const Ur5Measurements& measurements,
                               const ReachStudy& reach, const DexterityStudy& dexterity,
                               const StiffnessStudy& stiffness) {
  std::vector<Fault> faults;
  for (const std::vector<Fault>& some :
       {faults_of_readings(measurements), faults_of_load(kinematics, stiffness),
        faults_of_stiffness(kinematics, measurements, stiffness), faults_of_dexterity(reach, dexterity),
        slips_of_formulas(stiffness), remarks()}) {
    faults.insert(faults.end(), some.begin(), some.end());
  }
  std::stable_sort(faults.begin(), faults.end(),
                   [](const Fault& a, const Fault& b) { return rank(a) < rank(b); });
  return faults;
}

}  // namespace heft::studies
