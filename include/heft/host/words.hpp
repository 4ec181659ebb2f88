/// @file
/// Words that several rooms put into their sentences.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace heft::host {

/// "joint 2", "joints 2, 3 and 5".
/// @param joints  counted from 0
std::string joints_in_words(const std::vector<int>& joints);

/// The text with a capital letter at its beginning.
std::string capital(std::string text);

/// Number of letters to insert, delete or change to turn `a` into `b`.
std::size_t edit_distance(const std::string& a, const std::string& b);

/// The nearest of `known`, "" when none is near.
std::string nearest_word(const std::string& word, const std::vector<std::string>& known);

/// A word as a shell takes it literally.
std::string shell_word(const std::string& word);

}  // namespace heft::host
