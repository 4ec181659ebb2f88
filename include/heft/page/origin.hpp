/// @file
/// Pages that say at their end how they came to be.
#pragma once

#include <string>

#include "heft/page/page.hpp"

namespace heft::page {

/// Keeps the command line for the pages that are made from now on.
void remember_command(int argc, const char* const* argv);

/// An empty page whose end names the command, the date, and heft's version and commit.
Page new_page(const std::string& title, const std::string& subtitle = {});

}  // namespace heft::page
