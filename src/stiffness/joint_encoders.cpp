#include "heft/stiffness/joint_encoders.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "encoder_agreement.hpp"
#include "encoder_terms.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "heft/statistics/distributions.hpp"

namespace heft::stiffness {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kShortestLog = 5.0;  ///< usable [s]
/// A torque of which less than this share (of its rms change) is its own says nothing of the spring.
constexpr double kOwnTorque = 0.005;
constexpr double kLongestShift = 0.2;  ///< [s]

constexpr std::array kFirst{DeflectionTerm::kOffset, DeflectionTerm::kCompliance, DeflectionTerm::kVelocity,
                            DeflectionTerm::kDirection};

void read_direction(JointStiffness& s, const statistics::Interval& h, double coulomb) {
  DirectionReading& d = s.direction;
  d.loop = {2.0 * h.value, 2.0 * h.std, 2.0 * h.lower, 2.0 * h.upper};
  const double c = s.compliance.value;
  // 2 h = w − 2 c f
  d.lost_motion_if_no_friction = std::max(0.0, d.loop.value);
  if (c > 0) d.friction_if_no_lost_motion = std::max(0.0, -h.value / c);
  d.lost_motion_at_least = std::max(0.0, d.loop.lower);
  if (s.compliance.upper > 0) d.motor_friction_at_least = std::max(0.0, -h.upper / s.compliance.upper);
  if (std::isfinite(coulomb))
    d.lost_motion_at_most = std::max(0.0, d.loop.upper + 2.0 * std::max(0.0, s.compliance.upper) * coulomb);
  constexpr double kMicro = 1e6;
  const std::string most =
      std::isfinite(d.lost_motion_at_most)
          ? fmt::format("at most {:.0f} µrad, were all friction of the joint on the motor's side",
                        kMicro * d.lost_motion_at_most)
          : std::string("unknown without the joint's friction");
  if (d.loop.upper < 0) {
    d.text = fmt::format(
        "loop {:.0f} ± {:.0f} µrad against the motion: at least {:.0f} N·m of friction act on the motor's "
        "side of "
        "the gear, {:.0f} N·m if the gear has no lost motion; lost motion {}",
        kMicro * d.loop.value, kMicro * d.loop.std, d.motor_friction_at_least, d.friction_if_no_lost_motion,
        most);
  } else if (d.loop.lower > 0) {
    d.text = fmt::format(
        "loop {:.0f} ± {:.0f} µrad with the motion: the gear has at least {:.0f} µrad of lost motion, {:.0f} "
        "µrad if "
        "no friction acts on the motor's side of it; {}",
        kMicro * d.loop.value, kMicro * d.loop.std, kMicro * d.lost_motion_at_least,
        kMicro * d.lost_motion_if_no_friction, most);
  } else {
    d.text = fmt::format(
        "loop {:.0f} ± {:.0f} µrad, indistinguishable from none: lost motion and motor-side friction are absent or "
        "cancel; "
        "lost motion {}",
        kMicro * d.loop.value, kMicro * d.loop.std, most);
  }
}

/// Words for a compliance that the log does not show.
std::string why_not(const JointStiffness& s) {
  const statistics::Interval& c = s.compliance;
  if (c.upper <= 0)
    return fmt::format(
        "the deflection goes against the torque (compliance {:.3g} ± {:.2g} rad/(N·m)): check the signs of "
        "qlink{} and "
        "tau{}, or a term is missing",
        c.value, c.std, s.joint + 1, s.joint + 1);
  std::string text = fmt::format(
      "the 95 % interval of the compliance includes 0: the stiffness is at least {:.3g} N·m/rad. The torque "
      "changes by "
      "{:.0f} N·m, of which {:.0f} N·m (rms) could not be any other term",
      1.0 / c.upper, s.torque_range, s.independent_torque);
  if (c.value > 0)
    text += fmt::format("; {:.0f} times as much would give ± 20 %",
                        std::ceil((c.upper - c.lower) / (2.0 * 0.2 * c.value)));
  text += ". Load the joint more, best by another payload or posture at the same speed, or record longer";
  return text;
}

struct Prepared {
  int joint{0};
  double coulomb{kNaN};
};

const std::vector<Index>& torque_column(const EncoderProblem& problem) {
  return problem.term(DeflectionTerm::kCompliance)->columns;
}

/// Torque that no other term could explain, rms [N·m, N]: what is not its own says nothing of the spring.
double own_torque(const EncoderProblem& problem, const std::vector<DeflectionTerm>& terms) {
  const std::vector<Index>& column = torque_column(problem);
  const double share =
      problem.own_power(problem.indices(without(terms, DeflectionTerm::kCompliance)), column);
  return std::sqrt(std::max(0.0, share)) * problem.scale(column.front());
}

/// The terms that every fit begins with, as far as the motion shows them.
std::vector<DeflectionTerm> first_terms(const EncoderProblem& problem, JointStiffness& s) {
  std::vector<DeflectionTerm> used{DeflectionTerm::kOffset};
  for (const DeflectionTerm term : kFirst) {
    if (term == DeflectionTerm::kOffset || term == DeflectionTerm::kCompliance) continue;
    const std::string reason = obstacle(problem, used, term);
    if (reason.empty()) {
      used.push_back(term);
    } else {
      s.notes.push_back(fmt::format("{} left out: {}", to_string(term), reason));
    }
  }
  used.push_back(DeflectionTerm::kCompliance);
  return used;
}

/// A delay is not quite δ q̇: the link's channel is moved by it, until what is left is little.
void settle_shift(EncoderProblem& problem, const std::vector<DeflectionTerm>& terms) {
  for (int i = 0; i < 4; ++i) {
    const std::vector<statistics::Interval> delay =
        coefficients(problem, problem.fit(terms), DeflectionTerm::kVelocity, 1.0);
    const double step = delay.empty() ? 0.0 : delay.front().value;
    const double shift = problem.shift() + step;
    if (std::abs(shift) > kLongestShift) return;
    problem.set_shift(shift);
    problem.set_blocks(problem.block_length());
    if (std::abs(step) < 1e-3 / problem.rate()) return;
  }
}

/// Friction on the motor's side by the reading without lost motion; where the loop speaks for lost motion, none.
double motor_friction(const EncoderProblem& problem, const std::vector<DeflectionTerm>& used) {
  if (!contains(used, DeflectionTerm::kDirection)) return 0.0;
  const EncoderProblem::Fit first = problem.fit(used);
  const double c = coefficients(problem, first, DeflectionTerm::kCompliance, 1.0).front().value;
  const double h = coefficients(problem, first, DeflectionTerm::kDirection, 1.0).front().value;
  return c > 0 && h < 0 && -h / c < 0.5 * problem.torque_range() ? -h / c : 0.0;
}

bool disagree(const statistics::Interval& a, const statistics::Interval& b) {
  return (a.value < b.lower || a.value > b.upper) && (b.value < a.lower || b.value > a.upper);
}

/// Sum of squares of the deflection about its mean in each log.
double squares_about_means(const EncoderProblem& problem, int num_logs) {
  const VectorXd& y = problem.deflection();
  double total = 0.0;
  for (int l = 0; l < num_logs; ++l) {
    double sum = 0.0, squares = 0.0;
    Index count = 0;
    for (Index k = 0; k < y.size(); ++k) {
      if (problem.log_of_row()[static_cast<std::size_t>(k)] != l) continue;
      sum += y[k];
      squares += y[k] * y[k];
      ++count;
    }
    if (count > 0) total += std::max(0.0, squares - sum * sum / static_cast<double>(count));
  }
  return total;
}

/// What speaks for and against a term, in addition to the terms used or as one of them.
/// @param given  terms asked for, or null
/// @param factor  half-width of an interval of the fit, in standard deviations
/// @param scale   of errors in weighted rows to those in the deflection
TermEvidence evidence_of(EncoderProblem& problem, const std::vector<DeflectionTerm>& used,
                         DeflectionTerm term, const std::vector<DeflectionTerm>* given, double factor,
                         double scale) {
  const auto m = static_cast<double>(problem.rows());
  TermEvidence e;
  e.term = term;
  e.used = contains(used, term);
  e.verdict = e.used ? "used" : obstacle(problem, used, term);
  if (!e.used && !e.verdict.empty()) return e;
  const std::vector<DeflectionTerm> less = e.used ? without(used, term) : used;
  const TermTrial trial = try_term(problem, less, term);
  e.coefficients = coefficients(problem, trial.fit, term, factor);
  e.rms_with = scale * std::sqrt(trial.with / m);
  e.rms_without = scale * std::sqrt(trial.without / m);
  e.p_value = trial.p_value;
  e.compliance = coefficients(problem, e.used ? problem.fit(less) : trial.fit, DeflectionTerm::kCompliance,
                              statistics::interval_factor(problem.num_blocks() - 1))
                     .front();
  if (!e.used) {
    e.verdict = !trial.possible               ? "its coefficient has the wrong sign"
                : e.rms_with >= e.rms_without ? "held-out blocks are predicted no better"
                : e.p_value >= kLevel         ? fmt::format("chance explains it (p = {:.2g})", e.p_value)
                : given != nullptr            ? "not asked for"
                                              : "another term explains it better";
  }
  return e;
}

/// The stiffness from the compliance, or why there is none.
void read_stiffness(JointStiffness& s, double rms_torque) {
  // The numbers of a joint that does not deflect at all, or whose torque is another term in disguise, are
  // rounding.
  if (!(s.rms_deflection > 1e-12)) {
    s.reason = fmt::format(
        "qlink{0} repeats q{0} in every sample: not the reading of a second encoder, or it is behind the "
        "same one",
        s.joint + 1);
  } else if (!(s.torque_range > 0) ||
             s.independent_torque < kOwnTorque * std::min(rms_torque, s.torque_range)) {
    s.reason = fmt::format(
        "the torque changes by {:.3g} N·m, of which {:.2g} N·m (rms) could not be any other term of the "
        "deflection: load the joint in more than one way",
        s.torque_range, s.independent_torque);
    s.compliance = uncertain(0.0, kInfinity, 1.0);
  } else if (s.compliance.lower > 0) {
    s.identifiable = true;
  } else {
    s.reason = why_not(s);
  }
  const statistics::Interval& c = s.compliance;
  if (s.rms_deflection > 1e-12 && std::isfinite(c.std)) {
    s.stiffness = statistics::reciprocal(c);
    if (!(c.value > 0)) s.stiffness.value = kNaN;
  }
}

/// Chooses the terms and the weighting, and settles delay, friction and blocks on them. Fills what s says of them.
/// @return factor on the variance
double settle(EncoderProblem& problem, const std::vector<DeflectionTerm>* given, std::optional<double> memory,
              bool model_torque, JointStiffness& s, std::optional<statistics::Interval>& at_odds) {
  problem.set_blocks(problem.shortest_log() / 6.0);
  std::vector<DeflectionTerm> used = first_terms(problem, s);
  settle_shift(problem, used);
  problem.set_friction(model_torque ? 0.0 : motor_friction(problem, used), used);
  problem.set_blocks(problem.block_length());
  std::optional<Chosen> other;
  const Chosen chosen = choose_fit(problem, used, given, memory, other);
  if (given != nullptr) {
    for (const DeflectionTerm term : *given) {
      if (std::find(kCandidates.begin(), kCandidates.end(), term) != kCandidates.end() &&
          !contains(chosen.terms, term))
        s.notes.push_back(
            fmt::format("{} left out: {}", to_string(term), obstacle(problem, chosen.terms, term)));
    }
  }
  used = chosen.terms;
  s.memory = chosen.memory;
  if (other) s.other_weighting = other->compliance;
  if (other && disagree(other->compliance, chosen.compliance)) at_odds = other->compliance;
  problem.set_memory(s.memory);
  problem.set_blocks(problem.block_length());
  settle_shift(problem, used);
  const double edge = set_blocks(problem, problem.fit(used).innovation);
  s.correlation_time = correlation_time_of(problem, problem.fit(used).residual);
  s.terms = used;
  s.independent_torque = own_torque(problem, used);
  s.blocks = problem.num_blocks();
  s.block_length = problem.block_length();
  return edge;
}

/// Compliance, delay and what else the fit holds.
/// @param at_odds  the compliance by the other weighting, where the two disagree
void read_coefficients(const EncoderProblem& problem, const EncoderProblem::Fit& f,
                       const std::optional<statistics::Interval>& at_odds, JointStiffness& s) {
  const double factor = statistics::interval_factor(s.blocks - 1);
  s.compliance = coefficients(problem, f, DeflectionTerm::kCompliance, factor).front();
  if (at_odds) {
    s.compliance.lower = std::min(s.compliance.lower, at_odds->lower);
    s.compliance.upper = std::max(s.compliance.upper, at_odds->upper);
    s.notes.push_back(
        fmt::format("slow and quick changes of the torque give different compliances ({:.3g} and {:.3g} "
                    "rad/(N·m)): a term is missing or is mistaken for another; the interval holds both",
                    s.compliance.value, at_odds->value));
  }
  s.offset = coefficients(problem, f, DeflectionTerm::kOffset, factor);
  s.attenuation = problem.attenuation(problem.indices(without(s.terms, DeflectionTerm::kCompliance)),
                                      torque_column(problem).front());
  if (s.attenuation > 0.05)
    s.notes.push_back(fmt::format(
        "noise of tau{} may lower the compliance by up to {:.0f} %: give a model's torque as instrument",
        s.joint + 1, 100.0 * s.attenuation));
  if (contains(s.terms, DeflectionTerm::kVelocity)) {
    s.time_shift = coefficients(problem, f, DeflectionTerm::kVelocity, factor).front();
    s.time_shift.value += problem.shift();
    s.time_shift.lower += problem.shift();
    s.time_shift.upper += problem.shift();
    s.time_shift_known = true;
  }
  if (contains(s.terms, DeflectionTerm::kPosition))
    s.ratio_error = coefficients(problem, f, DeflectionTerm::kPosition, factor).front();
}

/// Loops of the deflection over the direction of motion and over the torque.
void read_loops(const EncoderProblem& problem, const EncoderProblem::Fit& f, double factor, double coulomb,
                JointStiffness& s) {
  if (contains(s.terms, DeflectionTerm::kDirection))
    read_direction(s, coefficients(problem, f, DeflectionTerm::kDirection, factor).front(), coulomb);
  for (const DeflectionTerm term : {DeflectionTerm::kBacklash, DeflectionTerm::kTorqueHysteresis}) {
    if (!contains(s.terms, term)) continue;
    statistics::Interval u = coefficients(problem, f, term, factor).front();
    u = {2.0 * u.value, 2.0 * u.std, 2.0 * u.lower, 2.0 * u.upper};
    if (!s.gear_hysteresis || term == DeflectionTerm::kTorqueHysteresis) s.gear_hysteresis = u;
  }
  if (s.gear_hysteresis && s.identifiable)
    s.gear_hysteresis_torque = s.gear_hysteresis->value * s.stiffness.value;
}

JointStiffness solve(EncoderProblem& problem, const Prepared& about, int num_logs,
                     const std::vector<DeflectionTerm>* given, std::optional<double> memory,
                     bool model_torque) {
  JointStiffness s;
  s.joint = about.joint;
  s.samples = static_cast<int>(problem.rows());
  s.torque_range = problem.torque_range();
  std::optional<statistics::Interval> at_odds;
  const double edge = settle(problem, given, memory, model_torque, s, at_odds);
  const std::vector<DeflectionTerm> used = s.terms;
  const double factor = statistics::interval_factor(s.blocks - 1);
  const EncoderProblem::Fit f = problem.fit(used, edge);
  const double total = squares_about_means(problem, num_logs);
  const auto m = static_cast<double>(problem.rows());
  const EncoderProblem::Fit rigid = problem.fit(without(used, DeflectionTerm::kCompliance), edge);
  s.rms_deflection = std::sqrt(total / m);
  // Weighted rows are smaller than the rows themselves: put back on their scale.
  const double scale =
      f.innovation.squaredNorm() > 0 ? std::sqrt(f.residual.squaredNorm() / f.innovation.squaredNorm()) : 1.0;
  s.rms = scale * std::sqrt(f.held_out / m);
  s.rms_rigid = scale * std::sqrt(rigid.held_out / m);
  if (total > 0) {
    s.r2 = 1.0 - f.residual.squaredNorm() / total;
    s.torque_share = (rigid.residual.squaredNorm() - f.residual.squaredNorm()) / total;
  }
  read_coefficients(problem, f, at_odds, s);
  for (const DeflectionTerm term : kCandidates) {
    TermEvidence e = evidence_of(problem, used, term, given, factor, scale);
    // Held-out blocks speak for the term, chance cannot be excluded: the answer with it stays possible.
    if (!e.used && e.verdict.starts_with("chance") && std::isfinite(e.compliance.value)) {
      s.compliance.lower = std::min(s.compliance.lower, e.compliance.value);
      s.compliance.upper = std::max(s.compliance.upper, e.compliance.value);
    }
    s.evidence.push_back(std::move(e));
  }
  read_stiffness(s, problem.scale(torque_column(problem).front()));
  read_loops(problem, f, factor, about.coulomb, s);
  return s;
}

void check_options(const std::vector<data::Log>& logs, const JointEncoderOptions& options, int n) {
  const auto size = [&](const std::vector<double>& values, const char* name) {
    if (!values.empty() && static_cast<int>(values.size()) != n)
      throw DataError(fmt::format("{}: {} values given for {} joints: give one a joint, or none", name,
                                  values.size(), n));
  };
  size(options.rotor_inertia, "rotor inertia");
  size(options.coulomb_friction, "Coulomb friction");
  if (options.cutoff < 0 || !(options.sign_width > 0))
    throw DataError("joint encoders: the cut-off must not be negative and the sign width must be above 0");
  if (options.torque == GearTorque::kMeasured) return;
  if (options.model_torque.size() != logs.size())
    throw DataError(fmt::format("model torque: {} matrices given for {} logs: give one a log",
                                options.model_torque.size(), logs.size()));
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const MatrixXd& tau = options.model_torque[l];
    if (tau.rows() != logs[l].num_samples() || tau.cols() != n)
      throw DataError(fmt::format("{}: model torque is {} × {}, expected {} samples × {} joints",
                                  logs[l].path, tau.rows(), tau.cols(), logs[l].num_samples(), n));
  }
}

}  // namespace

std::string to_string(DeflectionTerm term) {
  switch (term) {
    case DeflectionTerm::kOffset: return "offset";
    case DeflectionTerm::kCompliance: return "compliance";
    case DeflectionTerm::kVelocity: return "time shift";
    case DeflectionTerm::kDirection: return "direction of motion";
    case DeflectionTerm::kPosition: return "gear ratio";
    case DeflectionTerm::kEccentricity: return "first harmonic";
    case DeflectionTerm::kSecondHarmonic: return "second harmonic";
    case DeflectionTerm::kDrift: return "drift";
    case DeflectionTerm::kStiffening: return "stiffening";
    case DeflectionTerm::kBacklash: return "backlash";
    case DeflectionTerm::kTorqueHysteresis: return "torque hysteresis";
    case DeflectionTerm::kLoadFriction: return "load friction";
    case DeflectionTerm::kDamping: return "damping";
  }
  return "?";
}

std::vector<int> link_encoder_joints(const data::Log& log) {
  std::vector<int> joints;
  for (int i = 0; i < log.num_joints(); ++i) {
    if (link_column(log, i) != nullptr) joints.push_back(i);
  }
  return joints;
}

JointEncoderFit fit_joint_encoders(const std::vector<data::Log>& logs, const JointEncoderOptions& options) {
  if (logs.empty()) throw DataError("joint encoders: no log given");
  const int n = logs.front().num_joints();
  JointEncoderFit result;
  result.joints = link_encoder_joints(logs.front());
  double bandwidth = 0.0;
  for (const data::Log& log : logs) {
    const std::vector<int> joints = link_encoder_joints(log);
    if (joints.empty())
      throw DataError(
          fmt::format("{}: no column qlink1.. found: stiffness from two encoders needs the link's position "
                      "of at least one of the "
                      "{} joints (motor-side data alone: see the elasticity that `heft diagnose` looks for)",
                      log.path, log.num_joints()));
    if (log.tau.cols() != log.num_joints())
      throw DataError(
          fmt::format("{}: no column tau1.. found: the stiffness is a torque over a deflection", log.path));
    if (log.num_joints() != n || joints != result.joints)
      throw DataError(
          fmt::format("{}: other joints or other qlink columns than in {}: give logs of one robot", log.path,
                      logs.front().path));
    bandwidth = std::max(bandwidth, bandwidth_of(log));
  }
  check_options(logs, options, n);
  double cutoff = options.cutoff;
  if (cutoff == 0.0) cutoff = bandwidth > 0 ? std::max(3.0, 10.0 * bandwidth) : 10.0;

  result.separate.resize(logs.size());
  for (const int joint : result.joints) {
    Prepared about;
    about.joint = joint;
    if (!options.coulomb_friction.empty())
      about.coulomb = options.coulomb_friction[static_cast<std::size_t>(joint)];
    const double rotor =
        options.rotor_inertia.empty() ? 0.0 : options.rotor_inertia[static_cast<std::size_t>(joint)];
    std::vector<std::vector<Stretch>> of_log;
    std::vector<Stretch> all;
    for (std::size_t l = 0; l < logs.size(); ++l) {
      const MatrixXd* model = options.torque == GearTorque::kMeasured ? nullptr : &options.model_torque[l];
      std::vector<Stretch> stretches = stretches_of(logs[l], static_cast<int>(l), joint, model);
      for (Stretch& s : stretches) filter(s, cutoff, rotor, options);
      all.insert(all.end(), stretches.begin(), stretches.end());
      for (Stretch& s : stretches) s.log = 0;
      of_log.push_back(std::move(stretches));
    }
    for (std::size_t l = 0; l < logs.size(); ++l) {
      double usable = 0.0;
      for (const Stretch& s : of_log[l]) usable += s.time[s.time.size() - 1] - s.time[0];
      if (usable < kShortestLog)
        throw DataError(fmt::format(
            "{}: {:.1f} s of samples with q{}, qlink{} and tau{} in stretches of at least {:.0f} s: at least "
            "{:.0f} s "
            "are needed",
            logs[l].path, usable, joint + 1, joint + 1, joint + 1, kShortestStretch, kShortestLog));
    }
    const std::vector<DeflectionTerm>* asked = options.terms ? &*options.terms : nullptr;
    EncoderProblem pooled(std::move(all), static_cast<int>(logs.size()), cutoff);
    result.pooled.push_back(solve(pooled, about, static_cast<int>(logs.size()), asked, options.memory,
                                  options.torque == GearTorque::kModel));
    if (options.rotor_inertia.empty() && options.torque != GearTorque::kModel)
      result.pooled.back().notes.push_back(
          "no rotor inertia given: the part of tau that turns the rotor counts as load of the gear");
    if (logs.size() == 1) {
      result.separate[0].push_back(result.pooled.back());
      continue;
    }
    const std::vector<DeflectionTerm> same = result.pooled.back().terms;
    for (std::size_t l = 0; l < logs.size(); ++l) {
      EncoderProblem own(std::move(of_log[l]), 1, cutoff);
      result.separate[l].push_back(
          solve(own, about, 1, &same, options.memory, options.torque == GearTorque::kModel));
    }
  }
  for (std::size_t l = 0; l < logs.size(); ++l) result.time_shift.push_back(common_shift(result.separate[l]));
  if (logs.size() > 1) {
    for (std::size_t j = 0; j < result.joints.size(); ++j)
      result.agreement.push_back(compare(result.separate, j));
  }
  return result;
}

}  // namespace heft::stiffness
