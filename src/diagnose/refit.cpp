#include "refit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "heft/core/effects/effects.hpp"
#include "heft/data/motion_stream.hpp"
#include "heft/host/parallel.hpp"
#include "heft/model/motion_torque.hpp"
#include "heft/model/without_effects.hpp"
#include "heft/regression/triangular_factor.hpp"
#include "heft/statistics/jackknife.hpp"
#include "heft/statistics/residual_moments.hpp"
#include "heft/validate/predict.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Logs = std::vector<data::Log>;

/// Lengths of the stretches that a validation log is cut into [s], and most and fewest of them: a second holds more than one
/// swing of most motions, and two stretches are the fewest of which one can be fitted and the other judged on.
constexpr double kStretch = 1.0;
constexpr int kMostStretches = 4, kFewestStretches = 2;
/// The errors have to fall to this part, as for a version of the written model that is less simple.
constexpr double kEnough = 0.98;

/// A joint whose error on the training logs rises to this part says that the logs are not of the same arm: where they are, a
/// fit to all costs them little (1.10 at most on measured arms with more than ten seconds; a load of 0.6 kg on a UR5e gives 1.6).
constexpr double kContradiction = 1.25;

/// The log less the torque of the effects.
/// @param level  gravity of the base, which a tilt turns
data::Log less_effects(data::Log log, const model::Robot& robot, const std::array<double, 3>& level) {
  if (robot.couplings.empty() && robot.cables.empty() && robot.effects.empty() && robot.elasticities.empty() &&
      !(robot.torque_delay > 0.0) && robot.gravity == level)
    return log;
  data::StreamOptions options;
  options.displacement = true;
  options.temperature = model::needs_temperature(robot);
  const data::MotionStream stream(log, options);
  model::Robot bare = model::without_effects(robot);
  bare.gravity = level;
  validate::Predictor with(robot, stream.summary().begin), without(bare, stream.summary().begin);
  MatrixXd effects(log.tau.rows(), log.tau.cols());
  Index at = 0;
  stream.for_each([&](const data::MotionChunk& piece) {
    effects.middleRows(at, piece.row_time.size()) = with.rows(piece) - without.rows(piece);
    at += piece.row_time.size();
  });
  log.tau -= effects;
  return log;
}

/// The written model with another base. What that base does not see remains: the gravity of a tilt, and masses that only a tilt
/// shows.
model::Robot with_base(const model::Robot& written, const BaseModel& base, const VectorXd& beta) {
  model::Robot robot = base.robot(beta);
  const model::Robot seen = base.robot(base.parameters(written));
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    for (std::size_t k = 0; k < robot.joints[j].link.size(); ++k)
      robot.joints[j].link[k] += written.joints[j].link[k] - seen.joints[j].link[k];
  }
  robot.gravity = written.gravity;
  robot.effects = written.effects;
  robot.elasticities = written.elasticities;
  robot.couplings = written.couplings;
  robot.cables = written.cables;
  robot.torque_delay = written.torque_delay;
  put_offset_into_pull(robot);
  return robot;
}

/// Begin and end of a stretch [s], of the log's time.
struct Stretch {
  double from, to;
};

/// A stretch that a fit to all the rest is judged on: sums over its rows, n.
struct Judged {
  VectorXd squares;  ///< of the error of the written model
  VectorXd product;  ///< of it and of what the other fit changes
  VectorXd change;   ///< squares of that
  double rows;

  /// Squares of a joint's error after a part of the change.
  double squares_after(Index j, double part) const {
    return squares[j] - 2.0 * part * product[j] + part * part * change[j];
  }
};

/// How long an error goes on as it is: the longest of the joints' correlation times [s].
double correlation_of(const MotionTable& table, const MatrixXd& errors) {
  constexpr double kRate = 50.0;  // [Hz]: errors that matter here go on for longer
  const Index step = std::max<Index>(1, std::lround(table.sample_rate / kRate));
  const Eigen::ArithmeticSequence rows = Eigen::seqN(0, (table.rows() + step - 1) / step, step);
  statistics::ResidualMoments moments(static_cast<int>(errors.cols()));
  for (Index j = 0; j < errors.cols(); ++j)
    moments.add(0, static_cast<int>(j), table.time(rows), errors.col(j)(rows));
  return moments.correlation_time().maxCoeff();
}

/// A validation log, cut.
class CutLog {
 public:
  CutLog(const model::Robot& written, const data::Log& log, const Reading& reading)
      : motion_(written, {log}, reading), errors_(motion_.table().tau - motion_.predicted(written)) {
    const double begin = log.time[0], length = log.time[log.time.size() - 1] - begin;
    const int count = std::clamp(static_cast<int>(length / kStretch), kFewestStretches, kMostStretches);
    for (int k = 0; k < count; ++k)
      stretches_.push_back({begin + length * k / count, begin + length * (k + 1) / count});
    // Next to a stretch the same error goes on: a fit to these rows would know that of the stretch. P. Burman, E. Chow,
    // D. Nolan, Biometrika 81 (1994) 351.
    border_ = std::min(correlation_of(motion_.table(), errors_), 0.5 * length / count);
  }

  int count() const { return static_cast<int>(stretches_.size()); }
  /// Which stretch a row belongs to, and whether to its border with the next one.
  std::pair<int, bool> place_of(double time) const {
    int k = 0;
    while (k + 1 < count() && time > stretches_[static_cast<std::size_t>(k)].to + border_) ++k;
    return {k, k + 1 < count() && time > stretches_[static_cast<std::size_t>(k)].to - border_};
  }

  /// Sums over a stretch.
  /// @param other  a model that was not fitted to it
  Judged judged(int stretch, const model::Robot& other) const {
    const auto [from, to] = stretches_[static_cast<std::size_t>(stretch)];
    const MotionTable& table = motion_.table();
    const MatrixXd others = table.tau - motion_.predicted(other);
    const auto n = errors_.cols();
    Judged sums{VectorXd::Zero(n), VectorXd::Zero(n), VectorXd::Zero(n), 0.0};
    const double begin = stretches_.front().from;
    for (Index i = 0; i < table.rows(); ++i) {
      const double time = table.time[i];
      const bool inside = begin + time >= from && begin + time <= to;
      if (!inside || table.scored[i] == 0.0) continue;
      const VectorXd error = errors_.row(i).transpose(), change = error - others.row(i).transpose();
      sums.squares += error.cwiseAbs2();
      sums.product += error.cwiseProduct(change);
      sums.change += change.cwiseAbs2();
      sums.rows += 1.0;
    }
    return sums;
  }

 private:
  JudgedMotion motion_;
  MatrixXd errors_;  ///< of the written model
  std::vector<Stretch> stretches_;
  double border_;  ///< on each side of a cut [s]
};

/// The written model, and fits of its base to all logs but one stretch.
class LeftOut {
 public:
  LeftOut(const model::Robot& written, const BaseModel& base, const Logs& train, const Logs& validate,
          const Reading& reading)
      : written_(written), base_(base), cuts_(validate.size()) {
    Logs logs = train;
    logs.insert(logs.end(), validate.begin(), validate.end());
    const std::array<double, 3> level = base.robot(base.prior()).gravity;
    host::for_each_parallel(logs.size() + validate.size(), [&](std::size_t k) {
      if (k < logs.size()) {
        logs[k] = less_effects(logs[k], written, level);
      } else {
        cuts_[k - logs.size()].emplace(written, validate[k - logs.size()], reading);
      }
    });
    const auto trained = static_cast<int>(train.size());
    rows_.emplace(base.rows_in_parts(logs, kTraining + kPartsOfALog * static_cast<int>(validate.size()) + 1,
                                     [&](int log, double time) {
                                       return log < trained ? kTraining : part_of(log - trained, time);
                                     }));
  }

  /// Fitted to all.
  VectorXd of_all() const { return base_.identified(*rows_); }

  std::vector<Judged> judged() const {
    std::vector<std::pair<int, int>> places;  // log, stretch
    for (int log = 0; log < static_cast<int>(cuts_.size()); ++log)
      for (int k = 0; k < cut(log).count(); ++k) places.emplace_back(log, k);
    std::vector<Judged> all(places.size());
    host::for_each_parallel(places.size(), [&](std::size_t p) {
      const auto [log, k] = places[p];
      const VectorXd beta = base_.identified(without(log, k));
      all[p] = cut(log).judged(k, with_base(written_, base_, beta));
    });
    return all;
  }

 private:
  /// Parts of the rows: the training logs; of each validation log its stretches, each followed by its border with the next.
  static constexpr int kTraining = 0, kPartsOfALog = 2 * kMostStretches;
  static int part_at(int log, int stretch) { return kTraining + 1 + kPartsOfALog * log + 2 * stretch; }

  const CutLog& cut(int log) const { return *cuts_[static_cast<std::size_t>(log)]; }
  int part_of(int log, double time) const {
    const auto [stretch, border] = cut(log).place_of(time);
    return part_at(log, stretch) + (border ? 1 : 0);
  }

  /// All rows but those of a stretch and of its borders.
  regression::BlockFactors without(int log, int stretch) const {
    const int part = part_at(log, stretch);
    regression::BlockFactors rest(rows_->num_joints(), rows_->num_columns(), rows_->block_length(),
                                  rows_->max_blocks());
    for (int block = 0; block < rows_->num_blocks(); ++block) {
      const regression::BlockPartition::Key& key = rows_->key(block);
      if (key.log >= part - (stretch > 0 ? 1 : 0) && key.log <= part + 1) continue;
      for (int j = 0; j < rows_->num_joints(); ++j) rest.put(key, j, rows_->factor(block, j));
    }
    return rest;
  }

  const model::Robot& written_;
  const BaseModel& base_;
  std::vector<std::optional<CutLog>> cuts_;       ///< the validation logs
  std::optional<regression::BlockFactors> rows_;  ///< of all logs less the effects, by parts
};

/// Variance of a number by the jackknife.
/// @param without_each  the number without one stretch each
double variance_of(const VectorXd& without_each) {
  return statistics::jackknife_covariance((without_each.array() - without_each.mean()).matrix().transpose())(0, 0);
}

/// How far the written model goes towards the fit to all logs, 0 to 1: the part of the change that lowers the errors most,
/// Σ e d / Σ d², with every joint in parts of its own error, times 1 - (s / part)², s its standard error by the jackknife
/// over stretches. Of a part that is known no better than its size nothing is left; W. James, C. Stein, Proc. 4th Berkeley
/// Symp. Math. Statist. Prob. 1 (1961) 361.
double part_of_change(const std::vector<Judged>& judged) {
  const auto count = static_cast<Index>(judged.size());
  VectorXd up = VectorXd::Zero(count), down = up;
  for (Index k = 0; k < count; ++k) {
    const Judged& one = judged[static_cast<std::size_t>(k)];
    for (Index j = 0; j < one.squares.size(); ++j) {
      if (!(one.squares[j] > 0.0)) continue;
      up[k] += one.rows * one.product[j] / one.squares[j];
      down[k] += one.rows * one.change[j] / one.squares[j];
    }
  }
  if (count < 2 || !(down.sum() > 0.0)) return 0.0;
  const double part = up.sum() / down.sum();
  if (!(part > 0.0)) return 0.0;
  VectorXd without_each(count);
  for (Index k = 0; k < count; ++k) {
    const double others = down.sum() - down[k];
    without_each[k] = others > 0.0 ? (up.sum() - up[k]) / others : 0.0;
  }
  return std::clamp(part * (1.0 - variance_of(without_each) / (part * part)), 0.0, 1.0);
}

/// Logarithm of the geometric mean of the errors after a part of the change, against those before.
/// @param but  a stretch that does not count; none: -1
double fall_of(const std::vector<Judged>& judged, double part, Index but = -1) {
  double sum = 0.0;
  int count = 0;
  for (Index j = 0; j < judged.front().squares.size(); ++j) {
    double before = 0.0, after = 0.0;
    for (std::size_t k = 0; k < judged.size(); ++k) {
      if (static_cast<Index>(k) == but) continue;
      const Judged& one = judged[k];
      before += one.squares[j];
      after += one.squares_after(j, part);
    }
    if (!(before > 0.0 && after > 0.0)) continue;
    sum += 0.5 * std::log(after / before);
    ++count;
  }
  return count > 0 ? sum / count : 0.0;
}

/// Error of each joint on stretches of logs with fits that leave them out, against that of the model that was fitted to all of
/// them: how much better a short log is explained than it is known, n.
VectorXd rise_left_out(const model::Robot& written, const BaseModel& base, const Logs& fitted, const Reading& reading) {
  const std::vector<Judged> judged = LeftOut(written, base, {}, fitted, reading).judged();
  VectorXd before = VectorXd::Zero(judged.front().squares.size()), after = before;
  for (const Judged& one : judged) {
    before += one.squares;
    for (Index j = 0; j < after.size(); ++j) after[j] += one.squares_after(j, 1.0);
  }
  return after.cwiseQuotient(before).cwiseSqrt();
}

/// Its standard error, by the jackknife over stretches.
double spread_of_fall(const std::vector<Judged>& judged, double part) {
  const auto count = static_cast<Index>(judged.size());
  VectorXd without_each(count);
  for (Index k = 0; k < count; ++k) without_each[k] = fall_of(judged, part, k);
  return std::sqrt(variance_of(without_each));
}

}  // namespace

Refit refit(const WrittenModel& written, const BaseModel& base, const Logs& train, const JudgedMotion& trained,
            const Logs& validate, const Reading& reading) {
  const model::Robot robot = written.robot();
  const LeftOut left_out(robot, base, train, validate, reading);
  const std::vector<Judged> judged = left_out.judged();
  const double part = part_of_change(judged), fall = fall_of(judged, part), ratio = std::exp(fall);
  // A gain that the stretches do not agree on to its size is none: the rule of one standard error.
  if (!(ratio < kEnough && fall < -spread_of_fall(judged, part))) {
    return {{},
            "the model written is fitted to the training logs alone: a fit to the validation logs as well does not lower the "
            "errors on stretches of these that it leaves out by 2 % and by more than chance"};
  }
  const VectorXd once = base.parameters(robot);
  const model::Robot again = with_base(robot, base, once + part * (left_out.of_all() - once));
  const VectorXd rise =
      trained.rms_error(trained.predicted(again)).cwiseQuotient(trained.rms_error(trained.predicted(robot)));
  VectorXd most_rise = VectorXd::Constant(rise.size(), kContradiction);
  // The errors on a short log are too small: with any other log they rise.
  if (!(rise.maxCoeff() < kContradiction))
    most_rise = most_rise.cwiseMax(rise_left_out(robot, base, train, reading));
  Index most = 0;
  const double against = rise.cwiseQuotient(most_rise).maxCoeff(&most);
  if (!(rise.array().log().mean() < -fall && against < 1.0)) {
    return {{},
            fmt::format("the model written is fitted to the training logs alone: the validation logs contradict them, as if the "
                        "arm carried something else there (a fit to all would raise the error of joint {} on the training logs "
                        "by {:.0f} %)",
                        most + 1, 100.0 * (rise[most] - 1.0)),
            true};
  }
  return {Refitted{again, part, ratio, {}},
          fmt::format("the model written goes {:.0f} % of the way to a fit to all logs, validation logs included: on stretches "
                      "of these that such fits leave out it has {:.3f} of the errors above. These logs cannot judge it any "
                      "more; give another one to heft validate, or write the model above with --no-refit",
                      100.0 * part, ratio)};
}

void put_offset_into_pull(model::Robot& robot) {
  const auto taken = [&](int joint, double stiffness, double& neutral) {
    double& offset = robot.joints[static_cast<std::size_t>(joint)].actuation.friction_offset;
    const double all = stiffness > 0.0 ? std::exchange(offset, 0.0) : 0.0;
    if (all != 0.0) neutral -= all / stiffness;
    return all;
  };
  for (JointCable<double>& cable : robot.cables) {
    const double more = taken(cable.driven, cable.stiffness, cable.neutral);
    robot.joints[static_cast<std::size_t>(cable.driving)].actuation.friction_offset -= cable.ratio * more;
  }
  for (JointEffect<double>& effect : robot.effects) {
    if (effect.kind == joint_effect_kind<Spring>()) taken(effect.joint, effect.parameters[0], effect.parameters[1]);
  }
}

model::FitRecord with_values_of(const model::Robot& again, const model::Robot& once, const BaseModel& base,
                                model::FitRecord parameters) {
  const VectorXd beta = base.parameters(again);
  for (Index c = 0; c < base.columns(); ++c)
    parameters.base_parameters[static_cast<std::size_t>(c)].value = beta[c];
  // What is a part of the declared friction changes with it.
  for (model::EffectCoefficientRecord& record : parameters.effect_coefficients) {
    const JointEffect<double>& effect = again.effects[static_cast<std::size_t>(record.effect)];
    const auto friction = [&](const model::Robot& robot) {
      const JointActuation<double>& joint = robot.joints[static_cast<std::size_t>(effect.joint)].actuation;
      if (effect.kind == joint_effect_kind<Hysteresis>()) return joint.coulomb_friction;
      if (effect.kind != joint_effect_kind<FrictionDrift>()) return 1.0;
      return record.coefficient == 0 ? joint.coulomb_friction : joint.viscous_friction;
    };
    if (friction(once) > 0.0) record.value *= friction(again) / friction(once);
    if (effect.kind == joint_effect_kind<Spring>() && record.coefficient == 1)
      record.value = -effect.parameters[0] * effect.parameters[1];
  }
  return parameters;
}

}  // namespace heft::diagnose
