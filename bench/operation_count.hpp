/// @file
/// What the counts of operations share: the log of the experiment, results, and the pieces that are counted.
#pragma once

#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "counting_scalar.hpp"
#include "heft/core/arm_geometry.hpp"
#include "heft/core/inertia.hpp"
#include "heft/model/named_arms.hpp"

namespace heft::bench {

inline constexpr int kN = 6;
inline constexpr int kSamples = 2000;
inline constexpr int kSolveEvery = 50;
using Description = model::KawasakiArm;

template <typename Scalar>
using ArmOf = StaticArm<Scalar, Description>;

/// One sample of Kawasaki and Nishimura's experiment: exciting motion, noisy acceleration, clean instrument.
struct Sample {
  std::array<double, kN> q, qd, measured, instrument, tau;
};

/// The log, 10 s at 200 Hz.
const std::vector<Sample>& samples();

template <typename Scalar>
JointVector<Scalar, kN> vector_of(const std::array<double, kN>& values) {
  JointVector<Scalar, kN> v;
  for (int i = 0; i < kN; ++i) {
    v[i] = Scalar(values[static_cast<std::size_t>(i)]);
  }
  return v;
}

template <typename Scalar>
ReducedParameters<Scalar, Description> nominal() {
  ReducedParameters<Scalar, Description> out;
  const auto links = reduced_links(Description::kModel);
  for (std::size_t j = 0; j < kN; ++j) {
    for (std::size_t i = 0; i < 10; ++i) {
      out.links[j][i] = Scalar(links[j][i]);
    }
  }
  return out;
}

inline double number(double v) { return v; }
inline double number(const Counted& v) { return v.value(); }

/// Operations of a piece of work.
template <typename Work>
OperationCount counted(const Work& work) {
  const OperationCount before = counter();
  work();
  return counter() - before;
}

/// What one form of the estimator costs.
struct Result {
  std::string form;
  bool shared{false};
  bool least_squares{false};
  OperationCount total;  ///< over the samples after start-up
  long count{0};
  OperationCount worst;  ///< largest number of multiplications (and, separately, additions) of any sample
  std::vector<std::pair<std::string, OperationCount>> stages;
  bool same_numbers{true};     ///< the counting run and the double run gave the same bits
  double batch_difference{0};  ///< largest difference to the batch estimate, relative to its largest entry
};

/// Largest number of each kind.
void note_worst(OperationCount& worst, const OperationCount& sample);

/// One sample more of a loop: mean and worst.
void note_sample(Result& result, const OperationCount& sample);

/// Each number over the divisor, to two decimals.
nlohmann::ordered_json as_json(const OperationCount& count, double divisor);

/// Runs a loop once with the scalar that counts and once in double, and compares the bits of what it ends with.
/// @param loop  called with a Scalar and the numbers to fill in
/// @return those of double
template <typename Loop>
std::vector<double> run_in_both(Result& result, const Loop& loop) {
  std::vector<double> counting, plain;
  loop(Counted{}, counting);
  loop(double{}, plain);
  result.same_numbers = counting.size() == plain.size() &&
                        std::memcmp(counting.data(), plain.data(), plain.size() * sizeof(double)) == 0;
  return plain;
}

/// Every form of the terminal-link estimator for rows k..n, 1 to 6.
std::vector<Result> estimator_forms(int k);
/// Parameters that it estimates.
int estimator_parameters(int k);

/// Torque of the nominal arm at one state.
OperationCount computed_torque_cost();
/// ContactMonitor by itself with what it needs of the arm: worst sample, with a contact whose weight is looked into.
OperationCount monitor_cost();
/// A loop that follows its load: LoadObserver, one row a sample, an update every ten; ArmTorque at a commanded acceleration.
/// @param watched  with ContactMonitor on what the observer explains
Result control_sample(bool watched);
/// TerminalLinkController at k = 5, a sample of the estimator every five cycles.
Result controller_sample();
/// AdaptiveController on the same arm.
Result adaptive_sample();
/// ExtendedKalmanFilter, UnscentedKalmanFilter on that arm with rotors, positions and velocities measured, no load.
Result extended_sample();
Result unscented_sample();
/// DirectionalLeastSquares, 12 parameters, 6 rows a sample.
Result directional_sample();
/// ArmEstimatingController on that arm: links, friction and load estimated together.
Result arm_estimating_sample();

}  // namespace heft::bench
