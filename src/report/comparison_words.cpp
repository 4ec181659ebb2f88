#include "comparison_words.hpp"

#include <cmath>

#include <fmt/format.h>

#include "effect_words.hpp"

namespace heft::report {

using compare::Kind;

std::string quantity(const compare::Change& change) {
  switch (change.kind) {
    case Kind::kCoulomb: return "Coulomb friction";
    case Kind::kViscous: return "viscous friction";
    case Kind::kOffset: return "torque offset";
    case Kind::kRotorInertia: return "rotor inertia";
    case Kind::kFriction:
      return change.parameter.substr(0, 8) + change.parameter.substr(change.parameter.find(" at "));
    case Kind::kLink: return change.parameter + (change.meaning.empty() ? "" : " (" + change.meaning + ")");
    case Kind::kCoupling:
    case Kind::kEffect: break;
  }
  return change.parameter;
}

std::string percent(const compare::Change& change) {
  const double share = change.difference.value / std::abs(change.before);
  constexpr double kMost = 10.0;  // beyond, a percentage says nothing
  return std::abs(share) < kMost ? minus(fmt::format("{:+.0f} %", 100.0 * share)) : "";
}

std::string place(const compare::Change& change) {
  const bool link = change.kind == Kind::kLink || change.kind == Kind::kCoupling;
  return fmt::format("{} {}", link ? "link" : "joint", change.joint + 1);
}

}  // namespace heft::report
