/// @file
/// Output files that appear whole or not at all.
#pragma once

#include <string>
#include <string_view>

namespace heft::host {

/// Writes `content` to `path` through a temporary file in the same folder and a rename, so that a
/// reader never sees half a file. `-` writes to standard output.
/// @throws InputError when the folder does not exist or cannot be written.
void write_file_atomically(const std::string& path, std::string_view content);

/// Whole content of a text file.
/// @throws InputError naming the path when it cannot be read. `what` names the kind of file in the message ("log", "model").
std::string read_file(const std::string& path, std::string_view what);

}  // namespace heft::host
