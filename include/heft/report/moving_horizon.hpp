/// @file
/// What a moving horizon knows just now, in words, as JSON, as a page.
#pragma once

#include <string>

#include "heft/identify/moving_horizon.hpp"
#include "heft/page/page.hpp"

namespace heft::report {

/// One sentence: how many parameters the samples determine, and until when.
std::string brief(const identify::HorizonEstimate& estimate);
/// A row a parameter with its 95 % interval.
std::string full(const identify::HorizonEstimate& estimate);
/// {"time", "usable", "parameters": [{"name", "unit", "value", "low", "high", "determined", "excited"}], "noise_std",
/// "outliers", "smallest_eigenvalue"}; null for what is not known yet.
std::string json(const identify::HorizonEstimate& estimate);
page::Page page(const identify::HorizonEstimate& estimate);

}  // namespace heft::report
