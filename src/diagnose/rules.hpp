/// @file
/// What an effect must show to be taken: the thresholds, each with its reason, and the decisions that rest on them.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "engine.hpp"
#include "heft/diagnose/diagnose.hpp"

namespace heft::diagnose {

/// Chance that noise alone looks like this, all candidates together.
inline constexpr double kLevel = 1e-3;
/// Mean gain on left-out blocks against its standard error.
inline constexpr double kSteadyGain = 2.5;
/// The same where others lose next to nothing by it, at most the second number in parts of what is gained: a spring, which swings
/// where the motion is violent and nowhere else, gains in few blocks.
inline constexpr double kSteadyGainOfFew = 2.0, kNextToNothing = 0.05;
/// Least fall of the rms error on left-out blocks in the joint where it shows most.
inline constexpr double kRelevantGain = 0.02;
/// The same when three or more runs all gain from it.
inline constexpr double kRelevantGainInRuns = 0.01;
/// The same of what no chance explains, at the second level: slow training motion shows little of a delay. On the validation logs it
/// must matter as much as others do on the training logs.
inline constexpr double kCertainGain = 0.005, kCertain = 1e-6;
inline constexpr const char* kTooSmall = "too small to matter";
/// Least part of the residual above noise that it must explain there: what explains less is not its cause.
inline constexpr double kNamingShare = 0.2;
/// The same when three or more runs all gain from it.
inline constexpr double kNamingShareInRuns = 0.05;
/// Most that a quarter of the time may ask for more or less of it, in parts of it.
inline constexpr double kHolds = 0.6;
/// Most of the gain of friction with a memory, or over speed, that may lie where its joint turns back and the low-pass
/// leaves open when. More than half: instantaneous friction, misplaced by so much, looks the same.
inline constexpr double kAtTurns = 0.5;
/// Unless it takes more than this part of the squared error of its joint on left-out blocks: a low-pass without phase errs on
/// both sides of the reversal alike, and friction that comes later takes one of them.
inline constexpr double kBothSides = 0.6;
/// The same of a free curve over speed, within twice that time: it has nothing to do with turning back.
inline constexpr double kCurveAtTurns = 1.0 / 3.0;
/// Shortest delay, in samples: drives that average over a sample, or hold one, differ by half of one.
inline constexpr double kShortestDelay = 0.5;
/// Shortest time constant of a joint that warms up [s].
inline constexpr double kQuickestWarming = 3.0;
/// A simpler effect on the same joint with this part of the gain goes before.
inline constexpr double kSimpler = 0.95;
/// What a second spring must gain beside the first one, as a multiple of what a simpler effect in its joint does: the inertia of
/// the motor that comes with it may be all that is missing there.
inline constexpr double kMuchMore = 1.5;
/// A formula goes before a free curve with this part of its gain; what it leaves, the curve may explain next.
inline constexpr double kFormula = 0.7;
/// Most that a joint's torque scale may be off, as a share: gains of drives and gears are known better.
inline constexpr double kLargestScale = 0.4;
/// Most damping of a spring with its link, in parts of critical damping, at the least that the intervals allow: the joints of
/// robots have a few hundredths.
inline constexpr double kMostDamped = 0.2;
/// Least training motion for a free curve: its values want time at every speed [s]. Half a minute, of which the last row is
/// logged a sample or some before its end.
inline constexpr double kCurveSeconds = 29.5;
/// Most that all effects may raise the error of a joint on a validation log.
inline constexpr double kMayRise = 0.02;
/// Most that an effect may raise its own joint's error in band there: what is bought with the slow part of the torque
/// mends the derived motion rather than the model.
inline constexpr double kMayRiseInBand = 0.05;
/// A residual this much above noise (squared errors) has structure.
inline constexpr double kStructured = 0.1;
/// From this part of an effect's gain on, what the same effect gains that is in place already, a second time: there the prior of
/// the fit keeps some of it away, and what follows it this closely (squared correlation of their torques) is no other effect.
inline constexpr double kOnceMore = 0.5, kFollows = 0.8;
/// Rivals within this part of an effect's gain are listed; within the second they explain the same.
inline constexpr double kRival = 0.3, kEquivalent = 0.97;

/// Fall of each joint's rms error, as a share; on left-out blocks, for a contact in its stretches.
Eigen::VectorXd fall(const Trial& trial);
/// The joint where it falls most; of a trial that was not made 0.
Eigen::Index main_joint_of(const Trial& trial);
/// The same part of the squared error.
inline double squared(double fall) { return 1.0 - (1.0 - fall) * (1.0 - fall); }
/// Whether it gains on blocks that it was not fitted to by more than a few of them say by chance.
bool is_steady(const Trial& trial);
/// Whether there are enough runs to agree and all of them gain.
bool runs_agree(const Trial& trial);
/// Least fall() in the joint where it shows most, unless no chance explains it.
double relevant_gain(const Trial& trial);
/// What a candidate has to choose: coefficients, its shape, begin and length of events.
int parameters_of(const Candidate& c);
/// Robust chi-square of the coefficients against what they cost.
/// @param candidates  tried, shapes counted
double bic_of(const Candidate& c, int candidates);
/// Gains of effects in place among candidates, where they stand once more.
std::vector<double> gained_once_more(const std::vector<Candidate>& candidates, const std::vector<Candidate>& taken);
/// Shapes of all candidates.
int tried_of(const std::vector<Candidate>& candidates);
/// The same effect in the same place, and in the same form.
bool same_effect(const Candidate& a, const Candidate& b);
/// Whether a candidate is an effect, or has it as one of its parts.
bool holds(const Candidate& c, const Candidate& effect);
/// Whether a candidate is of the joint of another one; of a cable, of one of its two.
bool of_its_joints(const Candidate& c, const Candidate& other);
/// "spring on joint 2".
std::string name_of(const Candidate& c);
/// Those that gain most on left-out blocks first.
void sort_by_gain(std::vector<Candidate>& candidates);

/// Whether a candidate can be taken.
struct Rules {
  const Engine* engine;                           ///< the model as it is, whose rows and motion count
  const std::vector<NotExplained>* wrong_joints;  ///< that the arm model does not explain
  const std::vector<Candidate>* refused;          ///< for good, by the validation logs
  bool joint_sensor;                              ///< torque was measured behind the gear

  /// Candidates under judgement.
  struct Round {
    int tried;                            ///< candidates, shapes counted
    const Eigen::VectorXd& noise_floor;   ///< n: of the residual that they would explain
    const std::vector<Candidate>& taken;  ///< effects in place
    /// What each of them would gain if it stood there twice; empty: not asked.
    std::vector<double> once_more{};
  };
  /// Why a candidate is not taken; empty: it can be.
  std::string objection(const Candidate& c, const Round& round) const;
  /// A simpler effect of the same joint, of a cable's second one as well, that explains as good as the same goes before: what
  /// the motion cannot distinguish, and kinds that contain another one.
  const Candidate* simplest(const std::vector<Candidate>& candidates, const Candidate* best,
                            const Round& round) const;
  /// Whether an effect in place, where a candidate shows most, would gain as much of the same torque a second time.
  bool repeats(const Candidate& c, const Round& round) const;
  /// What is left in a joint that the model does not explain is no small effect.
  bool is_wrong(int joint) const;
};

}  // namespace heft::diagnose
