/// @file
/// How far a model that was judged on logs can be trusted, by limits stated here.
///
/// | asked of | good | doubtful | bad |
/// | --- | --- | --- | --- |
/// | each joint on each held-out log | explains kGoodShare of the torque, or misses at most kGoodPercent | else | below kBadShare and above kBadPercent |
/// | the log that judges | not seen by the fit | the fit's own | - |
/// | base parameters | kGoodDetermined of them determined | fewer | below kBadDetermined |
/// | the links | physically possible, mass matrix positive definite | not | - |
/// | an estimate with an interval | covers the truth, where that is known | does not | off by more than kFarOff intervals |
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/host/verdict.hpp"
#include "heft/model/physical_links.hpp"
#include "heft/validate/score.hpp"

namespace heft::validate {

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
/// Rise of a tracking error that is noise.
inline constexpr double kMayRise = 0.05;

/// Share of each joint's torque variance that a prediction explains, n: 1 what the mean torque as a predictor leaves
/// nothing of, 0 no better than the mean, negative worse. In band where the score has one: what lies above the band is
/// noise, and counts neither as torque nor as error. NaN where the torque never changes.
Eigen::VectorXd explained_share(const Score& score);

/// Judges a prediction on logs that the fit has not seen, each joint of each log.
host::Judgement judge_prediction(const std::vector<Score>& held_out);

/// Facts of a model other than its errors.
struct ModelFacts {
  int parameters{0}, determined{0};  ///< base parameters; 0: not known
  bool physically_consistent{true};  ///< every link could exist
  double physical_cost_ratio{0.0};   ///< see Fit; 0: not known
  model::MassMatrixCheck mass{};     ///< poses 0: not looked at
};
/// Judges what the model is made of.
host::Judgement judge_model(const ModelFacts& facts);

/// Judges an estimate where the truth is known.
/// @param what  "the mass"
host::Judgement judge_against_truth(const std::string& what, double value, double half_width, double truth);

/// Judges whether something that an estimate is for becomes smaller by it, as it should: kMayRise is nothing.
/// @param what, against  "the tracking error with the estimated load", "that without it"
host::Judgement judge_improvement(const std::string& what, double value, const std::string& against,
                                  double reference);

}  // namespace heft::validate
