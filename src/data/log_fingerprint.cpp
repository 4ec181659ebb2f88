#include "log_fingerprint.hpp"

#include <algorithm>

#include "heft/host/hash.hpp"

namespace heft::data {

using host::bits_of;
using host::combine;

namespace {

/// Runs kept before every other one is dropped: 8 MB at most.
constexpr std::size_t kMostRuns = std::size_t{1} << 20U;

/// Hash of a run: Σ kBase^age of the rows' hashes, modulo 2^64, which the next row takes further.
constexpr std::uint64_t kBase = combine(0, 0) | 1U;
constexpr std::uint64_t kBaseToRun = [] {
  std::uint64_t power = 1;
  for (int i = 0; i < LogFingerprint::kRun; ++i) power *= kBase;
  return power;
}();

/// Whose high half moves the low half of a product, too.
std::uint64_t folded(double value) {
  const std::uint64_t bits = bits_of(value);
  return bits ^ bits >> 32U;
}

}  // namespace

void LogFingerprint::add(const Eigen::Ref<const Eigen::MatrixXd>& q,
                         const Eigen::Ref<const Eigen::MatrixXd>& tau) {
  const Eigen::Index positions = q.cols(), numbers = positions + tau.cols();
  last_q_.resize(static_cast<std::size_t>(positions));
  for (auto j = static_cast<Eigen::Index>(factors_.size()); j < numbers; ++j)
    factors_.push_back(combine(1, static_cast<std::uint64_t>(j)) | 1U);
  for (Eigen::Index k = 0; k < q.rows(); ++k, ++rows_) {
    // A sum of products rather than a chain of hashes: the processor computes them side by side.
    std::uint64_t sum = 0;
    bool changed = false;
    for (Eigen::Index j = 0; j < positions; ++j) {
      const auto at = static_cast<std::size_t>(j);
      sum += folded(q(k, j)) * factors_[at];
      changed = changed || q(k, j) != last_q_[at];
      last_q_[at] = q(k, j);
    }
    for (Eigen::Index j = 0; j < tau.cols(); ++j)
      sum += folded(tau(k, j)) * factors_[static_cast<std::size_t>(positions + j)];
    const auto at = static_cast<std::size_t>(rows_ % kRun);
    const std::uint64_t hash = combine(0, sum);
    run_ = run_ * kBase + hash - recent_[at] * kBaseToRun;
    changes_ += (changed ? 1 : 0) - (changed_[at] ? 1 : 0);
    recent_[at] = hash;
    changed_[at] = changed;
    if (rows_ + 1 >= kRun) keep({combine(0, run_), changes_ >= kRun / 2 ? 1U : 0U});
  }
}

void LogFingerprint::keep(const Run& run) {
  if ((run.hash & mask_) != 0) return;
  runs_.push_back(run);
  if (runs_.size() > kMostRuns) thin_out();
}

/// Drops every other kept run, chosen by one more bit of its hash.
void LogFingerprint::thin_out() {
  sort(runs_);  // an arm that rests repeats itself
  while (runs_.size() > kMostRuns / 2) {
    mask_ = 2 * mask_ + 1;
    std::erase_if(runs_, [this](const Run& run) { return (run.hash & mask_) != 0; });
  }
}

void LogFingerprint::sort(std::vector<Run>& runs) {
  std::sort(runs.begin(), runs.end());
  runs.erase(std::unique(runs.begin(), runs.end()), runs.end());
}

const std::vector<LogFingerprint::Run>& LogFingerprint::sorted_runs() const {
  std::call_once(*sorted_, [this] { sort(runs_); });
  return runs_;
}

LogFingerprint::Relation LogFingerprint::relation_to(const LogFingerprint& other) const {
  const std::uint64_t mask = mask_ | other.mask_;
  std::size_t mine = 0, theirs = 0, shared = 0;
  bool moves = false;
  const std::vector<Run>&ours = sorted_runs(), &others = other.sorted_runs();
  auto a = ours.begin();
  auto b = others.begin();
  while (a != ours.end() || b != others.end()) {
    const bool take_a = b == others.end() || (a != ours.end() && !(*b < *a));
    const bool take_b = a == ours.end() || (b != others.end() && !(*a < *b));
    const Run& run = take_a ? *a : *b;
    if ((run.hash & mask) == 0) {
      mine += take_a ? 1 : 0;
      theirs += take_b ? 1 : 0;
      if (take_a && take_b) {
        ++shared;
        moves = moves || run.moves != 0;
      }
    }
    if (take_a) ++a;
    if (take_b) ++b;
  }
  if (shared == 0) return Relation::kNone;
  if (shared == mine && shared == theirs) return Relation::kSame;
  if (shared == mine) return Relation::kPart;
  if (shared == theirs) return Relation::kWhole;
  return moves ? Relation::kOverlap : Relation::kNone;
}

}  // namespace heft::data
