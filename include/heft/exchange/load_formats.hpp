/// @file
/// A load at the flange in the words of other programs: calls, configuration files and model files, each with its own
/// reference point, axes, order of entries and units.
///
/// @code
/// const exchange::Load load = exchange::load_of(weighing.loads.front().run.on_flange, "carrying.csv");
/// std::puts(exchange::to_text(load, "ur-script").c_str());   // set_target_payload(2.8, [0.01, 0, 0.09], ...)
/// @endcode
#pragma once

#include <span>
#include <string>
#include <string_view>

#include <Eigen/Core>

#include "heft/core/arm_model.hpp"

namespace heft::exchange {

/// A rigid body fixed to the flange.
struct Load {
  double mass{0.0};                              ///< [kg], above zero
  Eigen::Vector3d com{Eigen::Vector3d::Zero()};  ///< centre of mass from the flange, in its axes [m]
  Eigen::Matrix3d inertia{
      Eigen::Matrix3d::Zero()};  ///< about the centre of mass, axes of the flange [kg·m²]; zero: a point
};

/// The load with ten parameters about the flange frame's origin, in its axes.
/// @param where  what they are of, for the message
/// @throws ModelError when they are not finite, or no body can have them
Load load_of(const InertialParameters<double>& about_flange, const std::string& where);

/// A form in which a load can be written.
struct LoadFormat {
  std::string_view id;         ///< "ur-script"
  std::string_view title;      ///< "URScript set_target_payload"
  std::string_view reference;  ///< where its numbers count from, as a clause
};

/// Every form, in the order of the documents.
std::span<const LoadFormat> load_formats();

struct LoadOptions {
  /// Of ur-script and ur-ros2: time over which the controller changes to the new load [s].
  double transition_time{0.0};
  /// Link that urdf and mjcf fix the load to.
  std::string link{"tool0"};
};

/// The load in one of these forms, ends with a line feed. Numbers read back as the same double.
///
/// What a form cannot express is in a comment of it, or refused where that could do harm:
/// FANUC's schedule has no products of inertia, the comment gives their share.
/// @throws InputError for a format that does not exist (names those that do); ModelError for a load that is no body:
///         mass not above zero, inertia that breaks the triangle inequality, numbers that are not finite
std::string to_text(const Load& load, std::string_view format, const LoadOptions& options = {});

}  // namespace heft::exchange
