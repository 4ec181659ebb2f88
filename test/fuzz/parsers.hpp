/// @file
/// Everything that reads a user's text file, under one name each: what fuzzers call, and the short run of them in the test suite.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace heft::fuzz {

struct Parser {
  std::string_view name;             ///< the fuzzer is fuzz_NAME
  std::string_view seeds;            ///< folder of files to begin with, in test
  void (*read)(const std::string&);  ///< reads a file; throws InputError, or NotIdentifiableError
};

std::span<const Parser> parsers();

/// Gives a text to a parser as a file. Anything but an answer, or one error of one line that names the file, ends the process.
/// @return the message; empty: the file was read
std::string try_to_read(const Parser& parser, std::string_view text);

}  // namespace heft::fuzz
