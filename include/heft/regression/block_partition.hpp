/// @file
/// Which rows of the logs form a block.
#pragma once

#include <algorithm>
#include <cmath>
#include <compare>

namespace heft::regression {

/// Rows in blocks: stretches of a log, coarser ones whole logs, still coarser ones several logs together.
///
/// Every level's blocks are made of whole blocks of the level before. The finest level at which some rows form no more
/// than a given number of blocks so depends on the rows alone, not on the order in which they came or on which of them
/// were counted together before.
class BlockPartition {
 public:
  /// A block: its log, or what its logs have in common, and its number within the log.
  struct Key {
    long log{0};
    long index{0};
    auto operator<=>(const Key&) const = default;
  };

  /// @param first  length of a block at level 0 [s]; each level doubles it
  explicit BlockPartition(double first) : first_(first), length_(first) {}

  int level() const { return level_; }
  bool is_coarsest() const { return level_ == kWholeLogs + kLogBits; }
  /// Blocks are whole logs, or several of them.
  bool has_whole_logs() const { return level_ >= kWholeLogs; }
  double first_length() const { return first_; }
  /// Present length [s]; of whole logs without meaning.
  double length() const { return length_; }
  /// Begin of a block within its log [s]; 0 for whole logs.
  double begin_of(const Key& key) const {
    return has_whole_logs() ? 0.0 : static_cast<double>(key.index) * length_;
  }
  Key key_of(long log, double time) const {
    return has_whole_logs() ? Key{group_of(log), 0} : Key{log, static_cast<long>(std::floor(time / length_))};
  }
  /// To the next level.
  void coarsen() {
    ++level_;
    if (!has_whole_logs()) length_ *= 2.0;
  }
  /// The block of this level that holds a block of the level before.
  Key coarser(const Key& key) const {
    if (has_whole_logs()) return {group_of(key.log), 0};
    return {key.log, key.index >= 0 ? key.index / 2 : (key.index - 1) / 2};
  }

 private:
  /// Doublings of the length: from 0.5 s to 97 days. Time stamps that count from 1970 merge as well.
  static constexpr int kWholeLogs = 25;
  static constexpr int kLogBits = 62;
  /// Logs whose numbers agree in the lower bits, one bit fewer each level. Numbers in sequence and hashes both give
  /// groups of similar size.
  long group_of(long log) const {
    return log & ((1L << std::clamp(kWholeLogs + kLogBits - level_, 0, kLogBits)) - 1L);
  }

  double first_, length_;
  int level_{0};
};

}  // namespace heft::regression
