/// @file
/// One line on what an estimator sample costs, for people.
#pragma once

#include <string>

namespace heft::studies {

/// Multiplications and additions of one sample of the terminal-link estimator (Kawasaki and Nishimura's arm, rows 5 and 6,
/// instrumental variables, information form), counted now by running the production code with a counting scalar,
/// and their own figure.
std::string operation_count_line();

}  // namespace heft::studies
