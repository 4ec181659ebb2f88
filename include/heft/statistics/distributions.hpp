/// @file
/// Tails and quantiles of the distributions behind p values and intervals.
#pragma once

namespace heft::statistics {

/// Half-width of a 95 % interval in standard deviations of a normal distribution, 0.975, rounded as tables have it.
inline constexpr double kNormal95 = 1.96;

/// Half-width of a 95 % interval in standard deviations for that many degrees of freedom (Student's t,
/// 0.975).
double interval_factor(int degrees_of_freedom);

/// Degrees of freedom whose interval_factor() that is, at most 1000.
/// @param factor  above 1.96; anything else gives 1000, all but normal
int degrees_of_freedom(double factor);

/// P(|t| > value) of Student's t with these degrees of freedom, which need not be whole.
double student_two_sided(double value, double degrees_of_freedom);

/// The value that |t| exceeds with that probability: student_two_sided() turned over, to 1e-9.
/// @param probability  within (0, 1)
double student_quantile(double probability, double degrees_of_freedom);

/// P(F > value) of Fisher's F with these degrees of freedom.
double fisher_tail(double value, double numerator, double denominator);

}  // namespace heft::statistics
