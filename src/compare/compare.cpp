#include "heft/compare/compare.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "fitted_model.hpp"
#include "heft/core/effects/effects.hpp"
#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"
#include "heft/statistics/distributions.hpp"

namespace heft::compare {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Geometry apart by more than what files round to.
template <typename A>
bool differ(const A& a, const A& b) {
  constexpr double kRounding = 1e-4;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (std::abs(a[i] - b[i]) > kRounding) return true;
  }
  return false;
}

/// Degrees of freedom of a difference (Welch, Biometrika 34, 1947).
double welch(double std_a, double freedom_a, double std_b, double freedom_b) {
  const double a = std_a * std_a, b = std_b * std_b;
  return (a + b) * (a + b) / (a * a / freedom_a + b * b / freedom_b);
}

class Comparing {
 public:
  Comparing(const FittedModel& before, const FittedModel& after, Comparison& result)
      : before_(before), after_(after), result_(result), states_(reference_states(before.robot())) {}

  void run() {
    for (const Parameter& old_one : before_.parameters()) compare_parameter(old_one);
    load_ = typical_load(before_, states_);
    for (int j = 0; j < before_.robot().num_joints(); ++j) {
      if (by_speed(j)) compare_friction(j);
    }
    result_.parts = torque_parts(before_, after_, states_);
    result_.friction = friction_curves(before_, after_, load_);
    decide();
    note_effects();
  }

 private:
  bool by_speed(int joint) const {
    return before_.has_other_friction(joint) || after_.has_other_friction(joint);
  }

  /// Whether a parameter that both models hold means the same in both and is known in both.
  bool comparable(const Parameter& a, const Parameter& b) {
    if (!(a.std > 0.0) || !(b.std > 0.0) || !std::isfinite(a.freedom) || !std::isfinite(b.freedom))
      return false;
    if (a.kind == Kind::kLink && !(a.determined && b.determined)) return false;
    if ((a.kind == Kind::kCoulomb || a.kind == Kind::kViscous) && by_speed(a.joint)) return false;
    constexpr int kSpring = joint_effect_kind<Spring>(), kRipple = joint_effect_kind<Ripple>();
    if (a.kind == Kind::kOffset && (before_.has_effect(a.joint, {kSpring}) != after_.has_effect(a.joint, {kSpring}) ||
                                    before_.cables_of(a.joint) != after_.cables_of(a.joint)))
      return false;
    if (a.kind != Kind::kEffect) return true;
    const JointEffect<double>& old_effect = before_.robot().effects[static_cast<std::size_t>(a.effect)];
    const JointEffect<double>& new_effect = after_.robot().effects[static_cast<std::size_t>(b.effect)];
    if (old_effect.kind != new_effect.kind || old_effect.joint != new_effect.joint) return false;
    if (old_effect.kind == kRipple)
      return old_effect.parameters[1] == new_effect.parameters[1];  // as many a turn
    return old_effect.kind == kSpring || old_effect.kind == joint_effect_kind<LoadFriction>();
  }

  void compare_parameter(const Parameter& a) {
    const Parameter* b = after_.find(a.name);
    if (b == nullptr || b->meaning != a.meaning) {
      if (a.kind == Kind::kLink) other_meaning_.push_back(a.name);
      return;
    }
    if (!comparable(a, *b)) {
      if (a.kind == Kind::kLink) undetermined_.push_back(a.name);
      return;
    }
    Change change;
    change.kind = a.kind;
    change.parameter = a.name;
    change.meaning = a.meaning == a.name ? "" : a.meaning;
    change.unit = a.unit;
    change.joint = a.joint;
    change.before = a.value;
    change.after = b->value;
    const double std = std::hypot(a.std, b->std);
    change.difference.value = change.after - change.before;
    change.difference.std = std;
    for (const State& state : states_) {
      moves(change, (after_.column(*b, state) * (change.after - change.before)).cwiseAbs());
    }
    freedom_.push_back(welch(a.std, a.freedom, b->std, b->freedom));
    result_.changes.push_back(std::move(change));
  }

  void moves(Change& change, const VectorXd& torque) const {
    Index joint = 0;
    const double largest = torque.maxCoeff(&joint);
    if (largest > change.torque) change.torque = largest, change.moved_joint = static_cast<int>(joint);
  }

  /// Where the terms are not the same: the friction that they add up to.
  void compare_friction(int joint) {
    if (!before_.has_covariance() || !after_.has_covariance()) {
      result_.notes.push_back(fmt::format(
          "the friction of joint {} is described by other terms, and a file without covariance cannot say how well their sum is "
          "known: not compared",
          joint + 1));
      return;
    }
    const model::RobotJoint& of = before_.robot().joints[static_cast<std::size_t>(joint)];
    const Parameter* coulomb = before_.find(fmt::format("Fc{}", joint + 1));
    const Parameter* new_coulomb = after_.find(fmt::format("Fc{}", joint + 1));
    if (coulomb == nullptr || new_coulomb == nullptr) return;
    for (const double share :
         {0.04, 0.3, 1.0}) {  // near the Stribeck peak of most gears, halfway, the fastest
      const double speed = share * fastest(of);
      Change change;
      change.kind = Kind::kFriction;
      change.joint = joint;
      const bool slides = of.joint.type == JointType::kPrismatic;
      change.parameter =
          fmt::format("friction of joint {} at {:.2g} {}", joint + 1, speed, slides ? "m/s" : "rad/s");
      change.unit = slides ? "N" : "N·m";
      VectorXd old_gradient, new_gradient;
      change.before = before_.friction(joint, speed, load_[joint], &old_gradient);
      change.after = after_.friction(joint, speed, load_[joint], &new_gradient);
      const double a = std::sqrt(before_.variance(old_gradient)),
                   b = std::sqrt(after_.variance(new_gradient));
      if (!(a > 0.0) || !(b > 0.0)) continue;
      change.difference.value = change.after - change.before;
      change.difference.std = std::hypot(a, b);
      change.torque = std::abs(change.difference.value);
      change.moved_joint = joint;
      freedom_.push_back(welch(a, coulomb->freedom, b, new_coulomb->freedom));
      result_.changes.push_back(std::move(change));
    }
  }

  /// Intervals that all hold together, what lies outside, and the order in which it is told.
  void decide() {
    const auto count = static_cast<double>(result_.changes.size());
    for (std::size_t k = 0; k < result_.changes.size(); ++k) {
      Change& change = result_.changes[k];
      const double factor = statistics::student_quantile((1.0 - kConfidence) / count, freedom_[k]);
      const double value = change.difference.value, std = change.difference.std;
      change.difference = statistics::Interval::around(value, std, factor);
      change.significant = !change.difference.contains(0.0);
      change.p_value = statistics::student_two_sided(std::abs(value) / std, freedom_[k]);
      const double largest = result_.largest_torque[change.moved_joint];
      change.relevant = !(change.torque < kRelevantShare * largest);
    }
    const auto rank = [&](const Change& c) {
      const double largest = result_.largest_torque[c.moved_joint];
      return std::isfinite(largest) ? c.torque / largest : c.torque;
    };
    std::stable_sort(result_.changes.begin(), result_.changes.end(), [&](const Change& a, const Change& b) {
      if (a.named() != b.named()) return a.named();
      if (a.significant != b.significant) return a.significant;
      return a.significant && rank(a) > rank(b);
    });
  }

  /// Effects that one model alone has, and what is not compared.
  void note_effects() {
    const auto note_missing = [&](const FittedModel& with, const FittedModel& without,
                                  const std::string& path) {
      for (const JointEffect<double>& effect : with.robot().effects) {
        if (without.has_effect(effect.joint, {effect.kind})) continue;
        visit_joint_effect(effect.kind, [&](auto type) {
          result_.notes.push_back(fmt::format("only {} has the effect {} in joint {}", path,
                                              decltype(type)::kId, effect.joint + 1));
        });
      }
      for (const JointCable<double>& cable : with.robot().cables) {
        if (without.cables_of(cable.driven).contains({cable.driving, cable.driven})) continue;
        result_.notes.push_back(fmt::format("only {} has a cable over joints {} and {}", path, cable.driving + 1,
                                            cable.driven + 1));
      }
    };
    note_missing(before_, after_, result_.before_path);
    note_missing(after_, before_, result_.after_path);
    if (!other_meaning_.empty()) {
      result_.notes.push_back(fmt::format(
          "{} base parameters are other sums of link parameters in the two models and are not compared: the models "
          "have other columns (rotor inertia, couplings)",
          other_meaning_.size()));
    }
    if (!undetermined_.empty()) {
      result_.notes.push_back(
          fmt::format("{} base parameters are not determined by the logs of both models and are not compared",
                      undetermined_.size()));
    }
  }

  const FittedModel &before_, &after_;
  Comparison& result_;
  std::vector<State> states_;
  VectorXd load_;
  std::vector<double> freedom_;  ///< of each change
  std::vector<std::string> other_meaning_, undetermined_;
};

void note_what_has_no_interval(const model::ModelFile& before, const model::ModelFile& after,
                               Comparison& result) {
  for (const Elasticity<double>& a : before.elasticities) {
    for (const Elasticity<double>& b : after.elasticities) {
      if (a.joint == b.joint)
        result.notes.push_back(
            fmt::format("stiffness of joint {}: {:.4g} and {:.4g}, without intervals: not compared",
                        a.joint + 1, a.stiffness, b.stiffness));
    }
  }
  for (const JointCable<double>& a : before.cables) {
    for (const JointCable<double>& b : after.cables) {
      if (a.driving == b.driving && a.driven == b.driven)
        result.notes.push_back(
            fmt::format("stiffness of the cable over joints {} and {}: {:.4g} and {:.4g}, without intervals: not compared",
                        a.driving + 1, a.driven + 1, a.stiffness, b.stiffness));
    }
  }
  if (before.torque_delay != after.torque_delay)
    result.notes.push_back(
        fmt::format("delay of the torque channel: {:.3g} ms and {:.3g} ms, without intervals: not compared",
                    1e3 * before.torque_delay, 1e3 * after.torque_delay));
  if (differ(result.before.gravity, result.after.gravity))
    result.notes.emplace_back("gravity differs in the base frame: the base was tilted, or found to be");
}

void judge(const model::ModelFile& before, const model::ModelFile& after, Comparison& result) {
  for (const std::string& log : before.provenance.logs) {
    const std::vector<std::string>& others = after.provenance.logs;
    if (std::find(others.begin(), others.end(), log) == others.end()) continue;
    result.judgement.add(
        host::Verdict::kDoubtful,
        fmt::format("both models were fitted to {}: what they have in common cannot change", log));
  }
  const auto diagnosed = [](const model::ModelFile& file) { return file.fit->method == "diagnose"; };
  if (diagnosed(before) != diagnosed(after)) {
    result.judgement.add(
        host::Verdict::kDoubtful,
        "one model is of heft diagnose and the other of heft identify: other terms and filters may pass for a "
        "change; fit both in the same way");
  }
  if (result.changes.empty())
    result.judgement.add(host::Verdict::kBad, "no parameter is known with an interval in both models");
  for (const auto* file : {&before, &after}) {
    const auto& all = file->fit->base_parameters;
    const auto known = std::count_if(all.begin(), all.end(), [](const auto& p) { return p.determined; });
    if (2 * known < static_cast<long>(all.size()))
      result.judgement.add(host::Verdict::kDoubtful,
                           fmt::format("the logs of {} determine {} of {} base parameters, fewer than half",
                                       name_of(*file), known, all.size()));
  }
}

}  // namespace

void refuse_different_robots(const model::ModelFile& a, const model::ModelFile& b, const model::Robot& before,
                             const model::Robot& after) {
  const std::string where = name_of(b), same = "; compare two models of one robot";
  if (before.num_joints() != after.num_joints()) {
    throw ModelError(fmt::format("{}: found a robot of {} joints; expected {}, as {} has{}", where,
                                 after.num_joints(), before.num_joints(), name_of(a), same));
  }
  for (std::size_t k = 0; k < before.joints.size(); ++k) {
    const model::RobotJoint &old_joint = before.joints[k], &new_joint = after.joints[k];
    if (old_joint.name != new_joint.name) {
      throw ModelError(fmt::format("{}: /joints/{}/name: found \"{}\"; expected \"{}\", as in {}{}", where, k,
                                   new_joint.name, old_joint.name, name_of(a), same));
    }
    const Joint<double>&u = old_joint.joint, &v = new_joint.joint;
    if (u.type != v.type || differ(u.rotation, v.rotation) || differ(u.position, v.position) ||
        differ(u.axis, v.axis)) {
      throw ModelError(fmt::format(
          "{}: /kinematics/joints/{}: found joint {} in another place than in {}; expected the same "
          "geometry, since parameters are about the link frames{}",
          where, k, k + 1, name_of(a), same));
    }
  }
  if (a.fit->torque_at != b.fit->torque_at) {
    throw ModelError(fmt::format(
        "{}: /fit/torque_at: found \"{}\"; expected \"{}\", as in {}: friction and rotor inertia are not "
        "the same on both sides of a gear; fit both models to the same signal",
        where, b.fit->torque_at, a.fit->torque_at, name_of(a)));
  }
}

const char* to_string(Kind kind) {
  switch (kind) {
    case Kind::kCoulomb: return "coulomb";
    case Kind::kViscous: return "viscous";
    case Kind::kOffset: return "offset";
    case Kind::kRotorInertia: return "rotor_inertia";
    case Kind::kLink: return "link";
    case Kind::kCoupling: return "coupling";
    case Kind::kEffect: return "effect";
    case Kind::kFriction: return "friction";
  }
  return "";
}

const char* to_string(Part part) {
  return part == Part::kStatic ? "static" : part == Part::kInertia ? "inertia" : "friction";
}

int Comparison::count_named() const {
  return static_cast<int>(
      std::count_if(changes.begin(), changes.end(), [](const Change& c) { return c.named(); }));
}

Comparison compare(const model::ModelFile& before, const model::ModelFile& after) {
  FittedModel old_model(before), new_model(after);
  refuse_different_robots(before, after, old_model.robot(), new_model.robot());
  Comparison result;
  result.before = old_model.robot();
  result.after = new_model.robot();
  result.before_path = name_of(before);
  result.after_path = name_of(after);
  result.largest_torque =
      old_model.largest_torque().binaryExpr(new_model.largest_torque(), [](double a, double b) {
        return std::isnan(a) ? b : std::isnan(b) ? a : std::max(a, b);
      });
  const VectorXd temperature = bring_to_one_temperature({&old_model, &new_model});
  for (Eigen::Index j = 0; j < temperature.size(); ++j) {
    if (std::isfinite(temperature[j]))
      result.notes.push_back(fmt::format("friction of joint {} is compared at {:.3g} °C", j + 1, temperature[j]));
  }
  Comparing(old_model, new_model, result).run();
  note_what_has_no_interval(before, after, result);
  judge(before, after, result);
  return result;
}

}  // namespace heft::compare
