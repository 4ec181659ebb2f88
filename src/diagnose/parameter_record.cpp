// Intervals of everything that a diagnosis fitted.
#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "arm_search.hpp"
#include "engine.hpp"
#include "heft/statistics/distributions.hpp"
#include "heft/statistics/jackknife.hpp"
#include "moments.hpp"

namespace heft::diagnose {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd Problem::changes_without_blocks(const Problem& held_by, const std::vector<bool>& follows) const {
  // What a model misses stays correlated for some seconds: neighbouring blocks go together while a dozen groups are left.
  constexpr std::size_t kGroups = 12, kMost = 3;
  const std::size_t all = table_->blocks.size(), together = std::clamp<std::size_t>(all / kGroups, 1, kMost);
  // A prior that steadies a fit makes it repeat itself, not be right: intervals are those of the fit without it.
  const VectorXd held = solve(held_by.total_, -1, kLeastSteady, held_by.ridge_).theta;
  const VectorXd theta = solve(total_, -1, kLeastSteady, ridge_).theta;
  MatrixXd changes(columns_, static_cast<Index>(all));
  Index groups = 0;
  for (std::size_t first = 0; first < all; first += together) {
    const std::size_t end = std::min(all, first + together);
    MatrixXd rest = total_without(first, end);
    if (rest == total_) continue;
    // What is held goes where the fit that it comes from goes: (A + S r S) Δθ = Δa + S r S Δθ_held, S the columns' norms.
    const VectorXd moved =
        solve(held_by.total_without(first, end), -1, kLeastSteady, held_by.ridge_).theta - held;
    for (std::size_t c = 0; c < follows.size(); ++c) {
      const auto at = static_cast<Index>(c);
      if (follows[c]) rest(at, columns_) += ridge_[at] * rest(at, at) * moved[at];
    }
    const VectorXd change = solve(rest, -1, kLeastSteady, ridge_).theta - theta;
    if (change.allFinite()) changes.col(groups++) = change;
  }
  return changes.leftCols(groups);
}

VectorXd Problem::unsteadied_theta() const { return solve(total_, -1, kLeastSteady, ridge_).theta + prior_; }

/// Moments of all rows but those of some blocks.
MatrixXd Problem::total_without(std::size_t first, std::size_t end) const {
  MatrixXd rest = total_;
  for (std::size_t b = first; b < end; ++b) {
    for (int j = 0; j < num_joints(); ++j) {
      const auto s = static_cast<std::size_t>(j);
      add_moments(*moments_[b][s], places_[s], -weight(j), rest);
    }
  }
  return rest;
}

MatrixXd Engine::effect_torque(std::size_t index) const {
  const Candidate& effect = accepted[index];
  if (effect.effect.is<Delay>() || effect.effect.is<Contact>() || effect.effect.is<PayloadChange>())
    return {};
  MatrixXd torque = MatrixXd::Zero(table_.rows(), table_.num_joints);
  if (effect.is_elastic()) {
    // With its deflection less with a rigid joint that has the same motor.
    const VectorXd beta = base_parameters();
    Motion rigid = motion_;
    rigid.link_q.col(effect.joint) = rigid.q.col(effect.joint);
    rigid.link_qd.col(effect.joint) = rigid.qd.col(effect.joint);
    rigid.link_qdd.col(effect.joint) = rigid.qdd.col(effect.joint);
    torque = base_.torque(*rows_, beta) - base_.torque(base_.rows(rigid), beta);
    if (first_column_[index] >= 0)
      torque.col(effect.joint) += motion_.qdd.col(effect.joint) * fitted(index)[0];
    return torque;
  }
  const VectorXd c = fitted(index);
  for (std::size_t a = 0; a < effect.columns.joints.size() && c.size() > 0; ++a) {
    const int joint = effect.columns.joints[a];
    torque.col(joint) += effect.columns.values[a].leftCols(c.size()) * c;
    // It holds the Coulomb friction as well, which is no part of what was missing.
    if (effect.replaces >= 0) torque.col(joint) -= motion_.direction.col(joint) * c[0];
  }
  return torque;
}

/// Which base columns are held at the values of the fit without effects, where they are held at all.
std::vector<bool> Engine::followers() const {
  std::vector<bool> follows(static_cast<std::size_t>(base_.columns()));
  for (int c = 0; c < base_.columns(); ++c) follows[static_cast<std::size_t>(c)] = !is_out(c);
  return follows;
}

/// Derivatives of the torque by what it is not linear in: by the logarithm of an effect's shape, by a delay [s].
/// @param whose  out: the effect of each
std::vector<Columns> Engine::shape_slopes(std::vector<std::size_t>& whose) const {
  constexpr double kProbe = 1e-3;  // of the shape
  std::vector<Columns> slopes;
  for (std::size_t e = 0; e < accepted.size(); ++e) {
    const Candidate& effect = accepted[e];
    if (effect.effect.is<Delay>()) {
      const double row = 1.0 / table_.sample_rate;
      const MatrixXd torque = predicted();
      const MatrixXd change = (earlier(table_, torque, row) - earlier(table_, torque, -row)) / (2.0 * row);
      Columns slope;
      slope.joints = all_joints(table_.num_joints);
      for (const int j : slope.joints) slope.values.emplace_back(change.col(j));
      slopes.push_back(std::move(slope));
      whose.push_back(e);
    } else if (effect.effect.joint_effect() >= 0 && effect.shape > 0.0 && first_column_[e] >= 0 && !shares_memory(e)) {
      const auto at = [&](double shape) {
        return VectorXd(joint_effect_columns(bench(), effect.effect.joint_effect(), effect.joint, shape,
                                             {effect.replaces >= 0, effect.displacement}, effect.level) * fitted(e));
      };
      VectorXd slope = (at(effect.shape * (1.0 + kProbe)) - at(effect.shape * (1.0 - kProbe))) / (2.0 * kProbe);
      if (!(slope.squaredNorm() > 0.0)) continue;
      slopes.push_back({{effect.joint}, {std::move(slope)}});
      whose.push_back(e);
    }
  }
  return slopes;
}

std::vector<Replica> Engine::replicas() const {
  load_all();
  std::vector<std::size_t> whose;
  const std::vector<Columns> slopes = shape_slopes(whose);
  Problem around = *problem_;
  const std::vector<int> firsts = around.append(slopes);
  around.reweight();
  const MatrixXd changes = around.changes_without_blocks(*fit_->fitted, followers());
  const VectorXd theta = problem_->theta();
  const auto model_of = [&](const VectorXd& change) {
    Replica replica;
    replica.robot = base_.robot(theta + change.head(theta.size()));
    Index spring = first_spring_column_;
    for (std::size_t e = 0; e < accepted.size(); ++e) {
      const Candidate& effect = accepted[e];
      Replica::Effect numbers{fitted(e), effect.shape, effect.second};
      if (first_column_[e] >= 0) numbers.coefficients += change.segment(first_column_[e], numbers.coefficients.size());
      if (effect.is_elastic() && spring >= 0) {
        numbers.shape *= std::exp(change[spring++]);
        numbers.second *= std::exp(change[spring++]);
      }
      for (std::size_t k = 0; k < whose.size(); ++k) {
        if (whose[k] != e) continue;
        const double by = change[firsts[k]];
        numbers.shape = effect.effect.is<Delay>() ? numbers.shape + by : numbers.shape * std::exp(by);
      }
      replica.effects.push_back(std::move(numbers));
    }
    return replica;
  };
  VectorXd from = around.unsteadied_theta();
  from.head(theta.size()) -= theta;
  std::vector<Replica> all{model_of(from)};
  for (Index b = 0; b < changes.cols(); ++b) all.push_back(model_of(from + changes.col(b)));
  return all;
}

model::FitRecord Engine::parameter_record() const {
  model::FitRecord record;
  const MatrixXd changes = problem_->changes_without_blocks(*fit_->fitted, followers());
  const auto blocks = static_cast<int>(changes.cols());
  MatrixXd covariance = statistics::jackknife_covariance(changes);
  for (int c = 0; c < base_.columns(); ++c) {  // a column that the model does without is 0 and not known to be so
    if (!is_out(c)) continue;
    covariance.row(c).setZero();
    covariance.col(c).setZero();
  }
  const double factor = statistics::interval_factor(blocks - 1);
  const VectorXd theta = problem_->theta(), own = base_.prior();
  std::vector<int>
      places;  // of each entry of the record among the columns; -1: not fitted by a column of its own
  const auto std_of = [&](int column) { return std::sqrt(std::max(0.0, covariance(column, column))); };
  for (int c = 0; c < base_.columns(); ++c) {
    const double std = std_of(c);
    // A link's parameter known to no better than half of its size is not determined; friction is known where it is small.
    const bool determined =
        !base_.is_link(c) || factor * std < 0.5 * std::max(std::abs(theta[c]), std::abs(own[c]));
    record.base_parameters.push_back(
        {base_.name(c), base_.unit(c), base_.expression(c), theta[c], std, factor * std, determined});
    places.push_back(c);
  }
  int effects = 0;
  for (std::size_t e = 0; e < accepted.size(); ++e) {
    const Candidate& effect = accepted[e];
    if (effect.effect.joint_effect() < 0) continue;
    const VectorXd c = coefficients(e);
    const bool in_actuation = effect.effect.is<Offset>() || effect.effect.is<RotorInertia>();
    // A second memory shares its coefficient with the first: its column alone does not say how well either is known.
    const bool shared = shares_memory(e);
    for (int k = 0; k < static_cast<int>(c.size()); ++k) {
      const int place = shared || first_column_[e] < 0 ? -1 : first_column_[e] + k;
      const double std = place < 0 ? std::numeric_limits<double>::quiet_NaN() : std_of(place);
      if (in_actuation) {
        const std::string name =
            fmt::format("{}{}", effect.effect.is<Offset>() ? "off" : "Ia", effect.joint + 1);
        const std::string_view unit = effect.effect.visit([](auto type) { return type.kParameters[0].unit; });
        record.base_parameters.push_back({name, std::string(unit), name, c[k], std, factor * std, true});
        places.insert(places.begin() + static_cast<std::ptrdiff_t>(record.base_parameters.size()) - 1, place);
      } else {
        record.effect_coefficients.push_back({effects, k, c[k], std, factor * std});
        places.push_back(place);
      }
    }
    if (!in_actuation) ++effects;
  }
  const auto count = static_cast<Index>(places.size());
  record.parameter_covariance.resize(count, count);
  for (Index r = 0; r < count; ++r) {
    for (Index c = 0; c < count; ++c) {
      const int row = places[static_cast<std::size_t>(r)], column = places[static_cast<std::size_t>(c)];
      record.parameter_covariance(r, c) =
          row < 0 || column < 0 ? std::numeric_limits<double>::quiet_NaN() : covariance(row, column);
    }
  }
  return record;
}

}  // namespace heft::diagnose
