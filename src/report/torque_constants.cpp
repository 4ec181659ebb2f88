#include "heft/report/torque_constants.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "heft/host/words.hpp"
#include "heft/page/origin.hpp"
#include "heft/report/verdict.hpp"
#include "host/json.hpp"
#include "page_lines.hpp"

namespace heft::report {
namespace {

using drive::JointConstant;
using drive::TorqueConstants;

double half_percent(const statistics::Interval& constant) {
  return 100.0 * constant.half_width() / constant.value;
}

page::Table constants_table(const TorqueConstants& constants) {
  page::Table table({"joint", "K [N·m/A]", "95 % interval", "±", "from", "logs", "friction by load"});
  for (std::size_t j = 0; j < constants.joints.size(); ++j) {
    const JointConstant& joint = constants.joints[j];
    if (!joint.known()) {
      table.add_row({std::to_string(j + 1), page::number(kNaN), "", "", "", "", ""});
      continue;
    }
    const auto used =
        std::count_if(joint.logs.begin(), joint.logs.end(), [](const auto& log) { return log.agrees; });
    table.add_row(
        {std::to_string(j + 1), fmt::format("{:.3f}", joint.constant.value),
         fmt::format("{:.3f} to {:.3f}", joint.constant.lower, joint.constant.upper),
         fmt::format("{:.2f} %", half_percent(joint.constant)), drive::to_string(joint.from),
         joint.from == drive::From::kLoad ? std::to_string(constants.logs.size()) : std::to_string(used),
         std::isfinite(joint.load_friction) ? fmt::format("{:.1f} %", 100.0 * joint.load_friction) : ""});
  }
  return table;
}

/// A row a log, a column a joint; what was not used is in brackets.
page::Table logs_table(const TorqueConstants& constants) {
  std::vector<std::string> headers{"log"};
  for (std::size_t j = 0; j < constants.joints.size(); ++j) headers.push_back(fmt::format("joint {}", j + 1));
  page::Table table(headers);
  for (const std::string& path : constants.logs) {
    std::vector<std::string> row{file_name_of(path)};
    for (const JointConstant& joint : constants.joints) {
      const auto log =
          std::find_if(joint.logs.begin(), joint.logs.end(), [&](const auto& l) { return l.log == path; });
      if (log == joint.logs.end()) {
        row.push_back("–");
        continue;
      }
      const std::string cell =
          fmt::format("{:.3f} ± {:.1f} %", log->constant.value, half_percent(log->constant));
      row.push_back(log->agrees ? cell : "(" + cell + ")");
    }
    table.add_row(row);
  }
  return table;
}

std::string unknown_in_words(const TorqueConstants& constants) {
  std::string text;
  for (std::size_t j = 0; j < constants.joints.size(); ++j) {
    if (!constants.joints[j].known())
      text += fmt::format("Joint {}: {}.\n", j + 1, constants.joints[j].missing);
  }
  return text;
}

/// As --torque-constant takes them; empty when a joint is not known.
std::string option_in_words(const TorqueConstants& constants) {
  std::string list;
  for (const JointConstant& joint : constants.joints) {
    if (!joint.known()) return "";
    list += fmt::format("{}{:.4g}", list.empty() ? "" : ",", joint.constant.value);
  }
  return fmt::format("As an option: --torque-constant {}\n", list);
}

std::string notes_in_words(const TorqueConstants& constants) {
  std::string text;
  for (const std::string& note : constants.notes) text += note + "\n";
  return text;
}

}  // namespace

std::string brief(const TorqueConstants& constants) {
  std::vector<int> known;
  double widest = 0.0;
  for (std::size_t j = 0; j < constants.joints.size(); ++j) {
    if (!constants.joints[j].known()) continue;
    known.push_back(static_cast<int>(j));
    widest = std::max(widest, half_percent(constants.joints[j].constant));
  }
  if (known.empty()) return "The logs show the torque constant of no joint.";
  return fmt::format("The torque constant{} of {} {} known to ±{:.2g} %{}.", known.size() == 1 ? "" : "s",
                     known.size() == constants.joints.size() ? "all joints" : host::joints_in_words(known),
                     known.size() == 1 ? "is" : "are", widest, known.size() == 1 ? "" : " or better");
}

std::string full(const TorqueConstants& constants) {
  return fmt::format("{}\n{}{}{}{}{}", brief(constants), verdict_text(constants.judgement),
                     constants_table(constants).to_text(2), unknown_in_words(constants),
                     notes_in_words(constants), option_in_words(constants));
}

std::string json(const TorqueConstants& constants) {
  nlohmann::ordered_json json;
  put_verdict(json, constants.judgement);
  json["logs"] = constants.logs;
  json["joints"] = nlohmann::ordered_json::array();
  for (std::size_t j = 0; j < constants.joints.size(); ++j) {
    const JointConstant& joint = constants.joints[j];
    nlohmann::ordered_json entry{{"joint", j + 1},
                                 {"value", host::number_or_null(joint.constant.value)},
                                 {"low", host::number_or_null(joint.constant.lower)},
                                 {"high", host::number_or_null(joint.constant.upper)},
                                 {"from", joint.known() ? nlohmann::ordered_json(drive::to_string(joint.from))
                                                        : nlohmann::ordered_json(nullptr)},
                                 {"load_friction", host::number_or_null(joint.load_friction)},
                                 {"missing", joint.missing}};
    entry["logs"] = nlohmann::ordered_json::array();
    for (const drive::LogConstant& log : joint.logs) {
      entry["logs"].push_back({{"log", log.log},
                               {"value", host::number_or_null(log.constant.value)},
                               {"half_width_95", host::number_or_null(log.constant.half_width())},
                               {"used", log.agrees}});
    }
    json["joints"].push_back(std::move(entry));
  }
  json["notes"] = constants.notes;
  return text_of(json);
}

page::Page page(const TorqueConstants& constants) {
  page::Page page = page::new_page("Torque constants", file_names_of(constants.logs));
  page.verdict(brief(constants), constants.judgement);
  page.table(constants_table(constants), "Torque constants by joint");
  const std::string unknown = unknown_in_words(constants);
  if (!unknown.empty()) page.paragraph(unknown);
  const bool by_log = std::any_of(constants.joints.begin(), constants.joints.end(),
                                  [](const JointConstant& joint) { return !joint.logs.empty(); });
  if (by_log) page.table(logs_table(constants), "K [N·m/A] of each log by itself; in brackets: not used");
  for (const std::string& note : constants.notes) page.note(note);
  page.note(
      "Friction by load is friction that grows with the target torque, as a share of it: it adds to the torque in one "
      "direction and takes from it in the other, and would pass for another constant if it were left out.");
  return page;
}

}  // namespace heft::report
