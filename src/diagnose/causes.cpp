#include "causes.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "motion_scores.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Share of a structure that a cause has to account for. Half: it is then larger than all others together.
constexpr double kMostOfIt = 0.5;
/// Share of a structure from which on a function of the motion is part of it: noise that is correlated in time leaves
/// estimates of less.
constexpr double kPartOfIt = 0.1;
/// Cut-offs below are lower than the highest that the search tries: a higher one did worse [Hz].
constexpr double kLowered = 21.0;
/// Highest cut-off that the search tries, in parts of the sample rate.
constexpr double kHighest = 0.4;
/// Validation logs that leave so many times the residual of the training logs hold something else (a load, a contact),
/// beside which the ceiling does not show what is left of the training logs.
constexpr double kOther = 2.0;
/// Rows of one log that are rounded: enough for an rms, however long the log.
constexpr Index kMostRows = 6000;

double value_of(const Unexplained& unexplained, std::string_view name) {
  for (const auto& [key, value] : unexplained.evidence) {
    if (key.starts_with(name)) return value;
  }
  return 0.0;
}

Cause cause_of(const Unexplained& u, const Ceiling& ceiling, double quantisation) {
  const double structure = value_of(u, "share_above_noise"), rms = value_of(u, "rms");
  if (value_of(u, "share: vibrates") > kMostOfIt * structure) return Cause::kVibration;
  if (std::pow(quantisation / rms, 2) > kMostOfIt * structure) return Cause::kQuantisation;
  if (!std::isfinite(ceiling.explainable)) return Cause::kUnknown;
  if (ceiling.rms * std::sqrt(1.0 - ceiling.explained) > kOther * rms) return Cause::kUnknown;
  if (ceiling.unknown() > kPartOfIt * structure) return Cause::kMotion;
  // What drifts, swings or goes with one quantity has a name already, and the logs may be too short to learn it.
  if (value_of(u, "share: ") > kMostOfIt * structure) return Cause::kUnknown;
  return Cause::kNoise;
}

}  // namespace

const char* to_string(Cause cause) {
  switch (cause) {
    case Cause::kUnknown: return "unknown";
    case Cause::kMotion: return "motion";
    case Cause::kVibration: return "vibration";
    case Cause::kQuantisation: return "quantisation";
    case Cause::kNoise: return "noise";
  }
  return "unknown";
}

VectorXd quantisation_error(const model::Robot& robot, const Traces& motion, const VectorXd& steps,
                            double cutoff) {
  data::Log smooth;
  smooth.path = motion.log;
  const Index rows = std::min(kMostRows, motion.time.size());
  smooth.time = motion.time.head(rows);
  smooth.q = motion.q.topRows(rows);
  smooth.tau = MatrixXd::Zero(rows, motion.q.cols());
  data::Log rounded = smooth;
  for (Index j = 0; j < steps.size(); ++j) {
    if (steps[j] > 0.0) rounded.q.col(j) = (smooth.q.col(j).array() / steps[j]).round().matrix() * steps[j];
  }
  const JudgedMotion as_it_is(robot, {smooth}, Reading{cutoff}), in_steps(robot, {rounded}, Reading{cutoff});
  const MatrixXd error = in_steps.predicted(robot) - as_it_is.predicted(robot);
  const MatrixXd counted = error.cwiseProduct(as_it_is.table().keep);
  return (counted.colwise().squaredNorm().array() / as_it_is.table().keep.colwise().sum().array().max(1.0))
      .sqrt()
      .matrix()
      .transpose();
}

void name_causes(const std::vector<data::Log>& train, Diagnosis& diagnosis) {
  if (diagnosis.unexplained.empty() || train.empty() || diagnosis.train.empty()) return;
  const VectorXd steps = encoder_steps(train.front());
  // Coarse steps show twice: as noise, and as the motion that is lost to the low-pass that keeps this noise out. So
  // they are judged by the noise of the next cut-off, which was refused.
  const VectorXd& time = diagnosis.train.front().time;
  const double rate = static_cast<double>(time.size() - 1) / (time[time.size() - 1] - time[0]);
  const double next = std::min(2.0 * diagnosis.cutoff, kHighest * rate);
  const double cutoff = diagnosis.cutoff < kLowered ? std::max(diagnosis.cutoff, next) : diagnosis.cutoff;
  const VectorXd quantisation = quantisation_error(diagnosis.after, diagnosis.train.front(), steps, cutoff);
  for (Unexplained& u : diagnosis.unexplained) {
    if (u.joint < 0 || static_cast<std::size_t>(u.joint) >= diagnosis.ceilings.size()) continue;
    const Ceiling& ceiling = diagnosis.ceilings[static_cast<std::size_t>(u.joint)];
    u.cause = cause_of(u, ceiling, quantisation[u.joint]);
    if (u.cause == Cause::kMotion)
      u.evidence.emplace_back("share: any function of the motion (validation)", ceiling.unknown());
    if (u.cause == Cause::kQuantisation) u.evidence.emplace_back("encoder_step", steps[u.joint]);
    if (!u.is_noise()) continue;
    const std::string why =
        u.cause == Cause::kQuantisation
            ? fmt::format("the encoders' steps of {:.2g} cause as much at {:.3g} Hz", steps[u.joint], cutoff)
            : std::string("no function of the motion was found that explains it");
    u.what = fmt::format("{:.0f} % of the squared residual is correlated noise: {}",
                         100.0 * value_of(u, "share_above_noise"), why);
  }
}

}  // namespace heft::diagnose
