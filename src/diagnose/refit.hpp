/// @file
/// What the verdict was found with, fitted once more to all logs.
#pragma once

#include <optional>
#include <vector>

#include "written_model.hpp"

namespace heft::diagnose {

struct Refit {
  /// The written model with its effects as they are, and its base between what it was and a fit to all logs.
  model::Robot robot;
  double part;  ///< how far it goes towards that fit, 0 to 1
  /// Geometric mean of the errors of such models on stretches of the validation logs that they were not fitted to, against
  /// those of the written model [1].
  double ratio;
};

/// Fits rigid bodies, rotor inertia, Coulomb, viscous and offset to the training and validation logs together, as identify
/// does, beside the effects of the written model, and goes towards that fit as far as fits to all logs but a stretch of the
/// validation logs lower the errors on that stretch, and as far as these stretches agree. Nothing where the errors on them
/// do not fall by 2 %.
std::optional<Refit> refit(const WrittenModel& written, const BaseModel& base,
                           const std::vector<data::Log>& train, const std::vector<data::Log>& validate,
                           const Reading& reading);

}  // namespace heft::diagnose
