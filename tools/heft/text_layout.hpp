/// @file
/// Text that fits into a terminal.
#pragma once

#include <cstdio>
#include <string>
#include <string_view>

namespace heft::tools {

/// Columns of the terminal behind a stream; without one what COLUMNS says, else `otherwise`.
int terminal_width(std::FILE* stream, int otherwise);

/// Breaks lines that are wider than `width` at spaces. A broken line goes on under the beginning of its text (of its
/// second column, where two spaces or more separate columns within the first third of the width), a command with a
/// backslash. Rows of tables (more than one wide gap) stay as they are: broken they could not be read.
std::string wrapped(std::string_view text, int width);

/// For help texts: joins lines of prose that were broken by hand, then wraps, rows of tables as well. Indented lines and empty ones stay apart.
std::string reflowed(std::string_view text, int width);

}  // namespace heft::tools
