/// @file
/// Reading settings from JSON with messages that say where, what was found, what was expected and what to do.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace heft::host {

/// Which numbers a setting takes.
enum class Range { kAny, kNotNegative, kPositive, kPart };

/// A JSON object whose keys are asked for by name. What is asked for is known; finish() refuses the rest.
///
/// Every member throws ModelError with one message of the form
/// `arm.json: /friction/coulomb: found "high", expected one number or 6 numbers, at least 0; <advice>`.
class SettingsReader {
 public:
  /// Parses a file's text. @throws ModelError naming file, line and column when it is not a JSON object.
  static SettingsReader parse(std::string_view text, const std::string& file);

  /// Whether the key is there. Makes it a known key.
  bool has(const std::string& key) const;

  double number(const std::string& key, Range range = Range::kAny) const;
  double number_or(const std::string& key, double fallback, Range range = Range::kAny) const;
  /// A whole number from `lowest` to `highest`.
  long whole_number(const std::string& key, long lowest, long highest) const;
  bool flag_or(const std::string& key, bool fallback) const;
  std::string text(const std::string& key) const;
  /// One of the words allowed.
  std::string word(const std::string& key, const std::vector<std::string>& allowed) const;
  std::string word_or(const std::string& key, const std::string& fallback,
                      const std::vector<std::string>& allowed) const;
  /// `size` numbers; a single number means `size` equal ones. Size −1 takes an array of any length.
  Eigen::VectorXd numbers(const std::string& key, int size, Range range = Range::kAny) const;
  /// The same; size 0 when the key is missing.
  Eigen::VectorXd numbers_or_none(const std::string& key, int size, Range range = Range::kAny) const;
  /// An array of `rows` arrays of equal length. Rows −1 takes any number of them.
  Eigen::MatrixXd table(const std::string& key, int rows, int columns = -1) const;
  /// An object within this one; its own finish() has to be called.
  SettingsReader object(const std::string& key) const;
  /// An array of objects.
  std::vector<SettingsReader> objects(const std::string& key) const;
  /// Whether the value is a JSON string (some settings take a word or numbers).
  bool is_text(const std::string& key) const;

  /// Refuses keys that were never asked for, naming the nearest known one.
  void finish() const;

  /// Throws the message for a key. `found` empty prints the value itself.
  [[noreturn]] void refuse(const std::string& key, const std::string& found, const std::string& expected,
                           const std::string& advice) const;

  const std::string& file() const;

 private:
  struct Impl;
  explicit SettingsReader(std::shared_ptr<Impl> impl);
  std::shared_ptr<Impl> impl_;
};

}  // namespace heft::host
