/// @file
/// Whether the arm carried something else in the validation logs than in the training logs.
#pragma once

#include <optional>
#include <string>

#include "written_model.hpp"

namespace heft::diagnose {

/// For the user: "in the validation logs the arm carries 0.3 ± 0.02 kg more ...".
std::string in_words(const OtherLoad& load);

/// Fits mass and first moment of the last link to what the written model leaves of the validation logs, beside one scale of
/// their torque: logs of another torque constant carry no load. A load is found if its mass is out of doubt, for the interval of
/// the training logs' fit as well, and it moves a joint by more than the training logs leave there: what a model does not know
/// makes up some mass in every log.
/// @param parameters  of the written model's fit, with covariance
/// @param trained     the training logs, read as the written model reads them
std::optional<OtherLoad> other_load(const WrittenModel& written, const BaseModel& base,
                                    const model::FitRecord& parameters, const JudgedMotion& trained);

}  // namespace heft::diagnose
