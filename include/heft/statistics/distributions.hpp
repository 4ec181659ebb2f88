/// @file
/// Tails and quantiles of the distributions behind p values and intervals.
#pragma once

namespace heft::statistics {

/// Half-width of a 95 % interval in standard deviations of a normal distribution, 0.975, rounded as tables have it.
inline constexpr double kNormal95 = 1.96;

/// Half-width of a 95 % interval in standard deviations for that many degrees of freedom (Student's t,
/// 0.975).
double interval_factor(int degrees_of_freedom);

/// P(F > value) of Fisher's F with these degrees of freedom.
double fisher_tail(double value, double numerator, double denominator);

}  // namespace heft::statistics
