/// @file
/// A file that a page carries.
#pragma once

#include <string>

#include "heft/page/page.hpp"

namespace heft::page {

/// An element that shows nothing, for the page's script: JSON with label, name, notes and columns. A column's values are
/// numbers n to the base 64 in `places` characters each (A to Z, a to z, 0 to 9, +, /): low + step · n; the highest n
/// stands for no value. Empty when there are no rows.
std::string data_file_html(const DataFile& file);

}  // namespace heft::page
