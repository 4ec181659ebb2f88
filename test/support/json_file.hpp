/// @file
/// Results of commands as JSON.
#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "heft/host/file.hpp"

namespace heft::test {

inline nlohmann::json json_of(const std::string& path) {
  return nlohmann::json::parse(host::read_file(path, "result"));
}

}  // namespace heft::test
