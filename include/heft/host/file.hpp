/// @file
/// Input files that can be read twice and output files that appear whole or not at all.
#pragma once

#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "heft/host/error.hpp"

namespace heft::host {

/// Whoever read standard output has left (`| head`), which is no mistake of anyone.
class ReaderLeftError : public InputError {
 public:
  using InputError::InputError;
};

/// Writes `content` to `path`.
///
/// A regular file is written to a temporary file in the same folder, synchronised to the disk and renamed, so that a
/// reader never sees half a file and an old one stays until the new one is complete; mode and owner are kept. Links are
/// followed. Anything else (a device, a pipe) is written through. `-` is standard output; `/dev/stdout`, `/dev/stderr`
/// and `/dev/fd/N` are the descriptors of this process.
/// @throws InputError when the file cannot be written as a whole
void write_file_atomically(const std::string& path, std::string_view content);

/// Whole content of a text file.
/// @throws InputError naming the path when it cannot be read. `what` names the kind of file in the message ("log", "model").
std::string read_file(const std::string& path, std::string_view what);

/// Whether `path` names standard output: `-`, or one of the names that the system gives it.
bool is_standard_output(std::string_view path);

/// The descriptor that an output path names (`-`: 1, `/dev/fd/7`: 7); nothing for any other file.
std::optional<int> named_descriptor(std::string_view path);

/// The target of a path whose last part is a link, of links to links as well. The target need not exist.
/// @throws InputError when the links lead round in a circle
std::string follow_links(std::string path);

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using InputFile = std::unique_ptr<std::FILE, CloseFile>;

/// Opens a file for reading from its beginning; a spooled one (see below) as often as needed. `-` is standard input.
/// @return null when it cannot be opened; errno says why
InputFile open_input(const std::string& path);

/// An unnamed file to write to and read from, gone when it is closed: on the disk (in TMPDIR), in memory where no folder for
/// temporary files can be written.
/// @return null when there can be none
InputFile temporary_file();

/// What cannot be read twice (a pipe, standard input, `<(zcat log.gz)`) is copied once into an unnamed temporary file,
/// from which open_input() and read_file() read from then on. A temporary file rather than memory: commands read a
/// log several times so that it need not fit into memory. Regular files and files that do not exist are left alone.
/// Lasts until the process ends; meant for a command at its start, before it has threads.
/// @throws InputError when the pipe was spooled before, when it brings nothing but zeros, or when there is no space
void spool_input(const std::string& path, std::string_view what);

/// Refuses text whose brackets are nested deeper than any file of heft needs: JSON parsers and their destructors call
/// themselves for every level and run out of stack.
/// @throws InputError naming file, line and column
void refuse_deep_json(std::string_view text, const std::string& file);

}  // namespace heft::host
