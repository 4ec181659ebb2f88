// Gravity, inertia and friction of two models side by side.
#include <cmath>

#include "fitted_model.hpp"

namespace heft::compare {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Σ over joints' rows: the variance of each joint's torque, n.
VectorXd variance_of(const FittedModel& model, const MatrixXd& rows) {
  VectorXd variance(rows.rows());
  for (Index j = 0; j < rows.rows(); ++j) variance[j] = model.variance(rows.row(j).transpose());
  return variance;
}

}  // namespace

std::vector<TorquePart> torque_parts(const FittedModel& before, const FittedModel& after,
                                     const std::vector<State>& states) {
  const Index n = before.robot().num_joints();
  const auto count = static_cast<double>(states.size());
  std::vector<TorquePart> parts;
  for (const Part part : {Part::kStatic, Part::kInertia, Part::kFriction}) {
    VectorXd old_square = VectorXd::Zero(n), new_square = old_square, change = old_square, open = old_square;
    for (const State& state : states) {
      const VectorXd a = before.torque(part, state), b = after.torque(part, state);
      old_square += a.cwiseAbs2();
      new_square += b.cwiseAbs2();
      change += (b - a).cwiseAbs2();
      open += variance_of(before, before.rows(part, state)) + variance_of(after, after.rows(part, state));
    }
    const auto rms = [&](double sum) { return std::sqrt(sum / count); };
    for (Index j = 0; j < n; ++j) {
      parts.push_back(
          {static_cast<int>(j), part, rms(old_square[j]), rms(new_square[j]), rms(change[j]), rms(open[j])});
    }
  }
  return parts;
}

VectorXd typical_load(const FittedModel& model, const std::vector<State>& states) {
  VectorXd square = VectorXd::Zero(model.robot().num_joints());
  for (const State& state : states)
    square += (model.torque(Part::kStatic, state) + model.torque(Part::kInertia, state)).cwiseAbs2();
  return (square / static_cast<double>(states.size())).cwiseSqrt();
}

std::vector<FrictionCurve> friction_curves(const FittedModel& before, const FittedModel& after,
                                           const VectorXd& load) {
  constexpr Index kPoints = 40;
  std::vector<FrictionCurve> curves;
  for (int j = 0; j < before.robot().num_joints(); ++j) {
    FrictionCurve curve;
    curve.joint = j;
    // Denser where friction bends: speeds rise by their square.
    curve.speed = VectorXd::LinSpaced(kPoints, 0.05, 1.0).cwiseAbs2() *
                  fastest(before.robot().joints[static_cast<std::size_t>(j)]);
    curve.before = curve.after = curve.before_half = curve.after_half = curve.speed;
    for (Index k = 0; k < kPoints; ++k) {
      VectorXd gradient;
      curve.before[k] = before.friction(j, curve.speed[k], load[j], &gradient);
      curve.before_half[k] = statistics::kNormal95 * std::sqrt(before.variance(gradient));
      curve.after[k] = after.friction(j, curve.speed[k], load[j], &gradient);
      curve.after_half[k] = statistics::kNormal95 * std::sqrt(after.variance(gradient));
    }
    curves.push_back(std::move(curve));
  }
  return curves;
}

}  // namespace heft::compare
