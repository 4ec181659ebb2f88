/// @file
/// The reader of a log, found by the content of the file.
#pragma once

#include <memory>
#include <string>

#include "log_reader.hpp"
#include "readers/text_reader.hpp"

namespace heft::data {

/// A format of binary_formats() where the file begins as one, text otherwise. Logs that arrive, and files that can be read
/// once only, are text.
/// @throws DataError
std::unique_ptr<LogReader> open_log(const std::string& path, const ReadAs& as,
                                    Reading reading = Reading::kWhole);

}  // namespace heft::data
