#include "heft/validate/scored_time.hpp"

#include <algorithm>
#include <utility>

#include "heft/host/numbers.hpp"

namespace heft::validate {

ScoredTime::ScoredTime(double begin, double end, std::vector<data::TimeGap> gaps)
    : ends_(end - begin > 2.0 * kScoreEnd), beside_(ends_ ? kScoreEnd : 0.0), gaps_(std::move(gaps)) {
  // Time stamps near the border may be rounded.
  constexpr double kRounding = 1e-9;
  from_ = ends_ ? begin + kScoreEnd - kRounding : -kInfinity;
  to_ = ends_ ? end - kScoreEnd + kRounding : kInfinity;
  double rest = 0.0, recorded = end - begin, at = begin;
  for (const data::TimeGap& gap : gaps_) {
    rest += std::max(0.0, gap.begin - at - 2.0 * kScoreEnd);
    recorded -= gap.end - gap.begin;
    at = gap.end;
  }
  rest += std::max(0.0, end - at - 2.0 * kScoreEnd);
  if (rest < 0.5 * recorded) beside_ = 0.0;
}

bool ScoredTime::is_in_gap(double time) const {
  return std::any_of(gaps_.begin(), gaps_.end(), [&](const data::TimeGap& gap) {
    return time > gap.begin - beside_ && time < gap.end + beside_;
  });
}

}  // namespace heft::validate
