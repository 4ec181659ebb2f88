#include "heft/stiffness/judgement.hpp"

#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "heft/host/words.hpp"

namespace heft::stiffness {

using host::Judgement;
using Rank = host::Verdict;

Judgement judge(const StiffnessFit& fit, const StiffnessDiagnosis& diagnosis) {
  Judgement judgement;
  std::vector<int> open, wide;
  int known = 0;
  for (std::size_t j = 0; j < fit.joints.size(); ++j) {
    const StiffnessEstimate& joint = fit.joints[j];
    if (joint.group < 0 && joint.why.empty()) continue;  // rigid, as asked for
    if (!joint.has_stiffness()) {
      open.push_back(static_cast<int>(j));
    } else {
      ++known;
      if (joint.stiffness.upper > kWideStiffness * joint.stiffness.lower) wide.push_back(static_cast<int>(j));
    }
  }
  if (known == 0) judgement.add(Rank::kBad, "no joint's stiffness is determined");
  else if (!open.empty()) {
    judgement.add(Rank::kDoubtful,
                  fmt::format("the stiffness of {} is not determined; measure at other poses or with other "
                              "loads (--plan names some)",
                              host::joints_in_words(open)));
  }
  if (!wide.empty()) {
    judgement.add(Rank::kDoubtful, fmt::format("the stiffness of {} is known to a factor of {:g} only",
                                               host::joints_in_words(wide), kWideStiffness));
  }
  if (!(fit.left_out_rms < diagnosis.mean_rms)) {
    judgement.add(Rank::kBad, fmt::format("springs predict poses left out no better ({:.3g} mm) than the "
                                          "mean of the other readings ({:.3g} mm)",
                                          1e3 * fit.left_out_rms, 1e3 * diagnosis.mean_rms));
  }
  return judgement;
}

Judgement judge(const JointEncoderFit& fit, bool rotor_inertia_known) {
  Judgement judgement;
  if (!rotor_inertia_known) {
    judgement.add(
        Rank::kDoubtful,
        "no rotor inertia is known: torque that the rotors take counts as carried by the gears, and "
        "joints look stiffer than they are; give --rotor-inertia, or a --model that has it");
  }
  std::vector<int> open, wide, apart;
  for (const JointStiffness& joint : fit.pooled) {
    if (!joint.identifiable) open.push_back(joint.joint);
    else if (joint.stiffness.upper > kWideStiffness * joint.stiffness.lower) wide.push_back(joint.joint);
  }
  for (const StiffnessAgreement& agreement : fit.agreement) {
    if (!agreement.agrees) apart.push_back(agreement.joint);
  }
  if (!open.empty()) {
    judgement.add(open.size() == fit.pooled.size() ? Rank::kBad : Rank::kDoubtful,
                  fmt::format("the stiffness of {} is not determined", host::joints_in_words(open)));
  }
  if (!wide.empty()) {
    judgement.add(Rank::kDoubtful, fmt::format("the stiffness of {} is known to a factor of {:g} only",
                                               host::joints_in_words(wide), kWideStiffness));
  }
  if (!apart.empty()) {
    judgement.add(Rank::kDoubtful,
                  fmt::format("the logs disagree about the stiffness of {}", host::joints_in_words(apart)));
  }
  return judgement;
}

}  // namespace heft::stiffness
