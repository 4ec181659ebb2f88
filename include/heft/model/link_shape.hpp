/// @file
/// The shape of a link, as far as a description of the robot gives it.
#pragma once

#include <array>
#include <string>
#include <vector>

namespace heft::model {

/// One body of a link's collision geometry, fixed to the link.
struct LinkShape {
  enum class Kind {
    kBox,       ///< size: edges along x, y, z
    kCylinder,  ///< size: radius, length along z, unused
    kSphere,    ///< size: radius, unused, unused
    kMesh       ///< triangles
  };
  int link{-1};           ///< 0-based number of the joint that moves it; −1: it is fixed to the base
  std::string link_name;  ///< as in the description
  Kind kind{Kind::kBox};
  std::array<double, 3> size{0, 0, 0};  ///< [m]
  /// Corners of a mesh's triangles, three in a row each, in the shape's own frame [m].
  std::vector<std::array<double, 3>> corners{};
  /// Placement of the shape's frame in the frame of the moving link (base frame for −1): rotation row-major,
  /// position [m].
  std::array<double, 9> rotation{1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::array<double, 3> position{0, 0, 0};
};

}  // namespace heft::model
