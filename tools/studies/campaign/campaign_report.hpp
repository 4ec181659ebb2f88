/// @file
/// A simulated measuring campaign as text, page and JSON.
#pragma once

#include "campaign.hpp"
#include "study_report.hpp"

namespace heft::studies {

/// The verdict on the five criteria, then what each rests on. Torque over time is drawn where the settings asked for it.
StudyReport campaign_report(const CampaignSettings& settings, const CampaignResult& result);

}  // namespace heft::studies
