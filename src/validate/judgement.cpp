#include "heft/validate/judgement.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "heft/host/numbers.hpp"
#include "heft/host/words.hpp"

namespace heft::validate {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using host::Judgement;
using Rank = host::Verdict;

/// What one joint's error is on the log where it is worst.
struct JointError {
  double share{kNaN}, percent{kNaN};
  Rank rank{Rank::kGood};
  bool silent{false};  ///< its torque never changes
};

Rank rank_of(double share, double percent) {
  if (!std::isfinite(share) || !std::isfinite(percent)) return Rank::kDoubtful;
  if (share < kBadShare && percent > kBadPercent) return Rank::kBad;
  return share >= kGoodShare || percent <= kGoodPercent ? Rank::kGood : Rank::kDoubtful;
}

std::vector<JointError> worst_errors(const std::vector<Score>& scores) {
  std::vector<JointError> worst(static_cast<std::size_t>(scores.front().num_joints()));
  bool first = true;
  for (const Score& score : scores) {
    const VectorXd share = explained_share(score);
    for (std::size_t j = 0; j < worst.size(); ++j) {
      const auto at = static_cast<Index>(j);
      JointError error{share[at],
                       score.band > 0 ? score.in_band_percent_of_max[at] : score.percent_of_max[at]};
      error.rank = rank_of(error.share, error.percent);
      error.silent = !std::isfinite(share[at]);
      const bool worse =
          error.rank > worst[j].rank || (error.rank == worst[j].rank && !(error.share >= worst[j].share));
      if (first || worse) worst[j] = error;
    }
    first = false;
  }
  return worst;
}

/// "joint 5 (20 % explained, off by 18 % of its largest torque)".
std::string errors_in_words(const std::vector<JointError>& errors, Rank rank) {
  std::vector<std::string> parts;
  for (std::size_t j = 0; j < errors.size(); ++j) {
    const JointError& error = errors[j];
    if (error.rank != rank || error.silent) continue;
    const std::string share = error.share < 0.0 ? "predicted worse than by its mean"
                                                : fmt::format("{:.0f} % explained", 100.0 * error.share);
    parts.push_back(fmt::format("joint {} ({}, off by {:.{}g} % of its largest torque)", j + 1, share,
                                error.percent, error.percent < 99.5 ? 2 : 3));
  }
  return fmt::format("{}", fmt::join(parts, ", "));
}

}  // namespace

VectorXd explained_share(const Score& score) {
  const Index n = score.rmse.size();
  if (score.torque_variance.size() != n) return VectorXd::Constant(n, kNaN);
  return VectorXd::NullaryExpr(n, [&](Index j) {
    const double error = std::pow(score.rmse[j], 2);
    const double in_band = score.band > 0 ? std::pow(score.rmse_in_band[j], 2) : error;
    const double torque = score.torque_variance[j] - std::max(0.0, error - in_band);
    if (!(score.torque_variance[j] > 0.0)) return kNaN;
    // More above the band than the torque varies in all: nothing of the torque is in the band.
    return torque > 0.0 ? 1.0 - in_band / torque : 1.0 - error / score.torque_variance[j];
  });
}

Judgement judge_prediction(const std::vector<Score>& held_out) {
  Judgement judgement;
  if (held_out.empty()) return judgement;
  const std::vector<JointError> errors = worst_errors(held_out);
  std::vector<int> silent;
  for (std::size_t j = 0; j < errors.size(); ++j) {
    if (errors[j].silent) silent.push_back(static_cast<int>(j));
  }
  const std::string bad = errors_in_words(errors, Rank::kBad);
  if (!bad.empty()) {
    judgement.add(Rank::kBad, fmt::format("less than {:.0f} % of the torque's variation is explained in {}",
                                          100.0 * kBadShare, bad));
  }
  const std::string doubtful = errors_in_words(errors, Rank::kDoubtful);
  if (!doubtful.empty()) {
    judgement.add(Rank::kDoubtful,
                  fmt::format("less than {:.0f} % of the torque's variation is explained in {}",
                              100.0 * kGoodShare, doubtful));
  }
  if (silent.size() == errors.size()) {
    judgement.add(Rank::kBad, "the measured torque never changes: there is nothing to judge the model by");
  } else if (!silent.empty()) {
    judgement.add(Rank::kDoubtful, fmt::format("the measured torque of {} never changes: there is nothing to "
                                               "judge the model by",
                                               host::joints_in_words(silent)));
  }
  return judgement;
}

Judgement judge_model(const ModelFacts& facts) {
  Judgement judgement;
  if (facts.parameters > 0) {
    const double share = static_cast<double>(facts.determined) / facts.parameters;
    if (share < kGoodDetermined) {
      const bool bad = share < kBadDetermined;
      judgement.add(bad ? Rank::kBad : Rank::kDoubtful,
                    fmt::format("the logs determine {} of {} base parameters, fewer than {}; the rest comes "
                                "from the robot's description: record the motions that are missing",
                                facts.determined, facts.parameters, bad ? "one in eight" : "half"));
    }
  }
  // Base parameters do not say which link holds what. Where the mass matrix is sound and links that can exist do as
  // well, an impossible one is a matter of how the parameters were shared out.
  const bool free_of_charge =
      facts.physical_cost_ratio > 0.0 && std::sqrt(facts.physical_cost_ratio) - 1.0 <= kPhysicsCosts;
  if (facts.mass.not_positive == 0 &&
      (facts.physically_consistent || (facts.mass.poses > 0 && free_of_charge))) {
    return judgement;
  }
  std::string reason;
  if (facts.mass.not_positive > 0) {
    reason = fmt::format("the mass matrix of the links is not positive definite in {} of {} poses",
                         facts.mass.not_positive, facts.mass.poses);
    if (facts.mass.not_positive_with_rotors > 0) {
      reason += fmt::format(
          ", nor with rotor inertia in {} of them: not for simulation nor for control that inverts it",
          facts.mass.not_positive_with_rotors);
    }
  } else {
    reason = "a link or the friction of a joint is physically impossible";
  }
  if (facts.physical_cost_ratio > 0.0) {
    reason += fmt::format(" (--method physical gives physically possible links, for {:.2g} % more error)",
                          100.0 * (std::sqrt(facts.physical_cost_ratio) - 1.0));
  }
  judgement.add(Rank::kDoubtful, reason);
  return judgement;
}

Judgement judge_against_truth(const std::string& what, double value, double half_width, double truth) {
  Judgement judgement;
  if (!std::isfinite(value) || !std::isfinite(half_width)) {
    judgement.add(Rank::kBad, what + " was not determined");
    return judgement;
  }
  const double off = std::abs(value - truth);
  if (off <= half_width) return judgement;
  judgement.add(off > kFarOff * half_width ? Rank::kBad : Rank::kDoubtful,
                fmt::format("{} is off its true value by {:.2g}, more than its 95 % interval of ± {:.2g}",
                            what, off, half_width));
  return judgement;
}

Judgement judge_improvement(const std::string& what, double value, const std::string& against,
                            double reference) {
  Judgement judgement;
  if (value <= (1.0 + kMayRise) * reference) return judgement;
  judgement.add(value > kFarOff * reference || !std::isfinite(value) ? Rank::kBad : Rank::kDoubtful,
                fmt::format("{} is {:.3g} times {}", what, value / reference, against));
  return judgement;
}

}  // namespace heft::validate
