/// @file
/// Reads what an image printed: `key value` lines, `result value` repeated.
#pragma once

#include <map>
#include <string>
#include <vector>

namespace heft::firmware {

struct ImageOutput {
  std::map<std::string, std::string> fields;  ///< every line but the results
  std::vector<double> results;
  bool complete{false};  ///< the line `done` came
};

/// Reads the file; throws std::runtime_error when it cannot be opened.
ImageOutput read_image_output(const std::string& path);

}  // namespace heft::firmware
