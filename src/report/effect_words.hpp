/// @file
/// Effects in words.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "heft/diagnose/diagnose.hpp"

namespace heft::report {

/// "Stribeck friction", "a spring": follows "lacks".
std::string effect_name(EffectKind effect);
/// "Stribeck friction in joint 2", "a delay of the torque channel", "a cable over joints 1 and 2".
/// @param joint, driven  counted from 0; -1: the whole arm, an effect of one joint
std::string effect_in_place(EffectKind effect, int joint, int driven = -1);
/// The term that the effect adds.
std::string effect_equation(const diagnose::Finding& finding);
/// The motion that would tell the effect from its rivals.
std::string shown_by(const diagnose::Finding& finding);
/// What is wrong, as the beginning of a sentence: "Joint 2 lacks Stribeck friction", "The torque channel is 2 ms late".
std::string matter(const diagnose::Finding& finding);
/// "Fs 1.2 N·m, vs 0.05 rad/s": numbers with units, words, events.
std::string parameters_in_words(const diagnose::Finding& finding, const model::Robot& robot);

/// A number without zeros at its end.
std::string short_number(double value, int significant = 4);
/// Minus sign as printed text has it.
std::string minus(std::string text);
bool is_prismatic(const model::Robot& robot, int joint);

}  // namespace heft::report
