#include "column_words.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <initializer_list>

#include <fmt/format.h>

#include "csv_fields.hpp"
#include "heft/host/error.hpp"

namespace heft::data {
namespace {

constexpr std::array kGroups{
    ColumnGroup{"time", "time", Quantity::kTime},
    ColumnGroup{"q", "positions", Quantity::kPosition},
    ColumnGroup{"tau", "torques", Quantity::kTorque},
    ColumnGroup{"i", "currents", Quantity::kCurrent},
    ColumnGroup{"qd", "velocities", Quantity::kVelocity},
    ColumnGroup{"qdd", "accelerations", Quantity::kAcceleration},
    ColumnGroup{"qref", "position references", Quantity::kPosition},
    ColumnGroup{"qdref", "velocity references", Quantity::kVelocity},
    ColumnGroup{"temp", "temperatures", Quantity::kTemperature},
    ColumnGroup{"tauref", "target torques", Quantity::kTorque},
    ColumnGroup{"iref", "target currents", Quantity::kCurrent},
    ColumnGroup{"qlink", "positions behind the gear", Quantity::kPosition},
    ColumnGroup{"taulink", "torques behind the gear", Quantity::kTorque},
};

/// What other programs call a group; lower case, without what says measured or desired.
struct Synonym {
  std::string_view word;
  std::string_view group;
  bool weak{false};
};
constexpr std::array kSynonyms{
    Synonym{"q", "q"},
    Synonym{"pos", "q"},
    Synonym{"position", "q"},
    Synonym{"positions", "q"},
    Synonym{"angle", "q", true},
    Synonym{"angles", "q", true},
    Synonym{"theta", "q", true},
    Synonym{"jpos", "q"},
    Synonym{"qd", "qd"},
    Synonym{"dq", "qd"},
    Synonym{"qdot", "qd"},
    Synonym{"q_dot", "qd"},
    Synonym{"vel", "qd"},
    Synonym{"velocity", "qd"},
    Synonym{"velocities", "qd"},
    Synonym{"speed", "qd"},
    Synonym{"speeds", "qd"},
    Synonym{"jvel", "qd"},
    Synonym{"omega", "qd", true},
    Synonym{"qdd", "qdd"},
    Synonym{"ddq", "qdd"},
    Synonym{"qddot", "qdd"},
    Synonym{"q_ddot", "qdd"},
    Synonym{"acc", "qdd"},
    Synonym{"acceleration", "qdd"},
    Synonym{"accelerations", "qdd"},
    Synonym{"tau", "tau"},
    Synonym{"tau_j", "tau"},  // libfranka: measured at the joint, with gravity
    Synonym{"torque", "tau"},
    Synonym{"torques", "tau"},
    Synonym{"effort", "tau"},
    Synonym{"efforts", "tau"},
    Synonym{"trq", "tau"},
    Synonym{"moment", "tau", true},
    Synonym{"current_as_torque", "tau"},  // UR: actual_current_as_torque
    Synonym{"i", "i"},
    Synonym{"current", "i"},
    Synonym{"currents", "i"},
    Synonym{"cur", "i"},
    Synonym{"temp", "temp"},
    Synonym{"temps", "temp"},
    Synonym{"temperature", "temp"},
    Synonym{"temperatures", "temp"},
    Synonym{"q_d", "qref"},    // libfranka: desired
    Synonym{"dq_d", "qdref"},  // likewise
    Synonym{"qref", "qref"},
    Synonym{"qdref", "qdref"},
    Synonym{"tauref", "tauref"},
    Synonym{"iref", "iref"},
    Synonym{"qlink", "qlink"},
    Synonym{"taulink", "taulink"},
};

/// Words around a synonym that say it was measured, or what moves.
constexpr std::array<std::string_view, 11> kMeasured{
    "actual", "measured", "meas", "act", "joint", "joints", "feedback", "fb", "present", "sensed", "robot"};
/// Words that say it was asked for.
constexpr std::array<std::string_view, 12> kDesired{"target", "desired",  "des",       "commanded",
                                                    "ref",    "command",  "reference", "setpoint",
                                                    "goal",   "commands", "cmd",       "setpoints"};

template <std::size_t N>
bool is_one_of(std::string_view word, const std::array<std::string_view, N>& words) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

/// Lower case, with "_" for spaces and dashes, without what stands before the first letter.
std::string plain(std::string_view text) {
  std::string result;
  for (const char c : text) {
    result += c == ' ' || c == '-' ? '_' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  const std::size_t first = result.find_first_not_of("/._%#");
  result.erase(0, std::min(first, result.size()));
  while (!result.empty() && (result.back() == '_' || result.back() == '/' || result.back() == '.'))
    result.pop_back();
  return result;
}

/// The group asked for where `group` is the measured one; null: heft has none.
const ColumnGroup* desired(const ColumnGroup& group) {
  if (group.name == "q" || group.name == "qd" || group.name == "tau" || group.name == "i")
    return find_group(fmt::format("{}ref", group.name));
  return nullptr;
}

/// A word of a header such as "target_q" or "joint_temperatures", without number and path.
std::optional<HeaderWords> words_of_word(std::string_view word) {
  bool is_desired = false, is_motor = false;
  for (;;) {
    for (const Synonym& synonym : kSynonyms) {
      if (word != synonym.word) continue;
      HeaderWords words;
      words.group = find_group(synonym.group);
      words.kind = synonym.weak ? NameKind::kWeak : NameKind::kNamed;
      // A motor's position is in front of the gear.
      if (is_motor &&
          (words.group->quantity == Quantity::kPosition || words.group->quantity == Quantity::kVelocity ||
           words.group->quantity == Quantity::kAcceleration))
        return {};
      if (is_desired) words.group = desired(*words.group);
      if (words.group == nullptr) return {};
      return words;
    }
    const std::size_t first = word.find('_'), last = word.rfind('_');
    if (first == std::string_view::npos) return {};
    const std::string_view front = word.substr(0, first), back = word.substr(last + 1);
    if (is_one_of(front, kMeasured) || front == "motor") {
      is_motor = is_motor || front == "motor";
      word.remove_prefix(first + 1);
    } else if (is_one_of(back, kMeasured)) {
      word = word.substr(0, last);
    } else if (!is_desired && is_one_of(front, kDesired)) {
      is_desired = true;
      word.remove_prefix(first + 1);
    } else if (!is_desired && is_one_of(back, kDesired)) {
      is_desired = true;
      word = word.substr(0, last);
    } else if (front == "current") {  // position
      word.remove_prefix(first + 1);
    } else {
      return {};
    }
  }
}

/// A path such as "/joint_states/position" or "state.tau_J", in plain words.
std::optional<HeaderWords> words_of_path(std::string_view path) {
  const std::size_t cut = path.find_last_of("/.");
  std::optional<HeaderWords> words =
      words_of_word(cut == std::string_view::npos ? path : path.substr(cut + 1));
  if (!words || cut == std::string_view::npos) return words;
  for (std::string_view before = path.substr(0, cut);;) {
    const std::size_t end = before.find_last_of("/.");
    const std::string_view part = end == std::string_view::npos ? before : before.substr(end + 1);
    // libfranka's cmd is the command of the row before, and an error is no position.
    if (part == "cmd" || part == "error") return {};
    if (is_one_of(part, kDesired)) {
      words->group = desired(*words->group);
      if (words->group == nullptr) return {};
      return words;
    }
    if (end == std::string_view::npos) return words;
    before = before.substr(0, end);
  }
}

bool ends_with_part(std::string_view path, std::string_view end) {
  if (!path.ends_with(end)) return false;
  if (path.size() == end.size()) return true;
  const char before = path[path.size() - end.size() - 1];
  return before == '/' || before == '.' || before == '_';
}

/// Time stamps of other programs.
std::optional<HeaderWords> words_of_time(std::string_view raw, const std::string& path) {
  HeaderWords words;
  words.group = find_group("time");
  // rostopic echo -p puts the time of receipt into "%time"; all its stamps are nanoseconds.
  if (raw == "%time" || path == "rosbagtimestamp") {
    words.kind = NameKind::kReceipt;
    words.unit = find_unit("ns", Quantity::kTime);
    return words;
  }
  for (const std::string_view seconds :
       {"stamp.secs", "stamp.sec", "stamp/secs", "stamp/sec", "stamp_sec", "stamp_secs"}) {
    if (!ends_with_part(path, seconds)) continue;
    words.seconds_part = true;
    return words;
  }
  for (const std::string_view part : {"stamp.nsecs", "stamp.nanosec", "stamp.nsec", "stamp/nsecs",
                                      "stamp/nanosec", "stamp/nsec", "stamp_nanosec", "stamp_nsecs"}) {
    if (!ends_with_part(path, part)) continue;
    words.nanoseconds_part = true;
    return words;
  }
  if (ends_with_part(path, "header.stamp") || ends_with_part(path, "header/stamp")) {
    if (path.starts_with("field.")) words.unit = find_unit("ns", Quantity::kTime);
    return words;
  }
  for (const std::string_view name : {"time", "t", "timestamp", "timestamps", "stamp", "elapsed",
                                      "elapsed_time", "seconds", "secs", "time_stamp", "robot_time"}) {
    if (path != name) continue;
    // PlotJuggler's own column beside those of the message.
    words.kind = raw.starts_with("__") ? NameKind::kReceipt : NameKind::kNamed;
    return words;
  }
  return {};
}

/// The number at the end of a name: "[2]", "(2)", "_2", ".2" or "2".
void take_index(HeaderParts& parts) {
  std::string_view name = parts.name;
  const bool bracketed = name.ends_with(']') || name.ends_with(')');
  if (bracketed) name.remove_suffix(1);
  std::size_t digits = 0;
  while (digits < name.size() && digits < 4 &&
         std::isdigit(static_cast<unsigned char>(name[name.size() - 1 - digits])))
    ++digits;
  parts.stem = parts.name;
  if (digits == 0 || digits == name.size() || digits > 3) return;
  std::string_view stem = name.substr(0, name.size() - digits);
  const char before = stem.back();
  if (bracketed != (before == '[' || before == '(')) return;
  std::from_chars(name.data() + stem.size(), name.data() + name.size(), parts.index);
  if (bracketed || before == '_' || before == '.' || before == '/' || before == ' ') stem.remove_suffix(1);
  parts.stem = stem;
  if (parts.stem.empty()) parts.index = -1;
}

/// "joint1_pos", "A1 torque", "axis_2.velocity": the number in front. @return the rest, "" when it is none of these
std::string take_number_in_front(const std::string& path, int& index) {
  for (const std::string_view word : {"joint", "axis", "motor", "j", "a"}) {
    std::string_view rest = path;
    if (!rest.starts_with(word)) continue;
    rest.remove_prefix(word.size());
    if (rest.starts_with('_')) rest.remove_prefix(1);
    const auto [end, error] = std::from_chars(rest.data(), rest.data() + rest.size(), index);
    if (error != std::errc() || index < 0) continue;
    rest.remove_prefix(static_cast<std::size_t>(end - rest.data()));
    if (rest.size() < 2 || (rest.front() != '_' && rest.front() != '.' && rest.front() != '/')) continue;
    return std::string(word == "motor" ? "motor_" : "") + std::string(rest.substr(1));
  }
  return {};
}

/// The unit that a name ends in: "time_ms", "q_deg". @return the name without it
std::string_view take_unit_behind(std::string_view name, std::string_view& symbol) {
  const std::size_t cut = name.rfind('_');
  if (cut == std::string_view::npos || cut == 0) return name;
  symbol = name.substr(cut + 1);
  if (symbol == "s2" || symbol == "s") {  // "qd_rad_s"
    const std::size_t earlier = name.rfind('_', cut - 1);
    if (earlier != std::string_view::npos && earlier > 0 && is_unit(name.substr(earlier + 1))) {
      symbol = name.substr(earlier + 1);
      return name.substr(0, earlier);
    }
  }
  return name.substr(0, cut);
}

/// The joint of the robot that a header names. @return the header without it
std::string take_joint(std::string_view header, std::span<const std::string> joints, std::string& joint) {
  std::size_t at = std::string_view::npos;
  for (const std::string& name : joints) {
    if (name.size() <= joint.size()) continue;  // "joint1" is in "joint10"
    for (std::size_t k = header.find(name); k != std::string_view::npos; k = header.find(name, k + 1)) {
      const auto is_inside = [&](std::size_t place) {
        return place < header.size() && std::isalnum(static_cast<unsigned char>(header[place])) != 0;
      };
      if ((k > 0 && is_inside(k - 1)) || is_inside(k + name.size())) continue;
      joint = name;
      at = k;
      break;
    }
  }
  if (joint.empty()) return {};
  std::string before = plain(header.substr(0, at)), behind = plain(header.substr(at + joint.size()));
  if (behind.empty() || before.empty()) return before + behind;
  return before + "/" + behind;
}

/// "/joint_states/elbow_joint/position", "elbow.pos" of a robot whose joints are not known.
std::optional<HeaderWords> words_of_unknown_joint(const std::string& name) {
  const std::size_t cut = name.find_last_of("/.");
  if (cut == std::string::npos || cut == 0) return {};
  std::optional<HeaderWords> words = words_of_word(plain(std::string_view(name).substr(cut + 1)));
  if (!words) return {};
  const std::size_t earlier = name.find_last_of("/.", cut - 1);
  words->joint = name.substr(earlier == std::string::npos ? 0 : earlier + 1,
                             cut - (earlier == std::string::npos ? 0 : earlier + 1));
  return words;
}

/// What the name of a column means, the unit in brackets taken off.
std::optional<HeaderWords> words_of_name(const HeaderParts& parts, std::span<const std::string> joints) {
  const std::string path = plain(parts.name);
  if (std::optional<HeaderWords> time = words_of_time(parts.name, path)) return time;
  std::string joint;
  if (const std::string rest = take_joint(parts.name, joints, joint); !joint.empty()) {
    if (std::optional<HeaderWords> words = words_of_path(rest)) {
      words->joint = joint;
      return words;
    }
  }
  if (parts.index >= 0) {
    if (std::optional<HeaderWords> words = words_of_path(plain(parts.stem))) {
      words->index = parts.index;
      return words;
    }
  }
  int index = -1;
  if (const std::string rest = take_number_in_front(path, index); !rest.empty()) {
    if (std::optional<HeaderWords> words = words_of_path(rest)) {
      words->index = index;
      return words;
    }
  }
  return words_of_unknown_joint(parts.name);
}

}  // namespace

std::span<const ColumnGroup> column_groups() { return kGroups; }

const ColumnGroup* find_group(std::string_view name) {
  for (const ColumnGroup& group : kGroups) {
    if (group.name == name) return &group;
  }
  return nullptr;
}

int joint_number(std::string_view name, std::string_view prefix) {
  if (name.size() <= prefix.size() || name.substr(0, prefix.size()) != prefix) return 0;
  name.remove_prefix(prefix.size());
  if (name.front() == '0' || name.size() > 4) return 0;
  int number = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  return (error == std::errc() && end == name.data() + name.size() && number > 0) ? number : 0;
}

HeaderParts parts_of(std::string_view header) {
  HeaderParts parts;
  parts.name = trim(header);
  const bool square = parts.name.ends_with(']'), round = parts.name.ends_with(')');
  if (square || round) {
    const std::size_t open = parts.name.rfind(square ? '[' : '(');
    if (open != std::string::npos && open > 0) {
      const std::string inside(
          trim(std::string_view(parts.name).substr(open + 1, parts.name.size() - open - 2)));
      const bool number = !inside.empty() && std::all_of(inside.begin(), inside.end(), [](char c) {
        return std::isdigit(static_cast<unsigned char>(c)) != 0;
      });
      if (!number && !inside.empty()) {
        parts.symbol = inside;
        parts.name = trim(std::string_view(parts.name).substr(0, open));
      }
    }
  }
  take_index(parts);
  return parts;
}

const ColumnUnit* unit_of(std::string_view header, const HeaderParts& parts, const ColumnGroup& group,
                          std::string_view where) {
  if (parts.symbol.empty() || parts.symbol == "-" || parts.symbol == "1") return nullptr;
  const ColumnUnit* const unit = find_unit(parts.symbol, group.quantity);
  if (unit == nullptr) {
    throw DataError(fmt::format(
        "{}{}column '{}': found the unit '{}'; expected one of {} for {}; convert the column, or take the unit out of the "
        "header if the numbers are in SI units",
        where, where.empty() ? "" : ": ", shown(header), shown(parts.symbol), known_units(group.quantity),
        group.words));
  }
  return unit;
}

std::optional<HeaderWords> words_of(std::string_view header, std::span<const std::string> joints,
                                    std::string_view where) {
  HeaderParts parts = parts_of(header);
  for (const ColumnGroup& group : kGroups) {  // heft's own, to the letter
    const bool is_time = group.quantity == Quantity::kTime;
    const bool first = !is_time && parts.name == fmt::format("{}0", group.name);
    const int joint = is_time ? 0 : joint_number(parts.name, group.name);
    if (is_time ? parts.name != "time" : joint == 0 && !first) continue;
    HeaderWords words;
    words.group = &group;
    words.kind = NameKind::kHeft;
    if (!is_time) words.index = joint;
    words.unit = unit_of(header, parts, group, where);
    return words;
  }
  std::optional<HeaderWords> words = words_of_name(parts, joints);
  if (words) {
    if (words->unit == nullptr) words->unit = unit_of(header, parts, *words->group, where);
    return words;
  }
  // "time_ms", "q_0_deg", "pos_deg_0": a unit behind the name or in front of its number.
  std::string_view symbol;
  HeaderParts shorter = parts;
  const std::string name = parts.name, stem = parts.stem;
  shorter.name = take_unit_behind(name, symbol);
  if (shorter.name != name && is_unit(symbol)) {
    take_index(shorter);
    shorter.symbol = symbol;
    if (joint_number(shorter.name, "q") > 0 || shorter.index >= 0 || shorter.name.size() < name.size())
      words = words_of_name(shorter, joints);
  }
  if (!words && parts.index >= 0) {
    shorter = parts;
    shorter.stem = take_unit_behind(stem, symbol);
    if (shorter.stem == stem || !is_unit(symbol)) return {};
    shorter.symbol = symbol;
    shorter.name = fmt::format("{}[{}]", shorter.stem, parts.index);
    words = words_of_name(shorter, joints);
  }
  if (!words) return {};
  const ColumnUnit* const unit = find_unit(symbol, words->group->quantity);
  if (unit == nullptr) return {};  // "_s" may be anything
  words->unit = unit;
  return words;
}

}  // namespace heft::data
