/// @file
/// The text of a URDF file.
#pragma once

#include <string>

#include "heft/host/error.hpp"
#include "heft/host/file.hpp"

namespace heft::urdf {

/// @throws UrdfError naming the path when it cannot be read
inline std::string read_urdf(const std::string& path) {
  try {
    return host::read_file(path, "URDF");
  } catch (const InputError& error) {
    throw UrdfError(error.what());
  }
}

}  // namespace heft::urdf
