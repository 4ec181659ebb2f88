#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <span>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "candidates.hpp"
#include "deflection.hpp"
#include "heft/core/friction/friction.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/model/kinematics.hpp"

namespace heft::diagnose {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

std::vector<int> all_joints(int n) {
  std::vector<int> joints(static_cast<std::size_t>(n));
  std::iota(joints.begin(), joints.end(), 0);
  return joints;
}

/// Chi-square (three degrees) of a stretch of time, scaled to the residual elsewhere, from which on it is a touch:
/// far above what friction leaves at a reversal.
constexpr double kTouch = 1000.0;

Trial judge(const Workbench& bench, const Candidate& candidate) {
  return bench.problem->judge(bench.problem->moments(candidate.columns));
}

/// Takes the best of several shapes where it is better than what there is.
/// @param columns_of  columns of a shape
template <typename ColumnsOf>
void take_best(const Workbench& bench, std::span<const double> shapes, const ColumnsOf& columns_of,
               double& best, double& best_gain) {
  std::vector<Columns> candidates;
  for (const double shape : shapes) candidates.push_back(columns_of(shape));
  const std::vector<double> gains = bench.problem->gains(candidates);
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    if (gains[i] > best_gain) best_gain = gains[i], best = shapes[i];
  }
}

// ------------------------------------------------------------------------------------------------- delay

/// Torque of the present model `delay` seconds earlier, minus the one at the time itself.
Columns delay_columns(const Workbench& bench, const MatrixXd& predicted, double delay) {
  const MatrixXd difference = earlier(*bench.table, predicted, delay) - predicted;
  Columns columns;
  columns.joints = all_joints(bench.table->num_joints);
  for (const int j : columns.joints) columns.values.emplace_back(difference.col(j));
  return columns;
}

Candidate delay_candidate(const Workbench& bench) {
  Candidate c;
  c.kind = "delay";
  const MatrixXd predicted = bench.base->torque(*bench.rows, bench.problem->theta());
  double best = 0.0, best_gain = 0.0;
  const std::array<double, 9> grid{-0.004, 0.001, 0.002, 0.003, 0.005, 0.008, 0.012, 0.018, 0.027};
  c.tried = static_cast<int>(grid.size());
  take_best(
      bench, grid, [&](double delay) { return delay_columns(bench, predicted, delay); }, best, best_gain);
  // The coefficient of a shift that is right is 1; a smaller shift than tried shows as a smaller coefficient.
  for (int pass = 0; pass < 4 && best != 0.0; ++pass) {
    c.columns = delay_columns(bench, predicted, best);
    c.trial = judge(bench, c);
    if (!c.trial.valid) break;
    c.shape = best;
    const double next = best * std::clamp(c.trial.coefficients[0], -1.5, 1.5);
    if (std::abs(next - best) < 2e-5 || std::abs(next) < 1e-4) break;
    best = next;
  }
  if (c.trial.valid && c.shape * c.trial.coefficients[0] < 0.0)
    c.refused = "the torque would lead the motion";
  if (c.trial.valid && c.refused.empty()) {
    // The step of Coulomb friction comes with the reversal, whose instant stiction decides as much as a delay: the rest
    // of the torque has to be late as well.
    VectorXd theta = bench.problem->theta();
    for (int j = 0; j < bench.table->num_joints; ++j) {
      if (bench.base->coulomb(j) >= 0) theta[bench.base->coulomb(j)] = 0.0;
    }
    Candidate smooth;
    smooth.kind = c.kind;
    smooth.columns = delay_columns(bench, bench.base->torque(*bench.rows, theta), c.shape);
    smooth.trial = judge(bench, smooth);
    constexpr double kLeastShare = 0.5;
    if (!smooth.trial.valid || smooth.trial.cv_t <= 0.0 || smooth.trial.coefficients[0] < kLeastShare) {
      c.refused = "shows at reversals only, where stiction does the same";
    }
  }
  return c;
}

// ------------------------------------------------------------------------------------------------- base tilt

Candidate tilt_candidate(const Workbench& bench) {
  Candidate c;
  c.kind = "base_tilt";
  c.columns = tilt_columns(bench);
  c.trial = judge(bench, c);
  return c;
}

// ------------------------------------------------------------------------------------------------- couplings

std::vector<Candidate> coupling_candidates(const Workbench& bench) {
  std::vector<Candidate> found;
  const MotionTable& table = *bench.table;
  if (table.num_joints < 6) return found;
  Candidate c;
  c.kind = "wrist_coupling";
  c.joint = 4;
  const VectorXd v = bench.motion->qd.col(4) + bench.motion->qd.col(5);
  MatrixXd values(table.rows(), 2);
  for (Index i = 0; i < table.rows(); ++i) values(i, 0) = velocity_sign(v[i], table.sign_width[5]);
  values.col(1) = v;
  c.columns.joints = {4, 5};
  c.columns.values = {values, values};
  c.trial = judge(bench, c);
  for (Index k = 0; k < c.trial.coefficients.size(); ++k) {
    if (c.trial.coefficients[k] < -2.0 * c.trial.std[k]) c.refused = "would be negative";
  }
  // The motor that both joints turn has inertia too; it stays out unless the log shows it.
  Candidate heavy = c;
  values.conservativeResize(Eigen::NoChange, 3);
  values.col(2) = bench.motion->qdd.col(4) + bench.motion->qdd.col(5);
  heavy.columns.values = {values, values};
  heavy.trial = judge(bench, heavy);
  if (heavy.trial.valid && heavy.trial.cv_gain > 1.02 * c.trial.cv_gain &&
      heavy.trial.coefficients.minCoeff() > 0.0 && heavy.trial.coefficients[2] > 3.0 * heavy.trial.std[2]) {
    c = std::move(heavy);
  }
  found.push_back(std::move(c));
  return found;
}

// ------------------------------------------------------------------------------------------------- payload

/// Columns of the last link's parameters `entries`, all rows, for every joint.
Columns last_link_columns(const Workbench& bench, const MatrixXd& share) {
  const int n = bench.table->num_joints;
  Columns columns;
  columns.joints = all_joints(n);
  for (int j = 0; j < n; ++j) {
    const auto s = static_cast<std::size_t>(j);
    const auto& places = bench.base->places()[s];
    columns.values.push_back((*bench.rows)[s] * share(places, Eigen::all));
  }
  return columns;
}

/// The columns from a row on.
Columns from_row(Columns columns, Index from) {
  for (MatrixXd& values : columns.values) values.topRows(from).setZero();
  return columns;
}

Candidate payload_candidate(const Workbench& bench) {
  Candidate c;
  c.kind = "payload_change";
  const MotionTable& table = *bench.table;
  if (table.runs.size() != 1) {
    c.refused = "events are looked for in single training logs";
    return c;
  }
  const MatrixXd link = bench.base->link_share(table.num_joints - 1);
  // Mass and first moment; those that this motion does not show are left out.
  std::vector<int> entries;
  for (int e = 0; e < 4; ++e) {
    if (link.col(e).norm() > 1e-12) entries.push_back(e);
  }
  const auto columns_of = [&](const std::vector<int>& list) {
    return last_link_columns(bench, link(Eigen::all, list));
  };
  // Half way through, every entry that the rest of the model does not explain can be told.
  for (bool again = true; again && !entries.empty();) {
    again = false;
    Candidate half;
    half.columns = from_row(columns_of(entries), table.rows() / 2);
    if (!judge(bench, half).valid) {
      // Drop the weakest.
      std::size_t worst = 0;
      double least = 1e300;
      for (std::size_t e = 0; e < entries.size(); ++e) {
        Candidate one;
        one.columns = from_row(columns_of({entries[e]}), table.rows() / 2);
        const Trial trial = judge(bench, one);
        const double info = trial.valid ? 1.0 / trial.std[0] : 0.0;
        if (info < least) least = info, worst = e;
      }
      entries.erase(entries.begin() + static_cast<std::ptrdiff_t>(worst));
      again = true;
    }
  }
  if (entries.empty()) {
    c.refused = "this motion shows nothing of the last link";
    return c;
  }
  c.entries = entries;
  const Columns all = columns_of(entries);
  const ColumnMoments all_moments = bench.problem->moments(all);
  const auto gain_from = [&](Index row) {
    return bench.problem->gain(bench.problem->moments_from(row, all, all_moments));
  };
  const Index margin = static_cast<Index>(2.0 * table.sample_rate);
  Index best = 0;
  double best_gain = 0.0;
  const Index step = std::max<Index>(1, static_cast<Index>(1.0 * table.sample_rate));
  for (Index row = margin; row < table.rows() - margin; row += step) {
    const double g = gain_from(row);
    ++c.tried;
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
  if (best == 0) {
    c.refused = "explains nothing";
    return c;
  }
  c.shape = table.time[best];
  c.columns = from_row(all, best);
  c.trial = judge(bench, c);
  return c;
}

// ------------------------------------------------------------------------------------------------- elasticity

}  // namespace

std::vector<Candidate> elasticity_candidates(const Workbench& bench, const std::vector<bool>& joints) {
  const MotionTable& table = *bench.table;
  const int n = table.num_joints;
  const Index m = table.rows();
  const model::Dynamics dynamics(*bench.robot);
  std::vector<MatrixXd> inertia(static_cast<std::size_t>(n), MatrixXd(m, n));  // column j of M in every row
  for (Index i = 0; i < m; ++i) {
    const MatrixXd M = dynamics.mass_matrix(bench.motion->q.row(i).transpose());
    for (int j = 0; j < n; ++j) inertia[static_cast<std::size_t>(j)].row(i) = M.col(j).transpose();
  }
  std::vector<Candidate> found;
  for (int j = 0; j < n; ++j) {
    if (!joints[static_cast<std::size_t>(j)]) continue;
    Candidate c;
    c.kind = "elasticity";
    c.joint = j;
    const auto s = static_cast<std::size_t>(j);
    const VectorXd own = inertia[s].col(j);
    const double mean = own.mean();
    if (!(own.minCoeff() > 0.0)) {
      c.refused = "the fitted inertia about this joint is not positive";
      found.push_back(std::move(c));
      continue;
    }
    const auto columns_of = [&](double stiffness, double damping, bool motor) {
      const Deflection e = deflection(table, bench.load->col(j), own, stiffness, damping);
      Columns columns;
      columns.joints = all_joints(n);
      for (int i = 0; i < n; ++i) {
        MatrixXd value = MatrixXd::Zero(m, motor ? 2 : 1);
        value.col(0) = -inertia[s].col(i).cwiseProduct(e.acceleration);
        if (motor && i == j) value.col(1) = bench.motion->qdd.col(j);
        columns.values.push_back(std::move(value));
      }
      return columns;
    };
    const auto stiffness_of = [&](double hz) { return std::pow(2.0 * std::numbers::pi * hz, 2) * mean; };
    const auto damping_of = [&](double stiffness, double ratio) {
      return 2.0 * ratio * std::sqrt(stiffness * mean);
    };
    // Locked-motor frequencies.
    double best = 0.0, best_gain = 0.0, ratio = 0.02;
    constexpr int kSteps = 14;
    constexpr double kFrom = 3.0, kTo = 45.0;
    c.tried = kSteps;
    const double step = std::pow(kTo / kFrom, 1.0 / (kSteps - 1));
    const auto at_frequency = [&](double hz) {
      return columns_of(stiffness_of(hz), damping_of(stiffness_of(hz), ratio), false);
    };
    std::array<double, kSteps> frequencies{};
    for (int k = 0; k < kSteps; ++k) frequencies[static_cast<std::size_t>(k)] = kFrom * std::pow(step, k);
    take_best(bench, frequencies, at_frequency, best, best_gain);
    if (best == 0.0) {
      c.refused = "explains nothing";
      found.push_back(std::move(c));
      continue;
    }
    double width = step;
    for (int pass = 0; pass < 5; ++pass) {
      width = std::sqrt(width);
      take_best(bench, std::array{best / width, best * width}, at_frequency, best, best_gain);
    }
    take_best(
        bench, std::array{0.005, 0.01, 0.04, 0.08},
        [&](double other) {
          return columns_of(stiffness_of(best), damping_of(stiffness_of(best), other), false);
        },
        ratio, best_gain);
    c.shape = stiffness_of(best);
    c.second = damping_of(c.shape, ratio);
    c.columns = columns_of(c.shape, c.second, true);
    c.trial = judge(bench, c);
    if (!c.trial.valid) {
      c.columns = columns_of(c.shape, c.second, false);
      c.trial = judge(bench, c);
    }
    if (c.trial.valid && c.trial.coefficients[0] < 0.3)
      c.refused = "the joint would have to give against the load";
    if (c.trial.valid && c.trial.coefficients.size() > 1 && c.trial.coefficients[1] < -2.0 * c.trial.std[1]) {
      c.refused = "the motor's inertia would be negative";
    }
    found.push_back(std::move(c));
  }
  return found;
}

std::pair<Vector3d, Vector3d> horizontal_directions(const model::Robot& robot) {
  const Vector3d down = Vector3d(robot.gravity.data()).normalized();
  Vector3d first = Vector3d::UnitX() - down.x() * down;
  if (first.norm() < 0.1) first = Vector3d::UnitY() - down.y() * down;
  first.normalize();
  return {first, first.cross(down)};
}

Columns tilt_columns(const Workbench& bench) {
  const int n = bench.table->num_joints;
  const auto [first, second] = horizontal_directions(*bench.robot);
  Columns columns;
  columns.joints = all_joints(n);
  columns.values.assign(static_cast<std::size_t>(n), MatrixXd(bench.table->rows(), 2));
  int column = 0;
  for (const Vector3d& direction : {first, second}) {
    model::Robot robot = *bench.robot;
    robot.gravity = {direction.x(), direction.y(), direction.z()};
    const model::Dynamics dynamics(robot);
    for (Index i = 0; i < bench.table->rows(); ++i) {
      const VectorXd tau = dynamics.gravity_torque(bench.motion->link_q.row(i).transpose());
      for (int j = 0; j < n; ++j) columns.values[static_cast<std::size_t>(j)](i, column) = tau[j];
    }
    ++column;
  }
  return columns;
}

Candidate contact_candidate(const Workbench& bench) {
  Candidate c;
  c.kind = "contact";
  const MotionTable& table = *bench.table;
  const int n = table.num_joints;
  const MatrixXd residual = bench.problem->residual();
  const model::Kinematics kinematics(*bench.robot);
  // τ = model - Jᵀ F: sums of J w Jᵀ and -J w r over bins of 20 ms.
  const Index bin = std::max<Index>(1, static_cast<Index>(std::lround(0.02 * table.sample_rate)));
  const double seconds = static_cast<double>(bin) / table.sample_rate;
  std::vector<double> t_values, gains_found;
  for (std::size_t run = 0; run + 1 < table.run_begin.size(); ++run) {
    const Index begin = table.run_begin[run];
    const Index bins = (table.run_begin[run + 1] - begin) / bin;
    std::vector<Matrix3d> A(static_cast<std::size_t>(bins) + 1, Matrix3d::Zero());
    std::vector<Vector3d> v(static_cast<std::size_t>(bins) + 1, Vector3d::Zero());
    std::vector<double> power(static_cast<std::size_t>(bins) + 1, 0.0);
    for (Index b = 0; b < bins; ++b) {
      const auto at = static_cast<std::size_t>(b);
      A[at + 1] = A[at];
      v[at + 1] = v[at];
      power[at + 1] = power[at];
      const Index middle = begin + b * bin + bin / 2;
      const MatrixXd J = kinematics.jacobian(bench.motion->link_q.row(middle).transpose()).topRows(3);
      for (int j = 0; j < n; ++j) {
        const double w = bench.problem->weight(j);
        // A joint at rest holds with whatever part of its friction it stopped with: that is no touch.
        const auto moves =
            (bench.motion->qd.col(j).segment(begin + b * bin, bin).array().abs() > 2.0 * table.sign_width[j])
                .cast<double>();
        const VectorXd keep = table.keep.col(j).segment(begin + b * bin, bin).array() * moves;
        const double sum = residual.col(j).segment(begin + b * bin, bin).dot(keep);
        A[at + 1] += w * keep.sum() * J.col(j) * J.col(j).transpose();
        v[at + 1] -= w * sum * J.col(j);
        // Power of the bins' means: what a force of 20 ms and more could explain.
        if (keep.sum() > 0.0) power[at + 1] += w * sum * sum / keep.sum();
      }
    }
    struct Window {
      Index first, count;
      double gain, share;
      Vector3d force;
    };
    std::vector<std::pair<Index, Index>> taken;
    const std::size_t before = c.events.size();
    double next = 0.0;
    for (int event = 0; event < 6; ++event) {
      Window best{0, 0, 0.0, 0.0, Vector3d::Zero()};
      double scale = 0.0;
      for (Index count = static_cast<Index>(0.26 / seconds); count <= static_cast<Index>(1.2 / seconds);
           count += 2) {
        std::vector<double> gains;
        for (Index first = 0; first + count <= bins; ++first) {
          bool free = true;
          for (const auto& [from, to] : taken) free = free && (first + count <= from || first >= to);
          if (!free) continue;
          const auto a = static_cast<std::size_t>(first), b = static_cast<std::size_t>(first + count);
          Matrix3d M = A[b] - A[a];
          M.diagonal().array() += 1e-6 * M.trace() + 1e-12;
          const Vector3d s = v[b] - v[a];
          const Vector3d F = M.llt().solve(s);
          const double g = F.dot(s);
          gains.push_back(g);
          if (g > best.gain) best = {first, count, g, g / std::max(1e-12, power[b] - power[a]), F};
        }
        if (gains.size() > 20 && best.count == count) {
          std::nth_element(gains.begin(), gains.begin() + static_cast<std::ptrdiff_t>(gains.size() / 2),
                           gains.end());
          scale = gains[gains.size() / 2] / 2.37;  // median of a chi-square with three degrees
        }
      }
      if (best.count == 0 || !(scale > 0.0)) break;
      const double statistic = best.gain / std::max(1.0, scale);
      next = statistic;
      if (statistic < kTouch || best.share < 0.6) break;
      const Index from = std::max<Index>(0, best.first - static_cast<Index>(0.1 / seconds));
      const Index to = best.first + best.count + static_cast<Index>(0.1 / seconds);
      taken.emplace_back(from, to);
      c.events.emplace_back(table.time[begin + best.first * bin], static_cast<double>(best.count) * seconds);
      c.forces.push_back(best.force);
      c.event_runs.push_back(static_cast<int>(run));
      if (event < 5) next = 0.0;
      gains_found.push_back(best.gain);
      t_values.push_back(statistic);
    }
    // A touch stands alone. Where the next stretch is nearly as bad, something else is wrong all along.
    while (c.events.size() > before && t_values.back() < 3.0 * next) {
      next = t_values.back();
      for (auto* list : {&t_values, &gains_found}) list->pop_back();
      c.events.pop_back();
      c.forces.pop_back();
      c.event_runs.pop_back();
    }
  }
  if (c.events.empty()) {
    c.refused = "no stretch of time stands out";
    return c;
  }
  c.trial.valid = true;
  c.trial.gain = c.trial.cv_gain = std::accumulate(gains_found.begin(), gains_found.end(), 0.0);
  c.trial.wald = *std::max_element(t_values.begin(), t_values.end());
  c.trial.p_value = std::max(1e-300, std::exp(-0.5 * c.trial.wald));
  c.trial.cv_t = std::sqrt(c.trial.wald);
  c.trial.joint_before = c.trial.joint_after = VectorXd::Zero(n);
  return c;
}

std::vector<Candidate> arm_candidates(const Workbench& bench) {
  std::vector<Candidate> found;
  found.push_back(delay_candidate(bench));
  found.push_back(tilt_candidate(bench));
  found.push_back(payload_candidate(bench));
  for (Candidate& c : coupling_candidates(bench)) found.push_back(std::move(c));
  return found;
}

}  // namespace heft::diagnose
