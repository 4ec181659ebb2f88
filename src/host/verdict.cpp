#include "heft/host/verdict.hpp"

#include <algorithm>
#include <cstddef>
#include <utility>

namespace heft::host {

const char* to_string(Verdict verdict) noexcept {
  switch (verdict) {
    case Verdict::kGood:
      return "good";
    case Verdict::kDoubtful:
      return "doubtful";
    case Verdict::kBad:
      return "bad";
  }
  return "bad";
}

void Judgement::add(Verdict found, std::string reason) {
  verdict = std::max(verdict, found);
  // Behind the last reason that is as bad.
  const auto place = std::find_if(ranks_.begin(), ranks_.end(), [&](Verdict rank) { return rank < found; });
  reasons.insert(reasons.begin() + (place - ranks_.begin()), std::move(reason));
  ranks_.insert(place, found);
}

void Judgement::add(const Judgement& other, const std::string& about) {
  for (std::size_t k = 0; k < other.reasons.size(); ++k) add(other.ranks_[k], about + other.reasons[k]);
}

}  // namespace heft::host
