#include "motion_table.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "heft/core/effects/displacement.hpp"
#include "heft/core/friction/friction.hpp"
#include "heft/host/error.hpp"
#include "heft/regression/rests.hpp"
#include "heft/validate/predict.hpp"
#include "heft/validate/scored_time.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Everything of one log, grown piece by piece.
struct Collected {
  std::vector<double> time;
  std::vector<VectorXd>
      rows;  ///< q, qd, qdd, tau one after the other, then the displacement since the begin, if measured
  std::vector<VectorXd> temperature;  ///< no entries: not measured
  std::vector<bool> usable;
};

Collected collect(const data::MotionStream& log, int n) {
  Collected all;
  VectorXd travelled = VectorXd::Zero(kMeasuredDisplacements * n);
  log.for_each([&](const data::MotionChunk& piece) {
    const bool measured = piece.displacement.cols() == travelled.size();
    for (Index i = piece.begin; i < piece.begin + piece.count; ++i) {
      VectorXd row(4 * n + (measured ? travelled.size() : 0));
      row.head(4 * n) << piece.q.row(i).transpose(), piece.qd.row(i).transpose(),
          piece.qdd.row(i).transpose(), piece.tau.row(i).transpose();
      if (measured) {
        travelled += piece.displacement.row(i).transpose();
        row.tail(travelled.size()) = travelled;
      }
      if (piece.temperature.cols() == n) all.temperature.push_back(piece.temperature.row(i).transpose());
      all.time.push_back(piece.time[i]);
      all.rows.push_back(std::move(row));
      all.usable.push_back(piece.usable[i]);
    }
  });
  return all;
}

}  // namespace

VectorXd MotionTable::turns(int joint, double times) const {
  const auto speed = qd.col(joint).cwiseAbs().array();
  const double rests = 2.0 * sign_width[joint];
  return (speed > rests && speed < times * turn_seconds[joint] * qdd.col(joint).cwiseAbs().array())
      .cast<double>();
}

void MotionTable::take_motion(const MotionTable& other, int joint) {
  for (MatrixXd MotionTable::*of : {&MotionTable::q, &MotionTable::qd, &MotionTable::qdd,
                                    &MotionTable::direction, &MotionTable::keep, &MotionTable::standing, &MotionTable::resting})
    (this->*of).col(joint) = (other.*of).col(joint);
  turn_seconds[joint] = other.turn_seconds[joint];
}

void widen(SeenInterval<double>& seen, const Eigen::Ref<const VectorXd>& values,
           const Eigen::Ref<const VectorXd>& keep) {
  for (Index i = 0; i < values.size(); ++i) {
    if (!(keep[i] > 0.0)) continue;
    seen.low = std::min(seen.low, values[i]);
    seen.high = std::max(seen.high, values[i]);
  }
}

double part_repeated(const MotionTable& motion, const MotionTable& of) {
  constexpr double kNear = 0.1;         // rms over the joints, in parts of the scatter
  constexpr double kMoves = 0.1;        // of the scatter of the velocities: slower is no motion
  constexpr double kRate = 100.0;       // [Hz] of the rows compared with
  constexpr Index kMostCompared = 400;  // rows
  const auto state = [&](const MotionTable& table, Index step) {
    const Eigen::ArithmeticSequence rows = Eigen::seqN(0, (table.rows() + step - 1) / step, step);
    const Index n = table.num_joints;
    MatrixXd x(rows.size(), 2 * n);
    x << table.q(rows, Eigen::all), table.qd(rows, Eigen::all);
    for (Index j = 0; j < n; ++j) {
      const double at = of.q.col(j).mean();
      x.col(j).array() -= at;
      const auto part = [&](double scatter) { return scatter > 0.0 ? 1.0 / scatter : 0.0; };
      const double m = std::sqrt(static_cast<double>(of.rows()));
      x.col(j) *= part((of.q.col(j).array() - at).matrix().norm() / m);
      x.col(n + j) *= part(of.qd.col(j).norm() / m);
    }
    return x;
  };
  const MatrixXd known = state(of, std::max<Index>(1, std::lround(of.sample_rate / kRate))).transpose();
  const MatrixXd seen = state(motion, std::max<Index>(1, motion.rows() / kMostCompared));
  const double dimensions = static_cast<double>(seen.cols());
  Index moves = 0, near = 0;
  for (Index i = 0; i < seen.rows(); ++i) {
    if (seen.row(i).tail(motion.num_joints).squaredNorm() < kMoves * kMoves * motion.num_joints) continue;
    ++moves;
    const double least = (known.colwise() - seen.row(i).transpose()).colwise().squaredNorm().minCoeff();
    if (least < kNear * kNear * dimensions) ++near;
  }
  return moves > 0 ? static_cast<double>(near) / static_cast<double>(moves) : 0.0;
}

VectorXd encoder_steps(const data::Log& log) {
  VectorXd steps = VectorXd::Zero(log.q.cols());
  for (Index j = 0; j < log.q.cols(); ++j) {
    double least = std::numeric_limits<double>::infinity();
    for (Index i = 1; i < log.q.rows(); ++i) {
      const double moved = std::abs(log.q(i, j) - log.q(i - 1, j));
      if (moved > 1e-9) least = std::min(least, moved);  // below: rounding of one and the same position
    }
    if (std::isfinite(least)) steps[j] = least;
  }
  return steps;
}

void put_earlier(const MotionTable& table, const Eigen::Ref<const VectorXd>& signal, double delay, Index from,
                 Eigen::Ref<VectorXd> result) {
  const double back = delay * table.sample_rate;
  std::size_t run = 0;
  for (Index i = from; i < from + result.size(); ++i) {
    while (i >= table.run_begin[run + 1]) ++run;
    const Index begin = table.run_begin[run], last = table.run_begin[run + 1] - 1;
    const double at =
        std::clamp(static_cast<double>(i) - back, static_cast<double>(begin), static_cast<double>(last));
    const auto k = static_cast<Index>(at);
    const double f = at - static_cast<double>(k);
    result[i - from] = (1.0 - f) * signal[k] + f * signal[std::min(k + 1, last)];
  }
}

MatrixXd earlier_motion(const MotionTable& table, const MatrixXd& signal, double delay) {
  const double back = delay * table.sample_rate, whole = std::floor(-back), f = -back - whole;
  // The cubic through four rows whose slopes at the inner two are those of their neighbours (Catmull and Rom, 1974).
  const std::array<double, 4> weights{0.5 * f * (f * (2.0 - f) - 1.0), 1.0 + 0.5 * f * f * (3.0 * f - 5.0),
                                      0.5 * f * (1.0 + f * (4.0 - 3.0 * f)), 0.5 * f * f * (f - 1.0)};
  MatrixXd result(signal.rows(), signal.cols());
  for (std::size_t run = 0; run + 1 < table.run_begin.size(); ++run) {
    const Index begin = table.run_begin[run], last = table.run_begin[run + 1] - 1;
    for (Index i = begin; i <= last; ++i) {
      const Index at = i + static_cast<Index>(whole);
      result.row(i).setZero();
      for (Index k = 0; k < 4; ++k)
        result.row(i) += weights[static_cast<std::size_t>(k)] * signal.row(std::clamp(at - 1 + k, begin, last));
    }
  }
  return result;
}

MatrixXd earlier(const MotionTable& table, const MatrixXd& signal, double delay) {
  MatrixXd result(signal.rows(), signal.cols());
  for (Index c = 0; c < signal.cols(); ++c) put_earlier(table, signal.col(c), delay, 0, result.col(c));
  return result;
}

namespace {

/// Averages of `group` neighbouring samples of one log into the table's rows from `at` on.
/// @return whether each row counts at all: not in gaps, not at the ends
std::vector<bool> add_rows(const Collected& part, Index group, Index at, double reversal_seconds,
                           MotionTable& table) {
  constexpr double kEnds = 0.3;  // [s]: the derived motion means nothing there
  const int n = table.num_joints;
  const Index count = static_cast<Index>(part.time.size()) / group, steps = table.displacement.cols();
  const double begin = part.time.empty() ? 0.0 : part.time.front();
  const double end = part.time.empty() ? 0.0 : part.time.back();
  std::vector<bool> counts(static_cast<std::size_t>(count));
  VectorXd before;
  for (Index i = 0; i < count; ++i, ++at) {
    VectorXd mean = VectorXd::Zero(4 * n + steps);
    double time = 0.0;
    bool usable = true;
    for (Index k = 0; k < group; ++k) {
      const auto s = static_cast<std::size_t>(i * group + k);
      mean += part.rows[s].head(mean.size());
      if (table.temperature.cols() > 0)
        table.temperature.row(at) += part.temperature[s].transpose() / static_cast<double>(group);
      time += part.time[s];
      usable = usable && part.usable[s];
    }
    mean /= static_cast<double>(group);
    time /= static_cast<double>(group);
    table.time[at] = time - begin;
    table.q.row(at) = mean.segment(0, n);
    table.qd.row(at) = mean.segment(n, n);
    table.qdd.row(at) = mean.segment(2 * n, n);
    table.tau.row(at) = mean.segment(3 * n, n);
    if (before.size() > 0) table.displacement.row(at) = (mean - before).tail(steps);
    before = mean;
    table.in_gap[at] = usable ? 0.0 : 1.0;
    if (time - begin < kEnds || end - time < kEnds) usable = false;
    counts[static_cast<std::size_t>(i)] = usable && std::isfinite(mean.sum());
    for (int j = 0; j < n; ++j) {
      const double v = table.qd(at, j);
      table.direction(at, j) = velocity_sign(v, table.sign_width[j]);
      const double unresolved =
          std::max(2.0 * table.sign_width[j], reversal_seconds * std::abs(table.qdd(at, j)));
      table.keep(at, j) = counts[static_cast<std::size_t>(i)] && std::abs(v) > unresolved ? 1.0 : 0.0;
    }
  }
  return counts;
}

/// A joint at rest is no reversal. What holds it there only friction that remembers can say: such rows stand aside for it. Of a
/// joint that rests all along they are what the log says.
void take_resting_rows(Index first, Index last, const data::StreamSummary& log, const std::vector<bool>& prismatic,
                       double rate, const std::vector<bool>& counts, MotionTable& table) {
  for (int j = 0; j < table.num_joints; ++j) {
    const bool slides = prismatic[static_cast<std::size_t>(j)], moves = regression::moves(log, j, slides);
    const auto rests = regression::resting_rows(table.qd.col(j).segment(first, last - first), rate, slides);
    for (Index i = 0; i < last - first; ++i) {
      if (!rests[i]) continue;
      const double counted = counts[static_cast<std::size_t>(i)] ? 1.0 : 0.0;
      table.keep(first + i, j) = moves ? 0.0 : counted;
      table.resting(first + i, j) = moves ? counted : 0.0;
    }
  }
}

/// Whole blocks of about the same length, dealt out to the folds in turn.
void add_blocks(Index first, Index count, int run, int pieces, int folds, MotionTable& table) {
  for (int b = 0; b < pieces; ++b) {
    Block block;
    block.begin = first + count * b / pieces;
    block.count = first + count * (b + 1) / pieces - block.begin;
    block.run = run;
    block.fold = static_cast<int>(table.blocks.size()) % folds;
    if (block.count > 0) table.blocks.push_back(block);
  }
}

}  // namespace

MotionTable make_table(const std::vector<const data::MotionStream*>& logs, const std::vector<bool>& prismatic,
                       const TableOptions& options) {
  MotionTable table;
  const int n = static_cast<int>(prismatic.size());
  table.num_joints = n;
  table.sign_width.resize(n);
  table.turn_seconds.setZero(n);
  for (int j = 0; j < n; ++j) table.sign_width[j] = prismatic[static_cast<std::size_t>(j)] ? validate::kPrismaticSignWidth : 1e-3;

  std::vector<Collected> parts;
  long total = 0;
  for (const data::MotionStream* log : logs) {
    parts.push_back(collect(*log, n));
    total += static_cast<long>(parts.back().time.size());
  }
  // Averages of `group` neighbours: less rows, the noise of the torque falls as if all had been kept.
  const Index group = std::max<Index>(1, (total + options.most_rows - 1) / options.most_rows);

  Index rows = 0;
  for (const Collected& part : parts) rows += static_cast<Index>(part.time.size()) / group;
  table.time.resize(rows);
  table.scored.resize(rows);
  table.in_gap.resize(rows);
  for (MatrixXd* m :
       {&table.q, &table.qd, &table.qdd, &table.tau, &table.direction, &table.keep, &table.standing, &table.resting}) {
    m->setZero(rows, n);
  }
  const bool measured = std::all_of(parts.begin(), parts.end(), [&](const Collected& part) {
    return !part.rows.empty() && part.rows.front().size() > 4 * n;
  });
  table.displacement.setZero(rows, measured ? kMeasuredDisplacements * n : 0);
  const bool warmth_known = std::all_of(parts.begin(), parts.end(), [](const Collected& part) {
    return !part.rows.empty() && part.temperature.size() == part.rows.size();
  });
  table.temperature.setZero(rows, warmth_known ? n : 0);
  Index first = 0;
  for (std::size_t r = 0; r < parts.size(); ++r) {
    const Collected& part = parts[r];
    const data::StreamSummary& summary = logs[r]->summary();
    const Index count = static_cast<Index>(part.time.size()) / group, last = first + count;
    const double rate = summary.sample_rate / static_cast<double>(group);
    if (r == 0) {
      table.sample_rate = rate;
      table.logged_rate = summary.sample_rate;
    }
    if (summary.cutoff > 0.0)
      table.turn_seconds = table.turn_seconds.cwiseMax(0.5 * std::numbers::inv_pi / summary.cutoff);
    table.runs.push_back(summary.path);
    table.run_seconds.push_back(summary.end - summary.begin);
    table.run_begin.push_back(first);
    const std::vector<bool> counts = add_rows(part, group, first, options.reversal_seconds, table);
    take_resting_rows(first, last, summary, prismatic, rate, counts, table);
    const double begin = part.time.empty() ? 0.0 : part.time.front();
    const validate::ScoredTime scored(begin, count > 0 ? begin + table.time[last - 1] : begin, summary.gaps);
    for (Index i = first; i < last; ++i) {
      const double t = begin + table.time[i];
      table.scored[i] = scored.counts(t) ? 1.0 : 0.0;
      if (t >= summary.moving_from && t <= summary.moving_to) continue;
      table.in_gap[i] = 0.0;  // standstill may not be usable either
      table.standing.row(i) = table.keep.row(i) + table.resting.row(i);
      table.keep.row(i).setZero();
      table.resting.row(i).setZero();
    }
    for (Index i = first; i < last; ++i) {
      if (i == first || (table.in_gap[i - 1] > 0.0 && table.in_gap[i] == 0.0)) table.section_begin.push_back(i);
    }
    const int pieces =
        std::max(1, static_cast<int>(std::lround(static_cast<double>(count) / rate / options.block_seconds)));
    add_blocks(first, count, static_cast<int>(r), pieces, options.folds, table);
    first = last;
  }
  table.run_begin.push_back(first);
  table.section_begin.push_back(first);
  return table;
}

}  // namespace heft::diagnose
