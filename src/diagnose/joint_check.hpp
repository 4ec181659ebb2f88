/// @file
/// Joints that the arm model does not explain: there is no use in looking for small effects in them.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heft/diagnose/diagnose.hpp"
#include "problem.hpp"

namespace heft::diagnose {

/// A joint's error counts as small, whatever it is a share of, up to this part of its largest torque.
inline constexpr double kSmallError = 0.1;
/// Share of a joint's torque variance, noise left out, below which the arm model explains nothing of it. The weakest of
/// thirteen measured arms' joints, a wrist with little but friction, comes to 0.25.
inline constexpr double kExplainsNothing = 0.1;
/// A joint contradicts the rest when its rows fit on their own and not together with those of the other joints: links
/// are shared, so that a joint with another sign, unit or place does. Its error is then this many times what its rows
/// alone need: on thirteen measured arms at most 1.8, with the sign of a shoulder or elbow turned 4 and more.
inline constexpr double kTimesAlone = 2.0;
/// And the difference is this share of its torque's variance at least.
inline constexpr double kContradicts = 0.1;
/// A spring about the joint or its motor's inertia, which masses of its own imitate, is no contradiction: with one the error
/// is less than this many times what its rows alone need. Simulated springs come to 0.95 and 1.06, torques of another scale to
/// 2.1 and more.
inline constexpr double kTimesAloneWithColumn = 1.25;

/// Looks at a fit of the training logs. Torque offsets are allowed for: a sensor's zero is no contradiction.
std::vector<NotExplained> not_explained(const Problem& fitted, const MotionTable& table);

}  // namespace heft::diagnose
