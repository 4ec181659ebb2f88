#include "motion_scores.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "heft/data/differentiate.hpp"
#include "heft/host/parallel.hpp"
#include "heft/model/motion_torque.hpp"
#include "heft/validate/predict.hpp"

namespace heft::diagnose {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

Reading reading_of(const Diagnosis& diagnosis) {
  return diagnosis.ordinary_motion ? Reading{.cutoff = 0.0, .ordinary = true} : Reading{diagnosis.cutoff};
}

std::vector<data::MotionStream> streams_of(const std::vector<data::Log>& logs, const Reading& reading) {
  std::vector<data::MotionStream> streams;
  data::StreamOptions options;
  options.motion.cutoff = reading.cutoff;
  options.displacement = true;
  options.temperature = true;
  if (!reading.ordinary) {
    options.motion.smooth_position = true;
    options.prefer_logged = false;
    // The table marks standstill, and its rows count for friction that remembers.
    options.cut_standstill = false;
  }
  for (const data::Log& log : logs) streams.emplace_back(log, options);
  return streams;
}

namespace {

std::shared_ptr<MotionTable> table_of(const model::Robot& robot,
                                            const std::vector<data::MotionStream>& streams,
                                            const std::vector<data::Log>& logs) {
  std::vector<const data::MotionStream*> list;
  for (const auto& s : streams) list.push_back(&s);
  std::vector<bool> prismatic;
  for (const auto& joint : robot.joints) prismatic.push_back(joint.joint.type == JointType::kPrismatic);
  TableOptions options;
  double seconds = 0.0;
  for (const data::MotionStream* log : list) seconds += log->summary().end - log->summary().begin;
  // Long blocks hold what is correlated together; a short log needs enough of them.
  options.block_seconds = std::clamp(seconds / 30.0, 0.15, 1.0);
  MotionTable table = make_table(list, prismatic, options);
  for (const data::Log& log : logs) {
    const VectorXd steps = encoder_steps(log);
    table.encoder_step = table.encoder_step.size() > 0 ? VectorXd(table.encoder_step.cwiseMin(steps)) : steps;
  }
  return std::make_shared<MotionTable>(std::move(table));
}

/// Rows of one log of a table, or of a section of it.
struct Run {
  Index begin, count;
};
/// @param begin  first row of each, and one past the last
std::vector<Run> runs_between(const std::vector<Index>& begin) {
  std::vector<Run> runs;
  for (std::size_t r = 0; r + 1 < begin.size(); ++r) runs.push_back({begin[r], begin[r + 1] - begin[r]});
  return runs;
}
std::vector<Run> runs_of(const MotionTable& table) { return runs_between(table.run_begin); }

/// The same rows in pieces that are worth a job.
std::vector<Run> cut(const std::vector<Run>& runs) {
  constexpr Index kPiece = 2048;
  std::vector<Run> pieces;
  for (const Run& run : runs) {
    for (Index from = 0; from < run.count; from += kPiece)
      pieces.push_back({run.begin + from, std::min(kPiece, run.count - from)});
  }
  return pieces;
}

}  // namespace

JudgedMotion::JudgedMotion(const model::Robot& robot, const std::vector<data::Log>& logs,
                           const Reading& reading)
    : streams_(std::make_shared<const std::vector<data::MotionStream>>(streams_of(logs, reading))),
      table_(table_of(robot, *streams_, logs)),
      sign_width_(reading.ordinary ? validate::kSignWidth : table_->sign_width.maxCoeff()) {}

void JudgedMotion::take_joint_of(const JudgedMotion& other, int joint) {
  if (table_.use_count() > 1) table_ = std::make_shared<MotionTable>(*table_);
  table_->take_motion(*other.table_, joint);
}

JudgedMotion JudgedMotion::with_cutoffs(const model::Robot& robot, const std::vector<data::Log>& logs,
                                        const VectorXd& cutoffs) const {
  std::vector<double> higher;
  for (const double hz : cutoffs) {
    if (hz > cutoffs.minCoeff() && std::count(higher.begin(), higher.end(), hz) == 0) higher.push_back(hz);
  }
  std::vector<std::optional<JudgedMotion>> readings(higher.size());
  host::for_each_parallel(higher.size(), [&](std::size_t k) { readings[k].emplace(robot, logs, Reading{higher[k]}); });
  JudgedMotion mixed = *this;
  for (std::size_t k = 0; k < higher.size(); ++k) {
    for (Index j = 0; j < cutoffs.size(); ++j) {
      if (cutoffs[j] == higher[k]) mixed.take_joint_of(*readings[k], static_cast<int>(j));
    }
  }
  return mixed;
}

MatrixXd JudgedMotion::predicted(const model::Robot& robot) const {
  const MotionTable& t = *table_;
  MatrixXd predicted(t.rows(), t.num_joints);
  std::vector<Run> pieces = runs_between(robot.elasticities.empty() ? t.run_begin : t.section_begin);
  if (robot.effects.empty() && robot.elasticities.empty() && robot.couplings.empty() &&
      !(robot.torque_delay > 0.0)) {
    pieces = cut(pieces);  // rows know nothing of each other
  }
  host::for_each_parallel(pieces.size(), [&](std::size_t k) {
    const auto [begin, count] = pieces[k];
    const auto part = [first = begin, rows = count](const MatrixXd& whole) -> MatrixXd {
      return whole.middleRows(first, rows);
    };
    validate::Predictor predictor(robot, 0.0, {.sign_width = sign_width_});
    predicted.middleRows(begin, count) = predictor.rows({t.time.segment(begin, count), part(t.q), part(t.qd),
                                                         part(t.qdd), part(t.tau), part(t.displacement),
                                                         part(t.temperature)});
  });
  return predicted;
}

std::vector<validate::Score> JudgedMotion::scores(const MatrixXd& predicted, double band) const {
  const MotionTable& t = *table_;
  std::vector<validate::Score> scores;
  for (const auto [begin, count] : runs_of(t)) {
    const data::StreamSummary& summary = (*streams_)[scores.size()].summary();
    validate::TorqueScorer::Setup setup;
    setup.log = summary.path;
    setup.begin = t.time[begin];
    setup.end = t.time[begin + count - 1];
    setup.samples = count;
    setup.max_torque = summary.max_torque;
    setup.sample_rate = static_cast<double>(count - 1) / (setup.end - setup.begin);
    setup.band = band;
    setup.gaps = summary.gaps;
    for (data::TimeGap& gap : setup.gaps) gap = {gap.begin - summary.begin, gap.end - summary.begin};
    setup.moving_from = summary.moving_from - summary.begin;
    setup.moving_to = summary.moving_to - summary.begin;
    validate::TorqueScorer scorer(setup);
    scorer.add_rows(t.time.segment(begin, count), t.tau.middleRows(begin, count),
                    predicted.middleRows(begin, count));
    scorer.add_grid(t.time.segment(begin, count),
                    t.tau.middleRows(begin, count) - predicted.middleRows(begin, count));
    scores.push_back(scorer.finish());
  }
  return scores;
}

std::vector<Traces> JudgedMotion::traces(const MatrixXd& before, const MatrixXd& after) const {
  const MotionTable& t = *table_;
  std::vector<Traces> all;
  for (const auto [begin, count] : runs_of(t)) {
    all.push_back({t.runs[all.size()], t.time.segment(begin, count), t.q.middleRows(begin, count),
                   t.qd.middleRows(begin, count),
                   t.tau.middleRows(begin, count) - before.middleRows(begin, count),
                   t.tau.middleRows(begin, count) - after.middleRows(begin, count), t.in_gap.segment(begin, count)});
  }
  return all;
}

std::vector<VectorXd> JudgedMotion::rms_errors(const MatrixXd& predicted) const {
  const MotionTable& t = *table_;
  std::vector<VectorXd> errors;
  for (const auto [begin, rows] : runs_of(t)) {
    VectorXd sum = VectorXd::Zero(t.num_joints);
    double count = 0.0;
    for (Index i = begin; i < begin + rows; ++i) {
      if (t.scored[i] == 0.0) continue;
      sum += (t.tau.row(i) - predicted.row(i)).cwiseAbs2().transpose();
      count += 1.0;
    }
    errors.push_back((sum / std::max(1.0, count)).cwiseSqrt());
  }
  return errors;
}

std::vector<VectorXd> JudgedMotion::errors_by_kind(const MatrixXd& predicted, double band) const {
  constexpr double kSlow = 0.3, kFast = 0.6;  // of the joint's largest speed in the log
  constexpr double kLeast = 1.0;              // [s]
  constexpr Index kRests = 1, kMovesSlowly = 2, kMovesFast = 3, kInBand = 4;
  const MotionTable& t = *table_;
  std::vector<VectorXd> errors;
  for (const auto [begin, rows] : runs_of(t)) {
    const Index last = begin + rows - 1;
    const double rate = static_cast<double>(rows - 1) / (t.time[last] - t.time[begin]);
    const MatrixXd residual = t.tau.middleRows(begin, rows) - predicted.middleRows(begin, rows);
    MatrixXd slow = MatrixXd::Zero(rows, t.num_joints);
    if (band > 0.0 && band < 0.5 * rate) slow = data::low_pass_zero_phase(residual, rate, band);
    MatrixXd sums = MatrixXd::Zero(t.num_joints, static_cast<Index>(kKinds)), counts = sums;
    const VectorXd top = t.qd.middleRows(begin, rows).cwiseAbs().colwise().maxCoeff().transpose();
    const auto count = [&](int joint, Index kind, double error) {
      sums(joint, kind) += error * error;
      counts(joint, kind) += 1.0;
    };
    for (Index i = 0; i < rows; ++i) {
      if (t.scored[begin + i] == 0.0) continue;
      for (int j = 0; j < t.num_joints; ++j) {
        const double speed = std::abs(t.qd(begin + i, j)), error = residual(i, j);
        count(j, 0, error);
        count(j, kInBand, slow(i, j));
        if (speed < model::kRestSpeed) {
          count(j, kRests, error);
        } else if (speed < kSlow * top[j]) {
          count(j, kMovesSlowly, error);
        } else if (speed > kFast * top[j]) {
          count(j, kMovesFast, error);
        }
      }
    }
    for (Index k = 0; k < static_cast<Index>(kKinds); ++k) {
      VectorXd error = (sums.col(k).array() / counts.col(0).array().max(1.0)).sqrt();
      for (int j = 0; k > 0 && j < t.num_joints; ++j) {
        if (counts(j, k) < kLeast * rate) error[j] = 0.0;
      }
      errors.push_back(std::move(error));
    }
  }
  return errors;
}

VectorXd JudgedMotion::rms_error(const MatrixXd& predicted) const { return pooled(rms_errors(predicted)); }

VectorXd pooled(const std::vector<VectorXd>& errors) {
  VectorXd squares = VectorXd::Zero(errors.front().size());
  for (const VectorXd& e : errors) squares += e.cwiseAbs2() / static_cast<double>(errors.size());
  return squares.cwiseSqrt();
}

}  // namespace heft::diagnose
