/// @file
/// What a model file keeps of a fit, and which of its base parameters matter for the torque.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "heft/data/motion_stream.hpp"
#include "heft/identify/fit.hpp"
#include "heft/model/model_file.hpp"
#include "heft/validate/score.hpp"

namespace heft::identify {

/// What a model file keeps of a fit.
/// @param torque_at  where the torque was measured: "motor" or "joint"
/// @param training   score of fit.robot on the logs of the fit; null: unknown
model::FitRecord fit_record(const Fit& fit, const std::string& torque_at,
                            const validate::Score* training = nullptr);

/// Root mean square of what each base parameter moves, as a share of the same of the whole torque, in the joint
/// where that is largest, over a log's motion (samples as in a score).
/// @param beta  b values
/// @return b shares
Eigen::VectorXd torque_shares(const Fit& fit, const Eigen::VectorXd& beta, const data::MotionStream& log);

/// Least torque share for which a base parameter counts in a criterion: a hundredth of the joint's torque.
inline constexpr double kCountedShare = 0.01;

/// Which base parameters the criteria count, and why not the others.
struct CountedParameters {
  std::vector<bool> counted;         ///< b
  std::vector<std::string> reasons;  ///< b: why not; empty for those that count
  int count() const;
};
/// Those that the fit determined and that move at least `share` of some joint's torque.
CountedParameters counted_parameters(const Fit& fit, const Eigen::VectorXd& shares,
                                     double share = kCountedShare);

}  // namespace heft::identify
