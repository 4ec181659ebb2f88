/// @file
/// Names of links and joints, which a model file may leave out.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace heft::model {

/// Empty behind the end.
inline std::string name_at(const std::vector<std::string>& names, std::size_t index) {
  return index < names.size() ? names[index] : std::string{};
}

}  // namespace heft::model
