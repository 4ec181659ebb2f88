#include "heft/identify/judgement.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "heft/host/decompositions.hpp"

namespace heft::identify {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using host::Judgement;
using Rank = host::Verdict;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// "joint 2", "joints 2, 3 and 5".
std::string joints_in_words(const std::vector<int>& joints) {
  std::string text = joints.size() == 1 ? "joint " : "joints ";
  for (std::size_t k = 0; k < joints.size(); ++k) {
    text += fmt::format("{}{}", k == 0 ? "" : k + 1 == joints.size() ? " and " : ", ", joints[k] + 1);
  }
  return text;
}

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
    parts.push_back(
        fmt::format("joint {} ({}, off by {:.{}g} % of its largest torque)", j + 1, share, error.percent,
                    error.percent < 99.5 ? 2 : 3));
  }
  return fmt::format("{}", fmt::join(parts, ", "));
}

/// Symmetric 4 × 4 pseudo-inertia [Σ, h; hᵀ, m] of ten parameters in the order of the model file.
Eigen::Matrix4d pseudo_inertia(const VectorXd& p) {
  const double half_trace = 0.5 * (p[4] + p[6] + p[9]);
  Eigen::Matrix4d J;
  J << half_trace - p[4], -p[5], -p[7], p[1],  //
      -p[5], half_trace - p[6], -p[8], p[2],   //
      -p[7], -p[8], half_trace - p[9], p[3],   //
      p[1], p[2], p[3], p[0];
  return J;
}

/// Scheffé's factor for ten parameters: 95 % for all their combinations at once, whichever the data choose, with
/// `factor` the one of a single parameter.
double simultaneous(double factor) {
  constexpr double kChiSquare10 = 18.307, kNormal = 1.96;
  return std::sqrt(kChiSquare10) * factor / kNormal;
}

/// By how much of its standard deviation the load's pseudo-inertia is negative in its worst direction; 0: a body can
/// have these parameters.
double impossibility(const PayloadRun& run) {
  double worst = 0.0;
  // What is an eigenvector depends on the unit of length; loads of a hand's to an arm's size are looked at.
  for (const double length : {0.03, 0.1, 0.3}) {
    const Eigen::Vector4d scale(1.0 / length, 1.0 / length, 1.0 / length, 1.0);
    const Eigen::Matrix4d J = scale.asDiagonal() * pseudo_inertia(run.parameters) * scale.asDiagonal();
    const MatrixXd directions = eigensystem_of(J).vectors;
    for (int k = 0; k < 4; ++k) {
      const Eigen::Vector4d v = scale.asDiagonal() * directions.col(k);
      VectorXd slope(10);
      for (int i = 0; i < 10; ++i) slope[i] = v.dot(pseudo_inertia(VectorXd::Unit(10, i)) * v);
      const double value = slope.dot(run.parameters);
      const double std = std::sqrt(slope.dot(run.covariance * slope));
      if (value < 0.0 && std > 0.0) worst = std::max(worst, -value / std);
    }
  }
  return worst;
}

bool all(const std::vector<bool>& flags) {
  return !flags.empty() && std::all_of(flags.begin(), flags.end(), [](bool flag) { return flag; });
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
                                               joints_in_words(silent)));
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
    reason += fmt::format(" (--method physical gives links that can exist, for {:.2g} % more error)",
                          100.0 * (std::sqrt(facts.physical_cost_ratio) - 1.0));
  }
  judgement.add(Rank::kDoubtful, reason);
  return judgement;
}

ModelFacts facts_of(const Fit& fit, const MassMatrixCheck& mass) {
  // Friction of 0 comes out a little negative as often as not; it is impossible beyond its interval only, and where it
  // is more than what the joint's torque scatters by (at 1 rad/s or m/s).
  bool possible = has_physical_links(fit.robot);
  for (int i = 0; i < fit.base.count(); ++i) {
    const Column& column = (*fit.columns)[fit.base.kept[static_cast<std::size_t>(i)]];
    if (column.kind != ColumnKind::kCoulomb && column.kind != ColumnKind::kViscous) continue;
    possible = possible && fit.beta[i] + std::max(fit.half_width[i], fit.noise_std[column.joint]) >= 0.0;
  }
  return {fit.base.count(), static_cast<int>(std::count(fit.determined.begin(), fit.determined.end(), true)),
          fit.physically_consistent || possible,
          fit.method == Method::kPhysical ? 0.0 : fit.physical_cost_ratio, mass};
}

Judgement judge(const Fit& fit, const MassMatrixCheck& mass, const std::vector<Score>& held_out,
                const std::vector<Score>& training) {
  Judgement judgement = judge_prediction(held_out.empty() ? training : held_out);
  if (held_out.empty()) {
    judgement.add(Rank::kDoubtful,
                  "the model was not judged on a log that the fit has not seen: give one with --validate");
  }
  judgement.add(judge_model(facts_of(fit, mass)));
  return judgement;
}

Judgement judge(const std::vector<Criterion>& criteria) {
  Judgement judgement;
  for (const Criterion& criterion : criteria) {
    if (criterion.verdict == Verdict::kMissed) {
      judgement.add(Rank::kBad,
                    fmt::format("{}: {:.3g} %, the limit is {} {:g} %", criterion.name, criterion.value,
                                criterion.at_least ? "above" : "below", criterion.limit));
    } else if (criterion.verdict == Verdict::kNotJudged) {
      judgement.add(Rank::kDoubtful, fmt::format("{}: not judged", criterion.name));
    }
  }
  return judgement;
}

Judgement judge_condition(double condition) {
  Judgement judgement;
  if (condition <= kGoodCondition) return judgement;
  const bool bad = !(condition <= kBadCondition);
  judgement.add(bad ? Rank::kBad : Rank::kDoubtful,
                fmt::format("the condition number is {:.3g}, above {:g}: {}", condition,
                            bad ? kBadCondition : kGoodCondition,
                            bad ? "some parameters will not be determined"
                                : "some parameters will have wide intervals; allow a longer motion or more "
                                  "harmonics"));
  return judgement;
}

// Loads --------------------------------------------------------------------------------------------------------

std::string contradiction(const PayloadRun& run) {
  const bool has_mass = !run.mass.identifiable.empty() && run.mass.identifiable[0];
  if (has_mass && run.mass.value[0] + run.mass.half_width[0] < 0.0) {
    return fmt::format(
        "the load weighs {:.3g} kg ± {:.2g} kg, less than nothing: are --baseline and --log "
        "interchanged? Else the model is not that of this arm without load, or the torques "
        "have another sign",
        run.mass.value[0], run.mass.half_width[0]);
  }
  for (Index j = 0; j < run.torque_scale.value.size(); ++j) {
    if (!run.torque_scale.identifiable[static_cast<std::size_t>(j)]) continue;
    const double scale = run.torque_scale.value[j], half = run.torque_scale.half_width[j];
    if (scale + half >= 1.0 / kScaleImpossible && scale - half <= kScaleImpossible) continue;
    return fmt::format(
        "joint {} feels {:.2g} ± {:.2g} times the load that the joints together feel: its "
        "torque has another {} than that of the others; check tau{} (or its torque constant), "
        "or leave it out with --rows",
        j + 1, scale, half, scale < 0.0 ? "sign" : "unit or scale", j + 1);
  }
  const bool has_body = has_mass && all(run.first_moment.identifiable) && all(run.inertia.identifiable);
  if (has_body && run.covariance.size() > 0) {
    const double off = impossibility(run), limit = simultaneous(run.interval_factor);
    if (off > limit) {
      return fmt::format(
          "no body has this mass, centre of mass and inertia: they are impossible by {:.2g} "
          "standard deviations ({:.2g} are allowed for); check that --baseline was recorded "
          "without load and that the URDF is that of this arm",
          off, limit);
    }
  }
  return {};
}

Judgement judge(const PayloadRun& run) {
  Judgement judgement;
  const std::string against = contradiction(run);
  if (!against.empty()) judgement.add(Rank::kBad, against);
  const bool has_mass = !run.mass.identifiable.empty() && run.mass.identifiable[0];
  if (!has_mass) {
    const bool moments = !run.mass_visible && all(run.first_moment.identifiable);
    judgement.add(moments ? Rank::kDoubtful : Rank::kBad,
                  fmt::format("the mass cannot be determined: {}", run.missing));
  } else if (!run.converged_at) {
    judgement.add(Rank::kDoubtful, "the estimate had not converged by the end of the log");
  }
  std::vector<std::string> off;
  for (Index j = 0; j < run.torque_scale.value.size(); ++j) {
    if (!run.torque_scale.identifiable[static_cast<std::size_t>(j)]) continue;
    const double away = std::abs(run.torque_scale.value[j] - 1.0);
    if (away > kScaleOff && away > run.torque_scale.half_width[j]) {
      off.push_back(fmt::format("joint {} {:.2f} ± {:.2f}", j + 1, run.torque_scale.value[j],
                                run.torque_scale.half_width[j]));
    }
  }
  if (!off.empty() && against.empty()) {
    judgement.add(Rank::kDoubtful, fmt::format("the joints disagree about the load; torque scale against all "
                                               "joints together: {}; check the torque constants",
                                               fmt::join(off, ", ")));
  }
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

// Stiffness ----------------------------------------------------------------------------------------------------

Judgement judge(const StiffnessFit& fit, const StiffnessDiagnosis& diagnosis) {
  Judgement judgement;
  std::vector<int> open, wide;
  int known = 0;
  for (std::size_t j = 0; j < fit.joints.size(); ++j) {
    const StiffnessEstimate& joint = fit.joints[j];
    if (joint.group < 0 && joint.why.empty()) continue;  // rigid, as asked for
    if (!joint.has_stiffness()) {
      open.push_back(static_cast<int>(j));
    } else {
      ++known;
      if (joint.stiffness_high > kWideStiffness * joint.stiffness_low) wide.push_back(static_cast<int>(j));
    }
  }
  if (known == 0) judgement.add(Rank::kBad, "no joint's stiffness is determined");
  else if (!open.empty()) {
    judgement.add(Rank::kDoubtful,
                  fmt::format("the stiffness of {} is not determined; measure at other poses or with other "
                              "loads (--plan names some)",
                              joints_in_words(open)));
  }
  if (!wide.empty()) {
    judgement.add(Rank::kDoubtful, fmt::format("the stiffness of {} is known to a factor of {:g} only",
                                               joints_in_words(wide), kWideStiffness));
  }
  if (!(fit.left_out_rms < diagnosis.mean_rms)) {
    judgement.add(Rank::kBad, fmt::format("springs predict poses left out no better ({:.3g} mm) than the "
                                          "mean of the other readings ({:.3g} mm)",
                                          1e3 * fit.left_out_rms, 1e3 * diagnosis.mean_rms));
  }
  return judgement;
}

Judgement judge(const JointEncoderFit& fit, bool rotor_inertia_known) {
  Judgement judgement;
  if (!rotor_inertia_known) {
    judgement.add(
        Rank::kDoubtful,
        "no rotor inertia is known: torque that the rotors take counts as carried by the gears, and "
        "joints look stiffer than they are; give --rotor-inertia, or a --model that has it");
  }
  std::vector<int> open, wide, apart;
  for (const JointStiffness& joint : fit.pooled) {
    if (!joint.identifiable) open.push_back(joint.joint);
    else if (joint.stiffness_upper > kWideStiffness * joint.stiffness_lower) wide.push_back(joint.joint);
  }
  for (const StiffnessAgreement& agreement : fit.agreement) {
    if (!agreement.agrees) apart.push_back(agreement.joint);
  }
  if (!open.empty()) {
    judgement.add(open.size() == fit.pooled.size() ? Rank::kBad : Rank::kDoubtful,
                  fmt::format("the stiffness of {} is not determined", joints_in_words(open)));
  }
  if (!wide.empty()) {
    judgement.add(Rank::kDoubtful, fmt::format("the stiffness of {} is known to a factor of {:g} only",
                                               joints_in_words(wide), kWideStiffness));
  }
  if (!apart.empty()) {
    judgement.add(Rank::kDoubtful,
                  fmt::format("the logs disagree about the stiffness of {}", joints_in_words(apart)));
  }
  return judgement;
}

}  // namespace heft::identify
