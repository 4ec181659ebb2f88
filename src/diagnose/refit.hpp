/// @file
/// What the verdict was found with, fitted once more to all logs.
#pragma once

#include <optional>
#include <vector>

#include "written_model.hpp"

namespace heft::diagnose {

struct Refit {
  model::Robot robot;  ///< the written model with its effects as they are and its base fitted to all logs
  /// Geometric mean of its errors on halves of the validation logs that it was not fitted to, against those of the
  /// written model [1].
  double ratio;
};

/// Fits rigid bodies, rotor inertia, Coulomb, viscous and offset to the training and validation logs together, as identify
/// does, beside the effects of the written model. Nothing where a half of the validation logs is too short to judge on, or
/// where the errors on the other half, with which the fit is checked first, do not fall.
std::optional<Refit> refit(const WrittenModel& written, const BaseModel& base,
                           const std::vector<data::Log>& train, const std::vector<data::Log>& validate,
                           const Reading& reading);

}  // namespace heft::diagnose
