#include "motion_table.hpp"

#include <algorithm>
#include <cmath>

#include "heft/core/effects/displacement.hpp"
#include "heft/core/friction/friction.hpp"
#include "heft/host/error.hpp"

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
      all.time.push_back(piece.time[i]);
      all.rows.push_back(std::move(row));
      all.usable.push_back(piece.usable[i]);
    }
  });
  return all;
}

}  // namespace

MatrixXd earlier(const MotionTable& table, const MatrixXd& signal, double delay) {
  MatrixXd result(signal.rows(), signal.cols());
  const double back = delay * table.sample_rate;
  for (std::size_t r = 0; r + 1 < table.run_begin.size(); ++r) {
    const Index begin = table.run_begin[r], last = table.run_begin[r + 1] - 1;
    for (Index i = begin; i <= last; ++i) {
      const double at = std::max(static_cast<double>(begin), static_cast<double>(i) - back);
      const auto k = static_cast<Index>(at);
      const double f = at - static_cast<double>(k);
      result.row(i) = (1.0 - f) * signal.row(k) + f * signal.row(std::min(k + 1, last));
    }
  }
  return result;
}

MotionTable make_table(const std::vector<const data::MotionStream*>& logs, const std::vector<bool>& prismatic,
                       const TableOptions& options) {
  MotionTable table;
  const int n = static_cast<int>(prismatic.size());
  table.num_joints = n;
  table.sign_width.resize(n);
  for (int j = 0; j < n; ++j) table.sign_width[j] = prismatic[static_cast<std::size_t>(j)] ? 5e-4 : 1e-3;

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
  for (MatrixXd* m :
       {&table.q, &table.qd, &table.qdd, &table.tau, &table.direction, &table.keep, &table.standing}) {
    m->setZero(rows, n);
  }
  const bool measured = std::all_of(parts.begin(), parts.end(), [&](const Collected& part) {
    return !part.rows.empty() && part.rows.front().size() > 4 * n;
  });
  const Index steps = measured ? kMeasuredDisplacements * n : 0;
  table.displacement.setZero(rows, steps);
  Index at = 0;
  for (std::size_t r = 0; r < parts.size(); ++r) {
    const Collected& part = parts[r];
    const data::StreamSummary& summary = logs[r]->summary();
    const Index count = static_cast<Index>(part.time.size()) / group;
    const double rate = summary.sample_rate / static_cast<double>(group);
    if (r == 0) table.sample_rate = rate;
    table.runs.push_back(summary.path);
    table.run_seconds.push_back(summary.end - summary.begin);
    table.run_begin.push_back(at);
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
      if (time - begin < 0.3 || end - time < 0.3) usable = false;
      counts[static_cast<std::size_t>(i)] = usable && std::isfinite(mean.sum());
      for (int j = 0; j < n; ++j) {
        const double v = table.qd(at, j);
        table.direction(at, j) = velocity_sign(v, table.sign_width[j]);
        const double unresolved =
            std::max(2.0 * table.sign_width[j], options.reversal_seconds * std::abs(table.qdd(at, j)));
        table.keep(at, j) = counts[static_cast<std::size_t>(i)] && std::abs(v) > unresolved ? 1.0 : 0.0;
      }
    }
    // A joint at rest is no reversal: what holds it there is part of the log.
    const Index first_row = table.run_begin.back();
    const auto rest = static_cast<Index>(options.rest_seconds * rate);
    for (int j = 0; j < n; ++j) {
      for (Index i = first_row; i < at;) {
        Index k = i;
        while (k < at && std::abs(table.qd(k, j)) <= 2.0 * table.sign_width[j]) ++k;
        if (k - i >= rest) {
          for (Index r2 = i; r2 < k; ++r2)
            table.keep(r2, j) = counts[static_cast<std::size_t>(r2 - first_row)] ? 1.0 : 0.0;
        }
        i = std::max(k, i + 1);
      }
    }
    for (Index i = first_row; i < at; ++i) {
      const double t = begin + table.time[i];
      if (t >= summary.moving_from && t <= summary.moving_to) continue;
      table.standing.row(i) = table.keep.row(i);
      table.keep.row(i).setZero();
    }
    // Whole blocks of about the same length, dealt out to the folds in turn.
    const Index begin_row = table.run_begin.back();
    const int pieces =
        std::max(1, static_cast<int>(std::lround(static_cast<double>(count) / rate / options.block_seconds)));
    for (int b = 0; b < pieces; ++b) {
      Block block;
      block.begin = begin_row + count * b / pieces;
      block.count = begin_row + count * (b + 1) / pieces - block.begin;
      block.run = static_cast<int>(r);
      block.fold = static_cast<int>(table.blocks.size()) % options.folds;
      if (block.count > 0) table.blocks.push_back(block);
    }
  }
  table.run_begin.push_back(at);
  return table;
}

}  // namespace heft::diagnose
