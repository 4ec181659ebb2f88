// Triangles from STL files, binary or text.
#pragma once

#include <array>
#include <string>
#include <vector>

namespace heft::urdf {

/// Corners of the triangles, three in a row each, in the file's unit.
/// @throws UrdfError when it is not an STL file or has more than a million triangles.
std::vector<std::array<double, 3>> read_stl(const std::string& path);

}  // namespace heft::urdf
