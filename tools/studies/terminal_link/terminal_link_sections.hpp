/// @file
/// Checks of core/estimate/README.md, sections 5, 6 and 7, that are not rows of the table in section 10.
#pragma once

#include <array>
#include <string>
#include <vector>

namespace heft::studies {

/// (39) against (39'): the terminal link's change fitted over all six rows on the validation trajectory, noise-free,
/// with exact nominal values.
/// In Kawasaki and Nishimura's order and units: Δα (g m), ΔĪ 11, 22, 33, 12, 13, 23 (g m²), ΔF (mN m), Δd; then Δm (g).
struct MassColumnCheck {
  std::vector<double> truth;         ///< 12
  std::vector<double> without_mass;  ///< 11, equation (39)
  std::vector<double> with_mass;     ///< 12, equation (39')
};
MassColumnCheck check_mass_column();
const std::vector<std::string>& terminal_parameter_names();

/// Torque error of joints 1..4 on the validation trajectory, rms [mN m], when only links 5 and 6 are corrected.
struct UncorrectedRows {
  std::array<double, 4> uncorrected{};     ///< no correction at all
  std::array<double, 4> k5{};              ///< a perfect k = 5 estimate added to the raw coefficients
  std::array<double, 4> k5_base_values{};  ///< base values in the kept columns, zero in the dropped ones
  std::array<double, 4> reduced{};         ///< a perfect k = 5 estimate in heft's reduced parameters
  std::array<double, 4> with_mass{};       ///< the same with the payload's mass carried inboard
};
UncorrectedRows check_uncorrected_rows();

/// Payload mass from the difference of two k = 4 estimates, with and without payload [g].
struct MassFromDifference {
  double instrumental{0}, least_squares{0};                          ///< the same noise in both runs
  double instrumental_independent{0}, least_squares_independent{0};  ///< each run with noise of its own
};
/// @param seed  of the noise; 20000 samples at 5 ms, scenario A
MassFromDifference mass_from_difference(int seed);

/// Rank of rows k..6 over random motion.
struct RankCheck {
  int k{0};
  int columns{0};
  int rank{0};
  double gap{0};  ///< last kept over first dropped singular value, decades
};
std::vector<RankCheck> check_ranks();

/// Largest relative difference of each recursive form from the regularised batch estimate
/// (P₀⁻¹ + Σ ẑ w)⁻¹ (P₀⁻¹ x₀ + Σ ẑ y), over the data of section 10.
struct FormCheck {
  double covariance{0}, staged{0}, factored{0};
};
FormCheck check_forms(int seed, int samples);

/// What the production estimator hands out while data come in, against what instrumental variables would say.
struct StartupPoint {
  int samples{0};
  int source{0};         ///< 0 prior, 1 least squares, 2 instrumental variables
  double handed_out{0};  ///< e of the estimate handed out
  double unchecked{0};   ///< e of the instrumental estimate at this N without any check
};
std::vector<StartupPoint> startup(bool rotor_inertia, double period, int seed,
                                  const std::vector<int>& samples);

}  // namespace heft::studies
