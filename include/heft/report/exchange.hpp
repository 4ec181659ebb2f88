/// @file
/// What was written for another program, in words.
#pragma once

#include <string>

#include "heft/exchange/load_formats.hpp"
#include "heft/exchange/robot_formats.hpp"
#include "heft/payload/payload.hpp"

namespace heft::report {

/// What a form is, where its numbers count from, and whether inertia is in it: a sentence and the text.
std::string full(const payload::Payload& load, const exchange::LoadFormat& format, const std::string& text);

/// What the form has no place for, a line each with its share of torque; "" for nothing.
/// @param robot  names of joints
std::string full(const exchange::RobotText& written, const exchange::RobotFormat& format,
                 const model::Robot& robot);

}  // namespace heft::report
