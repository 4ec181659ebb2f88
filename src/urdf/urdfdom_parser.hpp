// urdfdom, with its messages caught.
#pragma once

#include <string>

#include <urdf_model/model.h>
#include <urdf_world/types.h>

#include "urdf_document.hpp"

namespace heft::urdf {

/// The model as urdfdom reads it.
/// @throws UrdfError also when urdfdom returns a model but has complained: it then keeps half-read links.
::urdf::ModelInterfaceSharedPtr parse_with_urdfdom(const std::string& text, const Document& document);

}  // namespace heft::urdf
