#include "heft/report/monitor.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "heft/host/numbers.hpp"
#include "heft/host/words.hpp"
#include "host/json.hpp"
#include "page_lines.hpp"
#include "torque_score.hpp"

namespace heft::report {
namespace {

using monitor::Contact;
using monitor::Contacts;
using monitor::Thresholds;
using nlohmann::ordered_json;

const char* counted(std::size_t count, const char* one, const char* several) {
  return count == 1 ? one : several;
}

std::string rate_words(const statistics::Interval& rate) {
  return fmt::format("{} an hour (95 %: {} to {})", page::number(rate.value, 2), page::number(rate.lower, 2),
                     page::number(rate.upper, 2));
}

std::string seconds_words(double seconds) {
  return seconds < 120 ? fmt::format("{:.3g} s", seconds) : fmt::format("{:.3g} min", seconds / 60.0);
}

std::size_t touches(const std::vector<Contact>& contacts) {
  return static_cast<std::size_t>(std::count_if(contacts.begin(), contacts.end(),
                                                [](const Contact& contact) { return !contact.load_change; }));
}

/// How many contacts, the first of them, and how many changes of load.
std::string count_words(const std::vector<Contact>& contacts) {
  const std::size_t count = touches(contacts), loads = contacts.size() - count;
  std::string text = count == 0 ? "Nothing touched the arm"
                                : fmt::format("{} {}", count, counted(count, "contact", "contacts"));
  const auto first = std::find_if(contacts.begin(), contacts.end(),
                                  [](const Contact& contact) { return !contact.load_change; });
  if (first != contacts.end())
    text += fmt::format(", the first at {:.3f} s on joint {}", first->begin, first->joint + 1);
  if (loads > 0) text += fmt::format("; {} {} of load", loads, counted(loads, "change", "changes"));
  return text;
}

const char* direction_words(const Contact& contact) {
  return contact.direction > 0 ? "along +q" : "along -q";
}

std::string what_of(const Contact& contact) {
  if (!contact.load_change) return "contact";
  return fmt::format("load change, {:+.2f} kg", contact.load[0]);
}

page::Table contact_table(const Contacts& found) {
  page::Table table(
      {"begin [s]", "end [s]", "what", "first at", "torque from outside", "peak [N·m]", "joints"});
  for (const Contact& contact : found.contacts) {
    table.add_row({fmt::format("{:.3f}", contact.begin), fmt::format("{:.3f}", contact.end), what_of(contact),
                   fmt::format("joint {}", contact.joint + 1), direction_words(contact),
                   page::number(contact.peak, 3), host::joints_in_words(contact.joints)});
  }
  return table;
}

page::Table judged_table(const Contacts& found) {
  page::Table table({"joint", "threshold here, median [N·m]", "of its change [N·m]", "delay [ms]"});
  for (Eigen::Index j = 0; j < found.threshold.size(); ++j) {
    table.add_row({fmt::format("{}", j + 1), page::number(found.threshold[j], 3),
                   page::number(found.change_threshold[j], 3),
                   std::isfinite(found.delay[j]) ? fmt::format("{:.0f}", 1e3 * found.delay[j]) : "–"});
  }
  return table;
}

std::string delay_meaning() {
  return fmt::format(
      "Delay: until a torque from outside that grows by {:.0f} N·m/s, or its change, exceeds its threshold; – beyond 10 s.",
      monitor::kPushRate);
}

page::Table threshold_table(const Thresholds& thresholds) {
  page::Table table({"joint", "moving [N·m]", "turning round [N·m]", "at rest [N·m]", "change moving [N·m]",
                     "change turning [N·m]", "change at rest [N·m]", "rest below [rad/s]",
                     "known up to [rad/s]"});
  for (std::size_t j = 0; j < thresholds.joints.size(); ++j) {
    const JointThreshold<double>& joint = thresholds.joints[j];
    std::vector<std::string> row{fmt::format("{}", j + 1)};
    for (const monitor::ThresholdField& field : monitor::kThresholdFields)
      row.push_back(page::number(joint.*field.value, 3));
    table.add_row(row);
  }
  return table;
}

std::string filters_words(const Thresholds& thresholds) {
  return fmt::format(
      "Low-pass {:.3g}/s ({:.2g} Hz), change from a mean that follows at {:.3g}/s. A joint turns for {:.2g} s after it started, stopped or turned "
      "round. Beyond a load rate of {} N·m/s and the speeds of the last column thresholds grow in proportion.",
      thresholds.bandwidth, thresholds.bandwidth / 6.283185307179586, thresholds.adaptation,
      thresholds.turning_time, page::number(thresholds.load_rate, 3));
}

std::string false_alarm_words(const Contacts& found) {
  return fmt::format("False alarms{}: {}.", found.known_free ? " counted in this log" : " to be expected",
                     rate_words(found.false_alarms));
}

ordered_json rate_json(const statistics::Interval& rate) {
  return {{"value", host::number_or_null(rate.value)},
          {"low", host::number_or_null(rate.lower)},
          {"high", host::number_or_null(rate.upper)}};
}

ordered_json thresholds_json(const Thresholds& thresholds) {
  ordered_json joints = ordered_json::array();
  for (std::size_t j = 0; j < thresholds.joints.size(); ++j) {
    const JointThreshold<double>& joint = thresholds.joints[j];
    ordered_json entry{{"joint", j + 1}};
    for (const monitor::ThresholdField& field : monitor::kThresholdFields)
      entry[field.name] = joint.*field.value;
    joints.push_back(std::move(entry));
  }
  return {{"bandwidth", thresholds.bandwidth},
          {"adaptation", thresholds.adaptation},
          {"turning_time", thresholds.turning_time},
          {"load_rate", thresholds.load_rate},
          {"largest_step", thresholds.largest_step},
          {"asked_per_hour", thresholds.asked_rate},
          {"expected_per_hour", rate_json(thresholds.expected)},
          {"hours", thresholds.hours},
          {"logs", thresholds.logs},
          {"joints", joints}};
}

ordered_json contact_json(const Contact& contact) {
  ordered_json joints = ordered_json::array();
  for (const int joint : contact.joints) joints.push_back(joint + 1);
  ordered_json json{{"begin", contact.begin},
                    {"end", contact.end},
                    {"joints", joints},
                    {"joint", contact.joint + 1},
                    {"direction", contact.direction},
                    {"peak", contact.peak},
                    {"kind", contact.load_change ? "load_change" : "contact"}};
  if (contact.load_change) {
    json["load"] = {{"mass", contact.load[0]},
                    {"first_moment", {contact.load[1], contact.load[2], contact.load[3]}}};
  }
  return json;
}

ordered_json found_json(const Contacts& found) {
  ordered_json json{{"robot", found.robot}, {"model", found.model}, {"log", found.log}};
  put_verdict(json, found.judgement);
  json["contacts"] = ordered_json::array();
  for (const Contact& contact : found.contacts) json["contacts"].push_back(contact_json(contact));
  json["known_free"] = found.known_free;
  json["judged_seconds"] = found.judged_seconds;
  json["false_alarms_per_hour"] = rate_json(found.false_alarms);
  json["thresholds"] = host::json_array(found.threshold);
  json["change_thresholds"] = host::json_array(found.change_threshold);
  json["delay"] = host::json_array(found.delay);
  json["learnt"] = thresholds_json(found.thresholds);
  return json;
}

page::PlotSpec deviation_plot(const Contacts& found, Eigen::Index joint) {
  page::PlotSpec spec;
  spec.title = fmt::format("joint {}", joint + 1);
  spec.x_label = "time [s]";
  spec.y_label = "torque from outside [N·m]";
  const monitor::DeviationTrace& trace = found.trace;
  spec.series.push_back(page::band("threshold", trace.time, -trace.level_threshold.col(joint),
                                   trace.level_threshold.col(joint), page::Hue::kNeutral));
  spec.series.push_back(page::band("of its change", trace.time, -trace.change_threshold.col(joint),
                                   trace.change_threshold.col(joint), page::Hue::kSky));
  spec.series.push_back(page::line("residual", trace.time, trace.residual.col(joint), page::Hue::kBlue));
  spec.series.push_back(page::line("change", trace.time, trace.change.col(joint), page::Hue::kOrange));
  for (const Contact& contact : found.contacts) {
    if (std::find(contact.joints.begin(), contact.joints.end(), static_cast<int>(joint)) ==
        contact.joints.end())
      continue;
    spec.marks.push_back({page::Mark::Direction::kVertical, contact.begin, ""});
  }
  return spec;
}

}  // namespace

std::string brief(const Thresholds& thresholds) {
  return fmt::format(
      "Thresholds from {} of free motion in {} {}: {} false alarms an hour were allowed, {} are to be expected.",
      seconds_words(3600.0 * thresholds.hours), thresholds.logs.size(),
      counted(thresholds.logs.size(), "log", "logs"), page::number(thresholds.asked_rate, 2),
      rate_words(thresholds.expected));
}

std::string full(const Thresholds& thresholds) {
  return fmt::format("{}\n{}{}\n{}", brief(thresholds), verdict_text(thresholds.judgement),
                     filters_words(thresholds), threshold_table(thresholds).to_text(2));
}

std::string brief(const Contacts& found) {
  return fmt::format("{}, in {} that could be judged.", count_words(found.contacts),
                     seconds_words(found.judged_seconds));
}

std::string brief(const monitor::LiveContact& event) {
  const Contact& contact = event.contact;
  if (!event.ended) {
    return fmt::format("{:.3f} s: contact begins on joint {}, {}, {} N·m (threshold {})", contact.begin,
                       contact.joint + 1, direction_words(contact), page::number(contact.peak, 3),
                       page::number(event.threshold, 3));
  }
  return fmt::format("{:.3f} s: {} since {:.3f} s on joint {}, {}, peak {} N·m, {}", contact.end,
                     contact.load_change ? what_of(contact) + "," : "contact ends,", contact.begin,
                     contact.joint + 1, direction_words(contact), page::number(contact.peak, 3),
                     host::joints_in_words(contact.joints));
}

std::string brief(const monitor::LiveSummary& summary) {
  if (!summary.unanswered.empty())
    return fmt::format("Nothing could be judged in {}; {} samples taken, {} refused.",
                       seconds_words(summary.seconds), summary.samples, summary.refused);
  return fmt::format("{}, in {} of {} that could be judged; {} samples taken, {} refused.",
                     count_words(summary.contacts), seconds_words(summary.judged_seconds),
                     seconds_words(summary.seconds), summary.samples, summary.refused);
}

std::string json(const monitor::LiveContact& event) {
  ordered_json line{{"event", event.ended ? "ends" : "begins"},
                    {"time", event.ended ? event.contact.end : event.contact.begin}};
  line.update(contact_json(event.contact));
  if (!event.ended) line.erase("end");
  line["threshold"] = event.threshold;
  return line.dump();
}

std::string json(const monitor::LiveSummary& summary) {
  ordered_json line{{"event", "end_of_stream"},
                    {"seconds", summary.seconds},
                    {"judged_seconds", summary.judged_seconds},
                    {"samples", summary.samples},
                    {"refused", summary.refused}};
  line["contacts"] = ordered_json::array();
  for (const Contact& contact : summary.contacts) line["contacts"].push_back(contact_json(contact));
  return line.dump();
}

std::string full(const Contacts& found) {
  std::string text = fmt::format("{}: {}\n{}", found.log, brief(found), verdict_text(found.judgement));
  if (!found.contacts.empty()) text += contact_table(found).to_text(2);
  return text +
         fmt::format("{}\n{}{}\n", false_alarm_words(found), judged_table(found).to_text(2), delay_meaning());
}

std::string json(const std::vector<Contacts>& found) {
  if (found.size() == 1) return text_of(found_json(found.front()));
  ordered_json list = ordered_json::array();
  for (const Contacts& one : found) list.push_back(found_json(one));
  return text_of(list);
}

std::string json(const Thresholds& thresholds) {
  ordered_json json;
  put_verdict(json, thresholds.judgement);
  json.update(thresholds_json(thresholds));
  return text_of(json);
}

page::Page page(const Thresholds& thresholds, const std::vector<Contacts>& found) {
  std::vector<std::string> logs;
  for (const Contacts& one : found) logs.push_back(one.log);
  page::Page page = page::new_page(
      found.empty() ? "Thresholds of contacts" : fmt::format("{}: contacts", found.front().robot),
      file_names_of(found.empty() ? thresholds.logs : logs));
  if (found.size() == 1) {
    page.verdict(brief(found.front()), found.front().judgement);
  } else {
    page.verdict(brief(thresholds), thresholds.judgement);
  }
  for (const Contacts& one : found) {
    add_log_line(page, {one.log, one.log_rate, one.log_seconds, 0.0});
    if (found.size() > 1) page.heading(file_name_of(one.log)).paragraph(brief(one));
    if (!one.contacts.empty()) page.table(contact_table(one), "Contacts");
    page.paragraph(false_alarm_words(one));
    page.table(judged_table(one), delay_meaning());
    if (one.trace.time.size() == 0) continue;
    std::vector<page::PlotSpec> plots;
    for (Eigen::Index j = 0; j < one.trace.residual.cols(); ++j) plots.push_back(deviation_plot(one, j));
    page.plots("Torque from outside and threshold", small(plots));
  }
  page.heading("Thresholds");
  if (found.size() == 1) page.paragraph(brief(thresholds));
  page.table(threshold_table(thresholds), filters_words(thresholds));
  return page;
}

}  // namespace heft::report
