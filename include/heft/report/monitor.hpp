/// @file
/// Contacts in a log: as one sentence, as text, as JSON and as a page.
#pragma once

#include <string>
#include <vector>

#include "heft/monitor/monitor.hpp"
#include "heft/page/page.hpp"

namespace heft::report {

/// How many false alarms the thresholds let expect.
std::string brief(const monitor::Thresholds& thresholds);
/// The thresholds and what they rest on, as `heft monitor --learn` prints it.
std::string full(const monitor::Thresholds& thresholds);

/// How many contacts, and the first.
std::string brief(const monitor::Contacts& found);
/// All of it for a terminal, as `heft monitor` prints it.
std::string full(const monitor::Contacts& found);
/// What began or ended in a live stream: one line, as `heft monitor -` prints it.
std::string brief(const monitor::LiveContact& event);
/// What the stream held: one line.
std::string brief(const monitor::LiveSummary& summary);
/// The same as one line of JSON each; fields in tools/README.md.
std::string json(const monitor::LiveContact& event);
std::string json(const monitor::LiveSummary& summary);
/// One JSON object, for several logs a list; its fields are described in src/report/README.md.
std::string json(const std::vector<monitor::Contacts>& found);
/// Only thresholds: no log was judged.
std::string json(const monitor::Thresholds& thresholds);
/// Verdict, contacts, thresholds, and deviation with threshold over time where Options::traces asked for them.
page::Page page(const monitor::Thresholds& thresholds, const std::vector<monitor::Contacts>& found);

}  // namespace heft::report
