// The load of a live stream, in lines.
#include <array>
#include <cmath>
#include <cstddef>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "heft/host/numbers.hpp"
#include "heft/report/payload.hpp"
#include "host/json.hpp"
#include "page_lines.hpp"
#include "payload_changes.hpp"

namespace heft::report {
namespace {

using Kind = payload::LiveEvent::Kind;
using nlohmann::ordered_json;
using payload::LoadValue;

/// "2.76 kg ± 0.31 kg (95 %)".
std::string mass_words(const LoadValue& load) {
  return fmt::format("{} kg ± {} kg (95 %)", page::number(load.mass.value, 3),
                     page::number(load.mass.half_width(), 2));
}

bool weighs(const LoadValue& load) { return load.mass.lower > 0.0; }

/// The same with the centre of mass, or that there is none.
std::string load_words(const LoadValue& load) {
  if (!weighs(load)) return fmt::format("no load, {}", mass_words(load));
  return fmt::format("{}, centre of mass at {}, {}, {} m", mass_words(load),
                     page::number(load.com[0].value, 2), page::number(load.com[1].value, 2),
                     page::number(load.com[2].value, 2));
}

std::string before_words(const LoadValue& load) {
  return weighs(load) ? mass_words(load) : "no load, " + mass_words(load);
}

struct Words {
  Kind kind;
  const char* json;
};
constexpr std::array<Words, 9> kWords{{{Kind::kKnown, "known"},
                                       {Kind::kChange, "change"},
                                       {Kind::kAttached, "attached"},
                                       {Kind::kDetached, "detached"},
                                       {Kind::kReplaced, "replaced"},
                                       {Kind::kUnchanged, "unchanged"},
                                       {Kind::kCorrected, "corrected"},
                                       {Kind::kImpossible, "impossible"},
                                       {Kind::kRefused, "refused"}}};

const char* name_of(Kind kind) {
  for (const Words& words : kWords) {
    if (words.kind == kind) return words.json;
  }
  return "unknown";
}

ordered_json mass_json(const LoadValue& load) {
  return {{"value", host::number_or_null(load.mass.value)},
          {"std", host::number_or_null(load.mass.std)},
          {"half_width_95", host::number_or_null(load.mass.half_width())}};
}

/// Mass and centre of mass; null where there is no load to have one.
ordered_json load_json(const LoadValue& load) {
  Eigen::Vector3d value, half;
  for (std::size_t a = 0; a < 3; ++a) {
    value[static_cast<Eigen::Index>(a)] = weighs(load) ? load.com[a].value : kNaN;
    half[static_cast<Eigen::Index>(a)] = weighs(load) ? load.com[a].half_width() : kNaN;
  }
  return {{"mass", mass_json(load)},
          {"com", {{"value", host::json_array(value)}, {"half_width_95", host::json_array(half)}}}};
}

std::string what_happened(const payload::LiveEvent& event) {
  switch (event.kind) {
    case Kind::kKnown: return "the load: " + load_words(event.load);
    case Kind::kChange: return fmt::format("the load changes; it was {}", before_words(event.before));
    case Kind::kAttached: return fmt::format("attached at {:.3f} s: {}", event.since, load_words(event.load));
    case Kind::kDetached:
      return fmt::format("detached at {:.3f} s: {}; it was {}", event.since, load_words(event.load),
                         before_words(event.before));
    case Kind::kReplaced:
      return fmt::format("replaced at {:.3f} s: {}; it was {}", event.since, load_words(event.load),
                         before_words(event.before));
    case Kind::kUnchanged:
      return fmt::format("the load is what it was before {:.3f} s: {}; a contact or another disturbance",
                         event.since, load_words(event.load));
    case Kind::kCorrected:
      return fmt::format("the load, corrected: {}; stated before: {}", load_words(event.load),
                         before_words(event.before));
    case Kind::kImpossible:
      return fmt::format("no load can be {}: the model is not that of this arm without load",
                         mass_words(event.load));
    case Kind::kRefused:
      return fmt::format(
          "joint {}: torque, velocity or step more than five times its limit; the row is left out, and those like it behind it",
          event.joint + 1);
  }
  return "unknown event";
}

}  // namespace

std::string brief(const payload::LiveEvent& event) {
  return fmt::format("{:.3f} s: {}", event.time, what_happened(event));
}

std::string json(const payload::LiveEvent& event) {
  ordered_json line{{"event", name_of(event.kind)}, {"time", event.time}};
  if (event.kind == Kind::kRefused) {
    line["joint"] = event.joint + 1;
    return line.dump();
  }
  line["since"] = event.since;
  if (event.kind != Kind::kChange) line.update(load_json(event.load));
  if (event.kind != Kind::kKnown && event.kind != Kind::kImpossible) line["before"] = load_json(event.before);
  return line.dump();
}

std::string brief(const payload::LiveSummary& summary) {
  const std::string load =
      !summary.load ? "No load was determined"
      : !summary.unanswered.empty()
          ? fmt::format("The load is not known at the end; it was {}", before_words(*summary.load))
      : summary.changing ? fmt::format("The load changed at the end and is not known again; it was {}",
                                       before_words(*summary.load))
      : weighs(*summary.load)
          ? fmt::format("The load since {:.3f} s: {}", summary.load_since, load_words(*summary.load))
          : fmt::format("No load: {}", mass_words(*summary.load));
  const std::size_t changes = summary.changes.size();
  return fmt::format("{}; {} in {:.1f} s; {} samples taken, {} refused.", load,
                     changes == 0   ? "no change"
                     : changes == 1 ? "1 change"
                                    : fmt::format("{} changes", changes),
                     summary.seconds, summary.samples, summary.refused);
}

std::string json(const payload::LiveSummary& summary) {
  ordered_json line{{"event", "end_of_stream"},
                    {"seconds", summary.seconds},
                    {"samples", summary.samples},
                    {"refused", summary.refused}};
  line.update(load_json(summary.load.value_or(LoadValue{})));
  line["mass"]["identifiable"] = summary.load.has_value() && !summary.changing && summary.unanswered.empty();
  line["load_since"] = summary.load_since;
  line["changing"] = summary.changing;
  line["changes"] = changes_json(summary.changes);
  if (!summary.unanswered.empty()) line["missing"] = summary.unanswered;
  return line.dump();
}

}  // namespace heft::report
