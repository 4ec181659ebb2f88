/// @file
/// What the columns of a log are, said by a person: `tau=effort,q=position`.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace heft::data {

/// ReadAs::map from words such as "tau=effort", heft's name first, or from a JSON file of the same:
/// `{"tau": "effort", "q": "position", "time": "500Hz"}`. heft's name is that of a group of columns (time, q, tau, ...) or of
/// one column (q3); the other is a column of the log, or a group of them without the numbers of the joints.
/// @throws InputError for a word that is neither, and for a file that cannot be read
std::vector<std::pair<std::string, std::string>> read_map(const std::vector<std::string>& words);

}  // namespace heft::data
