/// @file
/// Reading and writing JSON: for the rooms that read or write it themselves, with the type of the JSON library.
#pragma once

#include <array>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "heft/host/error.hpp"
#include "heft/host/numbers.hpp"

namespace heft::host {

/// Keys keep the order of the file.
using Json = nlohmann::ordered_json;

/// JSON has neither NaN nor infinity: null is written for both.
inline Json number_or_null(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

/// Numbers, null for those that are not finite.
inline Json json_array(const Eigen::Ref<const Eigen::VectorXd>& values) {
  Json array = Json::array();
  for (const double value : values) array.push_back(number_or_null(value));
  return array;
}

/// The value of a JSON text; comments as in C are left out.
/// @param file  named in messages
/// @throws ModelError naming file, line and column of what is not JSON, is nested too deeply or too large
Json parse_json(std::string_view text, const std::string& file);

/// A JSON value that knows its path, so that every complaint names file and path.
class JsonValue {
 public:
  JsonValue(const Json& json, std::string file, std::string path)
      : json_(&json), file_(std::move(file)), path_(std::move(path)) {}

  [[noreturn]] void fail(const std::string& found, const std::string& expected) const {
    throw ModelError(
        fmt::format("{}: {}: {}; expected {}", file_, path_.empty() ? "/" : path_, found, expected));
  }
  bool has(const char* key) const { return json_->is_object() && json_->contains(key); }
  JsonValue at(const char* key, const std::string& expected) const {
    expect_object();
    if (!json_->contains(key)) {
      throw ModelError(fmt::format("{}: {}/{}: missing; expected {}", file_, path_, key, expected));
    }
    return {(*json_)[key], file_, path_ + "/" + key};
  }
  JsonValue at(std::size_t index) const {
    return {(*json_)[index], file_, fmt::format("{}/{}", path_, index)};
  }
  std::size_t array_size(const std::string& expected) const {
    if (!json_->is_array()) fail(fmt::format("found {}", json_->type_name()), expected);
    return json_->size();
  }
  void expect_size(std::size_t size, const std::string& expected) const {
    if (const std::size_t found = array_size(expected); found != size) {
      fail(fmt::format("found {} entries", found), expected);
    }
  }
  void expect_object() const {
    if (!json_->is_object()) fail(fmt::format("found {}", json_->type_name()), "an object");
  }
  double number(bool null_is_nan = false) const {
    if (null_is_nan && json_->is_null()) return kNaN;
    if (!json_->is_number()) fail(fmt::format("found {}", json_->dump()), "a number");
    const double value = json_->get<double>();
    if (!std::isfinite(value)) fail("found a number too large for double precision", "a finite number");
    return value;
  }
  double number_or_zero(const char* key) const { return has(key) ? at(key, "a number").number() : 0.0; }
  /// null means `fallback`, and so does a missing key.
  double number_or(const char* key, double fallback) const {
    if (!has(key)) return fallback;
    const double value = at(key, "a number or null").number(true);
    return std::isnan(value) ? fallback : value;
  }
  bool flag_or(const char* key, bool fallback) const {
    if (!has(key)) return fallback;
    const JsonValue node = at(key, "true or false");
    if (!node.json_->is_boolean()) node.fail(fmt::format("found {}", node.json_->dump()), "true or false");
    return node.json_->get<bool>();
  }
  template <std::size_t kSize>
  std::array<double, kSize> numbers(const char* key) const {
    const std::string expected = fmt::format("{} numbers", kSize);
    const JsonValue list = at(key, expected);
    list.expect_size(kSize, expected);
    std::array<double, kSize> values{};
    for (std::size_t i = 0; i < kSize; ++i) values[i] = list.at(i).number();
    return values;
  }
  /// A joint that counts from 1; returned counted from 0.
  int joint(const char* key, std::size_t num_joints) const {
    const std::string expected = fmt::format("a joint, 1 to {}", num_joints);
    const JsonValue node = at(key, expected);
    if (!node.json_->is_number()) node.fail(fmt::format("found {}", node.json_->dump()), expected);
    const double value = node.number();
    if (value != std::floor(value) || value < 1 || value > static_cast<double>(num_joints)) {
      node.fail(fmt::format("found {}", value), expected);
    }
    return static_cast<int>(value) - 1;
  }
  /// Size 0 when the key is missing; null is NaN.
  Eigen::VectorXd numbers_or_none(const char* key, std::size_t size) const {
    if (!has(key)) return {};
    const std::string expected = fmt::format("{} numbers, one a joint", size);
    const JsonValue list = at(key, expected);
    list.expect_size(size, expected);
    Eigen::VectorXd values(static_cast<Eigen::Index>(size));
    for (std::size_t i = 0; i < size; ++i) values[static_cast<Eigen::Index>(i)] = list.at(i).number(true);
    return values;
  }
  std::string text() const {
    if (!json_->is_string()) fail(fmt::format("found {}", json_->dump()), "a text");
    return json_->get<std::string>();
  }
  bool is_null() const { return json_->is_null(); }
  std::string text_or_empty(const char* key) const {
    return has(key) ? at(key, "a text").text() : std::string{};
  }
  std::vector<std::string> texts_or_empty(const char* key) const {
    std::vector<std::string> texts;
    if (!has(key)) return texts;
    const JsonValue list = at(key, "a list of texts");
    for (std::size_t k = 0; k < list.array_size("a list of texts"); ++k) texts.push_back(list.at(k).text());
    return texts;
  }

 private:
  const Json* json_;
  std::string file_;
  std::string path_;
};

}  // namespace heft::host
