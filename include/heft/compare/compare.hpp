/// @file
/// What changed? Two models of one robot, fitted at two dates: which parameters differ by more than both fits leave open,
/// and what the difference is in torque.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/host/verdict.hpp"
#include "heft/model/model_file.hpp"
#include "heft/model/robot.hpp"
#include "heft/statistics/interval.hpp"

namespace heft::compare {

/// Of all intervals together: where nothing changed, no change is claimed in so many of the comparisons.
inline constexpr double kConfidence = 0.95;

/// A change that moves the torque by less than this part of the largest torque that the joint has shown is left out of
/// the sentence: friction of one arm differs by more from one morning to the next.
inline constexpr double kRelevantShare = 0.01;

enum class Kind {
  kCoulomb,
  kViscous,
  kOffset,
  kRotorInertia,
  kLink,      ///< a base parameter of the rigid bodies
  kCoupling,  ///< inertia or friction of a motor that turns with two joints
  kEffect,    ///< a coefficient of an effect that both models have
  kFriction   ///< friction at one speed, where the models describe friction by other terms
};
const char* to_string(Kind kind);  ///< "coulomb", "viscous", ..., as in JSON results

/// One quantity that both models know with an interval.
struct Change {
  Kind kind{Kind::kLink};
  std::string parameter;  ///< "Fc3", "mcx2*", "stribeck 1 of joint 2", "friction of joint 2 at 0.5 rad/s"
  std::string meaning;    ///< "mcx2 + 0.425 m3"; empty: the parameter itself
  std::string unit;       ///< "N·m"
  int joint{0};           ///< joint or link, counted from 0
  double before{0.0}, after{0.0};
  /// Of after − before; all these intervals together hold the truth in 95 % of comparisons (Bonferroni).
  statistics::Interval difference;
  double p_value{1.0};      ///< of this comparison alone
  bool significant{false};  ///< 0 is outside of the interval
  /// Largest torque that the change makes at a joint over the reference states [N·m, N], and at which one.
  double torque{0.0};
  int moved_joint{0};
  bool relevant{
      false};  ///< that is at least kRelevantShare of the joint's largest torque; true where that is not known

  bool named() const { return significant && relevant; }
};

/// Part of a joint's torque.
enum class Part {
  kStatic,   ///< gravity and torque offset: over the range of a joint one can stand for the other
  kInertia,  ///< of links and rotors, with what depends on products of velocities
  kFriction  ///< of joints and couplings, with the joint effects
};
const char* to_string(Part part);  ///< "static", "inertia", "friction"

/// rms over the reference states [N·m, N].
struct TorquePart {
  int joint{0};
  Part part{Part::kStatic};
  double before{0.0}, after{0.0};
  double change{0.0};  ///< of after − before, state by state
  double open{0.0};    ///< what `change` would be from the uncertainty of both fits alone; NaN: not known
};

/// Friction of a joint that moves forward, offset left out.
struct FrictionCurve {
  int joint{0};
  Eigen::VectorXd speed;                    ///< [rad/s, m/s]
  Eigen::VectorXd before, after;            ///< [N·m, N]
  Eigen::VectorXd before_half, after_half;  ///< half-widths of the 95 % intervals; NaN: not known
};

/// The answer.
struct Comparison {
  model::Robot before, after;
  std::string before_path, after_path;
  std::vector<Change> changes;  ///< all that was compared; named ones first, by torque
  std::vector<TorquePart> parts;
  std::vector<FrictionCurve> friction;  ///< one a joint
  std::vector<std::string> notes;       ///< what could not be compared, what to keep in mind
  host::Judgement judgement;

  int count_named() const;
  /// Largest torque of each joint in the logs of both fits, n; NaN where neither file knows it.
  Eigen::VectorXd largest_torque;
  bool usable() const { return judgement.usable(); }
};

/// Compares two models as `identify` or `diagnose` write them.
///
/// Base parameters are compared by name where they are the same combination of link parameters in both models; masses that
/// the motion shows only in a sum with others are not compared. Friction is compared term by term where both models have
/// the same terms at a joint, else at three speeds. The reference states are 200 random ones: positions within the limits
/// (±π at most), speeds up to half of the limit, accelerations that reach these in half a second.
///
/// @throws ModelError when the models are of different robots (joints, links, their geometry, where torque was measured),
///         when a file has no kinematics or no intervals
Comparison compare(const model::ModelFile& before, const model::ModelFile& after);

}  // namespace heft::compare
