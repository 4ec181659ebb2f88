/// @file
/// How far an answer can be trusted: one scale for every command, its page's colour and the library's usable().
#pragma once

#include <string>
#include <vector>

namespace heft::host {

/// From the best to the worst; a later one outweighs an earlier one.
enum class Verdict {
  kGood,      ///< every stated limit is kept
  kDoubtful,  ///< usable, but a limit is missed or could not be checked
  kBad        ///< must not be used
};

/// "good", "doubtful" or "bad", as in JSON results.
const char* to_string(Verdict verdict) noexcept;

/// A verdict with its reasons.
struct Judgement {
  Verdict verdict{Verdict::kGood};
  std::vector<std::string> reasons;  ///< full sentences without a full stop, worst first; empty when good

  bool usable() const noexcept { return verdict != Verdict::kBad; }
  /// Adds a reason. The verdict becomes the worse of the two; worse reasons come before better ones.
  void add(Verdict found, std::string reason);
  /// Adds all of another judgement.
  /// @param about  in front of each of its reasons
  void add(const Judgement& other, const std::string& about = "");

 private:
  std::vector<Verdict> ranks_;  // of `reasons`
};

}  // namespace heft::host
