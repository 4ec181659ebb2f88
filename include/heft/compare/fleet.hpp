/// @file
/// Which arms differ from the rest? Models of many arms of one type, each fitted to the arm's own logs.
#pragma once

#include <string>
#include <vector>

#include "heft/compare/compare.hpp"
#include "heft/host/verdict.hpp"
#include "heft/model/model_file.hpp"

namespace heft::compare {

/// With fewer arms there is no rest whose scatter could be known.
inline constexpr int kLeastArms = 5;

/// A parameter of one arm that lies outside of what the other arms and the fits allow.
struct Deviation {
  std::string arm;  ///< path of its model file, which is its name
  /// `before`: mean of the other arms; `after`: this arm; `difference`: its intervals over all arms and parameters together
  /// hold in 95 % of fleets without an odd arm (Bonferroni). Torque is not looked at.
  Change change;
};

/// One parameter over the fleet, arms that were named left out.
struct FleetParameter {
  Change about;             ///< kind, parameter, meaning, unit, joint
  int arms{0};              ///< that know it
  double mean{0.0};         ///< weighted by what is known of each arm
  double scatter{0.0};      ///< standard deviation from arm to arm beyond what the fits leave open
  double uncertainty{0.0};  ///< median of the standard deviations of the fits
};

/// The answer.
struct FleetComparison {
  std::string robot;
  int arms{0};
  int comparisons{0};                      ///< arms times parameters
  std::vector<Deviation> deviations;       ///< by p value
  std::vector<FleetParameter> parameters;  ///< all that were compared
  std::vector<std::string> notes;
  host::Judgement judgement;

  /// Names of the arms that differ, the surest first.
  std::vector<std::string> odd_arms() const;
  bool usable() const { return judgement.usable(); }
};

/// Compares each arm with all others, parameter by parameter.
///
/// Arms of one type are not the same: a parameter has a scatter from arm to arm, τ, found from the other arms beyond what
/// their own intervals explain (R. DerSimonian, N. Laird, Controlled Clinical Trials 7, 1986). An arm differs where
///
///     |x − mean of the others| > t √(s² + τ² + variance of that mean),
///
/// s the standard deviation of its own fit, for residuals correlated in time; t is Student's for the degrees of freedom
/// of s and τ (Welch). What was named is left out and the rest looked at again, so that one odd arm does not hide the next.
/// Where more than about a tenth of the arms differ in the same way, they hide one another.
///
/// Base parameters are compared as compare() does; effects of `diagnose` are not.
///
/// @param arms  as `identify` writes them, all of one type
/// @throws ModelError as compare(); InputError for fewer than kLeastArms
FleetComparison compare_fleet(const std::vector<model::ModelFile>& arms);

}  // namespace heft::compare
