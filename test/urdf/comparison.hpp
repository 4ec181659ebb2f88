/// @file
/// What the tests against other programs share.
#pragma once

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace heft::urdf {

/// Every robot in urdf/, by name.
inline std::vector<std::string> robot_files() {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(HEFT_URDF_DIR)) {
    if (entry.path().extension() == ".urdf") files.push_back(entry.path().string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// Largest difference, relative to the largest entry.
inline double relative_error(const Eigen::MatrixXd& found, const Eigen::MatrixXd& expected) {
  return (found - expected).cwiseAbs().maxCoeff() / expected.cwiseAbs().maxCoeff();
}

}  // namespace heft::urdf
