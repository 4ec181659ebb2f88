/// @file
/// Stiffness of joints from a log with encoders on both sides of the gear.
/// Derivation, and how the terms are distinguished: src/stiffness/joint_encoders.md
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/log.hpp"
#include "heft/host/numbers.hpp"
#include "heft/statistics/interval.hpp"

namespace heft::stiffness {

/// What the measured deflection φ = q − qlink of a gear is made of. q is the motor's encoder divided by the gear
/// ratio, qlink the link's.
enum class DeflectionTerm {
  kOffset,            ///< zeros of the encoders, one a log [rad]
  kCompliance,        ///< c τ [rad/(N·m)]
  kVelocity,          ///< δ q̇: the link's channel late by δ, less c times motor-side viscous friction [s]
  kDirection,         ///< h sign(q̇): lost motion w/2, less c times motor-side Coulomb friction [rad]
  kPosition,          ///< s q: error of the gear ratio or of a scale
  kEccentricity,      ///< first harmonic of the joint angle, two coefficients [rad]; contains kPosition
  kSecondHarmonic,    ///< second harmonic of the joint angle, two coefficients [rad]
  kDrift,             ///< straight line in time, one a log [rad/s]
  kStiffening,        ///< c₃ τ³ [rad/(N·m)³]
  kBacklash,          ///< b sign(τ): play of 2b [rad]
  kTorqueHysteresis,  ///< −g times the direction in which the torque last changed: loop 2g wide in φ [rad]
  kLoadFriction,  ///< −c μ |τ| sign(q̇): motor-side friction that grows with the load; c μ [rad/(N·m)]
  kDamping        ///< −c (D/K) dτ/dt; c D/K [rad·s/(N·m)]
};
std::string to_string(DeflectionTerm term);

/// Which torque deflects the spring.
enum class GearTorque {
  kMeasured,     ///< the log's tau less rotor inertia: what the motor feeds into the gear
  kModel,        ///< JointEncoderOptions::model_torque: what the links take out of it
  kInstrumental  ///< the log's tau, with the model's as its instrument: noise of tau then biases nothing
};

struct JointEncoderOptions {
  /// Rotor inertia on the link side of the gear, ρ² I_r [kg·m²], one a joint; empty: none is taken off. Part of tau
  /// that never reaches the gear: left in, it makes a joint look stiffer by (link + rotor)/link inertia.
  std::vector<double> rotor_inertia{};
  /// Whole Coulomb friction of each joint on the link side [N·m], as an identification gives it; empty: unknown. Not
  /// needed for the stiffness; it bounds the lost motion from above (see DirectionReading).
  std::vector<double> coulomb_friction{};
  GearTorque torque{GearTorque::kMeasured};
  /// One matrix a log, samples × joints: torque through the gear by a model of the links [N·m] (no rotor inertia, no
  /// motor-side friction; less the torque of a counterbalance next to the gear). For kModel and kInstrumental.
  std::vector<Eigen::MatrixXd> model_torque{};
  /// Cut-off of the zero-phase low-pass that deflection and terms go through [Hz]; 0: ten times the motion's
  /// bandwidth, at least 3 Hz.
  double cutoff{0.0};
  /// Speed at which the direction of motion counts as decided [rad/s].
  double sign_width{0.005};
  /// Rows are weighted for a residual whose autocorrelation falls off as exp(−|t|/memory) [s]; 0: all alike; not
  /// set: whichever of the two leaves the compliance the smaller scatter, the memory taken from the residual.
  std::optional<double> memory{};
  /// Terms beyond the first four; not set: chosen by cross-validation.
  std::optional<std::vector<DeflectionTerm>> terms{};
};

/// Why a term is in the model or not.
struct TermEvidence {
  DeflectionTerm term{};
  bool used{false};
  std::vector<statistics::Interval>
      coefficients;         ///< in the final model; of a refused term when it is added to that
  double rms_without{0.0};  ///< on held-out blocks [rad]; each block predicted by a fit to the others
  double rms_with{0.0};
  double p_value{1.0};              ///< Wald test, block jackknife, times the number of terms tried
  statistics::Interval compliance;  ///< with the term when it is refused, without it when it is used
  std::string verdict;              ///< "used", or why not
};

/// Loop of φ over the direction of motion: 2 h = w − 2 c f, w ≥ 0 lost motion in the gear, f ≥ 0 Coulomb friction on
/// the motor's side of it. One loop, two unknowns: the log gives their combination, and a lower bound of one of them.
struct DirectionReading {
  statistics::Interval loop;               ///< 2 h [rad]; negative: motor-side friction prevails
  double lost_motion_if_no_friction{0.0};  ///< max(0, 2 h) [rad]
  double friction_if_no_lost_motion{0.0};  ///< max(0, −h/c) [N·m]
  double lost_motion_at_least{0.0};        ///< 95 % [rad]
  /// [rad]: were all of JointEncoderOptions::coulomb_friction on the motor's side; infinite when that is unknown.
  double lost_motion_at_most{std::numeric_limits<double>::infinity()};
  double motor_friction_at_least{0.0};  ///< 95 % [N·m]
  std::string text;                     ///< both readings in words
};

/// Stiffness of one joint.
struct JointStiffness {
  int joint{0};              ///< index from 0
  bool identifiable{false};  ///< the 95 % interval of the compliance lies above 0
  /// Why not, and which load or motion would settle it; empty when identifiable.
  std::string reason;
  statistics::Interval compliance;  ///< c [rad/(N·m)]
  /// 1/c [N·m/rad]: the value NaN when c ≤ 0; the lower end 0 when even that is open, the upper one infinite when the
  /// joint may be rigid.
  statistics::Interval stiffness{kNaN, kNaN, 0.0, kInfinity};

  /// Time by which the link's channel comes late [s], if no viscous friction acts on the motor's side; with f_v there
  /// it is this plus c f_v. Does not touch the stiffness either way.
  statistics::Interval time_shift;
  bool time_shift_known{false};  ///< the joint moves
  DirectionReading direction;    ///< of motion
  /// Loop that follows the torque and therefore sits in the gear: kTorqueHysteresis or kBacklash if used [rad]. The
  /// direction of the torque counts as turned after a change by 4, 10 or 20 % of its range, whichever fits best.
  std::optional<statistics::Interval> gear_hysteresis;
  double gear_hysteresis_torque{0.0};               ///< the same in torque, K times the width [N·m]
  std::vector<statistics::Interval> offset;         ///< one a log [rad]
  std::optional<statistics::Interval> ratio_error;  ///< kPosition if used

  std::vector<TermEvidence> evidence;  ///< every term beyond the first four
  std::vector<DeflectionTerm> terms;   ///< of the model, the first four included where the motion shows them

  double r2{0.0};  ///< share of the variance of φ that the model takes, the delay already made up for
  double torque_share{0.0};    ///< share of it that goes when the torque is left out
  double rms_deflection{0.0};  ///< of φ about its mean [rad]
  double rms_rigid{0.0};       ///< residual on held-out blocks without the torque [rad]
  double rms{0.0};             ///< and with it [rad]
  double memory{0.0};          ///< weighting used [s], see JointEncoderOptions::memory
  /// Compliance by the weighting that was not used; another answer than this one speaks of a missing term.
  std::optional<statistics::Interval> other_weighting;
  double torque_range{0.0};        ///< largest minus smallest [N·m]
  double independent_torque{0.0};  ///< rms of the torque that no other term could explain [N·m]
  /// Share by which white noise of tau lowers c (raises the stiffness), from the power of tau above the cut-off; 0
  /// with the model's torque or instrument.
  double attenuation{0.0};
  int samples{0};
  int blocks{0};
  double block_length{0.0};      ///< [s]
  double correlation_time{0.0};  ///< of the residual [s]
  std::vector<std::string> notes;
};

/// Whether the logs agree, each with the terms of the pooled fit.
struct StiffnessAgreement {
  int joint{0};
  double chi_square{0.0};  ///< of the compliances about their weighted mean, by their own variances
  int degrees_of_freedom{0};
  double p_value{1.0};  ///< by Welch's F, since the variances come from few blocks
  bool agrees{true};    ///< p ≥ 0.05
  std::string text;
};

/// A delay of the link's channels is the same in all joints; friction and compliance are not.
struct CommonTimeShift {
  bool known{false};           ///< at least two joints move
  statistics::Interval value;  ///< weighted mean over the joints [s]
  double p_value{1.0};
  bool agrees{true};
};

struct JointEncoderFit {
  std::vector<int> joints;                            ///< with a column qlink, from 0
  std::vector<std::vector<JointStiffness>> separate;  ///< log × joint: terms of the pooled fit
  std::vector<JointStiffness> pooled;                 ///< joint: one compliance, own offsets and drifts
  std::vector<StiffnessAgreement> agreement;          ///< joint; empty with one log
  std::vector<CommonTimeShift> time_shift;            ///< log
};

/// Joints (from 0) with a column qlink<i> in the log.
std::vector<int> link_encoder_joints(const data::Log& log);

/// Compliance of each joint with a link encoder by least squares of φ on its terms, all behind one zero-phase
/// low-pass; terms beyond the first four by cross-validation over blocks of time; scatter by the delete-a-block
/// jackknife, which holds whatever the correlation inside a block.
///
/// Samples with a number missing are left out; stretches shorter than 2 s between gaps as well.
/// @throws DataError when a log has no qlink column or no torque, is shorter than 5 s of usable samples, or the logs
///         have different joints; when an option has the wrong size.
JointEncoderFit fit_joint_encoders(const std::vector<data::Log>& logs,
                                   const JointEncoderOptions& options = {});

}  // namespace heft::stiffness
