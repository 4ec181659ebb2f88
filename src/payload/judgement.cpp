#include "judgement.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "heft/host/decompositions.hpp"
#include "heft/model/physical_links.hpp"
#include "heft/statistics/distributions.hpp"

namespace heft::payload {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using host::Judgement;
using Rank = host::Verdict;

Eigen::Matrix4d pseudo_inertia(const VectorXd& p) {
  InertialParameters<double> link;
  for (std::size_t k = 0; k < 10; ++k) link[k] = p[static_cast<Index>(k)];
  return model::pseudo_inertia_matrix(link);
}

/// Scheffé's factor for ten parameters: 95 % for all their combinations at once, whichever the data choose, with
/// `factor` the one of a single parameter.
double simultaneous(double factor) {
  constexpr double kChiSquare10 = 18.307;
  return std::sqrt(kChiSquare10) * factor / statistics::kNormal95;
}

/// By how much of its standard deviation the load's pseudo-inertia is negative in its worst direction; 0: a body can
/// have these parameters.
double impossibility(const PayloadRun& run) {
  double worst = 0.0;
  // What is an eigenvector depends on the unit of length; loads of a hand's to an arm's size are looked at.
  for (const double length : {0.03, 0.1, 0.3}) {
    const Eigen::Vector4d scale(1.0 / length, 1.0 / length, 1.0 / length, 1.0);
    const Eigen::Matrix4d J = scale.asDiagonal() * pseudo_inertia(run.parameters) * scale.asDiagonal();
    const MatrixXd directions = eigensystem_of(J).vectors;
    for (int k = 0; k < 4; ++k) {
      const Eigen::Vector4d v = scale.asDiagonal() * directions.col(k);
      VectorXd slope(10);
      for (int i = 0; i < 10; ++i) slope[i] = v.dot(pseudo_inertia(VectorXd::Unit(10, i)) * v);
      const double value = slope.dot(run.parameters);
      const double std = std::sqrt(slope.dot(run.covariance * slope));
      if (value < 0.0 && std > 0.0) worst = std::max(worst, -value / std);
    }
  }
  return worst;
}

bool all_known(const std::vector<Estimated>& estimates) {
  return !estimates.empty() && std::all_of(estimates.begin(), estimates.end(),
                                           [](const Estimated& estimate) { return estimate.identifiable; });
}

}  // namespace

std::string contradiction(const PayloadRun& run) {
  const bool has_mass = run.mass.identifiable;
  if (has_mass && run.mass.upper < 0.0) {
    return fmt::format(
        "the estimated mass is negative ({:.3g} kg ± {:.2g} kg): are --baseline and --log interchanged? "
        "Otherwise the model is not that of this arm without load, or the torques have another sign",
        run.mass.value, run.mass.half_width());
  }
  for (std::size_t j = 0; j < run.torque_scale.size(); ++j) {
    const Estimated& scale = run.torque_scale[j];
    if (!scale.identifiable) continue;
    if (scale.upper >= 1.0 / kScaleImpossible && scale.lower <= kScaleImpossible) continue;
    return fmt::format(
        "joint {} feels {:.2g} ± {:.2g} times the load that the joints together feel: its "
        "torque has another {} than that of the others; check tau{} (or its torque constant), "
        "or leave it out with --rows",
        j + 1, scale.value, scale.half_width(), scale.value < 0.0 ? "sign" : "unit or scale", j + 1);
  }
  const bool has_body = has_mass && all_known(run.first_moment) && all_known(run.inertia);
  if (has_body && run.covariance.size() > 0) {
    const double off = impossibility(run), limit = simultaneous(run.interval_factor);
    if (off > limit) {
      return fmt::format(
          "mass, centre of mass and inertia are physically impossible, by {:.2g} standard deviations "
          "({:.2g} are allowed for); check that --baseline was recorded without load and that the URDF is "
          "that of this arm",
          off, limit);
    }
  }
  return {};
}

Judgement judge(const PayloadRun& run) {
  Judgement judgement;
  const std::string against = contradiction(run);
  if (!against.empty()) judgement.add(Rank::kBad, against);
  if (!run.mass.identifiable) {
    const bool moments = !run.mass_visible && all_known(run.first_moment);
    judgement.add(moments ? Rank::kDoubtful : Rank::kBad,
                  fmt::format("the mass cannot be determined: {}", run.missing));
  } else if (!run.converged_at) {
    judgement.add(Rank::kDoubtful, "the estimate had not converged by the end of the log");
  }
  std::vector<std::string> off;
  for (std::size_t j = 0; j < run.torque_scale.size(); ++j) {
    const Estimated& scale = run.torque_scale[j];
    if (scale.identifiable && std::abs(scale.value - 1.0) > kScaleOff && !scale.contains(1.0)) {
      off.push_back(fmt::format("joint {} {:.2f} ± {:.2f}", j + 1, scale.value, scale.half_width()));
    }
  }
  if (!off.empty() && against.empty()) {
    judgement.add(Rank::kDoubtful, fmt::format("the joints disagree about the load; torque scale against all "
                                               "joints together: {}; check the torque constants",
                                               fmt::join(off, ", ")));
  }
  return judgement;
}

}  // namespace heft::payload
