/// @file
/// Runs gnuplot as a subprocess.
#pragma once

#include <string>

namespace heft::page {

/// What gnuplot returned.
struct GnuplotResult {
  bool ok{false};
  std::string output;     ///< standard output: the drawing
  std::string error;      ///< why there is none, for people
  std::string remarks{};  ///< standard error of a drawing that was made: what the script printed
};

/// Feeds a script to gnuplot's standard input and collects its standard output. Never throws.
GnuplotResult run_gnuplot(const std::string& script);

}  // namespace heft::page
