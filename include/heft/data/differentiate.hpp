/// @file
/// Velocities and accelerations from logged positions: uniform grid, zero-phase low-pass, differences.
///
/// Everything here works on whole logs after the fact; nothing of it may run in a control loop.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heft/data/log.hpp"

namespace heft::data {

/// A stretch of time without samples.
struct TimeGap {
  double begin{0.0};  ///< time of the last sample before it [s]
  double end{0.0};    ///< time of the first sample after it [s]
};

/// Stretches between neighbouring samples longer than `factor` times the median sample period.
std::vector<TimeGap> find_gaps(const Eigen::VectorXd& time, double factor = 10.0);

/// Sample rate as one over the median sample period [Hz]. The median does not see gaps and late samples.
/// @throws DataError with fewer than two samples.
double median_sample_rate(const Eigen::VectorXd& time);

/// Whether every time stamp is within one percent of a period of the even grid between first and last.
bool is_uniform(const Eigen::VectorXd& time);

/// Values of the columns of `signal` at other times, by cubic splines through the samples.
///
/// Why cubic and not linear: a straight line between samples loses (ωh)²/12 of a sine, 2 % at five samples
/// a radian, and its derivative is a staircase, which differentiation turns into noise at the sample rate.
/// A cubic spline loses of the order (ωh)⁴/720 and has a continuous second derivative. The end conditions
/// are not-a-knot (the outer two pieces are one cubic), so that no curvature is invented at the ends.
/// Across gaps (`find_gaps`) the spline is cut and a straight line is drawn, because a spline overshoots
/// where nothing holds it. Times outside the samples take the nearest end value.
///
/// @param time    sample times [s], strictly increasing, m ≥ 1
/// @param signal  m × columns
/// @param at      times asked for [s], increasing
/// @return at.size() × columns. O(m + at.size()) a column.
Eigen::MatrixXd resample(const Eigen::VectorXd& time, const Eigen::MatrixXd& signal,
                         const Eigen::VectorXd& at);

/// The log on an even grid from its first to its last time stamp, every channel by `resample`; in a gap positions go on with
/// the velocities beside it.
/// @param sample_rate  [Hz]; 0 takes the median rate. The period is fitted so that both ends are met.
/// @throws DataError when the rate is not positive or the log has fewer than two samples.
Log resample_uniform(const Log& log, double sample_rate = 0.0);

/// Fourth-order Butterworth low-pass run forth and back over each column: no phase, twice the attenuation.
///
/// Gain at frequency f: 1 / (1 + (tan(πf/f_s) / tan(πf_c/f_s))⁸), which is 1/2 at the cut-off (each of the
/// two passes has 1/√2 there). Two second-order sections (Q = 0.5412 and 1.3066), each as a pair of
/// trapezoidal integrators [1]: the same transfer function as the usual coefficient form, but exact at
/// zero frequency however low the cut-off, where 1+a₁+a₂ would cancel to nothing.
/// Ends: the record is continued by odd reflection (2x₀ - x) over three periods of the cut-off, or over as
/// much as there is, and the sections start at rest on the first value; a straight line passes unchanged.
///
/// [1] U. Zölzer (ed.), DAFX: Digital Audio Effects, 2nd ed., 2011, ch. 2 (state-variable filters);
///     the bilinear transform with pre-warping gives the gain above.
///
/// @param signal       samples × columns on an even grid
/// @param sample_rate  f_s [Hz]
/// @param cutoff       f_c [Hz], 0 < f_c < f_s/2
/// @throws DataError when the cut-off is outside that range.
Eigen::MatrixXd low_pass_zero_phase(const Eigen::Ref<const Eigen::MatrixXd>& signal, double sample_rate, double cutoff);

/// Smoothed values or derivatives by Savitzky and Golay [1]: through each `window` neighbouring samples the
/// polynomial of least squares, read (or differentiated) in their middle; no phase.
///
/// Exact for polynomials up to `order`. The first and last half window are read off the polynomial of the
/// first and last whole window. Fewer samples than the window have one polynomial through all of them.
///
/// [1] A. Savitzky, M. J. E. Golay, Smoothing and differentiation of data by simplified least squares
///     procedures, Analytical Chemistry 36 (1964) 1627-1639.
///
/// @param signal       samples × columns on an even grid
/// @param sample_rate  [Hz]
/// @param window       samples, odd, more than `order`
/// @param order        of the polynomial, 0 to 8, at least `derivative`
/// @param derivative   0: smoothed values, 1 or 2: derivatives in time
/// @return same shape as `signal`. O(samples · window) a column.
/// @throws DataError when a number is outside these ranges.
Eigen::MatrixXd savitzky_golay(const Eigen::Ref<const Eigen::MatrixXd>& signal, double sample_rate, int window, int order,
                               int derivative = 0);

/// Shortest window [samples] whose smoothed values of a sine at `cutoff` have no more than half its
/// amplitude: the same half gain at the cut-off as `low_pass_zero_phase`. That is 1.28, 1.94 and 2.59 periods
/// of the cut-off at orders 2, 4 and 6; -3 dB lies at 0.83, 0.87 and 0.90 of the cut-off. Odd orders smooth
/// as the even one below. At a tenth of the cut-off order 4 takes 1.5e-6 of q, 2.7e-4 of q̇ and 1.7e-4 of q̈.
/// @throws DataError when the cut-off is not above 0 and below half the sample rate.
int savitzky_golay_window(double cutoff, double sample_rate, int order);

/// Time derivative of each column by differences over `stencil` neighbouring samples, central inside and
/// one-sided at the ends; the sample times need not be even.
///
/// The weights are those of the polynomial through the stencil's samples, differentiated. Three samples:
/// error (ωh)²/6 of a sine; five samples: (ωh)⁴/30. Five is the default, since at 100 Hz a 3 Hz motion loses
/// 0.6 % with three samples and 0.004 % with five.
///
/// @param stencil  3 or 5; fewer samples than that use what there is
/// @return same shape as `signal`
/// @throws DataError with fewer than two samples or another stencil.
Eigen::MatrixXd differentiate(const Eigen::VectorXd& time, const Eigen::MatrixXd& signal, int stencil = 5);

/// Bandwidth of the motion: the frequency below which lies all of q but 1 % of its amplitude (99.99 % of its
/// power about the mean), in the joint where it is highest [Hz].
///
/// From the periodogram (Hann window) on an even grid. Power of position, not of velocity: encoder resolution
/// and jittering time stamps make noise far below 1 % of a motion's amplitude, while in velocity and
/// acceleration they can exceed the motion. Joints whose rms deviation from their mean is below 5e-3 rad (m),
/// or below a hundredth of the largest, count as resting; 0 when all rest.
double motion_bandwidth(const Eigen::MatrixXd& q_uniform, double sample_rate);

/// What smooths a motion before or while it is differentiated.
enum class DerivativeMethod {
  kButterworth,    ///< `low_pass_zero_phase`, then `differentiate`
  kSavitzkyGolay,  ///< `savitzky_golay`, window from the cut-off by `savitzky_golay_window`
};

/// How velocities and accelerations are derived.
struct MotionOptions {
  /// Low-pass cut-off [Hz]. 0 chooses it: ten times the motion's bandwidth (`motion_bandwidth`), at least
  /// 3 Hz. At a tenth of the cut-off the filter takes 1e-8 of the amplitude, so the motion passes unchanged,
  /// and so do the harmonics that controllers and friction reversals add up to about six times the bandwidth.
  /// Ten was chosen on measured logs of seven robots: there the derived velocity is nearest to the one the
  /// robot reports for cut-offs of 4 to 15 Hz, at bandwidths of 0.3 to 1 Hz.
  /// A chosen cut-off above 0.4 times the sample rate means no filter at all. When no joint moves the
  /// bandwidth is unknown: then 10 Hz, or 0.4 times the sample rate if that is less.
  double cutoff{0.0};
  /// Derive qd and qdd from q although the log has them.
  bool from_position{false};
  /// Also replace q by its filtered values.
  bool smooth_position{false};
  /// Stencil of the differences, 3 or 5.
  int stencil{5};
  /// Savitzky-Golay has a window of limited length, so what is wrong in one place stays within half a window
  /// (one period of the cut-off), but it attenuates slowly beyond the cut-off, and its velocity and
  /// acceleration lose different parts of a fast motion. Without a filter (cut-off 0) both methods are plain
  /// differences.
  DerivativeMethod method{DerivativeMethod::kButterworth};
  /// Order of the polynomials of Savitzky and Golay, 2 to 8. An odd order is as good as the even one below it
  /// for q and q̈, as the even one above it for q̇.
  int polynomial_order{4};
};

/// What derive_motion did.
struct MotionReport {
  double cutoff{0.0};         ///< low-pass used [Hz]; 0: none
  bool cutoff_chosen{false};  ///< by heft rather than by the caller
  double bandwidth{0.0};      ///< motion_bandwidth [Hz]; 0: no joint moves, or not needed
  double sample_rate{0.0};    ///< of the even grid the work was done on [Hz]
  bool resampled{false};      ///< the log's time stamps jitter, so that grid is not the log's own
  bool velocity_derived{false};
  bool acceleration_derived{false};
  std::vector<TimeGap> gaps;  ///< inside them everything derived is invented: better left out of a fit
};

/// Fills qd and qdd where the log lacks them (or always, from q, with `from_position`).
///
/// q, or a logged qd, is brought to an even grid (if its time stamps jitter), filtered with zero phase,
/// differentiated there, and read back at the log's own time stamps. The log keeps its rows, and tau stays
/// as measured. qdd comes from a logged qd when there is one, since one difference makes less noise than two;
/// from q otherwise. Nothing is done to channels that the log has.
/// Trust the first and last 0.5 s less than the rest.
/// @throws DataError when the log has fewer than five samples, or when the cut-off is negative or not below
///         half the sample rate.
MotionReport derive_motion(Log& log, const MotionOptions& options = {});

}  // namespace heft::data
