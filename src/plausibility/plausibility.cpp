#include "heft/plausibility/plausibility.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "comparison.hpp"
#include "heft/host/error.hpp"
#include "heft/model/physical_links.hpp"
#include "heft/statistics/median.hpp"
#include "judge.hpp"

namespace heft::plausibility {
namespace {

/// Falls of minus twice the log-likelihood from which on a contradiction is named. What measured logs of twelve arms
/// that are as they should be reach by chance: 1 for signs, 11 for interchanged joints, 17 for zeros and gravity.
constexpr double kSignGain = 1.8, kInterchangeGain = 12.0, kTurnGain = 8.0;
/// A turned joint or base must also take away this share of the misfit, ...
constexpr double kTurnShare = 0.04;
/// ... which is more where links are physically impossible, as those of a fit may be: what is known of single masses is
/// too little for the model to fit motion that the fit has not seen, and the misfit is large. Sound logs reach 0.07 by chance.
constexpr double kFittedShare = 0.1;
/// ... and any contradiction gain so much more than one that excludes it.
constexpr double kLead = 2.0;
/// From this multiple of its threshold on a gain is clear.
constexpr double kClear = 2.5;
/// Standard deviations by which friction takes power out of a joint whose sign is right beyond doubt.
constexpr double kBrakes = 3.0;
/// A slope counts where its standard deviation is below this, or below this share of a large slope.
constexpr double kKnownSlope = 0.9, kKnownLargeSlope = 0.3;
/// Measured over expected torque: beyond these the unit is wrong, ...
constexpr double kTooSmall = 0.3, kTooLarge = 3.3;
/// ... where the heaviest joint's torque says so too; one joint's torque below this is no torque of that joint.
constexpr double kHeaviestTooSmall = 0.4, kOneTooSmall = 0.3;
/// A heaviest joint, and an arm, with so little torque is beyond any doubt.
constexpr double kFarTooSmall = 0.15, kAllTooSmall = 0.2;
/// Beyond these the masses are another robot's.
constexpr double kLight = 0.55, kHeavy = 1.8;
/// And beyond these something is wrong even where no known robot fits: masses of catalogues are not so far off.
constexpr double kFarTooLight = 0.4, kFarTooHeavy = 2.5;
/// A torque without weight: shares of the expected weight in the joints' torque, and rises of their residuals without, at
/// most. Torque that is sound has shares above that; in another unit it has small ones, but then gravity explains most of it.
/// Of measured logs, as they are or in another unit, the likelihood falls by 2 to 1500 where weight is taken off the arm.
constexpr double kWeightShare = 0.25, kWeightRise = 2.0;
/// Torque on the motor's side is smaller by the gear ratio, amperes by the torque constant.
constexpr double kGearShare = 0.03;
/// A torque of which friction explains less than 6 % of what is left, and of which no more than 6 % is left.
constexpr double kFrictionless = 1.06, kNoiseless = 0.06;
constexpr double kRounding = 5e-3;
constexpr Eigen::Index kFewestSamples = 10;

bool is_known(const std::pair<double, double>& slope) {
  return slope.second < kKnownSlope || slope.second < kKnownLargeSlope * slope.first;
}

/// Median of the slopes that are known, NaN when none is.
double median_slope(const std::vector<std::pair<double, double>>& slopes) {
  std::vector<double> known;
  for (const auto& slope : slopes) {
    if (is_known(slope)) known.push_back(slope.first);
  }
  return statistics::median(known);
}

std::string degrees(double angle) { return fmt::format("{:+.0f}°", angle * 180.0 / std::numbers::pi); }

/// Roll and pitch with which gravity points along `down` of the base (options of --mount).
std::string mount_for(const std::array<double, 3>& down) {
  const double quarter = 0.5 * std::numbers::pi;
  if (down[0] != 0.0) return fmt::format("0,{:.4f},0", down[0] > 0.0 ? quarter : -quarter);
  if (down[1] != 0.0) return fmt::format("{:.4f},0,0", down[1] > 0.0 ? -quarter : quarter);
  return down[2] > 0.0 ? fmt::format("{:.4f},0,0", 2.0 * quarter) : "0,0,0";
}

std::string axis_name(const std::array<double, 3>& down) {
  const char* names = "xyz";
  for (std::size_t i = 0; i < 3; ++i) {
    if (down[i] != 0.0) return fmt::format("{}{}", down[i] > 0.0 ? '+' : '-', names[i]);
  }
  return "nowhere";
}

class Judge {
 public:
  Judge(const model::Robot& robot, const Comparison& comparison, const Options& options)
      : robot_(robot), comparison_(comparison), options_(options) {
    // A torque that never changes has no slope.
    constexpr double kUnknown = std::numeric_limits<double>::infinity();
    for (int j = 0; j < n(); ++j) {
      slopes_.push_back(comparison.dead(j) ? std::pair{0.0, kUnknown} : comparison.slope(j));
    }
  }

  std::vector<JointExpectation> expectations() const {
    std::vector<JointExpectation> list;
    for (int j = 0; j < n(); ++j) {
      const auto& [slope, std] = slopes_[static_cast<std::size_t>(j)];
      list.push_back({slope, std, comparison_.torque_rms(j), comparison_.joint(j).expected_rms(),
                      comparison_.joint(j).moving()});
    }
    return list;
  }

  std::vector<Finding> findings() {
    add_dead();
    const Structure structure = find_structure();
    if (add_weightless(structure)) return std::move(findings_);
    const bool scale = arm_is_scaled();
    if (scale && (all_too_small() || (ratio(heaviest()) < kFarTooSmall && !structure.clear))) {
      add_arm_scale();
    } else if (!add_other_robot(structure)) {
      if (structure.found) {
        add(structure);
      } else if (scale) {
        add_arm_scale();
      } else {
        add_scales();
      }
    }
    if (findings_.empty()) add_beyond_limits();
    if (options_.at_motor) add_model_torque();
    return std::move(findings_);
  }

 private:
  int n() const { return comparison_.num_joints(); }
  double slope(int j) const { return slopes_[static_cast<std::size_t>(j)].first; }
  double ratio(int j) const {
    return comparison_.torque_rms(j) / std::max(comparison_.joint(j).expected_rms(), 1e-12);
  }
  /// The torque of the masses exceeds the errors of sensors.
  bool expected(int j) const { return comparison_.joint(j).expected_rms() > 2.0 * comparison_.floor(j); }

  void add_dead() {
    std::vector<std::string> dead;
    int first = -1;
    for (int j = 0; j < n(); ++j) {
      // At rest a torque may be constant, but what carries weight is not zero.
      const bool weightless = comparison_.torque_rms(j) > 0.0 || !expected(j);
      if (!comparison_.dead(j) || (!comparison_.joint(j).moving() && weightless)) continue;
      dead.push_back(fmt::format("tau{}", j + 1));
      if (first < 0) first = j;
    }
    if (dead.empty()) return;
    findings_.push_back(
        {Contradiction::kNoSignal, true, dead.size() == 1 ? first : -1, -1, 0.0, 0.0,
         fmt::format("{} never change{} although the robot moves or carries its weight; record the "
                     "torque of {}, or leave the columns out",
                     fmt::join(dead, ", "), dead.size() == 1 ? "s" : "",
                     dead.size() == 1 ? "this joint" : "these joints")});
  }

  /// Signs, order of joints, zeros and gravity.
  struct Structure {
    bool found{false}, clear{false};
    double gain{0.0};
    std::vector<Hypothesis> list;          ///< one, or several signs
    std::optional<Hypothesis> equivalent;  ///< another name of the same turn
  };

  Structure find_structure() const {
    // Signs are each joint's own; together they compete with contradictions of more than one joint.
    Structure signs;
    for (const Hypothesis& h : comparison_.signs()) {
      if (h.gain < kSignGain || comparison_.torque_rms(h.joint) < comparison_.floor(h.joint)) continue;
      // A spring may look like inertia of the other sign, but friction that brakes settles it.
      if (comparison_.joint(h.joint).dissipation(h.joint) > kBrakes) continue;
      signs.list.push_back(h);
      signs.gain += h.gain;
      signs.clear = signs.clear || h.gain > kClear * kSignGain;
    }
    signs.found = !signs.list.empty();
    const bool physical = model::has_physical_links(robot_);
    const double turn = std::max(kTurnGain, (physical ? kTurnShare : kFittedShare) * comparison_.misfit());
    std::vector<std::pair<Hypothesis, double>> others;  // with their thresholds
    for (const Hypothesis& h : comparison_.interchanges()) {
      const bool sure = physical && h.columns == Columns::kTorque;
      others.emplace_back(h, sure ? kInterchangeGain : std::max(kInterchangeGain, turn));
    }
    for (const Hypothesis& h : comparison_.zeros()) others.emplace_back(h, turn);
    for (const Hypothesis& h : comparison_.gravities()) {
      others.emplace_back(h, turn);
    }
    std::stable_sort(others.begin(), others.end(),
                     [](const auto& a, const auto& b) { return a.first.gain > b.first.gain; });
    if (others.empty() || (signs.found && signs.gain > others.front().first.gain)) return signs;
    const auto& [best, threshold] = others.front();
    for (const auto& [h, unused] : others) {
      if (is_upside_down(h) && h.gain > 0.8 * best.gain) return {true, true, h.gain, {h}, {}};
    }
    if (best.gain < threshold) return {};
    // A base some degrees off level is no contradiction: it is for a diagnosis to find.
    if (best.kind == Contradiction::kGravity && comparison_.gain_of_tilt() > best.gain - kLead) return {};
    Structure structure{true, best.gain > kClear * threshold, best.gain, {best}, {}};
    double second = signs.gain;
    if (others.size() > 1) {
      const Hypothesis& next = others[1].first;
      // Turning a first joint's zero and turning the base about its axis are one thing.
      if (next.kind != best.kind && best.gain - next.gain < 0.01 * best.gain) {
        structure.equivalent = next;
        if (next.kind == Contradiction::kGravity) std::swap(*structure.equivalent, structure.list.front());
      } else {
        second = std::max(second, next.gain);
      }
    }
    // What gains clearly is reported even where a rival gains nearly as much.
    if (!structure.clear && best.gain - second < kLead) return {};
    return structure;
  }

  /// All known slopes are those of an arm that hangs from the ceiling, while friction has the right sign.
  bool is_upside_down(const Hypothesis& gravity) const {
    double against = 0.0;
    for (std::size_t i = 0; i < 3; ++i) against += gravity.gravity[i] * robot_.gravity[i];
    const double typical = median_slope(slopes_);
    return gravity.kind == Contradiction::kGravity && against < 0.0 && gravity.gain > 0.0 &&
           typical < -kLight && typical > -kHeavy;
  }

  void add(const Structure& structure) {
    for (const Hypothesis& h : structure.list) {
      if (h.kind == Contradiction::kSign) add_sign(h);
      if (h.kind == Contradiction::kInterchanged) add_interchange(h, structure.clear);
      if (h.kind == Contradiction::kZero) add_zero(h, structure.clear);
      if (h.kind == Contradiction::kGravity) add_gravity(h, structure.clear, structure.equivalent);
    }
  }

  void add_sign(const Hypothesis& h) {
    const auto& [slope, std] = slopes_[static_cast<std::size_t>(h.joint)];
    const std::string seen = std < 0.5
                                 ? fmt::format("{:.2f} of the expected gravity and inertia torque", slope)
                                 : "its friction would drive the joint instead of braking it";
    findings_.push_back({Contradiction::kSign, h.gain > kClear * kSignGain, h.joint, -1, slope, h.gain,
                         fmt::format("tau{} fits with the opposite sign ({}); change the sign of the column",
                                     h.joint + 1, seen)});
  }

  void add_interchange(const Hypothesis& h, bool clear) {
    const char* format = h.columns == Columns::kTorque ? "tau{0} and tau{1} look interchanged"
                         : h.columns == Columns::kPosition
                             ? "q{0} and q{1} look interchanged"
                             : "all columns of joints {0} and {1} look interchanged";
    findings_.push_back({Contradiction::kInterchanged, clear, h.joint, h.other, 0.0, h.gain,
                         fmt::format("{}: each fits the other joint; check the order of the columns",
                                     fmt::format(fmt::runtime(format), h.joint + 1, h.other + 1))});
  }

  void add_zero(const Hypothesis& h, bool clear) {
    findings_.push_back(
        {Contradiction::kZero, clear, h.joint, -1, h.value, h.gain,
         fmt::format("the torque fits when {} is added to q{}; joint {} counts from another zero than "
                     "the robot's description",
                     degrees(h.value), h.joint + 1, h.joint + 1)});
  }

  void add_gravity(const Hypothesis& h, bool clear, const std::optional<Hypothesis>& zero) {
    std::string text =
        fmt::format("gravity points along {} of the base, not as the robot is mounted; use --mount {}",
                    axis_name(h.gravity), mount_for(h.gravity));
    if (zero && zero->kind == Contradiction::kZero) {
      text += fmt::format("; or, which is the same to this log, {} is to be added to q{}",
                          degrees(zero->value), zero->joint + 1);
    }
    findings_.push_back({Contradiction::kGravity, clear, -1, -1, 0.0, h.gain, std::move(text)});
  }

  /// The torque fits an arm without weight, better than a turned one, and that of no joint changes with its weight on any scale.
  bool add_weightless(const Structure& structure) {
    const Comparison::Weightless found = comparison_.weightless();
    const double threshold = std::max(kTurnGain, kTurnShare * comparison_.misfit());
    if (found.gain < threshold || (structure.found && structure.gain > found.gain)) return false;
    for (const Comparison::Weightless::Joint& joint : found.joints) {
      if (joint.share > kWeightShare || joint.rise > kWeightRise) return false;
    }
    findings_.push_back(
        {Contradiction::kWeightless, found.gain > kClear * threshold, -1, -1, ratio(heaviest()), found.gain,
         fmt::format(
             "gravity is already compensated in this torque: it fits {} without weight (joint {}: {:.3g} N·m rms, expected "
             "{:.3g}); record the torque with gravity (libfranka: tau_J, not tau_J_d or tau_ext_hat_filtered; a measured "
             "torque, not an external or commanded one), or add the gravity torque of the controller's model "
             "(heft dynamics --what gravity)",
             robot_.name, heaviest() + 1, comparison_.torque_rms(heaviest()),
             comparison_.joint(heaviest()).expected_rms())});
    return true;
  }

  /// Another robot that is known explains the torque, and with masses of the right size.
  bool add_other_robot(const Structure& structure) {
    const double given = median_slope(slopes_);
    if (!(given < kLight || given > kHeavy) || !surely_not_one() || !options_.other_robots) return false;
    const model::Robot* best = nullptr;
    double best_gain = -kTurnShare * comparison_.misfit();
    const std::vector<model::Robot> others = options_.other_robots();
    for (const model::Robot& other : others) {
      // The same arm by its description is no other one.
      if (other.num_joints() != n() || other.name == robot_.name) continue;
      const Comparison::Other found = comparison_.under(other);
      const double theirs = median_slope(found.slopes);
      const bool fits = theirs > kLight && theirs < kHeavy &&
                        std::abs(std::log(theirs)) < 0.5 * std::abs(std::log(std::max(given, 1e-3)));
      if (!fits || found.gain < best_gain) continue;
      best = &other;
      best_gain = found.gain;
    }
    if (best == nullptr || (structure.found && structure.gain > best_gain)) return false;
    findings_.push_back(
        {Contradiction::kRobot, true, -1, -1, given, best_gain,
         fmt::format("the torque is {:.2g} times what {} needs, and fits {}; check --urdf and --model", given,
                     robot_.name, best->name)});
    return true;
  }

  /// Half of the known slopes differ from one beyond doubt. Those of a fitted model, whose single masses mean little,
  /// are known too roughly for that.
  bool surely_not_one() const {
    constexpr double kDeviations = 3.0;
    int known = 0, off = 0;
    for (const auto& slope : slopes_) {
      if (!is_known(slope)) continue;
      ++known;
      off += std::abs(slope.first - 1.0) > kDeviations * slope.second ? 1 : 0;
    }
    return known > 0 && 2 * off >= known;
  }

  int heaviest() const {
    int heaviest = 0;
    for (int j = 0; j < n(); ++j) {
      if (comparison_.joint(j).expected_rms() > comparison_.joint(heaviest).expected_rms()) heaviest = j;
    }
    return heaviest;
  }

  /// Mean of the known slopes by their weights; nothing with less than two.
  std::optional<double> mean_slope() const {
    double sum = 0.0, weights = 0.0;
    int known = 0;
    for (int j = 0; j < n(); ++j) {
      const auto& [slope, std] = slopes_[static_cast<std::size_t>(j)];
      if (comparison_.dead(j) || !is_known({slope, std})) continue;
      sum += slope / (std * std), weights += 1.0 / (std * std);
      ++known;
    }
    return known > 1 ? std::optional<double>(sum / weights) : std::nullopt;
  }

  /// Torques too small or too large by the slopes and by the joint that carries most.
  bool arm_is_scaled() const {
    const std::optional<double> mean = mean_slope();
    const double heavy = ratio(heaviest());
    if (!mean || comparison_.dead(heaviest())) return false;
    return (*mean > kTooLarge && heavy > kTooLarge) || (*mean < kTooSmall && heavy < kHeaviestTooSmall);
  }

  /// Every joint that carries a tenth of the heaviest one's torque measures far too little, friction included.
  bool all_too_small() const {
    const double most = comparison_.joint(heaviest()).expected_rms();
    for (int j = 0; j < n(); ++j) {
      if (comparison_.joint(j).expected_rms() > 0.1 * most && ratio(j) > kAllTooSmall) return false;
    }
    return true;
  }

  void add_arm_scale() {
    const int j = heaviest();
    const bool large = *mean_slope() > kTooLarge;
    const char* looks =
        large ? "another unit, or a gear ratio multiplied twice; give joint torque in N·m"
        : ratio(j) < kGearShare
            ? "torque on the motor's side of the gears, or per cent of the rated torque; multiply "
              "by the gear ratios"
            : "motor currents in amperes; name the columns i1.. and give --torque-constant";
    findings_.push_back({Contradiction::kScale, true, -1, -1, *mean_slope(), 0.0,
                         fmt::format("the torques are {:.2g} of what {} needs to carry and move its masses "
                                     "(joint {}: {:.3g} N·m rms, expected {:.3g}); this looks like {}",
                                     large ? *mean_slope() : ratio(j), robot_.name, j + 1,
                                     comparison_.torque_rms(j), comparison_.joint(j).expected_rms(), looks)});
  }

  void add_scales() {
    bool one = false;
    for (int j = 0; j < n(); ++j) one = add_joint_scale(j) || one;
    // A spring or a cable shifts the slope of one joint; masses of another robot shift all of them.
    int known = 0, light = 0, heavy = 0;
    for (const auto& slope : slopes_) {
      if (!is_known(slope)) continue;
      ++known;
      light += slope.first < kFarTooLight ? 1 : 0;
      heavy += slope.first > kFarTooHeavy ? 1 : 0;
    }
    if (one || known < 2 || (light < known && heavy < known)) return;
    const double all = median_slope(slopes_);
    findings_.push_back(
        {Contradiction::kRobot, false, -1, -1, all, 0.0,
         fmt::format(
             "the torque is {:.2g} times what the masses of {} need; check that robot and unit are right",
             all, robot_.name)});
  }

  bool add_joint_scale(int j) {
    const auto& [slope, std] = slopes_[static_cast<std::size_t>(j)];
    if (comparison_.dead(j) || !expected(j)) return false;
    const bool large =
        is_known({slope, std}) && slope > kTooLarge && slope - 1.0 > 3.0 * std && ratio(j) > kTooLarge;
    const bool small = ratio(j) < kOneTooSmall && slope < kTooSmall;
    if (!large && !small) return false;
    findings_.push_back(
        {Contradiction::kScale, true, j, -1, slope, 0.0,
         fmt::format("tau{} is {:.2g} of what the masses behind joint {} need ({:.3g} N·m rms, expected "
                     "{:.3g}); check its unit, torque constant and gear ratio",
                     j + 1, small ? ratio(j) : slope, j + 1, comparison_.torque_rms(j),
                     comparison_.joint(j).expected_rms())});
    return true;
  }

  /// No drive gives more than its limit on average; the limits of descriptions are too rough for more than a doubt.
  void add_beyond_limits() {
    for (int j = 0; j < n(); ++j) {
      const double limit = robot_.joints[static_cast<std::size_t>(j)].effort_limit;
      if (!(limit > 0.0) || comparison_.torque_rms(j) <= limit) continue;
      findings_.push_back(
          {Contradiction::kScale, false, j, -1, comparison_.torque_rms(j) / limit, 0.0,
           fmt::format("tau{} is {:.3g} N·m on average, beyond the effort limit of {:.3g}; check its unit, "
                       "and the limit in the robot's description",
                       j + 1, comparison_.torque_rms(j), limit)});
    }
  }

  /// Friction explains nothing in any joint, and there is hardly any noise: no drive measures that.
  void add_model_torque() {
    std::vector<double> rise, left;
    for (int j = 0; j < n(); ++j) {
      if (comparison_.dead(j) || !comparison_.joint(j).moving() ||
          comparison_.torque_rms(j) < comparison_.floor(j))
        continue;
      const double with = comparison_.joint(j).free_residual(j),
                   without = comparison_.joint(j).free_residual(j, false);
      left.push_back(without / comparison_.torque_rms(j));
      // What is left of an exact torque is rounding.
      rise.push_back(without > kRounding * comparison_.torque_rms(j) ? without / with : 1.0);
    }
    if (rise.size() < 2 || statistics::median(rise) > kFrictionless || statistics::median(left) > kNoiseless)
      return;
    findings_.push_back(
        {Contradiction::kModelTorque, false, -1, -1, statistics::median(rise), 0.0,
         "the torque shows no friction in any joint: commanded, not measured, as what a controller computes from its own model; give "
         "what the drives measured, or --torque-at joint if sensors behind the gears measured it"});
  }

  const model::Robot& robot_;
  const Comparison& comparison_;
  const Options& options_;
  std::vector<std::pair<double, double>> slopes_;
  std::vector<Finding> findings_;
};

}  // namespace

bool TorqueCheck::refused() const {
  return std::any_of(findings.begin(), findings.end(), [](const Finding& f) { return f.clear; });
}

host::Judgement TorqueCheck::judgement() const {
  host::Judgement judgement;
  for (const Finding& f : findings) {
    judgement.add(f.clear ? host::Verdict::kBad : host::Verdict::kDoubtful,
                  fmt::format("{}: {}", log, f.message));
  }
  return judgement;
}

TorqueCheck check_torque(const model::Robot& robot, const data::MotionStream& log, const Options& options) {
  return check_samples(robot, samples_of(log), log.summary().path, options);
}

TorqueCheck check_samples(const model::Robot& robot, const Samples& samples, const std::string& log,
                          const Options& options) {
  TorqueCheck check;
  check.log = log;
  double mass = 0.0;
  for (const model::RobotJoint& joint : robot.joints) mass += joint.link[kMass];
  if (!(mass > 0.0) || samples.q.rows() < kFewestSamples || samples.tau.cols() != robot.num_joints() ||
      !samples.tau.allFinite()) {
    return check;
  }
  const Comparison comparison(robot, samples);
  Judge judge(robot, comparison, options);
  check.joints = judge.expectations();
  check.findings = judge.findings();
  std::stable_sort(check.findings.begin(), check.findings.end(), [](const Finding& a, const Finding& b) {
    return a.clear != b.clear ? a.clear : a.evidence > b.evidence;
  });
  return check;
}

TorqueCheck check_torque(const model::Robot& robot, const data::Log& log, const Options& options) {
  return check_torque(robot, data::MotionStream(log), options);
}

void refuse_contradictions(const TorqueCheck& check) {
  if (!check.refused()) return;
  std::vector<std::string> lines;
  for (const Finding& f : check.findings) {
    if (f.clear) lines.push_back(f.message);
  }
  throw DataError(
      fmt::format("{}: the torque contradicts the robot: {}; correct the log or the robot (--accept-torque "
                  "continues anyway)",
                  check.log, fmt::join(lines, "; ")));
}

}  // namespace heft::plausibility
