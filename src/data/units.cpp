#include "units.hpp"

#include <array>
#include <cctype>
#include <cmath>
#include <numbers>

namespace heft::data {
namespace {

constexpr double kRadPerDegree = std::numbers::pi / 180.0;
constexpr double kRadPerTurn = 2.0 * std::numbers::pi;

constexpr std::array kUnits{
    ColumnUnit{Quantity::kTime, "s|sec|secs|second|seconds", "seconds", 1.0},
    ColumnUnit{Quantity::kTime, "ms|msec|msecs|millisecond|milliseconds", "milliseconds", 1e-3},
    ColumnUnit{Quantity::kTime, "us|µs|μs|usec|usecs|microsecond|microseconds", "microseconds", 1e-6},
    ColumnUnit{Quantity::kTime, "ns|nsec|nsecs|nanosec|nanosecond|nanoseconds", "nanoseconds", 1e-9},
    ColumnUnit{Quantity::kTime, "min|minutes", "minutes", 60.0},
    ColumnUnit{Quantity::kPosition, "rad|radian|radians", "radians", 1.0},
    ColumnUnit{Quantity::kPosition, "deg|degree|degrees|°", "degrees", kRadPerDegree},
    ColumnUnit{Quantity::kPosition, "mrad", "milliradians", 1e-3},
    ColumnUnit{Quantity::kPosition, "rev|turn|turns", "turns", kRadPerTurn},
    ColumnUnit{Quantity::kPosition, "m|meter|meters|metre|metres", "metres", 1.0},
    ColumnUnit{Quantity::kPosition, "mm|millimeter|millimeters", "millimetres", 1e-3},
    ColumnUnit{Quantity::kPosition, "cm", "centimetres", 1e-2},
    ColumnUnit{Quantity::kVelocity, "rad/s|rad/sec|rads|rad_s|rad*s^-1", "rad/s", 1.0},
    ColumnUnit{Quantity::kVelocity, "deg/s|°/s|deg/sec|dps|deg_s|degrees/s", "degrees a second",
               kRadPerDegree},
    ColumnUnit{Quantity::kVelocity, "mrad/s", "mrad/s", 1e-3},
    ColumnUnit{Quantity::kVelocity, "rpm|1/min|rev/min|r/min", "rpm", kRadPerTurn / 60.0},
    ColumnUnit{Quantity::kVelocity, "rev/s|rps", "turns a second", kRadPerTurn},
    ColumnUnit{Quantity::kVelocity, "m/s", "m/s", 1.0},
    ColumnUnit{Quantity::kVelocity, "mm/s", "mm/s", 1e-3},
    ColumnUnit{Quantity::kAcceleration, "rad/s^2|rad/s2|rad/s²|rad/s/s|rad_s2", "rad/s²", 1.0},
    ColumnUnit{Quantity::kAcceleration, "deg/s^2|deg/s2|deg/s²|°/s²|°/s^2|deg_s2", "degrees/s²",
               kRadPerDegree},
    ColumnUnit{Quantity::kAcceleration, "m/s^2|m/s2|m/s²", "m/s²", 1.0},
    ColumnUnit{Quantity::kAcceleration, "mm/s^2|mm/s2|mm/s²", "mm/s²", 1e-3},
    ColumnUnit{Quantity::kTorque, "Nm|N·m|N*m|N m|N.m|N-m|newton_meter", "N·m", 1.0},
    ColumnUnit{Quantity::kTorque, "mNm|mN·m|mN*m|mN m|mN.m", "mN·m", 1e-3},
    ColumnUnit{Quantity::kTorque, "kNm|kN·m|kN*m|kN m|kN.m", "kN·m", 1e3},
    ColumnUnit{Quantity::kTorque, "Ncm|N·cm|N*cm|N cm", "N·cm", 1e-2},
    ColumnUnit{Quantity::kTorque, "N|newton", "N", 1.0},
    ColumnUnit{Quantity::kTorque, "kN", "kN", 1e3},
    ColumnUnit{Quantity::kCurrent, "A|amp|amps|ampere|amperes", "amperes", 1.0},
    ColumnUnit{Quantity::kCurrent, "mA|milliampere", "milliamperes", 1e-3},
    ColumnUnit{Quantity::kTemperature, "degC|°C|C|celsius|deg C", "degrees Celsius", 1.0},
    ColumnUnit{Quantity::kTemperature, "K|kelvin", "kelvin", 1.0, -273.15},
};

std::string_view first_symbol(const ColumnUnit& unit) {
  return unit.symbols.substr(0, unit.symbols.find('|'));
}

/// Prefixes differ in case (mNm, MNm), so only units without one are found whatever their case.
bool equal(std::string_view a, std::string_view b) {
  if (a == b) return true;
  if (a.size() != b.size() || b.front() == 'm' || b.front() == 'k') return false;
  for (std::size_t k = 0; k < a.size(); ++k) {
    if (std::tolower(static_cast<unsigned char>(a[k])) != std::tolower(static_cast<unsigned char>(b[k])))
      return false;
  }
  return true;
}

bool has_symbol(const ColumnUnit& unit, std::string_view symbol) {
  for (std::string_view rest = unit.symbols; !rest.empty();) {
    const std::size_t bar = rest.find('|');
    if (equal(symbol, rest.substr(0, bar))) return true;
    rest = bar == std::string_view::npos ? std::string_view() : rest.substr(bar + 1);
  }
  return false;
}

}  // namespace

const ColumnUnit* find_unit(std::string_view symbol, Quantity quantity) {
  for (const ColumnUnit& unit : kUnits) {
    if (unit.quantity == quantity && has_symbol(unit, symbol)) return &unit;
  }
  return nullptr;
}

bool is_unit(std::string_view symbol) {
  for (const ColumnUnit& unit : kUnits) {
    if (has_symbol(unit, symbol)) return true;
  }
  return false;
}

std::string known_units(Quantity quantity) {
  std::string text;
  for (const ColumnUnit& unit : kUnits) {
    if (unit.quantity == quantity) text += (text.empty() ? "" : ", ") + std::string(first_symbol(unit));
  }
  return text;
}

std::string_view unit_in_words(Quantity quantity, std::string_view symbol, double factor, double shift) {
  if (factor == 1.0 && shift == 0.0) return "";
  const ColumnUnit* const named = symbol.empty() ? nullptr : find_unit(symbol, quantity);
  if (named != nullptr && named->factor == factor && named->shift == shift) return named->words;
  for (const ColumnUnit& unit : kUnits) {
    if (unit.quantity == quantity && unit.factor == factor && unit.shift == shift) return unit.words;
  }
  return "";
}

}  // namespace heft::data
