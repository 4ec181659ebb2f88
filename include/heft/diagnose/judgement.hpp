/// @file
/// How far a diagnosis can be trusted: the rule behind its verdict, its page's colour and usable().
#pragma once

#include <string>

#include "heft/diagnose/diagnosis.hpp"
#include "heft/host/verdict.hpp"
#include "heft/validate/judgement.hpp"

namespace heft::diagnose {

/// Structure left in a joint's residual matters from this part of the joint's largest torque on: the acceptance limit
/// of the torque prediction (validate::kGoodPercent).
inline constexpr double kStructureThatMatters = 0.03;

/// Bad: a joint that the arm model does not explain. Doubtful: structure above kStructureThatMatters that no known
/// effect explains; an error that rises on a validation log by more than a hundredth. And the prediction with all
/// effects on each validation log, by validate::judge_prediction().
host::Judgement judge(const Diagnosis& diagnosis);

/// "joint 2 is not explained by the arm model at all (error 170 N·m, 98 % of its torque)".
std::string in_words(const NotExplained& joint, const model::Robot& robot);

}  // namespace heft::diagnose
