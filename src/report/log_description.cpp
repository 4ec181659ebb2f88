#include "heft/report/log_description.hpp"

#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "heft/page/page.hpp"
#include "host/json.hpp"
#include "page_lines.hpp"

namespace heft::report {
namespace {

using data::DescribedColumn;
using data::LogDescription;
using data::TorqueKind;

const char* word_of(TorqueKind kind) {
  switch (kind) {
    case TorqueKind::kNone: return "none";
    case TorqueKind::kMeasured: return "measured";
    case TorqueKind::kReference: return "equal to the target";
    case TorqueKind::kRepeated: return "repeated";
    case TorqueKind::kCurrent: return "from current";
  }
  return "";
}

std::string torque_in_words(const LogDescription& log) {
  switch (log.torque) {
    case TorqueKind::kNone: return "";
    case TorqueKind::kMeasured:
      return "Torque: nothing in the log shows that it was not measured. The log does not say where: --torque-at joint for a "
             "sensor behind the gear, motor otherwise; with --urdf it is compared with the robot (sign, unit, gravity).\n";
    case TorqueKind::kReference:
      return "Torque: equal to the target torque (tauref1..) to the last bit: commanded, not measured. A fit to it returns the "
             "controller's own model.\n";
    case TorqueKind::kRepeated:
      return fmt::format(
          "Torque: the same to the last bit in {}, of another motion: commanded, not measured.\n",
          log.repeated_in);
    case TorqueKind::kCurrent:
      return fmt::format(
          "Torque: a constant times the current in every joint ({:.4g} N·m/A): made of the current, no torque "
          "sensor.\n",
          fmt::join(log.torque_constant, ", "));
  }
  return "";
}

/// "× 0.01745" and the like; empty for SI.
std::string conversion_in_words(const DescribedColumn& column) {
  std::string text = column.factor == 1.0 ? "" : fmt::format("× {:.4g}", column.factor);
  if (column.shift != 0.0) text += fmt::format("{}{:+.5g}", text.empty() ? "" : " ", column.shift);
  return text;
}

page::Table columns_table(const LogDescription& log) {
  page::Table table({"column", "of the file", "to SI", "least", "most", ""});
  for (const DescribedColumn& column : log.columns) {
    table.add_row({column.name, column.origin == column.name ? "" : column.origin,
                   conversion_in_words(column), column.numbers ? page::number(column.least, 4) : "",
                   column.numbers ? page::number(column.most, 4) : "",
                   !column.numbers ? "text"
                   : column.known  ? ""
                                   : "not used"});
  }
  return table;
}

std::string time_in_words(const LogDescription& log) {
  if (!(log.period > 0.0)) return "";
  // Stamps scatter; a step of half as much again is a row that is missing.
  constexpr double kStep = 1.5;
  std::string text = fmt::format("Time: {:.6g} s to {:.6g} s, a row every {:.4g} s ({:.4g} Hz)", log.begin,
                                 log.end, log.period, 1.0 / log.period);
  if (log.longest_period > kStep * log.period)
    text += fmt::format(", longest step {:.4g} s at {:.6g} s", log.longest_period, log.longest_from);
  if (log.gaps > 0)
    text += fmt::format("; {} gap{} of more than ten rows", log.gaps, log.gaps == 1 ? "" : "s");
  if (log.backwards > 0)
    text += fmt::format("; time does not increase at {} rows, which no command takes", log.backwards);
  return text + "\n";
}

}  // namespace

std::string brief(const LogDescription& log) {
  std::string text = fmt::format("{}: {}, {} rows", log.path, log.format, log.rows);
  if (log.num_joints > 0)
    text += fmt::format(" of {} joint{}", log.num_joints, log.num_joints == 1 ? "" : "s");
  if (log.period > 0.0)
    text += fmt::format(" at {:.4g} Hz over {:.4g} s", 1.0 / log.period, log.end - log.begin);
  return text;
}

std::string full(const LogDescription& log) {
  std::string text = brief(log) + "\n";
  if (!log.understood.empty()) text += fmt::format("Understood as: {}\n", log.understood);
  text += columns_table(log).to_text(2) + time_in_words(log) + torque_in_words(log);
  for (const data::LogFinding& finding : log.findings)
    text += fmt::format("{}: {}\n", finding.severity == data::Severity::kError ? "Wrong" : "Note",
                        finding.message);
  for (const std::string& note : log.notes) text += fmt::format("Note: {}\n", note);
  for (const data::Question& question : log.questions) {
    text += question.missing.empty()
                ? fmt::format("heft {}: nothing is missing\n", question.commands)
                : fmt::format("heft {}: missing {}\n", question.commands, question.missing);
  }
  return text;
}

std::string json(const std::vector<LogDescription>& logs) {
  using host::number_or_null;
  host::Json all = host::Json::array();
  for (const LogDescription& log : logs) {
    host::Json json;
    json["log"] = log.path;
    json["usable"] = log.usable();
    json["format"] = log.format;
    json["understood"] = log.understood;
    json["rows"] = log.rows;
    json["joints"] = log.num_joints;
    json["begin"] = log.begin;
    json["end"] = log.end;
    json["period"] = log.period;
    json["longest_period"] = log.longest_period;
    json["gaps"] = log.gaps;
    json["not_increasing"] = log.backwards;
    json["torque"] = word_of(log.torque);
    json["columns"] = host::Json::array();
    for (const DescribedColumn& column : log.columns) {
      json["columns"].push_back({{"name", column.name},
                                 {"of_file", column.origin},
                                 {"factor", column.factor},
                                 {"shift", column.shift},
                                 {"known", column.known},
                                 {"numbers", column.numbers},
                                 {"least", number_or_null(column.least)},
                                 {"most", number_or_null(column.most)}});
    }
    json["missing"] = host::Json::object();
    for (const data::Question& question : log.questions)
      json["missing"][question.commands] = question.missing;
    json["findings"] = host::Json::array();
    for (const data::LogFinding& finding : log.findings) json["findings"].push_back(finding.message);
    json["notes"] = log.notes;
    all.push_back(std::move(json));
  }
  return host::Json({{"logs", std::move(all)}}).dump(2) + "\n";
}

std::string brief(const data::LogConversion& conversion) {
  std::string text = fmt::format("{} rows written", conversion.rows);
  if (conversion.left_out > 0)
    text += fmt::format(", {} without a partner in the other logs left out", conversion.left_out);
  if (conversion.largest_step > 0.0)
    text +=
        fmt::format("; stamps of rows that were joined differ by up to {:.3g} s", conversion.largest_step);
  return text;
}

}  // namespace heft::report
