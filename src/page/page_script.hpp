/// @file
/// What a page does where the reader's program runs scripts.
#pragma once

#include <string>

namespace heft::page {

/// The page's one script as an element, hand-written, without a library: its parts for plots, tables and files, as far as
/// the page has such. It reads nothing but the page: values and zoom from `data-plot` of a drawing (plot_data.hpp), rows
/// from their cells, files from the elements of data_file_html(). What it adds (buttons, links, lines of help) is not
/// there without it, nor on paper.
std::string script_html(const std::string& page);

}  // namespace heft::page
