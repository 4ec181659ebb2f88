/// @file
/// The publications that `heft reproduce` rebuilds.
#pragma once

#include <string>

namespace heft::tools {

struct ReproduceOptions {
  std::string what;
  std::string output;  ///< folder
  std::string json;    ///< the results also here; empty: not, "-": standard output
  int seeds{20};       ///< of noise, for each simulated case
};

/// Kawasaki and Nishimura's terminal-link estimator: open loop, instruments, identifiability, closed loop.
void reproduce_terminal_link(const ReproduceOptions& options);

/// The thesis on the joint stiffness of the UR5 (UPC-ETSEIB, 2017): reach, dexterity, stiffness from the measured deflections.
void reproduce_ur5_stiffness(const ReproduceOptions& options);

}  // namespace heft::tools
