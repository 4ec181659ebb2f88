#include "heft/host/settings_reader.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "heft/host/error.hpp"
#include "heft/host/words.hpp"
#include "json.hpp"

namespace heft::host {
namespace {

/// The value as given in the file, shortened.
std::string shown(const Json& value) {
  std::string text = value.dump(-1, ' ', false, Json::error_handler_t::replace);
  if (text.size() > 60) text = text.substr(0, 57) + "...";
  return text;
}

bool fits(double value, Range range) {
  if (!std::isfinite(value)) return false;
  switch (range) {
    case Range::kAny: return true;
    case Range::kNotNegative: return value >= 0.0;
    case Range::kPositive: return value > 0.0;
    case Range::kPart: return value >= 0.0 && value <= 1.0;
  }
  return false;
}

const char* bound(Range range) {
  switch (range) {
    case Range::kAny: return "";
    case Range::kNotNegative: return ", at least 0";
    case Range::kPositive: return ", greater than 0";
    case Range::kPart: return ", 0 to 1";
  }
  return "";
}

}  // namespace

struct SettingsReader::Impl {
  std::string file;
  std::string path;  ///< JSON pointer of this object, "" for the whole file
  Json value;
  std::set<std::string> known;

  const Json* find(const std::string& key) {
    known.insert(key);
    const auto it = value.find(key);
    return it == value.end() ? nullptr : &*it;
  }
};

SettingsReader::SettingsReader(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}

SettingsReader SettingsReader::parse(std::string_view text, const std::string& file) {
  auto impl = std::make_shared<Impl>();
  impl->file = file;
  impl->value = parse_json(text, file);
  if (!impl->value.is_object()) {
    throw ModelError(fmt::format("{}: found {}, expected a JSON object; put the settings in braces", file,
                                 shown(impl->value)));
  }
  return SettingsReader(impl);
}

bool SettingsReader::has(const std::string& key) const { return impl_->find(key) != nullptr; }

bool SettingsReader::is_text(const std::string& key) const {
  const Json* value = impl_->find(key);
  return value != nullptr && value->is_string();
}

void SettingsReader::refuse(const std::string& key, const std::string& found, const std::string& expected,
                            const std::string& advice) const {
  std::string what = found;
  if (what.empty()) {
    const Json* value = impl_->find(key);
    what = value == nullptr ? "nothing" : shown(*value);
  }
  throw ModelError(fmt::format("{}: {}/{}: found {}, expected {}; {}", impl_->file, impl_->path, key, what,
                               expected, advice));
}

double SettingsReader::number(const std::string& key, Range range) const {
  const Json* value = impl_->find(key);
  const std::string expected = fmt::format("a number{}", bound(range));
  if (value == nullptr) refuse(key, "", expected, "add the key");
  if (!value->is_number() || !fits(value->get<double>(), range))
    refuse(key, "", expected, "correct the value");
  return value->get<double>();
}

double SettingsReader::number_or(const std::string& key, double fallback, Range range) const {
  return has(key) ? number(key, range) : fallback;
}

long SettingsReader::whole_number(const std::string& key, long lowest, long highest) const {
  const Json* value = impl_->find(key);
  const std::string expected = fmt::format("a whole number from {} to {}", lowest, highest);
  if (value == nullptr) refuse(key, "", expected, "add the key");
  if (!value->is_number_integer() || value->get<double>() < static_cast<double>(lowest) ||
      value->get<double>() > static_cast<double>(highest)) {
    refuse(key, "", expected, "correct the value");
  }
  return value->get<long>();
}

bool SettingsReader::flag_or(const std::string& key, bool fallback) const {
  const Json* value = impl_->find(key);
  if (value == nullptr) return fallback;
  if (!value->is_boolean()) refuse(key, "", "true or false", "correct the value");
  return value->get<bool>();
}

std::string SettingsReader::text(const std::string& key) const {
  const Json* value = impl_->find(key);
  if (value == nullptr) refuse(key, "", "a text in quotes", "add the key");
  if (!value->is_string() || value->get<std::string>().empty()) {
    refuse(key, "", "a text in quotes", "correct the value");
  }
  return value->get<std::string>();
}

std::string SettingsReader::word(const std::string& key, const std::vector<std::string>& allowed) const {
  const Json* value = impl_->find(key);
  const std::string expected = fmt::format("one of \"{}\"", fmt::join(allowed, "\", \""));
  if (value == nullptr) refuse(key, "", expected, "add the key");
  if (!value->is_string() ||
      std::find(allowed.begin(), allowed.end(), value->get<std::string>()) == allowed.end()) {
    refuse(key, "", expected, "choose one of them");
  }
  return value->get<std::string>();
}

std::string SettingsReader::word_or(const std::string& key, const std::string& fallback,
                                    const std::vector<std::string>& allowed) const {
  return has(key) ? word(key, allowed) : fallback;
}

Eigen::VectorXd SettingsReader::numbers(const std::string& key, int size, Range range) const {
  const Json* value = impl_->find(key);
  const std::string expected = size < 0 ? fmt::format("an array of numbers{}", bound(range))
                                        : fmt::format("one number or an array of {}{}", size, bound(range));
  if (value == nullptr) refuse(key, "", expected, "add the key");
  if (size >= 0 && value->is_number()) {
    if (!fits(value->get<double>(), range)) refuse(key, "", expected, "correct the value");
    return Eigen::VectorXd::Constant(size, value->get<double>());
  }
  if (!value->is_array()) refuse(key, "", expected, "correct the value");
  if (size >= 0 && value->size() != static_cast<std::size_t>(size)) {
    refuse(key, fmt::format("{} values", value->size()), expected, "give one value for each");
  }
  Eigen::VectorXd result(static_cast<Eigen::Index>(value->size()));
  for (std::size_t i = 0; i < value->size(); ++i) {
    const Json& entry = (*value)[i];
    if (!entry.is_number() || !fits(entry.get<double>(), range)) {
      refuse(fmt::format("{}/{}", key, i), shown(entry), fmt::format("a number{}", bound(range)),
             "correct the value");
    }
    result[static_cast<Eigen::Index>(i)] = entry.get<double>();
  }
  return result;
}

Eigen::VectorXd SettingsReader::numbers_or_none(const std::string& key, int size, Range range) const {
  return has(key) ? numbers(key, size, range) : Eigen::VectorXd();
}

Eigen::MatrixXd SettingsReader::table(const std::string& key, int rows, int columns) const {
  const Json* value = impl_->find(key);
  const std::string expected =
      fmt::format("an array of {}arrays of {}", rows < 0 ? "" : fmt::format("{} ", rows),
                  columns < 0 ? "as many numbers each" : fmt::format("{} numbers", columns));
  if (value == nullptr) refuse(key, "", expected, "add the key");
  if (!value->is_array() || value->empty()) refuse(key, "", expected, "correct the value");
  if (rows >= 0 && value->size() != static_cast<std::size_t>(rows)) {
    refuse(key, fmt::format("{} rows", value->size()), expected, "give one row for each");
  }
  for (std::size_t i = 0; i < value->size(); ++i) {
    const Json& row = (*value)[i];
    if (!row.is_array() || row.empty())
      refuse(fmt::format("{}/{}", key, i), shown(row), expected, "correct the row");
    const std::size_t width = columns >= 0 ? static_cast<std::size_t>(columns) : value->front().size();
    if (row.size() != width) {
      refuse(fmt::format("{}/{}", key, i), fmt::format("{} values", row.size()),
             fmt::format("{} numbers", width), "give each row as many");
    }
  }
  Eigen::MatrixXd result(static_cast<Eigen::Index>(value->size()),
                         static_cast<Eigen::Index>(value->front().size()));
  for (std::size_t i = 0; i < value->size(); ++i) {
    for (std::size_t k = 0; k < (*value)[i].size(); ++k) {
      const Json& entry = (*value)[i][k];
      if (!entry.is_number() || !std::isfinite(entry.get<double>())) {
        refuse(fmt::format("{}/{}/{}", key, i, k), shown(entry), "a number", "correct the value");
      }
      result(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) = entry.get<double>();
    }
  }
  return result;
}

SettingsReader SettingsReader::object(const std::string& key) const {
  const Json* value = impl_->find(key);
  if (value == nullptr || !value->is_object()) {
    refuse(key, "", "an object in braces", value == nullptr ? "add the key" : "correct the value");
  }
  auto impl = std::make_shared<Impl>();
  impl->file = impl_->file;
  impl->path = fmt::format("{}/{}", impl_->path, key);
  impl->value = *value;
  return SettingsReader(impl);
}

std::vector<SettingsReader> SettingsReader::objects(const std::string& key) const {
  const Json* value = impl_->find(key);
  if (value == nullptr || !value->is_array()) {
    refuse(key, "", "an array of objects",
           value == nullptr ? "add the key" : "put the objects in square brackets");
  }
  std::vector<SettingsReader> result;
  for (std::size_t i = 0; i < value->size(); ++i) {
    const Json& entry = (*value)[i];
    if (!entry.is_object()) {
      refuse(fmt::format("{}/{}", key, i), shown(entry), "an object in braces", "correct the entry");
    }
    auto impl = std::make_shared<Impl>();
    impl->file = impl_->file;
    impl->path = fmt::format("{}/{}/{}", impl_->path, key, i);
    impl->value = entry;
    result.push_back(SettingsReader(impl));
  }
  return result;
}

void SettingsReader::finish() const {
  for (const auto& [key, value] : impl_->value.items()) {
    if (impl_->known.count(key) > 0) continue;
    std::string nearest;
    std::size_t best = std::string::npos;
    for (const std::string& known : impl_->known) {
      const std::size_t distance = edit_distance(key, known);
      if (distance < best) {
        best = distance;
        nearest = known;
      }
    }
    const std::string advice = best <= std::max<std::size_t>(2, key.size() / 2)
                                   ? fmt::format("did you mean \"{}\"?", nearest)
                                   : fmt::format("remove it (nearest known key: \"{}\")", nearest);
    refuse(key, "an unknown key", fmt::format("one of {}", fmt::join(impl_->known, ", ")), advice);
  }
}

const std::string& SettingsReader::file() const { return impl_->file; }

}  // namespace heft::host
