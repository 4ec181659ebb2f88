/// @file
/// Words that several rooms put into their sentences.
#pragma once

#include <string>
#include <vector>

namespace heft::host {

/// "joint 2", "joints 2, 3 and 5".
/// @param joints  counted from 0
std::string joints_in_words(const std::vector<int>& joints);

}  // namespace heft::host
