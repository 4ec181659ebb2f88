/// @file
/// Logs of simulated arms that lack nothing, with the faults that a measurement itself has.
#pragma once

#include <string>
#include <vector>

#include "support/undeclared_case.hpp"

namespace heft::test {

/// What is wrong with a measurement, on top of white noise.
enum class MeasurementFault {
  kNone,
  kCorrelatedNoise,  ///< on the torque, remembered for 5 to 50 ms
  kCoarseEncoder,    ///< steps of 0.2 to 2 mrad, a fifth of that in metres
  kUnevenSamples,  ///< samples up to 20 % of a period off the even clock, as their stamps say; one in a hundred is lost
  kUnevenStamps,   ///< the same stamps of samples on the even clock
  kLateStamps      ///< samples on the even clock, stamped later: by 0.2 periods times a half-normal number, one in 300 by 1 to 4 periods
};
inline constexpr MeasurementFault kMeasurementFaults[]{
    MeasurementFault::kNone, MeasurementFault::kCorrelatedNoise, MeasurementFault::kCoarseEncoder,
    MeasurementFault::kUnevenSamples, MeasurementFault::kUnevenStamps, MeasurementFault::kLateStamps};

struct NullSpec {
  MeasurementFault fault{MeasurementFault::kNone};
  double rate{500.0};      ///< [Hz]
  bool velocities{false};  ///< logged: differences of the positions as logged, low-passed as a drive does
};
/// "coarse_encoder_500_qd".
std::string name_of(const NullSpec& spec);

/// One motion of an arm without any effect, measured in many ways.
class NullLogs {
 public:
  /// Takes seconds.
  /// @param arm  see make_undeclared_case()
  NullLogs(const std::string& arm, unsigned seed);

  /// Training and validation log of the arm. The same arguments give the same logs.
  UndeclaredCase measured(const NullSpec& spec) const;

 private:
  /// Smooth motion on an even grid: what is true, to the last digit.
  struct Motion {
    double period;  ///< [s]
    Eigen::MatrixXd q, qd, qdd;
  };

  UndeclaredCase arm_;
  unsigned seed_;
  std::vector<Motion> motions_;  ///< to train on, to validate
};

}  // namespace heft::test
