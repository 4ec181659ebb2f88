/// @file
/// How large a load may be, and how well a model of the arm fits, where nobody says so.
#pragma once

#include <cmath>
#include <cstddef>

#include "heft/core/arm_geometry.hpp"
#include "heft/core/arm_model.hpp"
#include "heft/core/numeric_range.hpp"
#include "heft/core/run_clock.hpp"
#include "heft/core/status.hpp"

namespace heft::detail {

template <typename Scalar, int N>
struct LoadPriors {
  using Vector = JointVector<Scalar, N>;

  Scalar mass{0};      ///< standard deviation [kg]: a third of the arm's mass
  Scalar length{0};    ///< that scales first moment and inertia [m]: a tenth of the arm's length
  Scalar farthest{0};  ///< centre of mass of a load [m]: half the arm's length
  Scalar friction{0};  ///< of the last joint, that a load may change [N·m, N]: half of what it has
  Vector noise = Vector::Zero();  ///< standard deviation of the residual [N·m, N]: from friction and weight

  template <typename Actuation>
  LoadPriors(const ArmModel<Scalar, N>& model, const Actuation& actuation) noexcept {
    using std::sqrt;
    Scalar weight(0), reach(0);
    for (std::size_t j = 0; j < model.links.size(); ++j) {
      weight += model.links[j][kMass];
      const auto& p = model.joints[j].position;
      reach += sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
    }
    mass = at_least(weight / Scalar(3), 0.01);
    length = at_least(static_cast<Scalar>(0.1) * reach, 0.02);
    farthest = at_least(static_cast<Scalar>(0.5) * reach, 0.1);
    friction = at_least(static_cast<Scalar>(0.5) * actuation[N - 1].coulomb_friction, 1e-6);
    for (int i = 0; i < N; ++i) {
      noise[i] = static_cast<Scalar>(0.05) * actuation[static_cast<std::size_t>(i)].coulomb_friction +
                 static_cast<Scalar>(2e-4 * 9.81) * weight;
    }
  }

  static Scalar at_least(const Scalar& value, double least) noexcept {
    return value > static_cast<Scalar>(least) ? value : static_cast<Scalar>(least);
  }
};

/// Settings of PayloadEstimator for a configuration of LoadObserver; what that leaves open comes from the priors.
/// @return kOutOfRange
template <typename Scalar, int N, typename Config, typename Settings>
Status payload_settings(const Config& config, const LoadPriors<Scalar, N>& priors,
                        Settings& settings) noexcept {
  const auto positive = [](const Scalar& value) { return value > Scalar(0) && is_usable(value); };
  const auto not_negative = [](const Scalar& value) { return value >= Scalar(0) && is_usable(value); };
  if (config.first_row < 0 || config.first_row >= N || config.rows_per_sample < 0 ||
      !positive(config.update_rate) || !not_negative(config.mass_prior) ||
      !not_negative(config.friction_prior) || !positive(config.uncertain_speed) ||
      !not_negative(config.transition_time) || !positive(config.longest_rest) ||
      !(config.start_time >= Scalar(0) && config.start_time <= static_cast<Scalar>(kLongestStep))) {
    return Status::kOutOfRange;
  }
  settings.first_row = config.first_row;
  settings.mass_prior = config.mass_prior > Scalar(0) ? config.mass_prior : priors.mass;
  settings.length_prior = priors.length;
  settings.friction_prior = config.friction_prior > Scalar(0) ? config.friction_prior : priors.friction;
  settings.gate = Scalar(0);
  settings.forgetting_factor = Scalar(1);  // a change starts it again
  settings.sign_width = config.sign_width;
  for (int i = 0; i < N; ++i) {
    if (!not_negative(config.noise_std[i]) || !(config.torque_limit[i] > Scalar(0))) {
      return Status::kOutOfRange;
    }
    const Scalar noise = config.noise_std[i] > Scalar(0) ? config.noise_std[i] : priors.noise[i];
    settings.noise_std[i] = priors.at_least(noise, 1e-9);
  }
  return Status::kOk;
}

}  // namespace heft::detail
