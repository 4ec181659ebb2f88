/// @file
/// What the verdict was found with, fitted once more to all logs.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "written_model.hpp"

namespace heft::diagnose {

struct Refit {
  std::optional<Refitted> refitted;  ///< its parameters are not set
  std::string note;                  ///< for the user: how far, or why not
  bool contradicts{false};           ///< training and validation logs do not fit one model
};

/// Fits rigid bodies, rotor inertia, Coulomb, viscous and offset to the training and validation logs together, as identify
/// does, beside the effects of the written model, and goes towards that fit as far as fits to all logs but a stretch of the
/// validation logs lower the errors on that stretch, and as far as these stretches agree. Nothing where the errors on them
/// do not fall by 2 % and by more than their standard error, or where the training logs lose as much as these gain: then the
/// logs contradict each other.
/// @param trained  the training logs, read as the written model reads them
Refit refit(const WrittenModel& written, const BaseModel& base, const std::vector<data::Log>& train,
            const JudgedMotion& trained, const std::vector<data::Log>& validate, const Reading& reading);

/// Puts the offset of a joint into the spring or cable that contains it, which changes no torque:
/// k (x - x0) + off = k (x - (x0 - off/k)). What a cable so pulls more at its driving joint is taken from that one's offset.
void put_offset_into_pull(model::Robot& robot);

/// Parameters of a fit with the values of a robot that was fitted again, intervals and covariance as they were.
/// @param once  the robot that they are of
model::FitRecord with_values_of(const model::Robot& again, const model::Robot& once, const BaseModel& base,
                                model::FitRecord parameters);

}  // namespace heft::diagnose
