/// @file
/// Units in the headers of logs, and what they are in SI.
#pragma once

#include <string>
#include <string_view>

namespace heft::data {

/// What a column measures. Positions are angles or lengths, torques are torques or forces.
enum class Quantity { kTime, kPosition, kVelocity, kAcceleration, kTorque, kCurrent, kTemperature };

struct ColumnUnit {
  Quantity quantity;
  std::string_view symbols;  ///< as headers write it, the first as messages do: "deg|degree|degrees|°"
  std::string_view words;    ///< "degrees"
  double factor;             ///< SI = factor · number + shift
  double shift{0.0};
};

/// The unit of that symbol, without brackets and spaces around it; null when there is none of that quantity.
const ColumnUnit* find_unit(std::string_view symbol, Quantity quantity);
/// Whether anything is measured in it.
bool is_unit(std::string_view symbol);
/// "rad, deg, mrad, ..." for messages.
std::string known_units(Quantity quantity);
/// "degrees" of positions that were multiplied by π/180; "" for SI units.
/// @param symbol  as the header has it; "" where it has none
std::string_view unit_in_words(Quantity quantity, std::string_view symbol, double factor, double shift);

}  // namespace heft::data
