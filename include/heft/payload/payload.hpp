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

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/log_set.hpp"
#include "heft/host/verdict.hpp"
#include "heft/model/model_file.hpp"
#include "heft/model/robot.hpp"
#include "heft/payload/payload_run.hpp"
#include "heft/payload/recursive_fit.hpp"
#include "heft/statistics/residual_statistics.hpp"
#include "heft/validate/score.hpp"

namespace heft::payload {

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
  double mass{0.0};        ///< [kg]
  double std{0.0};         ///< [kg]
  double half_width{0.0};  ///< of its 95 % interval [kg]
};

/// The arm without load, and how well it is known.
struct UnloadedArm {
  model::Robot robot;  ///< with the model's parameters
  /// How the model misses the torque without load; absent: not known, it is measured on the log with the load.
  std::optional<statistics::ResidualStatistics> residual;
  std::optional<Eigen::MatrixXd> covariance;  ///< of the model's 14 n parameters
  std::optional<RecursiveFit> fit;            ///< absent: the model came from a file
  std::string model_file_path;                ///< of that file; may be empty
  std::vector<data::LogSource> logs;          ///< fitted to
  std::vector<data::LogSource> zeros;         ///< logs without load that the fit has not seen
  std::vector<ZeroCheck> zero_checks;
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

/// A load.
struct Payload {
  std::string robot;
  std::string log;
  std::string frame;  ///< of first moment, centre of mass and inertia: "the frame of tool0"
  double log_seconds{0.0}, log_rate{0.0};  ///< [s], [Hz]
  PayloadRun run;
  bool has_model_covariance{false};
  std::vector<ZeroCheck> zero_checks;
  std::optional<double> true_mass;  ///< [kg]
  /// Torque error without the load, with it, and with the change of friction in addition. The latter two are absent where
  /// the load is not known: a part of it must not pass for an improvement.
  validate::Score before;
  std::optional<validate::Score> after, after_friction;
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
  bool usable() const { return judgement.usable(); }
};

/// Estimates the load that a log shows, sample by sample as a controller would: from the torque that the unloaded arm
/// does not explain, that is measured torque minus that of model::MotionTorque with all that the model holds (friction,
/// gear couplings, effects, elastic joints, delay). The sign of friction has one width in all of it.
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

}  // namespace heft::payload
