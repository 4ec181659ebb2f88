/// @file
/// The closed loop in the manner of Kawasaki and Nishimura's figures 4 and 5: its arm, simulated, with 250 g at the wrist.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "heft/track/track.hpp"

namespace heft::studies {

/// Estimates of k = 5 from encoder signals of the loaded arm.
struct EncoderEstimate {
  std::string name;  ///< how acceleration and instruments were made
  double error{0};   ///< e of the protocol: against the loaded arm's base parameters
};

/// What the closed loop gave.
struct ClosedLoop {
  double payload_true{0};  ///< [kg]
  double payload_mass{0}, payload_half_width{0};
  std::array<double, 3> payload_com_true{}, payload_com{};
  std::string source;  ///< what the production estimator's estimate rests on
  std::vector<EncoderEstimate> estimates;
  std::vector<track::Run> runs;        ///< controllers side by side on the validation trajectory
  std::vector<std::string> run_notes;  ///< one a run: what the controller knows
  double duration{0};
};

/// Nominal values ±10 %, encoders, 1 kHz: a run without payload and one with it on the exciting trajectory for the
/// estimates, then each controller on the validation trajectory.
/// @param seed  of nominal values and noise
ClosedLoop run_closed_loop(int seed);

}  // namespace heft::studies
