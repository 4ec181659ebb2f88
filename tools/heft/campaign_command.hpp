/// @file
/// heft validate --campaign: a simulated measuring campaign against its truth, as text, JSON and page.
#pragma once

#include <cstdint>
#include <string>

#include "options.hpp"

namespace heft::tools {

struct CampaignOptions {
  std::uint64_t seed{1};
  int repeats{10};
  double duration{20.0};  ///< of an experiment [s]
  std::string output;     ///< folder for logs and models; empty: none
};

void run_campaign_command(const RobotOptions& robot, const ResultOptions& result,
                          const CampaignOptions& options);

}  // namespace heft::tools
