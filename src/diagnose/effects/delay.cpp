// A late torque channel.
#include <algorithm>
#include <array>
#include <cmath>

#include "../arm_search.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Torque of the present model `delay` seconds earlier, minus the one at the time itself.
Columns delay_columns(const Workbench& bench, const MatrixXd& predicted, double delay) {
  const MatrixXd difference = earlier(*bench.table, predicted, delay) - predicted;
  Columns columns;
  columns.joints = all_joints(bench.table->num_joints);
  for (const int j : columns.joints) columns.values.emplace_back(difference.col(j));
  return columns;
}

/// Whether the torque without the step of Coulomb friction is late as well. The step comes with the reversal, whose
/// instant stiction decides as much as a delay.
bool smooth_part_is_late(const Workbench& bench, double delay) {
  constexpr double kLeastShare = 0.5;
  VectorXd theta = bench.problem->theta();
  for (int j = 0; j < bench.table->num_joints; ++j) {
    if (bench.base->coulomb(j) >= 0) theta[bench.base->coulomb(j)] = 0.0;
  }
  Candidate smooth(Delay{});
  smooth.columns = delay_columns(bench, bench.base->torque(*bench.rows, theta), delay);
  const Trial trial = judge(bench, smooth);
  return trial.valid && trial.cv_t > 0.0 && trial.coefficients[0] >= kLeastShare;
}

std::vector<Candidate> propose_delay(const Workbench& bench, const std::vector<bool>&) {
  Candidate c(Delay{});
  const MatrixXd predicted = bench.base->torque(*bench.rows, bench.problem->theta());
  double best = 0.0, best_gain = 0.0;
  const std::array<double, 9> grid{-0.004, 0.001, 0.002, 0.003, 0.005, 0.008, 0.012, 0.018, 0.027};
  c.tried = static_cast<int>(grid.size());
  const auto write = [&](int joint, Index from, Eigen::Ref<MatrixXd> values) {
    for (std::size_t k = 0; k < grid.size(); ++k) {
      auto value = values.col(static_cast<Index>(k));
      put_earlier(*bench.table, predicted.col(joint), grid[k], from, value);
      value -= predicted.col(joint).segment(from, values.rows());
    }
  };
  take_best(bench, grid, write, best, best_gain);
  if (best_gain < bench.least_gain) {
    c.refused = kOfNoUse;
    return {std::move(c)};
  }
  // The coefficient of a shift that is right is 1; a smaller shift than tried shows as a smaller coefficient. In slow motion any shift
  // explains the same by its coefficient, so that the first one may be far below.
  constexpr int kPasses = 8;
  constexpr double kMostTimes = 3.0;
  for (int pass = 0; pass < kPasses && best != 0.0; ++pass) {
    c.columns = delay_columns(bench, predicted, best);
    c.trial = judge(bench, c);
    if (!c.trial.valid) break;
    c.shape = best;
    const double next = best * std::clamp(c.trial.coefficients[0], -kMostTimes, kMostTimes);
    if (std::abs(next - best) < 2e-5 || std::abs(next) < 1e-4) break;
    best = next;
  }
  c.second = delay_reach(c.shape);
  if (c.trial.valid && c.shape * c.trial.coefficients[0] < 0.0) {
    c.refused = "the torque would lead the motion";
  } else if (c.trial.valid && !smooth_part_is_late(bench, c.shape)) {
    c.refused = "shows at reversals only, where stiction does the same";
  }
  return {std::move(c)};
}

void apply_delay(const Candidate& effect, const VectorXd&, model::Robot& robot) {
  robot.torque_delay += effect.shape;
}

void describe_delay(const Candidate& effect, const VectorXd&, const model::Robot&, Finding& finding) {
  finding.parameters = {{"delay", effect.shape}};
}

}  // namespace

double delay_reach(double delay) {
  constexpr double kTimes = 2.0, kLeast = 0.004;
  return kTimes * delay + kLeast;
}

ArmSearch search_of(Delay) { return {propose_delay, apply_delay, describe_delay}; }

}  // namespace heft::diagnose
