/// @file
/// What an arm carries, from its torque: a model of the arm without load, then the load that a log shows.
///
/// @code
/// const auto logs = data::open_logs(robot.joint_specs(), {.train = {"empty.csv"}, .judge = {"carrying.csv"}});
/// const payload::UnloadedArm arm = payload::fit_unloaded(robot, logs);
/// const payload::Payload load = payload::estimate(arm, logs.judge().front());
/// std::puts(report::full(load).c_str());
/// @endcode
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/core/arm_model.hpp"
#include "heft/data/live_log.hpp"
#include "heft/data/log_set.hpp"
#include "heft/host/verdict.hpp"
#include "heft/model/model_file.hpp"
#include "heft/model/robot.hpp"
#include "heft/statistics/interval.hpp"
#include "heft/statistics/residual_statistics.hpp"
#include "heft/validate/score.hpp"

namespace heft::payload {

/// Torque scales of joints that differ from one another by more than this [1] make a load doubtful: torque constants of
/// data sheets are good to about a tenth.
inline constexpr double kScaleOff = 0.1;
/// Factor by which a joint's torque may be off before the log contradicts itself: beyond 2 it is no torque constant.
inline constexpr double kScaleImpossible = 2.0;

struct Options {
  int first_joint{1};  ///< k: torques of joints k..n are used, 1-based
  double cutoff{0.0};  ///< of the causal low-pass [Hz]; 0: chosen from the motion
  data::TorqueAt torque_at{data::TorqueAt::kMotor};
  double true_mass{0.0};  ///< of the load where it is known, to judge the estimate by [kg]; 0: it is not
  /// For weigh(): what is known against the torque of each of LogSet::given() before (heft/plausibility); goes into the
  /// judgement of its load, that of a log without load into all of them. May be empty.
  std::vector<host::Judgement> torque{};
  /// Called with what is being done and its share done, 0..1; may be empty.
  std::function<void(const std::string& what, double done)> progress{};
};

/// Load found on a log without load: what the model gets wrong from one recording to the next.
struct ZeroCheck {
  std::string log;
  statistics::Interval mass;  ///< [kg]
};

/// A fitted model and how far to trust it.
struct RecursiveFit {
  /// All 14 parameters a joint, their standard deviations (NaN: this parameter alone is not determined) and
  /// covariance (block jackknife, see BlockJackknife: holds for residuals correlated in time).
  model::ModelFile model;
  statistics::ResidualStatistics residual;
  Eigen::VectorXi rows;    ///< rows used per joint
  Eigen::VectorXd moving;  ///< time each joint was moving, all logs together [s]
  int samples{0};          ///< log rows, all logs together
  int left_out{0};         ///< samples whose torque or velocity no such arm can have
  int determined{0};       ///< combinations of parameters that the logs determine
  int determinable{0};     ///< combinations that any motion of this arm could determine
  /// What is missing for a usable model and the motion that would give it; empty: nothing.
  std::vector<std::string> missing;
};

/// The arm without load, and how well it is known.
struct UnloadedArm {
  model::Robot robot;  ///< with the model's parameters
  /// How the model misses the torque without load; absent: not known, it is measured on the log with the load.
  std::optional<statistics::ResidualStatistics> residual;
  std::optional<Eigen::MatrixXd> covariance;  ///< of the model's 14 n parameters
  std::optional<model::FitRecord> record;     ///< of the model: which side of the gears it was fitted to
  std::optional<RecursiveFit> fit;            ///< absent: the model came from a file
  std::string model_file_path;                ///< of that file; may be empty
  std::vector<data::LogSource> logs;          ///< fitted to
  std::vector<data::LogSource> zeros;         ///< logs without load that the fit has not seen
  std::vector<ZeroCheck> zero_checks;
  /// Measured torque in parts of the torque that the controller's own model gives, one a joint: the error of the torque
  /// constants, from the logs without load that hold target torque (tauref1..); empty: none does. See
  /// drive::torque_scales().
  std::vector<statistics::Interval> drive_scale;
  std::vector<std::string> notes;  ///< what a user should know besides

  /// Scatter of the zero checks beyond their own uncertainty [kg].
  double zero_mass_std() const;
  /// Whether the logs determine enough of the arm for a load to be found.
  bool usable() const { return !fit || fit->missing.empty(); }
  /// The fitted model with its residual, for arm_from_file().
  /// @pre fit
  model::ModelFile model_file() const;
};

/// Fits the arm to the training logs of the set, without load. The logs at `zeros` of those to judge on carry no load
/// either and check the model; with none and several training logs, each checks the model of the others.
/// @param zeros  how many of logs.judge(), from the first
/// @throws NotIdentifiableError when the logs do not determine a model, with the motion that would; DataError
UnloadedArm fit_unloaded(const model::Robot& robot, const data::LogSet& logs, std::size_t zeros = 0,
                         const Options& options = {});

/// The same from a model file. Its field "residual" may be absent.
/// @param robot  with the file's parameters
/// @throws ModelError when "residual" is not what UnloadedArm::model_file() writes
UnloadedArm arm_from_file(const model::Robot& robot, const model::ModelFile& file, const data::LogSet& logs,
                          std::size_t zeros = 0, const Options& options = {});

/// A number of the load with its uncertainty.
struct Estimated : statistics::Interval {
  bool identifiable{false};  ///< the data determine it; else the value is the prior's, or NaN
};

/// The load changed.
struct LoadChange {
  double time{0.0};         ///< when the torque began to differ [s]
  double mass_before{0.0};  ///< [kg]; NaN: not determined
  double mass{0.0};         ///< from then on [kg]; NaN: not determined
  double std{0.0};          ///< of `mass` [kg]; NaN: not determined
};

/// What the estimator made of a log.
struct PayloadRun {
  int first_joint{1};
  int samples{0};
  double cutoff{0.0};                   ///< [Hz]
  double block{0.0};                    ///< length of the blocks behind the interval [s]
  int blocks{0};                        ///< how many there were
  Estimated mass;                       ///< [kg]
  std::vector<Estimated> first_moment;  ///< 3, flange frame [kg·m]: known also where the mass is not
  std::vector<Estimated> com;           ///< 3, flange frame [m]; needs a mass well above its uncertainty
  std::vector<Estimated>
      inertia;  ///< 6: Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the flange frame's origin [kg·m²]
  std::vector<Estimated> coulomb_change;  ///< n: against the model [N·m, N]; joints below k: not identifiable
  std::vector<Estimated> viscous_change;  ///< n [N·m·s/rad, N·s/m]
  double mass_std_residual{0.0};          ///< share of the mass' standard deviation: this log's residual [kg]
  double mass_std_model{0.0};             ///< the model's parameters [kg]
  double mass_std_zero{0.0};              ///< the zero check [kg]
  double mass_std_scale{0.0};             ///< the torque scale of the joints, where that was estimated [kg]
  /// n: by what part of itself the mass changes when the torque scale of a joint changes by 1; size 0 while the mass is not
  /// clear. They add up to 1: what is wrong with all joints is wrong with the mass.
  Eigen::VectorXd gain_share;
  /// The ten parameters of the load about the flange frame, m, m c, inertia, with their covariance, 10 × 10; entries
  /// that are not identifiable are the prior's.
  Eigen::VectorXd parameters;
  Eigen::MatrixXd covariance;
  double interval_factor{0.0};  ///< half-width of a 95 % interval in standard deviations
  /// n: torque that each joint feels of the load, in parts of what the load found would make it feel. All joints agree
  /// where it is 1; a torque constant that is 10 % too large shows as 1.1 against the others.
  std::vector<Estimated> torque_scale;
  /// The ten parameters about the last link frame (the recursion's own), to be added to the last link.
  InertialParameters<double> on_last_link{};
  bool mass_visible{false};            ///< some motion of this arm shows the mass in rows k..n
  std::optional<double> converged_at;  ///< log time from which the running mass stays at its final value [s]
  std::vector<LoadChange> changes;
  double load_since{0.0};  ///< log time at which the load stated above began [s]
  Eigen::VectorXi rows_used, rows_rejected, rows_at_rest;  ///< per joint
  int left_out{0};  ///< samples whose torque or velocity no such arm can have
  Eigen::VectorXd time, mass_history,
      mass_std_history;  ///< running values [s, kg, kg]; NaN: not identifiable yet
  /// What the data do not determine and the motion that would; empty: nothing is missing.
  std::string missing;
};

/// A load at one moment, about the flange frame.
struct LoadValue {
  statistics::Interval mass;                ///< [kg]
  std::array<statistics::Interval, 3> com;  ///< [m]; NaN while the mass does not exceed its interval
};

/// What a row brought about for a controller, or whoever follows a stream.
struct LiveEvent {
  enum class Kind {
    kKnown,      ///< the first load is known; its interval may hold zero: there is none
    kChange,     ///< the torques show another load than `before`; which one is not known yet
    kAttached,   ///< `load` since `since`; there was none
    kDetached,   ///< none since `since`; there was `before`
    kReplaced,   ///< `load` in place of `before` since `since`
    kUnchanged,  ///< after a kChange: the load is what it was; a contact, or another disturbance
    kCorrected,  ///< `load` lies outside the interval of `before`, which was stated last
    kImpossible,  ///< a mass below zero by more than its interval: the model is not that of this arm without load
    kRefused  ///< a torque, a velocity or a step that no such arm can have: the row is left out, and those like it behind it
  };
  Kind kind{Kind::kKnown};
  double time{0.0};   ///< of the row [s]
  double since{0.0};  ///< when the torques began to show `load`, as far as that was seen [s]
  LoadValue load, before;
  int joint{-1};  ///< of kRefused, from 0
};

/// A load.
struct Payload {
  std::string robot;
  std::string log;
  std::string frame;  ///< of first moment, centre of mass and inertia: "the frame of tool0"
  double log_seconds{0.0}, log_rate{0.0};  ///< [s], [Hz]
  PayloadRun run;
  bool has_model_covariance{false};
  std::vector<ZeroCheck> zero_checks;
  std::vector<statistics::Interval> drive_scale;  ///< of the arm; the load is in true units, these taken off
  std::optional<double> true_mass;                ///< [kg]
  /// Torque error without the load, with it, and with the change of friction in addition. The latter two are absent where
  /// the load is not known: a part of it must not pass for an improvement.
  validate::Score before;
  std::optional<validate::Score> after, after_friction;
  /// What LiveLoad says of the rows of this log one after the other, as a controller would; empty where no motion shows the mass.
  std::vector<LiveEvent> live;
  Eigen::VectorXd time;  ///< of the two errors [s]
  Eigen::MatrixXd error_before,
      error_after;  ///< measured minus predicted, samples × n [N·m, N]; the latter may be empty
  host::Judgement judgement;
  std::vector<std::string> log_notes;  ///< what was done to the log
  std::string contradiction;       ///< why no load can be what was found; empty: nothing speaks against it
  std::vector<std::string> notes;  ///< what a user should know besides

  /// The mass is known, or all first moments are where the rows used cannot show the mass.
  bool answered() const;
  /// Why the load is not known or cannot be, with the log; empty: it is known.
  std::string unanswered() const;
  /// Whether the log determines all of the inertia, and a body can have it: usual for heavy loads that were turned fast only.
  bool has_inertia() const;
  /// What a controller may be given: ten parameters about the flange frame's origin, in its axes. A point of the mass found
  /// where !has_inertia(). @throws NotIdentifiableError where the mass is not clear of zero, or the centre not known
  InertialParameters<double> body() const;
  /// The first load that a controller states, see `live`; null: it states none.
  const LiveEvent* first_stated() const;
  bool usable() const { return judgement.usable(); }
};

/// Estimates the load that a log shows, sample by sample as a controller would: from the torque that the unloaded arm
/// does not explain, that is measured torque minus that of model::MotionTorque with all that the model holds (friction,
/// gear couplings, effects, elastic joints, delay). The torque errors before and after are of validate::Predictor and validate::score(), as those of every other answer.
/// @throws DataError when the log holds samples of a log without load, or lacks torque
Payload estimate(const UnloadedArm& arm, const data::LogSource& log, const Options& options = {});

/// The loads of several logs, and the arm that they were weighed with.
struct Weighing {
  UnloadedArm arm;
  std::vector<Payload> loads;  ///< one a log

  /// What was done to the logs, and what a user should know of the arm.
  std::vector<std::string> notes() const;
  /// Why the first load that is not known is not, or cannot be; empty: all are known.
  std::string unanswered() const;
  /// Whether a load cannot be what was found: the model then contradicts a log of its arm and must not be used.
  bool contradicted() const;
  /// Whether every load is usable.
  bool usable() const;
  /// UnloadedArm::model_file().
  model::ModelFile model_file() const { return arm.model_file(); }
};

/// Weighs what each log to judge on carries, but for the first `zeros`, which carry nothing and check the model: with
/// the arm that fit_unloaded() makes of the training logs.
/// @throws InputError when the robot does not have Options::first_joint; what fit_unloaded() and estimate() throw
Weighing weigh(const model::Robot& robot, const data::LogSet& logs, std::size_t zeros = 0,
               const Options& options = {});
/// The same with the arm of a model file, see arm_from_file().
Weighing weigh(const model::Robot& robot, const model::ModelFile& file, const data::LogSet& logs,
               std::size_t zeros = 0, const Options& options = {});

/// What a live stream held.
struct LiveSummary {
  double seconds{0.0};  ///< [s]
  long samples{0};      ///< taken
  long refused{0};      ///< left out here or by whoever read the rows
  /// Of the last load that was stated, with all rows up to the end or to the change that ended it; absent: none was.
  std::optional<LoadValue> load;
  double load_since{0.0};  ///< [s]
  bool changing{false};    ///< another load came last, and was not known by the end
  std::vector<LoadChange> changes;
  /// Why no load is known, or that none can be what was found, as a sentence without a full stop; empty: one is known.
  std::string unanswered;
};

/// Follows the load while rows arrive, with heft::LoadObserver as a controller runs it; the friction of every joint may have
/// changed. A load is stated once the half-width of its 95 % interval is below 15 % of the mass, or 1 % of the arm's mass; the
/// interval holds the model's error, the zero check and the torque scale, as that of estimate() does. What a row brings about is
/// known before the next one. The first data::LiveClock::kFirstRows give the sample period and are gone through together, while nothing could be
/// known yet.
///
/// @code
/// payload::LiveLoad live(arm, options);   // an UnloadedArm
/// data::LiveLog rows("-", {.num_joints = robot.num_joints(), .torque = true}, tell);
/// for (data::LiveRow row; rows.next(row);)
///   if (const auto event = live.push(row)) std::puts(report::brief(*event).c_str());
/// @endcode
class LiveLoad {
 public:
  /// Half-width of a mass that is stated, in parts of the mass [1]: enough to tell loads apart, and reached in seconds.
  static constexpr double kClear = 0.15;
  /// The same in parts of the arm's mass [1]: below this a load hardly matters to the arm.
  static constexpr double kLight = 0.01;

  /// @param options  `true_mass`, `torque` and `progress` are not used
  /// @throws InputError when the robot does not have Options::first_joint; NotIdentifiableError when no motion shows the mass in
  ///         the rows from there on; ModelError
  LiveLoad(const UnloadedArm& arm, const Options& options = {});
  ~LiveLoad();

  /// Takes a row. One whose time is not beyond that of the row before starts anew: the clock was set. What is carried stays stated until
  /// the rows behind it show another load.
  /// @return what it brings about; mostly nothing
  std::optional<LiveEvent> push(const data::LiveRow& row);
  /// The stream ends. @param refused  rows that did not get here
  LiveSummary end(long refused = 0);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace heft::payload
