/// @file
/// Pieces that text, tables, JSON and page of a diagnosis share.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "effect_words.hpp"
#include "heft/host/verdict.hpp"
#include "heft/page/page.hpp"
#include "heft/page/plot.hpp"
#include "heft/page/table.hpp"
#include "heft/plausibility/gear.hpp"
#include "heft/report/diagnosis.hpp"

namespace heft::report {

/// Colours of curves before and after the effects are added, the same in every plot of a page.
inline constexpr page::Hue kBefore = page::Hue::kVermillion;
inline constexpr page::Hue kAfter = page::Hue::kBlue;

/// "Stribeck friction in joint 2"; friction that remembers one of two distances of a joint says so.
std::string finding_in_place(const diagnose::Diagnosis& diagnosis, const diagnose::Finding& finding);
/// Findings kind by kind, that of the strongest first, each kind in the order of the joints.
std::vector<const diagnose::Finding*> by_kind(const diagnose::Diagnosis& diagnosis);
/// "p 3e-9, ΔBIC −812, error on blocks not fitted −31 %".
std::string evidence_in_words(const diagnose::Finding& finding);
/// "rms 1.59, noise 1.1; shares: drifts slowly 25 %; swings at 0.20 Hz 6.9 %".
std::string evidence_in_words(const diagnose::Unexplained& unexplained);
/// "All joints together, in band: error identified 6.81, diagnosed 4.02 % of the torque; ..."; asks for the torque's own
/// score.
std::string relative_error_in_words(const diagnose::Diagnosis& diagnosis);
/// "viscous_nonlinear, joint 2 (ΔBIC −640); ...".
std::string rivals_in_words(const std::vector<diagnose::Rival>& rivals, bool with_score);

/// Joint whose error on the validation logs falls most; -1: not known.
int most_improved_joint(const diagnose::Diagnosis& diagnosis);
/// Joints whose error on a validation log is more than a hundredth above that of the identified model, one line each.
std::vector<std::string> errors_that_rise(const diagnose::Diagnosis& diagnosis);

/// "3e-9", "< 1e-300".
std::string p_in_words(double p);
/// Whether both scores are there, of the same joints.
bool has_scores(const validate::Score& before, const validate::Score& after);
/// Refusals, those that would explain most first.
std::vector<diagnose::Refusal> strongest(const diagnose::Diagnosis& diagnosis);
/// "joint 2, 15 % of the squared residual is no noise".
std::string unexplained_in_words(const diagnose::Unexplained& unexplained);
/// Of the error in band against the torque, of all samples and of the motion alone [%].
struct RelativeErrors {
  double before, identified, after, moving_before, moving_identified, moving_after;
};
RelativeErrors relative_errors(const diagnose::Diagnosis& diagnosis);

/// "−33 %"; "–" where there is nothing to compare.
std::string change_percent(double before, double after);
/// "N·m", "N" or "N·m, N": of the torques of all joints.
std::string torque_unit(const model::Robot& robot);
/// "N·m" or "N".
std::string torque_unit(const model::Robot& robot, int joint);

/// Errors of each joint with the model as given, as identified and as diagnosed, which the changes are between the last
/// two of; no rows where a score is missing.
page::Table models_table(const validate::Score& given, const validate::Score& identified,
                         const validate::Score& diagnosed, const model::Robot& robot);
/// What the columns of models_table() are, as a sentence.
std::string models_in_words();
/// "6 Hz", and that of each joint where they differ.
std::string cutoff_in_words(const diagnose::Diagnosis& diagnosis);
/// "-1.9 to 1.9 rad/s, load -52 to 61 N·m, position -2.1 to 2.2 rad": where the effect was seen.
std::string range_in_words(const diagnose::Finding& finding, const model::Robot& robot);
/// Whether the effect is a value that identify finds as well: rotor inertia, offset.
bool is_identified(const diagnose::Finding& finding);
/// Effects as by_kind() has them, with their evidence, and what else was tried: rivals.
page::Table ranking_table(const diagnose::Diagnosis& diagnosis, const model::Robot& robot);
/// "1.2 N·m rms, 3.4 N·m at most in joint 2; 55 % of its squared error on the validation logs goes with it"; empty where it
/// is no torque of a joint.
std::string moves_in_words(const diagnose::Finding& finding, const model::Robot& robot);
/// What the effects move, joint by joint: torque and what is left of the joint's error; no rows when nothing moves.
page::Table moved_by_joint_table(const diagnose::Diagnosis& diagnosis);
/// The same kind by kind.
page::Table moved_by_kind_table(const diagnose::Diagnosis& diagnosis);
/// Whether a strain-wave gear of that joint can have the values.
plausibility::GearCheck gear_check(const diagnose::Finding& finding, const model::Robot& robot);

/// The refusals that explain most, strongest first.
page::Table refusal_table(const diagnose::Diagnosis& diagnosis, std::size_t most);

/// Shares of each joint's squared error: explained, explainable but unknown, noise.
page::Table ceiling_table(const diagnose::Diagnosis& diagnosis);
/// "Joint 2: explained 0.62 of what is explainable; nothing is explainable in joints 1 and 3."
std::string ceiling_in_words(const diagnose::Diagnosis& diagnosis);
/// The same as bars.
page::PlotSpec ceiling_bars(const diagnose::Diagnosis& diagnosis);
/// Friction curve, loop at reversals and map of the residual of each joint.
void add_curves(page::Page& page, const diagnose::Diagnosis& diagnosis);
nlohmann::ordered_json ceilings_json(const diagnose::Diagnosis& diagnosis);

/// Diagnosis::judgement() and what is known of the logs.
host::Judgement judgement_of(const diagnose::Diagnosis& diagnosis, const DiagnosisContext& context);

/// What json() prints.
nlohmann::ordered_json diagnosis_json(const diagnose::Diagnosis& diagnosis, const DiagnosisContext& context);

}  // namespace heft::report
