#include <algorithm>
#include <charconv>
#include <map>
#include <optional>

#include <fmt/format.h>

#include "column_words.hpp"
#include "csv_fields.hpp"
#include "heft/host/error.hpp"
#include "log_reader.hpp"

namespace heft::data {
namespace {

using Words = std::vector<std::optional<HeaderWords>>;

std::string prefixed(std::string_view where) { return where.empty() ? "" : fmt::format("{}: ", where); }

std::string group_list() {
  std::string text;
  for (const ColumnGroup& group : column_groups())
    text += fmt::format("{}{}", text.empty() ? "" : ", ", group.name);
  return text;
}

/// The rate in "500Hz"; nothing when it is none.
std::optional<double> rate_in(std::string_view text) {
  if (!text.ends_with("Hz") && !text.ends_with("hz")) return {};
  text = trim(text.substr(0, text.size() - 2));
  double rate = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), rate);
  if (error != std::errc() || end != text.data() + text.size()) return {};
  return rate;
}

/// Whether a user may mean the stem of this header by `name`: all of it, or what stands behind its path.
bool is_called(const std::string& stem, std::string_view name) {
  if (stem == name) return true;
  if (stem.size() <= name.size() || !stem.ends_with(name)) return false;
  const char before = stem[stem.size() - name.size() - 1];
  return before == '/' || before == '.';
}

/// Puts what `as.map` says into `words`.
class Mapping {
 public:
  Mapping(const std::vector<std::string>& headers, const ReadAs& as, std::string_view where)
      : headers_(headers), as_(as), where_(where) {
    for (const std::string& header : headers) parts_.push_back(parts_of(header));
  }

  void apply(Words& words) const {
    for (const auto& [ours, theirs] : as_.map) {
      if (ours == "time" && rate_in(theirs)) continue;
      const auto [group, joint] = group_of(ours);
      const std::vector<std::size_t> columns = find(theirs, group->quantity == Quantity::kTime || joint > 0);
      for (const std::size_t c : columns) {
        HeaderWords mapped;
        mapped.group = group;
        mapped.kind = NameKind::kMapped;
        mapped.unit = unit_of(headers_[c], parts_[c], *group, where_);
        if (words[c]) {
          mapped.joint = words[c]->joint;
          if (mapped.unit == nullptr && words[c]->group->quantity == group->quantity)
            mapped.unit = words[c]->unit;
        }
        mapped.index = joint > 0 ? joint : mapped.joint.empty() ? std::max(parts_[c].index, 0) : -1;
        mapped.from_one = joint > 0;
        if (joint > 0) mapped.joint.clear();
        words[c] = mapped;
      }
    }
  }

 private:
  /// Group and joint, counted from 1, of heft's name; joint 0: the whole group.
  std::pair<const ColumnGroup*, int> group_of(const std::string& ours) const {
    for (const ColumnGroup& group : column_groups()) {
      if (ours == group.name) return {&group, 0};
      if (const int joint = joint_number(ours, group.name); joint > 0 && group.quantity != Quantity::kTime)
        return {&group, joint};
    }
    throw DataError(fmt::format(
        "{}--map {}: '{}' is no name of heft; expected one of {}, or one of them with the number of "
        "a joint behind it; write --map tau=effort: heft's name first",
        prefixed(where_), shown(ours), shown(ours), group_list()));
  }

  std::vector<std::size_t> find(const std::string& theirs, bool single) const {
    std::vector<std::size_t> columns;
    for (std::size_t c = 0; c < headers_.size(); ++c) {
      if (trim(headers_[c]) == theirs || parts_[c].name == theirs) return {c};
    }
    for (std::size_t c = 0; c < headers_.size() && !single; ++c) {
      if (parts_[c].index >= 0 && is_called(parts_[c].stem, theirs)) columns.push_back(c);
    }
    return columns;
  }

  const std::vector<std::string>& headers_;
  const ReadAs& as_;
  std::string_view where_;
  std::vector<HeaderParts> parts_;
};

/// Best first: what was said, heft's own name, the sender's stamp, any other, the time of receipt.
int time_rank(const HeaderWords& words, const std::string& header) {
  switch (words.kind) {
    case NameKind::kMapped: return 0;
    case NameKind::kHeft: return 1;
    case NameKind::kReceipt: return 4;
    default:
      return header.find("stamp") != std::string::npos && header.find("header") != std::string::npos ? 2 : 3;
  }
}

[[noreturn]] void refuse_two(std::string_view where, const std::string& first, const std::string& second,
                             const std::string& name, std::string_view group) {
  throw DataError(fmt::format(
      "{}columns '{}' and '{}' would both be {}; expected one; name the one to be used: --map {}={}",
      prefixed(where), shown(first), shown(second), name, group, shown(parts_of(first).stem)));
}

/// Keeps the best time stamp only.
void choose_time(const std::vector<std::string>& headers, std::string_view where, Words& words) {
  const auto is_time = [&](std::size_t c) {
    return words[c] && words[c]->group->quantity == Quantity::kTime;
  };
  int best = 9;
  for (std::size_t c = 0; c < headers.size(); ++c) {
    if (is_time(c) && !words[c]->nanoseconds_part) best = std::min(best, time_rank(*words[c], headers[c]));
  }
  std::optional<std::size_t> chosen, part;
  for (std::size_t c = 0; c < headers.size(); ++c) {
    if (!is_time(c)) continue;
    if (words[c]->nanoseconds_part) {
      part = part ? part : c;
      if (part != c) words[c].reset();
      continue;
    }
    if (time_rank(*words[c], headers[c]) != best) {
      words[c].reset();
      continue;
    }
    if (chosen) refuse_two(where, headers[*chosen], headers[c], "time", "time");
    chosen = c;
  }
  if (part && !(chosen && words[*chosen]->seconds_part)) words[*part].reset();
}

/// Joints from 1 of every column that has a number or a name of one.
class Joints {
 public:
  Joints(const ReadAs& as, Words& words) : as_(as), words_(words) {}

  void count() {
    drop_doubtful();
    number_names();
    number_indices();
  }

 private:
  bool has_joint(std::size_t c) const { return words_[c] && words_[c]->group->quantity != Quantity::kTime; }

  /// A worse kind of name beside a better one in a group: it is something else.
  void drop_doubtful() {
    std::map<const ColumnGroup*, NameKind> best;
    for (std::size_t c = 0; c < words_.size(); ++c) {
      if (!has_joint(c)) continue;
      const auto entry = best.try_emplace(words_[c]->group, words_[c]->kind).first;
      entry->second = std::min(entry->second, words_[c]->kind);
    }
    for (std::size_t c = 0; c < words_.size(); ++c) {
      if (has_joint(c) && words_[c]->kind != best[words_[c]->group]) words_[c].reset();
    }
  }

  bool is_of_robot(const std::string& joint) const {
    return std::find(as_.joint_names.begin(), as_.joint_names.end(), joint) != as_.joint_names.end();
  }

  /// In the robot's order. Where none of them is a joint of the robot, in the order of the columns if positions have such
  /// names ("tool.temperature" alone is of no joint).
  void number_names() {
    std::vector<std::string> order;
    bool of_robot = false, positions = false;
    std::map<const ColumnGroup*, bool> counted;
    for (std::size_t c = 0; c < words_.size(); ++c) {
      if (!has_joint(c)) continue;
      const std::string& joint = words_[c]->joint;
      counted[words_[c]->group] = counted[words_[c]->group] || joint.empty();
      of_robot = of_robot || (!joint.empty() && is_of_robot(joint));
      positions = positions || (!joint.empty() && words_[c]->group->name == "q");
    }
    for (std::size_t c = 0; c < words_.size(); ++c) {
      if (!has_joint(c) || words_[c]->joint.empty()) continue;
      const std::string& joint = words_[c]->joint;
      if (of_robot ? !is_of_robot(joint) : counted[words_[c]->group] || !positions) {
        words_[c].reset();
        continue;
      }
      const std::vector<std::string>& names = of_robot ? as_.joint_names : order;
      auto at = std::find(names.begin(), names.end(), joint);
      if (at == names.end()) {
        order.push_back(joint);
        at = names.end() - 1;
      }
      words_[c]->index = static_cast<int>(at - names.begin()) + 1;
    }
  }

  /// Headers that count from 0 count from 1 behind it.
  void number_indices() {
    std::map<const ColumnGroup*, std::pair<int, int>> range;  // least and most
    int most_from_zero = -1;
    for (std::size_t c = 0; c < words_.size(); ++c) {
      if (!has_joint(c) || !words_[c]->joint.empty() || words_[c]->from_one) continue;
      const int index = words_[c]->index;
      auto& [least, most] = range.try_emplace(words_[c]->group, index, index).first->second;
      least = std::min(least, index);
      most = std::max(most, index);
    }
    for (const auto& [group, span] : range) {
      if (span.first == 0) most_from_zero = std::max(most_from_zero, span.second);
    }
    for (std::size_t c = 0; c < words_.size(); ++c) {
      if (!has_joint(c) || !words_[c]->joint.empty() || words_[c]->from_one) continue;
      const auto& [least, most] = range[words_[c]->group];
      // A group that lacks its first joint is counted as the others are.
      if (least == 0 || (words_[c]->kind != NameKind::kHeft && most <= most_from_zero)) ++words_[c]->index;
    }
  }

  const ReadAs& as_;
  Words& words_;
};

/// libfranka's logToCSV counts milliseconds and does not say so.
bool is_libfranka(const std::vector<std::string>& headers) {
  const auto has = [&](std::string_view name) {
    return std::find(headers.begin(), headers.end(), name) != headers.end();
  };
  return has("success_rate") && has("state.q[0]");
}

/// A column of another topic than the one that was asked for.
bool is_of_other_topic(const std::string& header, const std::string& topic) {
  if (topic.empty()) return false;
  const auto plain = [](std::string_view text) { return text.starts_with('/') ? text.substr(1) : text; };
  return header.starts_with('/') && !plain(header).starts_with(plain(topic));
}

}  // namespace

double given_rate(const ReadAs& as, std::string_view where) {
  for (const auto& [ours, theirs] : as.map) {
    if (ours != "time") continue;
    const std::optional<double> rate = rate_in(theirs);
    if (!rate) continue;
    if (*rate > 0.0 && *rate <= 1e6) return *rate;
    throw DataError(fmt::format("{}--map time={}: expected rows a second above 0, such as 500Hz",
                                prefixed(where), shown(theirs)));
  }
  return 0.0;
}

std::vector<LogColumn> in_heft_words(const std::vector<std::string>& headers, const ReadAs& as,
                                     std::string_view where) {
  Words words;
  for (const std::string& header : headers) {
    words.push_back(is_of_other_topic(header, as.topic) ? std::nullopt
                                                        : words_of(header, as.joint_names, where));
    // A name without a joint is no column of a joint.
    if (words.back() && words.back()->group->quantity != Quantity::kTime && words.back()->index < 0 &&
        words.back()->joint.empty())
      words.back().reset();
  }
  Mapping(headers, as, where).apply(words);
  choose_time(headers, where, words);
  Joints(as, words).count();

  std::vector<LogColumn> columns;
  std::map<std::string, std::size_t> taken;
  for (std::size_t c = 0; c < headers.size(); ++c) {
    columns.push_back({headers[c], headers[c]});
    if (!words[c]) continue;
    const HeaderWords& meant = *words[c];
    std::string name(meant.group->name);
    if (meant.nanoseconds_part) {
      name = kNanosecondsPart;
    } else if (meant.group->quantity != Quantity::kTime) {
      name += fmt::format("{}", meant.index);
    }
    const auto [before, is_new] = taken.emplace(name, c);
    if (!is_new) refuse_two(where, headers[before->second], headers[c], name, meant.group->name);
    columns.back().name = name;
    if (meant.unit != nullptr) {
      columns.back().factor = meant.unit->factor;
      columns.back().shift = meant.unit->shift;
    } else if (name == "time" && is_libfranka(headers)) {
      columns.back().factor = 1e-3;
    }
  }
  // What keeps its name must not have one that another was given, nor one that only heft gives.
  taken.emplace(kNanosecondsPart, headers.size());
  for (std::size_t c = 0; c < headers.size(); ++c) {
    const auto other = taken.find(columns[c].name);
    if (other != taken.end() && other->second != c) columns[c].name = fmt::format("{} (unused)", headers[c]);
  }
  return columns;
}

void refuse_unused_map(const std::vector<LogColumn>& columns, const ReadAs& as, std::string_view where) {
  constexpr std::size_t kMostShown = 30;
  for (const auto& entry : as.map) {
    const std::string &ours = entry.first, &theirs = entry.second;
    if (ours == "time" && rate_in(theirs)) continue;
    const bool used = std::any_of(columns.begin(), columns.end(), [&](const LogColumn& column) {
      // Heft's name alone does not tell: the file may have such a column besides the one that was misspelt.
      const bool is_ours = column.name == ours || joint_number(column.name, ours) > 0;
      return is_ours && column.origin.find(theirs) != std::string::npos;
    });
    if (used) continue;
    std::string found;
    for (std::size_t c = 0; c < std::min(columns.size(), kMostShown); ++c)
      found += fmt::format("{}{}", c == 0 ? "" : ", ", shown(columns[c].origin));
    if (columns.size() > kMostShown) found += fmt::format(", ... ({} in all)", columns.size());
    throw DataError(
        fmt::format("{}--map {}={}: there is no column '{}'; found {}; name one of them, or a group of them "
                    "without the number of the joint",
                    prefixed(where), ours, theirs, shown(theirs), found));
  }
}

namespace {

/// Columns of one group, and how they are read.
struct ReadGroup {
  const LogColumn *first{nullptr}, *last{nullptr};
  bool renamed{false};
  std::string units{};  ///< "degrees and millimetres"
};

ReadGroup read_group(const std::vector<LogColumn>& columns, const ColumnGroup& group) {
  ReadGroup read;
  std::vector<std::string_view> units;
  for (const LogColumn& column : columns) {
    const bool is_time = group.quantity == Quantity::kTime;
    if (is_time ? column.name != "time" : joint_number(column.name, group.name) == 0) continue;
    if (read.first == nullptr) read.first = &column;
    read.last = &column;
    read.renamed = read.renamed || parts_of(column.origin).name != column.name;
    const std::string_view unit =
        unit_in_words(group.quantity, parts_of(column.origin).symbol, column.factor, column.shift);
    if (!unit.empty() && std::find(units.begin(), units.end(), unit) == units.end()) units.push_back(unit);
  }
  for (std::size_t k = 0; k < units.size(); ++k) {
    if (k > 0) read.units += k + 1 == units.size() ? " and " : ", ";
    read.units += units[k];
  }
  return read;
}

}  // namespace

std::string understood(const std::vector<LogColumn>& columns) {
  std::string from, units;
  for (const ColumnGroup& group : column_groups()) {
    const ReadGroup read = read_group(columns, group);
    if (read.first == nullptr) continue;
    if (read.renamed) {
      from += fmt::format("{}{} from {}", from.empty() ? "" : ", ", group.name, shown(read.first->origin));
      if (read.last != read.first) from += fmt::format(" to {}", shown(read.last->origin));
    }
    if (!read.units.empty())
      units += fmt::format("{}{} in {}", units.empty() ? "" : ", ", group.words, read.units);
  }
  if (!from.empty() && !units.empty()) from += "; ";
  return from + units;
}

}  // namespace heft::data
