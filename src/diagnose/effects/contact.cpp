// Outer forces that come and go.
#include "contact.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include <Eigen/Cholesky>

#include "../arm_search.hpp"
#include "heft/model/kinematics.hpp"
#include "heft/statistics/distributions.hpp"

namespace heft::diagnose {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

/// What makes a stretch of time a touch.
struct Clear {
  double statistic;  ///< chi-square (three degrees), scaled to the residual elsewhere, at least
  double far_alone;  ///< times the next stretch's at least: where that comes near, something else is wrong all along
  double share;      ///< of what forces of single bins could explain, by the one force: a push holds its direction
  double joints;     ///< that move, in the mean: the three components of a force explain whatever few joints do
};
/// By its strength, far above what friction leaves at a reversal, or by standing alone and being one force: of five joints and
/// more, or, nearer to one force and clearer, of four.
constexpr std::array kClear{Clear{1000.0, 3.0, 0.6, 0.0}, Clear{100.0, 8.0, 0.9, 4.5}, Clear{300.0, 8.0, 0.95, 3.6}};
/// Beside one that is clear, in the same log.
constexpr Clear kClearBeside{300.0, 8.0, 0.9, 3.0};
/// Below the least of these no stretch is looked at.
constexpr double kFaintest = std::ranges::min(kClear, {}, &Clear::statistic).statistic;
constexpr double kOneForce = std::ranges::min(kClear, {}, &Clear::share).share;
constexpr std::size_t kMostTouches = 5;
/// Where runs without a touch show what friction and a rough model leave, a touch need not stand so far above it: beyond
/// this many times their largest statistic, not by chance, and with this share by one force.
constexpr double kAboveFreeRuns = 2.0, kUnlikely = 1e-3, kOneForceBesideFreeRuns = 0.45;
constexpr int kMostTouchesBesideFreeRuns = 20;
constexpr double kBin = 0.02, kShortestTouch = 0.26, kLongestTouch = 1.2, kMargin = 0.1;  // [s]
/// How long an arm that was pushed takes to come back to where it would be [s]: what it shows there is no measure for the rest.
constexpr double kAftermath = 0.5;

/// A joint slower than that many widths of its sign may rest, as model::kRestSpeed says of one that turns.
constexpr double kRests = 5.0;

/// Rows of a bin that count for a joint. A joint at rest holds with whatever part of its friction it stopped with: that is no
/// touch.
VectorXd counted_rows(const Workbench& bench, Index from, Index count, int joint) {
  const MotionTable& table = *bench.table;
  const auto moves =
      (bench.motion->qd.col(joint).segment(from, count).array().abs() > kRests * table.sign_width[joint])
          .cast<double>();
  return bench.problem->keep().col(joint).segment(from, count).array() * moves;
}

/// One log's residual in bins.
class BinnedLog {
 public:
  BinnedLog(const Workbench& bench, const MatrixXd& residual, const model::Kinematics& kinematics,
            std::size_t run)
      : bench_(bench),
        residual_(residual),
        rows_(std::max<Index>(1, static_cast<Index>(std::lround(kBin * bench.table->sample_rate)))),
        begin_(bench.table->run_begin[run]),
        bins_((bench.table->run_begin[run + 1] - begin_) / rows_) {
    for (Index b = 0; b < bins_; ++b) {
      const Index middle = begin_ + b * rows_ + rows_ / 2;
      jacobians_.push_back(kinematics.jacobian(bench.motion->link_q.row(middle).transpose()).topRows(3));
    }
  }

  ForceSums sums() const {
    ForceSums s;
    s.seconds = static_cast<double>(rows_) / bench_.table->sample_rate;
    s.normal.assign(static_cast<std::size_t>(bins_) + 1, Matrix3d::Zero());
    s.right.assign(s.normal.size(), Vector3d::Zero());
    s.power.assign(s.normal.size(), 0.0);
    s.joints = s.rows = s.power;
    for (std::size_t b = 0; b < jacobians_.size(); ++b) {
      s.normal[b + 1] = s.normal[b];
      s.right[b + 1] = s.right[b];
      s.power[b + 1] = s.power[b];
      s.joints[b + 1] = s.joints[b];
      s.rows[b + 1] = s.rows[b];
      const Index from = row_of(static_cast<Index>(b));
      for (int j = 0; j < bench_.table->num_joints; ++j) {
        const double w = bench_.problem->weight(j);
        const VectorXd keep = counted_rows(bench_, from, rows_, j);
        const double sum = residual_.col(j).segment(from, rows_).dot(keep);
        const auto J = jacobians_[b].col(j);
        s.normal[b + 1] += w * keep.sum() * J * J.transpose();
        s.right[b + 1] -= w * sum * J;
        if (!(keep.sum() > 0.0)) continue;
        s.power[b + 1] += w * sum * sum / keep.sum();
        s.joints[b + 1] += 1.0;
        s.rows[b + 1] += keep.sum() / static_cast<double>(rows_);
      }
    }
    return s;
  }

  /// Adds each joint's squared error in a touch, without and with its force.
  void add_errors(const Touch& touch, VectorXd& before, VectorXd& after) const {
    for (Index b = touch.first; b < touch.first + touch.count; ++b) {
      for (int j = 0; j < bench_.table->num_joints; ++j) {
        const VectorXd keep = counted_rows(bench_, row_of(b), rows_, j);
        const double torque = jacobians_[static_cast<std::size_t>(b)].col(j).dot(touch.force);
        const auto r = residual_.col(j).segment(row_of(b), rows_).array();
        before[j] += (keep.array() * r.square()).sum();
        after[j] += (keep.array() * (r + torque).square()).sum();
      }
    }
  }

  Index row_of(Index bin) const { return begin_ + bin * rows_; }

 private:
  const Workbench& bench_;
  const MatrixXd& residual_;
  Index rows_;   ///< of a bin
  Index begin_;  ///< of the log
  Index bins_;
  std::vector<MatrixXd> jacobians_;  ///< 3 × n, one a bin
};

/// @param behind  [s]
std::pair<Index, Index> with_margin(const Touch& touch, const ForceSums& sums, double behind = kMargin) {
  const auto bins = [&](double time) { return static_cast<Index>(time / sums.seconds); };
  return {std::max<Index>(0, touch.first - bins(kMargin)), touch.first + touch.count + bins(behind)};
}

/// Statistic of the best stretch of the rest.
double best_of_rest(const ForceSums& sums, const std::vector<Touch>& touches) {
  std::vector<std::pair<Index, Index>> taken;
  for (const Touch& touch : touches) taken.push_back(with_margin(touch, sums, kAftermath));
  return best_touch(sums, taken).statistic;
}

/// How many joints move, in the mean.
double joints_in(const Touch& touch, const ForceSums& sums) {
  const auto a = static_cast<std::size_t>(touch.first), b = static_cast<std::size_t>(touch.first + touch.count);
  return (sums.joints[b] - sums.joints[a]) / static_cast<double>(touch.count);
}

/// Touches of a log by itself: as many of the clearest stretches as stand out from the rest.
/// @param first  its best_touch()
std::vector<Touch> touches_of(const ForceSums& sums, const Touch& first) {
  std::vector<Touch> found;
  std::vector<std::pair<Index, Index>> taken;
  while (found.size() < kMostTouches) {
    const Touch next = taken.empty() ? first : best_touch(sums, taken);
    if (next.count == 0 || next.statistic < kFaintest || next.share < kOneForce) break;
    taken.push_back(with_margin(next, sums));
    found.push_back(next);
  }
  for (; !found.empty(); found.pop_back()) {
    const double next = best_of_rest(sums, found);
    const auto has = [&](const Touch& touch, const Clear& least) {
      return touch.statistic >= std::max(least.statistic, least.far_alone * next) && touch.share >= least.share &&
             joints_in(touch, sums) >= least.joints;
    };
    const auto is_clear = [&](const Touch& touch) {
      return std::any_of(kClear.begin(), kClear.end(), [&](const Clear& least) { return has(touch, least); });
    };
    const auto is_clear_beside = [&](const Touch& touch) { return is_clear(touch) || has(touch, kClearBeside); };
    if (std::any_of(found.begin(), found.end(), is_clear) && std::all_of(found.begin(), found.end(), is_clear_beside)) return found;
  }
  return {};
}

/// Touches of each log beside the others. Runs of which no stretch is unlikely are free: they set how far above the rest
/// a touch has to stand. Without such runs, or where most runs would be touched, each log is judged by itself.
std::vector<std::vector<Touch>> touches_beside_free_runs(const std::vector<ForceSums>& runs) {
  std::vector<std::vector<Touch>> touches(runs.size());
  std::vector<Touch> first(runs.size());
  std::size_t free = 0;
  double largest = 1.0;
  for (std::size_t run = 0; run < runs.size(); ++run) {
    const Touch& best = first[run] = best_touch(runs[run], {});
    if (best.count > 0 && best.p_value < kUnlikely) continue;
    ++free;
    largest = std::max(largest, best.statistic);
  }
  for (std::size_t run = 0; run < runs.size(); ++run) {
    touches[run] = touches_of(runs[run], first[run]);
    // A single run that is free holds nothing beyond its own.
    if (!touches[run].empty() || runs.size() < 2 || 2 * free < runs.size()) continue;
    std::vector<std::pair<Index, Index>> taken;
    for (int event = 0; event < kMostTouchesBesideFreeRuns; ++event) {
      const Touch best = taken.empty() ? first[run] : best_touch(runs[run], taken);
      if (best.count == 0 || best.p_value > kUnlikely || best.statistic < kAboveFreeRuns * largest) break;
      taken.push_back(with_margin(best, runs[run]));
      if (best.share >= kOneForceBesideFreeRuns) touches[run].push_back(best);
    }
  }
  return touches;
}

/// What the forces do. They are judged in the stretches that they were found in, which come once: there are no other
/// blocks to judge them on.
void add_to_trial(const Touch& touch, Trial& trial) {
  const Index k = trial.coefficients.size();
  for (VectorXd* list : {&trial.coefficients, &trial.std}) list->conservativeResize(k + 3);
  trial.coefficients.tail(3) = touch.force;
  trial.std.tail(3) = touch.std;
  trial.gain += touch.gain;
  trial.wald += touch.statistic;
  trial.p_value = std::min(trial.p_value, touch.p_value);
}

/// By log, then by time.
void sort_events(Candidate& contact) {
  std::vector<std::size_t> order(contact.events.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return std::pair(contact.event_runs[a], contact.events[a].first) <
           std::pair(contact.event_runs[b], contact.events[b].first);
  });
  const auto sorted = [&](const auto& list) {
    auto result = list;
    for (std::size_t k = 0; k < order.size(); ++k) result[k] = list[order[k]];
    return result;
  };
  contact.events = sorted(contact.events);
  contact.forces = sorted(contact.forces);
  contact.event_runs = sorted(contact.event_runs);
}

std::vector<Candidate> propose_contact(const Workbench& bench, const std::vector<bool>&) {
  Candidate c(Contact{});
  if (bench.least_gain > 0.0) {
    c.refused = kOfNoUse;  // what comes and goes is none of a joint
    return {std::move(c)};
  }
  const MotionTable& table = *bench.table;
  const MatrixXd residual = bench.problem->residual();
  const model::Kinematics kinematics(*bench.robot);
  c.trial.joint_before = c.trial.joint_after = VectorXd::Zero(table.num_joints);
  double scale = 1.0;
  std::vector<BinnedLog> logs;
  std::vector<ForceSums> sums;
  for (std::size_t run = 0; run + 1 < table.run_begin.size(); ++run) {
    logs.emplace_back(bench, residual, kinematics, run);
    sums.push_back(logs.back().sums());
  }
  const std::vector<std::vector<Touch>> touches = touches_beside_free_runs(sums);
  for (std::size_t run = 0; run < logs.size(); ++run) {
    const BinnedLog& log = logs[run];
    for (const Touch& touch : touches[run]) {
      c.events.emplace_back(table.time[log.row_of(touch.first)],
                            static_cast<double>(touch.count) * sums[run].seconds);
      c.forces.push_back(touch.force);
      c.event_runs.push_back(static_cast<int>(run));
      add_to_trial(touch, c.trial);
      log.add_errors(touch, c.trial.joint_before, c.trial.joint_after);
      scale = std::max(scale, touch.scale);
    }
  }
  if (c.events.empty()) {
    c.refused = "no stretch of time is unlike the rest";
    return {std::move(c)};
  }
  sort_events(c);
  c.trial.valid = true;
  c.trial.cv_gain = c.trial.gain;  // its rank among the candidates
  c.trial.effective_rows = bench.problem->counted().sum() / scale;
  return {std::move(c)};
}

void apply_contact(const Candidate&, const VectorXd&, model::Robot&) {}

void describe_contact(const Candidate& effect, const VectorXd&, const model::Robot&, Finding& finding) {
  finding.events = effect.events;
  finding.forces = effect.forces;
}

}  // namespace

Touch best_touch(const ForceSums& sums, const std::vector<std::pair<Index, Index>>& taken) {
  constexpr double kMedian = 2.37, kDegreesPerStretch = 1.58;  // see the header
  constexpr std::size_t kFewest = 20;
  constexpr double kLeastRows = 1.0;  // of one joint all along
  Touch best;
  double scale = 0.0, independent = 0.0, tried = 0.0;
  for (auto count = static_cast<Index>(kShortestTouch / sums.seconds);
       count <= static_cast<Index>(kLongestTouch / sums.seconds); count += 2) {
    std::vector<double> gains;
    for (Index first = 0; first + count <= sums.bins(); ++first) {
      const bool free = std::all_of(taken.begin(), taken.end(), [&](const auto& span) {
        return first + count <= span.first || first >= span.second;
      });
      if (!free) continue;
      const auto a = static_cast<std::size_t>(first), b = static_cast<std::size_t>(first + count);
      // What a stretch in which no joint moves shows at its ends is friction, and its gain is no measure for others.
      if (!sums.rows.empty() && sums.rows[b] - sums.rows[a] < kLeastRows * static_cast<double>(count)) continue;
      Matrix3d M = sums.normal[b] - sums.normal[a];
      M.diagonal().array() += 1e-6 * M.trace() + 1e-12;
      const Vector3d s = sums.right[b] - sums.right[a];
      const Vector3d F = M.llt().solve(s);
      const double g = F.dot(s);
      gains.push_back(g);
      if (!(g > best.gain)) continue;
      best.first = first;
      best.count = count;
      best.gain = g;
      best.share = g / std::max(1e-12, sums.power[b] - sums.power[a]);
      best.force = F;
    }
    tried += static_cast<double>(gains.size());
    if (gains.size() <= kFewest || best.count != count) continue;
    const auto middle = gains.begin() + static_cast<std::ptrdiff_t>(gains.size() / 2);
    std::nth_element(gains.begin(), middle, gains.end());
    scale = *middle / kMedian;
    independent = static_cast<double>(gains.size()) / static_cast<double>(count);
  }
  if (best.count == 0 || !(scale > 0.0)) return {};
  best.scale = std::max(1.0, scale);
  best.statistic = best.gain / best.scale;
  Matrix3d M = sums.normal[static_cast<std::size_t>(best.first + best.count)] -
               sums.normal[static_cast<std::size_t>(best.first)];
  M.diagonal().array() += 1e-6 * M.trace() + 1e-12;
  best.std = (best.scale * M.llt().solve(Matrix3d::Identity()).diagonal()).cwiseSqrt();
  best.p_value = std::min(
      1.0, tried * statistics::fisher_tail(best.statistic / 3.0, 3.0, kDegreesPerStretch * independent));
  return best;
}

void add_touches(const Candidate& more, Candidate& contact) {
  contact.events.insert(contact.events.end(), more.events.begin(), more.events.end());
  contact.forces.insert(contact.forces.end(), more.forces.begin(), more.forces.end());
  contact.event_runs.insert(contact.event_runs.end(), more.event_runs.begin(), more.event_runs.end());
  sort_events(contact);
}

ArmSearch search_of(Contact) { return {propose_contact, apply_contact, describe_contact}; }

}  // namespace heft::diagnose
