/// @file
/// The five acceptance criteria of a model, in percent.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/host/verdict.hpp"

namespace heft::validate {

enum class Verdict { kMet, kMissed, kNotJudged };
const char* to_string(Verdict verdict);  ///< "met", "missed", "not judged"

/// One acceptance criterion, in percent.
struct Criterion {
  std::string id;        ///< "parameter_recovery"
  std::string name;      ///< "parameter recovery"
  std::string meaning;   ///< what the value is
  double value{0.0};     ///< [%]; NaN when not judged
  double limit{0.0};     ///< [%]
  bool at_least{false};  ///< the value is to be above the limit
  Verdict verdict{Verdict::kNotJudged};
  std::vector<std::string> notes;  ///< what else belongs to it: exclusions, other ways to count
};

/// The five criteria in their order, not judged: parameter recovery below 15 %, torque prediction below 3 %,
/// tracking error reduced by more than 40 %, payload generalisation below 5 %, repeatability below 10 %.
std::vector<Criterion> acceptance_criteria();

/// Puts in a value and judges it; a value that is not finite leaves it not judged.
void judge(Criterion& criterion, double value);

/// Judges the criteria of a campaign: one missed is bad, one not judged doubtful.
host::Judgement judge(const std::vector<Criterion>& criteria);

/// |estimate − truth| / |truth| of each entry.
Eigen::VectorXd relative_errors(const Eigen::VectorXd& estimate, const Eigen::VectorXd& truth);
/// Standard deviation over |mean| of each entry, over repeated estimates. NaN for fewer than two.
Eigen::VectorXd relative_scatter(const std::vector<Eigen::VectorXd>& estimates);

}  // namespace heft::validate
