/// @file
/// What a model lacks: rigid bodies and friction are fitted, the residual is attributed to effects, these are added to
/// what identify would find and judged on logs that the fit has not seen. How it decides: src/diagnose/README.md.
#pragma once

#include <array>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "heft/core/effects/arm_effects.hpp"
#include "heft/data/log.hpp"
#include "heft/data/log_set.hpp"
#include "heft/host/verdict.hpp"
#include "heft/model/model_file.hpp"
#include "heft/model/robot.hpp"
#include "heft/validate/score.hpp"

namespace heft::diagnose {

/// Another effect that explains nearly as much, or the same.
struct Rival {
  EffectKind effect;
  int joint{-1};          ///< counted from 0; -1: the whole arm
  double delta_bic{0.0};  ///< as in Finding
  /// As fitted in the place of the effect, by the names of its kParameters, SI.
  std::vector<std::pair<std::string, double>> parameters{};
  int driven_joint{-1};  ///< as in Finding
};

/// Where an effect was seen: smallest and largest values of its joint's rows that count in the logs that it was fitted to and
/// judged on.
struct SeenRange {
  double velocity[2]{0.0, 0.0};  ///< [rad/s, m/s]
  double load[2]{0.0, 0.0};      ///< torque of rigid bodies that the gear transmits [N·m, N]
  double position[2]{0.0, 0.0};  ///< [rad, m]
  std::optional<std::array<double, 2>> temperature{};  ///< of the joint [°C]; none: not in all logs
};

/// An effect found.
struct Finding {
  explicit Finding(EffectKind which) : effect(which) {}

  EffectKind effect;
  int joint{-1};  ///< counted from 0; -1: the whole arm
  /// Wrist coupling: the joint whose motor turns with `joint` as well; cable: the other joint that it runs over; -1: other
  /// effects.
  int driven_joint{-1};
  /// By the names of the effect's kParameters, SI: of the search's fit, in which masses are free unless another joint would pay.
  /// The model written has the ones that go with its own masses.
  std::vector<std::pair<std::string, double>> parameters;
  /// Of the 95 % interval of each parameter, by the jackknife over stretches of the training logs, for residuals correlated in
  /// time, and wider by as much as the prior and the choice of a shape move the parameter; NaN where the fit does not tell (a
  /// time, a tilted base, a friction curve, a wrist coupling, the parts of two memories in one joint).
  std::vector<double> half_widths;
  std::vector<std::pair<std::string, std::string>> words;  ///< parameters that are no numbers ("event")
  std::vector<std::pair<double, double>> events;           ///< contact: begin and length [s]
  std::vector<Eigen::Vector3d> forces;                     ///< contact: on the robot, world frame [N]
  std::vector<std::string> event_logs;  ///< contact: training log of each; empty where there is one log
  double p_value{1.0};    ///< robust to correlated residuals, times the number of candidates tried
  double delta_bic{0.0};  ///< with effective samples and the candidates tried; negative: better with it
  /// Fall of the rms error of its main joint on blocks not fitted, as a share; NaN for a contact, which is there once.
  double cross_validated{0.0};
  /// Rms error of its main joint on the validation logs, by the model written without it and with it.
  double validate_before{0.0}, validate_after{0.0};
  int main_joint{0};                                   ///< where it lowers the error most, as a share
  Displacement displacement{Displacement::kPosition};  ///< that its memory goes by, if it has one
  std::optional<SeenRange> seen;                       ///< of an effect of one joint
  /// Torque that it adds over the training motion, in the joint where that is most: rms and largest [N·m, N]; NaN for
  /// what is no torque of a joint (a delay, a load picked up, a contact).
  double torque_rms{std::numeric_limits<double>::quiet_NaN()};
  double torque_peak{std::numeric_limits<double>::quiet_NaN()};
  int torque_joint{-1};  ///< that joint, counted from 0; -1: none
  std::vector<Rival> rivals, equivalent;
  /// Whether it lowers the error on left-out stretches in both halves of the training logs, each taken for itself. False:
  /// another recording of the robot may end without it. None: it comes at one time (contact, change of load, warming).
  std::optional<bool> stable;
  /// Why the model written is without it although it was found: which joint it would predict worse than the identified
  /// model does, and on which log. Empty: it is in the model.
  std::string left_out;

  /// Part of the squared error of its main joint on the validation logs that goes with it; NaN: not judged.
  double share_of_error() const {
    if (!(validate_before > 0.0)) return std::numeric_limits<double>::quiet_NaN();
    return 1.0 - validate_after * validate_after / (validate_before * validate_before);
  }
};

/// An effect that was considered and not taken.
struct Refusal {
  EffectKind effect;
  int joint{-1};
  std::string why;
  double gain{0.0};  ///< share of its joint's squared error that it would have explained
};

/// Where structure comes from that no known effect explains.
enum class Cause {
  kUnknown,       ///< not looked at: too few samples, or the joint counts with no ceiling
  kMotion,        ///< some function of the motion explains it: physics that the list of effects lacks
  kVibration,     ///< a narrow line of the spectrum
  kQuantisation,  ///< the steps of the encoders, through filter and derivatives, are as large
  kNoise          ///< correlated in time, and no function of the motion was found that explains it
};
/// "unknown", "motion", "vibration", "quantisation" or "noise", as in JSON.
const char* to_string(Cause cause);

/// Structure that no known effect explains.
struct Unexplained {
  int joint{-1};
  std::string what;
  std::vector<std::pair<std::string, double>> evidence;
  Cause cause{Cause::kUnknown};

  /// Whether it is noise of the measurement, so that no physics is missing.
  bool is_noise() const { return cause == Cause::kQuantisation || cause == Cause::kNoise; }
};

/// A joint that the arm model does not explain: no effect is looked for there. Its torque has another sign, unit or
/// place than the robot's description says, or the description is of another arm.
struct NotExplained {
  int joint{-1};
  double error{0.0};             ///< rms, training logs [N·m, N]
  double alone{0.0};             ///< what it would be, were its parameters not shared with the other joints
  double share{0.0};             ///< error against the variation of the joint's torque about its mean
  double share_of_largest{0.0};  ///< error against the joint's largest torque
  bool contradicts{false};       ///< fits on its own, and not together with the other joints
};

/// How much of a joint's residual on the validation logs, that of the identified model, any function of the motion could
/// explain, as shares of its mean square. NaN: too few samples.
struct Ceiling {
  double rms{std::numeric_limits<double>::quiet_NaN()};  ///< of that residual [N·m, N]
  double explained{
      std::numeric_limits<double>::quiet_NaN()};  ///< by the effects found; below 0: they raise the error
  /// By any function of position, velocity, acceleration, load and what the joint did a moment before, on stretches
  /// that it was not fitted to: a lower bound, and not below what is explained.
  double explainable{std::numeric_limits<double>::quiet_NaN()};
  double white_noise{std::numeric_limits<double>::quiet_NaN()};  ///< what has no memory

  double noise() const { return 1.0 - explainable; }          ///< what no function of the motion explains
  double missing() const { return explainable - explained; }  ///< explainable, and not explained
  /// Share of the explainable part that is explained; NaN where next to nothing can be explained.
  double reached() const;
  /// Share of the residual that is left, which some function of the motion explains and no effect found does.
  double unknown() const { return missing() / (1.0 - explained); }
};

/// Residuals of one log for plots, on its even grid.
struct Traces {
  std::string log;
  Eigen::VectorXd time;           ///< [s]
  Eigen::MatrixXd q, qd;          ///< m × n
  Eigen::MatrixXd before, after;  ///< measured minus predicted torque, m × n [N·m, N]
  Eigen::VectorXd in_gap;         ///< m, 1 or 0: a gap of time reaches the row, whose residual means nothing; no rows: none does
};

/// What a joint's torque holds beside that of the rigid bodies of the model after, on the validation logs: means over
/// velocity and over the way since it turned back, measured and as the models say.
struct JointCurves {
  struct Curve {
    Eigen::VectorXd
        x;  ///< velocity [rad/s, m/s], or way since the joint turned back, negative before [rad, m]
    Eigen::VectorXd measured;       ///< [N·m, N]; around a turn: along the direction after it
    Eigen::VectorXd low, high;      ///< 95 % interval of the measured mean, by means of seconds
    Eigen::VectorXd before, after;  ///< the models'
  };
  Curve friction, reversal;  ///< empty: too few samples
  /// Mean residual of the model after over position and velocity; NaN where there is next to nothing.
  std::vector<double> position, velocity;  ///< of the grid
  Eigen::MatrixXd residual;                ///< position.size() × velocity.size() [N·m, N]
};

struct DiagnoseOptions {
  /// Of the low-pass on q [Hz]; 0: the one that leaves the smallest residual, or the next one that lets the swing of a spring
  /// pass that was found behind it.
  double cutoff{0.0};
  double band{0.0};    ///< of the figures in band [Hz]; 0: validate::default_band
  int most_effects{20};
  /// Torque was measured behind the gear: no rotor inertia is looked for. So it is when the LogSet says so.
  bool joint_sensor{false};
  /// Pairs of joints that may share a motor, with the ratio of each. Those of the robot's own couplings are tried as well;
  /// where there are none at all, joints 5 and 6.
  std::vector<GearCoupling<double>> couplings{};
  /// Fit the written model once more to all logs, those to judge on as well, when the effects are decided and where
  /// that lowers the errors; it is then a model that these logs cannot judge any more.
  bool refit{true};
  std::function<void(const std::string& what, double done)> progress{};  ///< done within 0..1; may be empty
  std::function<void(const std::string& line)>
      trace{};  ///< gets what the search sees, for the curious; may be empty
};

/// Structure left in a joint's residual matters from this part of the joint's largest torque on: the acceptance limit
/// of the torque prediction (validate::kGoodPercent).
inline constexpr double kRelevantStructure = 0.03;

/// An error of this many times that of the identified model is worse [1]: what lies below is the scatter from log to log.
inline constexpr double kWorse = 1.01;

/// Mass at the last link that the validation logs show on top of the training logs' [kg].
struct OtherLoad {
  double mass{0.0}, half_width{0.0};  ///< of an interval that holds it in 99.9 %
};

/// The diagnosed model with its effects as they are, and its base between what it was and a fit to all logs.
struct Refitted {
  model::Robot robot;
  double part{0.0};  ///< how far it goes towards that fit, 0 to 1
  /// Geometric mean of the errors of such models on stretches of the validation logs that they were not fitted to, against
  /// those of the diagnosed model [1].
  double ratio{1.0};
  /// As Diagnosis::parameters, values of this robot; the intervals are those of the training logs alone, which know less.
  model::FitRecord parameters;
};

/// Result of a diagnosis.
struct Diagnosis {
  model::Robot given;   ///< as handed in
  model::Robot before;  ///< rigid bodies, Coulomb and viscous friction fitted: what the search begins with
  /// What identify makes of the training logs: rotor inertia (where the torque was measured before the gear) and offset
  /// as well.
  model::Robot identified;
  model::Robot after;  ///< what `identified` has, fitted again together with the effects
  validate::Score train_before, train_after, validate_before, validate_after;  ///< pooled over logs
  /// The same of the other two, their motion derived as for a model that does not say how.
  validate::Score train_given, train_identified, validate_given, validate_identified;
  validate::Score
      validate_torque;  ///< the same of the measured torque itself: errors of a model that predicts nothing
  std::vector<validate::Score> validate_each_given, validate_each_before, validate_each_identified,
      validate_each_after;
  std::vector<Finding> findings;  ///< strongest first
  std::vector<Refusal> refusals;
  std::vector<Unexplained> unexplained;
  /// Joints that the arm model, with all effects found, does not explain; the worst first.
  std::vector<NotExplained> not_explained;
  std::vector<std::string> notes;
  std::vector<Traces> train, validate;  ///< one a log
  double cutoff{0.0};                   ///< of the low-pass on q, the lowest of the joints [Hz]
  Eigen::VectorXd joint_cutoffs;        ///< n: of the low-pass on each joint's position in the search [Hz]
  double sign_width{0.0};               ///< of friction's sign [rad/s, m/s]
  int candidates{0};                    ///< tried, shapes counted
  double seconds{0.0};                  ///< of training motion
  bool joint_sensor{false};             ///< as in the options
  /// `after` is judged, and its model file read, with the motion derived as for a model that does not say how; false:
  /// with this cut-off and this sign width.
  bool ordinary_motion{false};
  /// What the model file holds where a fit to all logs lowers the errors on stretches of the validation logs that it has
  /// not seen, unless it was not asked for. All errors here are of `after`.
  std::optional<Refitted> refitted;
  /// A fit to all logs would predict the training logs worse by as much as the validation logs gain, as where the arm carries
  /// something in one of them, or the validation logs show another load at the last link. Without `refit` only that is
  /// looked at.
  bool logs_contradict{false};
  std::optional<OtherLoad> other_load;  ///< that load
  /// Base parameters and effect coefficients of `after` with intervals and covariance; its other fields are not set.
  model::FitRecord parameters;
  std::vector<Ceiling> ceilings;    ///< one a joint
  std::vector<JointCurves> curves;  ///< one a joint

  /// Bad: a joint that the arm model does not explain. Doubtful: structure above kRelevantStructure that no known
  /// effect explains; logs that contradict each other; an error on a validation log that is more than a hundredth above that
  /// of the identified model.
  /// And the prediction with all effects on each validation log: validate::judge_prediction().
  host::Judgement judgement() const;
  /// Whether that is not bad.
  bool usable() const { return judgement().usable(); }
  /// The model that is written: `refitted` where there is one, else `after`.
  const model::Robot& written() const { return refitted ? refitted->robot : after; }
  /// That with its effects and how its logs were read, so that others predict with it as it was judged here.
  model::ModelFile model_file() const;
};

/// "joint 2 is not explained by the arm model at all (error 170 N·m, 98 % of its torque)".
std::string in_words(const NotExplained& joint, const model::Robot& robot);

/// What a robot's model lacks.
///
/// @param robot  kinematics; its inertial parameters serve where the logs say nothing. Effects that it holds are searched
///               for again, and a note says so.
/// @param logs   at least one log to train on and one to judge on, with torque; a LogSet holds no sample in both
/// @throws DataError when there is no log to judge on
/// @throws ModelError for a coupling that is not one of two different joints of the robot
/// @throws NotIdentifiableError when the training logs move too little to determine an eighth of the parameters of rigid
///         bodies and friction, or the validation logs too little to judge on
Diagnosis diagnose(const model::Robot& robot, const data::LogSet& logs, const DiagnoseOptions& options = {});
/// The same of logs in memory, which are checked and kept apart as data::log_set() does.
Diagnosis diagnose(const model::Robot& robot, const std::vector<data::Log>& train,
                   const std::vector<data::Log>& validate, const DiagnoseOptions& options = {});

/// How far any function of the motion would get on a log that the diagnosis has not seen.
struct CeilingOnLog {
  std::vector<Ceiling> joints;  ///< n; explained by the diagnosed model, of the error of the identified one
  validate::Score model;        ///< of the diagnosed model
  /// The same with any function of the motion added, which was fitted to other logs and to other stretches of this one.
  validate::Score with_any_function;
};

/// Judges a diagnosed model, and any function in addition, on one log. No model: what it finds holds along these logs.
/// @param logs  any number of logs to learn from, one to judge on
/// @param band  of the figures in band [Hz]; 0: none
/// @throws DataError when there is not one log to judge on
CeilingOnLog ceiling_on(const Diagnosis& diagnosis, const data::LogSet& logs, double band);

}  // namespace heft::diagnose
