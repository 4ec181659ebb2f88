// The chain of a URDF between two links, as a robot.
#pragma once

#include <string>
#include <vector>

#include <urdf_model/model.h>

#include "heft/model/robot.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "urdf_document.hpp"

namespace heft::urdf {

/// Picks the chain out of the tree and turns it into a robot.
/// @param model     read from the text that `document` describes
/// @param warnings  one line for each thing worth knowing, may be null
/// @throws UrdfError
model::Robot build_chain(const Document& document, const ::urdf::ModelInterface& model,
                         const UrdfOptions& options, std::vector<std::string>* warnings);

}  // namespace heft::urdf
