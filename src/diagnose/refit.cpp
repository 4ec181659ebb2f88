#include "refit.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "heft/data/log_part.hpp"
#include "heft/data/motion_stream.hpp"
#include "heft/model/without_effects.hpp"
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
/// Shortest part of a log that is fitted [s]: behind its ends, where no motion is derived, some is left.
constexpr double kShortest = 1.0;
/// The errors have to fall to this part, as for a version of the written model that is less simple.
constexpr double kEnough = 0.98;

/// The log less the torque of the effects.
data::Log less_effects(data::Log log, const model::Robot& robot) {
  data::StreamOptions options;
  options.displacement = true;
  const data::MotionStream stream(log, options);
  validate::Predictor with(robot, stream.summary().begin),
      without(model::without_effects(robot), stream.summary().begin);
  MatrixXd effects(log.tau.rows(), log.tau.cols());
  Index at = 0;
  stream.for_each([&](const data::MotionChunk& piece) {
    effects.middleRows(at, piece.row_time.size()) = with.rows(piece) - without.rows(piece);
    at += piece.row_time.size();
  });
  log.tau -= effects;
  return log;
}

/// The written model with another base.
model::Robot with_base(const model::Robot& written, const BaseModel& base, const VectorXd& beta) {
  model::Robot robot = base.robot(beta);
  robot.effects = written.effects;
  robot.elasticities = written.elasticities;
  robot.couplings = written.couplings;
  robot.torque_delay = written.torque_delay;
  return robot;
}

/// Begin and end of a stretch [s], of the log's time.
struct Stretch {
  double from, to;
};

std::vector<Stretch> stretches_of(const data::Log& log) {
  const double begin = log.time[0], length = log.time[log.time.size() - 1] - begin;
  const int count = std::clamp(static_cast<int>(length / kStretch), kFewestStretches, kMostStretches);
  std::vector<Stretch> stretches;
  for (int k = 0; k < count; ++k)
    stretches.push_back({begin + length * k / count, begin + length * (k + 1) / count});
  return stretches;
}

/// What is left of a log without a stretch, as logs of their own.
Logs without_stretch(const data::Log& log, const Stretch& out) {
  const double begin = log.time[0], end = log.time[log.time.size() - 1];
  Logs parts;
  if (out.from - begin >= kShortest) parts.push_back(data::part_of(log, begin, out.from));
  if (end - out.to >= kShortest) parts.push_back(data::part_of(log, out.to, end));
  return parts;
}

/// A stretch that a fit to all the rest is judged on: sums over its rows, n.
struct Judged {
  VectorXd squares;  ///< of the error of the written model
  VectorXd product;  ///< of it and of what the other fit changes
  VectorXd change;   ///< squares of that
  double rows;
};

/// The written model, and fits of its base to all logs but one stretch.
class LeftOut {
 public:
  LeftOut(const model::Robot& written, const BaseModel& base, const Logs& train, const Logs& validate,
          const Reading& reading)
      : written_(written), base_(base), reading_(reading), validate_(validate) {
    for (const data::Log& log : train) train_.push_back(less_effects(log, written));
    for (const data::Log& log : validate) corrected_.push_back(less_effects(log, written));
  }

  /// Fitted to all.
  VectorXd of_all() const { return base_.identified(together(train_, corrected_)); }

  std::vector<Judged> judged() const {
    std::vector<Judged> all;
    for (std::size_t log = 0; log < validate_.size(); ++log) {
      const JudgedMotion motion(written_, {validate_[log]}, reading_);
      const MatrixXd errors = motion.table().tau - motion.predicted(written_);
      for (const Stretch& out : stretches_of(validate_[log])) {
        const VectorXd beta = base_.identified(together(train_, rest(log, out)));
        const MatrixXd others =
            motion.table().tau - motion.predicted(with_base(written_, base_, beta));
        all.push_back(sums(motion.table(), validate_[log].time[0], out, errors, others));
      }
    }
    return all;
  }

 private:
  static Logs together(Logs first, const Logs& second) {
    first.insert(first.end(), second.begin(), second.end());
    return first;
  }

  /// The validation logs without a stretch of one of them.
  Logs rest(std::size_t log, const Stretch& out) const {
    Logs logs;
    for (std::size_t k = 0; k < corrected_.size(); ++k)
      logs = together(std::move(logs), k == log ? without_stretch(corrected_[k], out) : Logs{corrected_[k]});
    return logs;
  }

  /// @param begin  of the log [s]
  static Judged sums(const MotionTable& table, double begin, const Stretch& out, const MatrixXd& errors,
                     const MatrixXd& others) {
    Judged sums{VectorXd::Zero(errors.cols()), VectorXd::Zero(errors.cols()), VectorXd::Zero(errors.cols()),
                0.0};
    const double end = table.time[table.rows() - 1];
    for (Index i = 0; i < table.rows(); ++i) {
      const double time = table.time[i];
      const bool inside = begin + time >= out.from && begin + time <= out.to;
      if (!inside || time < validate::kScoreEnd || end - time < validate::kScoreEnd) continue;
      const VectorXd error = errors.row(i).transpose(), change = error - others.row(i).transpose();
      sums.squares += error.cwiseAbs2();
      sums.product += error.cwiseProduct(change);
      sums.change += change.cwiseAbs2();
      sums.rows += 1.0;
    }
    return sums;
  }

  const model::Robot& written_;
  const BaseModel& base_;
  const Reading& reading_;
  const Logs& validate_;
  Logs train_, corrected_;  ///< less the effects
};

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
  const double n = static_cast<double>(count);
  const double variance = (n - 1.0) / n * (without_each.array() - without_each.mean()).square().sum();
  return std::clamp(part * (1.0 - variance / (part * part)), 0.0, 1.0);
}

/// Geometric mean of the errors after a part of the change, against those before.
double ratio_of(const std::vector<Judged>& judged, double part) {
  double sum = 0.0;
  int count = 0;
  for (Index j = 0; j < judged.front().squares.size(); ++j) {
    double before = 0.0, after = 0.0;
    for (const Judged& one : judged) {
      before += one.squares[j];
      after += one.squares[j] - 2.0 * part * one.product[j] + part * part * one.change[j];
    }
    if (!(before > 0.0 && after > 0.0)) continue;
    sum += 0.5 * std::log(after / before);
    ++count;
  }
  return count > 0 ? std::exp(sum / count) : 1.0;
}

}  // namespace

std::optional<Refit> refit(const WrittenModel& written, const BaseModel& base, const Logs& train,
                           const Logs& validate, const Reading& reading) {
  const model::Robot robot = written.robot();
  const LeftOut left_out(robot, base, train, validate, reading);
  const std::vector<Judged> judged = left_out.judged();
  const double part = part_of_change(judged), ratio = ratio_of(judged, part);
  if (!(ratio < kEnough)) return {};
  const VectorXd once = base.parameters(robot);
  return Refit{with_base(robot, base, once + part * (left_out.of_all() - once)), part, ratio};
}

}  // namespace heft::diagnose
