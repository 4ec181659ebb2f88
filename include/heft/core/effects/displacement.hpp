/// @file
/// Displacement by which friction's memory changes.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

namespace heft {

/// Which displacement of its joint drives an effect with memory. A controller has one; a log may yield several.
enum class Displacement : unsigned char {
  kPosition,  ///< of the position that the motion is derived from, low-passed
  kVelocity,  ///< of the velocity as measured
  kMeasured   ///< of the velocity as measured, held near the position as measured
};

/// In the order of Displacement, as model files have them.
inline constexpr std::array<std::string_view, 3> kDisplacementNames{"position", "velocity", "measured"};
/// Those that a log with velocities yields in addition to the position; tables hold them in turn, a column a joint.
inline constexpr int kMeasuredDisplacements = 2;
/// Column of a joint's displacement in such a table. @pre displacement is not kPosition
constexpr int displacement_column(Displacement displacement, int joint, int num_joints) {
  return (static_cast<int>(displacement) - 1) * num_joints + joint;
}
constexpr std::string_view displacement_name(Displacement displacement) {
  return kDisplacementNames[static_cast<std::size_t>(displacement)];
}

}  // namespace heft
