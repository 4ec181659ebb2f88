// A body picked up or dropped.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "../arm_search.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// No event is looked for this near to the begin or the end of a log; and what is found nearer than kEdge to these is none [s].
constexpr double kMargin = 2.0, kEdge = 0.25;

/// Columns of inertial parameters of the last link, all rows, for every joint.
/// @param share  b × k, what these add to the base parameters
Columns last_link_columns(const Workbench& bench, const MatrixXd& share) {
  return {.joints = all_joints(bench.table->num_joints), .values = bench.base->columns_of(*bench.rows, share)};
}

/// The columns from a row on.
Columns from_row(Columns columns, Index from) {
  for (MatrixXd& values : columns.values) values.topRows(from).setZero();
  return columns;
}

/// Mass and first moment as far as this motion shows them: those that the rest of the model does not explain when they
/// set in half way through. The one that is seen worst goes until all are seen.
/// @param link  b × 10, what the last link's parameters add to the base parameters
std::vector<int> visible_entries(const Workbench& bench, const MatrixXd& link) {
  const Index half = bench.table->rows() / 2;
  const auto trial_of = [&](const std::vector<int>& entries) {
    Candidate c(PayloadChange{});
    c.columns = from_row(last_link_columns(bench, link(Eigen::all, entries)), half);
    return judge(bench, c);
  };
  std::vector<int> entries;
  for (int e = 0; e < 4; ++e) {
    if (link.col(e).norm() > 1e-12) entries.push_back(e);
  }
  while (!entries.empty() && !trial_of(entries).valid) {
    std::size_t worst = 0;
    double least = 1e300;
    for (std::size_t e = 0; e < entries.size(); ++e) {
      const Trial trial = trial_of({entries[e]});
      const double info = trial.valid ? 1.0 / trial.std[0] : 0.0;
      if (info < least) least = info, worst = e;
    }
    entries.erase(entries.begin() + static_cast<std::ptrdiff_t>(worst));
  }
  return entries;
}

/// Row from which on the columns explain most, first in steps of a second, then finer; 0: none explains anything.
Index best_row(const Workbench& bench, const Columns& all, int& tried) {
  const MotionTable& table = *bench.table;
  const ColumnMoments all_moments = bench.problem->moments(all);
  const auto gain_from = [&](Index row) {
    return bench.problem->gain(bench.problem->moments_from(row, all, all_moments));
  };
  const Index margin = static_cast<Index>(kMargin * table.sample_rate);
  Index best = 0;
  double best_gain = 0.0;
  const Index step = std::max<Index>(1, static_cast<Index>(1.0 * table.sample_rate));
  for (Index row = margin; row < table.rows() - margin; row += step) {
    const double g = gain_from(row);
    ++tried;
    if (g > best_gain) best_gain = g, best = row;
  }
  for (Index fine = step / 2; fine >= 1 && best > 0; fine /= 2) {
    for (const Index row : {best - fine, best + fine}) {
      if (row < margin || row >= table.rows() - margin) continue;
      const double g = gain_from(row);
      if (g > best_gain) best_gain = g, best = row;
    }
    if (static_cast<double>(fine) / table.sample_rate < 0.01) break;
  }
  return best;
}

std::vector<Candidate> propose_payload_change(const Workbench& bench, const std::vector<bool>&) {
  Candidate c(PayloadChange{});
  const MotionTable& table = *bench.table;
  const auto refused = [&c](const char* why) {
    c.refused = why;
    return std::vector<Candidate>{std::move(c)};
  };
  if (table.runs.size() != 1) return refused("events are looked for in single training logs");
  const MatrixXd link = bench.base->link_share(table.num_joints - 1);
  c.entries = visible_entries(bench, link);
  if (c.entries.empty()) return refused("this motion shows nothing of the last link");
  const Columns all = last_link_columns(bench, link(Eigen::all, c.entries));
  const Index best = best_row(bench, all, c.tried);
  if (best == 0) return refused("explains nothing");
  // What gains most from the first or last instant tried would gain more outside of them: it is no event.
  if (std::min(best, table.rows() - best) < static_cast<Index>((kMargin + kEdge) * table.sample_rate))
    return refused("would have to happen where the log begins or ends");
  c.shape = table.time[best];
  c.columns = from_row(all, best);
  c.trial = judge(bench, c);
  return {std::move(c)};
}

/// The last link as it is at the end of training.
void apply_payload_change(const Candidate& effect, const VectorXd& c, model::Robot& robot) {
  auto& link = robot.joints.back().link;
  for (std::size_t k = 0; k < effect.entries.size(); ++k) {
    link[static_cast<std::size_t>(effect.entries[k])] += c[static_cast<Index>(k)];
  }
}

void describe_payload_change(const Candidate& effect, const VectorXd& c, const model::Robot&,
                             Finding& finding) {
  // What this motion does not show is not known, rather than 0.
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  double mass = kUnknown;
  std::array<double, 3> moment{kUnknown, kUnknown, kUnknown};
  for (std::size_t k = 0; k < effect.entries.size(); ++k) {
    const int entry = effect.entries[k];
    if (entry == 0) mass = c[static_cast<Index>(k)];
    if (entry >= 1 && entry <= 3) moment[static_cast<std::size_t>(entry - 1)] = c[static_cast<Index>(k)];
  }
  finding.parameters = {{"mass", std::abs(mass)}, {"time", effect.shape}};
  for (std::size_t k = 0; k < 3; ++k) finding.parameters.emplace_back(fmt::format("com_{}", "xyz"[k]), moment[k] / mass);
  finding.words = {{"event", std::isnan(mass) ? "changed" : mass >= 0.0 ? "picked_up" : "dropped"}};
}

}  // namespace

ArmSearch search_of(PayloadChange) {
  return {propose_payload_change, apply_payload_change, describe_payload_change};
}

}  // namespace heft::diagnose
