/// @file
/// The entries of `effects` in a model file: joint effects, elasticities, the delay of the torque.
#pragma once

#include <cstddef>

#include "heft/model/model_file.hpp"
#include "host/json.hpp"

namespace heft::model {

/// Reads one entry and puts it where the model keeps it.
/// @throws ModelError naming file and path of what is wrong
void read_effect(const host::JsonValue& node, std::size_t num_joints, ModelFile& model);

/// All entries, an array.
host::Json effects_json(const ModelFile& model);

}  // namespace heft::model
