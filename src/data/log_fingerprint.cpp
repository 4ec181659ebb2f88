#include "log_fingerprint.hpp"

#include <algorithm>

#include "heft/host/hash.hpp"

namespace heft::data {

using host::bits_of;
using host::combine;

namespace {

/// Runs kept before every other one is dropped: 8 MB at most.
constexpr std::size_t kMostRuns = std::size_t{1} << 20U;

}  // namespace

void LogFingerprint::add(const Eigen::Ref<const Eigen::MatrixXd>& q,
                         const Eigen::Ref<const Eigen::MatrixXd>& tau) {
  last_q_.resize(static_cast<std::size_t>(q.cols()));
  for (Eigen::Index k = 0; k < q.rows(); ++k, ++rows_) {
    std::uint64_t hash = 0;
    bool changed = false;
    for (Eigen::Index j = 0; j < q.cols(); ++j) {
      hash = combine(hash, bits_of(q(k, j)));
      changed = changed || q(k, j) != last_q_[static_cast<std::size_t>(j)];
      last_q_[static_cast<std::size_t>(j)] = q(k, j);
    }
    for (Eigen::Index j = 0; j < tau.cols(); ++j) hash = combine(hash, bits_of(tau(k, j)));
    const auto at = static_cast<std::size_t>(rows_ % kRun);
    recent_[at] = hash;
    changed_[at] = changed;
    if (rows_ + 1 < kRun) continue;
    Run run{0, std::count(changed_.begin(), changed_.end(), true) >= kRun / 2 ? 1U : 0U};
    for (std::size_t i = 1; i <= kRun; ++i) run.hash = combine(run.hash, recent_[(at + i) % kRun]);
    keep(run);
  }
}

void LogFingerprint::keep(const Run& run) {
  if ((run.hash & mask_) != 0) return;
  runs_.push_back(run);
  if (runs_.size() > kMostRuns) thin_out();
}

/// Drops every other kept run, chosen by one more bit of its hash.
void LogFingerprint::thin_out() {
  finish();  // an arm that rests repeats itself
  while (runs_.size() > kMostRuns / 2) {
    mask_ = 2 * mask_ + 1;
    std::erase_if(runs_, [this](const Run& run) { return (run.hash & mask_) != 0; });
  }
}

void LogFingerprint::finish() {
  std::sort(runs_.begin(), runs_.end());
  runs_.erase(std::unique(runs_.begin(), runs_.end()), runs_.end());
}

LogFingerprint::Relation LogFingerprint::relation_to(const LogFingerprint& other) const {
  const std::uint64_t mask = mask_ | other.mask_;
  std::size_t mine = 0, theirs = 0, shared = 0;
  bool moves = false;
  auto a = runs_.begin();
  auto b = other.runs_.begin();
  while (a != runs_.end() || b != other.runs_.end()) {
    const bool take_a = b == other.runs_.end() || (a != runs_.end() && !(*b < *a));
    const bool take_b = a == runs_.end() || (b != other.runs_.end() && !(*a < *b));
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
