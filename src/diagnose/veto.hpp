/// @file
/// Effects that are taken out again: they add nothing to what identify fits, or do harm on the validation logs.
#pragma once

#include <Eigen/Core>

#include "identified.hpp"
#include "search.hpp"

namespace heft::diagnose {

/// Takes out what its own intervals deny: springs whose stiffness and damping can only be what no gear has (a motor's inertia, or
/// the joint's friction, that is off looks like one), and torque scales that may be none (masses that were held hide it).
void reject_denied_by_intervals(Search& search, const Identified& identified);

/// Takes out effects that raise the error on a validation log, or gives them another form that does not. Where one explained much
/// of its joint's error, what was chosen beside it is chosen again, and what could stand in its place is looked for.
/// @param base  prediction of the fit without effects on the validation logs
void reject_overfitted(Search& search, const Eigen::MatrixXd& base);

/// Takes out effects that gain too little next to rotor inertia and offsets, which the search names only where it finds
/// them and identify's model has anyway: a tilted base, a cable or a ripple can look like an offset. Springs, and what gains
/// unsteadily, go as well where the validation logs show too little of them.
void reject_needless(Search& search, const Identified& identified);

}  // namespace heft::diagnose
