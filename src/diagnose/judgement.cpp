#include "heft/diagnose/diagnose.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "heft/validate/judgement.hpp"
#include "other_load.hpp"

namespace heft::diagnose {
namespace {

double evidence_of(const Unexplained& unexplained, const char* name) {
  for (const auto& [key, value] : unexplained.evidence) {
    if (key == name) return value;
  }
  return 0.0;
}

/// Joints whose residual holds structure that matters.
std::vector<int> joints_with_structure(const Diagnosis& diagnosis) {
  std::vector<int> joints;
  const Eigen::VectorXd& largest = diagnosis.train_after.max_torque;
  for (const Unexplained& u : diagnosis.unexplained) {
    if (u.joint < 0 || u.joint >= largest.size() || u.cause == Cause::kQuantisation) continue;
    const double rms = evidence_of(u, "rms"), noise = evidence_of(u, "noise_rms");
    const double structure = std::sqrt(std::max(0.0, rms * rms - noise * noise));
    if (structure > kRelevantStructure * largest[u.joint]) joints.push_back(u.joint + 1);
  }
  return joints;
}

/// Joints whose error on a validation log is above that of the identified model, as logged and no smaller in band: at rest friction
/// takes the sign of the velocity's noise, which a motion behind a higher cut-off has more of, in any model.
std::vector<int> joints_made_worse(const Diagnosis& diagnosis) {
  std::vector<int> joints;
  const std::size_t logs =
      std::min(diagnosis.validate_each_identified.size(), diagnosis.validate_each_after.size());
  for (std::size_t k = 0; k < logs; ++k) {
    const validate::Score &before = diagnosis.validate_each_identified[k], &after = diagnosis.validate_each_after[k];
    for (Eigen::Index j = 0; j < std::min(before.rmse.size(), after.rmse.size()); ++j) {
      const int joint = static_cast<int>(j) + 1;
      const bool has_band = j < std::min(before.rmse_in_band.size(), after.rmse_in_band.size());
      if (has_band && after.rmse_in_band[j] < before.rmse_in_band[j]) continue;
      if (after.rmse[j] > kWorse * before.rmse[j] && std::find(joints.begin(), joints.end(), joint) == joints.end())
        joints.push_back(joint);
    }
  }
  std::sort(joints.begin(), joints.end());
  return joints;
}

std::string named(const std::vector<int>& joints) {
  return fmt::format("joint{} {}", joints.size() > 1 ? "s" : "", fmt::join(joints, ", "));
}

}  // namespace

std::string in_words(const NotExplained& joint, const model::Robot& robot) {
  const bool slides = robot.joints[static_cast<std::size_t>(joint.joint)].joint.type == JointType::kPrismatic;
  const char* unit = slides ? "N" : "N·m";
  return joint.contradicts
             ? fmt::format(
                   "joint {} contradicts the rest of the arm (error {:.3g} {}, {:.0f} % of its largest "
                   "torque; "
                   "on its own {:.2g} {})",
                   joint.joint + 1, joint.error, unit, 100.0 * joint.share_of_largest, joint.alone, unit)
             : fmt::format(
                   "joint {} is not explained by the arm model at all (error {:.3g} {}, {:.0f} % of its "
                   "torque)",
                   joint.joint + 1, joint.error, unit, 100.0 * joint.share);
}

host::Judgement Diagnosis::judgement() const {
  const Diagnosis& diagnosis = *this;
  host::Judgement judgement;
  for (const NotExplained& joint : diagnosis.not_explained)
    judgement.add(host::Verdict::kBad,
                  in_words(joint, diagnosis.after) +
                      ": check its sign, its unit and the order of the joints; no effect was sought in it");
  judgement.add(validate::judge_prediction(diagnosis.validate_each_after));
  const std::vector<int> structure = joints_with_structure(diagnosis);
  if (!structure.empty()) {
    judgement.add(host::Verdict::kDoubtful,
                  fmt::format("an error that is correlated in time, more than {:.0f} % of the largest torque, is left in {}: no known "
                              "effect explains it",
                              100.0 * kRelevantStructure, named(structure)));
  }
  if (diagnosis.logs_contradict)
    judgement.add(host::Verdict::kDoubtful,
                  "training and validation logs contradict each other" +
                      (diagnosis.other_load ? ": " + in_words(*diagnosis.other_load)
                                            : ", as if the arm carried something else in one of them"));
  const std::vector<int> worse = joints_made_worse(diagnosis);
  if (!worse.empty()) {
    judgement.add(
        host::Verdict::kDoubtful,
        fmt::format("{} predicted worse on a validation log than by the identified model", named(worse)));
  }
  return judgement;
}

}  // namespace heft::diagnose
