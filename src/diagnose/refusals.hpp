/// @file
/// What was considered and is no finding, with the reasons.
#pragma once

#include <string>
#include <vector>

#include "candidates.hpp"
#include "heft/diagnose/diagnose.hpp"

namespace heft::diagnose {

/// Why an effect goes with which the validation logs are predicted hardly better.
inline constexpr const char* kShownTooLittle = "the validation logs show too little of it next to the identified model";

/// Effects that were looked at, or in place, and are no findings.
class Refusals {
 public:
  /// A round that looks at everything begins: those of the last one no longer count.
  void begin_round() { not_taken_.clear(); }
  /// A candidate that the round, or the verdict, does not take, if it explains enough to be worth a word.
  /// @param why  empty: it may be
  void not_taken(const Candidate& candidate, const std::string& why);
  /// An effect that was taken and is out again.
  /// @param gain  share of its joint's squared error that it explained
  void taken_out(const Candidate& effect, const std::string& why, double gain) {
    taken_out_.push_back({effect.effect, effect.joint, why, gain});
  }
  /// Those that count, each once, those that would explain most first.
  std::vector<Refusal> beside(const std::vector<Finding>& findings) const;

 private:
  std::vector<Refusal> not_taken_, taken_out_;
};

}  // namespace heft::diagnose
