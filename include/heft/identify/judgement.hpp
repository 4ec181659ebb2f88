/// @file
/// How far results of the identification can be trusted, by limits stated here: the one rule behind the verdict of
/// every command, the colour of its page and host::Judgement::usable().
///
/// | asked of | good | doubtful | bad |
/// | --- | --- | --- | --- |
/// | each joint on each held-out log | explains kGoodShare of the torque, or misses at most kGoodPercent | else | below kBadShare and above kBadPercent |
/// | the log that judges | not seen by the fit | the fit's own | - |
/// | base parameters | kGoodDetermined of them determined | fewer | below kBadDetermined |
/// | the links | physically possible, mass matrix positive definite | not | - |
/// | an estimate with an interval | covers the truth, where that is known | does not | off by more than kFarOff intervals |
/// | a load | possible, the joints agree | torque scales differ by kScaleOff | see contradiction() |
/// | condition of a motion | up to kGoodCondition | above | above kBadCondition |
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/host/verdict.hpp"
#include "heft/identify/fit.hpp"
#include "heft/identify/joint_encoders.hpp"
#include "heft/identify/payload_run.hpp"
#include "heft/identify/physical.hpp"
#include "heft/identify/stiffness.hpp"
#include "heft/identify/stiffness_effects.hpp"
#include "heft/identify/validation.hpp"

namespace heft::identify {

// Limits -------------------------------------------------------------------------------------------------------

/// Share of a joint's torque variance explained in band from which on a joint is well predicted: what is left is
/// below a third of the torque's own variation (sqrt(0.1) = 0.32), as measured arms reach with friction of two terms.
inline constexpr double kGoodShare = 0.9;
/// Below this most of what the joint's torque does is something else than the model.
inline constexpr double kBadShare = 0.5;
/// Error in band against the joint's largest torque [%] that is good whatever share it leaves: the acceptance limit of
/// the torque prediction. A joint whose torque hardly changes has no variance to explain.
inline constexpr double kGoodPercent = 3.0;
/// Below this [%] a small share is no reason against the model: the joint's torque hardly changes in this motion.
inline constexpr double kBadPercent = 10.0;
/// Share of the base parameters that the logs determine: with fewer than half, the URDF says more about the model
/// than the logs do.
inline constexpr double kGoodDetermined = 0.5;
/// With less than an eighth, the fit is one of friction; `diagnose` refuses to look for effects there as well.
inline constexpr double kBadDetermined = 1.0 / 8.0;
/// Rise of the fit's error when links are held to what is possible that is nothing [1]: below the scatter of an error
/// from run to run.
inline constexpr double kPhysicsCosts = 0.01;
/// An estimate that is off the truth by more than so many half-widths is wrong, not unlucky.
inline constexpr double kFarOff = 3.0;
/// Torque scales of joints that differ from one another by more than this [1] matter for a load: torque constants of
/// data sheets are good to about a tenth.
inline constexpr double kScaleOff = 0.1;
/// Factor by which a joint's torque may be off before the log contradicts itself: beyond 2 it is no torque constant.
inline constexpr double kScaleImpossible = 2.0;
/// Rise of a tracking error that is noise.
inline constexpr double kMayRise = 0.05;
/// Ratio of the ends of a stiffness' interval from which on it is an order of magnitude rather than a figure.
inline constexpr double kWideStiffness = 4.0;
/// Condition number of a regressor with columns of norm 1: up to 30 its columns are hardly dependent (Belsley, Kuh,
/// Welsch, Regression Diagnostics, 1980).
inline constexpr double kGoodCondition = 30.0;
/// From here on a fit needs a ridge towards the URDF (FitOptions::ridge_from_condition).
inline constexpr double kBadCondition = 1000.0;

// Prediction ---------------------------------------------------------------------------------------------------

/// Share of each joint's torque variance that a prediction explains, n: 1 what the mean torque as a predictor leaves
/// nothing of, 0 no better than the mean, negative worse. In band where the score has one: what lies above the band is
/// noise, and counts neither as torque nor as error. NaN where the torque never changes.
Eigen::VectorXd explained_share(const Score& score);

/// Judges a prediction on logs that the fit has not seen, each joint of each log.
host::Judgement judge_prediction(const std::vector<Score>& held_out);

/// What is known of a model beside its errors.
struct ModelFacts {
  int parameters{0}, determined{0};  ///< base parameters; 0: not known
  bool physically_consistent{true};  ///< every link could exist
  double physical_cost_ratio{0.0};   ///< see Fit; 0: not known
  MassMatrixCheck mass{};            ///< poses 0: not looked at
};
/// Judges what the model is made of.
host::Judgement judge_model(const ModelFacts& facts);

/// Judges a fit.
/// @param held_out  one score a log that the fit has not seen; empty: it was judged on nothing, which is doubtful
/// @param training  looked at where held_out is empty
host::Judgement judge(const Fit& fit, const MassMatrixCheck& mass, const std::vector<Score>& held_out,
                      const std::vector<Score>& training = {});
ModelFacts facts_of(const Fit& fit, const MassMatrixCheck& mass);

/// Judges the criteria of a campaign: one missed is bad, one not judged doubtful.
host::Judgement judge(const std::vector<Criterion>& criteria);

/// Judges the exciting motion of a regressor with columns of norm 1.
host::Judgement judge_condition(double condition);

// Loads --------------------------------------------------------------------------------------------------------

/// Why a load cannot be what the log says, as a sentence without a full stop; empty: nothing speaks against it. A mass
/// below zero, or a body that cannot exist, by more than the 95 % intervals allow; a joint whose torque scale is beyond
/// kScaleImpossible or negative.
std::string contradiction(const PayloadRun& run);
/// Judges a load.
host::Judgement judge(const PayloadRun& run);

/// Judges an estimate where the truth is known.
/// @param what  "the mass"
host::Judgement judge_against_truth(const std::string& what, double value, double half_width, double truth);

/// Judges whether something that an estimate is for becomes smaller by it, as it should: kMayRise is nothing.
/// @param what, against  "the tracking error with the estimated load", "that without it"
host::Judgement judge_improvement(const std::string& what, double value, const std::string& against,
                                  double reference);

// Stiffness ----------------------------------------------------------------------------------------------------

/// Judges stiffnesses from deflections.
host::Judgement judge(const StiffnessFit& fit, const StiffnessDiagnosis& diagnosis);
/// Judges stiffnesses from encoders.
/// @param rotor_inertia_known  what the rotors take of the torque was subtracted
host::Judgement judge(const JointEncoderFit& fit, bool rotor_inertia_known);

}  // namespace heft::identify
