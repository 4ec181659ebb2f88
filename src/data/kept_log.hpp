/// @file
/// A log file that is read once: what every later pass needs of it is kept.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "heft/data/differentiate.hpp"
#include "log_facts.hpp"
#include "log_file.hpp"
#include "row_store.hpp"
#include "row_times.hpp"

namespace heft::data {

/// Reads a log, checks every row and collects what a first pass does; rows of known columns are kept in a RowStore. Samples are
/// placed where the positions show that they were not taken when the stamps say; of the facts, the clock is theirs. Shared by the
/// streams of one log: what one has found out of the motion, another need not.
class KeptLog {
 public:
  /// @param compared  whether the log will be compared with others: its fingerprint is taken
  /// @throws DataError
  KeptLog(const std::string& path, const LogRequirements& needs, bool compared);

  const std::string& path() const { return path_; }
  const LogRequirements& needs() const { return needs_; }
  /// At its end and closed: columns and notes.
  const LogFile& file() const { return *file_; }
  const LogFacts& facts() const { return *facts_; }
  /// Gives away the fingerprint.
  LogFingerprint take_fingerprint() { return std::move(facts_->fingerprint); }

  /// The rows with these columns; null where they have to be read from the file: the file has changed since, a column was
  /// not kept, or there was no place for them.
  std::unique_ptr<RowSource> source(const std::vector<FileColumn>& columns) const;
  /// A pass over the file's rows, with the times of the samples instead of the stamps.
  std::unique_ptr<RowSource> placed(std::unique_ptr<RowSource> source) const;
  /// The same of a log that was read from the file.
  void place(Log& log) const;
  /// A line to tell about the time stamps; may be empty.
  std::string note_on_times() const;

  /// Time stamps and positions decide on these alone.
  struct Motion {
    std::optional<LogGrid> grid;
    std::optional<double> bandwidth;  ///< [Hz]
    struct Speeds {
      MotionOptions options;
      double cutoff{0.0};  ///< [Hz]
      std::vector<MovingSpan> spans;
    };
    std::vector<Speeds> speeds;
  };
  /// Calls `use` with what streams have found so far; one stream at a time.
  template <typename Use>
  void with_motion(const Use& use) const {
    const std::lock_guard<std::mutex> lock(guard_);
    use(motion_);
  }

 private:
  /// What shows that a file is still the same.
  struct Mark {
    bool is_file{false};
    std::uint64_t device{0}, number{0}, size{0};
    std::int64_t seconds{0}, nanoseconds{0};  ///< last change
    bool operator==(const Mark&) const = default;
  };
  static Mark mark_of(const std::string& path);
  void choose_columns();
  void read_rows(bool compared);
  void place_samples();

  std::string path_;
  LogRequirements needs_;
  Mark mark_;
  std::unique_ptr<LogFile> file_;
  std::vector<FileColumn> columns_;
  Eigen::Index joints_{0}, torques_{0}, rates_{0}, accelerations_{0};  ///< of the columns, in this order
  std::optional<LogFacts> facts_;
  std::optional<RowStore> rows_;
  std::optional<RowTimes> times_;
  mutable std::mutex guard_;
  mutable Motion motion_;
};

}  // namespace heft::data
