#include "effect_words.hpp"

#include <cmath>
#include <filesystem>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "heft/host/numbers.hpp"
#include "heft/page/table.hpp"

namespace heft::report {
namespace {

using diagnose::Finding;
using page::number;

/// Name of an effect that has no line below: its own kName where it states one, or its id.
template <typename Effect>
constexpr std::string_view name(Effect) {
  if constexpr (requires { Effect::kName; }) {
    return Effect::kName;
  } else {
    return Effect::kId;
  }
}
constexpr std::string_view name(Offset) { return "a torque offset"; }
constexpr std::string_view name(RotorInertia) { return "rotor inertia"; }
constexpr std::string_view name(ViscousNonlinear) { return "viscous friction that is not linear in speed"; }
constexpr std::string_view name(Stribeck) { return "Stribeck friction"; }
constexpr std::string_view name(LoadFriction) { return "friction that grows with load"; }
constexpr std::string_view name(Spring) { return "a spring"; }
constexpr std::string_view name(Hysteresis) { return "presliding (friction hysteresis)"; }
constexpr std::string_view name(FrictionTemperature) { return "friction that follows the temperature"; }
constexpr std::string_view name(FrictionDrift) { return "friction that drifts as it warms up"; }
constexpr std::string_view name(Ripple) { return "torque ripple over position"; }
constexpr std::string_view name(ElasticJoint) { return "elasticity"; }
constexpr std::string_view name(Delay) { return "a delay of the torque channel"; }
constexpr std::string_view name(BaseTilt) { return "a tilt of the base"; }
constexpr std::string_view name(PayloadChange) { return "a change of load"; }
constexpr std::string_view name(WristCoupling) { return "wrist coupling"; }
constexpr std::string_view name(Cable) { return "a cable over two joints"; }
constexpr std::string_view name(Contact) { return "an outer force that comes and goes"; }

std::optional<double> parameter(const Finding& finding, std::string_view of) {
  for (const auto& [key, value] : finding.parameters) {
    if (key == of) return value;
  }
  return std::nullopt;
}

std::string word(const Finding& finding, std::string_view of) {
  for (const auto& [key, value] : finding.words) {
    if (key == of) return value;
  }
  return "";
}

/// Text with the numbers of a coupling's joints in the places of {i} and {j}.
std::string with_joints(std::string_view text, const Finding& finding) {
  if (finding.driven_joint < 0) return std::string(text);
  return fmt::format(fmt::runtime(text), fmt::arg("i", finding.joint + 1),
                     fmt::arg("j", finding.driven_joint + 1));
}

/// Effects that have nothing of their own to say, or not the numbers to say it.
template <typename Effect>
std::string matter_of(Effect, const Finding& finding) {
  if (finding.joint < 0) return "The model lacks " + effect_name(finding.effect);
  return fmt::format("Joint {} lacks {}", finding.joint + 1, effect_name(finding.effect));
}

std::string matter_of(PayloadChange, const Finding& finding) {
  const auto mass = parameter(finding, "mass"), time = parameter(finding, "time");
  if (!mass || !time) return "The model lacks " + effect_name(finding.effect);
  if (!std::isfinite(*mass)) return fmt::format("The load of the arm changes {} s into the training log", short_number(*time, 3));
  return fmt::format("A load of {} kg was {} {} s into the training log", short_number(*mass, 3),
                     word(finding, "event") == "dropped" ? "put down" : "picked up", short_number(*time, 3));
}

std::string matter_of(Delay, const Finding& finding) {
  const auto delay = parameter(finding, "delay");
  return delay ? fmt::format("The torque channel is {} ms late", short_number(1e3 * *delay, 3))
               : "The model lacks " + effect_name(finding.effect);
}

std::string matter_of(BaseTilt, const Finding& finding) {
  const auto tilt = parameter(finding, "tilt_deg");
  return tilt ? fmt::format("The base is {}° off level", short_number(*tilt, 3))
              : "The model lacks " + effect_name(finding.effect);
}

std::string matter_of(Contact, const Finding& finding) {
  const std::size_t count = finding.events.size();
  if (count == 0) return "The model lacks " + effect_name(finding.effect);
  return fmt::format("Something pushed the arm in the training log, {} at {} s",
                     count == 1 ? "once," : fmt::format("{} times, first", count),
                     short_number(finding.events.front().first, 3));
}

std::string matter_of(WristCoupling, const Finding& finding) {
  return with_joints(
      "The motors of joints {i} and {j} both feel the friction of the two joints' sum (wrist coupling)",
      finding);
}

std::string matter_of(Cable, const Finding& finding) {
  return with_joints("A cable or hose over joints {i} and {j} pulls at both", finding);
}

std::string unit_of(EffectKind effect, const std::string& parameter, bool prismatic) {
  const EffectParameter* given = effect.parameter(parameter);
  const std::string_view unit = given == nullptr ? "" : prismatic ? given->prismatic_unit : given->unit;
  return unit == "1" ? "" : std::string(unit);
}

}  // namespace

std::string minus(std::string text) {
  if (!text.empty() && text.front() == '-') text.replace(0, 1, "−");
  return text;
}

std::string short_number(double value, int significant) {
  std::string text = number(value, significant);
  if (text.find('.') == std::string::npos || text.find('e') != std::string::npos) return minus(text);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return minus(text);
}

bool is_prismatic(const model::Robot& robot, int joint) {
  return joint >= 0 && joint < robot.num_joints() &&
         robot.joints[static_cast<std::size_t>(joint)].joint.type == JointType::kPrismatic;
}

std::string effect_name(EffectKind effect) {
  return std::string(effect.visit([](auto type) { return name(type); }));
}

std::string effect_in_place(EffectKind effect, int joint, int driven) {
  if (driven >= 0) {
    const std::string what = effect.is<Cable>() ? "a cable over" : effect_name(effect) + " of";
    return fmt::format("{} joints {} and {}", what, joint + 1, driven + 1);
  }
  return joint < 0 ? effect_name(effect) : fmt::format("{} in joint {}", effect_name(effect), joint + 1);
}

std::string effect_equation(const Finding& finding) {
  return with_joints(finding.effect.equation(), finding);
}

std::string shown_by(const Finding& finding) { return with_joints(finding.effect.shown_by(), finding); }

std::string matter(const Finding& finding) {
  return finding.effect.visit([&](auto type) { return matter_of(type, finding); });
}

std::string parameters_in_words(const Finding& finding, const model::Robot& robot) {
  const bool prismatic = is_prismatic(robot, finding.joint);
  std::vector<std::string> parts;
  // Components of one vector are printed together.
  const auto x = parameter(finding, "com_x"), y = parameter(finding, "com_y"),
             z = parameter(finding, "com_z");
  const bool vector = x && y && z;
  const auto with_half_width = [&](std::size_t k, const std::string& number) {
    const double half = k < finding.half_widths.size() ? finding.half_widths[k] : kNaN;
    return std::isfinite(half) ? number + " ± " + short_number(half, 2) : number;
  };
  const auto component = [&](std::size_t k, double value) {
    return std::isfinite(value) ? with_half_width(k, short_number(value, 3)) : "not determined";
  };
  for (std::size_t k = 0; k < finding.parameters.size(); ++k) {
    const auto& [key, value] = finding.parameters[k];
    if (vector && key == "com_x") {
      parts.push_back(fmt::format("com ({}, {}, {}) m", component(k, *x), component(k + 1, *y), component(k + 2, *z)));
    }
    if (vector && key.starts_with("com_")) continue;
    const std::string unit = unit_of(finding.effect, key, prismatic);
    parts.push_back(std::isfinite(value) ? fmt::format("{} {}{}{}", key, with_half_width(k, short_number(value)),
                                                       unit.empty() || unit == "°" ? "" : " ", unit)
                                         : fmt::format("{} not determined", key));
  }
  for (const auto& [key, value] : finding.words) parts.push_back(fmt::format("{} {}", key, value));
  if (finding.displacement == Displacement::kVelocity) parts.push_back("by the velocity as logged");
  if (finding.displacement == Displacement::kMeasured) parts.push_back("by velocity and position as logged");
  for (std::size_t k = 0; k < finding.events.size(); ++k) {
    std::string event = fmt::format("at {} s for {} s", short_number(finding.events[k].first, 4),
                                    short_number(finding.events[k].second, 2));
    if (k < finding.event_logs.size())
      event += " of " + std::filesystem::path(finding.event_logs[k]).filename().string();
    if (k < finding.forces.size()) {
      const Eigen::Vector3d& f = finding.forces[k];
      event += fmt::format(" ({}, {}, {}) N", short_number(f.x(), 3), short_number(f.y(), 3),
                           short_number(f.z(), 3));
    }
    parts.push_back(event);
  }
  return fmt::format("{}", fmt::join(parts, ", "));
}

}  // namespace heft::report
