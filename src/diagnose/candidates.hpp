/// @file
/// What could be missing: candidate effects with the columns they add.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "base_model.hpp"
#include "heft/core/effects/arm_effects.hpp"
#include "problem.hpp"

namespace heft::diagnose {

/// The forms in which an effect can model the friction of a joint.
struct FrictionForm {
  bool whole{false};  ///< it takes the place of the Coulomb friction: its column holds that one's as well
  Displacement displacement{Displacement::kPosition};  ///< that its memory goes by
};

/// Runs that have to agree before an effect counts that a single run leaves open.
inline constexpr std::size_t kRunsThatAgree = 3;

/// One effect on one joint (or the whole arm) at its best shape.
struct Candidate {
  explicit Candidate(EffectKind which) : effect(which) {}

  EffectKind effect;
  int joint{-1};      ///< counted from 0; -1: the whole arm
  double shape{0.0};  ///< the value that the torque is not linear in
  int tried{1};       ///< shapes compared, for multiplicity
  Columns columns;
  int replaces{-1};  ///< base column that its column replaces; -1: it comes on top of the base
  Trial trial;
  bool stale{false};         ///< judged before another effect was taken
  double at_turns{0.0};      ///< part of its gain in rows where its joint turns back, see turns_that_matter()
  std::vector<int> entries;  ///< payload change: inertial parameters that the coefficients are
  GearCoupling<double> pair;  ///< wrist coupling, cable: which joints, and the ratio
  /// Another shape: damping; next to a first memory that one's distance; of a delay the time after a change of direction whose
  /// rows do not count [s].
  double second{0.0};
  double inertia{0.0};        ///< elastic joint: mean of M_jj that stiffness and damping go with
  double level{0.0};          ///< friction that it makes up in the last fit [N·m, N]
  Displacement displacement{Displacement::kPosition};  ///< that its memory goes by
  /// A second memory, which takes its part from the first one of its joint; as a candidate its columns are its own and
  /// those of the first one at the distance that goes with it.
  bool beside{false};
  std::vector<Candidate> parts;  ///< springs of several joints that are taken together; empty: it is one effect
  std::string refused;           ///< why it cannot be; empty: it can
  Eigen::Vector2d tilt{0.0, 0.0};  ///< tilted base: horizontal part of gravity in the last fit [m/s²]; 0: not fitted yet
  Eigen::MatrixXd hidden;          ///< tilted base: 10 n × h, see shown_by_tilt(); the coefficients behind the first two are of these
  std::vector<std::pair<double, double>> events;  ///< contact: begin and length [s]
  std::vector<Eigen::Vector3d> forces;            ///< contact [N]
  std::vector<int> event_runs;

  /// It comes with time, or at one: it is not there all along, nor in each part of a log.
  bool in_time() const {
    return effect.is<PayloadChange>() || effect.is<FrictionDrift>() || effect.is<FrictionTemperature>();
  }
  bool has_memory() const { return joint_effect_has_memory(effect.joint_effect()); }
  bool is_elastic() const { return effect.is<ElasticJoint>(); }
  /// A spring in place whose motor's inertia is a number of its own, not part of the link's.
  bool has_motor() const { return is_elastic() && columns.count() > 1; }
  /// Its columns are made of the load torque.
  bool takes_load() const { return effect.is<LoadFriction>() || effect.is<TorqueScale>(); }
  /// Friction that the low-pass alone could make up, as it leaves open when the joint turns back: so many times
  /// MotionTable::turn_seconds from there on it cannot. A curve over speed may bend anywhere, so that it follows the
  /// flanks of what is left there as well. 0: other effects.
  double turns_that_matter() const { return has_memory() ? 1.0 : effect.is<FrictionCurve>() ? 2.0 : 0.0; }
};

/// Judges a candidate with its columns.
/// @param left_at_rest   see Workbench
/// @param tested, least  see Problem::judge()
void judge(const Problem& problem, const MotionTable& table, const Eigen::MatrixXd& left_at_rest, Candidate& candidate,
           int tested = 0, double least = 0.0);

/// The same effect in the same place, whatever its form.
inline bool same_place(const Candidate& a, const Candidate& b) {
  return a.effect == b.effect && a.joint == b.joint && a.pair.driven == b.pair.driven;
}

/// The memory that the friction of a joint has already.
struct FirstMemory {
  const Candidate* effect{nullptr};  ///< none: nullptr
  int column{-1};                    ///< of the problem, the effect's
};

/// Why one is not looked at closely, see Workbench::least_gain.
inline constexpr const char* kOfNoUse = "explains too little";

/// What candidates are made from.
struct Workbench {
  const Problem* problem;
  const BaseModel* base;
  const MotionTable* table;
  const Motion* motion;
  const std::vector<Eigen::MatrixXd>* rows;  ///< of the base model, also those that do not count
  const model::Robot* robot;                 ///< with the base parameters of the present fit
  const Eigen::MatrixXd* load;               ///< m × n: rigid-body torque of the present fit
  /// logs × n: torque that friction holds a resting joint with when the log begins; not finite where it moves
  const Eigen::MatrixXd* held;
  /// m × n: torque that the model leaves where a joint rests between two motions; 0 in other rows.
  const Eigen::MatrixXd* left_at_rest;
  std::vector<FirstMemory> memories;  ///< n: what each joint's friction remembers already
  std::vector<const Candidate*> springs;  ///< n: the one that a joint has already; none: nullptr
  const std::vector<int>* no_springs_in;  ///< see Engine
  /// Pairs of joints that may share a motor, with the ratio.
  std::span<const GearCoupling<double>> pairs;
  /// Gain on the rows of the fit below which a candidate is of no use: one for the place of an effect of a joint that gains far more.
  /// 0: any is
  double least_gain{0.0};
  /// The same of an effect of a joint: what does not take enough of that joint's error is of no use anywhere.
  double least_gain_of(int joint) const;
  /// Whether a spring is looked for in a joint.
  bool may_have_spring(int joint) const;
};

/// Finds the best candidate of one kind and form, judged.
using JointSearch = std::function<Candidate()>;

/// Searches for every kind of joint effect on a joint; an effect that can take the place of the Coulomb friction is tried in
/// each of its forms. They know nothing of each other, so that any number may run at once.
/// @param bench  has to outlive them
/// @param only   place in JointEffectTypes of the only kind to try; -1: all
std::vector<JointSearch> joint_searches(const Workbench& bench, int joint, int only = -1);

/// Physical parameters of fitted coefficients of a joint effect.
EffectParameters<double> effect_parameters(int effect, const Eigen::VectorXd& coefficients, double shape,
                                           const JointActuation<double>& actuation);

/// Column values of one joint effect, m × k; rows that do not count are not masked yet.
/// @param level  the friction that it makes up, which sets where its memory begins [N·m, N]
Eigen::MatrixXd joint_effect_columns(const Workbench& bench, int effect, int joint, double shape,
                                     FrictionForm form, double level);

/// Column of a second memory next to the first one of its joint, m × 1: that of its own less that of the first one, so
/// that its coefficient is what it takes over from it.
Eigen::MatrixXd second_memory_columns(const Workbench& bench, const Candidate& second,
                                      const Candidate& first);

}  // namespace heft::diagnose
