// See test/ros2/stub/README.md.
#pragma once

#include <cstdio>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

namespace rclcpp {

class Time {};

class Duration {
 public:
  explicit Duration(double seconds) : seconds_(seconds) {}
  double seconds() const { return seconds_; }

 private:
  double seconds_;
};

class Logger {};

class Parameter {
 public:
  using Value =
      std::variant<std::monostate, bool, std::string, std::vector<std::string>, std::vector<double>>;
  Parameter() = default;
  explicit Parameter(Value value) : value_(std::move(value)) {}
  bool as_bool() const { return std::get<bool>(value_); }
  std::string as_string() const { return std::get<std::string>(value_); }
  std::vector<std::string> as_string_array() const { return std::get<std::vector<std::string>>(value_); }
  std::vector<double> as_double_array() const { return std::get<std::vector<double>>(value_); }
  template <typename T>
  T get_value() const {
    return std::get<T>(value_);
  }

 private:
  Value value_;
};

}  // namespace rclcpp

// The last one is kept for the test.
namespace stub {
inline std::string& last_error() {
  static std::string text;
  return text;
}
}  // namespace stub

#define RCLCPP_ERROR(logger, ...)                  \
  do {                                             \
    static_cast<void>(logger);                     \
    char text[2000];                               \
    std::snprintf(text, sizeof text, __VA_ARGS__); \
    stub::last_error() = text;                     \
  } while (false)
