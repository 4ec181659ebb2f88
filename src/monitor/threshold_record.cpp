#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "heft/monitor/monitor.hpp"
#include "host/json.hpp"

namespace heft::monitor {
namespace {

using host::Json;
using Node = host::JsonValue;

/// Field of the model file that holds the thresholds.
constexpr const char* kField = "contact_thresholds";

Json others_of(const model::ModelFile& file) {
  return file.other_fields.empty() ? Json::object() : host::parse_json(file.other_fields, file.path);
}

double above_zero(const Node& node, const char* key) {
  constexpr const char* kExpected = "a number above 0, as heft monitor --learn writes it";
  const Node value = node.at(key, kExpected);
  const double number = value.number();
  if (!(number > 0)) value.fail(fmt::format("found {}", number), kExpected);
  return number;
}

double not_negative(const Node& node, const char* key) {
  const Node value = node.at(key, "0 or more");
  const double number = value.number();
  if (number < 0) value.fail(fmt::format("found {}", number), "0 or more");
  return number;
}

}  // namespace

model::ModelFile Thresholds::model_file(model::ModelFile model) const {
  Json others = others_of(model);
  Json list = Json::array();
  for (const JointThreshold<double>& joint : joints) {
    Json entry = Json::object();
    for (const ThresholdField& field : kThresholdFields) entry[field.name] = joint.*field.value;
    list.push_back(std::move(entry));
  }
  others[kField] = {
      {"bandwidth", bandwidth},
      {"adaptation", adaptation},
      {"turning_time", turning_time},
      {"load_rate", load_rate},
      {"largest_step", largest_step},
      {"torque_at", torque_at},
      {"joints", list},
      {"asked_per_hour", asked_rate},
      {"expected_per_hour",
       {{"value", expected.value}, {"low", expected.lower}, {"high", host::number_or_null(expected.upper)}}},
      {"hours", hours},
      {"logs", logs},
      {"verdict", host::to_string(judgement.verdict)},
      {"reasons", judgement.reasons}};
  model.other_fields = others.dump(-1, ' ', false, Json::error_handler_t::replace);
  return model;
}

std::optional<Thresholds> thresholds_of(const model::ModelFile& file) {
  const Json others = others_of(file);
  if (!others.contains(kField)) return std::nullopt;
  const Node node(others[kField], file.path, std::string("/") + kField);
  Thresholds thresholds;
  thresholds.bandwidth = above_zero(node, "bandwidth");
  thresholds.adaptation = above_zero(node, "adaptation");
  thresholds.turning_time = not_negative(node, "turning_time");
  thresholds.load_rate = above_zero(node, "load_rate");
  thresholds.largest_step = above_zero(node, "largest_step");
  const Node at = node.at("torque_at", "\"motor\" or \"joint\"");
  thresholds.torque_at = at.text();
  if (thresholds.torque_at != "motor" && thresholds.torque_at != "joint")
    at.fail(fmt::format("found \"{}\"", thresholds.torque_at), "\"motor\" or \"joint\"");
  const Node list = node.at("joints", "a list with one entry a joint");
  list.expect_size(static_cast<std::size_t>(file.num_joints()),
                   fmt::format("{}, one a joint", file.num_joints()));
  for (std::size_t j = 0; j < static_cast<std::size_t>(file.num_joints()); ++j) {
    const Node entry = list.at(j);
    JointThreshold<double>& joint = thresholds.joints.emplace_back();
    for (const ThresholdField& field : kThresholdFields) joint.*field.value = above_zero(entry, field.name);
  }
  thresholds.asked_rate = node.number_or("asked_per_hour", thresholds.asked_rate);
  if (node.has("expected_per_hour")) {
    const Node expected = node.at("expected_per_hour", "an object");
    thresholds.expected = {expected.number_or_zero("value"), kNaN, expected.number_or_zero("low"),
                           expected.number_or("high", kInfinity)};
  }
  thresholds.hours = node.number_or_zero("hours");
  thresholds.logs = node.texts_or_empty("logs");
  const std::string verdict = node.text_or_empty("verdict");
  for (const std::string& reason : node.texts_or_empty("reasons"))
    thresholds.judgement.add(verdict == "bad" ? host::Verdict::kBad : host::Verdict::kDoubtful, reason);
  return thresholds;
}

}  // namespace heft::monitor
