/// @file
/// What torque an ampere gives: torque constants from the drive's own signals, or from a load that is known.
///
/// @code
/// const auto logs = drive::open_logs({"run-1.csv", "run-2.csv"});
/// const drive::TorqueConstants constants = drive::from_targets(logs);
/// std::puts(report::full(constants).c_str());
/// @endcode
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/log_set.hpp"
#include "heft/host/numbers.hpp"
#include "heft/host/verdict.hpp"
#include "heft/model/robot.hpp"
#include "heft/statistics/interval.hpp"

namespace heft::drive {

/// What a constant comes from.
enum class From {
  kStandstill,  ///< target torque over target current while all joints rest: the drive's own constant
  kMotion,      ///< current against target torque while the joint moves, friction estimated with it
  kLoad         ///< current against the torque of a known load
};
/// "standstill", "motion" or "load", as in JSON results.
const char* to_string(From from);

/// What one log says of one joint.
struct LogConstant {
  std::string log;
  statistics::Interval constant;  ///< from this log alone [N·m/A]
  bool agrees{true};              ///< false: it contradicts the other logs and is not used
};

/// The torque constant of one joint.
struct JointConstant {
  statistics::Interval
      constant;  ///< [N·m/A], the scatter from log to log in it; NaN: the logs do not show it
  From from{From::kMotion};
  /// Friction that grows with the load, as a share of the target torque; NaN: not estimated.
  double load_friction{kNaN};
  std::vector<LogConstant> logs;  ///< those that show this joint
  std::string missing;  ///< why the value is not known, and the motion that would show it; empty: it is

  bool known() const { return constant.value == constant.value; }
};

/// Torque constants of an arm.
struct TorqueConstants {
  std::vector<JointConstant> joints;  ///< base first
  std::vector<std::string> logs;      ///< paths
  host::Judgement judgement;
  std::vector<std::string> notes;  ///< what a user should know besides

  /// Whether any joint is known.
  bool usable() const;
  /// One a joint [N·m/A], NaN where not known.
  std::vector<double> values() const;
};

/// Opens logs of which nothing but their columns is known: the number of joints is that of the first.
/// @throws DataError as data::open_logs; for a log without the columns tauref1.. and one of iref1.., i1..
data::LogSet open_logs(const std::vector<std::string>& paths, const data::ReadAs& as = {});

/// Torque constants from the controller's target torque (`tauref1..`) and its target current (`iref1..`), or the
/// measured current (`i1..`) where there is no target current.
///
/// At standstill of all joints the target current holds no friction: K = τ_ref / i_ref there, the median. A joint that no
/// standstill loads, and every joint where only the measured current is known, is taken from motion: in
///   i = τ_ref/K + b |τ_ref| s + o + c s + v q̇ + w √|q̇| s + u q̇³ + a q̈,   s = sign of q̇,
/// of which friction takes all terms but the first (b: friction that grows with the load; a: rotor inertia that the
/// controller's model may lack; without i_ref only), by least squares over samples in which the joint moves, both sides behind one zero-phase low-pass;
/// its interval holds for residuals correlated in time (delete-a-block jackknife). Logs are combined by a random-effects
/// mean (R. DerSimonian, N. Laird, Meta-analysis in clinical trials, Controlled Clinical Trials 7 (1986), 177-188).
///
/// A constant from the measured current is as right as the model behind τ_ref: a load that the controller does not know of
/// shows as too small a constant in all joints that carry it.
///
/// Cost: three passes over each log, memory independent of its length.
/// @throws DataError when no log has target torque with a current
TorqueConstants from_targets(const data::LogSet& logs);

/// A body at the flange of which at least the mass is known.
struct KnownLoad {
  double mass{0.0};  ///< [kg], > 0
  std::optional<std::array<double, 3>>
      com{};  ///< in the frame of the robot's tip [m]; absent: estimated with the constants
};

/// Torque constants from logs in which the arm carries a known load.
///
/// The arm's model without load comes from logs whose torque was made with the constants in `assumed`; the torque of
/// the load is r = (K_assumed/K) τ_load, so that the slope of the residual on τ_load, joint by joint, gives K. Where the
/// centre of mass is not known it is found with the slopes by alternating least squares over all joints.
///
/// @param robot    the arm without load: parameters fitted to logs without load, with the same constants
/// @param logs     with the load; all of judge(), or of train() when there is none to judge on
/// @param assumed  [N·m/A] one for all joints or one per joint: the constants that made the torque; the logs' own tau
///                 counts as made with them
/// @param fitted_to  paths of the logs that the model was fitted to: a load that one of them holds is in the model already
/// @throws DataError when a log has no torque, or when one to judge on is one of `fitted_to` or shares samples with one;
///         InputError for a load without mass
TorqueConstants from_known_load(const model::Robot& robot, const data::LogSet& logs, const KnownLoad& load,
                                const std::vector<double>& assumed,
                                const std::vector<std::string>& fitted_to = {});

/// How far the measured torque of an arm is from the controller's target torque, as a factor: τ = scale · τ_true, τ_true
/// being what the controller's model gives. The rest as from_targets with the measured torque instead of the current.
/// @param logs  of one arm, with tau1.. (or i1.. and torque constants) and tauref1..; others are passed over
/// @return one a joint [1], NaN for a joint that the logs do not show, the scatter from log to log included; empty when no
///         log has target torque
std::vector<statistics::Interval> torque_scales(const std::vector<data::LogSource>& logs);

/// Reads what report::json wrote: one a joint [N·m/A], NaN where not known.
/// @throws InputError, ModelError naming the file and field
std::vector<double> read_torque_constants(const std::string& path);

/// Constants for LogFiles::torque_constant: those that are not known taken from others.
/// @param otherwise  one value for all, or one a joint; empty: none
/// @throws DataError naming the joints that are neither known nor given
std::vector<double> completed(std::vector<double> values, const std::vector<double>& otherwise);

}  // namespace heft::drive
